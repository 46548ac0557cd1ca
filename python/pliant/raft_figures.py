"""Code shared by the figures of many rafts."""

import numpy as np

from . import ensemble, plotting, raft_analysis as raft

#: name of the figure → (column of raft.fractures, its label, the averaged column, or None: one of raft.JUDGEMENTS, its label)
FRACTURES = {
    "phi": ("phi", r"fraction of small droplets  $\phi$", "excess", "excess peaks  $\\Delta N$"),
    "delta": ("delta", r"polydispersity  $\delta$", "peaks", "peaks"),
    "size": ("inverse_size", "$N^{-1/2}$", None, "fraction of the reductions"),
    "aspect": ("aspect", "$q/p$", None, "fraction of the reductions"),
    "tilt": ("tilt", "tilt  [degrees]", None, "fraction of the reductions"),
}
#: Options that the columns of raft.fractures distinguish.
VARIABLES = ("rows", "columns", "n", "small_fraction", "small_radius", "delta", "tilt")


def draw_stiffness(axes, reductions, k1):
    """k_eq against q/(p+1) of reductions (with n and the two droplets' k1), and the line of the fitted `k1` [T 2.32]."""
    for i, (n, table) in enumerate(reductions.groupby("n")):
        plotting.errorbar(axes, table["x"], table["k_eq"], table["k_error"], ls="", label=f"$N = {n}$", **plotting.symbol(i))
    x = np.array([0, reductions["x"].max()])
    two = reductions["k1"].iloc[0]
    axes.plot(x, k1 * x, color="black", label=f"$k_1 = {k1:.2f}$")
    axes.plot(x, two * x, "--", color="0.5", label=f"two droplets, $k_1 = {two:.2f}$")
    axes.set(xlabel="$q/(p+1)$", ylabel="$k_{eq}$")
    axes.legend()


def inverse_rows(reductions):
    """(p³ + p²)^(-1/2), to which F_max/N is proportional [T 2.37]."""
    return (reductions["rows"] ** 3 + reductions["rows"] ** 2) ** -0.5


def draw_peaks(axes, reductions):
    """F_max/N against (p³ + p²)^(-1/2), and [T 2.37] with k1 and E1 of two droplets."""
    for i, (n, table) in enumerate(reductions.groupby("n")):
        axes.plot(inverse_rows(table), table["F_max"] / n, ls="", label=f"$N = {n}$", **plotting.symbol(i))
    u = np.array([0, inverse_rows(reductions).max()])
    slope = 2 * np.sqrt(reductions["k1"].iloc[0] * reductions["E1"].iloc[0])
    axes.plot(u, slope * u, "--", color="0.5", label=r"$2\sqrt{k_1E_1/(p^3+p^2)}$")
    axes.set(xlabel="$(p^3+p^2)^{-1/2}$", ylabel="$F_{max}/N$")
    axes.legend()


def fracture_points(data, kind, judgement="competing"):
    """(points, settings, y) of raft.fractures: points, as of ensemble.scatter, has the means of the column y over runs that
    differ in nothing but the seed, that is, not in the columns `settings`. Rows of `data` may have the name of their series.
    `judgement`: one of raft.JUDGEMENTS, where the figure is of competing fractures."""
    x, _, y, _ = FRACTURES[kind]
    several = "series" in data and bool(data["series"].any())
    settings = list(dict.fromkeys([*["series"] * several, x, "n", "rows", "phi", "delta", "tilt"]))
    points = ensemble.scatter(data, settings, y) if y else ensemble.scatter(data, settings, judgement, "reductions")
    return points, settings, y or judgement


def draw_fractures(axes, points, kind, y):
    """Points of fracture_points, by series, and by N where it is not on the axis; for excess peaks the fitted law [T 2.39].
    Returns [(group, height of the law, its error)]."""
    x, x_label, _, y_label = FRACTURES[kind]
    by = [*["n"] * (kind in ("phi", "delta", "tilt")), *["series"] * ("series" in points)]
    heights = []
    for i, (key, group) in enumerate(ensemble.groups(points, by) if by else [((), points)]):
        name = ", ".join(f"$N = {value}$" if column == "n" else value for column, value in zip(by, key)) or None
        plotting.errorbar(axes, group[x], group[y], group[y + "_error"], ls="", capsize=2, label=name, **plotting.symbol(i))
        if kind == "phi" and (group[y] * group[x] * (1 - group[x])).sum() > 0:
            peak, error = raft.fit_excess(group[x], group[y])
            phi = np.linspace(0, 1, 200)
            axes.plot(phi, raft.excess_fractures(phi, peak), color=plotting.color(i), lw=1)
            heights.append((name, peak, error))
    axes.set(xlabel=x_label, ylabel=y_label)
    axes.set_ylim(bottom=min(0, axes.get_ylim()[0]))
    if by:
        axes.legend()
    return heights
