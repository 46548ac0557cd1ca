#!/usr/bin/python3
"""Writes python/pliant/scenario_calls.pyi, the types of the scenarios for editors and mypy, from the module's own table:

    PYTHONPATH=build/python scripts/python_stubs.py [--check]     --check: writes nothing, exits with 1 if it is out of date
"""

import argparse
import sys
from pathlib import Path

from pliant.engine import core

STUB = Path(__file__).resolve().parents[1] / "python" / "pliant" / "scenario_calls.pyi"
HEAD = '''# Made by scripts/python_stubs.py from the table of options.
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Literal, overload

from .ensemble_run import Ensemble
from .run import Run

_Text = str | PathLike[str] | Sequence[str | float]

SCENARIOS: dict[str, tuple[str, str, str, list[dict[str, Any]]]]

def arguments(options: Mapping[str, Any]) -> list[str]: ...
def call(scenario: str, options: Mapping[str, Any], progress: bool | None = None, quiet: bool = False) -> Run | Ensemble: ...
def option_lines(table: list[dict[str, Any]], indent: str = "") -> list[str]: ...
def evaluate(case: Mapping[str, Any] | str | PathLike[str], name: str = "case") -> dict[str, Any]: ...
'''
TYPES = {"real": "float", "integer": "int", "yes|no": "bool", "text": "_Text"}


def stub():
    text = HEAD
    for name, _, _, table in core.scenarios():
        if any(entry["name"] == "ensemble" for entry in table):
            # The first that fits counts; mypy warns that 0 is an int, too.
            text += "@overload\n" + signature(name, table, "Run", "Literal[0] | None = 0", "  # type: ignore[misc]")
            text += "@overload\n" + signature(name, table, "Ensemble", "int")
        else:
            text += signature(name, table, "Run")
    return text


def signature(name, table, result, ensemble=None, remark=""):
    """A scenario that returns `result`; ensemble: type and default of the option `ensemble`; remark: of the first line."""
    text = f"def {name}(*,{remark}\n"
    for entry in table:
        kind = f"Literal[{', '.join(map(repr, entry['choices']))}]" if entry["choices"] else TYPES[entry["type"]]
        default = None if entry["default"] == "" else entry["default"]
        text += f"    {entry['name']}: {ensemble if entry['name'] == 'ensemble' else f'{kind} | None = {default!r}'},\n"
    return text + ("    options_file: _Text | None = None,\n    progress: bool | None = None,\n    quiet: bool = False,\n"
                   f"    **petsc: str | float | bool | None) -> {result}: ...\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    if not parser.parse_args().check:
        STUB.write_text(stub(), encoding="utf-8")
    elif not STUB.exists() or STUB.read_text(encoding="utf-8") != stub():
        sys.exit(f"{STUB} is out of date; run PYTHONPATH=build/python scripts/python_stubs.py")


if __name__ == "__main__":
    main()
