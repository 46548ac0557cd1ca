"""The figures of the hopper paper of k and C against the stiffness of particles."""

import matplotlib.pyplot as plt
import numpy as np

from .. import beverloo, plotting
from ..beverloo_figures import FRACTIONS, log_axes, plain_numbers
from ..errors import RunError
from . import published
from .figure import Quantity
from .hopper_runs import (LIMIT_NAMES, MODEL, chi2_note, decides, fitted, is_hard, is_soft, limits, named, of_several,
                          stiffness_label, undecided, variant_label)


def _against(axes, fits, x, quantity, x_label, label, references=None):
    """A quantity of fits with the published exponent held (filled) and free (open) against the column x, a curve per
    limit (its colour) and K_l (its marker)."""
    several = fits["k_l"].nunique() > 1
    for (limit, k_l), group in fits.sort_values(x).groupby(["limit", "k_l"]):
        color = plotting.COLORS[list(LIMIT_NAMES).index(limit)]
        marker = plotting.symbol(sorted(fits["k_l"].unique()).index(k_l) if several
                                 else list(LIMIT_NAMES).index(limit))["marker"]
        held = group[group["reference_fit"].notna()]
        values = np.array([fitted(row["reference_fit"], quantity) for _, row in held.iterrows()]).reshape(-1, 2)
        plotting.errorbar(axes, held[x], values[:, 0], values[:, 1], fmt=marker + "-", lw=0.9, color=color, capsize=2.5)
        free = group[group["fit"].notna()]
        values = np.array([fitted(fit, quantity) for fit in free["fit"]]).reshape(-1, 2)
        plotting.errorbar(axes, free[x] * 1.04, values[:, 0], values[:, 1], fmt=marker, color=color, mfc="white", alpha=0.6,
                          lw=0.8)
    for i, limit in enumerate(LIMIT_NAMES):
        for one in (references or {}).get(limit, ()):
            axes.axhline(one.value, color=plotting.COLORS[i], ls="-.", lw=0.9)
    for i, name in enumerate(LIMIT_NAMES.values()):
        axes.plot([], [], "-" if several else plotting.symbol(i)["marker"] + "-", color=plotting.COLORS[i], label=name)
    for i, k_l in enumerate(sorted(fits["k_l"].unique()) if several else ()):
        axes.plot([], [], plotting.symbol(i)["marker"], color="0.4", label=f"$K_l$ = {k_l:g}")
    axes.plot([], [], "o", color="0.4", mfc="white", label=r"$\beta$ free")
    if references:
        axes.plot([], [], "-.", color="0.4", lw=0.9, label="[H], hard")
    axes.set(xscale="log", xlabel=x_label, ylabel=label)
    if (few := sorted(fits[x].unique()))[-1] < 10 * few[0]:  # less than the ticks of a decade
        axes.set(xlim=(few[0] / 2, few[-1] * 2))
        axes.set_xticks(few, labels=[f"{one:g}" for one in few])
        axes.minorticks_off()
    axes.legend(**plotting.ABOVE)


def _prefactor_quantities(fits, names, known):
    """Quantities of fits with the published exponent held, and free; known(row, quantity) → Published or None."""
    quantities = []
    for _, row in fits.iterrows():
        name = named(row)
        held = row["reference_fit"]
        for quantity in names:
            quantities.append(Quantity(f"{quantity} with the published beta held: {name}", *fitted(held, quantity),
                                       known(row, quantity), "; ".join(filter(None, [held.note, chi2_note(held.chi2_reduced)]))
                                       if held else row["note"], decides(held)))
            quantities.append(Quantity(f"{quantity}, beta free: {name}", *fitted(row["fit"], quantity),
                                       known(row, quantity), row["note"], decides(row["fit"])))
    return quantities


def _map(axes, group, title):
    """Colour map of k, with the published exponent held, over K_l and K_b. A star: bending of full edges, where no other is."""
    one = group.assign(k=[fitted(row["reference_fit"], "k")[0] for _, row in group.iterrows()], star=group["edges"] == "full")
    one = one.sort_values("star").drop_duplicates(["k_b", "k_l"])
    grid, stars = (one.pivot(index="k_b", columns="k_l", values=name) for name in ("k", "star"))
    axes.pcolormesh(np.arange(grid.shape[1] + 1), np.arange(grid.shape[0] + 1), grid.to_numpy(), cmap="viridis")
    for (i, j), k in np.ndenumerate(grid.to_numpy()):
        if np.isnan(k):
            continue
        axes.text(j + 0.5, i + 0.5, f"{k:.2f}" + ("*" if stars.iloc[i, j] else ""), ha="center", va="center",
                  color="white" if k < np.nanmean(grid) else "black")
    axes.set_xticks(np.arange(grid.shape[1]) + 0.5, labels=[f"{v:g}" for v in grid.columns])
    axes.set_yticks(np.arange(grid.shape[0]) + 0.5, labels=[f"{v:g}" for v in grid.index])
    axes.set(xlabel="$K_l$", ylabel="$K_b$")
    axes.set_title(title + ("\n*: full edge vectors" if one["star"].any() else ""), loc="left")


def _stiffness_fits(measured):
    """Fits of every stiffness in the limits; `edges` distinguishes bending of full edges from bending of unit vectors
    if both occur, `size` is N where soft or deformable particles have several. Raises RunError where no fit, not even
    with the exponent held, is possible."""
    table = limits(measured)
    bending = table["bending_edges"].where(~is_soft(table))
    edges = bending.fillna("") if bending.nunique() > 1 else ""
    fits = beverloo.fit_seeds(table.assign(edges=edges), ["limit", "dim", *MODEL, "edges", "n"])
    if fits["reference_fit"].isna().all():
        raise RunError("no stiffness has enough widths for a fit: at least two with flow are needed")
    return fits.assign(size=of_several(fits.assign(soft=is_soft(fits)), "n", by=["soft"]))


def _alike(fits):
    """[(name, fits of one model and one N)] of `_stiffness_fits`, soft particles first."""
    return [(name + variant_label(group.iloc[0], latex=True), group)
            for model, name in (("sp", "soft"), ("smooth", "smooth"), ("rough", "rough"))
            for _, group in fits[fits["model"] == model].groupby("n")]


def draw_offsets(measured):
    """[H Fig. 7]: the offset k against the stiffness of soft particles, and over K_l and K_b of deformable particles."""
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
    figure, grid = plt.subplots(rows, columns, figsize=(min(5.0 * columns, plotting.PAGE), 2.9 * rows), layout="constrained", squeeze=False)
    for axes, (name, limit, group) in zip(grid.flat, panels):
        if limit:
            _map(axes, group, f"$k$: {name}, {LIMIT_NAMES[limit]}")
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

    exponents = []
    for _, row in fits[fits["fit"].notna()].iterrows():
        exponent = published.exponent(2, row["limit"])
        exponents.append(Quantity(f"beta: {named(row)}", *fitted(row["fit"], "beta"), exponent, row["note"],
                                  decides(row["fit"])))
        exponents += undecided(row, named(row), {"beta": exponent})
    return figure, exponents + _prefactor_quantities(fits, ("k",), known)


_LONG = 20  # letters, TeX included, of a legend's entry that needs the whole width of a panel
_AT_BOUND = 1e-3  # w - k of a fit whose k is at its bound, just below the narrowest orifice


def _collapse(axes, fits, limit, labels):
    """Q/C against w - k with the published exponent held, of one model and one N. `labels`: stiffness → number of its
    style, the same in all panels of a row; is added to."""
    group = fits[(fits["limit"] == limit) & fits["reference_fit"].notna()]
    for _, row in group.iterrows():
        data, fit = row["data"], row["reference_fit"]
        above = data["hopper_width"] > fit.k + _AT_BOUND
        label = stiffness_label(row)
        style = plotting.symbol(labels.setdefault(label, len(labels)))
        plotting.errorbar(axes, data["hopper_width"][above] - fit.k, data["Q"][above] / fit.C,
                          data["Q_error"][above] / fit.C, ls="", capsize=2, label=label, **style)
    if len(group):
        beta = group["reference"].iloc[0]
        x = np.geomspace(0.3, 10, 50)
        axes.plot(x, x**beta, "--", color="0.45", lw=1.1)
        axes.text(0.03, 0.97, f"line: [H], slope {FRACTIONS.get(beta, beta)}", transform=axes.transAxes, va="top", color="0.35")
    axes.set(xlabel=r"$w/\sigma_{avg} - k$", ylabel=r"$Q/C$")
    axes.set_title(LIMIT_NAMES[limit], loc="left")
    log_axes(axes)


def _fall(fits, limit):
    """[Quantity] of how far C falls within the stiffnesses of soft particles that the paper has; none for others."""
    group = fits[(fits["limit"] == limit) & is_soft(fits) & fits["reference_fit"].notna()
                 & fits["e_sp"].between(published.C_FALL_FROM, published.C_FALL_TO)].sort_values("e_sp")
    if len(group) < 2:
        return []
    first, last = group.iloc[0], group.iloc[-1]
    (soft, soft_error), (hard, hard_error) = (fitted(row["reference_fit"], "C") for row in (first, last))
    name = f"C at E_sp = {first['e_sp']:g} over C at {last['e_sp']:g}{variant_label(first)}, {LIMIT_NAMES[limit]}"
    return [Quantity(name, soft / hard, soft / hard * np.hypot(soft_error / soft, hard_error / hard),
                     published.C_FALL[limit], "with the published beta held")]


def _draw_prefactors(measured, x, label):
    fits = _stiffness_fits(measured)
    alike = _alike(fits)
    figure, panels = plt.subplots(len(alike), 3, figsize=(plotting.PAGE, 4.0 * len(alike)), layout="constrained", squeeze=False)
    quantities = _prefactor_quantities(fits, ("C",), lambda row, quantity: published.C[row["limit"]])
    for (left, *others), (name, group) in zip(panels, alike):
        _against(left, group, x, "C", label, r"$C$  [$\sigma_{avg}^2/t_0$]",
                 {limit: (published.C[limit],) for limit in LIMIT_NAMES})
        left.set_yscale("log")
        plain_numbers(left.yaxis)
        if len(alike) > 1:
            left.set_title(name, loc="right")
        labels = {}
        for axes, limit in zip(others, LIMIT_NAMES):
            _collapse(axes, group, limit, labels)
            quantities += _fall(group, limit)
        # One legend for both panels of the collapse, half of it above each.
        entries = {label: handle for axes in others for handle, label in zip(*axes.get_legend_handles_labels())}
        labels = [label for label in labels if label in entries]
        half = -(-len(labels) // 2)
        columns = 1 if any(len(label) > _LONG for label in labels) else 2
        for axes, part in zip(others, (labels[:half], labels[half:])):
            if part:
                axes.legend([entries[label] for label in part], part, **plotting.ABOVE | {"ncols": columns})
    return figure, quantities


def draw_soft_prefactors(measured):
    """[H Fig. 13]: the prefactor C against the stiffness of soft particles, and Q/C against w - k."""
    return _draw_prefactors(measured, "e_sp", "$E_{sp}$")


def draw_deformable_prefactors(measured):
    """[H Fig. 14]: prefactors of deformable particles against K_b."""
    return _draw_prefactors(measured, "k_b", "$K_b$")
