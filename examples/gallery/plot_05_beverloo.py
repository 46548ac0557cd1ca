"""
A sweep and the Beverloo law
============================

The flow rate of a hopper follows Q = C (w/σ_avg − k)^β. For disks, Cheng et al. (Soft Matter, 2022) report β = 1/2 if a fluid exerts drag and no friction
acts, and β = 3/2 if only friction acts. Six runs of soft disks with drag determine β with its error.
"""
import tempfile

import matplotlib.pyplot as plt
import numpy as np

import pliant
from pliant import beverloo

# %%
# Sweep
# -----
# For six runs a loop is enough. Q_error is NaN where the blocks of a run disagree too much for an error; the fit then uses the median relative error.
# For large tables use ``pliant-sweep``, which runs them on all cores and resumes after an interruption.
folder = tempfile.TemporaryDirectory()
widths = [2.5, 3, 4, 5, 6, 8]
runs = [pliant.hopper(n=400, hopper_wall_distance=25, hopper_width=w, zeta=2, t_end=150, output=f"{folder.name}/w{w}", quiet=True) for w in widths]
table = pliant.sweep_table(runs)
print(table[["hopper_width", "Q", "Q_error"]].to_string(index=False))

# %%
# Fit
# ---
# ``fit_beverloo`` fits C, k and β with weights 1/error². χ² per degree of freedom near 1 would mean that the law describes the data within their errors. The
# container is small, so β can deviate from the published 1/2 by more than its error.
fit = beverloo.fit_beverloo(table["hopper_width"], table["Q"], table["Q_error"])
print(f"beta = {fit.beta:.2f} ± {fit.beta_error:.2f} (published: 0.5), k = {fit.k:.2f} ± {fit.k_error:.2f}, chi2/dof = {fit.chi2_reduced:.2f}")

# %%
# Picture
# -------
# The right panel shows the same data against w − k on logarithmic axes, where β is the slope.
w = np.linspace(fit.k, 8.5, 200)
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
for ax, shift in ((left, 0), (right, fit.k)):
    ax.errorbar(table["hopper_width"] - shift, table["Q"], table["Q_error"], fmt="o", capsize=3, label="simulation")
    ax.plot(w - shift, beverloo.beverloo(w, fit.C, fit.k, fit.beta), label=rf"fit, $\beta$ = {fit.beta:.2f} ± {fit.beta_error:.2f}")
left.set(xlabel=r"$w/\sigma_{avg}$", ylabel=r"Q [$\sigma_{avg}^2/t_0$]", xlim=0, ylim=0)
right.set(xlabel=r"$w/\sigma_{avg} - k$", xscale="log", yscale="log", xlim=(0.8, 8.5), ylim=(1, 4.5))
for axis in (right.xaxis, right.yaxis):
    axis.set_major_locator(plt.FixedLocator([1, 2, 4, 8]))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(plt.NullFormatter())
left.legend()
figure.savefig("beverloo.png")
