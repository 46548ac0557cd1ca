"""
Adaptive integrators of PETSc and SUNDIALS
==========================================

Velocity Verlet takes fixed steps, as in LAMMPS. Pliant also runs on the adaptive methods of PETSc TS and on CVODE of SUNDIALS, with a tolerance instead of a step. A disk that bounces without
loss has an exact solution, so we can plot error against cost.
"""
import matplotlib.pyplot as plt
import numpy as np

import pliant

# %%
# Exact solution
# --------------
# The disk starts at rest at the height h above the floor, with gravity 1. In the air it moves on a parabola. The contact is a harmonic spring, so in contact it moves on a sine. The energy of the model
# for an overlap δ gives the spring constant K.
diameter, h, stiffness = 1.0, 0.5, 1000.0


def simulation(**options):
    walls = pliant.Walls()
    walls.half_space((0, 0), (0, 1))
    return pliant.Simulation([[0, diameter / 2 + h]], diameter, walls=walls, gravity=(0, -1), e_sp=stiffness, e_w=stiffness, **options)


probe = simulation()
delta = 0.01
probe.positions[0, 1] = diameter / 2 - delta
mass = probe.masses[0]
K = probe.forces[0, 1] + mass  # the forces contain the weight
K /= delta
omega, v = np.sqrt(K / mass), np.sqrt(2 * h)
shift = 1 / omega**2                                    # the weight compresses the spring by this length
contact = (2 * np.pi - 2 * np.arctan2(v / omega, shift)) / omega
period = 2 * v + contact


def exact(t):
    """Height of the centre at the time t, which begins at the highest point."""
    t = np.mod(t + v, period) - v                       # v: time of the fall
    amplitude, phase = np.hypot(shift, v / omega), np.arctan2(v / omega, shift)
    in_contact = -shift + amplitude * np.cos(phase + omega * (t - v))
    return diameter / 2 + np.where(t < v, h - t**2 / 2, in_contact)


# %%
# Error against cost
# ------------------
# The cost is the number of evaluations of the forces. We run for a bit more than three bounces, and take the root mean square
# of the difference from the exact height.
t_end = 3.2 * period
methods = {"verlet": [{"dt": 0.008 / 2**k} for k in range(6)],
           "rk": [{"ts_rk_type": "5dp", "ts_rtol": 10.0**-k, "ts_atol": 10.0**-k} for k in range(4, 11)],
           "cvode": [{"ts_rtol": 10.0**-k, "ts_atol": 10.0**-k} for k in range(4, 11)]}
results = {}
for name, settings in methods.items():
    for options in settings:
        sim = simulation(integrator=name, **options)
        errors = []
        sim.run(t_end, callback=lambda sim: errors.append(sim.positions[0, 1] - exact(sim.t)), every=0.05)
        results.setdefault(name, []).append((sim.counters["force_evaluations"], np.sqrt(np.mean(np.square(errors)))))
for name, values in results.items():
    evaluations, error = values[-1]
    print(f"{name:7}: {evaluations:6} evaluations, error {error:.1e} of a diameter")

# %%
# The slope of velocity Verlet is its order, 2. The adaptive methods take long steps in the air, and find the contacts by their error control.
cost, error = np.array(results["verlet"]).T
(slope, _), covariance = np.polyfit(np.log(cost), np.log(error), 1, cov=True)
print(f"measured order of velocity Verlet: {-slope:.2f} ± {covariance[0, 0] ** 0.5:.2f} (theory: 2)")

# %%
# Picture
# -------
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
sim, track = simulation(integrator="cvode", ts_rtol=1e-6, ts_atol=1e-8), []
sim.run(t_end, callback=lambda sim: track.append((sim.t, sim.positions[0, 1])))
t = np.linspace(0, t_end, 500)
left.plot(t, exact(t), color="0.7", lw=3)
left.plot(*np.array(track).T, "o", ms=3)
left.set(xlabel="t", ylabel="height", title="grey: exact; dots: steps of CVODE")
for name, marker in zip(results, "os^"):
    right.loglog(*np.array(results[name]).T, marker + "-", label=name)
right.set(xlabel="evaluations of the forces", ylabel="error of the height")
right.legend()
figure.savefig("integrators.png")
