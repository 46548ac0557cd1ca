"""
Statistics of clogs
===================

Attractive droplets in a wedge either flow out or form an arch. Each run has one outcome, so a probability needs many runs. We vary the width of the exit and fit
a sigmoid to the outcomes, with binomial errors.
"""
import tempfile

import matplotlib.pyplot as plt
import numpy as np

import pliant
from pliant import clog_analysis

# %%
# Runs
# ----
# 30 droplets make short runs; the scenario has 190 by default. The unit of length is the mean radius, and widths are in mean diameters.
folder = tempfile.TemporaryDirectory()
widths, seeds = [2.2, 2.6, 3.0, 3.4], range(1, 7)
folders = []
for w in widths:
    for seed in seeds:
        folders.append(f"{folder.name}/w{w}-{seed}")
        pliant.clog(n=30, phi_c=1e-4, hopper_width=w, seed=seed, output=folders[-1], quiet=True)

# %%
# Probabilities
# -------------
# ``clog_points`` counts clogs at each width, with Wilson's interval, because 0 of 6 clogs does not mean P = 0 ± 0. The column ``s`` is the mean number of
# droplets that leave.
table, _ = clog_analysis.load_clogs(folders)
points = clog_analysis.clog_points(table)
print(points[["hopper_width", "runs", "clogged", "P", "P_low", "P_high", "s", "s_error"]].round(2).to_string(index=False))

# %%
# Fit
# ---
# The sigmoid P = 1/(1 + exp((w − w*)/α)) is fitted by maximum likelihood. w* is the width at which half of the hoppers clog.
fit = clog_analysis.fit_sigmoids(points, "hopper_width").iloc[0]
print(f"w* = {fit.x0:.2f} ± {fit.x0_error:.2f} diameters, alpha = {fit.alpha:.2f} ± {fit.alpha_error:.2f}  {fit.note}")

# %%
# Picture
# -------
clogged = next(run for run in map(pliant.Run, folders) if run.summary["status"] == "clogged")
w = np.linspace(widths[0] - 0.1, widths[-1] + 0.1, 200)
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
clogged.draw(color="contacts", axes=left)
right.errorbar(points["hopper_width"], points["P"], [points["P"] - points["P_low"], points["P_high"] - points["P"]], fmt="o", capsize=3)
right.plot(w, clog_analysis.sigmoid(w, fit.x0, fit.alpha))
right.axvline(fit.x0, color="0.7", ls="--")
right.set(xlabel="width of the exit / diameter", ylabel="probability of a clog", title=f"$w^*$ = {fit.x0:.2f} ± {fit.x0_error:.2f}")
figure.savefig("clogging.png")
