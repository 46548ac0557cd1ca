#!/usr/bin/python3
"""Density of states and participation ratios of the vibrational modes of packings; of an ensemble or several runs the mean."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt
import numpy as np

from pliant import Ensemble, Run, RunError
from pliant import plotting, pooling, script
from pliant.scenarios import of_scenario

ZERO = 1e-6  # part of the highest frequency, below which a mode counts as a zero mode


def runs_of(path):
    """The run of a folder, or the runs of an ensemble."""
    return list(Ensemble(path)) if (Path(path) / "ensemble.h5").exists() else [Run(path)]


def last_modes(run):
    """(frequencies, participation ratios) of the last packing of a run, of all its modes."""
    of_scenario(run, "pack", "shear")
    if "frequencies" not in run.vector_series:
        raise RunError(f"{run.path}: the series has no frequencies: run pack with -modes")
    omega, ratio = (run.vector_series[name][-1] for name in ("frequencies", "participation"))
    found = np.isfinite(omega)
    if not found.any():
        raise RunError(f"{run.path}: the last packing has no modes, because nothing holds it up")
    points = len(run.topology.diameter) if run.topology.deformable else run.topology.particles
    backbone = run.summary["backbone"] if run.summary else run.topology.particles
    wanted = points // run.topology.particles * backbone * run.dim
    if found.sum() < wanted:
        raise RunError(f"{run.path}: {found.sum()} of {wanted} modes: the density of states needs all of them, -modes {wanted}")
    return omega[found], ratio[found]


def main():
    parser = script.parser(__doc__, "density_of_states.py runs/packing -o states.png", "states.png")
    parser.add_argument("run", nargs="+", help="folders of runs of pack or shear with all modes, or of ensembles of them")
    parser.add_argument("--bins", type=int, default=40, help="bins of the frequency (default: 40)")
    arguments = script.arguments(parser)
    if arguments.bins < 1:
        raise RunError(f"--bins {arguments.bins}: give 1 or more")
    runs = [run for path in arguments.run for run in runs_of(path)]
    runs, table = pooling.distinct_runs(runs, "pack", "shear")
    pooling.check(table, runs[0].scenario)
    found = [last_modes(run) for run in runs]
    highest = max(omega.max() for omega, _ in found)
    edges = np.linspace(0, highest, arguments.bins + 1)
    middle, width = (edges[1:] + edges[:-1]) / 2, edges[1] - edges[0]
    positive = [omega > ZERO * highest for omega, _ in found]
    density = np.array([np.histogram(omega[up], edges)[0] / (len(omega) * width) for (omega, _), up in zip(found, positive)])
    omega = np.concatenate([omega[up] for (omega, _), up in zip(found, positive)])
    ratio = np.concatenate([ratio[up] for (_, ratio), up in zip(found, positive)])

    figure, (upper, lower) = plt.subplots(2, 1, figsize=(5.6, 5.2), sharex=True, layout="constrained")
    mean = density.mean(0)
    upper.stairs(mean, edges, color="C0", linewidth=1.4)
    if len(density) > 1:
        error = density.std(0, ddof=1) / np.sqrt(len(density))
        upper.errorbar(middle, mean, error, fmt="none", ecolor="C0", elinewidth=0.8)
    zero = sum(len(omega) - up.sum() for (omega, _), up in zip(found, positive)) / len(found)
    upper.set(ylabel=r"density of states  $D(\omega)$", ylim=(0, None),
              title=f"{len(found)} packing{'s' if len(found) > 1 else ''},  {zero:.3g} zero or unstable modes{' each' if len(found) > 1 else ''}")
    lower.plot(omega, ratio, ".", color="C1", markersize=3, alpha=0.6)
    lower.set(xlabel=r"$\omega$  [$(\epsilon/\rho)^{1/2}\,\sigma_{avg}^{-1-d/2}$]", ylabel="participation ratio", ylim=(0, 1))
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
