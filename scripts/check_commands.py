#!/usr/bin/python3
"""Checks the commands of pages: the programs, scripts, files, options, choices and figures that they name must exist.

    check_commands.py [ROOT]     ROOT: the project (default: the project with this script)

Commands are indented lines, lines of code blocks, and `inline code`. docs/reference/options.md has the options and choices of
pliant, the --help of a Python command has its options, and a script must contain the options that it gets. Files are checked
if their names begin with a folder of the project, or with the folder of an installation.
Prints file:line: problem, and exits with 1 if there is any.
"""

import contextlib
import io
import re
import runpy
import sys
from functools import cache
from pathlib import Path

#: Options of PETSc, and of every scenario.
COMMON = ("ts_", "mobility_", "log_view", "options_file", "help", "version")
#: Options of pliant without a scenario.
ALONE = {"-help", "-h", "-version", "-scenarios", "-help_markdown"}
#: Debian packages, which commands install.
PACKAGES = {"pliant-doc"}
FOLDERS = ("benchmarks", "docs", "examples", "python", "scripts", "src", "tests", "validation")
#: Words before a program: variables, and mpiexec with its options.
BEFORE = re.compile(r"^(?:\w+=\S*\s+)*(?:mpiexec (?:-\S+ \S+ )*)?")
#: Installed copies of the examples.
INSTALLED = re.compile(r"^(?:\$HOME/pliant|/usr)/share/pliant/")
FILE = re.compile(r"[\w./$-]+\.(?:csv|txt|yaml|json)$")


def commands(text):
    """(line, words) of the commands of a page, without comments, redirections, variables and mpiexec."""
    number, pending = 0, ""
    for count, line in enumerate(text.split("\n"), 1):
        if not pending:
            number = count
        pending += line
        if line.endswith("\\"):
            pending = pending[:-1] + " "
            continue
        line, pending = pending, ""
        block = re.match(r"(?:    |\t)(\S.*)$", line)
        for code in [block[1]] if block else [line, *re.findall(r"`([^`\n]+)`", line)]:
            if "`" in code or "…" in code:
                continue
            for part in re.split(r"&&|[|;)]", re.split(r"(?:^|\s)#", code)[0]):
                words = BEFORE.sub("", part.strip()).split(" >")[0].split()
                if words and re.match(r"(?:build/|scripts/|environment/bin/|python/)?[\w./-]*$", words[0]):
                    yield number, words


def documented(root):
    """{scenario: {option: set of its choices}} of the page of options; numbers and names have no choices."""
    found = {}
    page = (root / "docs/reference/options.md").read_text(encoding="utf-8")
    for part in re.split(r"^# Options of `pliant ", page, flags=re.M)[1:]:
        rows = re.findall(r"^\| `-(\w+)` \| (\S+) \|", part, re.M)
        found[part.split("`")[0]] = {name: set(kind.split("\\|")) if "\\|" in kind else set() for name, kind in rows}
    return found


class Checker:
    def __init__(self, root):
        self.root = root
        self.options = documented(root)
        self.scenarios = {page.stem for page in (root / "docs/scenarios").glob("*.md")}

    def problems(self, text):
        """(line, problem) of the commands of a page."""
        for number, words in commands(text):
            for problem in self.of_command(words):
                yield number, problem

    def of_command(self, words):
        program, *rest = words
        name = program.rsplit("/")[-1]
        source = self.source(program)
        if source is None:
            return
        if not (self.root / source).exists():
            yield f"{program}: there is no {source}"
            return
        if source == "apps/pliant.cpp":
            yield from self.of_pliant(rest)
        elif source.startswith("examples/"):
            yield from self.of_own_program(source, rest)
        elif source.startswith("python/"):
            yield from self.of_python(name, rest)
        elif source.startswith("scripts/"):
            yield from (f"{program} has no {one}" for one in rest if one.startswith("--") and one not in self.script(source))
        for word in rest:
            yield from self.of_file(word)

    @staticmethod
    def source(program):
        """The file or folder of the project that a program is made of; None for words that are no programs of it."""
        name = program.rsplit("/")[-1]
        if program.startswith("scripts/"):
            return program
        if program.startswith("build/tests/test_"):
            return f"tests/{name.removeprefix('test_')}"
        if program.startswith("build/examples/"):
            return f"examples/{name}"
        if name == "pliant" and program in ("pliant", "./pliant", "build/apps/pliant"):
            return "apps/pliant.cpp"
        if re.fullmatch(r"pliant-[a-z]+", name) and name not in PACKAGES:
            return f"python/{name}"
        return None

    def of_pliant(self, words):
        if not words or words[0] in ALONE or not re.fullmatch(r"[a-z]+", words[0]):
            return
        scenario, *rest = words
        if scenario not in self.scenarios | self.options.keys():
            yield f"there is no scenario {scenario}"
        if scenario not in self.options:  # evaluate reads a file instead
            return
        known = self.options[scenario]
        for option, value in zip(rest, [*rest[1:], ""]):
            if not re.match(r"-[a-z]", option) or option[1:].startswith(COMMON):
                continue
            if option[1:] not in known:
                yield f"{scenario} has no option {option}"
            elif known[option[1:]] and re.fullmatch(r"[a-z]\w*", value) and value not in known[option[1:]]:
                yield f"{scenario} {option} cannot be {value}"

    def of_own_program(self, folder, words):
        """Options of the program, which its sources declare, and of the scenario."""
        sources = "".join(path.read_text(encoding="utf-8") for path in sorted((self.root / folder).glob("*.*")))
        known = self.options.get(words[0] if words else "", {})
        for option in words[1:]:
            if re.match(r"-[a-z]", option) and option[1:] not in known and option not in ("-output", "-t_end") and f'"{option[1:]}"' not in sources:
                yield f"{folder} has no option {option}"

    def of_python(self, program, words):
        if not words:
            return
        figure = []
        if program == "pliant-plot" and re.fullmatch(r"[a-z_]+", words[0]):
            if not (self.root / f"python/plots/{words[0]}.py").is_file():
                yield f"there is no figure {words[0]}"
                return
            figure = [words[0]]
        elif program == "pliant-analyse" and re.fullmatch(r"[a-z]+", words[0]):
            figure = [words[0]]
        elif program == "pliant-reproduce" and re.fullmatch(r"[A-Z]\d+\w*", words[0]) and words[0] not in self.help(program, "list"):
            yield f"pliant-reproduce has no figure {words[0]}"
        given = [word for word in words if re.fullmatch(r"--[a-z][\w-]*|-[a-z]", word) and word not in ("--help", "-h")]
        if given:
            known = self.help(program, *figure, "--help")
            yield from (f"{' '.join([program, *figure])} has no {one}" for one in given if one not in known)

    def of_file(self, word):
        for name in re.split(r"[,:]", word):
            installed = INSTALLED.match(name)
            path = name[installed.end():] if installed else name
            if FILE.match(path) and path.split("/")[0] in FOLDERS and not (self.root / path).exists():
                yield f"{name} does not exist"

    @cache  # noqa: B019: one object per process
    def help(self, program, *words):
        """The words that a Python command prints; without a new process, because importing its packages takes a second."""
        path = self.root / "python" / program
        if program == "pliant-plot":
            path, words = self.root / f"python/plots/{words[0]}.py", words[1:]
        given, sys.argv = sys.argv, [str(path), *words]
        if str(self.root / "python") not in sys.path:
            sys.path.insert(0, str(self.root / "python"))
        try:
            with contextlib.redirect_stdout(io.StringIO()) as printed, contextlib.suppress(SystemExit):
                runpy.run_path(str(path), run_name="__main__")
        finally:
            sys.argv = given
        return set(re.findall(r"[\w-]+", printed.getvalue()))

    def script(self, source):
        """The text of a script and of the Python files that it starts."""
        text = (self.root / source).read_text(encoding="utf-8")
        started = [self.root / name for name in re.findall(r"[\w/]+\.py", text)]
        return text + "".join(path.read_text(encoding="utf-8") for path in started if path.is_file())


def pages(root):
    """The pages with commands; CHANGELOG.md also has commands of earlier versions."""
    found = [*root.glob("*.md"), *(root / "docs").rglob("*.md"), *(root / "src").rglob("README.md")]
    return sorted(page for page in found if page.name != "CHANGELOG.md")


def check(root):
    """The problems of all pages, as lines of text."""
    checker = Checker(root)
    return [f"{page.relative_to(root).as_posix()}:{number}: {problem}" for page in pages(root)
            for number, problem in checker.problems(page.read_text(encoding="utf-8"))]


def main():
    root = Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else Path(__file__).resolve().parents[1]
    found = check(root)
    print(*found, sep="\n", end="\n" if found else "")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
