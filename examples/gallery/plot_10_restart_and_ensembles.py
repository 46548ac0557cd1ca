"""
Restart and ensembles
=====================

A restarted run must equal an uninterrupted run, and the error of one run should agree with the scatter between seeds. We check both with short flows.
"""
import tempfile

import matplotlib.pyplot as plt
import numpy as np

import pliant
from pliant import ensemble

folder = tempfile.TemporaryDirectory()
flow = dict(n=200, hopper_wall_distance=15, hopper_width=4, zeta=1, quiet=True)

# %%
# Restart
# -------
# ``restart=`` reads all options from the folder of a run; ``output=`` makes a branch in another folder and leaves the old one as it is.
whole = pliant.hopper(**flow, t_end=40, output=f"{folder.name}/whole")
pliant.hopper(**flow, t_end=20, output=f"{folder.name}/half")
branch = pliant.hopper(restart=f"{folder.name}/half", t_end=40, output=f"{folder.name}/branch", quiet=True)
difference = np.abs(whole.frames[-1].positions - branch.frames[-1].positions).max()
print(f"largest difference of a position between the whole run and the branch: {difference} (expected: 0)")

# %%
# Ensemble
# --------
# Eight seeds give eight packings. Each run has an error from averages over blocks; the standard deviation of the eight results is an independent estimate.
runs = [pliant.hopper(**flow, t_end=80, seed=seed, output=f"{folder.name}/seed{seed}") for seed in range(1, 9)]
table = pliant.sweep_table(runs)
blocks = np.sqrt(np.mean(table["Q_error"] ** 2))
scatter = table["Q"].std(ddof=1)
print(f"error of one run: {blocks:.3f} from blocks, {scatter:.3f} ± {scatter / np.sqrt(2 * (len(table) - 1)):.3f} from the scatter of the seeds")

# %%
# ``ensemble.average`` combines both errors: the function uses the scatter, and enlarges block errors that are too small.
mean = ensemble.average(table, ["hopper_width"], "Q").iloc[0]
print(f"Q = {mean['Q']:.3f} ± {mean['Q_error']:.3f} sigma_avg^2/t0, average of {mean['runs']} runs")

# %%
# Picture
# -------
# Some runs are too short to estimate an error of Q; their points have no bar. The scatter between the seeds gives the error of the average.
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
for run in runs:
    left.plot(run.series["time"], run.series["crossed_area"] - mean["Q"] * run.series["time"], lw=1)
left.plot(whole.series["time"], whole.series["crossed_area"] - mean["Q"] * whole.series["time"], color="black", label="whole")
left.plot(branch.series["time"], branch.series["crossed_area"] - mean["Q"] * branch.series["time"], "--", color="tab:orange", label="branch")
left.axvline(20, color="0.7")
left.set(xlabel="$t/t_0$", ylabel=r"crossed area $- \langle Q\rangle\, t$ [$\sigma_{avg}^2$]")
left.legend()
right.errorbar(table["seed"], table["Q"], table["Q_error"], fmt="o", capsize=3)
right.axhspan(mean["Q"] - mean["Q_error"], mean["Q"] + mean["Q_error"], color="tab:orange", alpha=0.4, lw=0)
right.set(xlabel="seed", ylabel=r"Q [$\sigma_{avg}^2/t_0$]", title=f"Q = {mean['Q']:.3f} ± {mean['Q_error']:.3f}")
figure.savefig("restart_and_ensembles.png")
