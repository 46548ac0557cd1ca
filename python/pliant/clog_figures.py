"""Clogs over many runs: code shared by their figures."""

import numpy as np

from . import clog_analysis as clog, plotting, symbols
from .errors import RunError
from .statistics import commonest

#: Labels of columns of clog.fit_sigmoids and of their abscissae (widths in mean diameters here); and of where P_clog
#: is one half.
SYMBOLS = {name: f"${symbols.SYMBOLS[name]}$" for name in ("phi_c", "n", "delta", "g")} | {"hopper_width": "$w/d$"}
MIDDLES = {"g": "$g_0$", "hopper_width": "$w^*/d$"}


def draw_curves(axes, fits, along):
    """One curve per row of `fits`: points with binomial intervals, and the sigmoid. Curves are named by the parameters that differ,
    phi_c or N, and by their series."""
    differ = [column for column in ("phi_c", "n") if fits[column].nunique() > 1] or ["phi_c"]
    for i, row in enumerate(fits.itertuples()):
        x, P, low, high = (row.data[c].to_numpy(float) for c in (along, "P", "P_low", "P_high"))
        plotting.errorbar(axes, x, P, [P - low, high - P], **plotting.points(i),
                          label=", ".join([*(f"{SYMBOLS[column]} = {getattr(row, column):g}" for column in differ), *filter(None, [row.series])]))
        if row.fit is not None:
            grid = np.linspace(x.min(), x.max(), 400)
            axes.plot(grid, row.fit(grid), color=plotting.color(i), lw=1.3)
    axes.set(ylabel=r"$P_{clog}$", ylim=(-0.04, 1.04), xlabel=SYMBOLS[along])
    axes.legend()


def draw_middles(axes, fits, x, along):
    """Where P_clog is one half, along `along`, against the column x, of each series."""
    for i, (series, known) in enumerate(fits[fits["fit"].notna()].groupby("series")):
        plotting.errorbar(axes, known[x], known["x0"], known["x0_error"], fmt="o", capsize=2.5, color=plotting.color(i), zorder=3,
                          label=series or None)
        if series:
            axes.legend()
    axes.set(xlabel=SYMBOLS[x], ylabel=MIDDLES[along])
    axes.ticklabel_format(axis="x", scilimits=(-3, 3), useMathText=True)


def draw_regimes(axes, fits):
    """w*/d against delta with its two regimes [T 4.12, 4.13], which are returned. Raises RunError for too few fits, and for several
    series."""
    draw_middles(axes, fits, "delta", "hopper_width")
    if fits["series"].nunique() > 1:
        raise RunError("runs of several series have no common regimes of w*/d: draw each series alone")
    known = fits[fits["fit"].notna()]
    if known.empty:
        raise RunError("no curve of P_clog passes one half: wider and narrower exits are needed")
    regimes = clog.fit_regimes(known["delta"], known["x0"], known["x0_error"])
    grid = np.linspace(0, known["delta"].max() * 1.05, 200)
    axes.plot(grid, regimes(grid), "--", color="0.4", lw=1.1, label=rf"{regimes.low:.3g} and {regimes.slope:.3g} $\delta$")
    axes.legend()
    return regimes


def _kinds(points):
    """Yields (rows of one phi_c, its style)."""
    for i, phi_c in enumerate(sorted(points["phi_c"].unique())):
        own = (points["phi_c"] == phi_c).to_numpy()
        yield own, phi_c, plotting.points(i)


def draw_avalanches(left, right, points, x, fit):
    """Mean avalanches of clog.clog_points against x = w/delta*, and ln(<s> + 1) against x², with [T 4.17, 4.18]."""
    n = commonest(points["n"])
    # [T Sec. 4.3]: avalanches of other numbers of droplets as fractions.
    scale = n / points["n"]
    for own, phi_c, style in _kinds(points):
        of = points[own]
        s, error = of["s"] * scale[own], of["s_error"] * scale[own]
        plotting.errorbar(left, x[own], s, error, label=rf"$\phi_c$ = {phi_c:g}", **style)
        plotting.errorbar(right, x[own] ** 2, np.log1p(of["s"]), error / (of["s"] + 1), **style)
    grid = np.linspace(0, x.max() * 1.05, 400)
    left.plot(grid, np.minimum(clog.avalanche_law(grid, fit.A, fit.B), n), color="0.3", lw=1.2)
    left.axhline(n, ls="--", color="0.6", lw=0.9)
    line = np.log1p(clog.avalanche_law(grid, fit.A, fit.B))
    right.plot(grid[line < 1.1 * np.log1p(n)] ** 2, line[line < 1.1 * np.log1p(n)], "--", color="0.3", lw=1.2)
    right.axhline(np.log1p(clog.AVALANCHE_LIMIT * n), ls=":", color="0.6", lw=0.9)
    left.set(xlabel=r"$w/\delta^*$", ylabel=r"$\langle s\rangle$", ylim=(0, 1.08 * n))
    right.set(xlabel=r"$(w/\delta^*)^2$", ylabel=r"$\ln(\langle s\rangle + 1)$")


def draw_probabilities(axes, points, x, fit):
    """P_clog against x = w/delta* with [T 4.19]."""
    for own, phi_c, style in _kinds(points):
        of = points[own]
        plotting.errorbar(axes, x[own], of["P"], [of["P"] - of["P_low"], of["P_high"] - of["P"]],
                          label=rf"$\phi_c$ = {phi_c:g}", **style)
    grid = np.linspace(0, x.max() * 1.05, 400)
    axes.plot(grid, clog.clog_law(grid, fit.A, fit.B, commonest(points["n"])), "--", color="0.3", lw=1.2,
              label=r"[T 4.19] of $\langle s\rangle$")
    axes.set(xlabel=r"$w/\delta^*$", ylabel=r"$P_{clog}$", ylim=(-0.04, 1.04))
