#!/usr/bin/python3
"""Checks that layers below src/scenarios name no options of scenarios in their messages:

    check_cures.py [SRC]     SRC: the sources (default: src/ of this project)

A layer states a fact and a cure (src/base/cure.h), because it serves scenarios with different options. A text below
src/scenarios may name options of PETSc and options that a source of the same folder binds. In src/run it may also name -dt,
-t_end and -seed, which every scenario has, and the options of the command line. Each cure must be advised by a message and declared by
an option. The script prints each violation as file:line and exits with 1 if there are any.
"""

import re
import sys
from pathlib import Path

from cpp_source import texts, without_comments

PETSC = re.compile(r"(ts|snes|ksp|pc|mat|vec|log|tao|sub|npc|mg|mobility_ksp|mobility_pc)_\w*$")
COMMAND_LINE = {"dt", "t_end", "seed", "help", "help_markdown", "help_json", "h", "version", "scenarios", "options_file", "option", "name", "no_signal_handler",
                "m"}  # of python3, for runs of the Python module
OPTION = re.compile(r"(?:(?<=[\s(/\"])|(?<=\{0\} )|^)-([a-z][a-z_0-9]*)(?![\w-])")
BIND = re.compile(r'\bbind\(\s*"(\w+)"')
CURES = "base/cure.h"


def named_options(src):
    """(path relative to src, line, name) of each option in a text below src/scenarios that its folder does not bind."""
    sources = [path for path in sorted(src.rglob("*")) if path.suffix in (".h", ".cpp") and "scenarios" not in path.relative_to(src).parts]
    bound = {}
    for path in sources:
        bound.setdefault(path.parent, set()).update(BIND.findall(path.read_text(encoding="utf-8")))
    for path in sources:
        allowed = bound[path.parent] | (COMMAND_LINE if path.parent.name in ("run", "base") else set())
        for line, text in texts(path.read_text(encoding="utf-8")):
            for name in OPTION.findall(text):
                if name not in allowed and not PETSC.match(name):
                    yield path.relative_to(src).as_posix(), line, name


def idle_cures(src):
    """(name, fault) of each cure that no message advises or no option declares."""
    listed = re.search(r"enum class Cure \{(.*?)\}", without_comments((src / CURES).read_text(encoding="utf-8")), re.DOTALL)
    advised, declared = set(), set()
    for path in sorted(src.rglob("*")):
        if path.suffix not in (".h", ".cpp") or path.stem == "cure":
            continue
        source = without_comments(path.read_text(encoding="utf-8"))
        if path.name in ("options.cpp", "model_choice.cpp", "settings.cpp"):
            declared |= set(re.findall(r"Cure::(\w+)", source))
        else:
            advised |= set(re.findall(r"Cure::(\w+)", source))
    for name in re.findall(r"\w+", listed[1]):
        if name not in advised:
            yield name, "no message advises it"
        if name not in declared:
            yield name, "no option declares it"


def main():
    src = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[1] / "src"
    found = [f"{path}:{line}: -{name}: the layer does not declare this option; state a cure ({CURES})"
             for path, line, name in named_options(src)]
    if (src / CURES).exists():
        found += [f"{CURES}: {name}: {fault}" for name, fault in idle_cures(src)]
    print("\n".join(found), end="\n" if found else "")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
