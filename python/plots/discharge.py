#!/usr/bin/python3
"""Discharge: the number left in the hopper, N(t), with the law dN/dt = -c0 sqrt(N - N_res) of summary.json."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np

from pliant import RunError, load_runs
from pliant import plotting, script
from pliant.flow import is_discharge
from pliant.scenarios import of_scenario

STEPS = 20  # of equal numbers of particles, for the local c0


@dataclass(frozen=True)
class Law:
    """N(t) = residue + (sqrt(start_count) - c0 (t - start)/2)^2, fitted from `start` to `end`."""

    c0: float
    c0_error: float
    start: float
    end: float
    start_count: float
    chi2_per_dof: float
    residue: int

    @classmethod
    def of(cls, run):
        """The law in summary.json; None if the run has not ended, or too early for a fit."""
        numbers = [*run.measured("c0"), *(run.measured(f"c0_{name}")[0]
                                          for name in ("start", "end", "start_count", "chi2_per_dof"))]
        known = np.isfinite([numbers[0], *numbers[2:5]]).all()
        return cls(*numbers, int(run.summary.get("c0_residue", 0))) if known else None

    def __call__(self, t):
        return self.residue + np.maximum(np.sqrt(self.start_count) - 0.5 * self.c0 * (t - self.start), 0) ** 2


def local_c0(time, left, residue):
    """(N, c0) where the number left falls in STEPS equal steps: -2 times the slope of sqrt(N - residue) in each."""
    edges = np.linspace(left[0], max(left[-1], residue), STEPS + 1)
    at = np.unique([np.argmax(left <= edge) for edge in edges])
    flowing, t = left[at] - residue, time[at]
    c0 = -2 * np.diff(np.sqrt(flowing)) / np.diff(t)
    return (left[at][1:] + left[at][:-1]) / 2, c0


def check(run):
    if not is_discharge(of_scenario(run, "hopper")):
        raise RunError(f"{run.path}: continuous flow, not a discharge (series.py draws its time series)")
    if len(run.series) < 2:
        raise RunError(f"{run.path}: {len(run.series)} samples are too few for N(t) (let it run longer)")


def main():
    parser = script.parser(__doc__, "discharge.py runs/discharge -o discharge.png", "discharge.png")
    parser.add_argument("run", nargs="+", help="run folders, with -flow discharge")
    arguments = script.arguments(parser)
    runs = load_runs(arguments.run)
    for run in runs:
        check(run)

    figure, (count, rate) = plt.subplots(1, 2, figsize=(9.2, 3.9), layout="constrained")
    rows = []
    for i, (run, label) in enumerate(zip(runs, plotting.run_labels(runs))):
        color = plotting.color(i)
        time, left = run.series["time"].to_numpy(), run.series["in_hopper"].to_numpy()
        law = Law.of(run)
        count.plot(time, left, color=color, lw=2.2, alpha=0.45, label=label if len(runs) > 1 else "$N$")
        rate.plot(*local_c0(time, left, law.residue if law else 0), "o-", color=color, lw=0.8, ms=3.5)
        if law is None:
            rows.append((run.path, "–", "–", "–", "–", f"{left[-1]:g}"))
            continue
        fitted = (time >= law.start) & (time <= law.end)
        count.plot(time[fitted], law(time[fitted]), color="black", lw=1.2)
        rest = time[time >= law.end]
        count.plot(rest, law(rest), ":", color="black", lw=1)
        numbers = law(np.array([law.start, law.end]))
        rate.fill_between(numbers, law.c0 - np.nan_to_num(law.c0_error), law.c0 + np.nan_to_num(law.c0_error),
                          color=color, alpha=0.25, lw=0)
        rate.plot(numbers, [law.c0] * 2, color="black", lw=1.2)
        rows.append((run.path, script.with_error(law.c0, law.c0_error), f"{law.start:.4g} … {law.end:.4g}",
                     f"{law.chi2_per_dof:.2g}", law.residue, f"{left[-1]:g}"))
    if any(row[1] != "–" for row in rows):
        count.plot([], [], color="black", lw=1.2, label="law, where it was fitted")
        count.plot([], [], ":", color="black", lw=1, label="law beyond")
    count.set(xlabel=r"time  $t/t_0$", ylabel="particles in the hopper  $N$", xlim=(0, None), ylim=(0, None))
    rate.set(xlabel="particles in the hopper  $N$", ylabel=r"$-\dot N/\sqrt{N - N_{res}}$  [$1/t_0$]", ylim=(0, None))
    rate.invert_xaxis()  # time runs to the right, as in the other panel
    count.legend()
    print(script.markdown(["run", "c0 [1/t0]", "fitted, t/t0", "chi2/dof", "N_res", "left"], rows))
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
