"""pliant-reproduce: makes the runs for a published figure, and draws it together with the published values."""

import argparse
import difflib
import lzma
import os
import shlex
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from .. import plotting
from ..errors import OutputError, PliantError, RunError
from ..files import TABLE_ERRORS, write_atomically
from ..script import markdown, remark, with_error
from ..sweep_command import (FAILED_CODE, check_options, default_workers, find_program, first_scenario, run_rows, write_results)
from ..sweep_jobs import STOPPED_CODE, RowFolder, count_text, row_text
from ..sweep_rows import read_rows
from . import disk_motion, disks, droplets, hopper, packings, readings
from .figure import AGREE, LEVELS, VALIDATION, check_rows, rows, write_rows
from .measure import OF_EVERY_RUN, measured

#: Of rows that name none, where there is no program to ask.
SCENARIO = "hopper"
FIGURES = {figure.name: figure for figure in (*hopper.FIGURES, *readings.FIGURES, *droplets.FIGURES, *disks.FIGURES,
                                              *disk_motion.FIGURES, *packings.FIGURES)}

_DESCRIPTION = """Makes a published figure again: runs a table of runs, fits with errors, draws the figure with the published
values in it (FIG-LEVEL.pdf and .png), and writes a row per quantity into reproduced.csv. The same command resumes stopped
runs. docs/how-to/reproduce.md has more."""

_EPILOG = """examples:
  pliant-reproduce list
  pliant-reproduce H2 quick -j 2
  pliant-reproduce H4 full                                 # hours; stop it, and resume with the same command
  pliant-reproduce H4 --kept                               # from stored results, without a run
  pliant-reproduce H4 as-run                               # with all differences of the authors' program
  pliant-reproduce H2 --table mine.csv                     # your runs, the same figure

exit codes: 0 done, 2 bad input, 3 runs have failed or, with all, a figure could not be drawn, 4 output failed,
6 another sweep works there, 75 runs are left: run the same again"""


@dataclass(frozen=True)
class Table:
    """A table of runs: its name, its file, and the folder of its runs."""

    name: str
    file: Path
    runs: Path

    def kept(self, measure):
        """The folder of the stored results of the published tables."""
        return VALIDATION / "measured" / f"{self.name}.{measure}.csv.xz"


def figure_by_name(name):
    """Raises RunError, with the nearest name, for one that there is not."""
    names = {known.lower(): known for known in FIGURES}
    if name.lower() in names:
        return FIGURES[names[name.lower()]]
    near = difflib.get_close_matches(name.lower(), names, 1, 0.4)
    raise RunError(f"no figure is called {name}; "
                   + (f"did you mean {names[near[0]]}?" if near else "pliant-reproduce list shows all"))


def _listing():
    width = max(map(len, FIGURES))
    lines = [f"{name:{width}}  {figure.title}" for name, figure in FIGURES.items()]
    return "\n".join([*lines, "", "H: Hopper flows of deformable particles; T: Slow granular flows (thesis); J: jammed packings"])


def _parser():
    parser = argparse.ArgumentParser(prog="pliant-reproduce", description=_DESCRIPTION, epilog=_EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figure", metavar="FIG", help="a figure, as H2 or T2.14; all; or list, which shows them")
    parser.add_argument("level", nargs="?", choices=LEVELS, help="quick: at most 5 minutes on 2 cores, larger errors "
                        "(default); full: the range of the paper, hours; as-run: with the options for the differences of the authors' program")
    parser.add_argument("-j", "--jobs", type=int, metavar="N", help="runs at a time (default: one per core)")
    parser.add_argument("-o", "--output", type=Path, default=Path("reproduced"), metavar="FOLDER",
                        help="folder of figures, reproduced.csv and runs (default: reproduced)")
    parser.add_argument("--program", metavar="FILE", help="the pliant to run (default: as of pliant-sweep)")
    parser.add_argument("--table", type=Path, action="append", metavar="FILE",
                        help="a table of runs instead of the figure's table; may be repeated")
    parser.add_argument("--retry", action="store_true", help="run failed rows again")
    mode = parser.add_mutually_exclusive_group()
    mode.add_argument("--kept", action="store_true", help="draw from stored results of earlier runs, without a run; "
                      "without a level: the full results if there are any")
    mode.add_argument("--keep", action="store_true", help="to spread the runs over several sessions: run only rows that are "
                      "not stored yet, and add them to the results in the folder validation")
    return parser


def _tables(figure, level, given):
    if given.table:
        stems = [path.stem for path in given.table]
        if len(set(stems)) < len(stems):
            raise RunError("--table: two tables have the same name; rename one")
        return [Table(path.stem, path, given.output / "runs" / path.stem) for path in given.table]
    return [Table(name, VALIDATION / f"{name}.csv", given.output / "runs" / name) for name in figure.tables(level)]


def _read_kept(path):
    try:
        table = pd.read_csv(path, dtype={"commit": str, "row": str}, keep_default_na=False, na_values=["", "nan"])
    except TABLE_ERRORS as error:
        raise RunError(f"{path}: cannot be read as a table ({str(error).strip().splitlines()[0]})") from None
    missing = [column for column in OF_EVERY_RUN if column not in table]
    if missing:
        raise RunError(f"{path}: has no column {', '.join(missing)}: it was not written by this command")
    return table


def _load_kept(figure, tables):
    """The stored results of the rows of these tables; empty if there are none."""
    found = []
    for table in tables:
        if not (path := table.kept(figure.measure)).exists():
            continue
        kept = _read_kept(path).assign(table=table.name)
        wanted = kept["row"].isin([row.id for row in read_rows(table.file, SCENARIO)])
        if not wanted.all():
            remark(f"{path}: {kept.loc[~wanted, 'row'].nunique()} of its runs are left out, which {table.file} does not have")
        found.append(kept[wanted])
    return pd.concat(found, ignore_index=True) if found else pd.DataFrame()


def _keep(path, new):
    """Adds new results to the stored ones, independent of the present rows of the table."""
    _write_csv(path, pd.concat([_read_kept(path), new], ignore_index=True) if path.exists() else new)


class Stopped(Exception):
    """A signal has stopped the runs."""


class _Runs:
    """Runs tables and measures them; a table that several figures share is run once."""

    def __init__(self, given):
        self.given, self.program, self._scenario = given, None, None
        self.failed, self.stopped, self._swept = False, False, {}

    def scenario(self):
        """The scenario of rows that name none."""
        if self.program is None:
            self.program = find_program(self.given.program)
            self._scenario = first_scenario(self.program)
        return self._scenario

    def _sweep(self, table, skip, ensembles):
        """[(row id, folder)] of the finished runs of a table. `ensembles`: as of pliant-sweep."""
        key = table.file, frozenset(skip)
        if key in self._swept:
            return self._swept[key]
        all_rows = read_rows(table.file, self.scenario())
        chosen = [row for row in all_rows if row.id not in skip]
        folders = [RowFolder(table.runs, row, table.file.absolute().parent, self.program) for row in chosen]
        for folder in folders:
            folder.check()
        jobs = self.given.jobs or default_workers(all_rows)
        remark(f"{len(chosen)} runs; by hand: " + shlex.join(
            ["pliant-sweep", str(table.file), "--output", str(table.runs), "-j", str(jobs), *["--ensembles"] * ensembles]))
        states = {}
        if chosen:
            check_options(table.file, all_rows, self.program, table.file.absolute().parent)
            states = run_rows(table.runs, folders, self.program, jobs, retry=self.given.retry, ensembles=ensembles)
            write_results(table.runs, folders)
            remark(count_text(states.values()))
        bad = [folder for folder in folders if states[folder.row.id].kind == "failed"]
        for folder in bad:
            remark(row_text(folder.row, states[folder.row.id]))
        self.failed |= bool(bad)
        self.stopped = any(state.kind in ("stopped", "waiting", "running") for state in states.values())
        if self.stopped and not self.given.keep:
            raise Stopped
        done = [(folder.row.id, folder.path) for folder in folders if states[folder.row.id].kind == "done"]
        self._swept[key] = done
        return done

    def measure(self, figure, table, skip=()):
        """DataFrame of the table's finished runs, without the rows in `skip`."""
        found = []
        for row, folder in self._sweep(table, skip, figure.ensembles):
            try:
                found.append(measured(figure.measure, row, folder))
            except RunError as error:
                remark(f"left out: {error}")
        result = pd.concat(found, ignore_index=True) if found else pd.DataFrame()
        return result.assign(table=table.name)


def _write_csv(path, table):
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{path.parent}: cannot be made ({error.strerror})") from None
    text = table.drop(columns="table").to_csv(index=False, float_format="%.6g")
    write_atomically(path, lzma.compress(text.encode(), preset=9 | lzma.PRESET_EXTREME) if path.suffix == ".xz" else text)


def _measured(figure, level, given, runs):
    """(level, tables, DataFrame of all that was measured for the figure)."""
    if given.kept:
        for one in [level] if level else ("full", "quick"):
            tables = _tables(figure, one, given)
            kept = _load_kept(figure, tables)
            if len(kept):
                for table in tables:
                    runs_kept = kept.loc[kept["table"] == table.name, "row"].nunique()
                    remark(f"{table.name}: {runs_kept} of {len(read_rows(table.file, SCENARIO))} runs are kept")
                return one, tables, _once(kept)
        raise RunError(f"no stored results of {figure.name}{f' {level}' if level else ''}: run it without --kept")
    level = level or "quick"
    tables, found = _tables(figure, level, given), []
    check_rows(figure, [(table.file, read_rows(table.file, runs.scenario())) for table in tables])
    for table in tables:
        kept = _load_kept(figure, [table]) if given.keep else pd.DataFrame()
        new = runs.measure(figure, table, set(kept["row"]) if len(kept) else ())
        together = pd.concat([part for part in (kept, new) if len(part)], ignore_index=True) if len(kept) + len(new) else new
        if given.keep and len(new):
            _keep(table.kept(figure.measure), new)
        if runs.stopped:  # finished runs are stored before
            raise Stopped
        if len(together):
            _write_csv(given.output / "measured" / f"{table.name}.{figure.measure}.csv", together)
            found.append(together)
    if not found:
        raise RunError(f"none of the runs of {figure.name} can be used")
    return level, tables, _once(pd.concat(found, ignore_index=True))


def _once(data):
    """Without runs that an earlier table has too: they would count as two seeds."""
    again = data.duplicated([column for column in data if column not in ("table", "commit", "cpu_seconds")])
    if again.any():
        remark(f"{data.loc[again, 'row'].nunique()} runs that two tables have count once")
    return data[~again]


def _print_rows(table):
    print(markdown(["quantity", "ours", "published", "agree", "note"], [
        (row.quantity, with_error(row.ours, row.error), with_error(row.published, row.published_error), row.agree,
         row.note) for row in table.itertuples()]), flush=True)


def reproduce(figure, level, given, runs):
    """Makes one figure. Raises PliantError, or Stopped."""
    remark(f"\n{figure.name}: {figure.title}")
    level, tables, data = _measured(figure, level, given, runs)
    if given.table:
        name = f"{figure.name}-{'-'.join(table.name for table in tables)}"
        level = "own"
    else:
        name = f"{figure.name}-{level}"
    if level == "quick":
        remark(f"quick: {figure.quick_note}; the errors are larger than with full")
    drawn, quantities = figure.draw(data)
    if level == "as-run":
        drawn.suptitle("as run", x=0.01, ha="left", fontsize="medium")
    lines = rows(figure, level, quantities, data, [table.name for table in tables])
    _print_rows(lines)
    hours = data.drop_duplicates(["table", "row"])["cpu_seconds"].sum() / 3600
    remark(f"{hours:.3g} CPU hours; agree: within {AGREE:g} joint standard errors")
    plotting.save(drawn, *(given.output / f"{name}.{ending}" for ending in ("png", "pdf")))
    write_rows(given.output / "reproduced.csv", lines)


def main(arguments=None):
    """Runs the command; returns the exit code."""
    parser = _parser()
    given = parser.parse_args(arguments)
    if given.jobs is not None and given.jobs < 1:
        parser.error(f"-j {given.jobs}: at least one")
    if given.figure == "list":
        print(_listing())
        return 0
    everything = given.figure.lower() == "all"
    chosen = list(FIGURES.values()) if everything else [figure_by_name(given.figure)]
    if given.table and (everything or given.level or given.keep or given.kept):
        raise RunError("--table goes with one figure, and with neither quick, full, --keep nor --kept")
    if given.level == "as-run":
        with_one = [figure for figure in FIGURES.values() if figure.as_run]
        if not everything and chosen[0] not in with_one:
            raise RunError(f"{chosen[0].name} has no table as run; these have: {', '.join(f.name for f in with_one)}")
        chosen = [figure for figure in chosen if figure in with_one]
    try:
        given.output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{given.output}: cannot be made ({error.strerror})") from None
    if not os.access(given.output, os.W_OK):
        raise OutputError(f"{given.output}: cannot be written")
    runs, failed = _Runs(given), []
    for figure in chosen:
        try:
            reproduce(figure, given.level, given, runs)
        except Stopped:
            remark("run the same command again to resume")
            return STOPPED_CODE
        except OutputError:
            raise
        except PliantError as error:
            if not everything:
                raise
            if not given.kept:  # stored results may lack rows
                failed.append(figure.name)
            remark(f"{figure.name}: {error}")
    if failed:
        remark(f"without a figure: {', '.join(failed)}")
    return FAILED_CODE if runs.failed or failed else 0
