"""Many runs as one table."""

import os
from pathlib import Path

import pandas as pd

from .ensemble_run import Ensemble
from .errors import RunError
from .files import open_regular
from .run import Run
from .sweep_rows import number


def load_runs(paths):
    """List of Run, one per path, also of a single path. A folder that is not a run stands for the runs directly inside it, and an
    ensemble for its runs that have data."""
    if isinstance(paths, (str, os.PathLike)):
        paths = [paths]
    runs = []
    for path in map(Path, paths):
        if (path / "ensemble.h5").exists():
            ensemble = Ensemble(path)
            runs.extend(ensemble[k] for k in range(len(ensemble)) if ensemble.has_data(k))
            continue
        inside = sorted(p.parent for p in path.glob("*/run.h5")) if not (path / "run.h5").exists() else []
        runs.extend(Run(p) for p in inside or [path])
    if not runs:
        raise RunError("no runs given")
    return runs


def _columns_of_results(run):
    """{name: column} of the numbers of a summary. A result with the name of an option that has a value, like the
    pressure of a packing, has the column NAME_result."""
    numbers = [name for name, entry in run.summary.items()
               if isinstance(entry, (int, float)) or isinstance(entry, dict) and "value" in entry]
    return {name: name if run.parameters.get(name) is None else f"{name}_result" for name in numbers}


def _row(run):
    row = {"run": str(run.path), "scenario": run.manifest.get("scenario"), "model": run.model, "dim": run.dim,
           "status": run.summary.get("status", "unfinished")}
    row.update({k: v for k, v in run.parameters.items() if k not in row and isinstance(v, (bool, int, float, str))})
    for name, column in _columns_of_results(run).items():
        if isinstance(run.summary[name], dict):
            row[column], row[column + "_error"] = run.measured(name)
        else:
            row[column] = run.summary[name]
    for name in ("Q", "Q_error"):
        row.setdefault(name, float("nan"))
    return row


def sweep_table(runs):
    """DataFrame, one row per run: run, scenario, model, dim, status, every parameter, the counters of the
    summary, and each measured quantity X as the columns X and X_error. A result that has the name of an option,
    like the fraction of a packing, is in the column X_result. `runs` are Run objects or paths, or one of these."""
    if isinstance(runs, (str, os.PathLike, Run)):
        runs = [runs]
    rows, options = [], set()

    def add(run):
        rows.append(_row(run))
        options.update(run.parameters)

    for one in list(runs):
        if isinstance(one, Run):
            add(one)
            continue
        for run in load_runs([one]):
            with run:
                add(run)
    table = pd.DataFrame(rows)
    table.attrs["options"] = sorted(options.intersection(table))  # the other columns are results
    return table


def _note_units(run, units):
    def note(column, entry):
        if isinstance(entry, dict) and entry.get("unit"):
            units.setdefault(column, []).append(entry["unit"])

    for name, entry in run.manifest["options"].items():
        note(name, entry)
    for name, column in _columns_of_results(run).items():
        entry = run.summary[name]
        if not isinstance(entry, dict):  # a plain number has the unit of the option, or of the column of the series, with its name
            entry = (run.manifest["options"].get(name) if column != name
                     else {"unit": run.manifest["datasets"].get(f"series/{name}", {}).get("units")})
        note(column, entry)
        note(column + "_error", entry)


def results_tables(entries):
    """Two DataFrames of a sweep. The first has one row per entry: row (its name), run (its folder), scenario, status,
    message, the options of the table, and for finished runs all columns of `sweep_table`. The second, column and
    unit, has the units of the first. `entries` are (Row, folder, State)."""
    rows, units = [], {}
    for row, folder, state in entries:
        line = {"row": row.id, "run": str(folder), "scenario": row.scenario, "status": state.status,
                "message": state.message, **{name: number(value) for name, value in row.options.items()}}
        if state.kind == "done":
            try:
                with Run(folder) as run:
                    line |= _row(run)
                    _note_units(run, units)
            except RunError as error:  # one damaged file does not affect other runs
                line["message"] = str(error)
        rows.append(line)
    table = pd.DataFrame(rows)
    lines = [(column, "; ".join(dict.fromkeys(units[column]))) for column in table.columns if column in units]
    return table, pd.DataFrame(lines, columns=["column", "unit"])


def load_table(path):
    """A sweep table from a CSV file with at least the columns hopper_width (or w) and Q; Q_error may be missing."""
    try:
        with open(path, "rb", opener=open_regular) as file:
            table = pd.read_csv(file, float_precision="round_trip").rename(columns={"w": "hopper_width"})
    except (OSError, ValueError) as error:  # pandas' parser errors are ValueErrors
        raise RunError(f"{path}: cannot be read as a table ({str(error).strip().splitlines()[0]})") from None
    for column in ("hopper_width", "Q"):
        if column not in table:
            raise RunError(f"{path}: the table has no column '{column}' (it has: {', '.join(map(str, table.columns))})")
    for column in ("hopper_width", "Q", "Q_error", "mu", "zeta"):
        if column in table and not pd.api.types.is_numeric_dtype(table[column]):
            raise RunError(f"{path}: column '{column}' holds something that is not a number")
    if "Q_error" not in table:
        table["Q_error"] = float("nan")
    return table
