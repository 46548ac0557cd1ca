"""The figures of the thesis: rafts of droplets (chapter 2) and clogs (chapter 4)."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from .. import clog_analysis as clog, ensemble, plotting, raft_analysis as raft, raft_figures, symbols
from ..clog_figures import draw_avalanches, draw_curves, draw_middles, draw_probabilities, draw_regimes
from ..errors import RunError
from ..script import remark, with_error
from ..statistics import commonest
from . import published
from .figure import Figure, Quantity

DISTANCE = r"distance of the walls  $D/\langle R\rangle$"


def _usual(measured, column):
    """The runs with the commonest value of a column, of which others are variants."""
    runs = measured.drop_duplicates(["table", "row"])
    value = commonest(runs[column])
    if (others := runs[runs[column] != value][column].nunique()):
        remark(f"{(runs[column] != value).sum()} runs with {others} other values of {column} than {value:g} are left out")
    return measured[measured[column] == value]


def _curves(axes, measured, labels):
    for i, ((_, curve), label) in enumerate(zip(measured.groupby(["table", "row"], sort=False), labels)):
        axes.plot(curve["distance"], curve["force"], color=plotting.color(i), lw=1.1, label=label)
    axes.axhline(0, color="0.7", lw=0.7)
    axes.set(xlabel=DISTANCE, ylabel="force on the walls  $F$")
    axes.invert_xaxis()  # time runs to the right


def _at_rest(forces):
    """(limit, error) of a force as the speed of the wall, its index, goes to 0: extrapolated by a straight line through
    the two slowest points; the line through the next two estimates the error."""
    v, F = forces.index.to_numpy()[:3], forces.to_numpy()[:3]
    limit = F[0] - v[0] * (F[1] - F[0]) / (v[1] - v[0])
    return limit, abs(limit - (F[1] - v[1] * (F[2] - F[1]) / (v[2] - v[1])))


def draw_three(measured):
    """[T Fig. 2.3]: force of three droplets, and its peak against the speed of the wall."""
    # Among runs that differ only in the integrator, the first is used.
    runs = measured.drop_duplicates(["table", "row"]).drop_duplicates("v_wall")
    measured = measured[measured["row"].isin(runs["row"])]
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.2, 3.8), layout="constrained")
    _curves(left, measured, [rf"$v_{{wall}}$ = {v:g}" for v in runs["v_wall"]])
    left.axhline(published.THREE_PEAK.value, color="0.4", ls="-.", lw=0.9, label="[T], peak")
    left.legend()
    speeds = runs.groupby("v_wall")["F_max"].mean()
    lowest = runs.groupby("v_wall")["F_min"].mean() if "F_min" in runs else pd.Series(dtype=float)
    right.plot(speeds.index, speeds, "o", color=plotting.COLORS[0])
    right.axhline(published.THREE_PEAK.value, color="0.4", ls="-.", lw=0.9, label="[T]")
    right.set(xlabel=r"$v_{wall}$", ylabel=r"$F_{max}$", xlim=(0, None))
    slowest = runs.sort_values("v_wall").iloc[0]
    quantities = [Quantity("stiffness at F = 0, slowest wall", slowest["slope"], slowest["slope_error"],
                           published.THREE_SLOPE)]
    for name, forces, known in (("F_max", speeds, published.THREE_PEAK), ("F_min", lowest, None)):
        note = "" if known else "the negative peak of [T Fig. 2.3]; [T] prints no number"
        quantities += [Quantity(f"{name} at v_wall = {v:g}", F, np.nan, known, note) for v, F in forces.items()]
        if len(forces) > 2:
            limit, error = _at_rest(forces)
            quantities.append(Quantity(f"{name} as v_wall goes to 0", limit, error, known, "; ".join(filter(None, [
                "line through the two slowest walls; error: difference from the line through the next two", note]))))
    if len(speeds) > 2:
        second = speeds.index[1]
        right.plot([0, second], [_at_rest(speeds)[0], speeds[second]], color=plotting.COLORS[0], lw=1)
    right.legend()
    return figure, quantities


def draw_forces(measured):
    """[T Fig. 2.6, 2.9]: the force curve of a raft, a panel per fraction of small droplets, a curve per seed."""
    measured = _usual(measured, "v_wall")
    # Among runs that differ only in the integrator, the first is used.
    first = measured.drop_duplicates(["table", "row"]).drop_duplicates(["small_fraction", "seed"])
    measured = measured[measured["row"].isin(first["row"])]
    kinds = sorted(measured["small_fraction"].unique())
    figure, panels = plt.subplots(len(kinds), 1, figsize=(8, 1.2 + 2.5 * len(kinds)), layout="constrained", squeeze=False)
    quantities = []
    for axes, phi in zip(panels[:, 0], kinds):
        own = measured[measured["small_fraction"] == phi]
        runs = own.drop_duplicates(["table", "row"])
        _curves(axes, own, [f"seed {seed}" for seed in runs["seed"]])
        axes.legend(ncols=2)
        axes.set_title(rf"$N$ = {runs['n'].iloc[0]}" + (rf", $\phi$ = {phi:g}" if len(kinds) > 1 else ""), loc="left")
        peak = ensemble.scatter(runs, ["n"], "F_max").iloc[0]
        quantities.append(Quantity(f"highest peak, phi = {phi:g}", peak["F_max"], peak["F_max_error"], None,
                                   ensemble.seeds_remark(pd.DataFrame([peak]))))
    return figure, quantities


def _stiffness(reductions):
    """Mean over runs of k1 [T 2.32], of its fit to each. Raises RunError where none has one."""
    runs = []
    for _, table in reductions.groupby(["table", "row"]):
        k1, error = raft.fit_k1(table)
        runs.append({"all": 0, "k1": k1, "k1_error": error})
    mean = ensemble.average(pd.DataFrame(runs), ["all"], "k1")
    if mean.empty:
        raise RunError("no run has two reductions of its rows, of which a stiffness could be fitted")
    return mean.iloc[0]


def draw_stiffness(measured):
    """[T Fig. 2.7]: k_eq of the reductions of a raft against q/(p+1)."""
    table = _usual(measured, "v_wall").drop_duplicates(["seed", "start_rows", "n", "rows"])
    mean = _stiffness(table)
    figure, axes = plt.subplots(figsize=(5.8, 4.2), layout="constrained")
    raft_figures.draw_stiffness(axes, table, mean["k1"])
    x = np.array([0, table["x"].max()])
    axes.plot(x, published.K1_SQUARE.value * x, "-.", color=plotting.COLORS[1],
              label=f"[T], $k_1$ = {with_error(published.K1_SQUARE.value, published.K1_SQUARE.error)}")
    axes.legend()
    usual = symbols.defaults("raft")
    constants = raft.contact_constants(**{name: usual[name] for name in ("f0", "phi_c", "a_s")})
    measured_ones = {"k1": table["k1"].iloc[0], "E1": table["E1"].iloc[0]}
    quantities = [*(Quantity(f"{name} of {'a droplet at a wall' if 'wall' in name else 'two droplets'}",
                             measured_ones.get(name, constants[name]), 0.0, known,
                             "" if name in measured_ones else "from the equations of the model")
                    for name, known in published.CONTACTS.items()),
                  Quantity("k1 of k_eq = k1 q/(p+1)", mean["k1"], mean["k1_error"], published.K1_SQUARE)]
    of_row = table.assign(k=table["k_eq"] / table["x"], k_error=table["k_error"] / table["x"])
    for row in ensemble.average(of_row, ["rows"], "k", pool=["rows"]).sort_values("rows", ascending=False).itertuples():
        first = published.K1_FIRST if row.rows == 7 else None
        lattice = raft.lattice_k1(row.rows, round(table["n"].iloc[0] / row.rows), table["k1"].iloc[0], constants["k_wall"])
        quantities += [Quantity(f"k1 of the reduction from {row.rows} rows", row.k, row.k_error, first),
                       Quantity(f"k1 of a linear lattice of {row.rows} rows", lattice, 0.0, first)]
    return figure, quantities


def draw_scaling(measured):
    """[T Fig. 2.8]: peaks of the reductions of many rafts against (p³ + p²)^(-1/2)."""
    table = measured.assign(ratio=measured["F_max"] / measured["n"] / (
        2 * np.sqrt(measured["k1"] * measured["E1"]) * raft_figures.inverse_rows(measured)))
    mean = _stiffness(table)
    figure, (left, right) = plt.subplots(1, 2, figsize=(plotting.PAGE, 4.1), layout="constrained")
    raft_figures.draw_stiffness(left, table, mean["k1"])
    raft_figures.draw_peaks(right, table)
    runs = table.groupby(["n", "table", "row"], as_index=False)["ratio"].mean()
    quantities = [Quantity("k1 of k_eq = k1 q/(p+1), mean of all arrays", mean["k1"], mean["k1_error"],
                           published.K1_ARRAYS)]
    for row in ensemble.scatter(runs, ["n"], "ratio").itertuples():
        quantities.append(Quantity(f"F_max over 2 N sqrt(k1 E1/(p^3+p^2)), mean of reductions, N = {row.n}", row.ratio,
                                   row.ratio_error, published.PEAK_RATIO))
    return figure, quantities


def draw_two_sizes(measured):
    """[T Fig. 2.10]: excess peaks against the fraction of small droplets, over the height of the fitted law."""
    points, _, y = raft_figures.fracture_points(measured, "phi")
    figure, (left, right) = plt.subplots(1, 2, figsize=(plotting.PAGE, 4.0), layout="constrained")
    raft_figures.draw_fractures(left, points, "phi", y)
    quantities = []
    mixed = points[(points["phi"] > 0) & (points["phi"] < 1)]
    if mixed.empty:
        raise RunError("no raft has droplets of two sizes: rows with small_fraction between 0 and 1 are needed")
    for i, (n, group) in enumerate(points.groupby("n")):
        if n not in mixed["n"].to_numpy():
            continue
        height, _ = raft.fit_excess(group["phi"], group["excess"])
        heights = [raft.fit_excess(group["phi"], draw)[0] for draw in ensemble.draws(group, "excess")]
        error = float(ensemble.spread(heights))
        quantities.append(Quantity(f"height of the excess, N = {n}", height, error))
        plotting.errorbar(right, group["phi"], group["excess"] / height, group["excess_error"] / height, ls="",
                          capsize=2, label=rf"$N = {n}$, $\Delta N_{{peak}}$ = {with_error(height, error)}",
                          **plotting.symbol(i))
        for row in mixed[mixed["n"] == n].itertuples():
            law = raft.excess_fractures(row.phi, 1.0)
            quantities.append(Quantity(f"excess over its height at phi = {row.phi:g}, N = {n}", row.excess / height,
                                       np.hypot(row.excess_error / height, row.excess * error / height**2),
                                       published.Published(float(law), 0.0, "T 2.39")))
    phi = np.linspace(0, 1, 200)
    right.plot(phi, raft.excess_fractures(phi, 1.0), "--", color="0.3", lw=1.1, label=r"[T], $2\sqrt{\phi(1-\phi)}$")
    right.set(xlabel=raft_figures.FRACTURES["phi"][1], ylabel=r"$\Delta N/\Delta N_{peak}$")
    right.legend()
    return figure, quantities


def draw_polydispersity(measured):
    """[T Fig. 2.11]: peaks against polydispersity, of one size with a scatter of radii, and of two sizes."""
    figure, axes = plt.subplots(figsize=(5.8, 4.2), layout="constrained")
    quantities = []
    one = measured["small_fraction"] == 0
    several = measured["n"].nunique() > 1
    for data, kind, marker, color in ((measured[one], "one size", "s", plotting.COLORS[0]),
                                      (measured[~one], "two sizes", "o", plotting.COLORS[1])):
        for i, (n, points) in enumerate(ensemble.scatter(data, ["n", "delta"], "peaks").groupby("n")):
            name = f"{kind}, N = {n}" if several else kind
            plotting.errorbar(axes, points["delta"], points["peaks"], points["peaks_error"], fmt=marker, color=color,
                              mfc="white" if i else color, capsize=2, label=name.replace("N", "$N$"))
            quantities += [Quantity(f"peaks at delta = {row.delta:.4g}, {name}", row.peaks, row.peaks_error)
                           for row in points.itertuples()]
    axes.set(xlabel=raft_figures.FRACTURES["delta"][1], ylabel="peaks", ylim=(0, None))
    axes.legend()
    return figure, quantities


#: A line whose points have a larger χ²/dof is no law: its end is shown without a verdict.
_STRAIGHT = 2.0


def _draw_competing(measured, kind):
    """A panel per judgement of competing fractures; returns the figure, [(judgement, panel, points)] and the quantities."""
    there = [name for name in raft.JUDGEMENTS if name in measured and measured[name].notna().any()]
    figure, panels = plt.subplots(1, len(there), figsize=(min(1.8 + 3.6 * len(there), plotting.PAGE), 4.0), layout="constrained", sharey=True,
                                  squeeze=False)
    x = {"size": "n"}.get(kind, kind)
    judged, quantities = [], []
    for axes, judgement in zip(panels[0], there):
        points, _, y = raft_figures.fracture_points(measured, kind, judgement)
        raft_figures.draw_fractures(axes, points, kind, y)
        axes.set_title(judgement, loc="left")
        axes.set_ylim(0, 1.05)
        axes.label_outer()
        varied = [x, *(c for c in ("n", "phi", "delta", "tilt") if c != x and points[c].nunique() > 1)]
        for _, row in points.iterrows():
            name = ", ".join(f"{ {'n': 'N', 'aspect': 'q/p'}.get(c, c)} = {row[c]:.3g}" for c in varied)
            quantities.append(Quantity(f"fraction of {raft.JUDGEMENTS[judgement]}, {name}", row[y], row[y + "_error"]))
        judged.append((judgement, axes, points))
    return figure, judged, quantities


def draw_size(measured):
    """[T Fig. 2.14]: competing fractures against N^(-1/2), with the line to infinite rafts."""
    figure, judged, quantities = _draw_competing(measured, "size")
    limits = []
    for judgement, axes, points in judged:
        line = points[points["n"] >= 16]
        if len(line) > 2:
            x = line["inverse_size"].to_numpy()
            slope, limit = np.polyfit(x, line[judgement], 1)
            drawn = np.polyfit(x, ensemble.draws(line, judgement).T, 1)
            at = np.array([0, x.max()])
            axes.plot(at, limit + slope * at, color=plotting.COLORS[0], lw=1.1, label="line, $N$ ≥ 16")
            off = (line[judgement] - limit - slope * x) / line[judgement + "_error"]
            chi2 = float((off**2).sum() / (len(x) - 2))
            limits.append(Quantity(f"fraction of {raft.JUDGEMENTS[judgement]} as N goes to infinity", limit,
                                   float(ensemble.spread(drawn[1])), published.COMPETING,
                                   f"the points leave the line (χ²/dof {chi2:.1f})" if chi2 > _STRAIGHT else "", chi2 <= _STRAIGHT))
        axes.plot([0, 1 / np.sqrt(published.NO_COMPETING)], [published.COMPETING.value, 0], "-.", color="0.3", lw=1.0,
                  label="[T], as described")
        axes.plot(0, published.COMPETING.value, "k*", ms=9, clip_on=False)
        axes.set_xlim(0, None)
    judged[0][1].legend()
    return figure, limits + quantities


def draw_aspect(measured):
    """[T Fig. 2.15]: competing fractures against the shape of the raft."""
    figure, _, quantities = _draw_competing(measured, "aspect")
    return figure, quantities


def draw_tilt(measured):
    """[T Fig. 2.16]: competing fractures against the angle between the walls."""
    figure, judged, quantities = _draw_competing(measured, "tilt")
    minima = []
    for judgement, axes, points in judged:
        for n, group in points.groupby("n"):
            tilt = group["tilt"].to_numpy()
            least = tilt[group[judgement].argmin()]
            drawn = tilt[ensemble.draws(group, judgement).argmin(1)]
            if group[judgement].min() < group[judgement].max() and group[judgement].iloc[0] > 0:
                minima.append(Quantity(f"tilt with the fewest {raft.JUDGEMENTS[judgement]}, N = {n}", least,
                                       float(np.sqrt(((drawn - least) ** 2).mean())), published.TILT))
        axes.axvline(published.TILT.value, color="0.5", ls="-.", lw=0.9, label="[T], fewest")
    judged[0][1].legend()
    return figure, minima + quantities


# ---- clogs -----------------------------------------------------------------------------------------------------------

def _points(measured):
    ended = measured[measured["status"].isin(clog.ENDED)]
    if ended.empty:
        raise RunError("no run has ended clogged or empty")
    return clog.clog_points(ended)


def _middles(fits, symbol):
    return [Quantity(f"{symbol} at phi_c = {row.phi_c:g}" + (f", N = {row.n:g}" if fits["n"].nunique() > 1 else ""),
                     row.x0 if row.fit else np.nan, row.x0_error if row.fit else np.nan, None, row.note or "")
            for row in fits.itertuples()]


def draw_gravity(measured):
    """[T Fig. 4.2]: P_clog against gravity, and where it is one half."""
    fits = clog.fit_sigmoids(_points(measured), "g")
    if fits.empty:
        raise RunError("no curve of P_clog against g: rows with several g and one width are needed")
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.2, 3.9), layout="constrained")
    draw_curves(left, fits, "g")
    draw_middles(right, fits, "phi_c", "g")
    return figure, _middles(fits, "g_0")


def _width_fits(measured):
    fits = clog.fit_sigmoids(_points(measured), "hopper_width")
    if fits.empty:
        raise RunError("no curve of P_clog against the width: rows with several widths and one g are needed")
    return fits


def draw_width(measured):
    """[T Fig. 4.3]: P_clog against the width of the exit."""
    fits = _width_fits(measured)
    figure, axes = plt.subplots(figsize=(5.8, 4.2), layout="constrained")
    draw_curves(axes, fits, "hopper_width")
    return figure, _middles(fits, "w*/d")


def draw_middle_widths(measured):
    """[T Fig. 4.4]: w*/d against the capillary length, with two regimes."""
    figure, axes = plt.subplots(figsize=(5.8, 4.2), layout="constrained")
    regimes = draw_regimes(axes, _width_fits(measured))
    grid = np.linspace(0, axes.get_xlim()[1], 200)
    axes.plot(grid, np.maximum(published.W_LOW.value, published.W_SLOPE.value * grid), "-.", color="0.2", lw=1.1,
              label=f"[T], {published.W_LOW.value:.3g} and {published.W_SLOPE.value:.3g} $\\delta$")
    axes.legend()
    relative = np.hypot(regimes.low_error / regimes.low, regimes.slope_error / regimes.slope)
    return figure, [Quantity("w*/d, low cohesion", regimes.low, regimes.low_error, published.W_LOW),
                    Quantity("w*/d over delta, high cohesion", regimes.slope, regimes.slope_error, published.W_SLOPE),
                    Quantity("delta_crit", regimes.delta_crit, regimes.delta_crit * relative, published.DELTA_CRIT)]


def _avalanches(measured):
    """clog_points of the commonest number of droplets, w/delta* of these, the fit of [T 4.18], its quantities; and
    clog.collapse_fits of all points."""
    points = _points(measured)
    own = points["n"] == commonest(points["n"])
    x = clog.effective_width(points, clog.fitted_delta_crit(points[own & (points["g"] == commonest(points["g"]))]))
    fits = clog.collapse_fits(points, x)
    fit = clog.fit_avalanches(x[own], points["s"][own], points["s_error"][own], points["n"][own])
    quality = f"chi2/dof {fit.chi2_reduced:.3g}, {fit.points} of {own.sum()} points"
    quantities = [Quantity("A", fit.A, fit.A_error, published.A, quality),
                  Quantity("B", fit.B, fit.B_error, published.B, quality)]
    return points[own], x[own], fit, quantities, fits


def _published_law(axes, x, law):
    grid = np.linspace(0, x.max() * 1.05, 300)
    axes.plot(grid, law(grid, published.A.value, published.B.value), "-.", color="0.2", lw=1.1, label="[T]")


#: Names of clog.collapse_fits, for the rows.
_FITS = {"scaled": "avalanches scaled to one N", "cut off": "emptied runs censored at N", "P_clog": "from P_clog",
         "widths at one g": "widths at one g alone", "other g": "other g alone"}


def draw_collapse(measured):
    """[T Fig. 4.5]: mean avalanches against w/delta*; B of parts of the data, and of other ways to fit them."""
    points, x, fit, quantities, fits = _avalanches(measured)
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(plotting.PAGE, 4.0), layout="constrained")
    draw_avalanches(left, middle, points, x, fit)
    n = points["n"].iloc[0]
    _published_law(left, x, lambda grid, A, B: np.minimum(clog.avalanche_law(grid, A, B), n))
    left.legend(**plotting.ABOVE)
    for i, (name, one) in enumerate(fits.items()):
        plotting.errorbar(right, one.B, i, xerr=one.B_error, fmt="o", capsize=2.5, color=plotting.COLORS[0])
        if name != "all":
            words, quality = _FITS.get(name, f"{name} alone"), f"chi2/dof {one.chi2_reduced:.3g}, {one.points} points"
            quantities += [Quantity(f"{part}, {words}", getattr(one, part), getattr(one, part + "_error"),
                                    getattr(published, part), quality) for part in ("A", "B")]
        if name in ("all", "cut off", "P_clog"):
            words = ", ".join(filter(None, [_FITS.get(name), "against B from the published w*"]))
            quantities.append(Quantity(f"B, {words}", one.B, one.B_error, published.B_OF_W_STAR))
    right.axvline(published.B.value, color="0.2", ls="-.", lw=1.0, label="[T]")
    right.axvline(published.B_OF_W_STAR.value, color="0.2", ls=":", lw=1.0, label="of $w^*$ in [T]")
    spread = np.nan_to_num(fit.B_error)
    right.axvspan(fit.B - spread, fit.B + spread, color=plotting.COLORS[0], alpha=0.15, lw=0)
    right.set_yticks(range(len(fits)), labels=[_FITS.get(name, name).replace("phi_c", r"$\phi_c$").replace("P_clog", "$P_{clog}$")
                                               for name in fits])
    right.set(xlabel="$B$", ylim=(len(fits) - 0.5, -0.5), xlim=(0, None))
    right.legend(**plotting.ABOVE)
    return figure, quantities


def draw_clog_collapse(measured):
    """[T Fig. 4.6]: P_clog against w/delta*."""
    points, x, fit, quantities, fits = _avalanches(measured)
    figure, axes = plt.subplots(figsize=(5.8, 4.2), layout="constrained")
    draw_probabilities(axes, points, x, fit)
    n = points["n"].iloc[0]
    _published_law(axes, x, lambda grid, A, B: clog.clog_law(grid, A, B, n))
    axes.legend()
    quantities.append(_off_the_law("P_clog minus its fit, mean over points", points, x, fit))
    if (uncut := fits.get("cut off")):
        grid = np.linspace(0, x.max() * 1.05, 300)
        axes.plot(grid, clog.clog_law(grid, uncut.A, uncut.B, n), ":", color="0.2", lw=1.4, label=_FITS["cut off"])
        axes.legend()
        quantities.append(_off_the_law(f"P_clog minus its fit, {_FITS['cut off']}, mean over points", points, x, uncut))
    return figure, quantities


def _off_the_law(name, points, x, fit):
    away = (points["P"] - clog.clog_law(x, fit.A, fit.B, points["n"].to_numpy())).to_numpy()
    return Quantity(name, float(away.mean()), float(away.std(ddof=1) / np.sqrt(len(away))),
                    published.Published(0.0, 0.0, "T 4.20"))


def _droplets(options):
    """Their number, of a row's options; None where these do not say it."""
    rows, columns = (options.get(name) for name in ("rows", "columns"))
    if "n" in options:
        return int(options["n"])
    return int(rows) * int(columns) if rows and columns else None


#: Among runs that differ only in these options the first is used.
_INTEGRATOR = ("dt", "ts_type", "ts_adapt_type", "ts_rk_type", "ts_rtol", "ts_atol", "mobility")
_RAFTS = ("rows", "columns", "n", "small_fraction", "small_radius", "delta", "tilt")
_CLOGS = ("n", "g", "phi_c", "hopper_width")
FIGURES = [
    Figure("T2.3", "three droplets: force on the walls, its slope and its peak", ("quick/three",), ("raft/three",), "forces",
           draw_three, "three speeds", tells=("v_wall", *_INTEGRATOR)),
    Figure("T2.6", "7 x 7 raft: force against the distance of the walls", ("quick/square",), ("raft/square",), "forces",
           draw_forces, "the same at one speed", tells=("v_wall", "small_fraction", *_INTEGRATOR)),
    Figure("T2.7", "7 x 7 raft: stiffness against q/(p+1)", ("quick/square",), ("raft/square",), "reductions",
           draw_stiffness, "the same at one speed", tells=("v_wall", *_INTEGRATOR)),
    Figure("T2.8", "rafts of 20 to 400 droplets: peaks of the force against the number of rows", ("quick/scaling",),
           ("raft/scaling",), "reductions", draw_scaling, "up to 100 droplets, twice the speed",
           tells=("rows", "columns", "n")),
    Figure("T2.9", "force with more and more small droplets", ("quick/small-droplets",), ("raft/small-droplets",), "forces",
           draw_forces, "one seed", tells=("v_wall", "small_fraction", *_INTEGRATOR)),
    Figure("T2.10", "excess fractures against the fraction of small droplets", ("quick/bidisperse",), ("raft/bidisperse",),
           "fractures", draw_two_sizes, "4 x 5 droplets, four seeds", tells=_RAFTS),
    Figure("T2.11", "fractures against polydispersity", ("quick/delta", "quick/bidisperse"),
           ("raft/delta", "raft/bidisperse"), "fractures", draw_polydispersity, "four seeds",
           tells=(_droplets, "small_fraction", "small_radius", "delta")),
    Figure("T2.14", "competing fractures against the number of droplets", ("quick/raft-size",), ("raft/size",), "fractures",
           draw_size, "up to 64 droplets, twice the speed", tells=_RAFTS),
    Figure("T2.15", "competing fractures against the shape of the raft", ("quick/aspect",), ("raft/aspect",), "fractures",
           draw_aspect, "36 droplets, twice the speed", tells=_RAFTS),
    Figure("T2.16", "competing fractures against the angle of the walls", ("quick/tilt",), ("raft/tilt",), "fractures",
           draw_tilt, "36 droplets, twice the speed", tells=_RAFTS),
    Figure("T4.2", "probability of a clog against gravity", ("quick/gravity",), ("clog/gravity", "clog/width"), "clogs",
           draw_gravity, "four seeds, fewer points", tells=_CLOGS),
    Figure("T4.3", "probability of a clog against the width of the exit", ("quick/width",), ("clog/width",), "clogs",
           draw_width, "four seeds, fewer points", tells=_CLOGS),
    Figure("T4.4", "width at which half of the runs clog, against the capillary length", ("quick/width",), ("clog/width",), "clogs",
           draw_middle_widths, "four seeds, fewer points", tells=_CLOGS),
    Figure("T4.5", "mean avalanche against w/delta*", ("quick/width", "quick/gravity"),
           ("clog/width", "clog/gravity", "clog/numbers"), "clogs", draw_collapse, "four seeds, fewer points, one N",
           tells=_CLOGS),
    Figure("T4.6", "probability of a clog against w/delta*", ("quick/width", "quick/gravity"),
           ("clog/width", "clog/gravity", "clog/numbers"), "clogs", draw_clog_collapse, "four seeds, fewer points, one N",
           tells=_CLOGS),
]
