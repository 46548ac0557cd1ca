"""The figures of the hopper paper of beta against lambda = zeta/mu, and lambda_c."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from .. import beverloo, ensemble, plotting
from ..beverloo_figures import FRACTIONS
from ..crossover import fit_crossover
from ..errors import RunError
from ..script import remark
from . import published
from .figure import Quantity
from .hopper_runs import (BETA, LAMBDA, LIMIT_AT, LIMIT_NAMES, MODEL, chi2_note, decides, fitted, limits, model_label,
                          of_several, plain, variant_label, with_limit)

#: Other options in which runs of one model may differ (`of_several`).
_VARIANT = ["contacts", "size"]


def _exponents(table, by, value="Q"):
    """A row per group of `by` and lambda with its exponent; those without one are left out. Raises RunError if there are
    none."""
    fits = beverloo.fit_seeds(table, [*by, "lam"], value)
    fits = fits[fits["fit"].notna()] if len(fits) else fits
    if fits.empty:
        raise RunError("no lambda has enough widths for a fit of beta")
    return fits


def _unbounded(exponents):
    """`exponents` with fits without the bound of k in place of those where k is at it."""
    free = exponents["unbounded_fit"].notna()
    fits = exponents["fit"].where(~free, exponents["unbounded_fit"])
    return exponents.assign(fit=fits, beta=[fit.beta for fit in fits], beta_error=[fit.beta_error for fit in fits])


def _crossovers(exponents, by, dim, label, known):
    """[(label, group, fit with the published ends, fit with free ends)] and their quantities. known(key) → Published. A curve
    with an exponent that cannot decide cannot decide either; a second row then has the fit to exponents of fits without the bound of k."""
    curves, quantities = [], []
    ends = dim - 1.5, dim - 0.5
    for key, group in ensemble.groups(exponents, by):
        name = label(group.iloc[0])
        found = []
        kinds = [("published ends", ends, group), ("free ends", None, group)]
        if group["unbounded_fit"].notna().any():
            kinds.append(("free ends, k unbounded", None, _unbounded(group)))
        for kind, held, points in kinds:
            unknown = ", ".join(f"{row.lam:g}" for row in points.itertuples() if not decides(row.fit))
            remark = f"no verdict on beta at lambda = {unknown}" if unknown else ""
            try:
                fit = fit_crossover(points["lam"], points["beta"], points["beta_error"], held)
            except RunError as error:
                found.append(None)
                quantities.append(Quantity(f"lambda_c, {kind}: {name}", np.nan, np.nan, known(key), str(error)))
                continue
            found.append(fit)
            quantities.append(Quantity(f"lambda_c, {kind}: {name}", fit.lam_c, fit.lam_c_error, known(key),
                                       "; ".join(filter(None, [fit.note, remark, chi2_note(fit.chi2_reduced)])), not unknown))
            if held is None:
                for part, limit in (("high", "friction"), ("low", "drag")):
                    quantities.append(Quantity(f"beta, fitted end ({limit}){kind.removeprefix('free ends')}: {name}", *fitted(fit, part),
                                               published.exponent(dim, limit), "; ".join(filter(None, [fit.note, remark])), not unknown))
        for row in group.itertuples():
            limit = LIMIT_AT.get(row.lam)
            quantities.append(Quantity(f"beta at lambda = {row.lam:g}: {name}", row.beta, row.beta_error,
                                       published.exponent(dim, limit) if limit else None, row.note, decides(row.fit)))
        curves.append((name, group, *found[:2]))
    return curves, quantities


def _lambda_label(table, dim, symbol=r"\lambda"):
    """Label of an axis of lambda, which `with_limit` divides where drag is per mass."""
    if "drag" in table and (table.loc[table["dim"] == dim, "drag"] == "per_mass").any():
        return rf"${symbol}$ in numbers of the program ($\zeta/\mu$: times {published.CODE_LAMBDA[dim]:.1f})"
    return LAMBDA if symbol == r"\lambda" else f"${symbol}$"


def _draw_crossovers(axes, curves, dim, lam_c, x_label, **legend):
    finite = np.concatenate([group["lam"][(group["lam"] > 0) & np.isfinite(group["lam"])] for _, group, *_ in curves])
    low, high = (finite.min(), finite.max()) if len(finite) else (1e-3, 1)
    edges = low / 6, high * 6  # where lambda = 0 and infinity are drawn
    grid = np.geomspace(*edges, 200)
    for i, (name, group, held, free) in enumerate(curves):
        symbol = plotting.symbol(i)
        lam = np.clip(group["lam"].to_numpy(float), *edges)
        plotting.errorbar(axes, lam, group["beta"], group["beta_error"], ls="", capsize=2.5, label=name, zorder=3,
                          clip_on=False, **symbol)
        if free:
            axes.plot(grid, free(grid), color=symbol["color"], lw=1.2)
        if held:
            axes.plot(grid, held(grid), "--", color=symbol["color"], lw=0.9, alpha=0.7)
    for beta in (dim - 0.5, dim - 1.5):
        axes.axhline(beta, color="0.55", lw=0.9, ls=":")
        axes.text(edges[1], beta, f" {FRACTIONS[beta]}", va="center", color="0.4")
    for one in lam_c:
        axes.axvline(one.value, color="0.55", lw=0.9, ls="-.")
    axes.plot([], [], color="0.4", lw=1.2, label="corrected [H 14], free ends")
    axes.plot([], [], "--", color="0.4", lw=0.9, label="with the published ends")
    axes.plot([], [], "-.", color="0.55", lw=0.9, label=r"published $\lambda_c$")
    axes.set(xscale="log", xlabel=x_label, ylabel=BETA, xlim=edges)
    ticks = [edges[0], *10.0 ** np.arange(np.ceil(np.log10(low)), np.floor(np.log10(high)) + 0.5), edges[1]]
    axes.set_xticks(ticks, labels=["0", *(f"{t:g}" for t in ticks[1:-1]), r"$\infty$"])
    axes.minorticks_off()
    axes.legend(**plotting.ABOVE | legend)


def _renamed(quantity, dim):
    name = quantity.name.replace("$", "").replace("{", "").replace("}", "")
    return replace(quantity, name=name + (", 3D" if dim == 3 else ""))


def draw_lambda(measured, value="Q"):
    """[H Fig. 4, 11, 12a]: beta against lambda with the corrected sigmoid, a panel per dimension; of hoppers with several angles
    the flattest, in each dimension."""
    table = with_limit(plain(measured))
    steep = table["hopper_angle"] < table.groupby("dim")["hopper_angle"].transform("max")
    if steep.any():
        remark(f"{steep.sum()} runs of steeper hoppers are left out, which H6 shows")
    table = table[~steep]
    table, by = table.assign(size=of_several(table, "n")), [*MODEL, "size"]
    exponents = _exponents(table, ["dim", *by], value)  # an unfinished campaign may have a few runs in 3D
    every = [(int(dim), group) for dim, group in exponents.groupby("dim")]
    figure, panels = plt.subplots(1, len(every), figsize=(min(6.2 * len(every), plotting.PAGE), 4.9), layout="constrained", squeeze=False)
    quantities = []
    for axes, (dim, exponents) in zip(panels[0], every):
        curves, found = _crossovers(exponents, by, dim, model_label, lambda key, dim=dim: published.LAMBDA_C[dim])
        _draw_crossovers(axes, curves, dim, [published.LAMBDA_C[dim]], _lambda_label(table, dim))
        axes.set_title(f"{dim}D", loc="left")
        quantities += [_renamed(q, dim) for q in found]
    return figure, quantities


def draw_corrected(measured):
    """[H Fig. 11]: beta from Q, and from Q' corrected for overlaps."""
    table = with_limit(plain(measured))
    rates = [(mark, _exponents(table, ["dim", *MODEL], value)) for value, mark in (("Q", ""), ("Q_corrected", "'"))]
    figure, panels = plt.subplots(1, 2, figsize=(plotting.PAGE, 4.9), layout="constrained", sharey=True)
    quantities = []
    for axes, (mark, exponents) in zip(panels, rates):
        curves, found = _crossovers(exponents, MODEL, 2, model_label, lambda key: published.LAMBDA_C[2])
        _draw_crossovers(axes, curves, 2, [published.LAMBDA_C[2]], _lambda_label(table, 2))
        prime = mark.replace("'", "\N{PRIME}")  # the prime of mathtext is hardly visible
        axes.set_ylabel(rf"$\beta${prime}")
        axes.set_title(f"from Q{prime}" + (", corrected for overlaps" if prime else ""), loc="left")
        for q in found:
            q = _renamed(q, 2)
            quantities.append(replace(q, name=f"from Q{mark}, {q.name}"))
    return figure, quantities


def _ratio_at_crossover(ratios, fit):
    """Drag over friction where lambda is lambda_c, and its error; NaN where no lambda of `ratios` is beyond it."""
    points = ratios.sort_values("lam")
    x, y = np.log(points["lam"].to_numpy(float)), np.log(points["drag_friction_ratio"].to_numpy(float))
    at = np.log(fit.lam_c)
    if len(x) < 2 or not x[0] <= at <= x[-1]:
        return np.nan, np.nan
    relative = points["drag_friction_ratio_error"].to_numpy(float) / points["drag_friction_ratio"].to_numpy(float)
    k = min(np.searchsorted(x, at, side="right"), len(x) - 1)
    slope = (y[k] - y[k - 1]) / (x[k] - x[k - 1])
    value = np.exp(np.interp(at, x, y))
    return value, value * np.hypot(slope * fit.lam_c_error / fit.lam_c, np.interp(at, x, relative))


def _same(table, row):
    """Mask of the rows of a table that agree with all of `row`."""
    return (table[row.index] == row).all(axis=1)


def _draw_lambda_c(axes, curves, y_label):
    """lambda_c against the angle of the hopper, where it is known."""
    for i, (kind, style) in enumerate((("published ends", "o"), ("free ends", "s"))):
        points = [(group["hopper_angle"].iloc[0], fit) for _, group, *fits in curves
                  if (fit := fits[i]) and np.isfinite(fit.lam_c_error)]
        if points:
            plotting.errorbar(axes, [a for a, _ in points], [f.lam_c for _, f in points], [f.lam_c_error for _, f in points],
                              fmt=style, capsize=2.5, label=kind)
    axes.plot(list(published.LAMBDA_C_ANGLE), [p.value for p in published.LAMBDA_C_ANGLE.values()], "k*", ms=8,
              label="[H]")
    axes.set(xlabel=r"$\theta_w$  [degrees]", ylabel=y_label, yscale="log")
    axes.legend()


def _plateau(ratios, full):
    """[Quantity]: drag over friction in the steepest hopper over that in the next one, of each model with several angles."""
    quantities = []
    for _, group in ratios.groupby(_VARIANT):
        group = group.sort_values("hopper_angle")
        if len(group) > 1:
            (steep, error), (next_one, next_error) = group[["drag_friction_ratio", "drag_friction_ratio_error"]].to_numpy()[:2]
            quantities.append(Quantity(
                f"|F_zeta|/|F_mu| at lambda = 0.01, {full(group.iloc[0])} over its value at theta_w = "
                f"{group['hopper_angle'].iloc[1]:g}",
                steep / next_one, steep / next_one * np.hypot(error / steep, next_error / next_one), published.RATIO_PLATEAU))
    return quantities


def _draw_ratios(axes, ratios, curves, full, lams):
    """Drag over friction of one model against the angle of the hopper; its quantities at lambda = 0.01 and at lambda_c.
    full(row) is the name of a row in their names; `lams` are the lambdas of all models, each with one colour."""
    quantities = []
    for lam, at_lam in ratios.groupby("lam"):
        for j, (_, group) in enumerate(at_lam.groupby(_VARIANT)):
            plotting.errorbar(axes, group["hopper_angle"], group["drag_friction_ratio"], group["drag_friction_ratio_error"],
                              linestyle=("-", "--", ":", "-.")[j % 4], capsize=2.5, **plotting.symbol(lams.index(lam), turns=j),
                              label=rf"$\lambda$ = {lam:g}" + variant_label(group.iloc[0], latex=True))
        if lam == 0.01 and len(at_lam) > 1:
            quantities += [Quantity(f"|F_zeta|/|F_mu| at lambda = 0.01, {full(row)}", row["drag_friction_ratio"],
                                    row["drag_friction_ratio_error"]) for _, row in at_lam.iterrows()]
            quantities += _plateau(at_lam, full)
    quantities += [Quantity(f"|F_zeta|/|F_mu| at lambda_c, free ends: {full(row)}",
                            *_ratio_at_crossover(ratios[_same(ratios, row[["hopper_angle", *_VARIANT]])], free))
                   for row, _, _, free in curves if free]
    axes.set(xlabel=r"$\theta_w$  [degrees]", ylabel=r"$|F_\zeta|/|F_\mu|$, mean over $w$", yscale="log")
    if len(ratios):
        axes.legend(**plotting.ABOVE)
    return quantities


def draw_angles(measured):
    """[H Fig. 6]: beta against lambda for hoppers of several angles; lambda_c and the ratio of drag to friction against the
    angle. A row of panels per model, then the panels of lambda_c; each contact stiffness and each N has a separate
    curve."""
    table = with_limit(plain(measured))
    table = table.assign(contacts=of_several(table, "e_c"), size=of_several(table, "n"))
    by = ["hopper_angle", *MODEL, *_VARIANT]
    several = len(table.drop_duplicates(MODEL)) > 1

    def angle(row):
        return rf"$\theta_w$ = {row['hopper_angle']:g}°"

    def short(row):
        return angle(row) + variant_label(row, latex=True)

    def full(row):
        return f"{angle(row)}, {model_label(row)}" if several else short(row)

    exponents = _exponents(table, ["dim", *by])
    curves, quantities = _crossovers(exponents, by, 2, full, lambda key: published.LAMBDA_C_ANGLE.get(int(key[0])))
    models = exponents.drop_duplicates(MODEL)[MODEL]
    rows = len(models) + -(-len(models) // 2)
    figure, panels = plt.subplots(rows, 2, figsize=(plotting.PAGE, 3.9 * rows), layout="constrained", squeeze=False)
    of_lambda_c = panels[len(models):].ravel()
    for axes in of_lambda_c[len(models):]:
        axes.set_axis_off()
    between = table[(table["lam"] > 0) & np.isfinite(table["lam"])]  # friction and drag act
    both = "drag_friction_ratio" in between and between["drag_friction_ratio"].notna().any()
    ratios = ensemble.average(between, ["lam", *by], "drag_friction_ratio") if both else None
    for (left, right), middle, (_, model) in zip(panels, of_lambda_c, models.iterrows()):
        own = [(group.iloc[0], group, *fits) for _, group, *fits in curves if _same(group, model).all()]
        _draw_crossovers(left, [(short(row), *rest) for row, *rest in own], 2, published.LAMBDA_C_ANGLE.values(),
                         _lambda_label(table, 2), title=model_label(model) if several else "", alignment="left")
        _draw_lambda_c(middle, own, _lambda_label(table, 2, r"\lambda_c").replace(" (", "\n("))
        if several:
            middle.set_title(model_label(model), loc="left")
        if ratios is None:
            right.set_axis_off()
        else:
            quantities += _draw_ratios(right, ratios[_same(ratios, model)], own, full, sorted(ratios["lam"].unique()))
    return figure, [_renamed(replace(q, name=q.name.replace(r"\theta_w", "theta_w").replace("°", "")), 2) for q in quantities]


def draw_size(measured):
    """[H Fig. 12]: beta against lambda, and C, for several numbers of particles."""
    table = with_limit(plain(measured))
    exponents = _exponents(table, ["dim", "n"])
    figure, (left, right) = plt.subplots(1, 2, figsize=(plotting.PAGE, 4.7), layout="constrained")
    curves, quantities = _crossovers(exponents, ["n"], 2, lambda row: f"$N$ = {row['n']:g}",
                                     lambda key: published.LAMBDA_C[2])
    _draw_crossovers(left, curves, 2, [published.LAMBDA_C[2]], _lambda_label(table, 2))
    quantities = [_renamed(q, 2) for q in quantities]
    fits = beverloo.fit_seeds(limits(measured), ["limit", "dim", "n"])
    for i, (limit, name) in enumerate(LIMIT_NAMES.items()):
        group = fits[(fits["limit"] == limit) & fits["reference_fit"].notna()].sort_values("n")
        if len(group) < 2:
            continue
        C, error = np.array([fitted(row["reference_fit"], "C") for _, row in group.iterrows()]).T
        plotting.errorbar(right, group["n"], C / C[0], error / C[0], fmt=plotting.MARKERS[i], color=plotting.COLORS[i],
                          capsize=2.5, label=name)
        n = group["n"].to_numpy(float)
        (power, offset), covariance = np.polyfit(np.log(n), np.log(C), 1, w=C / error, cov="unscaled") \
            if len(n) > 2 else (np.polyfit(np.log(n), np.log(C), 1), np.full((2, 2), np.nan))
        grid = np.linspace(n[0], n[-1], 50)
        right.plot(grid, np.exp(offset) * grid**power / C[0], color=plotting.COLORS[i], lw=1.1)
        quantities.append(Quantity(f"p of C ~ N^p, {name}", float(power), float(np.sqrt(covariance[0, 0])),
                                   published.C_SIZE[limit], "C with the published beta held"))
    n = np.array(sorted(fits["n"].unique()), float)
    right.plot(n, n / n[0], "-.", color="0.45", lw=1, label="[H], friction: linear")
    right.set(xlabel="$N$", ylabel=f"$C/C_{{{n[0]:g}}}$", ylim=(0, None))
    right.legend()
    return figure, quantities
