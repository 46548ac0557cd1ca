"""Flow rates against the width of the orifice, with fits: code shared by their figures."""

import numpy as np
from matplotlib.container import ErrorbarContainer
from matplotlib.ticker import LogLocator, NullFormatter

from . import plotting, script
from .symbols import plain

FRACTIONS = {0.5: "1/2", 1.0: "1", 1.5: "3/2", 2.5: "5/2"}
W_LABEL = r"orifice width  $w/\sigma_{avg}$"
_LEGEND_INSIDE = 4  #: entries of a legend that leave space for the curves
_LONG = 30  #: letters of an entry that needs the whole width of a panel


def rate_label(dims):
    """Label of an axis of flow rates, of runs of these dimensions."""
    dims = sorted(set(dims))
    power = str(int(dims[0])) if len(dims) == 1 else "d"
    return rf"flow rate  $Q$  [$\sigma_{{avg}}^{power}/t_0$]"


def groups_first(axes):
    """A legend with the groups (error bars) before the reference lines; above the axes where it would lie over curves."""
    pairs = sorted(zip(*axes.get_legend_handles_labels()), key=lambda pair: not isinstance(pair[0], ErrorbarContainer))
    if len(pairs) <= _LEGEND_INSIDE:
        axes.legend(*zip(*pairs), loc="upper left")
        return
    longest = max(len(plain(label)) for _, label in pairs)
    axes.legend(*zip(*pairs), **plotting.ABOVE | {"ncols": 1 if longest > _LONG else 2})


def plain_numbers(axis):
    """For an axis that is logarithmic already."""
    decades = np.log10(np.divide(*reversed(axis.get_view_interval())))
    axis.set_major_formatter("{x:g}")
    if decades < 2:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_minor_formatter(NullFormatter())


def log_axes(axes):
    """Both axes logarithmic, with plain numbers."""
    axes.set(xscale="log", yscale="log")
    plain_numbers(axes.xaxis)
    plain_numbers(axes.yaxis)


def draw_flow(left, right, fits, labels):
    """Q against w with the fits on the left, Q/C against w - k on the right. `fits` has a row per group: dim, data (with
    hopper_width, Q, Q_error), fit and reference_fit (BeverlooFit or None), reference (exponent or None)."""
    spans, clogged = [], False
    for i, (row, label) in enumerate(zip(fits.itertuples(), labels)):
        style = plotting.points(i)
        color = style["color"]
        w, Q, error = (row.data[c].to_numpy(float) for c in ("hopper_width", "Q", "Q_error"))
        flowing = Q > 0
        clogged |= (Q == 0).any()
        plotting.errorbar(left, w[flowing], Q[flowing], error[flowing], label=label, **style)
        if (~flowing & np.isfinite(Q)).any():
            left.plot(w[~flowing], np.zeros((~flowing).sum()), "x", color=color, ms=6, mew=1.3, clip_on=False, zorder=4)
        if row.fit is None:
            continue
        grid = row.fit.k + (w.max() * 1.04 - row.fit.k) * np.linspace(0, 1, 400) ** 2
        left.plot(grid, row.fit(grid), color=color, lw=1.3)
        if row.reference_fit is not None:
            grid = row.reference_fit.k + (w.max() * 1.04 - row.reference_fit.k) * np.linspace(0, 1, 400) ** 2
            left.plot(grid, row.reference_fit(grid), "--", color=color, lw=1, alpha=0.7)
        x = w[flowing] - row.fit.k
        plotting.errorbar(right, x, Q[flowing] / row.fit.C, error[flowing] / row.fit.C,
                          label=rf"$\beta$ = {script.with_error(row.fit.beta, row.fit.beta_error)}", **style)
        line = np.geomspace(x.min() / 1.15, x.max() * 1.15, 50)
        right.plot(line, line**row.fit.beta, color=color, lw=1.3)
        spans.append((x.min(), x.max()))
    if any(fit is not None for fit in fits["reference_fit"]):
        left.plot([], [], "--", color="0.4", lw=1, label=r"published $\beta$, $C$ and $k$ fitted")
    if clogged:
        left.plot([], [], "x", color="0.4", ms=6, mew=1.3, label="clogged")
    left.set(xlabel=W_LABEL, ylabel=rate_label(fits["dim"]), ylim=(0, None), xlim=(0, None))
    groups_first(left)
    if spans:
        x = np.array([min(s[0] for s in spans) / 1.3, max(s[1] for s in spans) * 1.3])
        # Every law Q/C = x^beta passes through (1, 1), so the reference lines do too.
        for style, reference in zip(["--", ":", "-."], sorted({r for r in fits["reference"] if r is not None})):
            right.plot(x, x**reference, style, color="0.45", lw=1.1, zorder=1,
                       label=f"slope {FRACTIONS.get(reference, f'{reference:g}')}")
        log_axes(right)
        groups_first(right)
    else:
        right.text(0.5, 0.5, "no group could be fitted", ha="center", transform=right.transAxes)
    right.set(xlabel=r"$w/\sigma_{avg} - k$", ylabel=r"$Q/C$")
