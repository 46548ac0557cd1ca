#!/usr/bin/python3
"""Stiffness and peak force of all reductions of many rafts: k_eq against q/(p+1), F_max/N against (p³+p²)^(-1/2)."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt
import pandas as pd

from pliant import RunError, load_runs, plotting, pooling, raft_analysis as raft, raft_figures, script


def main():
    parser = script.parser(__doc__, "raft_scaling.py runs/raft-* -o scaling.png", "raft_scaling.png")
    parser.add_argument("run", nargs="+", help="run folders, or folders of runs")
    arguments = script.arguments(parser)
    runs, table = pooling.distinct_runs(load_runs(arguments.run), "raft")
    curves = [raft.Compression.of(run) for run in runs]
    pooling.check(table, "raft", ("rows", "columns", "n", "rows_end", "start_distance", "end_distance"))
    tables = [c.reductions().assign(n=c.n, k1=c.k1, E1=c.E1) for c in curves]
    all_of_them = pd.concat([t for t in tables if len(t)], ignore_index=True) if any(map(len, tables)) else None
    if all_of_them is None:
        raise RunError("no run has completed a reduction of rows")
    k1, error = raft.fit_k1(all_of_them)
    print(f"k1 = {script.with_error(k1, error)} from {len(all_of_them)} reductions of {len(curves)} runs")

    figure, (left, right) = plt.subplots(1, 2, figsize=(plotting.PAGE, 4.0), layout="constrained")
    raft_figures.draw_stiffness(left, all_of_them, k1)
    raft_figures.draw_peaks(right, all_of_them)
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
