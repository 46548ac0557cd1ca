#!/usr/bin/python3
"""Checks the links of pages: relative links must lead to a file and, after #, to a heading in it; `paths` in pages must
exist, except in CHANGELOG.md. Pages named in sources must exist, too:

    check_links.py [ROOT]     ROOT: the project (default: the project with this script)

Prints dead links as file:line and exits with 1 if there are any. Addresses with a scheme (https:) are not checked.
"""

import re
import sys
from pathlib import Path
from urllib.parse import unquote

FOLDERS = ("docs", "src", "apps", "tests", "examples", "benchmarks", "python", "scripts", "validation", ".github")
SOURCES = (".h", ".cpp", ".c", ".py", ".sh", ".cmake", ".yaml", ".txt", ".csv")
LINK = re.compile(r"\]\(\s*<?((?:[^()\s<>]|\([^()\s]*\))+)>?(?:\s+\"[^\"]*\")?\s*\)|<(?:img|a)\b[^>]*?\b(?:src|href)=\"([^\"]+)\"")
NAMED = re.compile(rf"`((?:{'|'.join(map(re.escape, FOLDERS[:-1]))})/[\w./-]+)`")
MENTION = re.compile(r"(?<![\w/.-])(?:docs/[\w/.-]*\.(?:md|png|svg)|(?:README|ARCHITECTURE|CONTRIBUTING|CHANGELOG)\.md)\b")


def without_code(text):
    """The text of a page; code is blank."""
    blank = lambda found: re.sub(r"[^\n]", " ", found[0])  # noqa: E731
    text = re.sub(r"^(```|~~~).*?^\1[^\n]*$", blank, text, flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"(`+)(?!`)[^\n]+?(?<!`)\1(?!`)", blank, text)


def anchors(path):
    """The names that GitHub gives to the headings of a page."""
    names, text = set(), path.read_text(encoding="utf-8")
    text = re.sub(r"^(```|~~~).*?^\1[^\n]*$", "", text, flags=re.DOTALL | re.MULTILINE)
    names.update(re.findall(r"<a (?:name|id)=\"([^\"]+)\"", text))
    for heading in re.findall(r"^#{1,6}\s+(.+?)\s*#*$", text, flags=re.MULTILINE):
        heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        name = re.sub(r"[^\w\- ]", "", re.sub(r"<[^>]*>|[`*]", "", heading).lower()).replace(" ", "-")
        unique, count = name, 0
        while unique in names:
            count += 1
            unique = f"{name}-{count}"
        names.add(unique)
    return names


def check(root):
    """The dead links below root, as lines of text."""
    dead, known = [], {}
    pages = sorted([*root.glob("*.md"), *(path for folder in FOLDERS for path in (root / folder).rglob("*.md"))])
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for found in NAMED.finditer(text):
            if page.name != "CHANGELOG.md" and not (root / found[1]).exists():
                line = text.count("\n", 0, found.start()) + 1
                dead.append(f"{page.relative_to(root).as_posix()}:{line}: {found[1]} does not exist")
        text = without_code(text)
        for found in LINK.finditer(text):
            address = found[1] or found[2]
            if re.match(r"[a-z][a-z0-9+.-]*:", address, re.IGNORECASE):
                continue
            name, _, anchor = unquote(address).partition("#")
            target = (page.parent / name).resolve() if name else page
            place = f"{page.relative_to(root).as_posix()}:{text.count(chr(10), 0, found.start()) + 1}"
            if not target.exists():
                dead.append(f"{place}: {address} does not exist")
            elif target.is_dir() and not name.endswith("examples/gallery"):  # the site has pages of the gallery
                dead.append(f"{place}: {address} is a folder, and the site has no page for it")
            elif anchor and target.suffix == ".md":
                if target not in known:
                    known[target] = anchors(target)
                if anchor not in known[target]:
                    dead.append(f"{place}: {name or page.name} has no heading #{anchor}")
    sources = sorted(path for folder in FOLDERS for path in (root / folder).rglob("*")
                     if (path.suffix in SOURCES or path.parent.name == "python") and path.is_file())
    moved = {f"docs/{page.name}" for page in pages}  # found by its name in a folder of docs/
    for source in sources:
        if source.name in ("check_links.py", "test_check_links.py", "test_check_words.py"):
            continue  # their own names and examples
        for number, line in enumerate(source.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
            for found in MENTION.finditer(line):
                name = found[0]  # a README can also lie next to the source
                if not ((root / name).exists() or (source.parent / name).exists() or name in moved):
                    dead.append(f"{source.relative_to(root).as_posix()}:{number}: {name} does not exist")
    if not pages:
        dead.append(f"{root}: no pages")
    return dead


def main():
    root = Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else Path(__file__).resolve().parents[1]
    dead = check(root)
    print(*dead, sep="\n", end="\n" if dead else "")
    return 1 if dead else 0


if __name__ == "__main__":
    sys.exit(main())
