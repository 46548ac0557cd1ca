#!/usr/bin/python3
"""Checks that each parameter of the models has its name in one place, the header of its term:

    check_parameters.py [ROOT]     ROOT: the project (default: the project with this script)

A term declares a parameter as {.name = "k_a", …}. OTHER_MEANINGS has the files that use a name for something else, such as
terms in space with a stiffness of another unit. No other file below src/ and apps/ may declare it again, hold its name as
a text ("k_a", "-k_a"), or use an identifier of that name. Terms and kernels (src/model, src/kernels) may have members and
arguments of that name. Prints the violations as file:line and exits with 1 if there are any.
"""

import re
import sys
from pathlib import Path

from cpp_source import without_comments

DECLARATION = re.compile(r'\.name = "(\w+)"')
OTHER_MEANINGS = {
    ("gravity", "src/scenarios/hopper/options.cpp"),  # a name that users try for a unit
    ("k_a", "src/model/surface_terms.h"),  # stiffness of faces in space
    ("k_l", "src/model/surface_terms.h"),
    ("k_b", "src/model/surface_terms.h"),
}


def declarations(root):
    """{name: [the files that declare it]}"""
    found = {}
    for path in sorted((root / "src" / "model").glob("*.h")):
        file = path.relative_to(root)
        for name in DECLARATION.findall(path.read_text(encoding="utf-8")):
            if (name, str(file)) not in OTHER_MEANINGS:
                found.setdefault(name, []).append(file)
    return found


def terms(root):
    """Names of terms: some parameters are called as their terms are."""
    return {name for path in (root / "src" / "model").glob("*.h")
            for name in re.findall(r'name\(\) \{ return "(\w+)"; \}', path.read_text(encoding="utf-8"))}


def violations(root):
    declared, shared = declarations(root), terms(root)
    found = [f"{files[1]}: declares {name}, as {files[0]} does" for name, files in declared.items() if len(files) > 1]
    for path in sorted(p for folder in ("src", "apps") for p in (root / folder).rglob("*") if p.suffix in (".h", ".cpp")):
        file = path.relative_to(root)
        text = without_comments(path.read_text(encoding="utf-8"))
        implements = file.parts[:2] in (("src", "model"), ("src", "kernels"))
        for name, files in declared.items():
            if file == files[0] or (name, str(file)) in OTHER_MEANINGS:
                continue
            patterns = [rf'"[^"\n]*(?<![\w-])-{name}\b[^"\n]*"']  # an option in a message
            if name not in shared:
                patterns.append(rf'"{name}"')
            if not implements and re.search(r"[_\d]", name) and name not in shared:
                patterns.append(rf"(?<=[.>]){name}\b(?!\()")  # a member
            for pattern in patterns:
                found += [f"{file}:{text.count(chr(10), 0, m.start()) + 1}: has the name of the parameter {name} of {files[0]}"
                          for m in re.finditer(pattern, text)]
    return found


def main():
    root = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[1]
    found = violations(root)
    print("\n".join(found) if found else f"{len(declarations(root))} parameters, each in the header of its term")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
