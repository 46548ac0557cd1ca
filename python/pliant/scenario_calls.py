"""The scenarios of the program as functions, made from its table of options.

`pliant.hopper(n=200, t_end=20)` does what `pliant hopper -n 200 -t_end 20` does: the same checks, defaults and
messages, the same folder. `help(pliant.hopper)` lists the options.
"""

import inspect
import json
import keyword
import math
import numbers
import os
import sys
import warnings
from collections.abc import Iterable
from typing import Literal

import numpy as np

from .engine import core
from .ensemble_run import Ensemble
from .errors import InputError, PliantWarning
from .run import Run

_TYPES = {"real": float, "integer": int, "yes|no": bool, "text": str}


def _text(name, value):
    """The value of an option as the command line has it; None for an option without a value."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, (bool, np.bool_)):
        return None if value else "false"
    if isinstance(value, numbers.Integral):
        return str(int(value))
    if isinstance(value, numbers.Real):
        return repr(float(value))
    if isinstance(value, (str, os.PathLike)):
        text = os.fspath(value)
        if not isinstance(text, str):
            raise InputError(f"{name}: {text!r} is not a text; give a str")
        if len(text) > 1 and text[0] == "-" and text[1].isalpha():
            raise InputError(f"{name}: {text!r} begins like the name of an option; put ./ before the name of a file")
        return text
    if isinstance(value, Iterable) and not isinstance(value, (bytes, dict)):
        return ",".join(_text(name, item) or "true" for item in value)
    raise InputError(f"{name}: {value!r} is not an option's value; give a number, a text, True, False or a list")


def arguments(options):
    """Options as the arguments of a command line. Options that are None have their defaults. Errors: InputError."""
    result = []
    for name, value in options.items():
        if not name.isidentifier():
            raise InputError(f"{name!r} is not the name of an option; leave out dashes and blanks")
        if name in ("help", "h", "version"):
            raise InputError(f"{name} prints and runs nothing; help(pliant.hopper) lists the options of a scenario")
        if value is None:
            continue
        text = _text(name, value)
        result += [f"-{name}"] if text is None else [f"-{name}", text]
    return result


class _Listener:
    """Shows a run: its remarks, unless it is quiet, and a progress bar."""

    def __init__(self, name, progress, quiet):
        self._name, self._quiet, self._bar = name, quiet, None
        self._shows = sys.stderr is not None and sys.stderr.isatty() if progress is None else progress
        self._tqdm = None
        if self._shows:
            try:
                from tqdm.auto import tqdm
                self._tqdm = tqdm
            except ImportError:
                if progress:
                    raise InputError("progress=True needs tqdm; install python3-tqdm, or leave it out") from None

    def begin(self, folder):
        pass

    def progress(self, t, end, text):
        if self._tqdm is None:
            return
        if self._bar is None:
            self._bar = self._tqdm(total=end if math.isfinite(end) else None, desc=self._name, initial=t,
                                   bar_format="{l_bar}{bar}| {n:.4g}/{total:.4g} [{elapsed}<{remaining}{postfix}]")
        self._bar.set_postfix_str(text.partition("  ")[2], refresh=False)
        self._bar.update(t - self._bar.n)

    def say(self, text):
        if not self._quiet:
            self._close()
            print(text, end="", flush=True)

    def warn(self, text):
        warnings.warn(text, PliantWarning, stacklevel=4)

    def _close(self):
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    close = _close


def call(scenario, options, progress=None, quiet=False):
    """Runs a scenario with these options; returns its Run, or the Ensemble if `ensemble` is among them. Errors: as the
    functions that this module makes."""
    listener = _Listener(scenario, progress, quiet)
    try:
        folder = core.run_scenario(scenario, arguments(options), listener)
    finally:
        listener.close()
    return Ensemble(folder) if options.get("ensemble") else Run(folder)


def _default(entry):
    """A default in signatures: None where it is automatic."""
    value = entry["default"]
    return None if value == "" else value


def _annotation(entry):
    return Literal[tuple(entry["choices"])] if entry["choices"] else _TYPES[entry["type"]]


def _doc(name, text, units, table):
    lines = [f"{text[0].upper()}{text[1:]}: `pliant {name}` as a function.", "",
             "Returns the Run, which has ended, or which max_wall_time stopped and the same call resumes. Options that",
             "begin like PETSc's own (ts_type, ts_rtol, …) go to PETSc; options_file reads a file. True stands for a flag.",
             "",
             "progress: whether to show a bar (tqdm); by default on a terminal. quiet: print no remarks.", "",
             "Errors: InputError, NumericalError, OutputError, FolderInUseError with the messages of the program.",
             "KeyboardInterrupt (Ctrl-C) comes after a checkpoint: the same call resumes the run."]
    if units:
        lines += ["", units]
    return "\n".join(lines + option_lines(table))


def option_lines(table, indent=""):
    """Lines of a docstring with the options of a table, by groups."""
    lines, group = [], None
    for entry in table:
        if entry["group"] != group:
            group = entry["group"]
            lines += ["", f"{indent}{group}:"]
        kind = "|".join(entry["choices"]) if entry["choices"] else entry["type"]
        facts = "; ".join(fact for fact in (entry["unit"], f"default {entry['default_text']}", entry["range"]) if fact)
        lines.append(f"{indent}    {entry['name']}: {kind}  {entry['help']} [{facts}]")
    return lines


def _parameters(table):
    """Parameters of a signature."""
    kind = inspect.Parameter.KEYWORD_ONLY
    own = [inspect.Parameter(entry["name"], kind, default=_default(entry), annotation=_annotation(entry))
           for entry in table if not keyword.iskeyword(entry["name"])]
    return [*own,
            inspect.Parameter("options_file", kind, default=None, annotation=str),
            inspect.Parameter("progress", kind, default=None, annotation=bool),
            inspect.Parameter("quiet", kind, default=False, annotation=bool),
            inspect.Parameter("petsc", inspect.Parameter.VAR_KEYWORD)]


def _function(name, text, units, table):
    def run(*, progress=None, quiet=False, **options):
        return call(name, options, progress, quiet)

    run.__name__ = run.__qualname__ = name
    run.__doc__ = _doc(name, text, units, table)
    run.__signature__ = inspect.Signature(_parameters(table), return_annotation=Run)
    return run


def evaluate(case, name="case"):
    """Energies and forces of one configuration, as `pliant evaluate` computes them.

    case: a dict, or the name of a JSON file, as docs/scenarios/evaluate.md describes it; arrays may be numpy's. name:
    name of the case in messages. Returns a dict {"area", "energy": {term: value}, "force": {term: list, "total":
    list}}.
    Errors: InputError that names the key; NumericalError if a result overflows.
    """
    if isinstance(case, (str, os.PathLike)):
        name = os.fspath(case)
        text = core.read_case(name)
    else:
        try:
            text = json.dumps(case, default=_plain, allow_nan=False)
        except (TypeError, ValueError, RecursionError) as error:
            raise InputError(f"{name}: {error}; give a dict of finite numbers, lists and texts") from None
    result, remark = core.evaluate(text, name)
    if remark:
        warnings.warn(remark, PliantWarning, stacklevel=2)
    return json.loads(result)


def _plain(value):
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(f"{value!r} is not a number, a list or a text")


SCENARIOS = {entry[0]: entry for entry in core.scenarios()}
globals().update({name: _function(*entry) for name, entry in SCENARIOS.items()})

__all__ = ["arguments", "call", "evaluate", *SCENARIOS]
