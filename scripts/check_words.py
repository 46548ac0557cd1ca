#!/usr/bin/python3
"""Checks the wording of pages, comments and messages against the rules of CONTRIBUTING.md ("Plain words"):

    check_words.py                     all files; exit code 1 if a group is above a ceiling of CEILINGS
    check_words.py --list [FILE...]    each finding as file:line, with its replacement
    check_words.py FILE...             counts of these files, without ceilings

The counts are "what": this word, per 1000 words. "subject": sentences that begin with a pronoun instead of a
noun, per 1000 words. "word": words and constructions of WORDS, per 1000 words. Code (blocks, `inline`) is not counted, nor
are quoted output, addresses of links and docs/reference/options.md, which is made from the help texts.
"""

import argparse
import bisect
import re
import sys
from collections import Counter
from pathlib import Path

from cpp_source import TOKEN

#: Group: highest number per 1000 words. Ceilings only go down; the goal for "what" in pages and comments is 1.
CEILINGS = {
    "pages": {"what": 0.05, "subject": 0.1, "word": 0.2},
    "comments": {"what": 0.1, "subject": 0.4, "word": 0.4},
    "messages": {"what": 0.3, "subject": 1.6, "word": 1.9},
}

#: (regular expression, replacement). Words that have another sense as well are only listed where the sense is clear.
WORDS = [
    # one word per concept
    (r"puts? back|putting back|putback", "reinsert(ed)"),
    (r"(take|takes|taken|taking|took) out", "reinsert, remove"),
    (r"(go|goes|going|gone|went) on", "restart, resume, continue"),
    (r"balls?", "sphere"),
    (r"disks? in space", "sphere"),
    (r"within reach|reach(es|ing)? beyond", "within the cutoff, contact distance"),
    (r"(with|on|over|under|above) (a|the|their|its) base|base friction", "substrate"),
    (r"friction with (a|the) table|on a table\b(?! of)", "substrate"),
    (r"kept of|is to be kept", "contact history: current, next"),
    (r"rubs?|rubbing", "has friction"),
    (r"ma(k|d)es? energy|make energy|made energy", "unstable step, energy grows"),
    (r"look(s|ed|ing)? at|a look", "check(ed)"),
    (r"overrul\w+", "overrides"),
    (r"of no account", "undefined"),
    (r"beside", "next to, compared with, besides"),
    (r"anew", "again, rebuilt"),
    (r"rooms?", "gap, space"),
    (r"plungers push", "disks pushed by plungers"),
    (r"led by hand", "moved along a prescribed path"),
    # constructions
    (r"(that|those|the same) of", "repeat the noun"),
    (r"the ones?(?= (that|which|who|to|of|in|with)\b)", "repeat the noun"),
    (r"whatever|whoever|whichever", "any + noun"),
    (r"who (owns|has|holds|gets|keeps|reads|calls|writes)|who is|who are", "the owning rank, the caller, the reader"),
    (r"(says|asks|knows|speaks|tells|speak of|speaks of|said of)", "states, returns, takes, contains"),
    (r"nobody|somebody|somewhere else", "name the thing"),
    (r"an own|one's own|of one's own", "user-defined; or name the owner"),
    (r"(?<!there\s)(is|are|was|were) no (?!longer|more than|less than|other than|fewer than)(?=[a-z])", "is not a"),
    (r"(?<!there\s)(is|are|was|were|has|have|had) (?-i:none)", "repeat the noun"),
    (r"(that|which) (is|are|was|were) left", "remaining"),
    (r"(to|of|for) the whole of|the whole of", "all, full"),
    (r"things?", "name the thing"),
    (r"others than|an other", "different from"),
    (r"of which the", "whose"),
    (r"beforehand|thereof|therein|whereof|wherein|hereby", "before, of it, in it"),
]
NESTED = re.compile(r"\([^()]*[a-z]{2} [^()]*\([^()]*[a-z]{2} [^()]*\)")
_WORDS = [(re.compile(rf"\b(?:{pattern})\b".replace(" ", r"\s+"), re.IGNORECASE), instead) for pattern, instead in WORDS]

VERBS = """is are was were be has have had does do did can could may might must shall should will would makes make takes take
gives give needs need holds hold keeps keep means mean finds find costs cost adds add goes go comes come tells tell says say
asks ask knows know lets let leaves leave stays stay ends end happens happen depends depend changes change follows follow
works work avoids avoid allows allow ensures ensure includes include excludes exclude requires require returns return
replaces replace sets runs run reads writes write prints computes compute counts prevents prevent guarantees describes
applies apply covers cover contains contain differs differ appears appear shows show saves save shares share tests
only also then never always alone not""".split()
_VERB = "|".join(VERBS)
_AFTER_THOSE = "of|that|which|who|whose|with|without|in|from|to|for|at|on|beside|between"
SUBJECT = re.compile(
    rf"(?:what|whatever|whoever|whose|who|which)\b|(?:this|that|these|those) (?:{_VERB})\b"
    rf"|(?:those|that) (?:{_AFTER_THOSE})\b|it\b|(?:of|by which|from which|to which|in which) (?!course)[^,]*$",
    re.IGNORECASE)
SENTENCE = re.compile(r"(?<=[.!?:])[\s*_\"]+(?=[^\W\d_]|`)")
WORD = re.compile(r"[^\W\d_][\w'’-]*")
WHAT = re.compile(r"\bwhat\b", re.IGNORECASE)


class Block:
    """A piece of prose (paragraph, comment, string), with the line of each of its characters."""

    def __init__(self, line, text):
        self.line, self.text = line, text

    def at(self, offset):
        return self.line + self.text.count("\n", 0, offset)


def blank(text):
    """Blanks of the same number, with the same lines."""
    return re.sub(r"[^\n]", " ", text)


def code(text):
    """A word instead of code."""
    return re.sub(r"[^\n]", "x", text)


def markdown(text):
    """The blocks of a page."""
    text = re.sub(r"<!--.*?-->", lambda m: blank(m[0]), text, flags=re.DOTALL)
    text = re.sub(r"^(```|~~~).*?^\1[^\n]*$", lambda m: blank(m[0]), text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"(`+)(?!`).+?(?<!`)\1(?!`)", lambda m: code(m[0]), text, flags=re.DOTALL)
    text = re.sub(r"\[[\w./-]+\.(md|h|cpp|py|yaml|cff)(?=\]\()", lambda m: code(m[0]), text)
    text = re.sub(r"\]\(([^()\s]|\([^()]*\))*\)", lambda m: " " * len(m[0]), text)
    text = re.sub(r"\[(?=[^\]]*\])|<[^<>\n]{1,80}>|\*\*|https?://\S+", lambda m: " " * len(m[0]), text)
    lines, blocks, start, paragraph = text.split("\n"), [], 0, []

    def flush():
        if paragraph:
            blocks.append(Block(start, "\n".join(paragraph)))
            paragraph.clear()

    before_blank, in_list = True, False
    for number, line in enumerate(lines, 1):
        stripped = line.strip()
        if not stripped:
            flush()
            before_blank = True
            continue
        item = re.match(r"\s*([-*+]|\d+\.)\s", line)
        in_list = bool(item) or (in_list and (line.startswith(" ") or not before_blank))
        if before_blank and not in_list and (line.startswith("    ") or line.startswith("\t")):
            continue  # a code block: its lines stay "before_blank"
        if stripped.startswith(">"):  # quoted output
            flush()
            continue
        if stripped.startswith("|"):
            flush()
            blocks.extend(Block(number, cell) for cell in stripped.split("|") if WORD.search(cell))
        elif stripped.startswith("#"):
            flush()
            blocks.append(Block(number, stripped.lstrip("# ")))
        else:
            if item:
                flush()
                line = line[item.end():]
            if not paragraph:
                start = number
            paragraph.append(line.strip())
        before_blank = False
    flush()
    return blocks


PYTHON = re.compile(
    r'(?P<line>#[^\n]*)|(?P<prefix>\b[rRbBfFuU]{1,2})?(?:(?P<quote>"""|\'\'\')(?P<long>(?:[^\\]|\\.)*?)(?P=quote)'
    r'|"(?P<string>(?:[^"\\\n]|\\.)*)"|\'(?P<single>(?:[^\'\\\n]|\\.)*)\')', re.DOTALL)


class Lines:
    """Line numbers of offsets."""

    def __init__(self, text):
        self.starts = [m.end() for m in re.finditer("\n", text)]

    def __call__(self, offset):
        return bisect.bisect_right(self.starts, offset) + 1


def join_comments(parts):
    """Blocks of line comments (line, column is alone, text): comments in consecutive lines are one block."""
    blocks, last = [], None
    for line, alone, text in parts:
        if blocks and alone and line == last + 1 and text.strip():
            blocks[-1].text += "\n" + text
        elif text.strip():
            blocks.append(Block(line, text))
        last = line if alone and text.strip() else -1
    return blocks


def clean_comment(text):
    text = re.sub(r"```.*?```", lambda m: blank(m[0]), text, flags=re.DOTALL)
    text = re.sub(r"`[^`\n]+`", lambda m: code(m[0]), text)
    return re.sub(r"NOLINT\w*(\([^)]*\))?:?|noqa: \w+|https?://\S+", lambda m: " " * len(m[0]), text)


def is_prose(text):
    return len(WORD.findall(text)) >= 3 and " " in text


def cpp(text, messages):
    """(comments, strings) of a C++ file; strings that follow each other are one."""
    line_of, comments, strings, end = Lines(text), [], [], None
    for found in TOKEN.finditer(text):
        kind = found.lastgroup
        line = line_of(found.start())
        if kind == "line":
            body = re.sub(r"^//+[!<]*", lambda m: " " * len(m[0]), found[0])
            begin = text.rfind("\n", 0, found.start()) + 1
            comments.append((line, not text[begin:found.start()].strip(), body))
        elif kind == "block":
            comments.append((line, False, re.sub(r"^/\*+<?|\*/$|^\s*\*", lambda m: blank(m[0]), found[0], flags=re.MULTILINE)))
        elif messages and (found["string"] is not None or found["raw"] is not None):
            body = found["string"] if found["string"] is not None else found["raw"]
            if text[text.rfind("\n", 0, found.start()) + 1:found.start()].lstrip().startswith("#"):
                continue  # include
            if strings and end is not None and not text[end:found.start()].strip():
                lines = line - strings[-1].at(len(strings[-1].text))
                strings[-1].text += "\n" * lines + body
            else:
                strings.append(Block(line, body))
            end = found.end()
    return join_comments(comments), [string for string in strings if is_prose(string.text)]


def python(text, messages):
    """(comments and docstrings, other strings) of a Python file."""
    line_of, comments, docs, strings = Lines(text), [], [], []
    for found in PYTHON.finditer(text):
        line = line_of(found.start())
        begin = text.rfind("\n", 0, found.start()) + 1
        alone = not text[begin:found.start()].strip()
        if found["line"] is not None:
            if not (line == 1 and found[0].startswith("#!")):
                comments.append((line, alone, re.sub(r"^#+:?", lambda m: " " * len(m[0]), found[0])))
        elif found["quote"] is not None:
            (docs if alone else strings).append(Block(line, found["long"]))
        elif messages:
            body = found["string"] if found["string"] is not None else found["single"]
            strings.append(Block(line, body))
    docs = [part for block in docs for part in markdown_of(block)]
    return join_comments(comments) + docs, [string for string in strings if messages and is_prose(string.text)]


def markdown_of(block):
    """The paragraphs of a docstring; indented lines after an empty one are code."""
    blocks = []
    for part in markdown(re.sub(r"\n    ", "\n", block.text)):
        part.line += block.line - 1
        blocks.append(part)
    return blocks


def shell(text):
    """The comments of a shell script, CMake or YAML file."""
    parts = []
    for number, line in enumerate(text.split("\n"), 1):
        found = re.search(r"(?:^|(?<=\s))#+(?![!{\w])", line)
        if found:
            parts.append((number, not line[:found.start()].strip(), line[found.end():]))
    return join_comments(parts)


def sources(root):
    """All files with words."""
    for pattern in ("*.md", *(f"{folder}/**/*.md" for folder in ("docs", "src", "tests", "validation", "examples", ".github"))):
        yield from (path for path in root.glob(pattern) if path.name != "options.md")
    for folder in ("src", "apps", "tests", "examples", "benchmarks", "python", "scripts", "cmake"):
        for path in (root / folder).rglob("*"):
            if path.suffix in (".h", ".cpp", ".c", ".py", ".sh", ".cmake", ".yaml") or path.name == "CMakeLists.txt" or (
                    path.parent.name == "python" and path.name.startswith("pliant-")):
                yield path
    if (root / "CMakeLists.txt").is_file():
        yield root / "CMakeLists.txt"


def read(path, root):
    """{group: blocks} of a file."""
    if not path.is_file():
        return {}
    text = path.read_text(encoding="utf-8")
    top = path.relative_to(root).parts[0] if path.is_relative_to(root) else ""
    if path.suffix == ".md":
        return {"pages": markdown(text)}
    if path.suffix in (".h", ".cpp", ".c"):
        comments, strings = cpp(text, messages=top in ("src", "apps"))
    elif path.suffix == ".py" or path.name.startswith("pliant-"):
        comments, strings = python(text, messages=top == "python" and "tests" not in path.parts)
    else:
        comments, strings = shell(text), []
    if path == Path(__file__).resolve():
        strings = []
    for block in comments:
        block.text = clean_comment(block.text)
    for block in strings:
        block.text = re.sub(r"\\[ntr\"]|`[^`\n]+`", lambda m: " " * len(m[0]), block.text)
    return {"comments": comments, "messages": strings}


def findings(block):
    """(line, kind, text, replacement) in a block."""
    text = block.text
    for found in WHAT.finditer(text):
        yield block.at(found.start()), "what", text[found.start():found.start() + 40], "name the subject or object"
    for pattern, instead in _WORDS:
        for found in pattern.finditer(text):
            yield block.at(found.start()), "word", found[0], instead
    for found in NESTED.finditer(text):
        yield block.at(found.start()), "word", found[0][:60], "no brackets in brackets"
    start = 0
    for end in [*(found.end() for found in SENTENCE.finditer(text)), len(text)]:
        sentence = text[start:end]
        first = sentence.lstrip(" \n*_\"(")
        if (found := SUBJECT.match(first.rstrip())) and not sentence.rstrip().endswith("?"):
            offset = start + len(sentence) - len(first)
            yield block.at(offset), "subject", first[:40], "name the subject"
        elif sentence.count(";") > 1 and len(WORD.findall(sentence)) > 25:
            yield block.at(start), "word", first[:40], "two semicolons: two sentences or a table"
        start = end


def check(root, paths=None):
    """(counts {(group, path): Counter with "words"}, list of (path, line, group, kind, text, replacement))."""
    counts, found = {}, []
    for path in sorted(set(paths or sources(root))):
        name = path.relative_to(root).as_posix() if path.is_relative_to(root) else str(path)
        for group, blocks in read(path, root).items():
            counter = counts.setdefault((group, name), Counter())
            for block in blocks:
                counter["words"] += len(WORD.findall(block.text))
                for line, kind, text, instead in findings(block):
                    counter[kind] += 1
                    found.append((name, line, group, kind, " ".join(text.split()), instead))
    return counts, found


def above(counts, ceilings=None):
    """Lines that name each ceiling that is exceeded; and the rates {group: {kind: per 1000 words}}."""
    rates, violations = {}, []
    for group, limits in (CEILINGS if ceilings is None else ceilings).items():
        total = Counter()
        for (of, _), counter in counts.items():
            if of == group:
                total.update(counter)
        rates[group] = {kind: 1000 * total[kind] / max(total["words"], 1) for kind in limits}
        violations += [f"{group}: {kind} {rates[group][kind]:.2f} per 1000 words, ceiling {limit:.2f}"
                       for kind, limit in limits.items() if rates[group][kind] > limit]
    return violations, rates


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", action="store_true", help="print each finding")
    parser.add_argument("files", nargs="*", type=Path)
    arguments = parser.parse_args()
    root = Path(__file__).resolve().parents[1]
    paths = [path.resolve() for path in arguments.files]
    if missing := [path for path in paths if not path.is_file()]:
        parser.error(f"{missing[0]}: not found")
    counts, found = check(root, paths)
    if arguments.list:
        for name, line, _, kind, text, instead in sorted(found):
            print(f"{name}:{line}: {kind}: '{text}' -> {instead}")
    else:
        lines = {}
        for name, line, group, kind, *_ in sorted(found):
            lines.setdefault((group, name, kind), []).append(str(line))
        for (group, name), counter in sorted(counts.items()):
            for kind in ("what", "subject", "word"):
                if numbers := lines.get((group, name, kind)):
                    print(f"{group:8} {name}: {kind} {counter[kind]} in {counter['words']} words, lines {' '.join(numbers)}")
    violations, rates = above(counts)
    print(f"{'group':10}{'words':>8}" + "".join(f"{kind:>18}" for kind in ("what", "subject", "word")) + "   per 1000 (ceiling)")
    for group, rate in rates.items():
        words = sum(counter["words"] for (of, _), counter in counts.items() if of == group)
        print(f"{group:10}{words:8}" + "".join(f"{value:9.2f} ({CEILINGS[group][kind]:5.2f}) " for kind, value in rate.items()))
    if paths:
        return 0
    if not any(counter["words"] for counter in counts.values()):
        violations.append(f"{root}: no words")
    for violation in violations:
        print(f"error: {violation}; scripts/check_words.py --list shows each place")
    return 1 if violations else 0


if __name__ == "__main__":
    sys.exit(main())
