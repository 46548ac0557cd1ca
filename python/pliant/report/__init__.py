"""Reports of runs, sweeps and ensembles: HTML files that show results, charts and a player of the frames without a network."""

import datetime
import json
from pathlib import Path

from ..errors import RunError
from ..files import finite, write_atomically
from ..follow import in_use
from . import contents
from .frames import pack_frames, units
from .page import overhead, page

NAME = "report.html"
LIMIT = 5.0         # MB of a file
LEAST_LIMIT = 0.5   # MB
_RESERVE = 100_000  # bytes for the description of the frames


def footer():
    return f"Written by pliant-report, {datetime.datetime.now():%Y-%m-%d %H:%M}."


def write_report(run, path=None, limit=LIMIT, follow=None):
    """Writes the report of a Run to `path` (default: report.html in its folder), at most `limit` MB large. With `follow` the page
    reloads itself after so many seconds. Returns the path. Raises RunError, OutputError."""
    path = run.path / NAME if path is None else Path(path)
    if not limit >= LEAST_LIMIT:
        raise RunError(f"--limit {limit:g}: a report needs at least {LEAST_LIMIT:g} MB")
    data, frames = _contents(run, limit)
    write_atomically(path, page(f"{run.name} – Pliant", data | {"follow": follow}, frames))
    return path


def _contents(run, limit):
    """(data of the page, bytes of the frames)"""
    remarks = []
    length, time = units(run)
    data = {"kind": "run", "title": run.name, "subtitle": contents.subtitle(run), "status": contents.status_of(run, in_use(run.path)),
            "units": {"length": length, "time": time}, "results": contents.results(run), "parameters": contents.parameters(run),
            "details": contents.details(run), "footer": footer(), "player": None,
            "fits": _or_remark(remarks, contents.fit_charts, run) or []}
    data["series"], data["series_note"] = _or_remark(remarks, contents.series_charts, run) or ([], "")
    left = limit * 1e6 - overhead() - len(json.dumps(finite(data))) - _RESERVE
    packed = _or_remark(remarks, pack_frames, run, max(left, 0) * 3 / 4, remarks)
    frames = b""
    if packed:
        frames, data["player"] = packed
    return data | {"remarks": remarks}, frames


def _or_remark(remarks, function, *arguments):
    """The result, or None with a remark on the page if a part of the run is damaged or missing."""
    try:
        return function(*arguments)
    except RunError as error:
        remarks.append(str(error))
        return None
