"""Compares the exponents of the readings of the hopper paper: docs/models/published-models.md, "As printed and as
run"."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from .. import beverloo, ensemble, plotting
from ..beverloo_figures import FRACTIONS
from ..errors import RunError
from ..statistics import commonest
from ..symbols import SYMBOLS, models_that_read, parameters, plain
from . import published
from .figure import FREE, Figure, Quantity
from .hopper_runs import BETA, COEFFICIENT, LIMIT_NAMES, decides, fit_quantities, limits, model_label
from .hopper_runs import limit as limit_of

_UNITS = {"friction": r"$\mu/\mu_0$", "drag": r"$\zeta/\zeta_0$"}
NEAR = 0.1  #: beta is called 3/2 or 1/2 within this
SECOND_FROM = 4.0  #: readings are fitted a second time from this width on: the published k of drag leaves no flow at 3
STRONG = {"friction": 30.0, "drag": 3.0}  #: coefficients from which on Q is about inversely proportional to them

#: Options of the model and of the protocol. NaN: the program's default.
_COMMON = {"friction": "whole", "drag": "per_particle", "contact_law": "harmonic", "e_w": 1e4, "e_sp": 100.0,
           "count": "crossing", "removal_depth": np.nan, "reinsertion_gap": 0.0, "reinsertion_lateral_speed": np.nan,
           "pack_fraction": 0.84, "dt": np.nan, "n": 1600, "hopper_wall_distance": 50.0}
_AS_RUN = {"contact_law": "linear", "e_w": 694.0, "e_sp": 138.9, "count": "removal", "removal_depth": 2.5,
           "reinsertion_gap": 0.8333, "reinsertion_lateral_speed": 0.01, "dt": 2.5e-4}
PRINTED = {"friction": _COMMON | {"mu": 10 * np.sqrt(10), "zeta": 0.0}, "drag": _COMMON | {"mu": 0.0, "zeta": np.sqrt(0.1)}}
AS_RUN = {"friction": _COMMON | _AS_RUN | {"friction": "tangential", "mu": 8.505, "zeta": 0.0},
          "drag": _COMMON | _AS_RUN | {"drag": "per_mass", "mu": 0.0, "zeta": 1.54}}
_START_3D = {"n": 6400, "hopper_wall_distance": 25.0, "pack_fraction": 0.64}
PRINTED_3D = {limit: model | _START_3D for limit, model in PRINTED.items()}
AS_RUN_3D = {limit: AS_RUN[limit] | _START_3D | {"e_w": 578.7, "e_sp": 115.7} | coefficient
             for limit, coefficient in (("friction", {"mu": 28.4}), ("drag", {"zeta": 4.111}))}
MODELS = {2: (PRINTED, AS_RUN), 3: (PRINTED_3D, AS_RUN_3D)}
OPTIONS = list(PRINTED["drag"])
_SIZE = ("n", "hopper_wall_distance")
#: The options for deformable particles. [H 12] has friction at the vertex, which labels therefore name.
_DEFORMABLE = {"friction": "whole", "drag": "per_particle", "e_c": 1e4, "e_w": 1e4, "count": "crossing", "reinsertion_gap": 0.0,
               "area_energy": "absolute", "bending_edges": "unit", "edge_force": "single", "edge_width": 0.1,
               "friction_point": "contact", "wall_diameter": 0.0}
_DEFORMABLE_AS_RUN = {"e_c": 115.7, "e_w": 13.9, "count": "removal", "reinsertion_gap": 0.8333, "area_energy": "relative",
                      "bending_edges": "full", "edge_force": "twofold", "edge_width": 0.2, "wall_diameter": 0.1976}
#: The edges belong to smooth particles.
_EDGES = [name for name in _DEFORMABLE if models_that_read(name) == {"smooth"}]
MODELS_DEFORMABLE = [
    {limit: _DEFORMABLE | {name: PRINTED[limit][name] for name in ("mu", "zeta")} for limit in PRINTED},
    {limit: _DEFORMABLE | _DEFORMABLE_AS_RUN | {name: AS_RUN[limit][name] for name in ("mu", "zeta", "friction", "drag")}
     for limit in AS_RUN}]
_NOT_ACTING = {"drag": ("friction", "friction_point"), "friction": ("drag",)}  #: options without a coefficient, by limit
_MODEL = [name for name in OPTIONS if name in parameters("hopper")]
_PROTOCOL = [name for name in OPTIONS if name not in _MODEL]
_WORDS = {"whole": "whole friction", "tangential": "tangential friction", "per_particle": "drag per particle",
          "per_mass": "drag per mass", "linear": "linear contacts", "harmonic": "harmonic contacts",
          "crossing": "counted at crossing", "removal": "counted at removal",
          "absolute": "absolute area", "relative": "relative area", "unit": "bending of unit edges",
          "full": "bending of full edges", "single": "single edge force", "twofold": "twofold edge force",
          "contact": "friction at the contact", "vertex": "friction at the vertex"}
_NAMES = {"edge_width": "width of edges", "wall_diameter": "width of walls", "pack_fraction": "start at phi",
          "hopper_wall_distance": "W", **{name: plain(SYMBOLS[name]) for name in ("e_c", "e_w", "e_sp", "n")}}


def _same(a, b):
    """Whether two values of an option are equal up to the rounding in tables."""
    if isinstance(a, str) or isinstance(b, str):
        return a == b
    return bool(np.isclose(float(a), float(b), rtol=1e-3, atol=0, equal_nan=True))


def _words(name, value):
    if name in ("removal_depth", "reinsertion_lateral_speed"):
        return None  # the words of `count` and `reinsertion_gap` stand for both
    if name == "reinsertion_gap":
        return "reinserted touching" if value == 0 else "reinserted with a gap"
    if name == "dt":
        return "automatic step" if np.isnan(value) else f"dt = {value:g}"
    if isinstance(value, str):
        return _WORDS.get(value, f"{name} {value}")
    return f"{_NAMES.get(name, name)} = {float(f'{value:.4g}'):g}"


def changes(row, base, names=OPTIONS):
    """The options among `names` that differ from `base`, as text."""
    return list(filter(None, (_words(name, row[name]) for name in names if not _same(row[name], base[name]))))


#: Options that only act together with another one: the two are one difference.
_FOLLOWS = {"removal_depth": "count", "reinsertion_lateral_speed": "reinsertion_gap", "k_a": "area_energy"}


def _number(text):
    """A value of a table: a number where it is one."""
    try:
        return float(text)
    except ValueError:
        return text


def _differences(a, b):
    """The options in which two readings, {option: value}, differ; options in _FOLLOWS count as the option that they
    follow."""
    return {_FOLLOWS.get(name, name) for name in a.keys() | b.keys()
            if not _same(a.get(name, np.nan), b.get(name, np.nan))}


def _of_one_model(rows):
    """{(model, dim, K_l, K_b, limit): [(Row's path, line, {option: value})]} of the rows in the limits, each reading once.
    A size or contacts that all rows of a group share are omitted: they do not differ."""
    groups = {}
    for path, row in rows:
        own = COEFFICIENT.get(end := limit_of(row.options))
        if not own:
            continue
        kept = {name: _number(value) for name, value in row.options.items()
                if name not in (*FREE, *_NOT_ACTING[end], "hopper_width")}
        soft = kept.get("model", "sp") == "sp"
        usual = (MODELS[int(kept.get("dim", 2))] if soft else MODELS_DEFORMABLE)[0][end]
        key = (*(kept.pop(name, None) for name in ("model", "dim", "k_l", "k_b")), end)
        kept = {name: value for name, value in usual.items() if name not in _NOT_ACTING[end] and value == value} | kept
        found = groups.setdefault(key, [])
        if not any(not _differences(kept, other) for _, _, other in found):
            found.append((path, row.line, kept))
    for key, found in groups.items():
        shared = {name for name in (*_SIZE, "e_c", "e_w")
                  if all(_same(one.get(name, np.nan), found[0][2].get(name, np.nan)) for *_, one in found)}
        groups[key] = [(path, line, {k: v for k, v in one.items() if k not in shared}) for path, line, one in found]
    return groups


def check_single(rows):
    """Raises RunError for a reading that differs in several options from the model as printed, or as run, unless
    another reading lies between the two and differs from the reading in one option only: otherwise the effect of
    several options would be attributed to one; or for a row with a file of options, which is not read here. `rows`:
    [(path, Row)]."""
    for path, row in rows:
        if "options_file" in row.options:
            raise RunError(f"{path}, line {row.line}: has options in {row.options['options_file']}, but this figure compares rows option "
                           "by option: give the options in columns")
    for (model, dim, *_, end), readings in _of_one_model(rows).items():
        models = MODELS[int(dim or 2)] if model in (None, "sp") else MODELS_DEFORMABLE
        shared = {*_SIZE, "e_c", "e_w"} - set().union(*(one.keys() for *_, one in readings))
        bases = [{name: value for name, value in base[end].items() if name not in _NOT_ACTING[end] and name not in shared}
                 for base in models]
        for path, line, one in readings:
            from_bases = [_differences(one, base) for base in bases]
            if min(map(len, from_bases)) < 2:
                continue
            if not any(_differences(other, base) < differs and len(_differences(one, other)) == 1
                       for base, differs in zip(bases, from_bases) for *_, other in readings):
                nearest = min(from_bases, key=len)
                raise RunError(f"{path}, line {line}: differs from the model as {'printed' if nearest is from_bases[0] else 'run'} in "
                               f"{', '.join('-' + name for name in sorted(nearest))} at once; each reading of this figure "
                               "changes one option: add rows that change them one by one")


def reading(row, names=OPTIONS, models=None):
    """'printed', 'as run, mu = 31.62': the nearer of the two `models` (default: MODELS), and the differences from it."""
    found = [(name, changes(row, base[row["limit"]], names))
             for name, base in zip(("printed", "as run"), models or MODELS[row["dim"]])]
    name, differs = min(found, key=lambda one: len(one[1]))
    if row["dim"] == 3:
        differs = ["3D", *differs]
    return ", ".join([name, *differs])


def _canonical(measured):
    """Rows of soft particles in the limits. Options without effect in a limit are as printed: the law of friction if there
    is drag only, and vice versa."""
    return _laws_that_act(limits(measured))


def _laws_that_act(table):
    """The law of friction is as printed where there is drag only, and the other way round."""
    for limit, names in _NOT_ACTING.items():
        for name in names:
            if name in table:
                table.loc[table["limit"] == limit, name] = (_COMMON | _DEFORMABLE)[name]
    return table


def _fits(table, by, opposite=True):
    return beverloo.fit_seeds(table, ["limit", "dim", "model", "k_l", "k_b", *by], opposite=opposite)


def _some(fits, drop=False):
    """These fits, without the groups that could not be fitted if `drop`. Raises RunError if none could."""
    there = fits["fit"].notna()
    if not there.any():
        raise RunError("no group has enough widths for a fit of beta: at least three with flow are needed")
    return fits[there].copy() if drop else fits


def _range(row):
    return row["data"]["hopper_width"].min(), row["data"]["hopper_width"].max()


def _beta(fits):
    """beta and its error of a table of fits, NaN for missing fits."""
    return np.array([(fit.beta, fit.beta_error) if fit else (np.nan, np.nan) for fit in fits["fit"]]).T


def _chi2(fits, which):
    return np.array([fit.chi2_reduced if fit else np.nan for fit in fits[which]])


def _published(dim):
    """Both published exponents."""
    return tuple(published.exponent(dim, limit).value for limit in LIMIT_NAMES)


def _windows(axes, span, exponents, horizontal=True):
    """Published exponents, each with the rule by which a value agrees with it."""
    for beta in exponents:
        line, band = (axes.axhline, axes.axhspan) if horizontal else (axes.axvline, axes.axvspan)
        line(beta, color="0.45", lw=0.9, ls=":", zorder=0)
        band(beta - NEAR, beta + NEAR, color=plotting.PALE, zorder=-1)
    (axes.set_ylim if horizontal else axes.set_xlim)(*span)


def _span(beta, error, exponents):
    error, known = np.nan_to_num(error), np.isfinite(beta)
    return ((beta - error)[known].min(initial=min(exponents) - NEAR) - 0.1,
            (beta + error)[known].max(initial=max(exponents) + NEAR) + 0.1)


def _rows(axes, labels, beta, error, soft, exponents):
    """Exponents, a row each from the top; open symbols for contacts that are harder than printed."""
    y = np.arange(len(labels))
    known = np.isfinite(beta)
    for there, face, label in ((known & soft, None, "softer contacts"),
                               (known & ~soft, "white", "contacts of 10$^4$ and more")):
        if there.any():
            plotting.errorbar(axes, beta[there], y[there], xerr=error[there], fmt="o", mfc=face, capsize=2.5,
                              color=plotting.COLORS[0], label=label)
    axes.set_yticks(y, labels=labels)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
    _windows(axes, _span(beta, error, exponents), exponents, horizontal=False)
    axes.set_xlabel(BETA)


def _tidy(text):
    """With symbols set as on the axes of the other figures."""
    for plain, latex in (("E_sp", "$E_{sp}$"), ("E_c", "$E_c$"), ("E_w", "$E_w$"), ("K_l", "$K_l$"), ("K_b", "$K_b$"),
                         ("t_end", "$t_{end}$"), ("mu =", r"$\mu$ ="), ("zeta =", r"$\zeta$ ="),
                         ("phi", r"$\phi$"), ("N =", "$N$ ="), ("W =", "$W$ =")):
        text = text.replace(plain, latex)
    return text


def _name(row, text):
    return f"{text}, {LIMIT_NAMES[row['limit']]}"


def _second_fits(table):
    """Fits of the readings that have narrower orifices than SECOND_FROM, without those."""
    narrowest = table.groupby(OPTIONS, dropna=False)["hopper_width"].transform("min")
    rest = table[(narrowest < SECOND_FROM) & (table["hopper_width"] >= SECOND_FROM)]
    return _fits(rest, OPTIONS, opposite=False) if len(rest) else pd.DataFrame()


def _with_coefficient(row):
    """The reading without its coefficient, and the origin of the coefficient: 'as run', 'as run, printed coefficients';
    None for other coefficients."""
    rest = reading(row, [name for name in OPTIONS if name not in COEFFICIENT.values()])
    own = COEFFICIENT[row["limit"]]
    for name, base in zip(("printed", "as run"), MODELS[row["dim"]]):
        if _same(row[own], base[row["limit"]][own]):
            return rest if rest.split(", ")[0] == name else f"{rest}, {name} coefficients"
    return None


def prefactor_ratios(fits):
    """C of drag over C of friction, published exponents held, for readings with both; dimensionless."""
    found = {limit: {_with_coefficient(row): row["reference_fit"] for _, row in fits[fits["limit"] == limit].iterrows()
                     if row["reference_fit"]} for limit in LIMIT_NAMES}
    quantities = []
    for name, drag in found["drag"].items():
        friction = found["friction"].get(name)
        if name and friction:
            ratio = drag.C / friction.C
            quantities.append(Quantity(f"C of drag over C of friction, published beta held: {name}", ratio,
                                       ratio * np.hypot(drag.C_error / drag.C, friction.C_error / friction.C),
                                       published.C_RATIO, f"chi2/dof {drag.chi2_reduced:.3g} and {friction.chi2_reduced:.3g}",
                                       decides(drag) and decides(friction)))
    return quantities


def draw_readings(measured):
    """The exponent of each reading, and how well the published and the opposite exponent fit."""
    table = _canonical(measured)
    fits = _some(_fits(table, OPTIONS))
    fits["name"] = [reading(row) for _, row in fits.iterrows()]
    figure, quantities = _draw_models(fits, fits["e_sp"] < 1e4)
    quantities += fit_quantities(_second_fits(table),
                                 lambda row: f"{_name(row, reading(row))}, from w = {SECOND_FROM:g} on")
    return figure, quantities + prefactor_ratios(fits)


def _draw_models(fits, soft):
    """A row per model with its `name`, those with `soft` contacts first: beta, and how well the exponents fit; a pair of
    panels per limit. Returns the figure and the quantities of the fits."""
    fits = fits.assign(soft=soft)
    there = [limit for limit in LIMIT_NAMES if (fits["limit"] == limit).any()]
    labels = fits["name"].str.partition(": ")  # a reading and a model, which the title names if it is the same everywhere
    shared = labels[2].iloc[0] if labels[2].nunique() == 1 else ""
    fits["label"] = labels[0] if shared else fits["name"].str.replace(": ", ":\n")  # two lines: more space for the panels
    lines = 0.38 if fits["label"].str.contains("\n").any() else 0.24
    heights = [1.4 + lines * (fits["limit"] == limit).sum() for limit in there]
    figure, panels = plt.subplots(len(there), 2, figsize=(plotting.PAGE, sum(heights)), layout="constrained", squeeze=False,
                                  sharey="row", height_ratios=heights)
    quantities, narrow = [], {"columnspacing": 0.7, "handletextpad": 0.1}
    for (left, right), limit in zip(panels, there):
        group = fits[fits["limit"] == limit]
        order = sorted(range(len(group)), key=lambda i: (not group["soft"].iloc[i], _order(group.iloc[i])))
        group = group.iloc[order]
        beta, error = _beta(group)
        _rows(left, [_tidy(label) for label in group["label"]], beta, error, group["soft"].to_numpy(),
              _published(group["dim"].iloc[0]))
        left.set_title(_tidy(": ".join(filter(None, (shared, LIMIT_NAMES[limit])))), loc="left")
        for i, which in enumerate(("fit", "reference_fit", "opposite_fit")):
            label = r"$\beta$ free" if which == "fit" else f"{FRACTIONS.get(group[which.removesuffix('_fit')].iloc[0])} held"
            right.plot(_chi2(group, which), np.arange(len(group)), plotting.MARKERS[i], color=plotting.COLORS[i],
                       mfc="white" if which == "fit" else None, label=label)
        right.axvline(1, color="0.45", lw=0.9, ls=":")
        right.set(xscale="log", xlabel=r"$\chi^2$/dof")
        right.legend(**plotting.ABOVE | narrow | {"ncols": 3})
        quantities += fit_quantities(group, lambda row: _name(row, row["name"]))
    if len(fits["soft"].unique()) > 1:
        panels[0, 0].legend(**plotting.ABOVE | narrow | {"ncols": 1})
    return figure, quantities


def _deformable_fits(measured, by=()):
    """Fits of each reading of rough and of smooth particles, for each value of the columns `by`, with its `name`."""
    table = limits(measured)
    for name, printed in _DEFORMABLE.items():  # runs without these columns, of older versions, are as printed
        table[name] = table[name].fillna(printed) if name in table else printed
    for name in _EDGES:
        table.loc[table["model"] == "rough", name] = _DEFORMABLE[name]
    table = _laws_that_act(table)
    usual = {name: commonest(table[name]) for name in _SIZE}  # the other rows are variants of these values
    usual |= {name: table[name].iloc[0] for name in ("e_c", "e_w") if table[name].nunique() == 1}  # all equal
    models = [{limit: model | usual for limit, model in one.items()} for one in MODELS_DEFORMABLE]
    names = [*_DEFORMABLE, *_SIZE, "mu", "zeta"]
    fits = _fits(table, [*names, *by])
    fits["name"] = [f"{reading(row, [n for n in names if row['model'] == 'smooth' or n not in _EDGES], models)}: "
                    f"{model_label(row, latex=False)}" for _, row in fits.iterrows()]
    return fits


def draw_deformable(measured):
    """The exponent of each reading of rough and of smooth particles, and how well the published and the opposite exponent
    fit; Q with friction at the vertex over Q with friction at the contact."""
    fits = _some(_deformable_fits(measured))
    figure, quantities = _draw_models(fits, fits["e_c"] < 1e4)
    return figure, quantities + _friction_points(fits)


def _friction_points(fits):
    """[Quantity] of Q of smooth particles with friction at the vertex over Q with friction at the contact, of pairs of readings that
    are alike otherwise."""
    own = fits[(fits["model"] == "smooth") & (fits["limit"] == "friction")]
    rest = [name for name in ("k_l", "k_b", *_DEFORMABLE, *_SIZE, "mu") if name != "friction_point"]
    quantities = []
    for _, pair in own.groupby(rest, dropna=False):
        data = dict(zip(pair["friction_point"], pair["data"]))
        if set(data) != {"vertex", "contact"}:
            continue
        both = data["vertex"].merge(data["contact"], on="hopper_width", suffixes=("", "_contact"))
        name = pair["name"][pair["friction_point"] == "contact"].iloc[0]
        for row in both[(both["Q"] > 0) & (both["Q_contact"] > 0)].itertuples():
            ratio = row.Q / row.Q_contact
            quantities.append(Quantity(f"Q with friction at the vertex over Q at the contact, w = {row.hopper_width:g}: {name}", ratio,
                                       ratio * np.hypot(row.Q_error / row.Q, row.Q_error_contact / row.Q_contact)))
    return quantities


def _order(row):
    """As printed first, as run last."""
    return row["name"].startswith("as run"), row["name"].partition(":")[0] != "printed", row["name"]


def _within(x, beta, target):
    """Length in x over which beta, interpolated, is within NEAR of target; whether it is so at an end of the range."""
    fine = np.linspace(x[0], x[-1], 2001)
    near = np.abs(np.interp(fine, x, beta) - target) <= NEAR
    return float(near.mean() * (x[-1] - x[0])), bool(near[0] or near[-1])


def plateau(x, beta, error, target, seed=1):
    """How flat beta is about target, x the log10 of the coefficient, sorted: (decades within NEAR, error, whether the
    range ends inside), (slope per decade, error) of a line through the points within 0.25, NaN with fewer than two."""
    x, beta, error = (np.asarray(values, float) for values in (x, beta, np.nan_to_num(error)))
    decades, ends = _within(x, beta, target)
    drawn = np.random.default_rng(seed).normal(beta, error, (ensemble.RESAMPLES, len(x)))
    found = [_within(x, one, target)[0] for one in drawn]
    near = np.abs(beta - target) <= 0.25
    slope = slope_error = np.nan
    if near.sum() > 1 and (error[near] > 0).all():
        (slope, _), covariance = np.polyfit(x[near], beta[near], 1, w=1 / error[near], cov="unscaled")
        slope_error = float(np.sqrt(covariance[0, 0]))
    return (decades, float(ensemble.spread(found)), ends), (float(slope), slope_error)


def strong_mean(coefficient, beta, error):
    """(mean of beta over coefficients of STRONG, its error, enlarged to the scatter if this is larger, a note with the
    range of the coefficients); None for fewer than two with an error."""
    use = error > 0
    if use.sum() < 2:
        return None
    x, beta, weight = coefficient[use], beta[use], error[use] ** -2
    mean = (beta * weight).sum() / weight.sum()
    chi2 = float((weight * (beta - mean) ** 2).sum() / (len(beta) - 1))
    return mean, np.sqrt(max(chi2, 1.0) / weight.sum()), f"{len(x)} points from {x[0]:.3g} to {x[-1]:.3g}, chi2/dof {chi2:.3g}"


def _rate_quantities(row, name):
    """Q times the coefficient at the widest orifice: constant where Q is inversely proportional to it."""
    own = COEFFICIENT[row["limit"]]
    widest = row["data"].iloc[-1]
    return Quantity(f"Q {own} at w = {widest['hopper_width']:g}: {name}", widest["Q"] * row[own],
                    widest["Q_error"] * row[own])


def draw_coefficients(measured):
    """The exponent against the coefficient of friction, and of drag, a curve per reading of the other options; 2D and
    3D have separate panels."""
    fits = _some(_fits(_canonical(measured), OPTIONS), drop=True)
    rest = [name for name in OPTIONS if name not in ("mu", "zeta", "dt")]
    fits["curve"] = [reading(row, rest) for _, row in fits.iterrows()]
    curves = sorted(fits["curve"].unique())  # equal readings look equal in both panels
    there = [(dim, limit) for dim in MODELS for limit in LIMIT_NAMES
             if ((fits["dim"] == dim) & (fits["limit"] == limit)).any()]
    figure, panels = plt.subplots(2, len(there), figsize=(min(5.6 * len(there), plotting.PAGE), 6.6), layout="constrained", squeeze=False,
                                  sharex="col", height_ratios=(3, 2))
    quantities = []
    for (top, bottom), (dim, limit) in zip(panels.T, there):
        of_dim = fits[fits["dim"] == dim]
        group = of_dim[of_dim["limit"] == limit]
        own = group["reference"].iloc[0]
        for curve, points in group.groupby("curve"):
            i = curves.index(curve)
            points = points.sort_values(COEFFICIENT[limit])
            x, (beta, error) = points[COEFFICIENT[limit]].to_numpy(float), _beta(points)
            color, marker = (plotting.symbol(i)[name] for name in ("color", "marker"))
            plotting.errorbar(top, x, beta, error, fmt=marker + "-", color=color, lw=1, capsize=2.5, label=_tidy(curve))
            bottom.plot(x, _chi2(points, "reference_fit"), marker + "-", color=color, lw=1)
            bottom.plot(x, _chi2(points, "opposite_fit"), marker + "--", color=color, lw=0.8, mfc="white")
            for row in (points.iloc[j] for j in range(len(points))):
                name = _name(row, f"{curve}, {COEFFICIENT[limit]} = {row[COEFFICIENT[limit]]:.3g}")
                quantities += [*fit_quantities(pd.DataFrame([row]), lambda row, name=name: name), _rate_quantities(row, name)]
            strong = x >= STRONG[limit]
            if (mean := strong_mean(x[strong], beta[strong], error[strong])):
                decide = all(decides(fit) for fit, one in zip(points["fit"], strong & (error > 0)) if one)
                quantities.append(Quantity(f"beta, mean over {COEFFICIENT[limit]} of {STRONG[limit]:g} and more: "
                                           f"{_name(points.iloc[0], curve)}", *mean[:2], published.exponent(dim, limit),
                                           mean[2] + ("" if decide else "; some fits have no verdict"), decide))
            if len(points) > 1:
                (decades, spread, ends), (slope, slope_error) = plateau(np.log10(x), beta, error, own)
                name = f"beta = {FRACTIONS.get(own, own)}: {_name(points.iloc[0], curve)}"
                quantities += [
                    Quantity(f"decades within {NEAR:g} of {name}", decades, spread, None,
                             "lower limit" if ends else ""),
                    Quantity(f"slope per decade about {name}", slope, slope_error, None,
                             "" if np.isfinite(slope) else "fewer than two points within 0.25")]
        _windows(top, _span(*_beta(of_dim), _published(dim)), _published(dim))
        top.axvline(MODELS[dim][0][limit][COEFFICIENT[limit]], color="0.45", lw=0.9, ls="-.", label="printed coefficient")
        top.set(xscale="log", ylabel=BETA)
        top.set_title(LIMIT_NAMES[limit] + (", 3D" if dim == 3 else ""), loc="left")
        top.legend()
        bottom.axhline(1, color="0.45", lw=0.9, ls=":")
        bottom.plot([], [], "-", color="0.4", label=rf"$\beta$ = {FRACTIONS.get(own, own)} held")
        bottom.plot([], [], "--", color="0.4", label=rf"$\beta$ = {FRACTIONS.get(group['opposite'].iloc[0])} held")
        bottom.set(yscale="log", xlabel=_UNITS[limit], ylabel=r"$\chi^2$/dof")
        bottom.legend()
    return figure, quantities


def _commonest(values):
    """The most frequent value of an option; the printed one where several are."""
    found, printed = values.mode(dropna=False), _COMMON.get(values.name)
    return printed if any(_same(one, printed) for one in found if printed is not None) else found.iloc[0]


def draw_protocol(measured):
    """The exponent of each model with each choice of the protocol changed alone, a panel per model."""
    table = _canonical(measured)
    fits = _some(_fits(table, [*OPTIONS, "t_end"]))
    panels_of = ensemble.groups(fits, ["limit", "dim", *_MODEL])
    columns = 2
    lines = -(-len(panels_of) // columns)
    most = max(len(group) for _, group in panels_of)
    figure, panels = plt.subplots(lines, columns, figsize=(plotting.PAGE, lines * (1.4 + 0.2 * most)), layout="constrained",
                                  squeeze=False)
    for axes in panels.flat[len(panels_of):]:
        axes.set_visible(False)
    quantities = []
    # Friction first, as in the other figures.
    for axes, (_, group) in zip(panels.flat, sorted(panels_of, key=lambda one: one[1]["limit"].iloc[0] == "drag")):
        usual = {name: _commonest(group[name]) for name in (*_PROTOCOL, "t_end")}
        widths = commonest(pd.Series([_range(row) for _, row in group.iterrows()]))
        names = []
        for _, row in group.iterrows():
            differs = changes(row, usual, [*_PROTOCOL, "t_end"])
            if _range(row) != widths:
                differs.append("w = {:g} to {:g}".format(*_range(row)))
            names.append(", ".join(differs) or "reference")
        order = sorted(range(len(names)), key=lambda i: (names[i] != "reference", names[i]))
        group, names = group.iloc[order], [names[i] for i in order]
        beta, error = _beta(group)
        model = reading(group.iloc[0], _MODEL)
        _rows(axes, [_tidy(name) for name in names], beta, error, np.ones(len(names), bool), (group["reference"].iloc[0],))
        if names[0] == "reference":
            axes.axvspan(beta[0] - error[0], beta[0] + error[0], color=plotting.COLORS[0], alpha=0.15, lw=0)
        axes.set_title(_tidy(_name(group.iloc[0], model)), loc="left")
        names = dict(zip(group.index, names))
        quantities += fit_quantities(group, lambda row, names=names, model=model: _name(row, f"{model}: {names[row.name]}"))
    return figure, quantities


def draw_duration(measured):
    """The exponent, and Q at the widest orifice, against the duration of the runs: neither changes where the flow is steady."""
    fits = _fits(_canonical(measured), [*OPTIONS, "t_end"])
    return _draw_durations(fits.assign(name=[reading(row) for _, row in fits.iterrows()]))


def draw_duration_deformable(measured):
    """As `draw_duration`, of rough and of smooth particles."""
    return _draw_durations(_deformable_fits(measured, ["t_end"]))


def _draw_durations(fits):
    """A curve per `name` and limit. Returns the figure and the quantities of the fits."""
    fits = _some(fits, drop=True)
    fits["curve"] = [_name(row, row["name"]) for _, row in fits.iterrows()]
    figure, (left, right) = plt.subplots(1, 2, figsize=(plotting.PAGE, 4.0), layout="constrained", sharex=True)
    widths = set()
    for i, (curve, points) in enumerate(fits.groupby("curve")):
        points = points.sort_values("t_end")
        widest = pd.DataFrame([data.iloc[-1] for data in points["data"]])
        style = plotting.symbol(i) | {"lw": 1, "capsize": 2.5}
        plotting.errorbar(left, points["t_end"], *_beta(points), label=_tidy(curve), **style)
        plotting.errorbar(right, points["t_end"], widest["Q"], widest["Q_error"], **style)
        widths.add(widest["hopper_width"].iloc[0])
    exponents = _published(fits["dim"].iloc[0])
    _windows(left, _span(*_beta(fits), exponents), exponents)
    left.set(xscale="log", xlabel=r"duration  $t_{end}/t_0$", ylabel=BETA)
    right.set(xscale="log", xlabel=r"duration  $t_{end}/t_0$", ylabel=r"$Q$  [$\sigma_{avg}^2/t_0$]", ylim=(0, None))
    ticks = sorted(fits["t_end"].unique())
    left.set_xticks(ticks, labels=[f"{t:g}" for t in ticks])
    left.minorticks_off()
    left.legend(**plotting.ABOVE | {"ncols": 1})
    right.set_title("$w$ = " + " and ".join(f"{w:g}" for w in sorted(widths)), loc="left")
    return figure, fit_quantities(fits, lambda row: f"{row['curve']}, t_end = {row['t_end']:g}")


_ALONE = ("dim", *OPTIONS, "hopper_width")
_DEFORMABLE_ALONE = ("model", "k_l", "k_b", "mu", "zeta", *_SIZE, *_DEFORMABLE, "hopper_width")
FIGURES = [
    Figure("readings", "exponent of each reading of [H]: as printed, as run, and each difference alone",
           ("quick/readings",), ("hopper/readings", "hopper/readings-hard", "hopper/readings-together"), "readings",
           draw_readings, "four readings, fewer widths, shorter runs", tells=_ALONE, kind="soft", single=check_single,
           together=("hopper/readings-together",)),
    Figure("deformable", "exponent of rough and smooth particles as printed and as run, friction only and drag only",
           ("quick/deformable",),
           ("hopper/limits-rough", "hopper/limits-smooth", "hopper/limits-smooth-vertex", "hopper/rough-large", "hopper/smooth-large",
            "as-run/limits-rough", "as-run/limits-smooth", "as-run/smooth-large"),
           "flows", draw_deformable, "120 particles, softer contacts, fewer widths and seeds, shorter runs",
           tells=_DEFORMABLE_ALONE, kind="deformable"),
    Figure("readings-deformable", "exponent of each reading of [H]'s smooth particles: as printed, and each difference alone",
           ("quick/readings-deformable",), ("hopper/readings-deformable", "hopper/readings-deformable-together"), "flows",
           draw_deformable, "120 particles, three readings of each limit, fewer seeds, shorter runs",
           tells=_DEFORMABLE_ALONE, kind="deformable", single=check_single,
           together=("hopper/readings-deformable-together",)),
    Figure("coefficients", "exponent against mu (friction) and against zeta (drag), both forces as printed and as run",
           ("quick/coefficients",), ("hopper/coefficients", "hopper/coefficients-hard", "hopper/coefficients-as-run"),
           "readings", draw_coefficients,
           "laws as printed, a point per decade, fewer widths, shorter runs", tells=_ALONE, kind="soft"),
    Figure("coefficients-3d", "exponent of soft spheres against mu and against zeta", ("quick/coefficients-3d",),
           ("hopper/coefficients-3d",), "readings", draw_coefficients,
           "half the particles, three coefficients of each, fewer widths, shorter runs", tells=_ALONE, kind="soft"),
    Figure("protocol", "exponent with each choice of the protocol changed alone",
           ("quick/protocol",), ("hopper/protocol",), "readings", draw_protocol,
           "mu = 5 and zeta = 2 alone, fewer changes, shorter runs", tells=(*_ALONE, "t_end"), kind="soft"),
    Figure("duration", "exponent of the flow rate, drag only, as run, against the duration of the runs", ("quick/duration",), ("hopper/duration",),
           "readings", draw_duration, "fewer widths, shorter runs", tells=(*_ALONE, "t_end"), kind="soft"),
    Figure("duration-deformable", "exponent of the flow rate of smooth particles, drag only, as run, against the duration of the runs",
           ("quick/duration-deformable",), ("hopper/duration-smooth",), "flows", draw_duration_deformable,
           "120 particles, fewer seeds, shorter runs", tells=(*_DEFORMABLE_ALONE, "t_end"), kind="deformable"),
]
