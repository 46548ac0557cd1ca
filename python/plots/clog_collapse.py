#!/usr/bin/python3
"""Mean avalanche size and probability of a clog against w/delta*, with the laws [T 4.17-4.20]."""

import sys
from pathlib import Path

# In place of this folder, whose profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first: it says what this Python lacks

import matplotlib.pyplot as plt
import numpy as np

from pliant import clog, plotting, script


def effective_length(points, delta_crit):
    """delta* of each point, with the delta_crit given or, if it is None, that of the regimes of w*/d."""
    if delta_crit is None:
        fits = clog.fit_sigmoids(points, "hopper_width")
        known = fits[fits["fit"].notna()] if len(fits) else fits
        columns = [known[c] if len(known) else [] for c in ("delta", "x0", "x0_error")]
        delta_crit = clog.fit_regimes(*columns).delta_crit
    print(f"delta* = max(delta, {delta_crit:.3f})")
    return np.maximum(points["delta"], delta_crit)


def main():
    parser = script.parser(__doc__, "clog_collapse.py validation/clog/width/results.csv -o collapse.png",
                           "clog_collapse.png")
    parser.add_argument("table", nargs="+", help="results.csv of pliant-sweep, or run folders")
    parser.add_argument("--delta-crit", type=float,
                        help="delta below which cohesion does not count, in mean radii (default: from w*/d in the table)")
    arguments = script.arguments(parser)

    table, _ = clog.load_clogs(arguments.table)
    points = clog.clog_points(table)
    x = (2 * points["hopper_width"] / effective_length(points, arguments.delta_crit)).to_numpy()
    fit = clog.fit_avalanches(x, points["s"], points["s_error"], points["n"])
    print(f"A = {script.with_error(fit.A, fit.A_error)}, B = {script.with_error(fit.B, fit.B_error)}, "
          f"{fit.points} of {len(points)} points, chi2/dof {fit.chi2_reduced:.3g}")

    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(12.5, 3.9), layout="constrained")
    n = points["n"].max()
    # [T 4.3]: avalanches of other numbers of droplets as fractions.
    scale = n / points["n"]
    kinds = sorted(points["phi_c"].unique())
    for i, phi_c in enumerate(kinds):
        own = (points["phi_c"] == phi_c).to_numpy()
        style = {"fmt": plotting.MARKERS[i % len(plotting.MARKERS)], "color": plotting.COLORS[i % len(plotting.COLORS)],
                 "capsize": 2, "elinewidth": 0.9, "markeredgecolor": "white", "markeredgewidth": 0.4, "zorder": 3}
        of = points[own]
        s, error = of["s"] * scale[own], (of["s_error"] * scale[own]).fillna(0)
        left.errorbar(x[own], s, error, label=rf"$\phi_c$ = {phi_c:g}", **style)
        middle.errorbar(x[own] ** 2, np.log1p(of["s"]), error / (of["s"] + 1), **style)
        right.errorbar(x[own], of["P"], [of["P"] - of["P_low"], of["P_high"] - of["P"]], **style)
    grid = np.linspace(0, x.max() * 1.05, 400)
    left.plot(grid, np.minimum(clog.avalanche_law(grid, fit.A, fit.B), n), color="0.3", lw=1.2)
    left.axhline(n, ls="--", color="0.6", lw=0.9)
    line = np.log1p(clog.avalanche_law(grid, fit.A, fit.B))
    middle.plot(grid[line < 1.1 * np.log1p(n)] ** 2, line[line < 1.1 * np.log1p(n)], "--", color="0.3", lw=1.2)
    middle.axhline(np.log1p(clog.AVALANCHE_LIMIT * n), ls=":", color="0.6", lw=0.9)
    right.plot(grid, clog.clog_law(grid, fit.A, fit.B, n), "--", color="0.3", lw=1.2)
    left.set(xlabel=r"$w/\delta^*$", ylabel=r"$\langle s\rangle$", ylim=(0, 1.08 * n))
    middle.set(xlabel=r"$(w/\delta^*)^2$", ylabel=r"$\ln(\langle s\rangle + 1)$")
    right.set(xlabel=r"$w/\delta^*$", ylabel=r"$P_{clog}$", ylim=(-0.04, 1.04))
    left.legend()
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
