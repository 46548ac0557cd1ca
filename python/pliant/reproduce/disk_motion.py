"""The figures of the thesis' chapter 3 and appendix A that show where, next to which neighbours, and of which size disks
deviate from the mean motion, and how this depends on choices that the thesis leaves open."""

import textwrap

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from .. import channel_figures, ensemble, plotting
from ..channel_figures import LABELS, R
from ..errors import RunError
from ..statistics import commonest
from ..symbols import defaults
from . import published
from .figure import Figure, Quantity
from .measure import CHANNEL_OPTIONS, DISTRIBUTION

MOTION = ("dr_na", "d2_min")
TEXT = {"dr_na": "dr_NA/<R>", "d2_min": "D2_min/<R>^2"}
LABEL = {"dr_na": LABELS["dr_na"], "d2_min": LABELS["d2_min_per_neighbour"]}


def _by_delta(measured):
    """[(distribution, its rows)], the least polydisperse first."""
    order = measured.groupby("distribution")["polydispersity"].mean().sort_values().index
    return [(name, measured[measured["distribution"] == name]) for name in order]


def _two(measured):
    """The two distributions that the thesis shows; if one is missing, the distributions with the smallest and the
    largest delta."""
    found = _by_delta(measured)
    wanted = [one for one in found if one[0] in ("bidisperse", "T4")]
    return wanted if len(wanted) == 2 else [found[0], found[-1]][:len(found)]


def _over_runs(name, rows, function, known=None, note="", floor=0.0):
    """Mean of function(rows of a run) over runs with the scatter of the runs; `floor` is an error of every run alike."""
    values = np.array([function(group) for _, group in rows.groupby(["table", "row"], sort=True)], float)
    values = values[np.isfinite(values)]
    error = np.hypot(values.std(ddof=1) / np.sqrt(len(values)), floor) if len(values) > 1 else np.nan
    return Quantity(name, float(values.mean()) if len(values) else np.nan, float(error), known, note)


def _mean_cells(rows):
    """A row per cell: means over the runs that have it, as long as half of them do."""
    count = rows.groupby(["x", "y"])["count"].size()
    mean = rows.drop(columns=["distribution", "row", "commit", "table"]).groupby(["x", "y"]).mean()
    return mean[count >= count.max() / 2].reset_index()


# ---- sizes -----------------------------------------------------------------------------------------------------------

def draw_histogram(measured):
    """[T Fig. 3.4]: numbers of disks of each size; polydispersity of every distribution."""
    found = _by_delta(measured)
    shown = [one for one in found if one[1]["radius"].round(4).nunique() > 3] or found
    figure, axes = plt.subplots(figsize=(6.2, 3.8), layout="constrained")
    radii = np.unique(measured["radius"].round(4))
    width = 0.8 * (np.diff(radii).min() if len(radii) > 1 else radii[0]) / len(shown)
    for i, (name, rows) in enumerate(shown):
        mean = rows.groupby(rows["radius"].round(4))["disks"].mean()
        axes.bar(mean.index + width * (i - (len(shown) - 1) / 2), mean, width, color=plotting.color(i),
                 label=rf"{name}, $\delta$ = {rows['polydispersity'].mean():.2f}")
    axes.set(xlabel="$R$  [cm]", ylabel="disks")
    axes.legend()
    return figure, [Quantity(f"delta of {name}", rows["polydispersity"].mean(), 0.0, published.DELTA.get(name))
                    for name, rows in found]


def _draw_against_size(measured, prefix, ylabel):
    figure, panels = plt.subplots(1, 2, figsize=(plotting.PAGE, 4.2), layout="constrained")
    for i, (name, rows) in enumerate(_by_delta(measured)):
        for axes, quantity in zip(panels, MOTION):
            points = ensemble.average(rows.assign(size=rows["relative_radius"].round(3)), ["size"], prefix + quantity)
            plotting.errorbar(axes, points["size"], points[prefix + quantity], points[prefix + quantity + "_error"],
                              ls="-" if prefix == "" else "", lw=0.8, capsize=2, elinewidth=0.8, ms=4.5, label=name,
                              **plotting.symbol(i))
            axes.set(xlabel=rf"$R/{R}$", ylabel=ylabel.format(LABEL[quantity]))
    panels[0].legend(ncols=2, fontsize="small")
    return figure, panels


def _ends(rows, column):
    """Values of the largest and of the smallest disks of a run; the largest are those down to three quarters of the
    radius, as the thesis joins them."""
    rows = rows.sort_values("radius")
    large = rows[rows["radius"] > 0.75 * rows["radius"].max()]
    large = large[np.isfinite(large[column])]
    return np.average(large[column], weights=large["disks"]) if len(large) else np.nan, rows[column].iloc[0]


def draw_sizes(measured):
    """[T Fig. 3.8]: non-affine motion against size."""
    figure, panels = _draw_against_size(measured, "", "{}")
    for axes in panels:
        axes.set_ylim(bottom=0)
    quantities = []
    for name, rows in _by_delta(measured):
        if rows["radius"].max() < 2 * rows["radius"].min():
            continue
        wide = rows["radius"].max() > 4.9 * rows["radius"].min()
        for quantity in MOTION:
            for prefix, where in (("", ""), ("relative_", ", in the same cells")):
                known = published.LARGEST if wide and (prefix, quantity) == ("", "dr_na") else None

                def ratio(run, column=prefix + quantity):
                    large, small = _ends(run, column)
                    return large / small
                quantities.append(_over_runs(f"{TEXT[quantity]} of the largest disks over the smallest, {name}{where}",
                                             rows, ratio, known))
    return figure, quantities


def draw_peaks(measured):
    """[T Fig. 3.10]: how much disks of a size add to the motion next to them."""
    figure, panels = _draw_against_size(measured, "peak_", "peak less mean of  {}")
    quantities = []
    for axes, quantity in zip(panels, MOTION):
        axes.axhline(0, color="0.7", lw=0.8, zorder=0)

        def slope(run, column="peak_" + quantity):
            good = np.isfinite(run[column])
            return np.polyfit(run["relative_radius"][good], run[column][good], 1)[0] if good.sum() > 1 else np.nan
        for name, rows in _by_delta(measured):
            if rows["radius"].round(4).nunique() > 1:
                quantities.append(_over_runs(f"slope of the peak of {TEXT[quantity]} in R/<R>, {name}", rows, slope))
    return figure, quantities


def draw_distances(measured):
    """[T Fig. 3.9]: non-affine motion against the distance from a disk of each size."""
    found = _two(measured)
    figure, panels = plt.subplots(len(found), 2, figsize=(plotting.PAGE, 3.7 * len(found)), layout="constrained", squeeze=False)
    quantities = []
    for (name, rows), pair in zip(found, panels):
        smallest = rows["radius"].min()
        for axes, quantity in zip(pair, MOTION):
            for i, (radius, part) in enumerate(rows.groupby(rows["radius"].round(4))):
                curve = ensemble.scatter(part.assign(at=part["distance"].round(4)), ["at"], quantity)
                value, error = curve[quantity], curve[quantity + "_error"].fillna(0)
                axes.plot(curve["at"], value, color=plotting.color(i), label=f"from disks of $R$ = {radius:.3g} cm")
                axes.fill_between(curve["at"], value - error, value + error, color=plotting.color(i), alpha=0.2, lw=0)
            known = rows[np.isfinite(rows[quantity])]
            axes.axhline(np.average(known[quantity], weights=known["count"]), ls="--", color="0.5", lw=0.9, label="mean")
            axes.set(xlabel="distance of the surfaces  [cm]", ylabel=LABEL[quantity], xlim=(0, None),
                     title=rf"{name}, $\delta$ = {rows['polydispersity'].mean():.2f}")
        pair[0].legend(fontsize="small")
        largest = rows[rows["radius"] > 0.999 * rows["radius"].max()]
        bins = np.unique(rows["distance"])
        floor = np.diff(bins).min() / np.sqrt(12) if len(bins) > 1 else 0.0

        def place(run, low, high, pick):
            run = run[(run["distance"] > low) & (run["distance"] < high) & np.isfinite(run["dr_na"])]
            return run["distance"].iloc[pick(run["dr_na"].to_numpy())] if len(run) else np.nan
        quantities += [
            _over_runs(f"distance of the peak of dr_NA from the largest disks in cm, {name}", largest,
                       lambda run: place(run, 0, 2 * smallest, np.argmax), published.PEAK_DISTANCE, floor=floor),
            _over_runs(f"distance of the next minimum of dr_NA in cm, {name}", largest,
                       lambda run: place(run, 1.3 * smallest, 3 * smallest, np.argmin), published.VALLEY_DISTANCE,
                       floor=floor)]
    return figure, quantities


# ---- places ----------------------------------------------------------------------------------------------------------

def draw_field(measured):
    """[T Fig. 3.5]: mean displacement."""
    figure, axes = plt.subplots(figsize=(6.4, 5.4), layout="constrained")
    cells = _mean_cells(measured)
    arrows = channel_figures.draw_field(axes, cells, cells["travel"].mean(), cells["width"].mean())
    figure.colorbar(arrows, ax=axes, label=r"mean displacement  $|\Delta r_{mean}|$  [cm]")
    quantities = []
    for name, rows in _by_delta(measured):
        def speed(run, where):
            part = run[where(run)]
            return (np.hypot(part["mean_x"], part["mean_y"]) / part["travel"]).mean() if len(part) else np.nan
        # The channel is 20.5 cm wide; the plunger ends its stroke at x = 27 cm.
        for text, where in (("in the inlet", lambda c: (c["x"] > 20.5) & (c["x"] < 27)),
                            ("in the outer corner", lambda c: (c["x"] < 3.2) & (c["y"] < 3.2)),
                            ("in the middle of the outlet", lambda c: (c["y"] > 20.5) & (abs(c["x"] - 10.25) < 3.2)),
                            ("at the walls of the outlet",
                             lambda c: (c["y"] > 20.5) & (abs(c["x"] - 10.25) > 7.0))):
            quantities.append(_over_runs(f"mean displacement over the plunger's, {text}, {name}", rows,
                                         lambda run: speed(run, where)))
    return figure, quantities


def _map(axes, cells, name, **options):
    result = {"cells": cells, "choices": {"cell": cells["width"].mean()}, "source": "these runs"}
    return channel_figures.cell_map(axes, result, name, **options)


def draw_clock_maps(measured):
    """[T Fig. 3.13]: interval, strain and D2_min over the channel, for one interval and for equal strains."""
    (name, rows), *_ = _two(measured)
    cells = _mean_cells(rows)
    seconds = cells["time"].mean() / cells["travel"].mean()
    cells = cells.assign(interval=cells["time"].mean(), clock_interval=seconds * cells["clock"])
    figure, panels = plt.subplots(2, 3, figsize=(plotting.PAGE, 5.6), layout="constrained")
    columns = ((("interval", "clock_interval"), r"$\Delta t$  [s]", "cividis"),
               (("strain", "clock_strain"), "strain  $|DF|$", "magma"),
               (("d2_min", "clock_d2_min"), LABEL["d2_min"], "viridis"))
    for k, (pair, label, colors) in enumerate(columns):
        values = cells[list(pair)].to_numpy(float)
        top = np.nanquantile(values, 0.99) if np.isfinite(values).any() else 1.0
        for axes, column in zip(panels[:, k], pair):
            mesh = _map(axes, cells, column, cmap=colors, vmin=0, vmax=top)
        figure.colorbar(mesh, ax=panels[:, k], label=label, extend="max", aspect=40)
    panels[0, 0].set_title(f"{name}: one interval")
    panels[1, 0].set_title("equal strains")

    def spread(column):
        def function(run):
            both = run[np.isfinite(run["d2_min"]) & np.isfinite(run["clock_d2_min"])]
            return both[column].std() / both[column].mean() if len(both) > 2 else np.nan
        return function
    return figure, [
        _over_runs(f"correlation of D2_min with the strain over cells, {name}", rows,
                   lambda run: run["d2_min"].corr(run["strain"])),
        _over_runs(f"spread of D2_min over cells, over its mean, one interval, {name}", rows, spread("d2_min")),
        _over_runs(f"spread of D2_min over cells, over its mean, equal strains, {name}", rows, spread("clock_d2_min"))]


def draw_rotations(measured):
    """[T A.1]: rotation against displacement and non-affine motion of the cells."""
    found = _two(measured)
    if not np.isfinite(measured["rotation"]).any():
        raise RunError("no run has the quantity rotation")
    figure, panels = plt.subplots(3, len(found), figsize=(min(4.8 * len(found), plotting.PAGE), 9.6), layout="constrained", squeeze=False,
                                  sharey=True)
    quantities = []
    for (name, rows), column in zip(found, panels.T):
        cells = _mean_cells(rows)
        inside = cells["centre"] > 0.5
        for axes, quantity, text in zip(column, ("displacement", *MOTION), ("the displacement", "dr_NA", "D2_min")):
            for mask, color, label in ((~inside, plotting.COLORS[0], "outside"),
                                       (inside, plotting.COLORS[1], "central square")):
                axes.plot(cells[quantity][mask], cells["rotation"][mask], "o", color=color, ms=4, alpha=0.8, mew=0,
                          label=label)
            axes.set(xlabel=LABEL.get(quantity) or LABELS[quantity], xlim=(0, None), ylim=(0, None))
            quantities.append(_over_runs(f"correlation of |dtheta| with {text} over cells, {name}", rows,
                                         lambda run, column=quantity: run["rotation"].corr(run[column])))
        column[0].set_title(rf"{name}, $\delta$ = {rows['polydispersity'].mean():.2f}")
    for axes in panels[:, 0]:
        axes.set_ylabel(LABELS["rotation"])
    panels[0, 0].legend()
    return figure, quantities


# ---- single disks ----------------------------------------------------------------------------------------------------

def _first_run(rows):
    """Rows of one run."""
    return rows[(rows["table"] == rows["table"].iloc[0]) & (rows["row"] == rows["row"].iloc[0])]


def draw_snapshots(measured):
    """[T Fig. 3.6]: displacement, non-affine displacement and D2_min of every disk at one time."""
    found = [(name, _first_run(rows)) for name, rows in _two(measured)]
    figure, panels = plt.subplots(3, len(found), figsize=(min(5.4 * len(found), plotting.PAGE), 12.0), layout="constrained", squeeze=False)
    for (name, shot), column in zip(found, panels.T):
        place, mean_radius = shot[["x", "y"]].to_numpy(), shot["mean_radius"].iloc[0]
        shift = shot[["dx", "dy"]].to_numpy()
        off = shift - shot[["mean_x", "mean_y"]].to_numpy()
        for axes, values, label, arrows, colors in (
                (column[0], np.hypot(*shift.T) / mean_radius, LABELS["displacement"], shift, "viridis_r"),
                (column[1], shot["dr_na"].to_numpy(), LABEL["dr_na"], off, "magma_r"),
                (column[2], shot["d2_min"].to_numpy(), LABEL["d2_min"], None, "cividis_r")):
            disks = channel_figures.draw_disks(axes, place, shot["radius"].to_numpy(), values, colors)
            if arrows is not None:
                axes.quiver(*place.T, *arrows.T, angles="xy", scale_units="xy", scale=1, width=0.003, color="black")
            figure.colorbar(disks, ax=axes, label=label, extend="max")
        start = shot["start"].iloc[0]
        column[0].set_title(f"{name}, from {start:.3g} to {start + shot['travel'].iloc[0]:.3g} cm of travel")
    return figure, []


def draw_neighbours(measured):
    """[T Fig. 3.7]: the neighbours of a largest and of a smallest disk."""
    name, rows = _two(measured)[-1]
    shot = _first_run(rows)
    place, radius = shot[["x", "y"]].to_numpy(), shot["radius"].to_numpy()
    figure, axes = plt.subplots(figsize=(6.2, 5.6), layout="constrained")
    channel_figures.draw_neighbourhoods(axes, place, radius, [
        (np.flatnonzero(shot[column] == 2)[0], np.flatnonzero(shot[column] == 1)) for column in ("largest", "smallest")])
    axes.legend(loc="upper right", title=name)
    return figure, []


# ---- choices that the thesis leaves open -------------------------------------------------------------------------------

_SHORT = {"area_fraction": "area fraction", "mu_disk": r"$\mu$ disks", "mu_wall": r"$\mu$ walls",
          "mu_plunger": r"$\mu$ plungers", "mu_base": r"$\mu$ base", "base_coupled": "base coupled",
          "plunger_speed": "speed [cm/s]", "retract_speed": "retraction [cm/s]", "stiffness": "stiffness [g/s²]",
          "restitution": "restitution", "dt": "step [s]"}
_SHORT |= {name + "_dynamic": text + ", dynamic" for name, text in _SHORT.items() if name.startswith("mu_")}


def choices(measured):
    """The rows with the columns `changed`, the options in which a run differs from most runs, and `label`, the same as text.
    The reference has, option by option, the value of most runs."""
    def text(value):
        if pd.isna(value):
            return ""
        return f"{value:g}" if isinstance(value, (int, float)) and not isinstance(value, bool) else str(value)

    # Results stored before an option was added lack it and had its default.
    usual = {name: value for name, value in defaults("channel").items() if value is not None}
    options = measured.reindex(columns=CHANNEL_OPTIONS).fillna(usual).apply(lambda column: column.astype(object).map(text))
    different = options.drop_duplicates()
    common = commonest(different)
    changed, labels = [], []
    for _, row in options.iterrows():
        off = [name for name in CHANNEL_OPTIONS if row[name] != common[name]]
        parts = []
        for name in (n for n in off if not (n.endswith("_dynamic") and n.removesuffix("_dynamic") in off)):
            value = row[name] + (f"/{row[name + '_dynamic']}" if name + "_dynamic" in off else "")
            parts.append((name, value))
        changed.append(", ".join(f"{name} = {value}" for name, value in parts))
        labels.append(", ".join(f"{_SHORT.get(name, name)} {value}" for name, value in parts))
    return measured.assign(changed=changed, label=labels)


def draw_choices(measured):
    """Non-affine motion with one choice changed at a time, next to the reference."""
    measured = choices(measured)
    named = measured["distribution"].value_counts()
    found = [(name, rows) for name, rows in _by_delta(measured)
             if rows["changed"].nunique() > 1 and (rows["changed"] == "").any()]
    if not found:
        raise RunError(f"no distribution ({', '.join(named.index)}) has runs of the reference and runs with one choice "
                       "changed")
    order = [c for c in dict.fromkeys(measured.sort_values(["changed"])["changed"]) if c]
    columns = (("dr_na", LABEL["dr_na"]), ("d2_min", LABEL["d2_min"]), ("exponent_dr_na", r"exponent of $\Delta r_{NA}$"),
               ("exponent_d2_min", r"exponent of $D^2_{min}$"), ("rotation", LABELS["rotation"]))
    figure, panels = plt.subplots(1, len(columns), figsize=(plotting.PAGE, max(1.4 + 0.26 * len(order), 3.2)), layout="constrained",
                                  sharey=True)
    quantities, places = [], {text: i for i, text in enumerate(order)}
    label = dict(zip(measured["changed"], measured["label"]))
    for i, (name, rows) in enumerate(found):
        color = plotting.color(i)
        for axes, (column, text) in zip(panels, columns):
            points = ensemble.average(rows, ["changed"], column).set_index("changed")
            value, error = points[column], points[column + "_error"].fillna(0)
            axes.axvspan(value[""] - error[""], value[""] + error[""], color=color, alpha=0.25, lw=0)
            at = [c for c in order if c in points.index]
            plotting.errorbar(axes, value[at], [places[c] + 0.2 * i for c in at], xerr=error[at], ls="", ms=4,
                              capsize=2, elinewidth=0.8, label=name, **plotting.symbol(i))
            axes.set(xlabel=text.replace(" of ", " of\n").replace(" per ", "\nper "))
            quantities += [Quantity(f"{column}, {name}" + (f", {c}" if c else ""), float(value[c]), float(
                points[column + "_error"][c])) for c in ["", *at]]
        for column, what in (("force", "mean"), ("largest_overlap", "max"), ("jammed", "sum")):
            if column in rows:
                value = rows.groupby("changed")[column].agg(what)
                quantities += [Quantity(f"{column}, {name}" + (f", {c}" if c else ""), float(value[c]), np.nan) for c in ["", *at]]
    panels[0].set_yticks(range(len(order)), [textwrap.fill(label[c], 50) for c in order], fontsize="small")
    panels[0].invert_yaxis()
    panels[0].legend(**plotting.ABOVE | {"bbox_to_anchor": (0, 1), "ncols": len(found)})
    return figure, quantities


_PAIR, _ALL = ("channel/pair",), ("channel/pair", "channel/distributions")
_QUICK = "two seeds, twice the speed, fewer pushes"


def _figure(name, title, full, measure, draw, quick_note=_QUICK, quick=("quick/channel",), tells=DISTRIBUTION):
    return Figure(name, title, quick, full, measure, draw, quick_note, tells=tells)


FIGURES = [
    _figure("T3.4", "numbers of disks of each size", _ALL, "sizes", draw_histogram,
            "four size distributions, two seeds, twice the speed, fewer pushes"),
    _figure("T3.5", "mean displacement of disks in the channel", _PAIR, "cells", draw_field),
    _figure("T3.6", "motion of every disk at one time", ("channel/snapshot",), "snapshots", draw_snapshots),
    _figure("T3.7", "neighbours of a large and of a small disk", ("channel/snapshot",), "snapshots", draw_neighbours),
    _figure("T3.8", "non-affine motion of disks against their size", _ALL, "sizes", draw_sizes,
            "four size distributions, two seeds, twice the speed, fewer pushes"),
    _figure("T3.9", "non-affine motion of disks against the distance from a disk", _PAIR, "distances", draw_distances),
    _figure("T3.10", "contribution of disks of each size to the motion next to them", _ALL, "sizes", draw_peaks,
            "four size distributions, two seeds, twice the speed, fewer pushes"),
    _figure("T3.13", "interval, strain and D2_min over the channel, with the strain clock", _PAIR, "cells",
            draw_clock_maps),
    _figure("TA.1", "rotation of disks against their motion", _PAIR, "cells", draw_rotations),
    _figure("T3.choices", "dependence of non-affine motion on choices that the thesis leaves open",
            ("channel/pair", "channel/dependence", "channel/dependence-bidisperse"), "motion", draw_choices,
            "size distribution T4 alone, two seeds, twice the speed, fewer pushes", ("quick/channel-choices",),
            (*DISTRIBUTION, *CHANNEL_OPTIONS)),
]
