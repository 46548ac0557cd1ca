"""The figures of the hopper paper."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from .. import beverloo, beverloo_figures, ensemble, plotting
from ..beverloo_figures import FRACTIONS, W_LABEL, draw_flow, log_axes, plain_numbers
from ..crossover import fit_crossover
from ..errors import RunError
from ..script import remark
from . import published
from .figure import Figure, Quantity

LIMIT_NAMES = {"friction": "friction only", "drag": "drag only"}
COEFFICIENT = {"friction": "mu", "drag": "zeta"}
_LIMIT_AT = {0.0: "friction", np.inf: "drag"}  #: by lambda
BETA, LAMBDA = r"$\beta$", r"$\lambda = \zeta/\mu$"
_MODEL = ["model", "e_sp", "k_l", "k_b"]
#: What runs of one model may differ in beside (`_of_several`).
_VARIANT = ["contacts", "size"]
_COULOMB = "disk"  #: the model whose mu is a coefficient of Coulomb friction, not that of [H 6]
_KINDS = {"soft": ("sp",), "deformable": ("rough", "smooth")}  #: of particles, with their models


def rounded(x):
    """To four digits: tables hold rounded coefficients, and equal ones get equal values."""
    return float(f"{x:.4g}")


def chi2_note(chi2):
    return f"chi2/dof {chi2:.3g}" if np.isfinite(chi2) else "as many parameters as points"


def with_limit(measured):
    """The same with lam, zeta/mu, and limit: friction, drag, or empty between them. With drag per mass lam is that of the
    numbers of the authors' code, to which the published values belong if the figures come from it. Without runs of
    another law of friction than [H 6]."""
    if "model" in measured and (other := measured["model"] == _COULOMB).any():
        remark(f"{other.sum()} runs of frictional disks are left out: their mu is not that of [H 6]")
        measured = measured[~other]
    mu, zeta = measured["mu"].to_numpy(float), measured["zeta"].to_numpy(float)
    with np.errstate(divide="ignore", invalid="ignore"):
        lam = np.where(mu > 0, zeta / mu, np.inf)
    if "drag" in measured:
        lam = lam / np.where(measured["drag"] == "per_mass", measured["dim"].map(published.CODE_LAMBDA), 1.0)
    return measured.assign(lam=[rounded(x) for x in lam], mu=[rounded(x) for x in mu], zeta=[rounded(x) for x in zeta],
                           limit=np.select([zeta == 0, mu == 0], ["friction", "drag"], ""))


def ratio(options):
    """zeta/mu of a row's options, as `with_limit` has it for the same law of drag."""
    mu, zeta = (float(options.get(name, 0)) for name in ("mu", "zeta"))
    return rounded(zeta / mu) if mu > 0 else np.inf


def limit(options):
    """Whether a row's options have friction only or drag only; None between them."""
    return _LIMIT_AT.get(ratio(options))


def _planar(measured):
    """Raises RunError for runs in 3D, with whose exponents the figure would compare nothing."""
    if (measured["dim"] == 3).any():
        raise RunError("there are runs in 3D, but this figure is of the plane: leave them out (H3, H4 and coefficients-3d "
                       "have spheres)")
    return measured


def of_kind(measured, kind):
    """The runs of 'soft' or of 'deformable' particles. Raises RunError if there are none."""
    own = measured[measured["model"].isin(_KINDS[kind])]
    if own.empty:
        raise RunError(f"no run has {kind} particles (-model {' or '.join(_KINDS[kind])}), of which this figure is")
    return own


def is_soft(measured):
    """Whether a run, or each run of a table, has soft particles [H 2], no deformable ones."""
    return measured["model"] == "sp"


def model_label(row, latex=True):
    """'soft, E_sp = 100' or 'smooth, K_l = 10, K_b = 0.1'; with `edges` of `_stiffness_fits`, `contacts` of `draw_angles` and
    `size`, if any."""
    return f"{'soft' if is_soft(row) else row['model']}, {_stiffness_label(row, latex)}" + _variant_label(row, latex)


def _stiffness_label(row, latex=True):
    """'E_sp = 100' or 'K_l = 10, K_b = 0.1'; with `edges` of `_stiffness_fits`, if any."""
    e_sp, k_l, k_b = ("$E_{sp}$", "$K_l$", "$K_b$") if latex else ("E_sp", "K_l", "K_b")
    if is_soft(row):
        return f"{e_sp} = {row['e_sp']:g}"
    return f"{k_l} = {row['k_l']:g}, {k_b} = {row['k_b']:g}" + (", full edges" if row.get("edges") == "full" else "")


def _variant_label(row, latex=False):
    """', E_c = 250' and ', N = 400' where a row has `contacts` and `size` that are not 0."""
    values = (("$E_c$" if latex else "E_c", row.get("contacts", 0)), ("$N$" if latex else "N", row.get("size", 0)))
    return "".join(f", {name} = {value:g}" for name, value in values if value > 0)


def plain(measured):
    """Soft particles do not have what deformable ones have, and these no E_sp: equal groups get equal columns."""
    soft = is_soft(measured)
    return measured.assign(**{c: measured[c].where(soft == (c == "e_sp"), 0.0) for c in (*_MODEL[1:], "e_c")})


def limits(measured):
    """Runs in the limits alone, as of `with_limit`. Raises RunError if there are none."""
    table = with_limit(plain(measured))
    table = table[table["limit"] != ""]
    if table.empty:
        raise RunError("no run has friction only or drag only: this figure needs rows with mu alone or zeta alone")
    return table


def is_hard(row):
    """Whether the published offset of hard particles is meant."""
    return row["e_sp"] >= 1e4 if is_soft(row) else row["k_b"] >= 100


def _named(row, end=""):
    return f"{model_label(row, latex=False)}{end}, {LIMIT_NAMES[row['limit']]}"


def fit_quantities(fits, name_of):
    """Exponent, prefactor and offset of every fit, and how bad the published exponent fits, and the opposite one where
    `fits` have it. In 2D the published prefactor is that of all particles, the offset that of hard ones."""
    quantities = []
    for _, row in fits.iterrows():
        name = name_of(row)
        known = {"beta": published.exponent(int(row["dim"]), row["limit"])}
        if row["dim"] == 2:
            known |= {"C": published.C[row["limit"]]} | ({"k": published.K[row["limit"]]} if is_hard(row) else {})
        for quantity in ("beta", "C", "k"):
            value, error = (getattr(row["fit"], quantity + end) if row["fit"] else np.nan for end in ("", "_error"))
            quantities.append(Quantity(f"{quantity}: {name}", value, error, known.get(quantity), row["note"]))
        if row["reference_fit"] and row["fit"]:
            held, fixed = f"with beta = {FRACTIONS.get(row['reference'], row['reference'])} held", row["reference_fit"]
            quantities += [Quantity(f"{quantity} {held}: {name}", getattr(fixed, quantity),
                                    getattr(fixed, quantity + "_error"), known.get(quantity), fixed.note)
                           for quantity in ("C", "k")]
            quantities.append(Quantity(f"chi2/dof {held}: {name}", fixed.chi2_reduced, np.nan, None,
                                       f"with beta free: {chi2_note(row['fit'].chi2_reduced)}"))
        if row.get("opposite_fit") and row["fit"]:
            held = f"with beta = {FRACTIONS.get(row['opposite'], row['opposite'])} held"
            quantities += [
                Quantity(f"chi2/dof {held}: {name}", row["opposite_fit"].chi2_reduced, np.nan, None,
                         "the exponent published for the other limit"),
                *(Quantity(f"residual of Q {which}: {name}", relative_residual(row["data"], row[fit]), np.nan)
                  for which, fit in (("with beta free", "fit"), (f"with beta = {FRACTIONS.get(row['reference'])} held",
                                                                 "reference_fit"), (held, "opposite_fit")))]
    return quantities


def relative_residual(data, fit):
    """Root mean square of Q over the fitted law, less 1, of the widths with flow."""
    flowing = data[data["Q"] > 0]
    return float(np.sqrt(np.mean((fit(flowing["hopper_width"]) / flowing["Q"] - 1) ** 2)))


def draw_limits(measured):
    """[H 2, 3, 10]: Q(w) with fits, and Q/C, a row of panels per limit; in 2D the published law of hard particles."""
    fits = beverloo.fit_seeds(limits(measured), ["limit", "dim", *_MODEL, "mu", "zeta"])
    there = [limit for limit in LIMIT_NAMES if (fits["limit"] == limit).any()]
    figure, panels = plt.subplots(len(there), 2, figsize=(9.4, 3.9 * len(there)), layout="constrained", squeeze=False)
    quantities = []
    for (left, right), limit in zip(panels, there):
        group = fits[fits["limit"] == limit]
        own = COEFFICIENT[limit]
        # The coefficient, and 3D, are named where there are several.
        ends = [(f", {own} = {row[own]:g}" if group[own].nunique() > 1 else "")
                + (", 3D" if fits["dim"].nunique() > 1 and row["dim"] == 3 else "") for _, row in group.iterrows()]
        draw_flow(left, right, group, [model_label(row) + end.replace(own, rf"$\{own}$")
                                       for (_, row), end in zip(group.iterrows(), ends)])
        ends = dict(zip(group.index, ends))
        quantities += fit_quantities(group, lambda row, ends=ends: _named(row, ends[row.name]))
        if (group["dim"] == 2).all():
            law = published.C[limit].value, published.K[limit].value, published.exponent(2, limit).value
            grid = law[1] + (left.get_xlim()[1] - law[1]) * np.linspace(0, 1, 200) ** 2
            left.plot(grid, beverloo.beverloo(grid, *law), "-.", color="0.2", lw=1.2,
                      label=f"[H], hard: $C$ = {law[0]:g}, $k$ = {law[1]:g}")
            beverloo_figures.groups_first(left)
        left.set_title(LIMIT_NAMES[limit], loc="left")
    return figure, quantities


def _exponents(table, by, value="Q"):
    """A row per group of `by` and lambda with its exponent; those without one are left out. Raises RunError if there are
    none."""
    fits = beverloo.fit_seeds(table, [*by, "lam"], value)
    fits = fits[fits["fit"].notna()] if len(fits) else fits
    if fits.empty:
        raise RunError("no lambda has enough widths for a fit of beta")
    return fits


def _crossovers(exponents, by, dim, label, known):
    """[(label, group, fit with the published ends, fit with free ends)] and their quantities. known(key) → Published."""
    curves, quantities = [], []
    ends = dim - 1.5, dim - 0.5
    for key, group in ensemble.groups(exponents, by):
        name = label(group.iloc[0])
        found = []
        for kind, held in (("published ends", ends), ("free ends", None)):
            try:
                fit = fit_crossover(group["lam"], group["beta"], group["beta_error"], held)
            except RunError as error:
                found.append(None)
                quantities.append(Quantity(f"lambda_c, {kind}: {name}", np.nan, np.nan, known(key), str(error)))
                continue
            found.append(fit)
            quantities.append(Quantity(f"lambda_c, {kind}: {name}", fit.lam_c, fit.lam_c_error, known(key),
                                       "; ".join(filter(None, [fit.note, chi2_note(fit.chi2_reduced)]))))
            if held is None:
                for part, limit in (("high", "friction"), ("low", "drag")):
                    quantities.append(Quantity(f"beta, fitted end ({limit}): {name}", getattr(fit, part),
                                               getattr(fit, part + "_error"), published.exponent(dim, limit), fit.note))
        for row in group.itertuples():
            limit = _LIMIT_AT.get(row.lam)
            quantities.append(Quantity(f"beta at lambda = {row.lam:g}: {name}", row.beta, row.beta_error,
                                       published.exponent(dim, limit) if limit else None, row.note))
        curves.append((name, group, *found))
    return curves, quantities


def _draw_crossovers(axes, curves, dim, lam_c, **legend):
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
    axes.set(xscale="log", xlabel=LAMBDA, ylabel=BETA, xlim=edges)
    ticks = [edges[0], *10.0 ** np.arange(np.ceil(np.log10(low)), np.floor(np.log10(high)) + 0.5), edges[1]]
    axes.set_xticks(ticks, labels=["0", *(f"{t:g}" for t in ticks[1:-1]), r"$\infty$"])
    axes.minorticks_off()
    axes.legend(**legend)


def _of_several(table, column, by=("dim", *_MODEL)):
    """The values of a column where groups of `by`, runs of one model, have several, else 0."""
    return table[column].where(table.groupby(list(by))[column].transform("nunique") > 1, 0.0)


def draw_lambda(measured, value="Q"):
    """[H 4, 11, 12a]: beta against lambda with the corrected sigmoid, a panel per dimension; of hoppers with several angles
    the flattest, in each dimension."""
    table = with_limit(plain(measured))
    steep = table["hopper_angle"] < table.groupby("dim")["hopper_angle"].transform("max")
    if steep.any():
        remark(f"{steep.sum()} runs of steeper hoppers are left out, which H6 shows")
    table = table[~steep]
    table, by = table.assign(size=_of_several(table, "n")), [*_MODEL, "size"]
    exponents = _exponents(table, ["dim", *by], value)  # of a campaign that has begun there may be a few runs in 3D
    every = [(int(dim), group) for dim, group in exponents.groupby("dim")]
    figure, panels = plt.subplots(1, len(every), figsize=(6.2 * len(every), 4.4), layout="constrained", squeeze=False)
    quantities = []
    for axes, (dim, exponents) in zip(panels[0], every):
        curves, found = _crossovers(exponents, by, dim, model_label, lambda key, dim=dim: published.LAMBDA_C[dim])
        _draw_crossovers(axes, curves, dim, [published.LAMBDA_C[dim]])
        axes.set_title(f"{dim}D", loc="left")
        quantities += [_renamed(q, dim) for q in found]
    return figure, quantities


def _renamed(quantity, dim):
    name = quantity.name.replace("$", "").replace("{", "").replace("}", "")
    return Quantity(name + (", 3D" if dim == 3 else ""), quantity.value, quantity.error, quantity.published, quantity.note)


def draw_corrected(measured):
    """[H 11]: beta from Q, and from Q' corrected for overlaps."""
    table = _planar(with_limit(plain(measured)))
    rates = [(mark, _exponents(table, ["dim", *_MODEL], value)) for value, mark in (("Q", ""), ("Q_corrected", "'"))]
    figure, panels = plt.subplots(1, 2, figsize=(12, 4.4), layout="constrained", sharey=True)
    quantities = []
    for axes, (mark, exponents) in zip(panels, rates):
        curves, found = _crossovers(exponents, _MODEL, 2, model_label, lambda key: published.LAMBDA_C[2])
        _draw_crossovers(axes, curves, 2, [published.LAMBDA_C[2]])
        prime = mark.replace("'", "\N{PRIME}")  # that of mathtext can hardly be seen
        axes.set_ylabel(rf"$\beta${prime}")
        axes.set_title(f"from Q{prime}" + (", corrected for overlaps" if prime else ""), loc="left")
        for q in found:
            q = _renamed(q, 2)
            quantities.append(Quantity(f"from Q{mark}, {q.name}", q.value, q.error, q.published, q.note))
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


def draw_angles(measured):
    """[H 6]: beta against lambda for hoppers of several angles; lambda_c and the ratio of drag to friction against the
    angle. A row of panels per model; several stiffnesses of its contacts, or several N, are curves of their own."""
    table = _planar(with_limit(plain(measured)))
    table = table.assign(contacts=_of_several(table, "e_c"), size=_of_several(table, "n"))
    by = ["hopper_angle", *_MODEL, *_VARIANT]
    several = len(table.drop_duplicates(_MODEL)) > 1

    def angle(row):
        return rf"$\theta_w$ = {row['hopper_angle']:g}°"

    def short(row):
        return angle(row) + _variant_label(row, latex=True)

    def full(row):
        return f"{angle(row)}, {model_label(row)}" if several else short(row)

    exponents = _exponents(table, ["dim", *by])
    curves, quantities = _crossovers(exponents, by, 2, full, lambda key: published.LAMBDA_C_ANGLE.get(int(key[0])))
    models = exponents.drop_duplicates(_MODEL)[_MODEL]
    figure, panels = plt.subplots(len(models), 3, figsize=(14, 4.2 * len(models)), layout="constrained", squeeze=False,
                                  gridspec_kw={"width_ratios": [1.6, 1, 1]})
    between = table[(table["lam"] > 0) & np.isfinite(table["lam"])]  # friction and drag act
    both = "drag_friction_ratio" in between and between["drag_friction_ratio"].notna().any()
    ratios = ensemble.average(between, ["lam", *by], "drag_friction_ratio") if both else None
    for (left, middle, right), (_, model) in zip(panels, models.iterrows()):
        own = [(group.iloc[0], group, *fits) for _, group, *fits in curves if _same(group, model).all()]
        _draw_crossovers(left, [(short(row), *rest) for row, *rest in own], 2, published.LAMBDA_C_ANGLE.values(),
                         loc="lower left", bbox_to_anchor=(0, 1), ncols=2, title=model_label(model) if several else "",
                         alignment="left")
        _draw_lambda_c(middle, own)
        if ratios is None:
            right.set_axis_off()
        else:
            quantities += _draw_ratios(right, ratios[_same(ratios, model)], own, full, sorted(ratios["lam"].unique()))
    return figure, [_renamed(Quantity(q.name.replace(r"\theta_w", "theta_w").replace("°", ""), q.value, q.error,
                                      q.published, q.note), 2) for q in quantities]


def _same(table, row):
    """Which rows of a table agree with all of `row`."""
    return (table[row.index] == row).all(axis=1)


def _draw_lambda_c(axes, curves):
    """lambda_c against the angle of the hopper, where it is known."""
    for i, (kind, style) in enumerate((("published ends", "o"), ("free ends", "s"))):
        points = [(group["hopper_angle"].iloc[0], fit) for _, group, *fits in curves
                  if (fit := fits[i]) and np.isfinite(fit.lam_c_error)]
        if points:
            plotting.errorbar(axes, [a for a, _ in points], [f.lam_c for _, f in points], [f.lam_c_error for _, f in points],
                              fmt=style, capsize=2.5, label=kind)
    axes.plot(list(published.LAMBDA_C_ANGLE), [p.value for p in published.LAMBDA_C_ANGLE.values()], "k*", ms=8,
              label="[H]")
    axes.set(xlabel=r"$\theta_w$  [degrees]", ylabel=r"$\lambda_c$", yscale="log")
    axes.legend()


def _draw_ratios(axes, ratios, curves, full, lams):
    """Drag over friction of one model against the angle of the hopper; its quantities at lambda = 0.01 and at lambda_c.
    full(row) is what their names call a row; `lams` are those of all models, each of one colour."""
    quantities = []
    for lam, at_lam in ratios.groupby("lam"):
        for j, (_, group) in enumerate(at_lam.groupby(_VARIANT)):
            plotting.errorbar(axes, group["hopper_angle"], group["drag_friction_ratio"], group["drag_friction_ratio_error"],
                              linestyle=("-", "--", ":", "-.")[j % 4], capsize=2.5, **plotting.symbol(lams.index(lam) + 8 * j),
                              label=rf"$\lambda$ = {lam:g}" + _variant_label(group.iloc[0], latex=True))
        if lam == 0.01 and len(at_lam) > 1:
            quantities += [Quantity(f"|F_zeta|/|F_mu| at lambda = 0.01, {full(row)}", row["drag_friction_ratio"],
                                    row["drag_friction_ratio_error"]) for _, row in at_lam.iterrows()]
    quantities += [Quantity(f"|F_zeta|/|F_mu| at lambda_c, free ends: {full(row)}",
                            *_ratio_at_crossover(ratios[_same(ratios, row[["hopper_angle", *_VARIANT]])], free))
                   for row, _, _, free in curves if free]
    axes.set(xlabel=r"$\theta_w$  [degrees]", ylabel=r"$|F_\zeta|/|F_\mu|$, mean over $w$", yscale="log")
    if len(ratios):
        axes.legend(loc="center left", bbox_to_anchor=(1, 0.5))
    return quantities


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


def draw_profiles(measured):
    """[H 5]: velocity on the axis against height for several widths, and at the orifice against the width."""
    table = with_limit(measured)
    lams = sorted(table["lam"].unique())
    titles = {0.0: r"$\lambda = 0$", np.inf: r"$\lambda = \infty$"}
    figure, panels = plt.subplots(1, len(lams) + 1, figsize=(3.6 * (len(lams) + 1), 3.9), layout="constrained")
    quantities, last = [], panels[-1]
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
        known = published.VELOCITY[_LIMIT_AT.get(lam, "crossover")]
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


def _held(row, quantity):
    """(value, error) of a fit with the published exponent held, NaN where there is none."""
    fit = row["reference_fit"]
    return (getattr(fit, quantity), getattr(fit, quantity + "_error")) if fit else (np.nan, np.nan)


def _against(axes, fits, x, quantity, x_label, label, references=None):
    """A quantity of fits with the published exponent held (filled) and free (open) against the column x, a curve per
    limit and K_l."""
    several = fits["k_l"].nunique() > 1
    for (limit, k_l), group in fits.sort_values(x).groupby(["limit", "k_l"]):
        color = plotting.COLORS[list(LIMIT_NAMES).index(limit)]
        marker = plotting.MARKERS[sorted(fits["k_l"].unique()).index(k_l) % 8 if several else list(LIMIT_NAMES).index(limit)]
        name = LIMIT_NAMES[limit] + (f", $K_l$ = {k_l:g}" if several else "")
        held = group[group["reference_fit"].notna()]
        values = np.array([_held(row, quantity) for _, row in held.iterrows()]).reshape(-1, 2)
        plotting.errorbar(axes, held[x], values[:, 0], values[:, 1], fmt=marker + "-", lw=0.9, color=color, capsize=2.5,
                          label=name)
        free = group[group["fit"].notna()]
        values = np.array([(getattr(f, quantity), getattr(f, quantity + "_error")) for f in free["fit"]]).reshape(-1, 2)
        plotting.errorbar(axes, free[x] * 1.04, values[:, 0], values[:, 1], fmt=marker, color=color, mfc="white", alpha=0.6,
                          lw=0.8)
    for i, limit in enumerate(LIMIT_NAMES):
        for one in (references or {}).get(limit, ()):
            axes.axhline(one.value, color=plotting.COLORS[i], ls="-.", lw=0.9)
    axes.plot([], [], "o", color="0.4", mfc="white", label=r"$\beta$ free")
    if references:
        axes.plot([], [], "-.", color="0.4", lw=0.9, label="[H], hard")
    axes.set(xscale="log", xlabel=x_label, ylabel=label)
    if (few := sorted(fits[x].unique()))[-1] < 10 * few[0]:  # less than the ticks of a decade
        axes.set_xticks(few, labels=[f"{one:g}" for one in few])
        axes.minorticks_off()
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1.08), ncols=2)


def _prefactor_quantities(fits, names, known):
    """Quantities of fits with the published exponent held, and free; known(row, quantity) → Published or None."""
    quantities = []
    for _, row in fits.iterrows():
        name = _named(row)
        for quantity in names:
            quantities.append(Quantity(f"{quantity} with the published beta held: {name}", *_held(row, quantity),
                                       known(row, quantity), chi2_note(row["reference_fit"].chi2_reduced)
                                       if row["reference_fit"] else row["note"]))
            free = row["fit"]
            quantities.append(Quantity(f"{quantity}, beta free: {name}", getattr(free, quantity) if free else np.nan,
                                       getattr(free, quantity + "_error") if free else np.nan, known(row, quantity),
                                       row["note"]))
    return quantities


def _map(axes, group, title):
    """Colour map of k, with the published exponent held, over K_l and K_b. A star: bending of full edges, where no other is."""
    one = group.assign(k=[_held(row, "k")[0] for _, row in group.iterrows()], star=group["edges"] == "full")
    one = one.sort_values("star").drop_duplicates(["k_b", "k_l"])
    grid, stars = (one.pivot(index="k_b", columns="k_l", values=name) for name in ("k", "star"))
    mesh = axes.pcolormesh(np.arange(grid.shape[1] + 1), np.arange(grid.shape[0] + 1), grid.to_numpy(), cmap="viridis")
    for (i, j), k in np.ndenumerate(grid.to_numpy()):
        if np.isnan(k):
            continue
        axes.text(j + 0.5, i + 0.5, f"{k:.2f}" + ("*" if stars.iloc[i, j] else ""), ha="center", va="center", fontsize=8,
                  color="white" if k < np.nanmean(grid) else "black")
    axes.set_xticks(np.arange(grid.shape[1]) + 0.5, labels=[f"{v:g}" for v in grid.columns])
    axes.set_yticks(np.arange(grid.shape[0]) + 0.5, labels=[f"{v:g}" for v in grid.index])
    axes.set(xlabel="$K_l$", ylabel="$K_b$")
    axes.set_title(title + (" (*: full edges bend)" if one["star"].any() else ""), loc="left")
    axes.figure.colorbar(mesh, ax=axes, label="$k$")


def _stiffness_fits(measured):
    """Fits of every stiffness in the limits; `edges` tells bending of full edges from that of unit vectors where there are
    both, `size` is N where soft or deformable particles have several. Raises RunError where no fit, not even with the
    exponent held, is possible."""
    table = _planar(limits(measured))
    bending = table["bending_edges"].where(~is_soft(table))
    edges = bending.fillna("") if bending.nunique() > 1 else ""
    fits = beverloo.fit_seeds(table.assign(edges=edges), ["limit", "dim", *_MODEL, "edges", "n"])
    if fits["reference_fit"].isna().all():
        raise RunError("no stiffness has enough widths for a fit: at least two with flow are needed")
    return fits.assign(size=_of_several(fits.assign(soft=is_soft(fits)), "n", by=["soft"]))


def _alike(fits):
    """[(name, fits of one model and one N)] of `_stiffness_fits`, soft particles first."""
    return [(name + _variant_label(group.iloc[0], latex=True), group)
            for model, name in (("sp", "soft"), ("smooth", "smooth"), ("rough", "rough"))
            for _, group in fits[fits["model"] == model].groupby("n")]


def draw_offsets(measured):
    """[H 7]: the offset k against the stiffness of soft particles, and over K_l and K_b of deformable ones."""
    fits = _stiffness_fits(measured)
    panels = []  # (name, limit of a map, fits)
    for name, group in _alike(fits):
        if is_soft(group).all():
            panels.append((name, None, group))
        else:
            by_limit = ((limit, group[group["limit"] == limit]) for limit in LIMIT_NAMES)
            panels += [(name, limit, one) for limit, one in by_limit if one["k_l"].nunique() > 1]
    if not panels:
        raise RunError("neither soft particles nor deformable ones with several K_l")
    columns = min(len(panels), 3)
    rows = -(-len(panels) // columns)
    figure, grid = plt.subplots(rows, columns, figsize=(5.0 * columns, 4.0 * rows), layout="constrained", squeeze=False)
    for axes, (name, limit, group) in zip(grid.flat, panels):
        if limit:
            _map(axes, group, f"{name}, {LIMIT_NAMES[limit]}")
        else:
            _against(axes, group, "e_sp", "k", "$E_{sp}$", "$k$", {limit: (published.K[limit],) for limit in LIMIT_NAMES})
            axes.set_title(name, loc="right")
    for axes in grid.flat[len(panels):]:
        axes.set_axis_off()

    def known(row, quantity):
        if is_hard(row):
            return published.K[row["limit"]]
        softest = row["e_sp"] <= 50 if is_soft(row) else row["k_b"] <= 0.01 and row["k_l"] <= 10
        return published.K_SOFT[row["limit"]] if softest else None

    exponents = [Quantity(f"beta: {_named(row)}", row["fit"].beta, row["fit"].beta_error, published.exponent(2, row["limit"]),
                          row["note"]) for _, row in fits[fits["fit"].notna()].iterrows()]
    return figure, exponents + _prefactor_quantities(fits, ("k",), known)


_AT_BOUND = 1e-3  # w - k of a fit whose k is at its bound, just below the narrowest orifice


def _collapse(axes, fits, limit):
    """Q/C against w - k with the published exponent held, of one model and one N."""
    group = fits[(fits["limit"] == limit) & fits["reference_fit"].notna()]
    for i, (_, row) in enumerate(group.iterrows()):
        data, fit = row["data"], row["reference_fit"]
        above = data["hopper_width"] > fit.k + _AT_BOUND
        plotting.errorbar(axes, data["hopper_width"][above] - fit.k, data["Q"][above] / fit.C,
                          data["Q_error"][above] / fit.C, ls="", capsize=2, label=_stiffness_label(row), **plotting.symbol(i))
    if len(group):
        beta = group["reference"].iloc[0]
        x = np.geomspace(0.3, 10, 50)
        axes.plot(x, x**beta, "--", color="0.45", lw=1.1, label=f"[H], slope {FRACTIONS.get(beta, beta)}")
    axes.set(xlabel=r"$w/\sigma_{avg} - k$", ylabel=r"$Q/C$")
    axes.set_title(LIMIT_NAMES[limit], loc="left")
    log_axes(axes)
    if len(group):
        axes.legend(loc="center left", bbox_to_anchor=(1, 0.5))


def _fall(fits, limit):
    """[Quantity] of how far C falls within the stiffnesses of soft particles that the paper has; none for others."""
    group = fits[(fits["limit"] == limit) & is_soft(fits) & fits["reference_fit"].notna()
                 & fits["e_sp"].between(published.C_FALL_FROM, published.C_FALL_TO)].sort_values("e_sp")
    if len(group) < 2:
        return []
    first, last = group.iloc[0], group.iloc[-1]
    (soft, soft_error), (hard, hard_error) = _held(first, "C"), _held(last, "C")
    name = f"C at E_sp = {first['e_sp']:g} over C at {last['e_sp']:g}{_variant_label(first)}, {LIMIT_NAMES[limit]}"
    return [Quantity(name, soft / hard, soft / hard * np.hypot(soft_error / soft, hard_error / hard),
                     published.C_FALL[limit], "with the published beta held")]


def _draw_prefactors(measured, x, label):
    fits = _stiffness_fits(measured)
    alike = _alike(fits)
    figure, panels = plt.subplots(len(alike), 3, figsize=(15, 4.4 * len(alike)), layout="constrained", squeeze=False)
    quantities = _prefactor_quantities(fits, ("C",), lambda row, quantity: published.C[row["limit"]])
    for (left, *others), (name, group) in zip(panels, alike):
        _against(left, group, x, "C", label, r"$C$  [$\sigma_{avg}^2/t_0$]",
                 {limit: (published.C[limit],) for limit in LIMIT_NAMES})
        left.set_yscale("log")
        plain_numbers(left.yaxis)
        if len(alike) > 1:
            left.set_title(name, loc="right")
        for axes, limit in zip(others, LIMIT_NAMES):
            _collapse(axes, group, limit)
            quantities += _fall(group, limit)
    return figure, quantities


def draw_soft_prefactors(measured):
    """[H 13]: the prefactor C against the stiffness of soft particles, and Q/C against w - k."""
    return _draw_prefactors(of_kind(measured, "soft"), "e_sp", "$E_{sp}$")


def draw_deformable_prefactors(measured):
    """[H 14]: the same of deformable particles against K_b."""
    return _draw_prefactors(of_kind(measured, "deformable"), "k_b", "$K_b$")


def draw_size(measured):
    """[H 12]: beta against lambda, and C, for several numbers of particles."""
    table = _planar(with_limit(plain(measured)))
    exponents = _exponents(table, ["dim", "n"])
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.5, 4.4), layout="constrained")
    curves, quantities = _crossovers(exponents, ["n"], 2, lambda row: f"$N$ = {row['n']:g}",
                                     lambda key: published.LAMBDA_C[2])
    _draw_crossovers(left, curves, 2, [published.LAMBDA_C[2]])
    quantities = [_renamed(q, 2) for q in quantities]
    fits = beverloo.fit_seeds(limits(measured), ["limit", "dim", "n"])
    for i, (limit, name) in enumerate(LIMIT_NAMES.items()):
        group = fits[(fits["limit"] == limit) & fits["reference_fit"].notna()].sort_values("n")
        if len(group) < 2:
            continue
        C, error = np.array([_held(row, "C") for _, row in group.iterrows()]).T
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


def _ratio_of_hoppers(fits):
    """c0 of the second hopper over that of the first at the same widths: mean, with the error of the scatter where that is
    larger than that of the rates; None without two hoppers or common widths."""
    if len(fits) != 2:
        return None
    both = fits["data"].iloc[0].merge(fits["data"].iloc[1], on="hopper_width", suffixes=("", "_other"))
    both = both[(both["Q"] > 0) & (both["Q_other"] > 0)]
    if len(both) < 2:
        return None
    ratio = (both["Q"] / both["Q_other"]).to_numpy()
    error = ratio * np.hypot(both["Q_error"] / both["Q"], both["Q_error_other"] / both["Q_other"]).to_numpy()
    mean_error = max(ratio.std(ddof=1), np.sqrt((error**2).mean())) / np.sqrt(len(ratio))
    return Quantity(f"c0 of {fits['walls'].iloc[0]} over {fits['walls'].iloc[1]} degrees, mean over w", float(ratio.mean()),
                    float(mean_error), published.OIL_HOPPERS,
                    "{:.3g} at w = {:g}, {:.3g} at {:g}".format(ratio[0], both["hopper_width"].iloc[0], ratio[-1],
                                                                both["hopper_width"].iloc[-1]))


def draw_discharge(measured):
    """[H 8]: c0 of discharges of wedges, dN/dt = -c0 sqrt(N), against the width, with the law of the experiment."""
    table = measured[np.isfinite(measured["c0"].astype(float))]
    if table.empty:
        raise RunError("no discharge has a rate c0: it needs a wedge that runs empty")
    left = table["hopper_angle_left"].astype(float) if "hopper_angle_left" in table else np.nan
    table = table.assign(left=np.where(np.isfinite(left), left, table["hopper_angle"]))
    fits = beverloo.fit_seeds(table, ["zeta", "e_sp", "hopper_angle", "left", "dim"], "c0")
    fits["walls"] = [f"{row['hopper_angle']:g}/{row['left']:g}" for _, row in fits.iterrows()]
    several = len(fits[["zeta", "e_sp"]].drop_duplicates()) > 1
    fits["drag"] = [f", zeta = {row['zeta']:.3g}" if several else "" for _, row in fits.iterrows()]
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.4, 4.0), layout="constrained")
    labels = [f"{row['walls']}°{row['drag']}".replace("zeta", r"$\zeta$") for _, row in fits.iterrows()]
    draw_flow(left, right, fits.assign(reference=0.5, reference_fit=None), labels)
    oil = [published.OIL_K.value, published.OIL_BETA.value]
    grid = oil[0] + (left.get_xlim()[1] - oil[0]) * np.linspace(0, 1, 200) ** 2
    quantities = []
    for i, (_, row) in enumerate(fits.iterrows()):
        if row["fit"]:
            data = row["data"][row["data"]["hopper_width"] > oil[0]]
            shape = (data["hopper_width"] - oil[0]) ** oil[1]
            label = None if i else rf"oil drops [H]: $\beta$ = {oil[1]:g}, $k$ = {oil[0]:g}, $C$ fitted"
            left.plot(grid, (data["Q"] @ shape) / (shape @ shape) * (grid - oil[0]) ** oil[1], "-.", lw=1.2,
                      color=plotting.COLORS[i % 8], label=label)
        for quantity, known in (("beta", published.OIL_BETA), ("k", published.OIL_K), ("C", None)):
            value, error = (getattr(row["fit"], quantity + end) if row["fit"] else np.nan for end in ("", "_error"))
            quantities.append(Quantity(f"{quantity} of c0(w), {row['walls']} degrees{row['drag']}", value, error, known,
                                       row["note"]))
    for drag, pair in fits.groupby("drag"):
        if (ratio := _ratio_of_hoppers(pair)):
            quantities.append(replace(ratio, name=ratio.name + drag))
    left.set_ylabel(r"$c_0$  [$t_0^{-1}$]")
    right.set_ylabel(r"$c_0/C$")
    beverloo_figures.groups_first(left)
    return figure, quantities


_PARTICLES = ("dim", *_MODEL)
_LIMITS = (*_PARTICLES, "mu", "zeta", "hopper_width")
_STIFFNESS = (limit, *_PARTICLES, "bending_edges", "n", "hopper_width")
_LAMBDA = (ratio, *_PARTICLES, "hopper_angle", "n", "hopper_width")
_MAPS = ("hopper/map", "hopper/limits-smooth", "hopper/map-large", "hopper/smooth-large", "hopper/map-rough",
         "hopper/limits-rough", "hopper/map-rough-large", "hopper/rough-large")  #: K_l and K_b of deformable particles
_FEW = "soft particles alone, fewer seeds and shorter runs; no deformable ones"
FIGURES = [
    Figure("H2", "Q(w) of soft and deformable particles, friction only and drag only", ("quick/limits", "quick/stiff"),
           ("hopper/limits", "hopper/limits-smooth", "hopper/limits-rough"), "flows", draw_limits, _FEW,
           as_run=("as-run/limits",), tells=_LIMITS),
    Figure("H3", "Q(w) of soft spheres, friction only and drag only", ("quick/limits-3d",), ("hopper/limits-3d",),
           "flows", draw_limits, "half the particles, shorter runs", as_run=("as-run/limits-3d",), tells=_LIMITS),
    Figure("H4", "exponent beta against lambda = zeta/mu", ("quick/lambda", "quick/limits"),
           ("hopper/lambda", "hopper/lambda-3d", "hopper/lambda-smooth", "hopper/lambda-stiff", "hopper/lambda-rough",
            "hopper/limits-rough"),
           "flows", draw_lambda, "soft particles of one stiffness, 2D, fewer widths, shorter runs",
           as_run=("as-run/lambda", "as-run/limits", "as-run/lambda-hard", "as-run/limits-hard", "as-run/lambda-3d",
                   "as-run/limits-3d", "as-run/lambda-rough", "as-run/lambda-smooth", "as-run/lambda-stiff",
                   "as-run/limits-rough", "as-run/limits-smooth"),
           tells=_LAMBDA),
    Figure("lambda-path", "beta against lambda, where friction stays and drag is added", ("quick/lambda-path",),
           ("hopper/lambda-path",), "flows", draw_lambda, "fewer lambda and widths, shorter runs", tells=_LAMBDA),
    Figure("H5", "velocity on the axis for several widths, and its exponent at the orifice", ("quick/profile",),
           ("hopper/profile",), "profiles", draw_profiles, as_run=("as-run/profile",), tells=(ratio, "hopper_width")),
    Figure("H6", "beta(lambda) and the ratio of the forces for several angles", ("quick/angle", "quick/lambda"),
           ("hopper/angle", "hopper/angle-smooth", "hopper/angle-smooth-hard", "hopper/lambda-smooth"), "flows", draw_angles,
           "soft particles alone, three angles, fewer lambda, widths and seeds, shorter runs",
           as_run=("as-run/angle", "as-run/lambda", "as-run/limits", "as-run/angle-smooth", "as-run/lambda-smooth",
                   "as-run/limits-smooth"),
           tells=(ratio, *_MODEL, "e_c", "n", "hopper_angle", "hopper_width")),
    Figure("H7", "offset k against the stiffness of soft and deformable particles", ("quick/stiffness", "quick/map"),
           ("hopper/limits", "hopper/stiffness", *_MAPS), "flows", draw_offsets,
           "120 deformable particles with contacts softer than printed, three widths, two K_l and two K_b",
           as_run=("as-run/stiffness", "as-run/limits", "as-run/limits-hard", "as-run/map"), tells=_STIFFNESS),
    Figure("H8", "discharge of two wedges against their width, beside the experiment", ("quick/discharge",),
           ("hopper/discharge",), "flows", draw_discharge, "400 particles, four seeds",
           tells=("zeta", "e_sp", "hopper_angle", "hopper_angle_left", "hopper_width")),
    Figure("H10", "Q(w) of soft and of nearly hard particles", ("quick/limits", "quick/hard"),
           ("hopper/limits", "hopper/limits-smooth", "hopper/limits-rough"), "flows", draw_limits, _FEW,
           as_run=("as-run/limits", "as-run/limits-hard"), tells=_LIMITS),
    Figure("H11", "beta(lambda) of very soft particles, from Q and from Q' corrected for overlaps",
           ("quick/lambda-soft", "quick/lambda"), ("hopper/lambda-soft", "hopper/lambda"), "flows", draw_corrected,
           "fewer lambda and widths, shorter runs", tells=(ratio, *_MODEL, "hopper_width")),
    Figure("H12", "beta(lambda) and C for several numbers of particles", ("quick/size", "quick/limits", "quick/lambda"),
           ("hopper/size",),
           "flows", draw_size, "fewer lambda, widths and seeds, shorter runs",
           as_run=("as-run/size", "as-run/limits", "as-run/lambda"), tells=(ratio, "n", "hopper_width")),
    Figure("H13", "prefactor C of soft particles against their stiffness, and the collapse", ("quick/stiffness",),
           ("hopper/limits", "hopper/stiffness"), "flows", draw_soft_prefactors, "three stiffnesses, shorter runs",
           as_run=("as-run/stiffness", "as-run/limits", "as-run/limits-hard"), tells=_STIFFNESS),
    Figure("H14", "prefactor C of deformable particles, and the collapse", ("quick/map",),
           _MAPS, "flows", draw_deformable_prefactors,
           "120 particles with contacts softer than printed, three widths", as_run=("as-run/map",), tells=_STIFFNESS),
]
