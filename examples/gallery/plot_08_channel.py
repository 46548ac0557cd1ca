"""
Disks in a bent channel
=======================

A plunger pushes frictional disks on a substrate around the corner of an L-shaped channel. We measure the work of the plunger, the heat of each kind of friction,
and the deviation of single disks from a smooth flow.
"""
import tempfile

import matplotlib.pyplot as plt
import numpy as np

import pliant
from pliant import analysis

# %%
# Run
# ---
# Units are cm, g and s. In the experiment (P. E. Illing's thesis, Emory University, chapter 3) the plunger is 70 times slower, and the disks are smaller
# and more numerous.
folder = tempfile.TemporaryDirectory()
run = pliant.channel(radii=[1.6, 1.1], counts=[1, 1], area_fraction=0.74, pushes=1, plunger_speed=15,
                     output=f"{folder.name}/channel", quiet=True)

# %%
# Energy
# ------
# The work of the plunger is dissipated by sliding and damping. Their sum is the known answer for the work, up to the kinetic and elastic energy at the end.
last = run.series.iloc[-1]
causes = {"substrate": last.filter(like="base_friction").sum(), "sliding contacts": last.filter(like="contact_sliding").sum(),
          "collisions": last.filter(like="damping").drop("base_friction_damping").sum()}
print("heat:", ", ".join(f"{name} {100 * heat / last['heat']:.1f} %" for name, heat in causes.items()))
balance = (last["plunger_work"] - last["heat"] - last["kinetic_energy"] - last["elastic_energy"]) / last["plunger_work"]
print(f"work {last['plunger_work']:.4g} erg, relative error of the balance {balance:.1e}")

# %%
# Motion
# ------
# The motion of the neighbours of a disk is compared with the local strain that fits it best. D²_min is the mean square of the differences, here over half
# of the push.
frames = run.frames
before, after = frames[len(frames) // 4], frames[3 * len(frames) // 4]
d2, count = analysis.d2_min(before, after)
moved = np.linalg.norm(after.displacements(before), axis=1)
root = np.sqrt(d2 / count)
corner = np.linalg.norm(after.centres - [10, 10], axis=1) < 10
for name, chosen in (("in the bend", corner), ("in the arms", ~corner)):
    values = root[chosen & np.isfinite(root)]
    print(f"non-affine displacement {name}: {values.mean():.3f} ± {values.std(ddof=1) / len(values)**0.5:.3f} cm")

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4.2), layout="constrained")
run.draw(after, axes=left)
radius = run.topology.sigma / 2
for ax_position, r, value in zip(after.centres, radius, root):
    right.add_patch(plt.Circle(ax_position, r, color=plt.cm.magma(min(value / np.nanquantile(root, 0.95), 1))))
right.quiver(*after.centres.T, *after.displacements(before).T, angles="xy", scale_units="xy", scale=1, width=0.004, color="tab:cyan")
right.set(aspect="equal", xlim=left.get_xlim(), ylim=left.get_ylim(), xlabel="x/cm", title="displacement, and its non-affine part (bright)")
figure.savefig("channel.png")
