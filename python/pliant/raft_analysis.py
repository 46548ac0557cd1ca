"""Analysis of a compressed raft: force peaks, row reductions, stiffness, competing fractures.

The rules (docs/scenarios/raft.md explains them):

- Force F: the mean of the forces on both walls, positive where the raft pushes. D: their distance.
- A peak is one of scipy.signal.find_peaks(F) with a height and a prominence of at least 0.1 sqrt(2 k1 E1), the force that
  breaks one bond through one spring [T 2.31]; a negative peak is one of -F. k1 and E1 are the model's, from summary.json.
- p rows rest at D_p = 2 h_eq + (p-1) (sqrt(3)/2) d_eq. The reduction from p to p-1 rows is the interval
  D_p >= D > D_(p-1). Its F_max is the highest force there, its F_min the lowest one after that.
- The stiffness at zero is the slope of the straight line through the samples with |F| < F_1/10 around the last F = 0 before
  the first peak, F_1; at least three samples.
- k_eq: slope of the straight line through the samples on the last rise before F_max, from F = 0 to F_max/2.
- A reduction is competing if the raft that it leaves is not whole: if at no time between D_(p-1) + 0.1 and D_(p-1) - 0.02
  it has more than N - p' + (p' - 1)(2 N/p' - 1) - 4 bonds, p' = p - 1: the bonds of a hexagonal raft of p' rows, less 4
  because the ends of its rows may be incomplete. Reductions to one row do not count.
- Two other judgements of a reduction come from the bonds that break and form in it, in the order of time. A fracture is a
  set of at least two broken bonds, each with its middle within 1.25 d_eq of another of the set; sets that come to touch
  become one. A fracture has closed when as many bonds have formed within 1.25 d_eq of the set as have broken in it. The
  fractures of a reduction are overlapping if one starts before another has closed; they are unmatched if moreover they
  have not become one when the first of them has closed, or the reduction has ended.
"""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from scipy.optimize import brentq
from scipy.signal import find_peaks

from .errors import RunError
from .scenarios import of_scenario

#: Least height and prominence of a peak over sqrt(2 k1 E1).
LEAST_PEAK = 0.1
#: Bonds that the ends of the rows of a whole raft may lack.
LOOSE_ENDS = 4
#: Distance of the middles of two bonds of one fracture, in d_eq: of bonds that share a droplet, or lie side by side in two
#: rows, it is at most 1. The next ones are 1.32 apart.
FRACTURE_REACH = 1.25
#: Broken bonds of a fracture, at least.
LEAST_FRACTURE = 2
#: Columns that say whether the fractures of a reduction compete, by three judgements, and their labels.
JUDGEMENTS = {"competing": "competing fractures", "overlapping": "overlapping fractures", "unmatched": "unmatched fractures"}


def ideal_bonds(n, rows):
    """Bonds of a hexagonal raft of n droplets in rows of n/rows each."""
    return n - rows + (rows - 1) * (2 * n / rows - 1)


def excess_fractures(phi, peak):
    """Number of fractures beyond the number with one size, for a fraction phi of small droplets [T 2.39]."""
    return 2 * peak * np.sqrt(phi * (1 - phi))


def judge_fractures(position, broken, reach):
    """(overlapping, unmatched) of bonds that break (`broken` true) or form at `position` [n, 2], in the order of time."""
    fractures, overlapping, unmatched = [], False, False
    for place, breaks in zip(np.asarray(position, float), broken):
        distances = [np.linalg.norm(fracture["places"] - place, axis=1).min() for fracture in fractures]
        near = [fracture for fracture, d in zip(fractures, distances) if d < reach]
        if breaks:
            fractures = [fracture for fracture, d in zip(fractures, distances) if d >= reach]
            fractures.append({"places": np.vstack([place, *(fracture["places"] for fracture in near)]),
                              "open": 1 + sum(fracture["open"] for fracture in near)})
        elif near:
            fractures[int(np.argmin(distances))]["open"] -= 1
        several = sum(len(fracture["places"]) >= LEAST_FRACTURE for fracture in fractures) > 1
        overlapping |= several
        closed = [fracture for fracture in fractures if fracture["open"] <= 0]
        unmatched |= several and any(len(fracture["places"]) >= LEAST_FRACTURE for fracture in closed)
        fractures = [fracture for fracture in fractures if fracture["open"] > 0]
    return overlapping, unmatched or sum(len(fracture["places"]) >= LEAST_FRACTURE for fracture in fractures) > 1


@dataclass
class Compression:
    """The force curve of a run of scenario raft; raises RunError for other scenarios."""

    distance: np.ndarray  #: [T] of the walls, falling
    force: np.ndarray     #: [T]
    bonds: np.ndarray     #: [T]
    n: int                #: droplets
    rows: int             #: at the start
    d_eq: float
    h_eq: float
    k1: float
    E1: float
    events: dict = field(default_factory=dict)  #: wall_distance, broken, position of bonds that broke and formed, if known

    @classmethod
    def of(cls, run):
        if "d_eq" not in of_scenario(run, "raft").summary:
            raise RunError(f"{run.path}: the run has not ended (its summary.json has no d_eq)")
        s = run.series
        model = {name: float(run.summary[name]) for name in ("d_eq", "h_eq", "k1", "E1")}
        return cls(s["wall_distance"].to_numpy(), ((s["fixed_wall_force"] + s["moving_wall_force"]) / 2).to_numpy(),
                   s["bonds"].to_numpy(), run.topology.particles, int(run.parameters["rows"]), **model, events=run.events)

    def rest_distance(self, rows):
        """D_p, at which so many rows rest between the walls."""
        return 2 * self.h_eq + (rows - 1) * np.sqrt(3) / 2 * self.d_eq

    def peaks(self, sign=1):
        """Numbers of the samples at the peaks, or with sign = -1 at the negative ones."""
        least = LEAST_PEAK * np.sqrt(2 * self.k1 * self.E1)
        return find_peaks(sign * self.force, height=least, prominence=least)[0]

    def rise(self, top):
        """Slice of the samples of the last rise before sample `top`, from F = 0 to half of F[top]."""
        below = np.flatnonzero(self.force[:top] <= 0)
        first = below[-1] if len(below) else 0
        half = first + int(np.argmax(self.force[first:top + 1] >= self.force[top] / 2))
        return slice(first, half + 1)

    def slope(self, samples):
        """(k, its standard error) of F against -D in a slice of samples; NaN for fewer than three."""
        x, y = -self.distance[samples], self.force[samples]
        if len(x) < 3:
            return np.nan, np.nan
        (slope, _), covariance = np.polyfit(x, y, 1, cov="unscaled")
        residual = y - np.polyval(np.polyfit(x, y, 1), x)
        return slope, float(np.sqrt(covariance[0, 0] * (residual @ residual) / (len(x) - 2)))

    def stiffness_at_zero(self, reach=0.1):
        """(Slope, its standard error) of F at the last F = 0 before the first peak, from the samples around it with
        |F| < reach · peak, at least three; NaN without a peak."""
        peaks = self.peaks()
        if not len(peaks):
            return np.nan, np.nan
        top = peaks[0]
        zero = self.rise(top).start
        far = np.abs(self.force[:top + 1]) >= reach * self.force[top]
        before = np.flatnonzero(far[:zero])
        first = max(min(before[-1] + 1, zero - 1), 0) if len(before) else 0
        end = zero + 1 + int(np.argmax(far[zero + 1:]))
        return self.slope(slice(first, max(end, first + 3)))

    def reductions(self):
        """DataFrame, one row per reduction that the run has completed: rows (p), columns (N/p), x = q/(p+1), k_eq,
        k_error, F_max, F_min, distance (at F_max), sample (its number), peaks, missing_bonds, and the JUDGEMENTS: competing,
        overlapping, unmatched (None where they do not count, or the run has no events)."""
        rows = []
        peaks = self.peaks()
        for p in range(self.rows, 1, -1):
            start, end = self.rest_distance(p), self.rest_distance(p - 1)
            inside = np.flatnonzero((self.distance <= start) & (self.distance > end))
            if not len(inside) or self.distance[-1] > end + 0.01:
                continue
            top = inside[np.argmax(self.force[inside])]
            k, error = self.slope(self.rise(top))
            settled = (self.distance <= end + 0.1) & (self.distance >= end - 0.02)
            missing = ideal_bonds(self.n, p - 1) - self.bonds[settled].max(initial=0)
            rows.append({"rows": p, "columns": self.n / p, "x": self.n / p / (p + 1), "k_eq": k, "k_error": error,
                         "F_max": self.force[top], "F_min": self.force[top:inside[-1] + 1].min(),
                         "distance": self.distance[top], "sample": top,
                         "peaks": int(np.isin(peaks, inside).sum()), "missing_bonds": missing,
                         "competing": bool(missing > LOOSE_ENDS) if p > 2 else None}
                        | dict(zip(("overlapping", "unmatched"), self._judged(start, end) if p > 2 else (None, None))))
        return pd.DataFrame(rows)

    def _judged(self, start, end):
        """judge_fractures of the events from D = start to end; None without events."""
        if not self.events:
            return None, None
        inside = (self.events["wall_distance"] <= start) & (self.events["wall_distance"] > end)
        return judge_fractures(self.events["position"][inside], self.events["broken"][inside] > 0, FRACTURE_REACH * self.d_eq)


def contact_constants(*, f0, phi_c, a_s):
    """{name: value} of two equal droplets and of a droplet at a wall, R = b = 1, from [T 2.1, 2.5, 2.7, 2.8]: L^2/R^2 [T 2.13],
    the distance d_eq at rest, the stiffness k1 there and the energy E1 of the bond; also for the bond with the wall."""
    L2 = 8 * f0 * a_s**3 / (np.pi * phi_c)
    reach = 1 + a_s
    # f0 (1 - d/2) = f0 (4 reach^2 - d^2)/(4 L2)
    d = L2 - np.sqrt(L2**2 - 4 * L2 + 4 * reach**2)
    lens = np.pi / 12 * (4 * reach + d) * (2 * reach - d) ** 2
    suction = np.pi * phi_c / (8 * a_s**3)  # of the wall, times (1 + 2 a_s - h)(1 + h)

    def wall_force(h):
        return f0 * (1 / h - 1) * (h < 1) - suction * (1 + 2 * a_s - h) * (1 + h)

    h = brentq(wall_force, 0.5, 1)
    end = 1 + 2 * a_s

    def work(x):  # of the suction, from 0
        return suction * (end * x + (end - 1) * x**2 / 2 - x**3 / 3)

    return {"L^2/R^2": L2, "d_eq": d, "k1": f0 * (0.5 - d / (2 * L2)), "E1": phi_c / (8 * a_s**3) * lens - f0 * (2 - d) ** 2 / 4,
            "k_wall": f0 / h**2 + suction * (2 * a_s - 2 * h), "E_wall": work(end) - work(h) - f0 * (-np.log(h) - (1 - h))}


def lattice_k1(rows, columns, bond, wall):
    """k_eq (p + 1)/q of a hexagonal raft of p rows of q droplets whose bonds, and contacts with the walls, are linear springs of
    stiffness `bond` and `wall` at rest: k1 of [T 2.32] without stretched bonds, damage or drag."""
    place = np.array([(i + row % 2 / 2, row * np.sqrt(3) / 2) for row in range(rows) for i in range(columns)])
    count = len(place)
    stiffness, load = np.zeros((2 * count, 2 * count)), np.zeros(2 * count)
    for a, b in zip(*np.triu_indices(count, 1)):
        apart = place[a] - place[b]
        if abs(np.hypot(*apart) - 1) < 1e-6:
            for i, j, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
                stiffness[2 * i:2 * i + 2, 2 * j:2 * j + 2] += sign * bond * np.outer(apart, apart)
    fixed, moving = 2 * np.arange(columns) + 1, 2 * np.arange(count - columns, count) + 1
    stiffness[fixed, fixed] += wall
    stiffness[moving, moving] += wall
    load[moving] = -wall  # the wall has moved by -1
    shift = np.linalg.lstsq(stiffness, load, rcond=None)[0]  # the raft may slide along the walls
    return float(wall * (shift[moving] + 1).sum() * (rows + 1) / columns)


def _slope(x, y):
    """(slope of a line through the origin, its standard error from the scatter about it: NaN for a single point)."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    slope = x @ y / (x @ x)
    return slope, np.sqrt(((y - slope * x) ** 2).sum() / (len(x) - 1) / (x @ x)) if len(x) > 1 else np.nan


def fit_k1(reductions):
    """(k1, its standard error) from k_eq = k1 q/(p+1) [T 2.32], a line through the origin."""
    known = reductions[np.isfinite(reductions["k_eq"])]
    return _slope(known["x"], known["k_eq"]) if len(known) > 1 else (np.nan, np.nan)


def fit_excess(phi, excess):
    """(peak, its standard error) of excess_fractures through numbers of excess fractures, of which some have 0 < phi < 1."""
    return _slope(excess_fractures(np.asarray(phi, float), 1.0), excess)


def competing_fraction(reductions, judgement="competing"):
    """(fraction of the reductions that compete by one of JUDGEMENTS, their number); those to one row do not count."""
    counted = reductions[judgement].dropna() if len(reductions) else reductions
    return (float(counted.astype(float).mean()), len(counted)) if len(counted) else (np.nan, 0)


def polydispersity(phi, small, delta):
    """Standard deviation of the radii over their mean, of both kinds together [T 2.41]."""
    mean = 1 - phi + phi * small
    return np.sqrt((1 - phi + phi * small**2) * (1 + delta**2) - mean**2) / mean


def extends(run):
    """Whether the walls of a raft move apart, so that its rows are not reduced."""
    return run.parameters.get("motion") == "extension"


def fractures(runs):
    """One row per run of compression (RunError for others): n, rows, phi, tilt, delta (of both kinds together), inverse_size (N^(-1/2)), aspect (q/p), peaks,
    excess (peaks beyond rows - 1), reductions (their number), competing, overlapping, unmatched (fractions of them)."""
    rows = []
    for run in runs:
        if extends(run):
            raise RunError(f"{run.path}: the walls move apart (-motion extension), so that no reduction of rows has fractures to "
                           "analyse; leave this run out")
        curve, o = Compression.of(run), run.parameters
        reductions = curve.reductions()
        rows.append({"n": curve.n, "rows": curve.rows, "phi": o["small_fraction"], "tilt": o["tilt"],
                     "delta": round(polydispersity(o["small_fraction"], o["small_radius"], o["delta"]), 12),
                     "inverse_size": curve.n**-0.5, "aspect": curve.n / curve.rows**2, "peaks": len(curve.peaks()),
                     "excess": len(curve.peaks()) - (curve.rows - 1), "reductions": competing_fraction(reductions)[1],
                     **{name: competing_fraction(reductions, name)[0] for name in JUDGEMENTS}})
    return pd.DataFrame(rows)
