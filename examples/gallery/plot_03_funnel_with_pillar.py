"""
A funnel of your own shape with a pillar
========================================

Does a pillar above the outlet slow a flow down? Two simulations of soft disks in a curved funnel, with and without a pillar, give the ratio of the flow rates
with its error.
"""
import itertools

import matplotlib.pyplot as plt
import numpy as np

import pliant

# %%
# Container
# ---------
# Two polylines begin at the ends of the orifice, at y = 0. Above their last points the walls continue vertically.
y = np.linspace(0, 8, 9)
x = 2 + 6 * (y / 8) ** 2
left, right = np.stack([-x, y], axis=1), np.stack([x, y], axis=1)
pillar = ("disk", (0, 4.5), 1.3)


def flow(obstacles):
    """(simulation at its end, flow rate, its standard error)"""
    funnel = pliant.Container.outline(left, right, obstacles)
    sizes = pliant.diameters(200)
    sim = pliant.Simulation(funnel.pack(sizes), sizes, walls=funnel, gravity=(0, -1), e_sp=500, zeta=0.5)
    time, fallen, columns = [0.0], [0.0], itertools.cycle(np.arange(-7, 7.1, 1.4))

    @sim.every(0.1)
    def reinsert(sim):
        low = np.flatnonzero(sim.positions[:, 1] < -2)
        for k in low:  # writing to the arrays moves the disks
            x = next(columns)
            near = sim.positions[abs(sim.positions[:, 0] - x) < 1.5, 1]  # in this column; the disk goes above the highest of them
            sim.positions[k], sim.velocities[k] = (x, max(24, near.max(initial=0) + 1.5)), 0
        time.append(sim.t)
        fallen.append(fallen[-1] + np.pi / 4 * np.sum(sizes[low] ** 2))

    sim.run(100)
    steady = np.searchsorted(time, 20)
    return sim, *pliant.flow_rate(time[steady:], fallen[steady:])


results = {"without pillar": flow([]), "with pillar": flow([pillar])}

# %%
# Result
# ------
# ``pliant.flow_rate`` averages over blocks, like the program. The two runs are independent, so their relative errors add in squares.
(_, Q0, e0), (_, Q1, e1) = results.values()
ratio = Q1 / Q0
print(f"Q = {Q0:.2f} ± {e0:.2f} without and {Q1:.2f} ± {e1:.2f} with the pillar")
print(f"ratio {ratio:.3f} ± {ratio * np.hypot(e0 / Q0, e1 / Q1):.3f}")

figure, axes = plt.subplots(1, 2, figsize=(8, 4.5), layout="constrained")
for ax, (name, (sim, Q, error)) in zip(axes, results.items()):
    ax.set(aspect="equal", xlim=(-9, 9), ylim=(-2.5, 18), title=f"{name}:  Q = {Q:.2f} ± {error:.2f}")
    speed = np.linalg.norm(sim.velocities, axis=1)
    for position, d, v in zip(sim.positions, sim.diameters, speed):
        ax.add_patch(plt.Circle(position, d / 2, color=plt.cm.viridis(min(v / 3, 1))))
    for (x1, y1, x2, y2), radius in zip(sim.wall_segments, sim.wall_radius):
        if radius:
            ax.add_patch(plt.Circle((x1, y1), radius, color="black"))
        else:
            ax.plot([x1, x2], [y1, min(y2, 18)], color="black")
figure.colorbar(plt.cm.ScalarMappable(plt.Normalize(0, 3)), ax=axes, label="speed", extend="max")
figure.savefig("funnel_with_pillar.png")
