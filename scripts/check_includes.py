#!/usr/bin/python3
"""Checks that headers are included in the order of the folders, and that none include each other in a circle:

    check_includes.py [ROOT]     ROOT: the project (default: the project with this script)

Prints the violations as file:line and exits with 1 if there are any.
"""

import re
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

# Folder of src/ (and apps): folders that it may include, besides itself and the folders that those may include.
USES = {
    "base": [],
    "geometry": ["base"],
    "kernels": ["geometry"],
    "model": ["kernels"],
    "catalogue": ["model"],
    "domain": ["model"],
    "system": ["domain"],
    "jamming": ["system"],
    "ts/sundials": ["base"],
    "ts": ["system", "ts/sundials"],
    "io": ["model"],
    "analysis": ["model"],
    "setup": ["system", "catalogue"],
    "run": ["ts", "io", "analysis", "setup", "jamming"],
    "scenarios/droplets": ["run"],
    "scenarios/particles": ["run"],
    "scenarios/hopper": ["run", "scenarios/particles"],
    "scenarios/packings": ["run", "scenarios/particles"],
    "scenarios/vibrate": ["run", "scenarios/particles"],
    "scenarios/raft": ["scenarios/droplets"],
    "scenarios/clog": ["scenarios/droplets"],
    "scenarios/channel": ["run"],
    "scenarios/evaluate": ["run"],
    "scenarios": ["scenarios/hopper", "scenarios/raft", "scenarios/clog", "scenarios/channel", "scenarios/packings",
                  "scenarios/vibrate", "scenarios/evaluate"],
    "python": ["scenarios"],
    "apps": ["scenarios"],
}
INCLUDE = re.compile(r'\s*#\s*include\s*(?:<pliant/([^>]+)>|(".*"))')


def all_uses():
    """{folder: all that it may include}."""
    uses = {}
    for folder in TopologicalSorter(USES).static_order():  # CycleError: the table has a cycle
        uses[folder] = {folder}.union(*(uses[used] for used in USES[folder]))
    return uses


def includes(path):
    """(line, header as in <pliant/header>, or None where it is in quotes) of a file."""
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if found := INCLUDE.match(line):
            yield number, found[1]


def check(root):
    """The violations in root/src and root/apps, as lines of text."""
    uses, violations, graph = all_uses(), [], {}
    files = sorted(path for path in [*root.glob("src/**/*"), *root.glob("apps/**/*")] if path.suffix in (".h", ".cpp"))
    for path in files:
        place = path.relative_to(root).as_posix()
        name = place.removeprefix("src/")
        folder = name.rpartition("/")[0]
        if folder not in uses:
            violations.append(f"{place}: folder {folder} is not in the table of {Path(__file__).name}")
            continue
        for line, header in includes(path):
            used = header and header.rpartition("/")[0]
            if header is None:
                violations.append(f"{place}:{line}: own headers are included as <pliant/folder/file.h>")
            elif used not in uses[folder]:
                violations.append(f"{place}:{line}: {folder} may not include {used} (<pliant/{header}>)")
        if path.suffix == ".h":
            graph[name] = [header for _, header in includes(path) if header]
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        violations.append(f"headers include each other: {' <- '.join(error.args[1])}")
    if not files:
        violations.append(f"{root}: no sources")
    return violations


def main():
    root = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[1]
    violations = check(root)
    print(*violations, sep="\n", end="\n" if violations else "")
    return 1 if violations else 0


if __name__ == "__main__":
    sys.exit(main())
