"""Figures of jammed packings: their onset, the laws above it, packings of polygons, and steady shear."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from scipy.optimize import OptimizeWarning, curve_fit

from .. import ensemble, plotting
from ..beverloo_figures import groups_first, log_axes
from ..errors import RunError
from ..script import with_error
from ..symbols import MODEL_NAMES
from . import published
from .figure import Figure, Quantity

_PATH = ["path", "start_fraction", "start_pressure"]
_RATE = r"shear rate  $\dot\gamma\,t_0$"
_AT = 0.002  #: largest distance from a fraction that counts as this fraction
#: Largest p N² of a packing that counts as one without pressure: above it, packings have more contacts than the isostatic number.
_WITHOUT_PRESSURE = 0.02


def _last(measured):
    """The packing with the lowest pressure of each run."""
    return measured.loc[measured.groupby(["table", "row"])["pressure"].idxmin()]


def _line(x, y, error):
    """((slope, error), (offset, error)) of a straight line through points with errors; NaN for fewer than two points, errors NaN
    without errors of points."""
    if len(x) < 2:
        return ((np.nan, np.nan),) * 2
    weights = 1 / error if (np.isfinite(error) & (error > 0)).all() else None
    if weights is None:
        return tuple((value, np.nan) for value in np.polyfit(x, y, 1))
    values, covariance = np.polyfit(x, y, 1, w=weights, cov="unscaled")
    return tuple(zip(values.tolist(), np.sqrt(np.diag(covariance)).tolist()))


def _isostatic(packings):
    """d (N' - 1) + 1 of each packing."""
    return packings["dim"] * (packings["backbone"] - 1) + 1


def _counted(packings, remark=""):
    """Quantities: the fraction of packings that are isostatic, by number of particles."""
    share = packings.assign(isostatic=(packings["contacts"] == _isostatic(packings)).astype(float), one=1)
    pressure = packings["pressure"].max()
    return [Quantity(f"packings with d (N' - 1) + 1 contacts{remark}, N = {row.n}", row.isostatic, row.isostatic_error,
                     published.ISOSTATIC, decides=pressure * row.n**2 < _WITHOUT_PRESSURE)
            for row in ensemble.scatter(share, ["n"], "isostatic", trials="one").itertuples()]


def draw_onset(measured):
    """Fraction at the onset of jamming, its scatter and the contacts against the number of particles, for each path."""
    packings = _last(measured)
    if packings["dim"].nunique() > 1:
        raise RunError("there are disks and spheres, whose onsets differ: draw them from separate tables")
    dim = int(packings["dim"].iloc[0])
    power = -1 / (dim * published.ONSET_NU)
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(plotting.PAGE, 3.9), layout="constrained")
    quantities = []
    for i, (key, own) in enumerate(ensemble.groups(packings, _PATH)):
        path, fraction, pressure = key
        way = f", first p = {pressure:g}" if path == "decompress" else f", {path}"
        name = f"start at phi = {fraction:g}{way}"
        onset, contacts = (ensemble.scatter(own, ["n"], value) for value in ("fraction", "coordination"))
        n = onset["n"].to_numpy(float)
        (shift, _), limit = _line(n**power, onset["fraction"], onset["fraction_error"].to_numpy())
        plotting.errorbar(left, n**power, onset["fraction"], onset["fraction_error"],
                          label=name.replace("phi", r"$\phi$").replace("p =", "$p$ ="), **plotting.points(i))
        left.plot([0, (n**power).max()], limit[0] + shift * np.array([0, (n**power).max()]), color=plotting.color(i), lw=1.2)
        remark = ensemble.seeds_remark(onset)
        quantities.append(Quantity(f"phi_J, N to infinity, {name}", *limit, published.ONSET[dim], remark))
        quantities += [Quantity(f"phi_J, N = {row.n}, {name}", row.fraction, row.fraction_error) for row in onset.itertuples()]
        quantities += _scatter(middle, onset, i, name)
        (slope, _), limit = _line(1 / n, contacts["coordination"], contacts["coordination_error"].to_numpy())
        plotting.errorbar(right, 1 / n, contacts["coordination"], contacts["coordination_error"], **plotting.points(i))
        right.plot([0, (1 / n).max()], limit[0] + slope * np.array([0, (1 / n).max()]), color=plotting.color(i), lw=1.2)
        quantities.append(Quantity(f"Z, N to infinity, {name}", *limit, published.ONSET_Z[dim], remark))
        quantities += _counted(own, f", {name}")
    known = published.ONSET[dim]
    left.plot(0, known.value, "*", color="0.3", ms=9, ls="", clip_on=False, label=f"[O] {known.value:g}")
    left.set(xlabel=rf"$N^{{-1/({dim}\nu)}}$,  $\nu$ = {published.ONSET_NU:g}", ylabel=r"$\phi_J$")
    left.set_xlim(0)
    left.legend(**plotting.ABOVE | {"ncols": 1})
    log_axes(middle)
    middle.set(xlabel="$N$", ylabel=r"standard deviation of $\phi_J$")
    x = np.array([0, 1 / packings["n"].min()])
    right.plot(x, 2 * dim - 2 * (dim - 1) * x, "-.", color="0.3", lw=1, label=rf"isostatic, $2d - 2(d-1)/N$")
    right.set(xlabel="$1/N$", ylabel="contacts of a particle  $Z$")
    right.set_xlim(0)
    right.legend()
    return figure, quantities


def _scatter(axes, onset, i, name):
    """Draws the standard deviation of phi_J against N; the quantity is its exponent."""
    several = onset[onset["runs"] > 2]
    n, m = (several[column].to_numpy(float) for column in ("n", "runs"))
    width = np.array([values.std(ddof=1) for values in several["values"]])
    error = 1 / np.sqrt(2 * (m - 1))  # relative, of normally distributed values
    if len(n) < 2 or not (width > 0).all():
        return []
    (slope, slope_error), (offset, _) = _line(np.log(n), np.log(width), error)
    plotting.errorbar(axes, n, width, width * error, **plotting.points(i))
    axes.plot(n, np.exp(offset) * n**slope, color=plotting.color(i), lw=1.2)
    if i == 0:
        power = published.ONSET_WIDTH.value
        axes.plot(n, np.exp(offset + (slope - power) * np.log(n).mean()) * n**power, "-.", color="0.3", lw=1, zorder=1,
                  label=f"[O] slope {power:g}")
        axes.legend()
    return [Quantity(f"exponent of N in the standard deviation of phi_J, {name}", slope, slope_error, published.ONSET_WIDTH)]


def draw_laws(measured):
    """Pressure, contacts above the isostatic number and shear modulus against the distance from the onset, for each number of
    particles."""
    onset = _last(measured).set_index(["table", "row"])["fraction"]
    data = measured.assign(dphi=measured["fraction"] - onset[pd.MultiIndex.from_frame(measured[["table", "row"]])].to_numpy(),
                           excess=2 * (measured["contacts"] - _isostatic(measured)) / measured["backbone"], step=measured["pressure"])
    figure, panels = plt.subplots(1, 3, figsize=(plotting.PAGE, 3.7), layout="constrained")
    columns = {"p": ("pressure", r"$p$  [$\epsilon/\sigma_{avg}^d$]"), "Z - Z_iso": ("excess", r"$Z - Z_{iso}$"),
               "G": ("shear_modulus", r"$G$  [$\epsilon/\sigma_{avg}^d$]")}
    quantities, highest = [], data["pressure"].max()
    for i, ((n,), own) in enumerate(ensemble.groups(data, ["n"])):
        for axes, (name, (column, label)) in zip(panels, columns.items()):
            known = own[(own["dphi"] > 0) & own[column].notna()]
            if known.empty:
                continue
            table = {value: known.pivot_table(index=["table", "row"], columns="step", values=value) for value in ("dphi", column)}
            quantities += _slopes(table, column, name, n, highest)
            means = {value: one.mean() for value, one in table.items()}
            shown = means[column] > 0
            if not shown.any():  # an axis is logarithmic
                continue
            error = known.groupby("step")[column].sem()
            plotting.errorbar(axes, means["dphi"][shown], means[column][shown], error[shown], label=f"$N$ = {n}", **plotting.points(i))
            axes.set(xlabel=r"$\phi - \phi_J$", ylabel=label)
        quantities += _counted(_last(own), f" at p = {own['pressure'].min():g}")
    for axes, (name, _) in zip(panels, columns.items()):
        if not axes.has_data():
            continue
        power = published.JAMMED_POWER[name].value
        x = np.array(axes.dataLim.intervalx)
        line = axes.lines[0]
        axes.plot(x, line.get_ydata()[-1] * (x / line.get_xdata()[-1]) ** power, "-.", color="0.3", lw=1, zorder=1,
                  label=f"slope {power:g}")
        log_axes(axes)
        axes.legend()
    return figure, quantities


def _slopes(table, column, name, n, highest):
    """Quantities: slopes of means over runs over a factor of ten in pressure, from the highest pressure on. The published exponents
    are limits at the onset, so the lowest slope alone decides."""
    pressures = table["dphi"].columns.to_numpy()
    found = []
    for upper in (highest, highest / 10):
        ends = [np.flatnonzero(np.isclose(pressures, p, rtol=1e-3)) for p in (upper, upper / 10)]
        if any(len(end) != 1 for end in ends):
            continue
        x, y = (table[value].to_numpy()[:, [end[0] for end in ends]] for value in ("dphi", column))
        found.append(Quantity(f"slope of {name} in phi - phi_J, p = {upper:g} to {upper / 10:g}, N = {n}", *_slope(x, y),
                              published.JAMMED_POWER[name], decides=upper < highest))
    return found


def _slope(x, y):
    """(slope, error) of ln y in ln x between two states, of means over runs; x and y: [runs, 2]. The error is linear in the deviations
    of the runs, with their correlations. NaN if a mean is not positive, the error also for one run."""
    x, y = (values[np.isfinite(x + y).all(1)] for values in (x, y))
    if len(x) == 0 or min(x.mean(0).min(), y.mean(0).min()) <= 0:
        return np.nan, np.nan
    span = np.log(x.mean(0)[0] / x.mean(0)[1])
    slope = np.log(y.mean(0)[0] / y.mean(0)[1]) / span
    of_runs = (np.diff(y / y.mean(0)) - slope * np.diff(x / x.mean(0)))[:, 0] / span
    return slope, of_runs.std(ddof=1) / np.sqrt(len(x)) if len(x) > 1 else np.nan


def _shape(row):
    """The shape parameter of a row; a regular polygon has the option 0."""
    n = row["n_vertices"]
    return row["shape_parameter"] or n * np.tan(np.pi / n) / np.pi


def draw_polygons(measured):
    """Fractions, and contacts of a particle, of packings of polygons at the lowest pressure, against the rest shape."""
    packings = _last(measured)
    packings = packings.assign(shape=[_shape(row) for _, row in packings.iterrows()],
                               vertex_contacts=2 * packings["contacts"] / packings["backbone"],
                               held=packings["backbone"] / packings["n"])
    figure, (left, right) = plt.subplots(1, 2, figsize=(plotting.PAGE, 4.3), layout="constrained")
    quantities, kinds = [], ensemble.groups(packings, ["model", "n", "n_vertices", "k_b"])
    panels = [(left, "rim_fraction", "phi with rims", r"$\phi$ with rims"), (left, "fraction", "phi", r"$\phi$"),
              (right, "coordination", "touching particles of a particle", "touching particles"),
              (right, "vertex_contacts", "contacts of a particle", "contacts of vertices")]
    for i, ((model, n, vertices, k_b), own) in enumerate(kinds):
        name = f"{model}, N = {n}, n_v = {vertices:g}, K_b = {k_b:g}"
        for turn, (axes, column, words, label) in enumerate(panels):
            points = ensemble.scatter(own, ["shape"], column)
            kind = f", {MODEL_NAMES[model]}, $N$ = {n}, $n_v$ = {vertices:g}, $K_b$ = {k_b:g}" if len(kinds) > 1 else ""
            plotting.errorbar(axes, points["shape"], points[column], points[column + "_error"], ls="-", capsize=2.5, lw=1.1,
                              label=label + kind, **plotting.symbol(i, turn % 2))
            for row in points.itertuples():
                at = column == "rim_fraction" and np.isclose(row.shape, published.CONFLUENT_SHAPE)
                quantities.append(Quantity(f"{words}, A0 = {row.shape:.4g}, {name}", getattr(row, column), getattr(row, column + "_error"),
                                           published.CONFLUENCE if at else None, ensemble.seeds_remark(points)))
        quantities += [Quantity(f"share of particles that are no rattlers, A0 = {row.shape:.4g}, {name}", row.held, row.held_error)
                       for row in ensemble.scatter(own, ["shape"], "held").itertuples()]
    left.axhline(1, ls=":", color="0.5", lw=1)
    left.axvline(published.CONFLUENT_SHAPE, ls="-.", color="0.3", lw=1, label="published confluence")
    left.set(xlabel=r"rest shape  $\mathcal{A}_0$", ylabel="fraction")
    right.set(xlabel=r"rest shape  $\mathcal{A}_0$", ylabel="mean number for a particle", ylim=(0, None))
    for axes in (left, right):
        axes.legend(**plotting.ABOVE | {"ncols": 1})
    return figure, quantities


def _polygons(row):
    """Words for the particles of a packing."""
    return f"{row['model']}, A0 = {_shape(row):.4g}, K_b = {row['k_b']:g}, N = {row['n']}, n_v = {row['n_vertices']:g}"


def draw_modes(measured):
    """Modes without stiffness against missing contacts, and the energy along modes."""
    measured = measured.assign(particles=[_polygons(row) for _, row in measured.iterrows()])
    figure, (left, right) = plt.subplots(1, 2, figsize=(plotting.PAGE, 5), layout="constrained")
    counted = measured[measured["pre_stress"] == "dropped"]
    quantities = _count_modes(left, counted) if len(counted) else []
    if "energy" in measured:
        quantities += _energies(right, measured[measured["pre_stress"] == "kept"])
    return figure, quantities


def _count_modes(axes, counted):
    """Draws the numbers of modes without stiffness, translations not included, of the packings at the lowest pressure."""
    last = _last(counted)
    last = last.assign(free=last["zero_modes"] - last["dim"], one=1)
    last["equal"] = (last["free"] == last["missing"].clip(lower=0)).astype(float)
    quantities = []
    for i, ((particles,), own) in enumerate(ensemble.groups(last, ["particles"])):
        axes.plot(own["missing"], own["free"], ls="none", label=particles, **plotting.symbol(i))
        for row in ensemble.scatter(own, ["particles"], "equal", trials="one").itertuples():
            quantities.append(Quantity(f"packings whose missing contacts are as many as modes without stiffness, {particles}", row.equal,
                                       row.equal_error, published.QUARTIC_COUNT))
        quantities += [Quantity(f"missing contacts, {particles}", row.missing, row.missing_error)
                       for row in ensemble.scatter(own, ["particles"], "missing").itertuples()]
    ends = np.array([last["missing"].min(), 0, max(last["missing"].max(), 0)])
    axes.plot(ends, ends.clip(min=0), "-.", color="0.3", lw=1, label="as many as missing contacts", zorder=1)
    axes.set(xlabel=r"missing contacts  $N_{iso} - N_c$", ylabel="modes without stiffness")
    axes.legend(**plotting.ABOVE | {"ncols": 1})
    return quantities


def _energies(axes, measured):
    """Draws median energies along modes at the lowest pressure and at a pressure 100 times as high."""
    quantities = []
    for (particles,), own in ensemble.groups(measured, ["particles"]):
        own = own.assign(step=[float(f"{p:.3g}") for p in own["pressure"]])
        whole = own[own["amplitude"].isna()]
        steps = np.sort(whole["step"].unique())
        pressures = steps[0], steps[np.abs(np.log(steps / (100 * steps[0]))).argmin()]
        for k, (kind, line) in enumerate((("no stiffness", "-"), ("stiff", "--"))):
            for i, p in enumerate(pressures):
                curve = own[(own["kind"] == kind) & (own["step"] == p) & own["amplitude"].notna()].groupby("amplitude")["energy"].median()
                axes.plot(curve.index, curve, line, color=plotting.color(i), lw=1.3, label=f"{kind}, $p$ = {p:g}")
            found = whole[(whole["kind"] == kind) & (whole["step"] == pressures[0])]
            name = f"{kind}, p = {pressures[0]:g}, {particles}"
            quantities += [Quantity(f"exponent of the energy in the displacement, {name}", row.exponent, row.exponent_error,
                                    published.QUARTIC[kind], decides=False)
                           for row in ensemble.scatter(found, ["kind"], "exponent").itertuples()]
            quantities += [Quantity(f"share of modes with an exponent, {name}", row.with_exponent, row.with_exponent_error)
                           for row in ensemble.scatter(found, ["kind"], "with_exponent").itertuples() if kind == "no stiffness"]
        loose = whole[whole["kind"] == "no stiffness"]
        for column, words in (("quadratic", "quadratic part"), ("crossover", "crossover")):
            values = loose.pivot_table(index=["table", "row"], columns="step", values=column)
            quantities += [Quantity(f"{words}, no stiffness, p = {p:g}, {particles}", values[p].mean(), values[p].sem()) for p in values]
            for upper, lower in zip(values.columns[:0:-1], values.columns[-2::-1]):
                both = values[[upper, lower]].dropna()
                powers = np.log(both[upper] / both[lower]) / np.log(upper / lower)
                quantities.append(Quantity(f"exponent of p in the {words}, no stiffness, p = {upper:g} to {lower:g}, {particles}",
                                           powers.mean(), powers.sem(), published.QUARTIC_PRESSURE[column],
                                           decides=lower == pressures[0]))
    x = np.array([1e-3, 1e-2])
    for power, factor in ((4, 30), (2, 3)):
        axes.plot(x, factor * x**power, "-.", color="0.3", lw=1, label=f"slope {power}")
    log_axes(axes)
    axes.set(xlabel=r"displacement  $\delta$  [$\sigma_{avg}$]", ylabel=r"$\Delta U$  [$\epsilon$]")
    axes.legend(**plotting.ABOVE)
    return quantities


def herschel_bulkley(rate, stress, factor, power):
    """Shear stress of a fluid with a yield stress."""
    return stress + factor * rate**power


def _flow_fit(rate, stress, error):
    """[yield stress, factor, exponent] of the law of Herschel and Bulkley; None if it cannot be fitted."""
    start = [stress.min() / 2, stress.max() / rate.max() ** 0.5, 0.5]
    try:
        return curve_fit(herschel_bulkley, rate, stress, start, error, bounds=(0, [stress.min(), np.inf, 1]))[0]
    except (RuntimeError, ValueError, OptimizeWarning):
        return None


def draw_flow(measured):
    """Shear stress against shear rate of steady flows, for each fraction, and its exponent."""
    points = ensemble.average(measured, ["n", "zeta", "fraction", "shear_rate"], "flow_stress")
    if points.empty:
        raise RunError("no flow is steady; raise -strain")
    pressures = ensemble.average(measured, ["n", "zeta", "fraction", "shear_rate"], "flow_pressure")
    figure, (left, right) = plt.subplots(1, 2, figsize=(plotting.PAGE, 4.3), layout="constrained")
    quantities = []
    systems = points[["n", "zeta"]].drop_duplicates()
    for i, ((n, zeta, fraction), curve) in enumerate(ensemble.groups(points, ["n", "zeta", "fraction"])):
        name = f"phi = {fraction:g}, N = {n}, zeta = {zeta:g}"
        label = rf"$\phi$ = {fraction:g}" + (rf", $N$ = {n}, $\zeta$ = {zeta:g}" if len(systems) > 1 else "")
        rate, stress, error = (curve[column].to_numpy() for column in ("shear_rate", "flow_stress", "flow_stress_error"))
        plotting.errorbar(left, rate, stress, error, label=label, **plotting.points(i))
        own = pressures[(pressures["n"] == n) & (pressures["zeta"] == zeta) & (pressures["fraction"] == fraction)]
        plotting.errorbar(right, own["shear_rate"], own["flow_pressure"], own["flow_pressure_error"], **plotting.points(i))
        remark = ensemble.seeds_remark(curve)
        quantities += [Quantity(f"sigma at rate {row.shear_rate:g}, {name}", row.flow_stress, row.flow_stress_error, None, remark)
                       for row in curve.itertuples()]
        for symbol, value, one in (("sigma", "flow_stress", curve), ("p", "flow_pressure", own)):
            quantities += _powers(*(one[column].to_numpy() for column in ("shear_rate", value, value + "_error")), symbol, fraction, name)
        if fraction > published.FLOW_JAMMED + _AT and len(rate) > 3 and (fit := _flow_fit(rate, stress, error)) is not None:
            drawn = [one for draw in ensemble.draws(curve, "flow_stress") if (one := _flow_fit(rate, draw, error)) is not None]
            errors = ensemble.spread(np.array(drawn)) if len(drawn) > 1 else np.full(3, np.nan)
            quantities += [Quantity(f"{words} of Herschel and Bulkley, {name}", fit[k], errors[k], None, remark)
                           for k, words in ((0, "yield stress"), (2, "exponent"))]
            grid = np.geomspace(rate.min(), rate.max(), 60)
            left.plot(grid, herschel_bulkley(grid, *fit), color=plotting.color(i), lw=1.1,
                      label=rf"Herschel and Bulkley, $\sigma_y$ = {with_error(fit[0], errors[0])}")
    for axes, table, value, label in ((left, points, "flow_stress", r"shear stress  $\sigma_{xy}$  [$\epsilon/\sigma_{avg}^d$]"),
                                      (right, pressures, "flow_pressure", r"pressure  $p$  [$\epsilon/\sigma_{avg}^d$]")):
        for known, style, near in ((published.FLOW_POWER["below"], ":", table["fraction"] < published.FLOW_JAMMED - _AT),
                                   (published.FLOW_POWER["at"], "-.", abs(table["fraction"] - published.FLOW_JAMMED) <= _AT)):
            if near.any():
                start = table[near].sort_values("shear_rate").iloc[0]
                rate = np.array([start["shear_rate"], table["shear_rate"].max()])
                axes.plot(rate, start[value] * (rate / rate[0]) ** known.value, style, color="0.4", lw=1, label=f"slope {known.value:g}")
        axes.set(xlabel=_RATE, ylabel=label)
        log_axes(axes)
    groups_first(left)
    return figure, quantities


def _powers(rate, stress, error, symbol, fraction, name):
    """Quantities: exponents of a stress in the shear rate between successive rates. The two lowest rates are compared with the
    published limit, which decides for Newtonian flow alone: at the onset, exponents hardly reach the limit."""
    found = []
    known = None
    if abs(fraction - published.FLOW_JAMMED) <= _AT:
        known = published.FLOW_POWER["at"]
    elif fraction < published.FLOW_JAMMED:
        known = published.FLOW_POWER["below"]
    for k in range(len(rate) - 1):
        span = np.log(rate[k + 1] / rate[k])
        value = np.log(stress[k + 1] / stress[k]) / span if min(stress[k:k + 2]) > 0 else np.nan
        found.append(Quantity(f"exponent of {symbol} in the rate, {rate[k]:g} to {rate[k + 1]:g}, {name}", value,
                              np.hypot(*(error[k:k + 2] / stress[k:k + 2])) / span, known if k == 0 else None,
                              "published: the limit of low rates" if known and k == 0 else "",
                              decides=known is published.FLOW_POWER["below"]))
    return found


_OPTIONS = ("n", "fraction", "path", "start_pressure", "pressure", "size_distribution")
FIGURES = [
    Figure("J1", "onset of jamming of bidisperse disks against the number of disks", ("quick/onset",), ("packings/onset",),
           "packings", draw_onset, "up to 256 disks, fewer seeds", tells=_OPTIONS, kind="soft", planar=True, ensembles=True),
    Figure("J2", "pressure, contacts and shear modulus above the onset of jamming", ("quick/laws",), ("packings/laws",), "packings",
           draw_laws, "up to 256 disks, fewer seeds", tells=_OPTIONS, kind="soft", planar=True, ensembles=True),
    Figure("J3", "onset of jamming of equal spheres against the number of spheres", ("quick/onset-3d",), ("packings/onset-3d",),
           "packings", draw_onset, "up to 256 spheres near the onset alone, fewer seeds", tells=(*_OPTIONS, "dim"), kind="soft", ensembles=True),
    Figure("J4", "fractions and contacts of packings of rough polygons against their rest shape", ("quick/polygons",),
           ("packings/polygons",), "packings", draw_polygons, "three shapes, fewer seeds",
           tells=("model", "n", "n_vertices", "k_b", "shape_parameter"), kind="deformable", ensembles=True),
    Figure("J5", "stress of steady shear flows against the shear rate", ("quick/flow",), ("packings/flow",), "shear_flows", draw_flow,
           "64 disks, higher rates, fewer seeds", tells=("n", "fraction", "shear_rate", "zeta"), kind="soft", planar=True,
           ensembles=True),
    Figure("J6", "modes without stiffness and missing contacts of packings of polygons, and the energy along modes", ("quick/modes",),
           ("packings/modes",), "packing_modes", draw_modes, "two shapes, fewer seeds",
           tells=("model", "n", "n_vertices", "k_b", "shape_parameter", "pre_stress"), kind="deformable", planar=True, ensembles=True),
]
