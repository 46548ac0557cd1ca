"""The figures of the hopper paper: the list of all, and the figures of Q(w), of velocities and of discharges."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from .. import beverloo, beverloo_figures, ensemble, plotting
from ..beverloo_figures import W_LABEL, draw_flow, log_axes
from ..errors import RunError
from . import published
from .figure import Figure, Quantity
from .hopper_lambda import draw_angles, draw_corrected, draw_lambda, draw_size
from .hopper_runs import (COEFFICIENT, LIMIT_AT, LIMIT_NAMES, MODEL, chi2_note, decides, fit_quantities, fitted, is_hard,
                          is_soft, limit, limits, model_label, named, of_several, ratio, with_limit)
from .hopper_stiffness import draw_deformable_prefactors, draw_offsets, draw_soft_prefactors


def _limit_fits(table):
    """Fits of Q(w) of every model of `limits`; `size` is N where a model has several."""
    by = ["dim", *MODEL, "mu", "zeta"]
    return beverloo.fit_seeds(table.assign(size=of_several(table, "n", by)), ["limit", *by, "size"])


def draw_limits(measured):
    """[H Fig. 2, 3, 10]: Q(w) with fits, and Q/C, a row of panels per limit; in 2D the published law of hard particles."""
    fits = _limit_fits(limits(measured))
    there = [name for name in LIMIT_NAMES if (fits["limit"] == name).any()]
    figure, panels = plt.subplots(len(there), 2, figsize=(plotting.PAGE, 3.9 * len(there)), layout="constrained", squeeze=False)
    quantities = []
    for (left, right), name in zip(panels, there):
        group = fits[fits["limit"] == name]
        own = COEFFICIENT[name]
        # The coefficient, and 3D, are named where there are several.
        ends = [(f", {own} = {row[own]:g}" if group[own].nunique() > 1 else "")
                + (", 3D" if fits["dim"].nunique() > 1 and row["dim"] == 3 else "") for _, row in group.iterrows()]
        draw_flow(left, right, group, [model_label(row) + end.replace(own, rf"$\{own}$")
                                       for (_, row), end in zip(group.iterrows(), ends)])
        ends = dict(zip(group.index, ends))
        quantities += fit_quantities(group, lambda row, ends=ends: named(row, ends[row.name]))
        if (group["dim"] == 2).all():
            law = published.C[name].value, published.K[name].value, published.exponent(2, name).value
            grid = law[1] + (left.get_xlim()[1] - law[1]) * np.linspace(0, 1, 200) ** 2
            left.plot(grid, beverloo.beverloo(grid, *law), "-.", color="0.2", lw=1.2,
                      label=f"[H], hard: $C$ = {law[0]:g}, $k$ = {law[1]:g}")
            beverloo_figures.groups_first(left)
        left.set_title(LIMIT_NAMES[name], loc="left")
    return figure, quantities


def draw_hard(measured):
    """[H Fig. 10] as `draw_limits`, and Q of the stiffest deformable particles over Q of the hardest soft particles of the
    same N and width: [H App. B] has one hard limit for both."""
    figure, quantities = draw_limits(measured)
    table = limits(measured)
    hard = table[[is_hard(row) for _, row in table.iterrows()]]
    for (limit, dim, n), group in hard.groupby(["limit", "dim", "n"]):
        soft = group[is_soft(group)]
        soft = soft[soft["e_sp"] == soft["e_sp"].max()]
        points = {key: ensemble.average(one, ["hopper_width"], "Q")
                  for key, one in [("soft", soft), *group[~is_soft(group)].groupby(["model", "k_l", "k_b"])] if len(one)}
        if "soft" not in points:
            continue
        name = f"soft, E_sp = {soft['e_sp'].iloc[0]:g}, N = {n:g}"
        for (model, k_l, k_b), own in ((key, own) for key, own in points.items() if key != "soft"):
            both = own.merge(points["soft"], on="hopper_width", suffixes=("", "_soft"))
            for row in both[(both["Q"] > 0) & (both["Q_soft"] > 0)].itertuples():
                ratio = row.Q / row.Q_soft
                error = ratio * np.hypot(row.Q_error / row.Q, row.Q_error_soft / row.Q_soft)
                quantities.append(Quantity(f"Q of {model}, K_l = {k_l:g}, K_b = {k_b:g} over {name}, w = {row.hopper_width:g}, "
                                           f"{LIMIT_NAMES[limit]}", ratio, error, published.HARD_ALIKE))
    return figure, quantities


def power_law(points, x, value):
    """(exponent, its error, prefactor, chi2/dof) of value = A x^p through points of `ensemble.average`, weighted by their errors;
    the error is drawn over seeds. Raises RunError for fewer than two points above 0."""
    use = (points[value] > 0) & (points[value + "_error"] > 0)
    points = points[use]
    if len(points) < 2:
        raise RunError(f"{len(points)} points with an error are too few for a power law")
    log_x, weight = np.log(points[x].to_numpy(float)), (points[value] / points[value + "_error"]).to_numpy(float)
    (slope, offset), residual, *_ = np.polyfit(log_x, np.log(points[value]), 1, w=weight, full=True)
    chi2 = float(residual[0]) / (len(points) - 2) if len(residual) else np.nan
    drawn = ensemble.draws(points, value)
    drawn = drawn[(drawn > 0).all(1)]
    slopes = np.polyfit(log_x, np.log(drawn).T, 1, w=weight)[0]
    return float(slope), float(ensemble.spread(slopes)), float(np.exp(offset)), chi2


FAR, NEAR = 15.0, 2.0  #: heights above the orifice [sigma_avg] where the speed is far from it, and over which its gradient is taken


def _profile_quantities(runs, lam):
    """[Quantity] of the speed far from the orifice and of its fall per height close to it: the largest width over the smallest, and the
    exponents in w."""
    rows = []
    for (w, *_), run in ensemble.groups(runs, ["hopper_width", "table", "row"]):
        curve = run.sort_values("height")
        if curve["height"].max() >= FAR:
            v = np.interp([0, NEAR, FAR], curve["height"], curve["v"])
            rows.append({"hopper_width": w, "far": v[2], "gradient": (v[0] - v[1]) / NEAR})
    if not rows:
        return []
    quantities = []
    for column, name in (("far", f"speed at h = {FAR:g}"), ("gradient", f"fall of v_g per height below h = {NEAR:g}")):
        points = ensemble.scatter(pd.DataFrame(rows), ["hopper_width"], column)
        quantities += [Quantity(f"{name}, w = {points['hopper_width'].iloc[i]:g}, lambda = {lam:g}", points[column].iloc[i],
                                points[f"{column}_error"].iloc[i], None, "[H 5] draws it; we have no number") for i in (0, -1)]
        try:
            slope, error, _, chi2 = power_law(points, "hopper_width", column)
        except RunError:
            continue
        quantities.append(Quantity(f"exponent of the {name} in w, lambda = {lam:g}", slope, error, None, chi2_note(chi2)))
    return quantities


def draw_profiles(measured):
    """[H Fig. 5]: velocity on the axis against height for several widths, and at the orifice against the width."""
    table = with_limit(measured)
    lams = sorted(table["lam"].unique())
    titles = {0.0: r"$\lambda = 0$", np.inf: r"$\lambda = \infty$"}
    columns = min(len(lams) + 1, 2)
    rows = -(-(len(lams) + 1) // columns)
    figure, panels = plt.subplots(rows, columns, figsize=(plotting.PAGE, 3.6 * rows), layout="constrained", squeeze=False)
    panels = panels.ravel()
    for axes in panels[len(lams) + 1:]:
        axes.set_axis_off()
    quantities, last = [], panels[len(lams)]
    for i, (axes, lam) in enumerate(zip(panels, lams)):
        own = table[table["lam"] == lam]
        widths = sorted(own["hopper_width"].unique())
        for w, color in zip(widths, plt.get_cmap("turbo")(np.linspace(0.08, 0.92, len(widths)))):
            curve = ensemble.average(own[own["hopper_width"] == w], ["height"], "v")
            error = np.nan_to_num(curve["v_error"])
            axes.fill_between(curve["height"], curve["v"] - error, curve["v"] + error, color=color, alpha=0.25, lw=0)
            axes.plot(curve["height"], curve["v"], color=color, label=f"{w:g}")
        axes.set(xlabel=r"height above the orifice  $h/\sigma_{avg}$", ylabel=r"$v_g$  [$\sigma_{avg}/t_0$]", xlim=(0, None),
                 ylim=(0, None))
        axes.set_title(titles.get(lam, rf"$\lambda$ = {lam:g}"), loc="left")
        axes.legend(title=r"$w/\sigma_{avg}$", ncols=2)
        points = ensemble.average(own[own["height"] == own["height"].min()], ["hopper_width"], "v")
        symbol = plotting.symbol(i)
        plotting.errorbar(last, points["hopper_width"], points["v"], points["v_error"], ls="", capsize=2.5,
                          label=titles.get(lam, rf"$\lambda$ = {lam:g}"), **symbol)
        quantities += _profile_quantities(own, lam)
        known = published.VELOCITY[LIMIT_AT.get(lam, "crossover")]
        name = f"exponent of v_g(h = 0) in w, lambda = {lam:g}"
        try:
            slope, error, factor, chi2 = power_law(points, "hopper_width", "v")
        except RunError as reason:
            quantities.append(Quantity(name, np.nan, np.nan, known, str(reason)))
            continue
        quantities.append(Quantity(name, slope, error, known, "; ".join(
            filter(None, [chi2_note(chi2), ensemble.seeds_remark(points)]))))
        w = np.geomspace(points["hopper_width"].min() / 1.1, points["hopper_width"].max() * 1.1, 30)
        last.plot(w, factor * w**slope, color=symbol["color"], lw=1.2)
        middle = np.exp(np.log(points["hopper_width"]).mean())
        last.plot(w, factor * middle**slope * (w / middle) ** known.value, "--", color=symbol["color"], lw=0.9, alpha=0.8)
    last.plot([], [], "--", color="0.4", lw=0.9, label="published exponent")
    last.set(xlabel=W_LABEL, ylabel=r"$v_g$ at $h = 0$  [$\sigma_{avg}/t_0$]")
    log_axes(last)
    last.legend()
    return figure, quantities


def _ratio_of_hoppers(fits):
    """c0 of the first hopper over c0 of the second at the same widths: [mean over the widths, chi2/dof of a ratio of 1 at every
    width]. The verdict is on the curve, which a mean hides; empty without two hoppers or common widths."""
    if len(fits) != 2:
        return []
    both = fits["data"].iloc[0].merge(fits["data"].iloc[1], on="hopper_width", suffixes=("", "_other"))
    both = both[(both["Q"] > 0) & (both["Q_other"] > 0)]
    if len(both) < 2:
        return []
    ratio = (both["Q"] / both["Q_other"]).to_numpy()
    error = ratio * np.hypot(both["Q_error"] / both["Q"], both["Q_error_other"] / both["Q_other"]).to_numpy()
    mean_error = max(ratio.std(ddof=1), np.sqrt((error**2).mean())) / np.sqrt(len(ratio))
    name = f"c0 of {fits['walls'].iloc[0]} over {fits['walls'].iloc[1]} degrees"
    ends = "{:.3g} at w = {:g}, {:.3g} at {:g}".format(ratio[0], both["hopper_width"].iloc[0], ratio[-1],
                                                       both["hopper_width"].iloc[-1])
    chi2 = float((((ratio - published.OIL_HOPPERS.value) / error) ** 2).mean())
    return [Quantity(f"{name}, mean over w", float(ratio.mean()), float(mean_error), None, ends),
            Quantity(f"chi2/dof of {name} = 1 at every w", chi2, np.sqrt(2 / len(ratio)), published.OIL_HOPPERS, ends)]


def draw_discharge(measured):
    """[H Fig. 8]: c0 of discharges of wedges, dN/dt = -c0 sqrt(N), against the width, with the law of the experiment."""
    table = measured[np.isfinite(measured["c0"].astype(float))]
    if table.empty:
        raise RunError("no discharge has a rate c0: run a wedge until it is empty")
    left = table["hopper_angle_left"].astype(float) if "hopper_angle_left" in table else np.nan
    table = table.assign(left=np.where(np.isfinite(left), left, table["hopper_angle"]))
    fits = beverloo.fit_seeds(table, ["zeta", "e_sp", "hopper_angle", "left", "dim"], "c0")
    fits["walls"] = [f"{row['hopper_angle']:g}/{row['left']:g}" for _, row in fits.iterrows()]
    several = len(fits[["zeta", "e_sp"]].drop_duplicates()) > 1
    fits["drag"] = [f", zeta = {row['zeta']:.3g}" if several else "" for _, row in fits.iterrows()]
    figure, (left, right) = plt.subplots(1, 2, figsize=(plotting.PAGE, 4.4), layout="constrained")
    labels = [f"{row['walls']}°{row['drag']}".replace("zeta", r"$\zeta$") for _, row in fits.iterrows()]
    draw_flow(left, right, fits.assign(reference=0.5, reference_fit=None), labels)
    oil = [published.OIL_K.value, published.OIL_BETA.value]
    grid = oil[0] + (left.get_xlim()[1] - oil[0]) * np.linspace(0, 1, 200) ** 2
    quantities = []
    for i, (_, row) in enumerate(fits.iterrows()):
        if row["fit"]:
            data = row["data"][row["data"]["hopper_width"] > oil[0]]
            shape = (data["hopper_width"] - oil[0]) ** oil[1]
            label = None if i else rf"oil drops [H]: $\beta$ = {oil[1]:g}, $k$ = {oil[0]:g}, $C$ fitted to each colour"
            left.plot(grid, (data["Q"] @ shape) / (shape @ shape) * (grid - oil[0]) ** oil[1], "-.", lw=1.2,
                      color=plotting.color(i), label=label)
        for quantity, known in (("beta", published.OIL_BETA), ("k", published.OIL_K), ("C", None)):
            quantities.append(Quantity(f"{quantity} of c0(w), {row['walls']} degrees{row['drag']}",
                                       *fitted(row["fit"], quantity), known, row["note"], decides(row["fit"])))
    for drag, pair in fits.groupby("drag"):
        quantities += [replace(ratio, name=ratio.name + drag) for ratio in _ratio_of_hoppers(pair)]
    left.set_ylabel(r"$c_0$  [$t_0^{-1}$]")
    right.set_ylabel(r"$c_0/C$")
    beverloo_figures.groups_first(left)
    return figure, quantities


_PARTICLES = ("dim", *MODEL)
_LIMITS = (*_PARTICLES, "mu", "zeta", "n", "hopper_width")
_STIFFNESS = (limit, *_PARTICLES, "bending_edges", "n", "hopper_width")
_LAMBDA = (ratio, *_PARTICLES, "hopper_angle", "n", "hopper_width")
_MAPS = ("hopper/map", "hopper/limits-smooth", "hopper/map-large", "hopper/smooth-large", "hopper/map-rough",
         "hopper/limits-rough", "hopper/map-rough-large", "hopper/rough-large")  #: K_l and K_b of deformable particles
_MAPS_AS_RUN = ("as-run/map", "as-run/limits-smooth", "as-run/smooth-large")


_FEW = "soft particles only, fewer seeds and shorter runs"
FIGURES = [
    Figure("H2", "Q(w) of soft and deformable particles, friction only and drag only", ("quick/limits", "quick/stiff"),
           ("hopper/limits", "hopper/limits-smooth", "hopper/limits-rough"), "flows", draw_limits, _FEW,
           as_run=("as-run/limits",), tells=_LIMITS),
    Figure("H3", "Q(w) of soft spheres, friction only and drag only", ("quick/limits-3d",), ("hopper/limits-3d",),
           "flows", draw_limits, "half the particles, shorter runs", as_run=("as-run/limits-3d",), tells=_LIMITS),
    Figure("surfaces", "Q(w) of deformable surfaces and of soft spheres, friction only and drag only", ("quick/surfaces",),
           ("hopper/surfaces",), "flows", draw_limits, "200 particles of 12 vertices", tells=_LIMITS),
    Figure("H4", "exponent beta against lambda = zeta/mu", ("quick/lambda", "quick/limits"),
           ("hopper/lambda", "hopper/lambda-3d", "hopper/lambda-smooth", "hopper/lambda-stiff", "hopper/lambda-rough",
            "hopper/limits-rough"),
           "flows", draw_lambda, "soft particles of one stiffness, 2D, fewer widths, shorter runs",
           as_run=("as-run/lambda", "as-run/limits", "as-run/lambda-hard", "as-run/limits-hard", "as-run/lambda-3d",
                   "as-run/limits-3d", "as-run/lambda-rough", "as-run/lambda-smooth", "as-run/lambda-stiff",
                   "as-run/limits-rough", "as-run/limits-smooth"),
           tells=_LAMBDA),
    Figure("lambda-path", "beta against lambda, with constant friction and increasing drag", ("quick/lambda-path",),
           ("hopper/lambda-path",), "flows", draw_lambda, "fewer lambda and widths, shorter runs", tells=_LAMBDA),
    Figure("H5", "velocity on the axis for several widths, and its exponent at the orifice", ("quick/profile",),
           ("hopper/profile",), "profiles", draw_profiles, as_run=("as-run/profile",), tells=(ratio, "hopper_width")),
    Figure("H6", "beta(lambda) and the ratio of drag to friction for several angles", ("quick/angle", "quick/lambda"),
           ("hopper/angle", "hopper/angle-smooth", "hopper/angle-smooth-hard", "hopper/lambda-smooth"), "flows", draw_angles,
           "soft particles alone, three angles, fewer lambda, widths and seeds, shorter runs",
           as_run=("as-run/angle", "as-run/lambda", "as-run/limits", "as-run/angle-smooth", "as-run/lambda-smooth",
                   "as-run/limits-smooth"),
           tells=(ratio, *MODEL, "e_c", "n", "hopper_angle", "hopper_width"), planar=True),
    Figure("H7", "offset k against the stiffness of soft and deformable particles", ("quick/stiffness", "quick/map"),
           ("hopper/limits", "hopper/stiffness", *_MAPS), "flows", draw_offsets,
           "120 deformable particles with contacts softer than printed, three widths, two K_l and two K_b",
           as_run=("as-run/stiffness", "as-run/limits", "as-run/limits-hard", *_MAPS_AS_RUN), tells=_STIFFNESS,
           planar=True),
    Figure("H8", "discharge of two wedges against their width, compared with the experiment", ("quick/discharge",),
           ("hopper/discharge",), "flows", draw_discharge, "400 particles, four seeds",
           tells=("zeta", "e_sp", "hopper_angle", "hopper_angle_left", "hopper_width")),
    Figure("H10",
           "Q(w) of soft and of nearly hard particles; ratio of Q of the stiffest deformable particles to Q of the stiffest soft particles",
           ("quick/limits", "quick/hard"),
           ("hopper/limits", "hopper/limits-smooth", "hopper/limits-rough", "hopper/stiffest"), "flows", draw_hard, _FEW,
           as_run=("as-run/limits", "as-run/limits-hard"), tells=_LIMITS),
    Figure("H11", "beta(lambda) of very soft particles, from Q and from Q' corrected for overlaps",
           ("quick/lambda-soft", "quick/lambda"), ("hopper/lambda-soft", "hopper/lambda"), "flows", draw_corrected,
           "fewer lambda and widths, shorter runs", tells=(ratio, *MODEL, "hopper_width"), planar=True),
    Figure("H12", "beta(lambda) and C for several numbers of particles", ("quick/size", "quick/limits", "quick/lambda"),
           ("hopper/size",),
           "flows", draw_size, "fewer lambda, widths and seeds, shorter runs",
           as_run=("as-run/size", "as-run/limits", "as-run/lambda"), tells=(ratio, "n", "hopper_width"), planar=True),
    Figure("H13", "prefactor C of soft particles against their stiffness; Q/C against w − k for all stiffnesses",
           ("quick/stiffness",), ("hopper/limits", "hopper/stiffness"), "flows", draw_soft_prefactors, "three stiffnesses, shorter runs",
           as_run=("as-run/stiffness", "as-run/limits", "as-run/limits-hard"), tells=_STIFFNESS, kind="soft",
           planar=True),
    Figure("H14", "prefactor C of deformable particles; Q/C against w − k for all stiffnesses", ("quick/map",),
           _MAPS, "flows", draw_deformable_prefactors,
           "120 particles with contacts softer than printed, three widths", as_run=_MAPS_AS_RUN, tells=_STIFFNESS,
           kind="deformable", planar=True),
]
