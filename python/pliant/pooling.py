"""The rule for runs that are averaged or fitted together: they may differ in the variables of the figure, and in the options of
this module. Every other option distinguishes runs, also an option of a later version."""

import re
from pathlib import Path

import numpy as np
import pandas as pd

from . import symbols
from .errors import RunError
from .scenarios import of_scenario
from .script import remark
from .sweep import sweep_table

#: Options of files, cores and measurements.
OUTPUT = ("output", "restart", "options_file", "frame_interval", "sample_interval", "frame_travel", "sample_travel",
          "frames_per_cycle", "samples_per_cycle", "frame_fields", "frame_precision", "frame_deflate", "checkpoint_interval",
          "progress_interval", "max_wall_time", "threads", "ensemble", "ensemble_over", "ensemble_workers", "moduli", "modes",
          "mode_amplitude")
#: Options that end a run.
LENGTH = ("t_end", "hopper_q_rtol", "pushes")
#: Options of the sizes of disks in a channel.
DISKS = ("distribution", "radii", "counts")
_NUMERICS = ("dt", "allow_unstable_dt", "allow_energy_error", "integrator", "implicit", "jacobian", "skin")
_PETSC = re.compile("(ts|snes|ksp|pc|tao|mat|vec)_")
_TUNED = ("skin",)  # by the program, differently in runs of different length
_UNFINISHED = ("stopped", "failed", "unfinished")
_SHOWN = 4  # values of an option in a message


def joined(tables):
    """One sweep table of several."""
    table = pd.concat(tables, ignore_index=True)
    # Includes options of user-defined models.
    table.attrs["options"] = sorted({name for one in tables for name in one.attrs.get("options", ())})
    return table


def _text(value):
    """One text per value, because files spell a number differently."""
    return value if isinstance(value, str) else f"{float(value):.12g}"


def _column(table, name, default):
    """The values of an option: None where it is unknown or the model does not read it, "" where it is automatic."""
    of_run = table["scenario"].notna() if "scenario" in table else [False] * len(table)
    models = table["model"] if "model" in table else [""] * len(table)
    first, values = {}, []
    for value, model, known in zip(table[name], models, of_run):
        if pd.isna(value):  # an older version did not have the option
            value = ("" if default is None else default) if known else None
        unread = value is None or not symbols.reads(model, name)
        values.append(None if unread else first.setdefault(_text(value), value))
    return pd.Series(values, index=table.index, dtype=object)


def _options(table, scenario, free):
    """DataFrame of the options in a sweep table that are not in `free`, with one value where spellings differ."""
    defaults = symbols.options(scenario)
    names = [name for name in table if (name in defaults or name in table.attrs.get("options", ()) or _PETSC.match(name))
             and name not in free]
    return pd.DataFrame({name: _column(table, name, defaults.get(name)) for name in names}, index=table.index)


def settings(table, scenario, variables=(), among=slice(None)):
    """DataFrame of the options, except `variables`, that distinguish runs of a sweep table and differ in its rows `among`."""
    found = _options(table, scenario, {"seed", *OUTPUT, *LENGTH, *_NUMERICS, *variables})
    return found[[name for name in found if not _PETSC.match(name) and found.loc[among, name].nunique() > 1]]


def series(table, scenario, variables):
    """Name of the series of each run of a sweep table: its values of the `settings`; "" if there are none."""
    found = settings(table, scenario, variables)

    def label(name, value):
        if isinstance(value, str) and not value:
            return f"default {name}"
        return symbols.parameter_label(name, value if isinstance(value, (bool, np.bool_)) else _text(value))

    names = [", ".join(label(name, value) for name, value in zip(found, row) if value is not None) for row in found.itertuples(index=False)]
    return pd.Series(names if len(found.columns) else "", index=table.index, dtype=object)


def check(table, scenario, variables=()):
    """Raises RunError if runs of a sweep table differ in options that distinguish them, besides `variables`."""
    found = settings(table, scenario, variables)
    if "scenario" in table and table["scenario"].nunique() > 1:
        found = table[["scenario"]]
    for name in found:
        values = [_text(value) or "default" for value in found[name].dropna().unique()]
        values = values[:_SHOWN] + ["…"] * (len(values) > _SHOWN)
        raise RunError(f"the runs differ in {'-' * (name != 'scenario')}{name} ({', '.join(values[:-1])} and {values[-1]}), but are drawn and fitted as one "
                       "system; draw the runs of each value alone")


def _repeated(table, scenario):
    """Mask of the rows of runs that another row has, too: one that has ended, a longer one (without t_end the whole run), or an
    earlier row."""
    if "seed" not in table:
        return pd.Series(False, index=table.index)
    known = table["scenario"].notna() if "scenario" in table else pd.Series(False, index=table.index)
    order = pd.DataFrame({"unfinished": table["status"].isin(_UNFINISHED) if "status" in table else False,
                          "t_end": -table["t_end"].fillna(np.inf) if "t_end" in table else 0}, index=table.index)
    longest = order.sort_values(["unfinished", "t_end"], kind="stable").index
    same = pd.Series(False, index=table.index)
    for part, columns in ((known, _options(table, scenario, {*OUTPUT, *LENGTH, *_TUNED})), (~known, table)):
        same |= part & columns[part].loc[[row for row in longest if part[row]]].astype(str).duplicated().reindex(table.index, fill_value=False)
    return same & table["seed"].notna()


def once(table, scenario):
    """The sweep table with one row per run, with a remark if a run has several rows: equal options and seed."""
    same = _repeated(table, scenario)
    if same.any():
        remark(f"{same.sum()} of {len(table)} runs have the options and the seed of another run; each counts once")
    return table[~same].reset_index(drop=True)


def distinct_runs(runs, *scenarios):
    """(runs, their sweep table without the values of automatic options, which can depend on variables), each run once. RunError for
    runs of other scenarios."""
    table = sweep_table([of_scenario(run, *scenarios) for run in runs])
    scenario = runs[0].scenario
    for name, default in symbols.options(scenario).items():
        if name in table and default is None:
            table[name] = table[name].mask([run.manifest["options"].get(name, {}).get("source") == "default" for run in runs])
    kept = once(table.assign(number=range(len(runs))), scenario)
    return [runs[number] for number in kept["number"]], kept


def distinct_paths(paths):
    """The paths of files and folders, each once, with a remark if one is given several times."""
    found = {}
    for path in paths:
        found.setdefault(Path(path).resolve(), path)
    if len(found) < len(paths):
        remark(f"{len(paths) - len(found)} of {len(paths)} files and folders are given several times; each counts once")
    return list(found.values())
