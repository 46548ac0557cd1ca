"""A hopper that is shaken whenever it clogs, until it is empty."""
import numpy as np

import pliant

hopper, sizes = pliant.Container(width=3, wall_distance=12, angle=60), pliant.diameters(150, seed=3)
walls = pliant.Walls()
body = walls.container(hopper)
sim = pliant.Simulation(hopper.pack(sizes), sizes, walls=walls, gravity=(0, -1), model="disk", mu_disk=0.5)
inside, clogs = len(sim), 0
while inside:
    before = inside
    sim.run(5)
    inside = np.sum(sim.positions[:, 1] > 0)
    if inside == before:
        sim.move_wall(body, amplitude=(0.4, 0.4), frequency=2 * np.pi)
        sim.run(2)
        sim.move_wall(body)
        clogs += 1
print(f"empty at t = {sim.t:.0f} t0, after {clogs} clogs")
