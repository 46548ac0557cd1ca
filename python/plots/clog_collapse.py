#!/usr/bin/python3
"""Mean avalanche size and probability of a clog against w/delta*, with the laws [T 4.17-4.20]."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt

from pliant import clog_analysis as clog, plotting, pooling, script
from pliant.clog_figures import draw_avalanches, draw_probabilities


def main():
    parser = script.parser(__doc__, "clog_collapse.py validation/clog/width/results.csv -o collapse.png",
                           "clog_collapse.png")
    parser.add_argument("table", nargs="+", help="results.csv of pliant-sweep, or run folders")
    parser.add_argument("--delta-crit", type=float,
                        help="delta below which cohesion does not count, in mean radii (default: from w*/d in the table)")
    arguments = script.arguments(parser)

    table, _ = clog.load_clogs(arguments.table)
    pooling.check(table, "clog", clog.POINT)
    points = clog.clog_points(table)
    delta_crit = clog.fitted_delta_crit(points) if arguments.delta_crit is None else arguments.delta_crit
    print(f"delta* = max(delta, {delta_crit:.3f})")
    x = clog.effective_width(points, delta_crit)
    fit = clog.fit_avalanches(x, points["s"], points["s_error"], points["n"])
    print(f"A = {script.with_error(fit.A, fit.A_error)}, B = {script.with_error(fit.B, fit.B_error)}, "
          f"{fit.points} of {len(points)} points, chi2/dof {fit.chi2_reduced:.3g}")

    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(plotting.PAGE, 3.6), layout="constrained")
    draw_avalanches(left, middle, points, x, fit)
    draw_probabilities(right, points, x, fit)
    left.legend(**plotting.ABOVE)
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
