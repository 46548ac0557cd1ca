"""The report of an ensemble: a table of its runs, means with errors, charts over all runs, and players of some of them."""

import json

import numpy as np

from ..errors import RunError
from ..files import finite, write_atomically
from . import LEAST_LIMIT, LIMIT, NAME, contents, footer
from .contents import line
from .frames import pack_frames, units
from .page import overhead, page

_RESULTS = 12           # columns of results
_CHARTS = 6
_BINS = 40              # of a histogram, at most
_DECADES = 50           # ratio of the values of an option from which its axis is logarithmic
_ROWS = 2000            # of the table, at most
_POINTS = 1000          # of a chart, at most
_PLAYERS = 60           # runs in the player, at most
_DESCRIPTION = 8_000    # bytes of the description of a player, before one is known
_FULL = 0.8             # of the limit, for runs that are larger than the first one


def is_ensemble(folder):
    """Whether a folder holds an ensemble."""
    return (folder / "ensemble.h5").exists()


def write_ensemble(ensemble, path=None, limit=LIMIT, member=None):
    """Writes the report of an Ensemble to `path` (default: report.html in its folder), at most `limit` MB large. The player has as many
    runs as fit, or only the run with the number `member`. Returns the path. Raises RunError, OutputError."""
    path = ensemble.path / NAME if path is None else path
    if not limit >= LEAST_LIMIT:
        raise RunError(f"--limit {limit:g}: a report needs at least {LEAST_LIMIT:g} MB")
    if member is not None and not 0 <= member < len(ensemble):
        raise RunError(f"--member {member}: {ensemble.path} has the runs 0 to {len(ensemble) - 1}")
    data, frames = _contents(ensemble, limit, member)
    write_atomically(path, page(f"{data['title']} – Pliant", data, frames))
    return path


def _contents(ensemble, limit, member):
    """(data of the page, bytes of the frames)"""
    title = ensemble.path.resolve().name
    states = ", ".join(f"{n} {str(text).replace('_', ' ')}" for text, n in ensemble.table["status"].value_counts().items())
    failed = int((ensemble.table["status"] == "failed").sum())
    data = {"kind": "ensemble", "title": title, "subtitle": f"{len(ensemble)} runs: {states}", "remarks": [], "follow": None, "footer": footer(),
            "status": {"text": f"{failed} failed", "tone": "bad"} if failed else {"text": "done", "tone": "good"},
            "results": [], "common": [], "players": [], "shown": "", "units": {}, "means": None}
    good = [k for k, message in enumerate(_messages(ensemble)) if not message]
    results = []
    if good:
        with ensemble[max(good, key=ensemble.table.notna().sum(axis=1).get)] as run:  # one with all results
            length, time = units(run)
            results = [one | {"name": ensemble.column(one["name"])} for one in contents.results(run)
                       if one["name"] in run.summary["results"] and ensemble.column(one["name"]) in ensemble.table]
            data |= {"subtitle": f"{contents.subtitle(run)} · {data['subtitle']}", "units": {"length": length, "time": time},
                     "common": [one for one in contents.parameters(run) if one["name"] not in ("seed", ensemble.description["option"])]}
    data["columns"], data["rows"] = _table(ensemble, results, data["remarks"])
    data["fits"] = _charts(ensemble, results)
    if ensemble.description["option"]:
        data["means"] = _means(ensemble, results)
    elif results:
        row = ensemble.means.iloc[0]
        data["results"] = [one | {"value": float(row[one["name"]]), "error": float(row[one["name"] + "_error"])} for one in results]
    left = limit * 1e6 - overhead() - len(json.dumps(finite(data))) - _DESCRIPTION
    frames, data["players"] = _players(ensemble, list(filter(ensemble.has_data, range(len(ensemble)))) if member is None else [member],
                                       max(left, 0), data["remarks"])
    if member is None and data["players"]:
        data["shown"] = f"{len(data['players'])} of {len(ensemble)} runs. pliant-report --member N shows run N, --limit MB more runs." \
            if len(data["players"]) < len(ensemble) else ""
    present = {one["member"] for one in data["players"]}
    for row in data["rows"]:
        row["link"] = f"#member={row['member']}" if row["member"] in present else None
    return data, frames


def _messages(ensemble):
    """The message of each run; empty for runs that have not failed."""
    if "message" not in ensemble.table:
        return [""] * len(ensemble)
    return ensemble.table["message"].fillna("").astype(str).tolist()


def _name(ensemble, k):
    option, row = ensemble.description["option"], ensemble.table.iloc[k]
    return f"{k}: " + (f"{option} {row[option]}, " if option else "") + f"seed {row['seed']}"


def _option_column(ensemble):
    option = ensemble.description["option"]
    return [{"name": option, "label": option, "unit": "", "numeric": _numeric(ensemble), "option": True}] if option else []


def _numeric(ensemble):
    option = ensemble.description["option"]
    return bool(option) and ensemble.table[option].dtype.kind in "if"


def _result_columns(results):
    return [{"name": one["name"], "label": one["label"], "unit": one["unit"], "numeric": True} for one in results]


def _table(ensemble, results, remarks):
    """(columns, rows) of the table of runs; the failed ones are among the rows if not all runs fit."""
    columns = [{"name": "row", "label": "run", "unit": "", "numeric": False}, {"name": "status", "label": "status", "unit": "", "numeric": False},
               {"name": "seed", "label": "seed", "unit": "", "numeric": True}, *_option_column(ensemble), *_result_columns(results[:_RESULTS])]
    table, messages = ensemble.table, _messages(ensemble)
    order = np.argsort([not message for message in messages], kind="stable")[:_ROWS]
    if len(order) < len(table):
        remarks.append(f"The table shows {len(order)} of {len(table)} runs; members.csv has all of them.")
    rows = []
    for k in sorted(order.tolist()):
        status = str(table["status"].iloc[k])
        cells = [None, None] + [_cell(table[column["name"]].iloc[k]) for column in columns[2:]]
        rows.append({"name": _name(ensemble, k), "short": str(k), "member": k, "message": messages[k], "cells": cells,
                     "status": {"text": status.replace("_", " "), "tone": contents.TONES.get(status, "busy")}})
    return columns, rows


def _cell(value):
    """A cell as the page takes it: None for a missing value."""
    if isinstance(value, str) or np.isfinite(value):
        return getattr(value, "item", lambda: value)()
    return None


def _means(ensemble, results):
    """{columns, rows} of the means over the runs of each value of the varied option."""
    columns = [*_option_column(ensemble), {"name": "members", "label": "runs", "unit": "", "numeric": True}, *_result_columns(results[:_RESULTS])]
    rows = []
    for _, row in ensemble.means.iterrows():
        cells = [_cell(row[ensemble.description["option"]]), int(row["members"])]
        rows.append({"cells": cells + [[_cell(row[one["name"]]), _cell(row[one["name"] + "_error"])] for one in results[:_RESULTS]]})
    return {"columns": columns, "rows": rows}


def _charts(ensemble, results):
    """Results of all runs that have not failed: against the varied option, or as histograms."""
    option, table = ensemble.description["option"], ensemble.table[ensemble.table["status"] != "failed"]
    means, charts = ensemble.means if option else None, []
    for one in results:
        known = table[np.isfinite(table[one["name"]])]
        if known[one["name"]].nunique() < 2 or len(charts) == _CHARTS:
            continue
        common = {"title": one["label"], "unit": one["unit"]}
        if _numeric(ensemble):
            part = known.iloc[np.unique(np.linspace(0, len(known) - 1, _POINTS).round().astype(int))]
            x = table[option]
            decades = x.min() > 0 and x.max() >= _DECADES * x.min()
            along = np.log10 if decades else np.asarray
            lines = [line(along(part[option]), part[one["name"]], thin=False, kind="points", small=True, label="runs", colour=7),
                     line(along(means[option]), means[one["name"]], thin=False, kind="points", error=means[one["name"] + "_error"],
                          label="mean ± standard error", colour=1)]
            charts.append(common | {"x": {"label": f"log10 of {option}" if decades else option, "unit": ""}, "lines": lines})
            continue
        edges = np.histogram_bin_edges(known[one["name"]], "auto")
        if len(edges) > _BINS + 1:
            edges = np.histogram_bin_edges(known[one["name"]], _BINS)
        lines = []
        for value, group in known.groupby(option) if option else [(None, known)]:
            counts = np.histogram(group[one["name"]], edges)[0]
            lines.append(line(edges, [*counts, counts[-1]], thin=False, kind="steps", **({"label": f"{option} {value}"} if option else {})))
        charts.append({"title": f"{one['label']}: number of runs", "unit": "", "x": {"label": one["label"], "unit": one["unit"]}, "lines": lines,
                       "zero": True})
    return charts


def _players(ensemble, members, limit, remarks):
    """(bytes, [{member, label, player}]) of as many of the members as fit into `limit` bytes of the page, evenly spread."""
    packed, described = b"", []
    if not members:
        return packed, described
    first = _player(ensemble, members[0], limit - _DESCRIPTION, own := [])
    count, description = min(len(members), _PLAYERS), _DESCRIPTION
    if first is not None:
        description = len(json.dumps(finite(first[1])))
        count = max(1, min(count, int(_FULL * limit / (len(first[0]) * 4 / 3 + description))))
    chosen = [members[k] for k in np.unique(np.linspace(0, len(members) - 1, count).round().astype(int))]
    if count == 1:
        remarks += own
    for member in chosen:
        one = first if count == 1 else _player(ensemble, member, limit / count - description, [])
        if one is None:
            continue
        data, player = one
        for entry in player["entries"].values():
            entry["start"] += len(packed)
        packed += data
        described.append({"member": member, "label": _name(ensemble, member), "player": player})
    return packed, described


def _player(ensemble, member, limit, remarks):
    """(bytes, description) of the frames of a member, at most `limit` bytes of the page without the description; None if there is nothing to show, or if the member is damaged."""
    try:
        with ensemble[member] as run:
            return pack_frames(run, max(limit, 0) * 3 / 4, remarks)
    except RunError as error:
        remarks.append(str(error))
        return None
