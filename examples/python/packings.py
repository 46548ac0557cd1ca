"""Jammed packings of 64 disks at three pressures, twenty seeds each: means with standard errors, failed packings, a figure."""
import matplotlib.pyplot as plt

import pliant

try:
    pliant.pack(n=64, moduli=True, ensemble=20, ensemble_over="pressure=1e-4,1e-3,1e-2", output="packings")
except pliant.NumericalError as error:  # some packings have not converged
    print(error)
packings = pliant.Ensemble("packings")
means = packings.means
for _, m in means.iterrows():
    print(f"p = {m.pressure:g}: phi = {m.fraction:.4f} ± {m.fraction_error:.4f}, Z = {m.coordination:.3f} ± {m.coordination_error:.3f}, "
          f"G = {m.shear_modulus:.4f} ± {m.shear_modulus_error:.4f}, {m.members:g} packings")
print(f"{(packings.table.status == 'failed').sum()} packings have not converged")
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
left.errorbar(means.pressure, means.shear_modulus, means.shear_modulus_error, fmt="o", capsize=3)
left.set(xscale="log", yscale="log", xlabel="pressure", ylabel="shear modulus")
packings[0].draw(-1, color="contacts", axes=right)
figure.savefig("packings.png")
