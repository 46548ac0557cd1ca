"""A user-defined force: disks collect in a harmonic trap."""
import numpy as np

import pliant

x = 3 * np.stack(np.meshgrid(np.arange(-5, 5), np.arange(-5, 5)), axis=-1).reshape(-1, 2)
sim = pliant.Simulation(x, diameters=1, e_sp=1000, zeta=0.5)
sim.force = lambda x, v, t: -0.2 * x
sim.run(60)
print(f"radius of gyration {np.sqrt(np.mean(np.sum(sim.positions**2, axis=1))):.2f} diameters, {len(sim.contacts)} contacts")
