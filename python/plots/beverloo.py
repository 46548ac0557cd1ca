#!/usr/bin/python3
"""Flow rate against orifice width, with the fit Q = C (w/sigma_avg - k)^beta of every group of runs."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt

from pliant import RunError, load_runs, load_table, sweep_table
from pliant import beverloo, plotting, pooling, script, symbols
from pliant.beverloo_figures import draw_flow
from pliant.scenarios import of_scenario

def read(paths):
    """One table of all CSV files and run folders. A CSV file without dim is in 2D; without model, mu or zeta these are unknown."""
    paths = pooling.distinct_paths(paths)
    tables = [load_table(p) for p in paths if Path(p).is_file()]
    folders = [p for p in paths if not Path(p).is_file()]
    if folders:
        runs = sweep_table([of_scenario(run, "hopper") for run in load_runs(folders)])
        tables.append(runs.assign(**{name: runs[name].fillna(0.0) if name in runs else 0.0 for name in ("mu", "zeta")}))
    table = pooling.joined(tables)
    for column, value in (("model", ""), ("dim", 2), ("mu", float("nan")), ("zeta", float("nan"))):
        table[column] = table[column].fillna(value) if column in table else value
    if not table["Q"].notna().any():
        raise RunError("none of the runs has a flow rate Q in its summary.json (not ended yet, or discharges, which discharge.py draws?)")
    return table


def print_tables(table, fits, labels):
    plain = [symbols.plain(label) for label in labels]
    print(script.markdown(["group", "w/sigma_avg", "Q [sigma_avg^d/t0]", "status"], [
        (label, f"{row.hopper_width:g}", script.with_error(row.Q, row.Q_error), getattr(row, "status", "–"))
        for label, group in zip(plain, fits["data"]) for row in group.sort_values("hopper_width").itertuples()]))
    print()
    rows, notes = [], []
    for label, fit_row in zip(plain, fits.itertuples()):
        for kind, fit in (("", fit_row.fit), (" (published)", fit_row.reference_fit)):
            if fit is not None:
                values = [script.with_error(getattr(fit, n), getattr(fit, n + "_error")) for n in ("C", "k", "beta")]
                rows.append((label, fit.points, *values[:2], values[2] + kind, script.with_error(fit.chi2_reduced, None)))
            elif not kind:
                rows.append((label, fit_row.points, "–", "–", "–", "–"))
        # In the same row they would make the table wider than a terminal.
        found = dict.fromkeys([fit_row.fit.note if fit_row.fit else fit_row.note,
                               fit_row.reference_fit.note if fit_row.reference_fit else ""])
        notes += [f"{label}: {note}" for note in found if note]
    print(script.markdown(["group", "points", "C [sigma_avg^d/t0]", "k", "beta", "chi2/dof"], rows))
    for note in notes:
        print(f"\n{note}")


def exponent(text):
    return text if text in ("auto", "none") else float(text)


def main():
    parser = script.parser(__doc__, "beverloo.py runs/w* -o beverloo.png\n  beverloo.py sweep.csv --beta 1.5",
                           "beverloo.png")
    parser.add_argument("run", nargs="+", help="run folders, folders of runs, or sweep tables "
                                               "(CSV: hopper_width, Q, Q_error, model, mu, zeta, and dim, default 2)")
    parser.add_argument("--beta", type=float, help="hold the exponent fixed (default: fitted)")
    parser.add_argument("--reference", type=exponent, default="auto", metavar="auto|none|EXPONENT",
                        help="exponent of the reference line; auto: d - 1/2 for friction only, d - 3/2 for drag only")
    arguments = script.arguments(parser)

    table = read(arguments.run)
    fits = beverloo.fit_table(table, beta=arguments.beta)
    labels = list(fits["label"])

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
                pass  # too few points: the free fit's note reports it
        reference_fits.append(fixed)
    fits["reference"], fits["reference_fit"] = references, reference_fits
    print_tables(table, fits, labels)

    figure, (left, right) = plt.subplots(1, 2, figsize=(9.2, 4.0), layout="constrained")
    draw_flow(left, right, fits, labels)
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
