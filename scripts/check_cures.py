#!/usr/bin/python3
"""Checks that layers below src/scenarios name no options of scenarios in their messages:

    check_cures.py [SRC]     SRC: the sources (default: src/ of this project)

A layer states a fact and a cure (src/base/cure.h), because it serves scenarios with different options. A string literal
below src/scenarios may name options of PETSc and options that a source of the same folder binds. In src/run it may also name
-dt and -t_end, which every scenario has, and the options of the command line. The script prints each other option as
file:line and exits with 1 if LEFT does not list it.
"""

import re
import sys
from pathlib import Path

#: Files with messages that still name options: they may lose some, no file may be added.
LEFT = {
    "catalogue/catalogue.cpp": {"dim"},
    "catalogue/catalogue.h": {"dim"},
    "geometry/hopper.h": {"hopper_width", "hopper_wall_distance", "hopper_angle"},
    "io/frame.cpp": {"frame_fields", "frame_deflate"},
    "model/droplet_pairs.h": {"dt"},
    "model/droplet_walls.h": {"dt"},
    "run/folder.cpp": {"hopper_q_rtol"},
    "run/run.cpp": {"integrator"},
    "setup/particles.cpp": {"size_deviation"},
    "system/particle_system.cpp": {"integrator"},
    "ts/ts_integrator.cpp": {"implicit"},
}
PETSC = re.compile(r"(ts|snes|ksp|pc|mat|vec|log|sub|npc|mg|mobility_ksp|mobility_pc)_\w*$")
COMMAND_LINE = {"dt", "t_end", "help", "help_markdown", "help_json", "h", "version", "scenarios", "options_file", "option", "name", "no_signal_handler"}
LITERAL = re.compile(r'"(?:[^"\\\n]|\\.)*"')
OPTION = re.compile(r"(?:(?<=[\s(/\"])|(?<=\{0\} ))-([a-z][a-z_0-9]*)(?![\w-])")
BIND = re.compile(r'\bbind\(\s*"(\w+)"')


def without_comments(text):
    return re.sub(r'//[^\n]*|("(?:[^"\\\n]|\\.)*")', lambda found: found[1] or "", text)


def named_options(src):
    """(path relative to src, line, name) of each option in a string literal below src/scenarios that its folder does not bind."""
    sources = [path for path in sorted(src.rglob("*")) if path.suffix in (".h", ".cpp") and "scenarios" not in path.relative_to(src).parts]
    bound = {}
    for path in sources:
        bound.setdefault(path.parent, set()).update(BIND.findall(path.read_text(encoding="utf-8")))
    for path in sources:
        allowed = bound[path.parent] | (COMMAND_LINE if path.parent.name in ("run", "base") else set())
        for number, line in enumerate(without_comments(path.read_text(encoding="utf-8")).splitlines(), 1):
            for literal in LITERAL.findall(line):
                for name in OPTION.findall(literal):
                    if name not in allowed and not PETSC.match(name):
                        yield path.relative_to(src).as_posix(), number, name


def main():
    src = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[1] / "src"
    found = list(named_options(src))
    bad = [(path, number, name) for path, number, name in found if name not in LEFT.get(path, ())]
    for path, number, name in bad:
        print(f"{path}:{number}: -{name}: the layer does not declare this option; state a cure (src/base/cure.h)")
    gone = [f"{path}: -{name}" for path, names in LEFT.items() for name in sorted(names)
            if not any((path, name) == (other, option) for other, _, option in found)]
    if gone and len(sys.argv) == 1:
        print("check_cures.py: take these out of LEFT: " + ", ".join(gone))
    return 1 if bad or (gone and len(sys.argv) == 1) else 0


if __name__ == "__main__":
    sys.exit(main())
