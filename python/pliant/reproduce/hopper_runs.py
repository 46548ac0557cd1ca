"""Runs of hoppers as their figures take them: lambda and its limits, names of runs, and quantities of fits."""

import numpy as np

from .. import beverloo
from ..beverloo_figures import FRACTIONS
from ..errors import RunError
from ..script import remark
from . import published
from .figure import Quantity

LIMIT_NAMES = {"friction": "friction only", "drag": "drag only"}
COEFFICIENT = {"friction": "mu", "drag": "zeta"}
LIMIT_AT = {0.0: "friction", np.inf: "drag"}  #: by lambda
BETA, LAMBDA = r"$\beta$", r"$\lambda = \zeta/\mu$"
MODEL = ["model", "e_sp", "k_l", "k_b"]
_COULOMB = "disk"  #: the model whose mu is a coefficient of Coulomb friction, not of [H 6]


def rounded(x):
    """Rounded to four digits, because tables contain rounded coefficients, which should compare equal."""
    return float(f"{x:.4g}")


def chi2_note(chi2):
    return f"chi2/dof {chi2:.3g}" if np.isfinite(chi2) else "as many parameters as points"


def with_limit(measured):
    """`measured` with the columns lam, zeta/mu, and limit: friction, drag, or empty between them. With drag per mass lam
    is in the numbers of the authors' program, to which the published values belong if the figures come from it. Runs with
    another law of friction than [H 6] are omitted."""
    if "model" in measured and (other := measured["model"] == _COULOMB).any():
        remark(f"{other.sum()} runs of frictional disks are left out: their mu is another coefficient than in [H 6]")
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
    return LIMIT_AT.get(ratio(options))


def is_soft(measured):
    """Whether a run, or each run of a table, has soft particles [H 2], not deformable particles."""
    return measured["model"] == "sp"


def plain(measured):
    """Soft particles lack the coefficients of deformable particles, which lack E_sp: equal groups get equal columns."""
    soft = is_soft(measured)
    return measured.assign(**{c: measured[c].where(soft == (c == "e_sp"), 0.0) for c in (*MODEL[1:], "e_c")})


def limits(measured):
    """Runs in the limits alone, as of `with_limit`. Raises RunError if there are none."""
    table = with_limit(plain(measured))
    table = table[table["limit"] != ""]
    if table.empty:
        raise RunError("no run has friction only or drag only: this figure needs rows with mu alone or zeta alone")
    return table


def of_several(table, column, by=("dim", *MODEL)):
    """The values of a column where groups of `by`, runs of one model, have several, else 0."""
    return table[column].where(table.groupby(list(by))[column].transform("nunique") > 1, 0.0)


def is_hard(row):
    """Whether the published offset of hard particles is meant."""
    return row["e_sp"] >= 1e4 if is_soft(row) else row["k_b"] >= 100


def model_label(row, latex=True):
    """'soft, E_sp = 100' or 'smooth, K_l = 10, K_b = 0.1'; with `edges` of `_stiffness_fits`, `contacts` of `draw_angles` and
    `size`, if any."""
    return f"{'soft' if is_soft(row) else row['model']}, {stiffness_label(row, latex)}" + variant_label(row, latex)


def stiffness_label(row, latex=True):
    """'E_sp = 100' or 'K_l = 10, K_b = 0.1'; with `edges` of `_stiffness_fits`, if any."""
    e_sp, k_l, k_b = ("$E_{sp}$", "$K_l$", "$K_b$") if latex else ("E_sp", "K_l", "K_b")
    if is_soft(row):
        return f"{e_sp} = {row['e_sp']:g}"
    return f"{k_l} = {row['k_l']:g}, {k_b} = {row['k_b']:g}" + (", full edges" if row.get("edges") == "full" else "")


def variant_label(row, latex=False):
    """', E_c = 250' and ', N = 400' where a row has `contacts` and `size` that are not 0."""
    values = (("$E_c$" if latex else "E_c", row.get("contacts", 0)), ("$N$" if latex else "N", row.get("size", 0)))
    return "".join(f", {name} = {value:g}" for name, value in values if value > 0)


def named(row, end=""):
    return f"{model_label(row, latex=False)}{end}, {LIMIT_NAMES[row['limit']]}"


def fitted(fit, quantity):
    """(value, error) of a parameter of a fit; NaN where there is no fit."""
    return (getattr(fit, quantity), getattr(fit, quantity + "_error")) if fit else (np.nan, np.nan)


def fit_quantities(fits, name_of):
    """Exponent, prefactor and offset of every fit, and the chi² of the published exponent, and of the opposite exponent
    if `fits` have it. In 2D the published prefactor applies to all particles, the published offset to hard
    particles."""
    quantities = []
    for _, row in fits.iterrows():
        name = name_of(row)
        known = {"beta": published.exponent(int(row["dim"]), row["limit"])}
        if row["dim"] == 2:
            known |= {"C": published.C[row["limit"]]} | ({"k": published.K[row["limit"]]} if is_hard(row) else {})
        for quantity in ("beta", "C", "k"):
            quantities.append(Quantity(f"{quantity}: {name}", *fitted(row["fit"], quantity), known.get(quantity),
                                       row["note"], decides(row["fit"])))
        quantities += undecided(row, name, known)
        if row["reference_fit"] and row["fit"]:
            held, fixed = f"with beta = {FRACTIONS.get(row['reference'], row['reference'])} held", row["reference_fit"]
            quantities += [Quantity(f"{quantity} {held}: {name}", *fitted(fixed, quantity), known.get(quantity), fixed.note,
                                    decides(fixed))
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


def decides(fit):
    """Whether a fit can be compared with published values."""
    return bool(fit) and fit.decides


def undecided(row, name, known):
    """Measures of the exponent if the fit of a row cannot decide: exponent and offset without the bound of k, and the local
    slopes of Q, which are beta w/(w - k). known: {quantity: Published}."""
    if not row["fit"] or row["fit"].decides:
        return []
    free = row["unbounded_fit"]
    return [*(Quantity(f"{quantity}, k unbounded: {name}", *fitted(free, quantity), known.get(quantity), free.note,
                       free.decides) for quantity in ("beta", "k") if free),
            *(Quantity(f"local slope of Q, w = {low:g} to {high:g}: {name}", slope, error)
              for low, high, slope, error in beverloo.local_slopes(
                  row["data"]["hopper_width"], row["data"]["Q"], row["data"]["Q_error"]))]


def relative_residual(data, fit):
    """Root mean square of Q over the fitted law, less 1, of the widths with flow."""
    flowing = data[data["Q"] > 0]
    return float(np.sqrt(np.mean((fit(flowing["hopper_width"]) / flowing["Q"] - 1) ** 2)))
