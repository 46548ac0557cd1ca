"""
Droplets in a raft
==================

Two walls compress a raft of attractive droplets. The force on the walls rises until bonds break, falls, and rises again, once for every row that is lost.
"""
import tempfile

import matplotlib.pyplot as plt
import numpy as np

import pliant
from pliant import raft_analysis

# %%
# Run
# ---
# The raft has three rows of four droplets. In the thesis of P. E. Illing (Emory University, chapter 2) rafts are larger and walls five times slower.
# Droplets have no inertia; PETSc's Runge-Kutta method with error control integrates their motion.
folder = tempfile.TemporaryDirectory()
run = pliant.raft(rows=3, columns=4, v_wall=5e-4, frame_interval=100, output=f"{folder.name}/raft", quiet=True)
series = run.series
force = (series["fixed_wall_force"] + series["moving_wall_force"]) / 2

# %%
# Known answers
# -------------
# The stiffness of a pair of droplets follows from the depletion potential: the program and ``raft_analysis`` compute it independently. The work of the walls
# must appear as energy or heat.
potential = {name: run.parameters[name] for name in ("f0", "phi_c", "a_s")}
k1, known = run.summary["k1"], raft_analysis.contact_constants(**potential)["k1"]
print(f"k1 = {k1:.6f}, from the potential: {known:.6f}")
print(f"budget: work {run.summary['work']:.5f}, dissipated {run.summary['dissipated']:.5f}, error {run.summary['budget_error']:.1e}")

# %%
# First peak
# ----------
# Before the first fracture the raft is a spring: the slope of the force at F = 0 is its stiffness. A hexagonal lattice of linear
# springs has nearly the same stiffness; the error of the fit excludes drag, which adds to the force because the walls move fast.
distance = series["wall_distance"]
peak = int(force[: int(0.4 * len(force))].idxmax())
near = np.flatnonzero((abs(force[:peak]) < force[peak] / 5) & (distance[:peak] < distance[int(force[:peak].idxmin())]))
(slope, _), covariance = np.polyfit(distance.iloc[near], force.iloc[near], 1, cov=True)
lattice = raft_analysis.lattice_k1(3, 4, run.summary["k1"], run.summary["k_wall"]) * 4 / (3 + 1)
print(f"stiffness at F = 0: {-slope:.4f} ± {covariance[0, 0] ** 0.5:.4f}, lattice of springs: {lattice:.4f}")
print(f"first peak: F = {force[peak]:.4f} at a distance of {distance[peak]:.3f} R; {run.summary['broken']} bonds broke in all")

# %%
# Picture
# -------
figure = plt.figure(figsize=(9, 5), layout="constrained")
top, bottom = figure.subfigures(2, 1)
for ax, k in zip(top.subplots(1, 3), (0, len(run.frames) // 2, -1)):
    run.draw(k, color="contacts", axes=ax)
    ax.set_title(f"t = {run.frames[k].time:.0f}")
ax = bottom.subplots()
ax.plot(distance, force)
ax.plot(distance[peak], force[peak], "o")
ax.axhline(0, color="0.8", zorder=0)
ax.invert_xaxis()
ax.set(xlabel=r"distance of the walls / $\langle R\rangle$", ylabel="force on the walls")
figure.savefig("raft.png")
