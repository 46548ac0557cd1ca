#!/usr/bin/python3
"""Fractures of many rafts: excess peaks against phi, peaks against delta, competing fractures against N, q/p and tilt.

Runs that differ in nothing but the seed are averaged; bars are standard errors. Runs that differ in other options are
separate series.
"""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt

from pliant import load_runs, plotting, pooling, raft_analysis as raft, raft_figures, script, symbols


def main():
    parser = script.parser(__doc__, "raft_fractures.py size runs/square-* -o competing.png", "raft_fractures.png")
    parser.add_argument("figure", choices=raft_figures.FRACTURES, help="figure to draw")
    parser.add_argument("run", nargs="+", help="run folders, or folders of runs")
    parser.add_argument("--judgement", choices=raft.JUDGEMENTS, default="competing",
                        help="rule for competing fractures: the raft has holes (default), fractures overlap, or overlapping "
                             "fractures never meet")
    arguments = script.arguments(parser)
    runs, table = pooling.distinct_runs(load_runs(arguments.run), "raft")
    data = raft.fractures(runs).assign(series=pooling.series(table, "raft", raft_figures.VARIABLES))
    points, settings, y = raft_figures.fracture_points(data, arguments.figure, arguments.judgement)

    figure, axes = plt.subplots(figsize=(5.6, 4.0), layout="constrained")
    for name, peak, error in raft_figures.draw_fractures(axes, points, arguments.figure, y):
        print(f"{name}: peak of the excess {script.with_error(peak, error)}")
    print(script.markdown([*settings, y, "error", "runs"],
                          [[symbols.plain(r[c]) if c == "series" else f"{r[c]:.4g}" for c in settings] + [f"{r[y]:.4g}", f"{r[y + '_error']:.2g}", int(r["runs"])]
                           for _, r in points.iterrows()]))
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
