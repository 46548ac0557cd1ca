"""
ParaView and OVITO
==================

``pliant.exchange`` writes runs for OVITO (extended XYZ, LAMMPS dump) and ParaView (VTK), with columns of your own, and reads them back. We export a flow together
with the hexagonal order of each disk.
"""
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import pliant
from pliant import analysis, exchange

# %%
# Run
# ---
# Disks of nearly one size order themselves in layers at the walls.
folder = Path(tempfile.mkdtemp())
run = pliant.hopper(n=300, size_distribution="normal", size_deviation=0.03, hopper_wall_distance=18, hopper_width=5, zeta=2, t_end=30,
                    frame_interval=3, output=folder / "run", quiet=True)

# %%
# Export
# ------
# The third argument of ``write`` computes further columns from each frame: here the absolute value of ψ6, which is 1 in a hexagonal lattice.


def order(frame):
    return {"psi6": abs(analysis.bond_order(frame))}


for name, program in (("flow.xyz", "OVITO, ASE"), ("flow.dump", "OVITO, LAMMPS"), ("flow.pvd", "ParaView")):
    exchange.write(run, folder / name, order)
    size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file() and path.name.startswith("flow") and path.suffix != ".h5")
    print(f"{name:9} for {program:13} written, {size / 1e6:.1f} MB in all")

# %%
# In OVITO use *File, Load File*, then *Color coding* by ``psi6``. In ParaView open ``flow.pvd`` and add a *Glyph* filter with the sphere scaled by the
# diameter. ParaView also opens ``run.xdmf`` in the folder of the run without an export.
#
# Round trip
# ----------
# Times, positions and velocities keep all digits: the known answer is a difference of 0.
frames = exchange.read(folder / "flow.xyz")
present = run.frames[-1].active
difference = np.abs(frames[-1].positions - run.frames[-1].centres[present]).max()
print(f"{len(frames)} frames read, largest difference of a position: {difference}")

# %%
# Order
# -----
# Frames 3 t0 apart count as independent: in this time the flow renews the disks near the orifice. If frames are closer in time, use ``pliant.block_average``.
values = [np.nanmean(order(frame)["psi6"]) for frame in run.frames[2:]]
print(f"mean |psi6| = {np.mean(values):.3f} ± {np.std(values, ddof=1) / len(values) ** 0.5:.3f} over {len(values)} frames, 3 t0 apart")

part = frames[-1]
psi6 = abs(analysis.bond_order(part))
figure, ax = plt.subplots(figsize=(5.5, 4.5), layout="constrained")
for position, radius, value in zip(part.positions, part.radii, psi6):
    ax.add_patch(plt.Circle(position, radius, color=plt.cm.viridis(0.0 if np.isnan(value) else value)))
ax.set(aspect="equal", xlim=(-9.5, 9.5), ylim=(-2, part.positions[:, 1].max() + 1), xlabel=r"$x/\sigma_{avg}$", title="read from flow.xyz")
figure.colorbar(plt.cm.ScalarMappable(), ax=ax, label=r"$|\psi_6|$")
figure.savefig("paraview_and_ovito.png")
