"""Statistics of clogs over many runs: probabilities with binomial errors, sigmoids, the cohesive length and the collapse
of thesis chapter 4 ([T n] are its equations).

Lengths: w/d is the orifice in mean diameters, as the option -hopper_width; w, delta and delta* are in mean radii.
"""

from dataclasses import dataclass
from pathlib import Path

import lmfit
import numpy as np
import pandas as pd
from scipy.stats import binomtest

from . import pooling
from .errors import RunError
from .files import TABLE_ERRORS
from .fits import fitted
from .scenarios import of_scenario
from .statistics import commonest
from .sweep import load_runs, sweep_table

COLUMNS = ("hopper_width", "g", "phi_c", "n", "status", "avalanche_size", "capillary_length")
ENDED = ("clogged", "at_rest", "empty")
#: Options of a point of `clog_points`; runs that differ in other ones belong to other series.
POINT = ("n", "phi_c", "g", "hopper_width")
CONFIDENCE = 0.95       # level of the binomial intervals
AVALANCHE_LIMIT = 0.75  # larger mean avalanches, as a fraction of the droplets, are cut by their number [T Sec. 4.3]


def load_clogs(paths):
    """One table of runs that ended clogged, at rest or empty, each once, from CSV files (pliant-sweep's results.csv) and run
    folders, and the number of rows left out because they have not ended or have failed."""
    tables = []
    for path in map(Path, pooling.distinct_paths(paths)):
        try:
            tables.append(pd.read_csv(path, comment="#", float_precision="round_trip") if path.is_file() else
                          sweep_table([of_scenario(run, "clog") for run in load_runs([path])]))
        except TABLE_ERRORS as error:
            raise RunError(f"{path}: cannot be read as a table ({str(error).strip().splitlines()[0]})") from None
        if "status" not in tables[-1]:
            raise RunError(f"{path}: the table has no column 'status' (not one of pliant-sweep?)")
    table = pooling.joined(tables)
    ended = table[table["status"].isin(ENDED)]
    if ended.empty:
        raise RunError(f"{paths[0]}: no run has ended clogged or empty yet")
    for column in COLUMNS:
        if column not in ended or ended[column].isna().any():
            raise RunError(f"{paths[0]}: column '{column}' is missing or incomplete (not runs of the scenario clog?)")
    return pooling.once(ended, "clog"), len(table) - len(ended)


def binomial_interval(clogged, runs):
    """(low, high): Wilson's interval of a probability that has shown itself in `clogged` of `runs` runs."""
    interval = binomtest(int(clogged), int(runs)).proportion_ci(CONFIDENCE, method="wilson")
    return interval.low, interval.high


def uncut_mean(sizes, clogged):
    """(mean, its standard error) of avalanches that would continue in a larger hopper: of an exponential distribution, of which
    runs that ran empty give only a lower bound. The largest likelihood has the sum of all sizes over the number
    of clogs; NaN without one."""
    clogs = int(np.sum(clogged))
    mean = float(np.sum(sizes)) / clogs if clogs else np.nan
    return mean, mean / np.sqrt(clogs) if clogs else np.nan


def clog_points(table):
    """One row per series and POINT: runs, clogged, P, P_low, P_high, delta, s, s_error, s_uncut, s_uncut_error, sorted; runs of
    one series (its name: "" if there is one alone) differ in POINT and in the options of `pooling` alone.

    s is the mean of the avalanche size over all runs, those that ran empty included, with its standard error over the
    runs (NaN for one run); s_uncut is the mean of `uncut_mean`.
    """
    rows = []
    for (series, n, phi_c, g, width), group in table.assign(series=pooling.series(table, "clog", POINT)).groupby(["series", *POINT]):
        runs, clogged = len(group), int((group["status"] == "clogged").sum())
        low, high = binomial_interval(clogged, runs)
        s = group["avalanche_size"].to_numpy(float)
        uncut, uncut_error = uncut_mean(s, group["status"] == "clogged")
        rows.append({"series": series, "n": int(n), "phi_c": phi_c, "g": g, "hopper_width": width, "runs": runs, "clogged": clogged,
                     "P": clogged / runs, "P_low": low, "P_high": high, "delta": group["capillary_length"].mean(),
                     "s": s.mean(), "s_error": s.std(ddof=1) / np.sqrt(runs) if runs > 1 else np.nan,
                     "s_uncut": uncut, "s_uncut_error": uncut_error})
    return pd.DataFrame(rows)


def sigmoid(x, x0, alpha):
    """1/(1 + exp((x - x0)/alpha)) [T 4.8, 4.11]."""
    return 1 / (1 + np.exp(np.clip((np.asarray(x, float) - x0) / alpha, -500, 500)))


@dataclass(frozen=True)
class SigmoidFit:
    """Where the probability is one half, and the width of the transition, with one standard error each."""

    x0: float
    x0_error: float
    alpha: float        #: NaN if the data have only an upper bound
    alpha_error: float
    note: str

    def __call__(self, x):
        return sigmoid(x, self.x0, self.alpha if np.isfinite(self.alpha) else 1e-9)


def fit_sigmoid(x, clogged, runs):
    """The sigmoid of the largest binomial likelihood: `clogged` [n] of `runs` [n] at x [n], probability falling with x.

    lmfit minimises the sum of squares of the deviance residuals, which is the likelihood's logarithm. Where all are clogged
    up to some x and none beyond, but at one x at most, the width has no lower bound, and the curvature of the
    likelihood is not an error: see _step. Raises RunError where the data, or their sigmoid, do not pass one half
    between the first and the last x.
    """
    order = np.argsort(np.asarray(x, float), kind="stable")
    x, k, n = (np.asarray(values, float)[order] for values in (x, clogged, runs))
    p = k / n
    outside = "the probability of a clog does not pass one half in the range of the data"
    if not (p.max(initial=0) > 0.5 > p.min(initial=1) and x[0] < x[-1]):
        raise RunError(outside)
    if np.all(np.diff(p) <= 0) and len(np.unique(x[(k > 0) & (k < n)])) <= 1:
        return _step(x, k, n)

    def residual(parameters):
        return deviance_residuals(k, n, sigmoid(x, parameters["x0"].value, parameters["alpha"].value))

    span = x[-1] - x[0]
    starts = []
    for alpha in (0.03, 0.1, 0.3):
        parameters = lmfit.Parameters()
        parameters.add("x0", np.interp(0.5, np.maximum.accumulate(p[::-1]), x[::-1]))
        parameters.add("alpha", alpha * span, min=1e-4 * span, max=10 * span)
        starts.append(lmfit.minimize(residual, parameters, scale_covar=False))
    best = min(starts, key=lambda result: result.chisqr)
    if not x[0] <= best.params["x0"].value <= x[-1]:
        raise RunError(outside)
    errors = [np.nan if best.params[name].stderr is None else best.params[name].stderr for name in ("x0", "alpha")]
    return SigmoidFit(best.params["x0"].value, errors[0], best.params["alpha"].value, errors[1], "")


def _step(x, k, n):
    """x0 is the middle of where the likelihood falls by less than e^(-1/2), half of that its error: between the last x [n]
    that clogs always and the first that never does, all of the gap if there is nothing between them."""
    below, above = x[k == n].max(initial=x[0]), x[k == 0].min(initial=x[-1])
    edges = np.linspace(below, above, 401)
    x0 = (edges[1:] + edges[:-1]) / 2
    alpha = (above - below) * np.geomspace(1e-4, 1, 50)
    q = sigmoid(x[:, None, None], x0[:, None], alpha)
    deviance = (deviance_residuals(k[:, None, None], n[:, None, None], q) ** 2).sum(axis=0).min(axis=1)
    likely = np.flatnonzero(deviance <= deviance.min() + 1)
    first, last = edges[likely[0]], edges[likely[-1] + 1]
    return SigmoidFit((first + last) / 2, (last - first) / 2, np.nan, np.nan, "a step: its width is not resolved")


def fit_sigmoids(points, along):
    """One row per curve of points against `along` (g or hopper_width), the other one held: series, n, phi_c, the held column,
    delta (of the middle of the transition), x0 … alpha_error, note, fit, data. A curve that cannot be fitted has fit =
    None and the reason as its note; values of the held column with a single point have no curve."""
    held = {"g": "hopper_width", "hopper_width": "g"}[along]
    rows = []
    for (series, n, phi_c, value), data in points.groupby(["series", "n", "phi_c", held]):
        if len(data) < 2:
            continue
        rows.append({"series": series, "n": n, "phi_c": phi_c, held: value, "delta": data["delta"].mean(), "data": data}
                    | fitted(fit_sigmoid, data[along], data["clogged"], data["runs"]))
    return pd.DataFrame(rows)


@dataclass(frozen=True)
class Regimes:
    """w*/d = low for delta < delta_crit and slope·delta beyond [T 4.12, 4.13], with one standard error each."""

    low: float
    low_error: float
    slope: float
    slope_error: float

    @property
    def delta_crit(self):
        """Where the two meet; delta* of the regime of low cohesion."""
        return self.low / self.slope

    def __call__(self, delta):
        return np.maximum(self.low, self.slope * np.asarray(delta, float))

    def effective(self, delta):
        """delta* [T 4.12]."""
        return np.maximum(delta, self.delta_crit)


def fit_regimes(delta, w_star, error):
    """The constant and the line through the origin that together fit w*/d [n] best (least squares with weights 1/error,
    or equal weights without errors), over all divisions of the points by delta. Errors are scaled by the scatter if it
    is larger. Raises RunError for less than two points on either side."""
    order = np.argsort(np.asarray(delta, float), kind="stable")
    delta, w, error = (np.asarray(values, float)[order] for values in (delta, w_star, error))
    if len(delta) < 4:
        raise RunError(f"{len(delta)} values of w* are too few for two regimes (at least 4)")
    known = np.isfinite(error) & (error > 0)
    error = np.where(known, error, np.median(error[known])) if known.any() else np.ones_like(w)
    best = None
    for cut in range(2, len(delta) - 1):
        # Linear in both: each regime has one parameter, the factor of its shape.
        shape = np.where(np.arange(len(delta)) < cut, 1.0, delta)
        factors, variances = [], []
        for part in (slice(None, cut), slice(cut, None)):
            a, y = shape[part] / error[part], w[part] / error[part]
            factors.append(a @ y / (a @ a))
            variances.append(1 / (a @ a))
        fitted = np.where(np.arange(len(delta)) < cut, factors[0], factors[1] * delta)
        chi2 = (((w - fitted) / error) ** 2).sum()
        if best is None or chi2 < best[0]:
            best = chi2, factors, variances
    chi2, factors, variances = best
    scale = chi2 / max(len(delta) - 2, 1)
    scale = max(scale, 1.0) if known.any() else scale
    errors = np.sqrt(np.array(variances) * scale)
    return Regimes(float(factors[0]), float(errors[0]), float(factors[1]), float(errors[1]))


def fitted_delta_crit(points):
    """delta_crit of the regimes of w*/d in clog_points along the width. Raises RunError for too few curves."""
    fits = fit_sigmoids(points, "hopper_width")
    known = fits[fits["fit"].notna()] if len(fits) else fits
    columns = [known[c] if len(known) else [] for c in ("delta", "x0", "x0_error")]
    return fit_regimes(*columns).delta_crit


def effective_width(points, delta_crit):
    """[k] w/delta* of clog_points [T 4.12], w and delta* in mean radii."""
    return (2 * points["hopper_width"] / np.maximum(points["delta"], delta_crit)).to_numpy()


def avalanche_law(x, A, B):
    """Mean avalanche size exp(B x²)/A - 1 [T 4.17]."""
    return np.exp(B * np.asarray(x, float) ** 2) / A - 1


def clog_law(x, A, B, n):
    """Probability 1 - exp(-n/<s>) that n droplets clog, <s> the mean avalanche size: [T 4.19]. [T 4.20] leaves out the
    -1 of <s>, which makes a difference only where <s> is small and everything clogs."""
    s = avalanche_law(x, A, B)
    with np.errstate(divide="ignore"):
        return np.where(s > 0, -np.expm1(-n / np.maximum(s, 1e-300)), 1.0)


@dataclass(frozen=True)
class AvalancheFit:
    """A and B of [T 4.17] with one standard error each."""

    A: float
    A_error: float
    B: float
    B_error: float
    points: int
    chi2_reduced: float  #: NaN without degrees of freedom


def _law_fit(result, points):
    log_A, B = result.params["log_A"], result.params["B"]
    A = float(np.exp(log_A.value))
    errors = [np.nan if p.stderr is None else p.stderr for p in (log_A, B)]
    return AvalancheFit(A, A * errors[0], B.value, errors[1], points, result.redchi if result.nfree > 0 else np.nan)


def fit_avalanches(x, s, s_error, n):
    """ln(<s> + 1) = -ln A + B x² [T 4.18] by lmfit, weighted by the errors of s; points with <s> below
    AVALANCHE_LIMIT·n alone. x [k] = w/delta*, s and s_error [k], n [k] droplets. Raises RunError for less than three."""
    x, s, s_error, n = (np.asarray(values, float) for values in (x, s, s_error, n))
    use = (s < AVALANCHE_LIMIT * n) & np.isfinite(s_error)
    if len(np.unique(x[use])) < 3:
        raise RunError(f"{use.sum()} mean avalanches below {AVALANCHE_LIMIT:g} of the droplets are too few to fit "
                       "(at least 3, at different w/delta*, each with several runs)")
    # An avalanche of a few runs that agree by chance has an error too: at least the effect of one droplet more or less.
    weight = (s[use] + 1) / np.maximum(s_error[use], 1.0)
    model = lmfit.Model(lambda x2, log_A, B: -log_A + B * x2, independent_vars=["x2"])
    result = model.fit(np.log1p(s[use]), x2=x[use] ** 2, log_A=-2.0, B=0.03, weights=weight)
    return _law_fit(result, int(use.sum()))


def deviance_residuals(clogged, runs, probability):
    """[k] residuals whose sum of squares is twice the logarithm of the ratio of two binomial likelihoods, with the
    probabilities of the data and with `probability`."""
    k, n = np.asarray(clogged, float), np.asarray(runs, float)
    p, q = k / n, np.clip(probability, 1e-12, 1 - 1e-12)
    with np.errstate(divide="ignore", invalid="ignore"):
        deviance = np.where(k > 0, k * np.log(p / q), 0) + np.where(k < n, (n - k) * np.log((1 - p) / (1 - q)), 0)
    return np.sign(p - q) * np.sqrt(2 * np.maximum(deviance, 0))


def fit_clog_law(x, clogged, runs, n):
    """A and B of [T 4.19] of the largest binomial likelihood: `clogged` [k] of `runs` [k] at x [k] = w/delta* with n [k]
    droplets; chi2 is the deviance. Raises RunError without three points, or with none between 0 and 1."""
    x, clogged, runs, n = (np.asarray(values, float) for values in (x, clogged, runs, n))
    if len(np.unique(x)) < 3 or not ((clogged > 0) & (clogged < runs)).any():
        raise RunError("the probabilities of a clog are too few for its law: at least 3 widths, and one between 0 and 1")
    parameters = lmfit.Parameters()
    parameters.add("log_A", -2.0, min=-15, max=5)
    parameters.add("B", 0.1, min=1e-4, max=10)
    result = lmfit.minimize(lambda p: deviance_residuals(clogged, runs, clog_law(x, np.exp(p["log_A"].value), p["B"].value, n)),
                            parameters)
    return _law_fit(result, len(x))


def collapse_fits(points, x):
    """{name: AvalancheFit} of clog_points over x = w/delta*, to see which runs decide A and B. The fits: all points of the
    commonest number N of droplets; points of each other N, and all avalanches scaled to the commonest N, as in [T Sec. 4.3].
    For the commonest N also each phi_c, and each way to vary w/delta*, alone. Then avalanches of `uncut_mean`, with all
    points that have a clog, and P_clog. Fits that fail are omitted."""
    points = points.assign(x=x)
    usual = {name: commonest(points[name]) for name in ("n", "g")}
    scale = usual["n"] / points["n"]
    own = points[points["n"] == usual["n"]]
    parts = {"all": own, "scaled": points.assign(s=points["s"] * scale, s_error=points["s_error"] * scale, n=usual["n"])}
    parts |= {f"N = {n}": group for n, group in points.groupby("n")}
    parts |= {f"phi_c = {phi_c:g}": group for phi_c, group in own.groupby("phi_c")}
    parts |= {"widths at one g": own[own["g"] == usual["g"]], "other g": own[own["g"] != usual["g"]]}
    fits = {}
    for name, part in parts.items():
        if name == "all" or not part.equals(own):  # not the same again
            fits[name] = fitted(fit_avalanches, part["x"], part["s"], part["s_error"], part["n"])["fit"]
    fits["cut off"] = fitted(fit_avalanches, own["x"], own["s_uncut"], own["s_uncut_error"], np.full(len(own), np.inf))["fit"]
    fits["P_clog"] = fitted(fit_clog_law, own["x"], own["clogged"], own["runs"], own["n"])["fit"]
    return {name: fit for name, fit in fits.items() if fit}
