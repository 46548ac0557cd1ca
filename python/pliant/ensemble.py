"""Averages over runs that differ in nothing but the seed, with errors from blocks and from seeds.

The error of a single run comes from blocks of it, and is too small where its flow drifts for longer than a block. The
scatter of a few seeds includes drifts, but is itself uncertain. `average` joins both:

- f² is the mean of s²/b² over all points with several seeds, weighted by their degrees of freedom, at least 1; s² is the
  variance of a point's seeds, b² the mean square of their block errors. So f is the factor by which the block errors of these
  runs are too small. Points that differ in kind have an f² for each kind (`pool`): one of chaotic points would swamp the
  errors of points that hardly depend on the seed.
- The variance of one run of a point is (PRIOR f² b² + (m - 1) s²)/(PRIOR + m - 1), m its number of seeds: from the
    scatter of its seeds, and from the blocks as if they were PRIOR further seeds.
- The standard error of the point is the root of that over m.

Where no point has two seeds, f is 1 and errors are block errors alone: `seeds_remark` reports it.
"""

import numpy as np
import pandas as pd

PRIOR = 4         #: seeds that the block errors count for
RESAMPLES = 200   #: default number of draws of a bootstrap


def groups(table, by):
    """[(key as a tuple, group)] of the columns `by`; missing values are a key too."""
    by = list(by)
    return [(key if isinstance(key, tuple) else (key,), group)
            for key, group in table.groupby(by if len(by) > 1 else by[0], dropna=False, sort=True)]


def _block_errors(means, known):
    """[points] block error of one run; for a point without it, the median relative error of the other points."""
    relative = [error / abs(mean) for mean, error in zip(means, known) if np.isfinite(error) and mean != 0]
    typical = np.median(relative) if relative else np.nan
    return np.array([error if np.isfinite(error) else typical * abs(mean) for mean, error in zip(means, known)])


def average(table, by, value, error=None, pool=()):
    """One row per group of `by`: its columns, the mean of the column `value`, its standard error in `value`_error
    (`error` names the column of the runs' own, by default that; NaN where neither blocks nor seeds give one), runs (how
    many), values (theirs). Points that agree in the columns `pool`, of `by`, share an f². Runs without a value are left out."""
    error = error or value + "_error"
    known = table[np.isfinite(table[value].astype(float))]
    found = groups(known, by)
    values = [group[value].to_numpy(float) for _, group in found]
    blocks = []
    for _, group in found:
        own = group[error].to_numpy(float) if error in group else np.array([])
        own = own[np.isfinite(own) & (own > 0)]
        blocks.append(np.sqrt((own**2).mean()) if len(own) else np.nan)
    means = np.array([v.mean() for v in values])
    free = np.array([len(v) - 1 for v in values])
    scatter = np.array([v.var(ddof=1) if len(v) > 1 else 0.0 for v in values])
    blocks = _block_errors(means, blocks)
    several = (free > 0) & (means != 0)
    if not np.isfinite(blocks).any() and several.any():  # no run has an error: the joint error of all seeds, relative
        blocks = np.sqrt((free * scatter / np.where(means == 0, 1, means) ** 2)[several].sum() / free[several].sum()
                         ) * abs(means)
    used = several & (blocks > 0)
    kinds = [tuple(dict(zip(by, key))[name] for name in pool) for key, _ in found]
    factor = np.ones(len(found))
    for kind in set(kinds):
        same = np.array([one == kind for one in kinds])
        if (known_here := used & same).any():
            factor[same] = ((free * scatter)[known_here] / blocks[known_here] ** 2).sum() / free[known_here].sum()
    variance = (PRIOR * np.maximum(factor, 1.0) * blocks**2 + free * scatter) / (PRIOR + free)
    errors = np.sqrt(variance / (free + 1))
    rows = [dict(zip(by, key)) | {value: mean, value + "_error": one, "runs": len(v), "values": v}
            for (key, _), mean, one, v in zip(found, means, errors, values)]
    return _points(rows, known, by, value)


def _points(rows, table, by, value):
    """The rows as a table, with columns of the same types where there are none."""
    points = pd.DataFrame(rows, columns=[*by, value, value + "_error", "runs", "values"])
    return points.astype({**table[list(by)].dtypes, value: float, value + "_error": float}) if not rows else points


def scatter(table, by, value, trials=None):
    """As `average`, with errors from the scatter of the seeds alone (NaN for one): for counts and fractions, for which
    a run has no error. The error of fractions of `trials` (a column) is at least the binomial error of as many
    independent trials, with half a success and half a failure added, because equal seeds have no scatter."""
    known = table[np.isfinite(table[value].astype(float))]
    rows = []
    for key, group in groups(known, by) if len(known) else []:
        values = group[value].to_numpy(float)
        m = len(values)
        error = values.std(ddof=1) / np.sqrt(m) if m > 1 else np.nan
        if trials:
            count = group[trials].to_numpy(float)
            p = ((values * count).sum() + 0.5) / (count.sum() + 1)
            error = np.fmax(error, np.sqrt(p * (1 - p) / count.sum()))
        rows.append(dict(zip(by, key)) | {value: values.mean(), value + "_error": error, "runs": m, "values": values})
    return _points(rows, known, by, value)


def draws(points, value, count=None, seed=1):
    """[count or RESAMPLES, points] means as they could have come out, to fit them again: seeds are drawn with replacement. If
    their scatter is below the point's error, normal noise is added; if it is above, a factor reduces it."""
    rng, count, columns = np.random.default_rng(seed), count or RESAMPLES, []
    for mean, error, values in zip(points[value], points[value + "_error"], points["values"]):
        m = len(values)
        own = values.std(ddof=1) / np.sqrt(m) if m > 1 else 0.0
        error = error if np.isfinite(error) else 0.0
        change = np.zeros(count)
        if own > 0:
            # The mean of m drawn out of m scatters by sqrt((m - 1)/m) too little.
            change = (rng.choice(values, (count, m)).mean(1) - mean) * np.sqrt(m / (m - 1)) * min(error / own, 1)
        if error > own:
            change = change + rng.normal(0, np.sqrt(error**2 - own**2), count)
        columns.append(mean + change)
    return np.array(columns).T


def spread(samples):
    """Standard error from bootstrap samples [count, …]: half of the central 68 %, which is robust against outliers."""
    low, high = np.quantile(samples, [0.158655, 0.841345], axis=0)
    return (high - low) / 2


def seeds_remark(points):
    """A note on the contributions missing from the errors of these points; empty if all have several seeds."""
    single = int((points["runs"] < 2).sum())
    if not single:
        return ""
    if single == len(points):
        return "one seed a point: errors of blocks alone, too small where the flow drifts"
    return f"{single} of {len(points)} points with one seed"
