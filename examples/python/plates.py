"""Two plates press a droplet, and then elastic shells. The script prints the force on a plate. For the droplet it also
prints the exact force.

python3 plates.py [--quick]"""

import sys

import numpy as np
import pliant
from scipy.integrate import quad
from scipy.optimize import brentq

WIDTH = 0.05  # of edges: plates touch vertices at half of it


def press(height, n_vertices, **shape):
    """(force on a plate, distance of the flat parts, volume, height at rest) of a sphere with the volume of a sphere of diameter 1,
    which two plates press to about this height."""
    mesh = pliant.Mesh.icosphere(n_vertices)
    ball = mesh.placed([[0, 0, 0]], 1, [np.eye(3)])[0]
    walls = pliant.Walls(3)
    for side in (-1, 1):
        walls.half_space((0, 0, side * (height + WIDTH) / 2), (0, 0, -side))
    squeezed = ball * [height**-0.5, height**-0.5, height]
    sim = pliant.Simulation(surfaces=[squeezed], a0=[np.pi / 6], mesh=mesh, model="smooth", diameters=WIDTH, walls=walls,
                            e_w=0.1, mu=0, zeta=0, **shape)
    sim.minimize(5e-4, 1_000_000)
    return abs(sim.wall_forces[1][2]), np.ptp(sim.surfaces[0][:, 2]), sim.volumes[0], np.ptp(ball[:, 2])


def droplet(distance, volume, tension):
    """Force between two plates on a droplet that does not wet them (Young-Laplace). At the distance z from the middle the meridian
    has the angle psi to the plates: r sin(psi) = (r^2 - a^2)/b, with the radius a of the flat parts and R of the middle,
    b = (R^2 - a^2)/R. The pressure is 2 tension/b."""
    def integral(weight, a, R):
        b = (R * R - a * a) / R

        def integrand(t):  # r = R - (R - a) t^2 removes the singularity in the middle
            r = R - (R - a) * t * t
            sine = (r * r - a * a) / (b * r)
            return weight(r) * sine / np.sqrt(max(1 - sine * sine, 1e-300)) * 2 * (R - a) * t
        return 2 * quad(integrand, 0, 1)[0]

    def middle(a):
        return brentq(lambda R: integral(lambda r: 1, a, R) - distance, a * (1 + 1e-9) + 1e-9, a + 2 * distance)
    a = brentq(lambda a: integral(lambda r: np.pi * r * r, a, middle(a)) - volume, 1e-6, 2)
    R = middle(a)
    return 2 * tension * R / (R * R - a * a) * np.pi * a * a


quick = "--quick" in sys.argv
print("droplet: vertices, distance, force, exact, ratio")
for n_vertices in (162,) if quick else (162, 642):
    for height in (0.8,) if quick else (0.9, 0.8, 0.7, 0.6):
        force, distance, volume, _ = press(height, n_vertices, gamma=1, k_v=200, k_a=0, k_l=0.1, k_b=0)
        exact = droplet(distance, volume, 1)
        print(f"{n_vertices} {distance:.4f} {force:.4f} {exact:.4f} {force / exact:.3f}", flush=True)
for k_v in (0,) if quick else (0, 1000):
    print(f"shell, k_l = 100, k_b = 1, k_v = {k_v}: indentation of both sides together, force, exponent")
    before = None
    for height in (0.98, 0.96) if quick else (0.995, 0.99, 0.98, 0.96, 0.92, 0.84):
        force, distance, _, at_rest = press(height, 162 if quick else 642, gamma=0, k_v=k_v, k_a=0, k_l=100, k_b=1, rest_angles=True)
        now = np.log([at_rest - distance, force])
        exponent = "" if before is None else f" {(now - before)[1] / (now - before)[0]:.2f}"
        print(f"{at_rest - distance:.4f} {force:.4f}{exponent}", flush=True)
        before = now
