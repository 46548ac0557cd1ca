"""
A new force term, in Python and in C++
======================================

Pliant's polygons resist changes of their area and edges. We add a line tension γ, which pulls neighbouring vertices together and so makes a droplet: first as a
Python function, then as the C++ term of ``examples/own_term``. Laplace's law is the known answer: at rest the pressure inside is γ/R.
"""
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import pliant

# %%
# In Python
# ---------
# ``sim.force`` is called in every evaluation and returns a force on each vertex. The energy γ Σ l of the edges pulls both ends of an edge with the constant
# force γ. We start from an ellipse, and let the drag ζ damp its oscillation.
tension, area_stiffness, vertices = 2.0, 200.0, 16
angle = 2 * np.pi * np.arange(vertices) / vertices
ellipse = np.stack([0.56 * np.cos(angle), 0.45 * np.sin(angle)], axis=1)
sim = pliant.Simulation(polygons=[ellipse], model="smooth", k_a=area_stiffness, k_l=0, k_b=0, zeta=5, e_c=10, e_w=10)


def line_tension(positions, velocities, t):
    edge = np.roll(positions, -1, axis=0) - positions
    pull = tension * edge / np.linalg.norm(edge, axis=1)[:, None]
    return pull - np.roll(pull, 1, axis=0)


def radii(polygon):
    return np.linalg.norm(polygon - polygon.mean(axis=0), axis=1)


sim.force = line_tension
time, aspect = [], []


@sim.every(0.05)
def record(sim):
    r = radii(sim.polygons[0])
    time.append(sim.t)
    aspect.append(r.max() / r.min())


sim.run(5)

# %%
# At rest each vertex is pushed outwards by the pressure p on the two half edges, and pulled inwards by γ: for a regular polygon with n vertices,
# p = γ/(R cos(π/n)), which tends to γ/R. The force of the pressure on a vertex is the force of the model, without the line tension.
x = sim.positions
r = radii(x)
pressure = np.linalg.norm(sim.forces, axis=1).mean() / np.linalg.norm((np.roll(x, -1, axis=0) - np.roll(x, 1, axis=0)) / 2, axis=1).mean()
laplace = tension / (r.mean() * np.cos(np.pi / vertices))
print(f"aspect ratio {aspect[-1]:.4f}, pressure {pressure:.4f}, Laplace {laplace:.4f}, relative difference {pressure / laplace - 1:.1e}")

# %%
# In C++
# ------
# A Python function costs a call per evaluation. A C++ term runs in the compiled loop of the model, adds its energy to the energy balance, its Hessian to implicit integrators, and an
# option to the command line. It is a struct with these members (``examples/own_term/line_tension.h``)::
#
#     Real energy(const View& s, Index i) const { return gamma * edge(s, i).norm(); }
#
#     template <class G>
#     void add_gradient(const View& s, Index i, G& grad) const {
#       const Vec pull = gamma * edge(s, i).normalized();
#       grad.add(s.topology.next[i], pull);
#       grad.add(i, -pull);
#     }
#
# The page *Add an energy term* explains all members. ``cmake --build build --target own_term`` compiles the program; here it runs if it is found in the
# ``PATH``, or in ``build/`` of the current folder.
program = shutil.which("own_term", path=os.pathsep.join([os.environ["PATH"], "build/examples/own_term"]))
folder = tempfile.TemporaryDirectory()
run = None
if program:
    check = subprocess.run([program, "check", "2"], capture_output=True, encoding="utf-8", check=True)
    print(check.stdout)
    output = Path(folder.name) / "droplets"
    options = "-model line_tension -tension 200 -zeta 1 -e_c 1000 -e_w 1000 -n 40 -hopper_wall_distance 10 -hopper_width 4 -t_end 3"
    subprocess.run([program, "hopper", *options.split(), "-output", str(output)], check=True, stdout=subprocess.DEVNULL)
    run = pliant.Run(output)
else:
    print("own_term is not built: the picture has the droplet of Python only")

# %%
# Picture
# -------
# The ellipse becomes a circle; the droplets of the C++ term in a hopper stay nearly round.
figure, axes = plt.subplots(1, 3 if run else 2, figsize=(9, 3.5), layout="constrained")
for polygon, name in ((ellipse, "start"), (x, "end")):
    axes[0].plot(*np.r_[polygon, polygon[:1]].T, "o-", ms=3, label=name)
axes[0].set(aspect="equal", title=f"p / Laplace = {pressure / laplace:.6f}", xlabel="x", ylabel="y")
axes[0].legend(loc="center")
axes[1].plot(time, aspect)
axes[1].set(xlabel="$t$", ylabel="largest / smallest radius")
if run:
    run.draw(axes=axes[2])
figure.savefig("force_term.png")
