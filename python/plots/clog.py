#!/usr/bin/python3
"""Probability of a clog against gravity and against the width of the exit, with sigmoids, and where they reach 1/2."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt

from pliant import RunError
from pliant import clog_analysis as clog, plotting, script, symbols
from pliant.clog_figures import draw_curves, draw_middles, draw_regimes


def _series(row):
    """The cell with the name of the series, if there are several."""
    return [symbols.plain(row.series)] * bool(row.series)


def print_fits(fits, along):
    name = {"g": "g_0", "hopper_width": "w*/d"}[along]
    rows = [(*_series(row), f"{row.n:g}", f"{row.phi_c:g}", f"{row.delta:.3f}", len(row.data), row.data["runs"].sum(),
             *((script.with_error(row.x0, row.x0_error), script.with_error(row.alpha, row.alpha_error))
               if row.fit is not None else ("–", "–")), row.note) for row in fits.itertuples()]
    print(script.markdown([*["series"] * any(fits["series"]), "N", "phi_c", "delta", "points", "runs", name, "alpha", "note"], rows), end="\n\n")


def main():
    parser = script.parser(__doc__, "clog.py validation/clog/width/results.csv validation/clog/gravity/results.csv",
                           "clog.png")
    parser.add_argument("table", nargs="+", help="results.csv of pliant-sweep, or run folders")
    arguments = script.arguments(parser)

    table, left_out = clog.load_clogs(arguments.table)
    points = clog.clog_points(table)
    if left_out:
        print(f"{left_out} rows left out: not ended, or failed\n")
    print(script.markdown(
        [*["series"] * any(points["series"]), "N", "phi_c", "g", "w/d", "delta", "runs", "clogged", "P_clog", f"{100 * clog.CONFIDENCE:g} % interval", "s"],
        [(*_series(p), f"{p.n}", f"{p.phi_c:g}", f"{p.g:g}", f"{p.hopper_width:g}", f"{p.delta:.3f}", p.runs, p.clogged, f"{p.P:.2f}",
          f"{p.P_low:.2f} … {p.P_high:.2f}", script.with_error(p.s, p.s_error)) for p in points.itertuples()]), end="\n\n")
    curves = {along: fits for along in ("g", "hopper_width") if len(fits := clog.fit_sigmoids(points, along))}
    if not curves:
        raise RunError("all runs have one g and one width: no curve to draw (add rows to the table)")

    figure, axes = plt.subplots(len(curves), 2, figsize=(9.2, 3.8 * len(curves)), squeeze=False, layout="constrained")
    for (left, right), (along, fits) in zip(axes, curves.items()):
        print_fits(fits, along)
        draw_curves(left, fits, along)
        of_numbers = fits["phi_c"].nunique() == 1 and fits["n"].nunique() > 1
        if of_numbers or along == "g":
            draw_middles(right, fits, "n" if of_numbers else "phi_c", along)
            continue
        try:
            regimes = draw_regimes(right, fits)
        except RunError as error:
            print(f"{error}\n")
            continue
        print(f"w*/d = {script.with_error(regimes.low, regimes.low_error)} below delta = {regimes.delta_crit:.3f}, "
              f"({script.with_error(regimes.slope, regimes.slope_error)}) delta beyond\n")
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
