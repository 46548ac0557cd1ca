"""The exponent of the Beverloo law between its limits of friction and of drag, as a function of lambda = zeta/mu.

[H 14] as printed does not run from d - 1/2 to d - 3/2 in 3D. Corrected, and with ends that may be others:

  beta = (low + high)/2 - (high - low)/2 tanh( (1/b) log10(lambda/lambda_c) ),   high = d - 1/2, low = d - 3/2 as published
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from . import ensemble
from .errors import RunError

_LOG_RANGE = (-7.0, 4.0)   # range of log10(lambda_c)
_WIDTH_RANGE = (0.05, 10.0)  # of b, decades
_HELD = 0.25  # from this argument of the tanh on a point determines an end of beta
_WIDEST = np.log10(np.e)  # standard error of log10(lambda_c) from which on it is not known: as large as lambda_c itself


def crossover(lam, lam_c, b, low, high):
    """beta at lam, which may be 0 or infinite."""
    with np.errstate(divide="ignore"):
        x = np.log10(np.asarray(lam, float) / lam_c) / b
    return (low + high) / 2 - (high - low) / 2 * np.tanh(x)


@dataclass(frozen=True)
class CrossoverFit:
    """Parameters with one standard error each: 0 for the ends where they are held, NaN where the data do not determine
    them (see the note)."""

    lam_c: float
    lam_c_factor: float  #: lam_c is known to within this factor, one standard error of its logarithm
    b: float
    b_error: float
    low: float
    low_error: float
    high: float
    high_error: float
    chi2_reduced: float
    note: str

    def __call__(self, lam):
        return crossover(lam, self.lam_c, self.b, self.low, self.high)

    @property
    def lam_c_error(self):
        return self.lam_c * np.log(self.lam_c_factor)


def fit_crossover(lam, beta, error, ends=None, resamples=None, seed=1):
    """Fit to beta [n] with errors [n] at lam [n]; `ends` holds (low, high). Errors of the parameters by parametric
    bootstrap from normal distributions about the data. Raises RunError for fewer points than parameters."""
    lam, beta, error = (np.asarray(values, float) for values in (lam, beta, error))
    use = np.isfinite(beta) & np.isfinite(error) & (error > 0)
    lam, beta, error = lam[use], beta[use], error[use]
    between = lam[(lam > 0) & np.isfinite(lam)]
    free = 2 if ends else 4
    if len(lam) < free or not len(between):
        raise RunError(f"{len(lam)} values of lambda with an exponent are too few for {free} parameters")
    floor = (_LOG_RANGE[0], _WIDTH_RANGE[0], -1.0, -1.0)[:free]
    ceiling = (_LOG_RANGE[1], _WIDTH_RANGE[1], 5.0, 5.0)[:free]

    def law(p):
        return crossover(lam, 10 ** p[0], p[1], *(ends or p[2:4]))

    def solve(values, starts):
        fits = [least_squares(lambda p: (law(p) - values) / error, start, bounds=(floor, ceiling)) for start in starts]
        return min(fits, key=lambda fit: fit.cost)

    guess = [] if ends else [beta.min(), beta.max()]
    starts = [[np.clip(x, -6.9, 3.9), 1.0, *guess] for x in np.log10(np.geomspace(between.min(), between.max(), 5))]
    best = solve(beta, starts)
    rng = np.random.default_rng(seed)
    inside = np.clip(best.x, np.array(floor) + 1e-6, np.array(ceiling) - 1e-6)
    refits = np.array([solve(rng.normal(beta, error), [inside]).x for _ in range(resamples or ensemble.RESAMPLES)])
    errors = ensemble.spread(refits)
    freedom = len(lam) - free
    low, high = ends or best.x[2:4]
    low_error, high_error = (0.0, 0.0) if ends else errors[2:4]
    notes = [] if between.min() <= 10 ** best.x[0] <= between.max() else ["lambda_c lies outside the values of lambda"]
    if not ends:
        notes += _loose_ends(lam, np.log10(between / 10 ** best.x[0]) / best.x[1])
        if high > ceiling[3] - 1e-3:
            notes.append("friction end at its bound")
            high_error = np.nan
    if best.x[1] < 1.2 * _WIDTH_RANGE[0]:
        notes.append("a step between two lambda")
    if errors[0] > _WIDEST:
        notes.append(f"lambda_c is known to within a factor of {10 ** errors[0]:.2g} only")
    if notes:  # parameters that the data do not determine have no error
        errors[0] = np.nan
    note = "; ".join(notes)
    return CrossoverFit(float(10 ** best.x[0]), float(10 ** errors[0]), float(best.x[1]), float(errors[1]), float(low),
                        float(low_error), float(high), float(high_error),
                        float(2 * best.cost / freedom) if freedom else np.nan, note)


def _loose_ends(lam, x):
    """Notes on free ends that the points at lam, with arguments x of the tanh between the limits, do not hold: the limit
    itself does, or two points beyond lambda_c, as one point is not a plateau."""
    sides = (("friction", lam == 0, x < -_HELD), ("drag", np.isinf(lam), x > _HELD))
    return [f"too few lambda for the {name} end" for name, limit, beyond in sides if not limit.any() and beyond.sum() < 2]
