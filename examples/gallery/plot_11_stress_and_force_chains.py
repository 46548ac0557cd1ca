"""
Stress and force chains
=======================

Soft disks settle in a periodic box on a floor. At rest the vertical stress at a height carries the weight above it, which tests the coarse-grained stress. Then we
find the force chains.
"""
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
from scipy.special import ndtr

import pliant
from pliant import analysis

# %%
# Settle
# ------
# 400 disks rain down in a box that is periodic along x, with drag. ``minimize`` removes the remaining motion.
rng = np.random.default_rng(1)
length, n = 20.0, 400
sizes = pliant.diameters(n)
x = np.stack(np.meshgrid(np.arange(0.75, length, 1.25), 1 + 1.25 * np.arange(25)), axis=-1).reshape(-1, 2)[:n]
walls = pliant.Walls()
walls.half_space((0, 0), (0, 1))
sim = pliant.Simulation(x + rng.uniform(-0.02, 0.02, x.shape), sizes, walls=walls, box=(length, None), gravity=(0, -1), e_sp=2000, e_w=2000, zeta=0.5)
sim.run(60)
rest = sim.minimize(force_tolerance=1e-7)
print(f"largest force at rest: {rest.max_force:.1e} of the weight of a disk of about {sim.masses.mean():.2f}")

# %%
# Stress
# ------
# ``analysis.Particles`` takes arrays; frames of runs work in the same way. ``coarse_grained`` smooths the stress with a Gaussian.
contacts = sim.contacts
part = analysis.Particles(sim.positions, radii=sizes / 2, box=[length, np.inf], velocities=0 * sim.velocities, masses=sim.masses,
                          pairs=contacts[["particle_1", "particle_2"]].to_numpy(), forces=contacts[["fx", "fy"]].to_numpy(),
                          points=contacts[["x", "y"]].to_numpy())
width = 0.7
fields = analysis.coarse_grained(part, width=width, spacing=0.25)
height = fields.axes[1]
vertical = fields.stress[..., 1, 1].mean(axis=0)
above = (sim.masses * ndtr((sim.positions[:, 1] - height[:, None]) / width)).sum(axis=1) / length  # weight of the smoothed masses above
inner = (height > 4 * width) & (above > 0.5)                                                       # the floor bears weight below
deviation = vertical[inner] / above[inner] - 1
print(f"vertical stress / weight above: {1 + deviation.mean():.4f} ± {deviation.std() / np.sqrt(inner.sum()):.4f} (expected: 1)")

# %%
# Force chains
# ------------
# A chain joins neighbours whose largest principal stress is above average, each within 45° of the other's axis of stress [Peters et al. 2005].
chains = analysis.force_chains(part)
print(f"{len(chains.lengths)} chains, mean length {chains.lengths.mean():.1f} ± {chains.lengths.std(ddof=1) / len(chains.lengths) ** 0.5:.1f} disks")
coordination, rattlers = analysis.mean_coordination(part)
print(f"mean coordination {coordination:.2f}, share of rattlers {rattlers:.2f}")

# %%
# Picture
# -------
# Lines join the centres of touching disks, with a width that grows with the force.
pressure = analysis.pressure(analysis.particle_stress(part))
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4.4), layout="constrained", width_ratios=[1.2, 1])
for (cx, cy), d, p in zip(sim.positions, sizes, pressure):
    left.add_patch(plt.Circle((cx, cy), d / 2, color=plt.cm.Blues(0.1 + 0.7 * min(p / np.quantile(pressure, 0.98), 1))))
pairs, forces, branch = analysis.pair_forces(part)
start = sim.positions[pairs[:, 0]]
size = np.linalg.norm(forces, axis=1)
left.add_collection(LineCollection(np.stack([start, start - branch], axis=1), linewidths=4 * size / size.max(), colors="tab:red"))
left.set(aspect="equal", xlim=(0, length), ylim=(-0.5, sim.positions[:, 1].max() + 1), xlabel="x", ylabel="y", title="pressure (blue) and pair forces (red)")
right.plot(vertical, height, label=r"$\sigma_{yy}$")
right.plot(above, height, "--", label="weight above")
right.plot(fields.stress[..., 0, 0].mean(axis=0), height, label=r"$\sigma_{xx}$")
right.set(xlabel="stress, weight per length", ylabel="y")
right.legend()
figure.savefig("stress_and_force_chains.png")
