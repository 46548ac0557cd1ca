"""The report of a sweep: a table of its runs with links to their reports, and fits over all runs."""

import math
import os
import re
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pandas as pd

from .. import pooling, symbols
from ..errors import RunError
from ..files import read_json, write_atomically
from ..follow import in_use
from ..run import Run
from ..script import with_error
from ..sweep import sweep_table
from . import LIMIT, NAME, contents, footer, write_report
from .contents import line
from .page import page

_RESULTS = 12  # columns of results


def is_sweep(folder):
    """Whether a folder holds runs, or rows of pliant-sweep, and is not a run itself."""
    return folder.is_dir() and not (folder / "run.h5").exists() and bool(_row_folders(folder))


def _row_folders(folder):
    found = {path.parent for name in ("run.h5", "row.json") for path in folder.glob(f"*/{name}")}
    return sorted(found, key=lambda path: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path.name)])


def write_sweep(folder, path=None, limit=None, reports=True, tell=lambda text: None):
    """Writes the report of a folder of runs, and with `reports` the report of each run that is newer than its last report. A
    given `limit` (MB) writes all of them. tell(text) is called for each row that has no report. Returns the path."""
    path = folder / NAME if path is None else Path(path)
    rows, runs = [], []
    for row_folder in _row_folders(folder):
        row = _row(row_folder, limit, reports, tell)
        report = row_folder / NAME
        row["link"] = _address(report, path.parent) if report.exists() else None
        rows.append(row)
    for row, name in zip(rows, _short_names([row["name"] for row in rows])):
        row["short"] = name
    columns, common = _columns(rows)
    title = folder.resolve().name
    states = pd.Series([row["status"]["text"] for row in rows]).value_counts()
    data = {"kind": "sweep", "title": title, "subtitle": f"{len(rows)} runs: " + ", ".join(f"{n} {text}" for text, n in states.items()), "status": None,
            "remarks": [], "columns": columns, "common": common, "footer": footer(),
            "rows": [{"name": row["name"], "short": row["short"], "link": row["link"], "status": row["status"], "message": row["message"],
                      "cells": [row["values"].get(column["name"]) for column in columns]} for row in rows]}
    data["fits"] = _fits(columns, rows, data["remarks"])
    write_atomically(path, page(f"{title} – Pliant", data | {"follow": None}))
    return path


def _short_names(names):
    """The names without the parts between commas that all of them have (pliant-sweep names rows by their options)."""
    parts = [name.split(",") for name in names]
    common = set.intersection(*map(set, parts))
    return [", ".join(part for part in one if part not in common) or name for one, name in zip(parts, names)]


def _address(file, base):
    """The address of a file relative to a folder, as a URL."""
    return quote(os.path.relpath(file.resolve(), base.resolve()).encode("utf-8", "surrogateescape"))


def _row(folder, limit, reports, tell):
    row = {"folder": folder, "name": folder.name, "message": "", "values": {}, "units": {}, "options": {}, "done": False}
    try:
        record = read_json(folder / "row.json") or {}
        row["message"] = record.get("message") or ""
        if not (folder / "run.h5").exists():
            row["status"] = {"text": "failed" if row["message"] else "not started", "tone": "bad" if row["message"] else "busy"}
            return row
        with Run(folder) as run:
            row["status"] = contents.status_of(run, in_use(folder))
            row["done"] = bool(run.summary) and row["status"]["tone"] == "good"
            row["scenario"] = run.scenario
            row["options"] = {one["name"]: one for one in contents.parameters(run)}
            row["raw"] = run.parameters
            for one in contents.results(run):
                row["values"][one["name"]] = [one["value"], one["error"]]
                row["units"][one["name"]] = (one["label"], one["unit"])
            if reports and (limit is not None or not _fresh(folder)):
                write_report(run, limit=LIMIT if limit is None else limit)
    except RunError as error:  # the other rows stay as they are
        row.setdefault("status", {"text": "damaged", "tone": "bad"})
        row["message"] = str(error)
        tell(f"{folder}: no report: {error}")
    return row


def _fresh(folder):
    """Whether the report is newer than the run and than the files that make reports."""
    report = folder / NAME
    if not report.exists():
        return False
    sources = [folder / "run.h5", folder / "summary.json", *Path(__file__).parent.rglob("*.*")]
    return report.stat().st_mtime > max(file.stat().st_mtime for file in sources if file.exists())


def _columns(rows):
    """(columns of the table, options that all rows share). Columns: options in which rows differ, then results."""
    values = {}
    for row in rows:
        for name, one in row["options"].items():
            values.setdefault(name, []).append(one)
    count = sum(bool(row["options"]) for row in rows)
    differ = [name for name, ones in values.items() if len({one["value"] for one in ones}) > 1 or len(ones) < count]
    for row in rows:
        for name in differ:
            if name in row["options"]:
                raw = row["raw"].get(name)
                row["values"][name] = raw if isinstance(raw, (int, float, str)) else contents.value_text(raw)
    columns = [{"name": "row", "label": "row", "unit": "", "numeric": False}, {"name": "status", "label": "status", "unit": "", "numeric": False}]
    for name in differ:
        numeric = all(isinstance(row["values"].get(name, 0.0), (int, float)) for row in rows)
        columns.append({"name": name, "label": name, "unit": values[name][0]["unit"], "numeric": numeric, "option": True})
    found = {}
    for row in rows:
        for name, (label, unit) in row["units"].items():
            found.setdefault(name, (label, unit))
    for name, (label, unit) in list(found.items())[:_RESULTS]:
        columns.append({"name": name, "label": label, "unit": unit, "numeric": True})
    common = [ones[0] for name, ones in sorted(values.items()) if name not in differ and ones[0]["given"]]
    return columns, common


# ---- fits ------------------------------------------------------------------------------------------------------------

def _fits(columns, rows, remarks):
    charts, done = [], [row for row in rows if row["done"]]
    for make in (_beverloo, _sigmoids):
        try:
            charts += make(done)
        except RunError as error:
            remarks.append(str(error))
    return charts or _scatter(columns, rows)


def _of(rows, scenario):
    """Sweep table of the runs of a scenario."""
    return sweep_table([row["folder"] for row in rows if row["scenario"] == scenario])


def _beverloo(rows):
    table = _of(rows, "hopper")
    if "Q" not in table or not table["Q"].notna().any() or "hopper_width" not in table or table["hopper_width"].nunique() < 2:
        return []
    from .. import beverloo  # imports scipy.optimize
    for column in ("mu", "zeta"):
        table[column] = table[column].fillna(0.0) if column in table else 0.0
    lines, notes = [], []
    for i, group in enumerate(beverloo.fit_table(table).itertuples()):
        label = symbols.plain(group.label)
        data = group.data.sort_values("hopper_width")
        lines.append(line(data["hopper_width"], data["Q"], thin=False, kind="points", error=data["Q_error"], label=label, colour=i))
        fit = group.fit
        if fit is None:
            notes.append(f"{label}: {group.note}.")
            continue
        w = fit.k + (data["hopper_width"].max() * 1.03 - fit.k) * np.linspace(0, 1, 80) ** 2
        lines.append(line(w, fit(w), thin=False, colour=i))
        values = ", ".join(f"{symbol} = {with_error(getattr(fit, name), getattr(fit, name + '_error'))}"
                           for name, symbol in (("C", "C"), ("k", "k"), ("beta", "β")))
        chi2 = f", χ²/dof = {fit.chi2_reduced:.2g}" if math.isfinite(fit.chi2_reduced) else ""
        notes.append(f"{label}: {values}{chi2}." + (f" {fit.note}." if fit.note else ""))
    dim = int(table["dim"].iloc[0])
    return [{"title": "flow rate, with the law Q = C (w − k)ᵝ", "unit": f"sigma_avg^{dim}/t0", "x": {"label": "orifice width w", "unit": "sigma_avg"},
             "lines": lines, "note": " ".join(notes), "zero": True}]


def _name(curve):
    """Name of a curve of clogs, a row of points or fits."""
    return ", ".join([f"N = {curve.n:g}", f"φ_c = {curve.phi_c:g}", *filter(None, [symbols.plain(curve.series)])])


def _sigmoids(rows):
    table = _of(rows, "clog")
    if table.empty:
        return []
    from .. import clog_analysis  # imports lmfit
    if not set(clog_analysis.COLUMNS) <= set(table):
        return []
    table = pooling.once(table[table["status"].isin(clog_analysis.ENDED)], "clog")
    points, charts = clog_analysis.clog_points(table), []
    for along, label, unit in (("g", "gravity g", ""), ("hopper_width", "orifice width w/d", "")):
        if points[along].nunique() < 2:
            continue
        lines, notes = [], []
        for i, (_, group) in enumerate(points.groupby(["series", "n", "phi_c", "hopper_width" if along == "g" else "g"])):
            name = _name(group.iloc[0])
            half = (group["P_high"] - group["P_low"]) / 2
            lines.append(line(group[along], group["P"], thin=False, kind="points", error=half, label=name, colour=i))
        for i, fit in enumerate(clog_analysis.fit_sigmoids(points, along).itertuples()):
            if fit.fit is None:
                notes.append(f"{_name(fit)}: {fit.note}.")
                continue
            x = np.linspace(points[along].min(), points[along].max(), 100)
            lines.append(line(x, fit.fit(x), thin=False, colour=i))
            notes.append(f"{_name(fit)}: one half at {with_error(fit.x0, fit.x0_error)}.")
        charts.append({"title": "probability of a clog", "unit": "", "x": {"label": label, "unit": unit}, "lines": lines, "note": " ".join(notes), "zero": True})
    return charts


def _scatter(columns, rows):
    """The first results against the first option in which rows differ, for sweeps without a law to fit."""
    options = [c for c in columns if c.get("option") and c["numeric"] and c["name"] not in ("seed", "threads")]
    measured = [c for c in columns if c["numeric"] and not c.get("option")]
    if not options:
        return []
    x, charts = options[0], []
    for y in measured[:3]:
        known = [row for row in rows if y["name"] in row["values"] and x["name"] in row["values"]]
        if len(known) < 2:
            continue
        at = [row["values"][x["name"]] for row in known]
        value, error = zip(*(row["values"][y["name"]] for row in known))
        charts.append({"title": y["label"], "unit": y["unit"], "x": {"label": x["name"], "unit": x["unit"]},
                       "lines": [line(at, value, thin=False, kind="points", error=error, colour=len(charts))]})
    return charts
