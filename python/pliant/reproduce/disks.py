"""The figures of the thesis' chapter 3 and appendix A: disks that are pushed through a channel."""

import matplotlib.pyplot as plt
import numpy as np

from .. import ensemble, plotting
from ..beverloo_figures import log_axes
from ..channel_analysis import Choices
from ..channel_figures import LABELS
from ..errors import RunError
from ..script import with_error
from . import published
from .figure import Figure, Quantity
from .measure import DISTRIBUTION

DELTA = r"polydispersity  $\delta$"


def _points(measured, value):
    """Means over seeds of one size distribution each; two differ if their delta does in the third digit."""
    points = ensemble.average(measured.assign(delta=measured["polydispersity"].round(3)), ["delta"], value)
    if points.empty:
        raise RunError(f"no run has the quantity {value}")
    return points


def _line(points, value):
    """((slope, error), (value at delta = 0, error)) of a straight line in delta, drawn over seeds."""
    drawn = np.polyfit(points["delta"], ensemble.draws(points, value).T, 1)
    errors = ensemble.spread(drawn.T)
    return tuple(zip(np.polyfit(points["delta"], points[value], 1).tolist(), errors.tolist()))


def _draw_points(axes, points, value, label):
    plotting.errorbar(axes, points["delta"], points[value], points[value + "_error"], fmt="o", capsize=2.5,
                      color=plotting.COLORS[0], label="ours")
    axes.set(xlabel=DELTA, ylabel=label)


def _finish(axes):
    """Once all is drawn: from here on limits no longer follow."""
    axes.set(xlim=(0, None), ylim=(0, None))
    axes.legend()


def _mean(name, points, value, known, note=""):
    """Mean over all distributions; its error is of their seeds alone."""
    error = float(np.sqrt((points[value + "_error"].to_numpy() ** 2).sum())) / len(points)  # unknown if one is
    return Quantity(name, float(points[value].mean()), error, known, "; ".join(
        filter(None, [note, ensemble.seeds_remark(points)])))


def _draw_polydispersity(measured, end, mean_known, slope_known, offset_known):
    figure, (left, right) = plt.subplots(1, 2, figsize=(plotting.PAGE, 4.0), layout="constrained")
    delta = np.array([0, measured["polydispersity"].max() * 1.1])
    motion, local = (_points(measured, name + end) for name in ("dr_na", "d2_min"))
    _draw_points(left, motion, "dr_na" + end, LABELS["dr_na"])
    if mean_known:
        left.plot(delta, np.full(2, mean_known.value), "-.", color="0.3", label=f"[T] {mean_known.value:g}")
    _draw_points(right, local, "d2_min" + end, LABELS["d2_min_per_neighbour"])
    quantities = [_mean("dr_NA/<R>, mean of the distributions", motion, "dr_na" + end, mean_known)]
    if len(motion) > 2:
        (slope, error), _ = _line(motion, "dr_na" + end)
        quantities.append(Quantity("slope of dr_NA/<R> in delta", slope, error, published.NON_AFFINE_SLOPE))
        (slope, error), (offset, offset_error) = _line(local, "d2_min" + end)
        right.plot(delta, offset + slope * delta, color=plotting.COLORS[0], lw=1.2,
                   label=rf"({with_error(slope, error)}) $\delta$ + {with_error(offset, offset_error)}")
        quantities += [Quantity("slope of D2_min/<R>^2 in delta", slope, error, slope_known),
                       Quantity("D2_min/<R>^2 at delta = 0", offset, offset_error, offset_known)]
    if offset_known:
        right.plot(delta, offset_known.value + slope_known.value * delta, "-.", color="0.3",
                   label=rf"[T] {slope_known.value:g} $\delta$ + {offset_known.value:g}")
    else:  # through the middle of ours
        right.plot(delta, local["d2_min" + end].mean() + slope_known.value * (delta - local["delta"].mean()), "-.",
                   color="0.3", label=f"[T] slope {slope_known.value:g}")
    for axes in (left, right):
        _finish(axes)
    return figure, quantities


def draw_polydispersity(measured):
    """[T Fig. 3.11]: non-affine displacement and D2_min against polydispersity."""
    return _draw_polydispersity(measured, "", published.NON_AFFINE, published.D2_SLOPE, published.D2_OFFSET)


def draw_clock(measured):
    """[T Fig. 3.14]: the same over intervals of equal strain."""
    return _draw_polydispersity(measured, "_clock", None, published.D2_SLOPE_CLOCK, None)


def draw_intervals(measured):
    """[T Fig. 3.12]: the same against the interval, in the central square, with the exponents."""
    runs = measured.drop_duplicates(["table", "row"])
    figure, panels = plt.subplots(1, 2, figsize=(plotting.PAGE, 4.2), layout="constrained")
    quantities = []
    deltas = sorted(measured["polydispersity"].round(3).unique())
    colors = plt.get_cmap("viridis")(np.linspace(0, 0.85, len(deltas)))
    for axes, name, label, known in zip(panels, ("dr_na", "d2_min"), (LABELS["dr_na"], LABELS["d2_min_per_neighbour"]),
                                        (published.NON_AFFINE_POWER, published.D2_POWER)):
        for delta, color in zip(deltas, colors):
            curve = ensemble.average(measured[measured["polydispersity"].round(3) == delta], ["relative"], name)
            plotting.errorbar(axes, curve["relative"], curve[name], curve[name + "_error"], fmt="o", ms=3.5, color=color,
                              label=rf"$\delta$ = {delta:g}")
        x = np.array([measured["relative"].min(), measured["relative"].max()])
        middle = ensemble.average(measured, ["relative"], name).iloc[len(curve) // 2]
        axes.plot(x, middle[name] * (x / middle["relative"]) ** known.value, "-.", color="0.3",
                  label=f"[T] slope {known.value:g}")
        axes.set(xlabel=r"$\Delta t/\Delta t_0$", ylabel=label)
        log_axes(axes)
        axes.legend()
        quantities.append(_mean(f"exponent of {name} in the interval, centre", _points(runs, "exponent_" + name),
                                "exponent_" + name, known))
    return figure, quantities


def draw_rotation(measured):
    """[T A.2]: rotation against polydispersity, in the central square."""
    figure, axes = plt.subplots(figsize=(5.4, 4.0), layout="constrained")
    points = _points(measured, "rotation")
    _draw_points(axes, points, "rotation", LABELS["rotation"])
    known = published.ROTATION.value
    axes.axhline(known * 2 * np.pi, ls="-.", color="0.3", label=f"[T] {known:g}, if that is in turns")
    axes.axhline(known, ls=":", color="0.3", label=f"[T] {known:g}, if that is in rad")
    _finish(axes)
    turns = points.assign(rotation=points["rotation"] / (2 * np.pi), rotation_error=points["rotation_error"] / (2 * np.pi),
                          values=[values / (2 * np.pi) for values in points["values"]])
    quantities = [_mean("|dtheta|, mean of the distributions", points, "rotation", published.ROTATION, "in rad; [T] gives no unit"),
                  _mean("|dtheta| in turns, mean of the distributions", turns, "rotation", published.ROTATION,
                        "[T] gives no unit")]
    if len(turns) > 2:
        (slope, error), _ = _line(turns, "rotation")
        quantities.append(Quantity("slope of |dtheta| in turns in delta", slope, error, published.ROTATION_SLOPE))
        quantities += [Quantity(f"|dtheta| in turns at delta = {row['delta']:g}", row["rotation"], row["rotation_error"])
                       for _, row in turns.sort_values("delta").iloc[[0, -1]].iterrows()]
    return figure, quantities


def draw_neighbours(measured):
    """D2_min with 11 and 20 neighbours, which [T Sec. 3.3] tried, over D2_min with 15."""
    usual = measured[measured["neighbours"] == Choices().neighbours].set_index(["table", "row"])
    figure, axes = plt.subplots(figsize=(5.4, 4.0), layout="constrained")
    quantities = []
    for value, when in (("d2_min", ""), ("d2_min_clock", ", equal strains")):
        ratios = measured.assign(ratio=[row[value] / usual.loc[(row["table"], row["row"]), value] for _, row in measured.iterrows()])
        points = ensemble.scatter(ratios[ratios["neighbours"] != Choices().neighbours], ["distribution", "neighbours"], "ratio")
        plotting.errorbar(axes, points["neighbours"], points["ratio"], points["ratio_error"], fmt="o", capsize=2.5,
                          label="one interval" if not when else "equal strains")
        quantities += [Quantity(f"D2_min, {row.neighbours} over {Choices().neighbours} neighbours{when}, {row.distribution}",
                                row.ratio, row.ratio_error, None, 'T 3.3 "similar results", without a number')
                       for row in points.itertuples()]
    axes.axhline(1, color="0.6", lw=0.9)
    axes.set(xlabel="neighbours", ylabel=r"$D^2_{min}$ over $D^2_{min}$ with 15 neighbours")
    axes.legend()
    return figure, quantities


_ALL = ("channel/pair", "channel/distributions")
_QUICK = "four size distributions, two seeds, twice the speed, fewer pushes"
FIGURES = [
    Figure("T3.11", "non-affine motion of disks against polydispersity", ("quick/channel",), _ALL,
           "motion", draw_polydispersity, _QUICK, tells=DISTRIBUTION),
    Figure("T3.12", "non-affine motion of disks against the interval", ("quick/channel",), _ALL,
           "intervals", draw_intervals, _QUICK, tells=DISTRIBUTION),
    Figure("T3.14", "non-affine motion of disks over equal strains against polydispersity", ("quick/channel",),
           _ALL, "motion", draw_clock, _QUICK, tells=DISTRIBUTION),
    Figure("TA.2", "rotation of disks against polydispersity", ("quick/channel",), _ALL, "motion",
           draw_rotation, _QUICK, tells=DISTRIBUTION),
    Figure("T3.neighbours", "D2_min of disks with 11, 15 and 20 neighbours", ("quick/channel",), ("channel/pair",),
           "neighbours", draw_neighbours, _QUICK, tells=DISTRIBUTION),
]
