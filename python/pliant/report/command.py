"""pliant-report: HTML files that show runs and sweeps in a browser."""

import argparse
from pathlib import Path

from ..errors import RunError
from ..follow import states
from ..ensemble_run import Ensemble
from ..run import Run
from ..script import check_output, remark
from . import LIMIT, NAME, write_report
from .ensemble import is_ensemble, write_ensemble
from .sweep import is_sweep, write_sweep

_DESCRIPTION = f"""Writes {NAME} into the folder of each run: results, time series, profile, fit, and a player of the
frames. The file needs no network and no other file. For a folder of runs (a sweep) the report is a table with fits, and
links to the reports of its runs. For an ensemble the report has means, charts over all runs, and a player of one run at a time. docs/how-to/report.md has more."""

_EPILOG = """examples:
  pliant-report runs/hopper && xdg-open runs/hopper/report.html
  pliant-report runs/hopper --follow       # while the run is in progress
  pliant-report widths                     # a folder that pliant-sweep has written
  pliant-report packings --member 17       # an ensemble, with the frames of one of its runs

exit codes: 0 done, 2 bad input, 4 output failed, 130 --follow was interrupted"""


def _parser():
    parser = argparse.ArgumentParser(prog="pliant-report", description=_DESCRIPTION, epilog=_EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", nargs="+", type=Path, metavar="RUN", help="folder of a run, of a sweep, or of an ensemble")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help=f"file to write, of a single RUN (default: RUN/{NAME})")
    parser.add_argument("--limit", type=float, metavar="MB", help="largest size of the file of a run; a smaller part of the frames is "
                        f"shown if not all of them fit (default: {LIMIT:g})")
    parser.add_argument("--table-only", action="store_true", help="for a sweep, write no reports of its runs; the table links to existing reports")
    parser.add_argument("--member", type=int, metavar="N", help="of an ensemble, show the frames of run N (default: of as many runs as fit)")
    parser.add_argument("--follow", action="store_true", help="write the report repeatedly until the run ends; the page reloads itself")
    parser.add_argument("--interval", type=float, default=10.0, metavar="S", help="seconds between two reports with --follow (default: 10)")
    return parser


def _tell(path):
    remark(f"wrote {path}: {path.stat().st_size / 1e6:.2g} MB")


def _follow(folder, output, limit, interval):
    try:
        _write_states(folder, output, limit, interval)
    except KeyboardInterrupt:
        if (folder / "run.h5").exists():
            with Run(folder) as run:  # a page that no longer reloads itself
                _tell(write_report(run, output, limit))
        raise


def _write_states(folder, output, limit, interval):
    for run, writing in states(folder, interval):
        try:
            _tell(write_report(run, output, limit, interval if writing else None))
        except RunError as error:
            if not writing:
                raise
            remark(f"{folder}: {error}; the next report follows in {interval:g} s")


def main(arguments=None):
    given = _parser().parse_args(arguments)
    if len(given.run) > 1 and (given.output or given.follow):
        raise RunError(f"{'--output names one file' if given.output else '--follow needs one run'}; give one RUN, not {len(given.run)}")
    if given.output:
        check_output(given.output)
    limit = LIMIT if given.limit is None else given.limit
    for folder in given.run:
        if given.member is not None and not is_ensemble(folder):
            raise RunError(f"{folder}: --member needs the folder of an ensemble")
        if is_ensemble(folder):
            if given.follow:
                raise RunError(f"{folder}: --follow needs the folder of one run, not of an ensemble; write its report when it has ended")
            _tell(write_ensemble(Ensemble(folder), given.output, limit, given.member))
        elif is_sweep(folder):
            if given.follow:
                raise RunError(f"{folder}: --follow needs the folder of one run, not of a sweep; write its table again with --table-only")
            _tell(write_sweep(folder, given.output, given.limit, not given.table_only, remark))
        elif given.follow:
            _follow(folder, given.output, limit, given.interval)
        else:
            with Run(folder) as run:
                _tell(write_report(run, given.output, limit))
