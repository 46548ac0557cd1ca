"""A published figure that can be made again, and the rows of reproduced.csv."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from .. import pooling
from ..errors import RunError
from ..files import write_atomically
from .published import Published

_FOLDERS = Path(__file__).resolve().parents
#: Tables and their results: next to the folder python of the sources and of an installation; for packages in share/pliant of
#: the prefix.
VALIDATION = next(filter(Path.is_dir, (folder / "share/pliant/validation" for folder in _FOLDERS)), _FOLDERS[3] / "validation")
LEVELS = ("quick", "full", "as-run")
#: Options in which runs of one point may differ.
FREE = ("seed", "strain", *pooling.LENGTH, *pooling.OUTPUT)
#: Two values agree if they differ by at most this many joint standard errors.
AGREE = 2.0

#: Kinds of particles, with their models.
KINDS = {"soft": ("sp",), "deformable": ("rough", "smooth")}
_DEFAULTS = {"model": "sp", "dim": 2}  #: of the program, where a row does not give them

COLUMNS = ["figure", "level", "quantity", "ours", "error", "published", "published_error", "deviation", "agree",
           "source", "note", "cpu_hours", "commit", "seeds", "table"]


@dataclass(frozen=True)
class Quantity:
    """A number of a figure."""

    name: str
    value: float
    error: float  #: one standard error; NaN: unknown
    published: Published | None = None
    note: str = ""
    decides: bool = True  #: false: shown with the published value, but too uncertain in kind to be judged by it


@dataclass(frozen=True)
class Figure:
    name: str        #: as on the command line: H2, T2.14
    title: str
    quick: tuple     #: names of tables below validation/, without .csv
    full: tuple
    measure: str     #: name of a function of measure.py
    drawing: Callable   #: measured [DataFrame] → (matplotlib figure, [Quantity])
    quick_note: str = "fewer seeds and shorter runs"  #: the savings of the quick form
    as_run: tuple = ()  #: with the options for the differences of the authors' program; empty where there are none
    #: Criteria that distinguish runs: options, and functions of a run's options. Runs that agree in all are seeds of one point.
    tells: tuple = ()
    kind: str = ""        #: of particles, of KINDS, if it shows one alone
    planar: bool = False  #: whether runs in 3D cannot be in it
    #: Raises RunError for rows, [(path, Row)], that change several options at once, where the figure shows the effect of one each.
    single: Callable | None = None
    together: tuple = ()  #: tables in which options change together on purpose: not checked by `single`
    ensembles: bool = False  #: whether runs take seconds: rows that differ only in the seed run in one process

    def shown(self, runs):
        """The rows of `runs` (columns model and dim) that the figure shows. Raises RunError if there are none, or for runs
        in 3D if the figure is in 2D."""
        if self.planar and (runs["dim"] == 3).any():
            raise RunError("there are runs in 3D, but this figure shows 2D runs only: leave them out (H3, H4, "
                           "coefficients-3d and J3 have spheres)")
        if not self.kind:
            return runs
        own = runs[runs["model"].isin(KINDS[self.kind])]
        if own.empty:
            raise RunError(f"no run has {self.kind} particles (-model {' or '.join(KINDS[self.kind])}), which this figure shows")
        return own

    def draw(self, measured):
        """(matplotlib figure, [Quantity]) of measured runs. Raises RunError if the figure shows none of them."""
        return self.drawing(self.shown(measured))

    def tables(self, level):
        """Names of the tables of a level; empty for as-run where there is none."""
        return {"quick": self.quick, "full": self.full, "as-run": self.as_run}[level]


def check_rows(figure, tables):
    """Before they run. Raises RunError if the figure shows none of them, would average runs that differ in more than
    FREE options, or would show the effect of several options as if it were one: `tables` is [(path, [Row])]."""
    given = [row.options for _, lines in tables for row in lines]
    if not any("options_file" in options for options in given):  # a file may have the option
        runs = pd.DataFrame([_DEFAULTS | {name: options[name] for name in _DEFAULTS if name in options} for options in given])
        figure.shown(runs.assign(dim=pd.to_numeric(runs["dim"], errors="coerce")))
    first = {}
    for path, lines in tables:
        for row in lines:
            key = row.scenario, *(told(row.options) if callable(told) else row.options.get(told) for told in figure.tells)
            rest = {name: value for name, value in row.options.items() if name not in (*figure.tells, *FREE)}
            where, other = first.setdefault(key, (f"{path}, line {row.line}", rest))
            if name := next((name for name in sorted(rest.keys() | other.keys()) if rest.get(name) != other.get(name)), None):
                values = " and ".join(found.get(name, "none") for found in (other, rest))
                raise RunError(f"{where}, and {path}, line {row.line}: they differ in -{name} ({values}), which "
                               f"{figure.name} would average; draw them from separate tables, one --table at a time")
    if figure.single:
        together = {VALIDATION / f"{name}.csv" for name in figure.together}
        figure.single([(path, row) for path, lines in tables if path not in together for row in lines])


def deviation(quantity):
    """Ours less the published value over their joint standard error; NaN where a value is missing, or both errors are. An
    error that is unknown counts as none."""
    if quantity.published is None or not math.isfinite(quantity.value):
        return math.nan
    joint = math.hypot(*(e if math.isfinite(e) else 0.0 for e in (quantity.error, quantity.published.error)))
    return (quantity.value - quantity.published.value) / joint if joint > 0 else math.nan


def agree(quantity):
    """'yes', 'no', 'no verdict' where the quantity cannot decide, or 'no number' where there is nothing to compare, or no
    error to compare by."""
    distance = deviation(quantity)
    if math.isnan(distance) or not math.isfinite(quantity.error):
        return "no number"
    if not quantity.decides:
        return "no verdict"
    return "yes" if abs(distance) <= AGREE else "no"


def seeds_text(seeds):
    """'1-3,7' of seeds."""
    runs = []
    for seed in sorted(set(map(int, seeds))):
        if runs and seed == runs[-1][1] + 1:
            runs[-1][1] = seed
        else:
            runs.append([seed, seed])
    return ",".join(str(a) if a == b else f"{a}-{b}" for a, b in runs)


def rows(figure, level, quantities, measured, tables):
    """The rows of reproduced.csv of one figure."""
    once = measured.drop_duplicates(["table", "row"])
    common = {"cpu_hours": float(f"{once['cpu_seconds'].sum() / 3600:.4g}"),
              "commit": "; ".join(sorted(set(once["commit"].astype(str)))), "seeds": seeds_text(once["seed"]),
              "table": "; ".join(tables)}
    lines = []
    for q in quantities:
        known = q.published
        lines.append({"figure": figure.name, "level": level, "quantity": q.name, "ours": q.value, "error": q.error,
                      "published": known.value if known else math.nan,
                      "published_error": known.error if known else math.nan, "deviation": deviation(q),
                      "agree": agree(q), "source": known.source if known else "", "note": q.note} | common)
    return pd.DataFrame(lines, columns=COLUMNS)


def write_rows(path, new):
    """Puts the rows into the table `path`, in place of those that it has of the same figure, level and tables."""
    table = new
    if path.exists():
        try:
            old = pd.read_csv(path, dtype={"commit": str}, keep_default_na=False, na_values=[""])
            key = ["figure", "level", "table"]
            stays = ~pd.MultiIndex.from_frame(old[key].astype(str)).isin(pd.MultiIndex.from_frame(new[key]))
        except (OSError, ValueError, KeyError) as error:
            raise RunError(f"{path}: is not a table of this command ({str(error).splitlines()[0]}); move it") from None
        table = pd.concat([old[stays], new]) if stays.any() else new
    write_atomically(path, table.to_csv(index=False, float_format="%.6g"))
