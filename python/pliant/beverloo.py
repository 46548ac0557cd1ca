"""Fits of the flow rate: the Beverloo law Q = C (w/sigma_avg - k)^beta.

The published exponents are beta = d - 1/2 (viscous friction only) and d - 3/2 (drag only); docs/validation/validation.md has the
exponents that the program gives.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.optimize import leastsq

from . import ensemble, pooling, symbols
from .errors import RunError
from .fits import fitted

K_MIN = 0.0                # an orifice is not narrower than nothing
K_UNBOUNDED = -10.0        # in widest orifices: where "k unbounded" ends in practice
FEW_WIDTHS = 3             # as many as parameters: such a fit does not determine the exponent
BETA_RANGE = (0.05, 5.0)   # wide enough for every exponent in 2D and 3D; beyond, k and beta run away together
_MARGIN = 1e-6             # k stays this fraction below the narrowest flowing orifice: the model is singular there


def beverloo(w, C, k, beta):
    """C (w - k)^beta, and 0 for w <= k. w in sigma_avg."""
    return C * np.maximum(np.asarray(w, float) - k, 0.0) ** beta


def published_exponent(dim, mu, zeta):
    """The exponent of [H]: d - 1/2 for friction only, d - 3/2 for drag only, None where both (or none) act."""
    if mu > 0 and zeta == 0:
        return dim - 0.5
    if zeta > 0 and mu == 0:
        return dim - 1.5
    return None


def opposite_exponent(dim, exponent):
    """The published exponent of the other limit."""
    return 2 * (dim - 1) - exponent


@dataclass(frozen=True)
class BeverlooFit:
    """C, k, beta with one standard error each (0 for a fixed parameter, NaN where it cannot be given)."""

    C: float
    C_error: float
    k: float
    k_error: float
    beta: float
    beta_error: float
    points: int
    chi2_reduced: float  #: NaN without degrees of freedom or without errors of Q
    note: str            #: remarks; empty without any
    widths: int          #: different orifice widths
    at_bound: tuple      #: names of the free parameters that ended at a bound

    @property
    def decides(self):
        """Whether the free parameters can be compared with published ones: none is at a bound, and there are more widths than
        parameters."""
        return not self.at_bound and self.widths > FEW_WIDTHS

    def __call__(self, w):
        return beverloo(w, self.C, self.k, self.beta)


class _Projected:
    """The least-squares problem with C eliminated (it is linear) and bounds removed by a sine: fast enough to be
    solved hundreds of times for the bootstrap."""

    def __init__(self, w, weight, k_range, beta, k):
        self.w, self.weight, self.k_range, self.fixed_beta, self.fixed_k = w, weight, k_range, beta, k

    @staticmethod
    def _bounded(t, low_high):
        return low_high[0] + (low_high[1] - low_high[0]) * 0.5 * (np.sin(t) + 1)

    @staticmethod
    def _free(value, low_high):
        return np.arcsin(np.clip(2 * (value - low_high[0]) / (low_high[1] - low_high[0]) - 1, -0.999999, 0.999999))

    def unpack(self, t):
        t = list(t)
        k = self.fixed_k if self.fixed_k is not None else self._bounded(t.pop(0), self.k_range)
        return k, self.fixed_beta if self.fixed_beta is not None else self._bounded(t.pop(0), BETA_RANGE)

    def pack(self, k, beta):
        return np.array([self._free(k, self.k_range)] * (self.fixed_k is None)
                        + [self._free(beta, BETA_RANGE)] * (self.fixed_beta is None))

    def best_C(self, k, beta, scaled_Q):
        shape = (self.w - k) ** beta * self.weight
        return shape @ scaled_Q / (shape @ shape), shape

    def residual(self, t, scaled_Q):
        C, shape = self.best_C(*self.unpack(t), scaled_Q)
        return scaled_Q - C * shape

    def start(self, Q):
        """(C, k, beta) of the best point of a coarse grid: the valley of k and beta has no other safe entry."""
        low, high = self.k_range
        # Dense towards the upper bound, where a small exponent has its minimum; not on a bound, where a fit gets stuck.
        ks = [self.fixed_k] if self.fixed_k is not None else high - (high - low) * np.geomspace(1e-3, 1 - 1e-3, 40)
        betas = [self.fixed_beta] if self.fixed_beta is not None else np.linspace(0.1, 4, 40)
        shape = (self.w - np.asarray(ks)[:, None, None]) ** np.asarray(betas)[:, None] * self.weight
        norm = (shape**2).sum(-1)
        gain = (shape @ (Q * self.weight)) ** 2 / norm
        i, j = np.unravel_index(np.argmax(gain), gain.shape)
        return self.best_C(ks[i], betas[j], Q * self.weight)[0], ks[i], betas[j]

    def solve(self, Q, k, beta, tolerance=1e-7, evaluations=300):
        """(C, k, beta) of the least sum of squares near (k, beta)."""
        scaled = Q * self.weight
        t = self.pack(k, beta)
        if len(t):
            # full_output: a fit that creeps along a bound ends at maxfev, close enough, without a warning.
            t = leastsq(self.residual, t, args=(scaled,), xtol=tolerance, ftol=tolerance, maxfev=evaluations,
                        full_output=True)[0]
        k, beta = self.unpack(t)
        return self.best_C(k, beta, scaled)[0], k, beta


def _clean(w, Q, error):
    """Flowing points, sorted, with an error each (None if no point has one), their numbers, and notes on omitted
    points."""
    w, Q = np.asarray(w, float), np.asarray(Q, float)
    error = np.full_like(Q, np.nan) if error is None else np.asarray(error, float)
    if not w.shape == Q.shape == error.shape or w.ndim != 1:
        raise RunError(f"w, Q and their errors differ in length ({w.shape}, {Q.shape}, {error.shape})")
    notes = []
    unknown = ~(np.isfinite(w) & np.isfinite(Q))
    if unknown.any():
        notes.append(f"{unknown.sum()} without Q left out")
    clogged = ~unknown & (Q <= 0)
    if clogged.any():
        notes.append(f"{clogged.sum()} clogged left out (w = {', '.join(f'{x:g}' for x in sorted(set(w[clogged])))})")
    picked = np.flatnonzero(~unknown & ~clogged)
    picked = picked[np.argsort(w[picked], kind="stable")]
    w, Q, error = w[picked], Q[picked], error[picked]
    known = np.isfinite(error) & (error > 0)
    if not known.any():
        return w, Q, None, picked, notes
    if not known.all():
        notes.append(f"{(~known).sum()} without error given the median relative error")
        error = np.where(known, error, Q * np.median(error[known] / Q[known]))
    return w, Q, error, picked, notes


def local_slopes(w, Q, error):
    """[(w, next w, d ln Q/d ln w, its error)] between neighbouring orifices with flow; w, Q, error [n], one point per width.
    The law with offset k has the local slope beta w/(w - k), which no bound of k touches."""
    w, Q, error, _, _ = _clean(w, Q, error)
    relative = np.full_like(Q, np.nan) if error is None else error / Q
    steps = np.diff(np.log(w))
    return list(zip(w[:-1], w[1:], np.diff(np.log(Q)) / steps, np.hypot(relative[:-1], relative[1:]) / steps))


def fit_beverloo(w, Q, error=None, beta=None, k=None, resamples=400, seed=1, draws=None, k_bounded=True):
    """Least-squares fit of Q = C (w - k)^beta with weights 1/error.

    w [n] in sigma_avg; Q [n]; error [n] one standard error of Q. `beta` or `k` hold that parameter fixed; a free k lies
    between 0 (far below 0 with `k_bounded` false) and the narrowest orifice with Q > 0. Standard errors come from a parametric bootstrap: Q is drawn
    `resamples` times from normal distributions about the fitted law with the given errors (half the central 68 % range
    of the refitted parameters), so that they exist for an exact fit too. The deviations of `draws` [m, n] from Q
    (ensemble.draws: over seeds) take the place of the normal ones. Without any error of Q the fit is unweighted and
    uses the scatter about the fit as errors. Points with Q = 0 are omitted with a note.
    Raises RunError if there are fewer orifices than free parameters.
    """
    w, Q, error, picked, notes = _clean(w, Q, error)
    free = 1 + (k is None) + (beta is None)
    if len(np.unique(w)) < free:
        raise RunError(f"{len(np.unique(w))} orifice widths with flow are too few for {free} parameters "
                       "(add runs, or hold beta fixed)")
    if beta is not None and not BETA_RANGE[0] <= beta <= BETA_RANGE[1]:
        raise RunError(f"a fixed exponent of {beta:g} is outside {BETA_RANGE[0]} … {BETA_RANGE[1]}")
    k_range = (K_MIN if k_bounded else K_UNBOUNDED * w[-1], w[0] - _MARGIN * abs(w[0]))
    if k is not None and k >= w[0]:
        raise RunError(f"a fixed k of {k:g} is not below the narrowest flowing orifice, {w[0]:g}")
    weight = np.full_like(Q, 1 / Q.mean()) if error is None else 1 / error

    problem = _Projected(w, weight, k_range, beta, k)
    _, *start = problem.start(Q)
    best = np.array(problem.solve(Q, *start, tolerance=1e-12, evaluations=5000))

    at_bound = []
    for name, value, held, low_high in (("k", best[1], k, k_range), ("beta", best[2], beta, BETA_RANGE)):
        if held is None and min(abs(value - bound) for bound in low_high) < 1e-3 * (low_high[1] - low_high[0]):
            at_bound.append(name)
            notes.append(f"{name} at its bound")

    freedom = len(w) - free
    fitted = beverloo(w, *best)
    scatter = error
    if error is None and draws is None:
        # The residuals of a weighted fit with equal weights: their size is the error that the data did not bring.
        scatter = np.full_like(Q, np.sqrt(((Q - fitted) ** 2).sum() / freedom)) if freedom > 0 else None
        notes.append("Q without errors: " + ("taken from the scatter" if freedom > 0 else "none for the fit"))
    if draws is not None:
        draws = fitted + np.asarray(draws, float)[:, picked] - Q
    elif scatter is not None:
        draws = np.random.default_rng(seed).normal(fitted, scatter, size=(resamples, len(w)))
    if draws is None:
        errors = np.where([True, k is None, beta is None], np.nan, 0.0)
    else:
        refits = np.array([problem.solve(draw, best[1], best[2]) for draw in draws])
        errors = ensemble.spread(refits)
    chi2 = (((Q - fitted) * weight) ** 2).sum() / freedom if freedom > 0 and error is not None else np.nan
    return BeverlooFit(*(float(x) for pair in zip(best, errors) for x in pair), len(w), float(chi2), "; ".join(notes),
                       len(np.unique(w)), tuple(at_bound))


def fit_groups(table, by, beta=None, **options):
    """One row per group of a sweep table: the group's columns, points, C, k, beta with errors, chi2_reduced, note, fit.

    `by` are column names; `beta` is None (free) or a number; `options` go to fit_beverloo. A group that cannot
    be fitted has fit = None and the reason as its note.
    """
    rows = []
    for key, group in ensemble.groups(table, by):
        row = dict(zip(by, key))
        row["points"] = int((group["Q"] > 0).sum())
        data = (group[name] for name in ("hopper_width", "Q", "Q_error"))
        rows.append(row | fitted(fit_beverloo, *data, beta=beta, **options))
    return pd.DataFrame(rows)


def fit_table(table, beta=None):
    """One row per group of runs of a sweep table that differ in the width, the seed and the options of `pooling` alone, as of
    fit_groups, with data (its rows) and label (the group's name in a legend). A repeated run counts once. `table` must have model
    ("" if unknown), dim, mu and zeta (NaN if unknown)."""
    named = ["model", "dim", "mu", "zeta"]
    table = pooling.once(table, "hopper")
    differ = pooling.settings(table, "hopper", ("hopper_width", *named), among=table["Q"].notna())
    table = table.assign(**differ)
    by = [*named, *differ]
    fits = fit_groups(table, by, beta=beta)
    fits["data"] = [group for _, group in ensemble.groups(table, by)]
    groups = [row for _, row in fits.iterrows()]
    shown = ["model", "mu", "zeta", *symbols.differing(groups, [c for c in by if c not in ("model", "mu", "zeta")])]
    fits["label"] = [symbols.group_label(row, [c for c in shown if row[c] != ""]) or "parameters unknown" for row in groups]
    return fits


def _clogged(group, value):
    """Mask of the clogged runs. A run in which a single particle keeps bouncing has another status, but also has no
    flow."""
    clogged = group[value] == 0
    return clogged | group["status"].isin(["clogged", "at_rest"]) if "status" in group else clogged


def _no_law(*_, **__):
    raise RunError("the widest orifice clogs, too: no fit")


def fit_seeds(table, by, value="Q", beta=None, resamples=None, opposite=False):
    """One row per group of runs: its columns of `by`, fit, C, k, beta with errors and so on as of fit_groups; data (a
    row per width: hopper_width, Q, Q_error from blocks and seeds, runs). Also unbounded_fit, whose k may be negative,
    if k of fit is at its bound, else None. Then reference (the published exponent or None) and reference_fit (with that
    exponent held); with `opposite` also opposite (the published exponent of the other limit) and opposite_fit. Errors
    of the fits are drawn over seeds. `value` is the rate's column. A clogged run has no steady rate and is omitted if
    other runs of the same width flowed. If the widest orifice clogs, the group has no law of the width, and no fit."""
    rows = []
    for key, group in ensemble.groups(table, by):
        row = dict(zip(by, key))
        width, clogged = group["hopper_width"], _clogged(group, value)
        fit = _no_law if clogged[width == width.max()].any() else fit_beverloo
        out = clogged & ~clogged.groupby(width).transform("all")
        left_out = ", ".join(f"{w:g}" for w in sorted(set(width[out])))
        remark = f"{out.sum()} of {len(group)} runs clogged, left out (w = {left_out})" if left_out else ""
        points = ensemble.average(group[~out], ["hopper_width"], value)
        row["data"] = points.rename(columns={value: "Q", value + "_error": "Q_error"})
        row["points"] = int((points[value] > 0).sum())
        data = points["hopper_width"], points[value], points[value + "_error"]
        options = {"draws": ensemble.draws(points, value, resamples)} if np.isfinite(data[2]).any() else {}
        row |= fitted(fit, *data, beta=beta, **options)
        row["unbounded_fit"] = (fitted(fit, *data, beta=beta, k_bounded=False, **options)["fit"]
                                if row["fit"] and "k" in row["fit"].at_bound else None)
        row["note"] = "; ".join(filter(None, [row["note"], remark, ensemble.seeds_remark(points)]))
        first = group.iloc[0]
        row["reference"] = published_exponent(first["dim"], first["mu"], first["zeta"])
        held = {"reference": row["reference"]}
        if opposite:
            held["opposite"] = row["opposite"] = (opposite_exponent(first["dim"], row["reference"])
                                                  if row["reference"] is not None else None)
        for name, exponent in held.items():
            row[name + "_fit"] = fitted(fit, *data, beta=exponent, **options)["fit"] if exponent is not None else None
        rows.append(row)
    return pd.DataFrame(rows)
