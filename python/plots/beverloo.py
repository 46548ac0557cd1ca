#!/usr/bin/python3
"""Flow rate against orifice width, with the fit Q = C (w/sigma_avg - k)^beta of every group of runs."""

import sys
from pathlib import Path

# In place of this folder, whose profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first: it says what this Python lacks

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.container import ErrorbarContainer
from matplotlib.ticker import LogLocator, NullFormatter

from pliant import RunError, load_runs, load_table, sweep_table
from pliant import beverloo, plotting, script
from pliant.scenarios import of_scenario

# Parameters that make another group when they differ, besides the model, mu and zeta.
PHYSICS = ["e_sp", "k_a", "k_l", "k_b", "e_c", "e_w", "n", "hopper_angle", "hopper_wall_distance"]
FRACTIONS = {0.5: "1/2", 1.0: "1", 1.5: "3/2", 2.5: "5/2"}


def read(paths):
    """One table of all CSV files and run folders; model, dim, mu and zeta get a value where a CSV file lacks them."""
    tables = [load_table(p) for p in paths if Path(p).is_file()]
    folders = [p for p in paths if not Path(p).is_file()]
    if folders:
        tables.append(sweep_table([of_scenario(run, "hopper") for run in load_runs(folders)]))
    table = pd.concat(tables, ignore_index=True)
    for column, value in (("model", ""), ("dim", 2), ("mu", 0.0), ("zeta", 0.0)):
        table[column] = table[column].fillna(value) if column in table else value
    if not table["Q"].notna().any():
        raise RunError("none of the runs has a flow rate Q in its summary.json (not ended yet, or discharges, which discharge.py draws?)")
    return table


def print_tables(table, fits, labels):
    plain = [label.replace("$", "").replace(r"\sigma_{avg}", "sigma_avg").replace("\\", "") for label in labels]
    print(script.markdown(["group", "w/sigma_avg", "Q [sigma_avg^d/t0]", "status"], [
        (label, f"{row.hopper_width:g}", script.with_error(row.Q, row.Q_error), getattr(row, "status", "–"))
        for label, group in zip(plain, fits["data"]) for row in group.sort_values("hopper_width").itertuples()]))
    print()
    rows = []
    for label, fit_row in zip(plain, fits.itertuples()):
        for kind, fit in (("", fit_row.fit), (" (published beta)", fit_row.reference_fit)):
            if fit is not None:
                rows.append((label + kind, fit.points, *(script.with_error(getattr(fit, n), getattr(fit, n + "_error"))
                                                         for n in ("C", "k", "beta")),
                             script.with_error(fit.chi2_reduced, None), fit.note))
            elif not kind:
                rows.append((label, fit_row.points, "–", "–", "–", "–", fit_row.note))
    print(script.markdown(["group", "points", "C [sigma_avg^d/t0]", "k", "beta", "chi2/dof", "note"], rows))


def exponent(text):
    return text if text in ("auto", "none") else float(text)


def main():
    parser = script.parser(__doc__, "beverloo.py runs/w* -o beverloo.png\n  beverloo.py sweep.csv --beta 1.5",
                           "beverloo.png")
    parser.add_argument("run", nargs="+", help="run folders, folders of runs, or sweep tables "
                                               "(CSV: hopper_width, Q, Q_error, model, dim, mu, zeta)")
    parser.add_argument("--beta", type=float, help="hold the exponent fixed (default: fitted)")
    parser.add_argument("--reference", type=exponent, default="auto", metavar="auto|none|EXPONENT",
                        help="exponent of the reference line; auto: d - 1/2 for friction only, d - 3/2 for drag only")
    arguments = script.arguments(parser)

    table = read(arguments.run)
    by = ["model", "dim", "mu", "zeta"] + [c for c in PHYSICS if c in table and table[c].nunique() > 1]
    fits = beverloo.fit_groups(table, by, beta=arguments.beta)
    fits["data"] = [group for _, group in table.groupby(by, dropna=False, sort=True)]
    shown = [c for c in by if c in ("model", "mu", "zeta") or fits[c].nunique() > 1]
    labels = [plotting.group_label(row, [c for c in shown if row[c] != ""]) for _, row in fits.iterrows()]

    references, reference_fits = [], []
    for _, row in fits.iterrows():
        reference = {"none": None, "auto": beverloo.published_exponent(row["dim"], row["mu"], row["zeta"])}.get(
            arguments.reference, arguments.reference)
        references.append(reference)
        fixed = None
        if reference is not None and arguments.beta is None:
            try:
                data = (row["data"][c] for c in ("hopper_width", "Q", "Q_error"))
                fixed = beverloo.fit_beverloo(*data, beta=reference)
            except RunError:
                pass  # too few points: the free fit's note says so
        reference_fits.append(fixed)
    fits["reference"], fits["reference_fit"] = references, reference_fits
    print_tables(table, fits, labels)

    figure, (left, right) = plt.subplots(1, 2, figsize=(9.2, 4.0), layout="constrained")
    spans = []
    for i, (row, label) in enumerate(zip(fits.itertuples(), labels)):
        color, marker = plotting.COLORS[i % len(plotting.COLORS)], plotting.MARKERS[i % len(plotting.MARKERS)]
        w, Q, error = (row.data[c].to_numpy(float) for c in ("hopper_width", "Q", "Q_error"))
        flowing = Q > 0
        style = {"fmt": marker, "color": color, "capsize": 2.5, "elinewidth": 1, "markeredgecolor": "white",
                 "markeredgewidth": 0.4, "zorder": 3}
        left.errorbar(w[flowing], Q[flowing], np.nan_to_num(error[flowing]), label=label, **style)
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
        right.errorbar(x, Q[flowing] / row.fit.C, np.nan_to_num(error[flowing]) / row.fit.C,
                       label=rf"$\beta$ = {script.with_error(row.fit.beta, row.fit.beta_error)}", **style)
        line = np.geomspace(x.min() / 1.15, x.max() * 1.15, 50)
        right.plot(line, line**row.fit.beta, color=color, lw=1.3)
        spans.append((x.min(), x.max()))
    if any(fit is not None for fit in reference_fits):
        left.plot([], [], "--", color="0.4", lw=1, label=r"published $\beta$, $C$ and $k$ fitted")
    if (table["Q"] == 0).any():
        left.plot([], [], "x", color="0.4", ms=6, mew=1.3, label="clogged")
    left.set(xlabel=r"orifice width  $w/\sigma_{avg}$", ylabel=flow_label(table), ylim=(0, None), xlim=(0, None))
    groups_first(left)
    if spans:
        x = np.array([min(s[0] for s in spans) / 1.3, max(s[1] for s in spans) * 1.3])
        # Every law Q/C = x^beta passes through (1, 1), so the reference lines do too.
        for style, reference in zip(["--", ":", "-."], sorted({r for r in references if r is not None})):
            right.plot(x, x**reference, style, color="0.45", lw=1.1, zorder=1,
                       label=f"slope {FRACTIONS.get(reference, f'{reference:g}')}")
        right.set(xscale="log", yscale="log")
        for axis in (right.xaxis, right.yaxis):
            decades = np.log10(np.divide(*reversed(axis.get_view_interval())))
            axis.set_major_formatter("{x:g}")
            if decades < 1.6:
                axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.set_minor_formatter(NullFormatter())
        groups_first(right)
    else:
        right.text(0.5, 0.5, "no group could be fitted", ha="center", transform=right.transAxes)
    right.set(xlabel=r"$w/\sigma_{avg} - k$", ylabel=r"$Q/C$")
    plotting.save(figure, arguments.output)


def groups_first(axes):
    """A legend with the groups (error bars) before the reference lines."""
    pairs = sorted(zip(*axes.get_legend_handles_labels()), key=lambda pair: not isinstance(pair[0], ErrorbarContainer))
    axes.legend(*zip(*pairs), loc="upper left")


def flow_label(table):
    dims = table["dim"].unique()
    power = str(int(dims[0])) if len(dims) == 1 else "d"
    return rf"flow rate  $Q$  [$\sigma_{{avg}}^{power}/t_0$]"


if __name__ == "__main__":
    script.run(main)
