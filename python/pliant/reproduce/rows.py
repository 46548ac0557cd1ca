"""Rows of validation/reproduced.csv as sentences and pages name them, and expressions of them.

A specification is an expression: {quantity} or {FIGURE LEVEL: quantity} is a row, with the attributes published and deviation and the
method noted('words'), the number behind these words in its note; all{...} is the list of rows whose quantity matches a regular
expression. Values are added, divided and so on with their errors; FUNCTIONS lists the functions.
"""

from __future__ import annotations

import operator
import re
from dataclasses import dataclass
from functools import cache

import numpy as np
import pandas as pd

from . import published
from .figure import AGREE, VALIDATION


@dataclass(frozen=True)
class Value:
    """A number with its standard error, and the verdict of its row."""

    value: float
    error: float = 0.0
    agree: str = ""
    note: str = ""
    row: dict | None = None

    @property
    def published(self):
        return Value(self.row["published"], self.row["published_error"])

    @property
    def deviation(self):
        return Value(self.row["deviation"])

    def noted(self, words):
        """The number behind these words in the note."""
        return Value(float(re.search(re.escape(words) + r" ([\d.e+-]*\d)", self.note)[1]))


UNDECIDED = "no verdict"  #: the verdict that a value has, too, if a value decides nothing from which it is computed


def _with(operation, relative):
    def apply(a, b):
        a, b = (x if isinstance(x, Value) else Value(x) for x in (a, b))
        value = operation(a.value, b.value)
        error = (abs(value) * np.hypot(a.error / a.value, b.error / b.value) if relative else np.hypot(a.error, b.error))
        return Value(value, float(error), UNDECIDED if UNDECIDED in (a.agree, b.agree) else "")
    return apply


for _name, _operation, _relative in (("add", operator.add, False), ("sub", operator.sub, False), ("mul", operator.mul, True),
                                     ("truediv", operator.truediv, True)):
    _apply = _with(_operation, _relative)
    setattr(Value, f"__{_name}__", _apply)
    setattr(Value, f"__r{_name}__", lambda a, b, f=_apply: f(b, a))


@cache
def reproduced():
    return pd.read_csv(VALIDATION / "reproduced.csv", dtype={"commit": str}, keep_default_na=False)


def _number(text):
    return float(text) if text not in ("", None) else np.nan


def _value(row):
    own = {name: _number(row[name]) for name in ("ours", "error", "published", "published_error", "deviation")}
    return Value(own["ours"], own["error"], row["agree"], row["note"], row | own)


def _of_figure(table):
    """{(figure, level): [row]}, remembered for the table."""
    if id(table) not in _INDEX:
        found = _INDEX.setdefault(id(table), {})
        for row in table.to_dict("records"):
            found.setdefault((row["figure"], row["level"]), []).append(row)
    return _INDEX[id(table)]


_INDEX: dict[int, tuple] = {}


class Rows:
    """The rows of reproduced.csv as specifications name them, and those that one of them has named."""

    def __init__(self, table):
        self.of_figure, self.named = _of_figure(table), []

    def one(self, figure, level, quantity):
        found = [row for row in self.of_figure.get((figure, level), []) if row["quantity"] == quantity]
        assert len(found) == 1, f"{len(found)} rows of {figure} {level} are called '{quantity}'"
        self.named += found
        return _value(found[0])

    def matching(self, figure, level, pattern):
        found = [row for row in self.of_figure.get((figure, level), []) if re.fullmatch(pattern, row["quantity"])]
        assert found, f"no row of {figure} {level} matches '{pattern}'"
        self.named += found
        return [_value(row) for row in found]


def named_row(text, default):
    """(figure, level, quantity) of 'FIGURE LEVEL: quantity', or of 'quantity' of the default 'FIGURE LEVEL'."""
    own = re.match(r"([A-Za-z][\w.-]*) (full|quick|as-run): (.*)", text)
    return own.groups() if own else (*default.split(), text)


def evaluate(specification, default, rows):
    """The results of a specification: [Value, bool or set]. Raises AssertionError for a row that is not there, or is there twice."""
    known = []

    def named(match):
        opening, text = match[1], match[2]
        figure, level, quantity = named_row(text, default)
        known.append((rows.matching if opening == "all" else rows.one)(figure, level, quantity))
        return f"known[{len(known) - 1}]"

    code = re.sub(r"(all)?\{([^{}]*)\}", named, specification)
    result = eval(code, {"__builtins__": {}, "known": known, **FUNCTIONS})  # noqa: S307: our own files
    return list(result) if isinstance(result, (tuple, list)) else [result]


@cache
def _column(table, name):
    """The values of a column of the table validation/TABLE.csv."""
    return set(pd.read_csv(VALIDATION / f"{table}.csv", comment="#")[name])


def _values(arguments):
    return [v for one in arguments for v in (one if isinstance(one, (list, tuple)) else [one])]


@cache
def _measured(name, column):
    """The values of a column of results, validation/measured/NAME.csv.xz."""
    return set(pd.read_csv(VALIDATION / "measured" / f"{name}.csv.xz")[column].dropna())


def _kept(name, column, **where):
    """The mean of a column of validation/measured/NAME.csv.xz over the rows with these values of other columns."""
    data = pd.read_csv(VALIDATION / "measured" / f"{name}.csv.xz")
    for other, value in where.items():
        data = data[data[other] == value]
    assert len(data), f"{name} has no row with {where}"
    return Value(float(data[column].mean()))


def _judged(v, known):
    if v.agree == UNDECIDED:
        return UNDECIDED
    return "yes" if abs(v.value - known.value) <= AGREE * np.hypot(v.error, known.error) else "no"


def _change(reference, others):
    return Value(max(abs(one.value - reference.value) for one in others))


#: Functions that specifications may call; `of` are rows, or lists of them.
FUNCTIONS = {
    # numbers
    "Value": Value, "TRUE_RATIO": Value(published.CODE_LAMBDA[2]), "TRUE_RATIO_3D": Value(published.CODE_LAMBDA[3]),
    "value": lambda v: Value(v.value),
    "abs": lambda v: Value(abs(v.value), v.error), "percent": lambda v: Value(100 * v.value, 100 * v.error),
    "relative": lambda v: Value(100 * v.error / abs(v.value)),
    "low": lambda *of: min(_values(of), key=lambda v: v.value), "high": lambda *of: max(_values(of), key=lambda v: v.value),
    "span": lambda *of: [min(_values(of), key=lambda v: v.value), max(_values(of), key=lambda v: v.value)],
    "count": lambda verdict, *of: Value(sum(v.agree == verdict for v in _values(of))), "number": lambda *of: Value(len(_values(of))),
    "farthest": lambda *of: Value(max(abs(v.row["deviation"]) for v in _values(of))), "change": _change,
    "seeds": lambda v: Value(_seeds(v.row["seeds"])),
    "distributions": lambda: Value(len(set(published.DELTA) & _measured("channel/pair.motion", "distribution")
                                       | set(published.DELTA) & _measured("channel/distributions.motion", "distribution"))),
    "judged": lambda v, known: Value(v.value, v.error, _judged(v, known)),
    # whether it is so
    "every": lambda verdict, *of: all(v.agree == verdict for v in _values(of)),
    "never": lambda verdict, *of: all(v.agree != verdict for v in _values(of)),
    "notes": lambda words, *of: all(words in v.note for v in _values(of)),
    "is_bound": lambda *of: all("k at its bound" in v.note for v in _values(of)),
    "near": lambda a, b, k: bool(abs(a.value - b.value) <= k * np.hypot(a.error, b.error)),
    "beyond": lambda k, *of: all(v.row["deviation"] * np.sign(k) > abs(k) for v in _values(of)),
    "falls": lambda a, b: bool(a.value - b.value > 2 * np.hypot(a.error, b.error)),
    # values of a column
    "column": _column, "measured": _measured, "kept": _kept,
}


def _seeds(text):
    return sum(int(part.split("-")[-1]) - int(part.split("-")[0]) + 1 for part in text.split(","))
