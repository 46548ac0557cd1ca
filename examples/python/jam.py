"""A jammed periodic box: the largest area fraction with a minimum of the energy near zero, by bisection."""
import numpy as np

import pliant

sizes = pliant.diameters(100)
area, x = np.pi / 4 * np.sum(sizes**2), np.random.default_rng(1).random((100, 2))
low, high = 0.7, 0.95
while high - low > 1e-4:
    phi = (low + high) / 2
    length = np.sqrt(area / phi)
    with pliant.Simulation(length * x, sizes, box=(length, length), e_sp=1) as sim:
        # Near jamming the minimisation may end before it has converged. If the energy is near zero, the box is not jammed all the same;
        # if not, the box counts as jammed, so the printed fraction is a lower bound.
        if sim.minimize(1e-10, must_converge=False).energy < 1e-12:
            low, x = phi, sim.positions / length
        else:
            high = phi
print(f"jammed at an area fraction of {phi:.4f}")
