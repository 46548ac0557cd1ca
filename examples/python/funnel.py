"""Disks soften while they flow around a pillar in a funnel: a picture (funnel.png), and the flow rate with its error."""
import itertools

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection

import pliant

funnel = pliant.Container.outline([(-2.5, 0), (-4, 4), (-8, 8)], [(2.5, 0), (4, 4), (8, 8)], [("disk", (0, 7.5), 1.2)])
sizes = pliant.diameters(200)
sim = pliant.Simulation(funnel.pack(sizes), sizes, walls=funnel, gravity=(0, -1), e_sp=1000, zeta=0.3)
time, fallen, columns = [0.0], [0.0], itertools.cycle(np.arange(-7, 7.1, 1.4))


@sim.every(1)
def soften(sim):
    if sim.t < 31:
        sim.set(e_sp=1000 - 30 * sim.t)


@sim.every(0.1)
def reinsert(sim):
    low = np.flatnonzero(sim.positions[:, 1] < -2)
    for k in low:
        x = next(columns)
        near = sim.positions[abs(sim.positions[:, 0] - x) < 1.5, 1]  # in this column
        sim.positions[k], sim.velocities[k] = (x, max(25, near.max(initial=0) + 1.5)), (0, -3)
    time.append(sim.t), fallen.append(fallen[-1] + np.pi / 4 * np.sum(sizes[low] ** 2))


sim.run(130)
first = np.searchsorted(time, 40)
Q, error = pliant.flow_rate(time[first:], fallen[first:])
print(f"e_sp = {sim.options['e_sp']:.0f}: Q = {Q:.2f} ± {error:.2f} sigma_avg^2/t0")
axes = plt.figure(figsize=(4, 5)).add_subplot(aspect="equal", xlim=(-9, 9), ylim=(-3, 26), title=f"Q = {Q:.2f} ± {error:.2f}")
axes.add_collection(EllipseCollection(sizes, sizes, 0, units="xy", offsets=sim.positions, transOffset=axes.transData))
axes.add_collection(LineCollection(np.minimum(sim.wall_segments, 30).reshape(-1, 2, 2), colors="black"))
axes.add_patch(plt.Circle((0, 7.5), 1.2, color="black"))
plt.savefig("funnel.png", dpi=150)
