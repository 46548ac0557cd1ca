#!/usr/bin/python3
"""Force on the walls of rafts against their distance, with peaks, slopes and reductions of rows; prints a table."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt

from pliant import load_runs, plotting, raft_analysis as raft, script


def main():
    parser = script.parser(__doc__, "raft.py runs/raft -o force.png", "force.png")
    parser.add_argument("run", nargs="+", help="run folder")
    arguments = script.arguments(parser)
    runs = load_runs(arguments.run)

    figure, axes = plt.subplots(figsize=(7.0, 4.2), layout="constrained")
    labels = plotting.name_labels(runs)
    for i, (run, label) in enumerate(zip(runs, labels)):
        color = plotting.color(i)
        curve = raft.Compression.of(run)
        axes.plot(curve.distance, curve.force, ("-", "--", ":")[i % 3], color=color, lw=0.9, label=label)
        for sign, marker in ((1, "^"), (-1, "v")):
            at = curve.peaks(sign)
            axes.plot(curve.distance[at], curve.force[at], marker, color=color, ms=4 + 2 * i, mfc="none" if i else color)
        table = curve.reductions()
        found = (f"{run.path}: slope at F = 0 {script.with_error(*curve.stiffness_at_zero())}, "
                 f"{len(curve.peaks())} peaks, {len(curve.peaks(-1))} negative ones")
        if not len(table):
            print(f"{found}; no reduction of rows, because " + ("the walls move apart" if raft.extends(run) else "none is complete"))
            continue
        k1, error = raft.fit_k1(table)
        for row in table.itertuples():
            rise = curve.rise(row.sample)
            x = curve.distance[[rise.start, rise.stop - 1]]
            axes.plot(x, curve.force[rise.start] + row.k_eq * (x[0] - x), color="black", lw=1.6)
        fractions = [(name, *raft.competing_fraction(table, name)) for name in raft.JUDGEMENTS]
        print(f"{found}, k1 = {script.with_error(k1, error)} from k_eq, "
              + ", ".join(f"{name} {fraction:.2f} of {count}" for name, fraction, count in fractions if count))
        print(script.markdown(
            ["rows", "q/(p+1)", "k_eq", "F_max", "F_min", "distance", "peaks", "missing bonds", *raft.JUDGEMENTS],
            [[r.rows, f"{r.x:.3f}", script.with_error(r.k_eq, r.k_error), f"{r.F_max:.4f}", f"{r.F_min:.4f}",
              f"{r.distance:.4f}", r.peaks, f"{r.missing_bonds:.1f}",
              *({None: "–", True: "yes", False: "no"}[getattr(r, name)] for name in raft.JUDGEMENTS)]
             for r in table.itertuples()]))
    axes.axhline(0, color="0.6", lw=0.6, zorder=0)
    axes.set(xlabel=r"distance of the walls  $D/\langle R\rangle$", ylabel="force on the walls  $F$")
    if curve.distance[-1] < curve.distance[0]:
        axes.invert_xaxis()  # time runs to the right
    if len(runs) > 1:
        axes.legend()
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
