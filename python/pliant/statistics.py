"""Standard errors of time series by block averaging; the most frequent value of a column."""

import numpy as np

from .errors import RunError


def block_ratio(numerator, denominator, blocks=10):
    """Ratio of sums over the first axis, and its standard error from `blocks` consecutive blocks.

    numerator, denominator: [T, …]; returns two arrays […]. Correlations within a block do no harm; blocks should be
    longer than the correlation time. Columns whose denominator vanishes in a block use the other blocks.
    """
    numerator, denominator = np.asarray(numerator, float), np.asarray(denominator, float)
    blocks = min(blocks, len(numerator))
    if blocks < 2:
        raise RunError(f"{len(numerator)} samples are too few for block averages (at least 2)")
    edges = np.linspace(0, len(numerator), blocks + 1).astype(int)[:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        value = numerator.sum(0) / denominator.sum(0)
        ratios = np.add.reduceat(numerator, edges, axis=0) / np.add.reduceat(denominator, edges, axis=0)
        valid = np.isfinite(ratios)
        count = valid.sum(0)
        spread = np.where(valid, ratios - value, 0.0)
        error = np.sqrt((spread**2).sum(0) / (count - 1) / count)
    return value, np.where(count > 1, error, np.nan)


def commonest(values):
    """The most frequent of a column's values, of each column's where there are several; the least where two are as frequent."""
    return values.mode().iloc[0]
