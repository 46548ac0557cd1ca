"""
A first flow
============

300 soft disks flow out of a hopper against the drag of a fluid. We measure the flow rate with its error, and check the balance of energy.

Lengths are in mean diameters σ_avg, times in t0 = √(σ_avg/g), and the density of the particles is 1.
"""
import tempfile

import matplotlib.pyplot as plt

import pliant

# %%
# Run
# ---
# ``pliant.hopper`` takes the options of the program as keywords. It packs the disks, simulates them, and reinserts at the top each disk
# that has fallen through the orifice, so that the flow can become steady. All results go into a folder, here a temporary one.
folder = tempfile.TemporaryDirectory()
run = pliant.hopper(n=300, hopper_wall_distance=20, hopper_width=5, zeta=2, t_end=200, output=f"{folder.name}/first", quiet=True)

# %%
# Flow rate
# ---------
# The program discards the start-up, and takes the error from averages over blocks of the remaining time. LAMMPS leaves both to the user.
Q, error = run.measured("Q")
print(f"Q = {Q:.2f} ± {error:.2f} sigma_avg^2/t0, averaged from t = {run.steady_start:.1f} t0 on")

# %%
# Energy
# ------
# The energy includes the potential energy of gravity. Its change must equal the work of reinserting disks minus the heat of the drag. The run computes
# all three numbers, so the relative error of this balance is the error of the integrator, ± the sampling error of the heat; the known answer is 0.
audit = run.summary["energy_audit"]
print(f"relative error of the energy balance: {audit['relative_error']:.1e} ± {audit['uncertainty']:.1e}")

# %%
# Picture
# -------
# A steady flow crosses the orifice at a constant rate: the area that has left grows along a straight line.
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained", width_ratios=[1, 1.1])
run.draw(axes=left)
series = run.series
right.plot(series["time"], series["crossed_area"], label="simulation")
start = series["time"] >= run.steady_start
origin = series["crossed_area"][start].iloc[0] - Q * run.steady_start
right.plot(series["time"], origin + Q * series["time"], "--", label=f"slope Q = {Q:.2f} ± {error:.2f}")
right.axvline(run.steady_start, color="0.7")
right.set(xlabel="$t/t_0$", ylabel=r"area through the orifice [$\sigma_{avg}^2$]")
right.legend()
figure.savefig("first_flow.png")
