#!/usr/bin/python3
"""Stiffness and peak force of all reductions of many rafts: k_eq against q/(p+1), F_max/N against (p³+p²)^(-1/2)."""

import sys
from pathlib import Path

# In place of this folder, whose profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first: it says what this Python lacks

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from pliant import RunError, load_runs, plotting, raft, script


def main():
    parser = script.parser(__doc__, "raft_scaling.py runs/raft-* -o scaling.png", "raft_scaling.png")
    parser.add_argument("run", nargs="+", help="run folders, or folders of runs")
    arguments = script.arguments(parser)
    curves = [raft.Compression.of(run) for run in load_runs(arguments.run)]
    tables = [c.reductions().assign(n=c.n) for c in curves]
    all_of_them = pd.concat([t for t in tables if len(t)], ignore_index=True) if any(map(len, tables)) else None
    if all_of_them is None:
        raise RunError("no run has completed a reduction of rows")
    k1, error = raft.fit_k1(all_of_them)
    print(f"k1 = {script.with_error(k1, error)} from {len(all_of_them)} reductions of {len(curves)} runs")

    figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 4.0), layout="constrained")
    for (n, table), marker, color in zip(all_of_them.groupby("n"), plotting.MARKERS * 9, plotting.COLORS * 9):
        left.errorbar(table["x"], table["k_eq"], table["k_error"], fmt=marker, color=color, label=f"$N = {n}$")
        p = table["rows"]
        right.plot((p**3 + p**2) ** -0.5, table["F_max"] / n, marker, color=color, label=f"$N = {n}$")
    x = np.array([0, all_of_them["x"].max()])
    left.plot(x, k1 * x, color="black", label=f"$k_1 = {k1:.2f}$")
    left.plot(x, curves[0].k1 * x, "--", color="0.5", label=f"two droplets, $k_1 = {curves[0].k1:.2f}$")
    left.set(xlabel="$q/(p+1)$", ylabel="$k_{eq}$")
    u = np.array([0, ((all_of_them["rows"] ** 3 + all_of_them["rows"] ** 2) ** -0.5).max()])
    right.plot(u, 2 * np.sqrt(curves[0].k1 * curves[0].E1) * u, "--", color="0.5", label=r"$2\sqrt{k_1E_1/(p^3+p^2)}$")
    right.set(xlabel="$(p^3+p^2)^{-1/2}$", ylabel="$F_{max}/N$")
    for axes in (left, right):
        axes.legend()
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
