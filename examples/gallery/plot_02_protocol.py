"""
A protocol: shake a hopper when it clogs
========================================

Frictional disks clog a narrow orifice. A callback watches the flow, shakes the container when no disk has left for a while, and raises the amplitude step by
step until the arch breaks. In LAMMPS such a protocol needs loops and variables of the input script; here it is a function.
"""
import matplotlib.pyplot as plt
import numpy as np

import pliant

# %%
# Setup
# -----
# A container becomes one rigid body of the walls; its number identifies it later.
n, width = 150, 2.2
container = pliant.Container(width=width, wall_distance=11, angle=60)
walls = pliant.Walls()
hopper = walls.container(container)
sizes = pliant.diameters(n, seed=3)
sim = pliant.Simulation(container.pack(sizes), sizes, walls=walls, gravity=(0, -1), model="disk", e_disk=1000, mu_disk=0.5, mu_wall=0.5)

# %%
# Protocol
# --------
# Every 0.1 t0 the callback removes the disks below the orifice. If none has left for 2 t0, it shakes the container for 1 t0 with the amplitude 0.05. If no
# disk leaves after that, the amplitude of the next attempt is 0.05 larger. The wall oscillates as amplitude · sin(frequency · t), from the moment at which ``move_wall`` is called.
times, left, shakes = [0.0], [0], []
last, until, amplitude = 0.0, 0.0, 0.0


@sim.every(0.1)
def protocol(sim):
    global last, until, amplitude
    fallen = sim.ids[sim.positions[:, 1] < -1.5]
    if len(fallen):
        sim.remove(fallen)
        last, amplitude = sim.t, (amplitude if sim.t < until else 0.0)
    times.append(sim.t)
    left.append(left[-1] + len(fallen))
    if until and sim.t > until - 0.05:  # after whole oscillations the container is at its old place
        sim.move_wall(hopper)
        until, last = 0.0, sim.t
    elif not until and sim.t - last > 2:
        amplitude += 0.05
        until = sim.t + 1
        shakes.append((sim.t, amplitude))
        sim.move_wall(hopper, amplitude=(amplitude, 0), frequency=8 * np.pi)  # four oscillations
    if left[-1] > 0.85 * n:
        sim.stop()


sim.run(300)

# %%
# Result
# ------
# A clog that needs several attempts counts once. The number of clogs is a Poisson variable; its standard error is the square root of the number.
attempts = len(shakes)
clogs = len({left[np.searchsorted(times, t)] for t, _ in shakes})
print(f"{left[-1]} of {n} disks left in {sim.t:.0f} t0 with {clogs} ± {clogs**0.5:.1f} clogs and {attempts} attempts to break them")

figure, (view, chart) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
view.set(aspect="equal", xlim=(-6.5, 6.5), ylim=(-3, 16), xlabel="x", ylabel="y", title=f"t = {sim.t:.0f} t0")
for (x, y), d in zip(sim.positions, sim.diameters):
    view.add_patch(plt.Circle((x, y), d / 2, color="tab:blue", ec="white"))
for x1, y1, x2, y2 in sim.wall_segments:
    view.plot([x1, x2], [y1, min(y2, 16)], color="black")
chart.plot(times, left)
for t, a in shakes:
    chart.axvspan(t, t + 1, color="tab:red", alpha=min(1, 2 * a), lw=0)
chart.set(xlabel="$t/t_0$", ylabel="disks that have left", title="shaken in the red intervals")
figure.savefig("protocol.png")
