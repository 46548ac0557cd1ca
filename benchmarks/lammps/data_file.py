#!/usr/bin/python3
"""Writes a frame of a run of soft particles or frictional disks as a LAMMPS data file: both programs flow from the same start.

    benchmarks/lammps/data_file.py RUN DATA [--style sphere|atomic] [--frame 0]

A run of soft particles has two diameters (-size_distribution bidisperse): types 1 and 2. The floor of the box is the
height at which Pliant removes particles from a discharge (2D), or the bottom (3D). Disks have a type for each diameter,
and a box around the walls; frictional spheres have the box of soft spheres."""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))
from pliant import PliantError, Run  # noqa: E402  (the folder of the package comes first)


def _hopper_box(run, position, kinds):
    half, roof = run.geometry.W / 2, 1.5 * position[:, run.dim - 1].max()
    return [(-half, half), (-2 * kinds[1], roof), (-0.5, 0.5)] if run.dim == 2 else [(-half, half)] * 2 + [(0, roof)]


def data_file(run, style, index=0):
    """Text of the data file of frame `index`; style is sphere (diameter and density) or atomic (mass by type)."""
    frame, topology = run.frame(index), run.topology
    kinds = np.unique(topology.sigma)
    if not (run.model == "sp" and len(kinds) == 2) and not (run.model == "disk" and style == "sphere"):
        raise PliantError(f"{run.path}: not a run of soft particles of two diameters, or of disks or frictional spheres")
    kind = np.searchsorted(kinds, topology.sigma)
    position, velocity = (np.zeros((topology.particles, 3)) for _ in range(2))
    position[:, : run.dim], velocity[:, : run.dim] = frame.positions, frame.velocities
    if run.model == "disk" and run.dim == 2:
        ends = frame.wall_segments.reshape(-1, 2)
        box = [*zip(ends.min(0) - kinds[-1], ends.max(0) + kinds[-1]), (-0.5, 0.5)]
    else:
        box = _hopper_box(run, position, kinds)
    lines = [f"{run.name}, frame {index}", "", f"{topology.particles} atoms", f"{kind.max() + 1} atom types", ""]
    lines += [f"{low:.17g} {high:.17g} {a}lo {a}hi" for (low, high), a in zip(box, "xyz")]
    if style == "atomic":
        lines += ["", "Masses", ""] + [f"{k + 1} {topology.mass[kind == k][0]:.17g}" for k in (0, 1)]
    lines += ["", f"Atoms # {style}", ""]
    # LAMMPS makes the mass of a sphere from its density, in 2D too.
    density = 6 * topology.mass / (np.pi * topology.sigma**3)
    for m, (x, y, z) in enumerate(position):
        size = f" {topology.sigma[m]:.17g} {density[m]:.17g}" if style == "sphere" else ""
        lines.append(f"{m + 1} {kind[m] + 1}{size} {x:.17g} {y:.17g} {z:.17g}")
    spin = " 0 0 0" if style == "sphere" else ""
    lines += ["", "Velocities", ""] + [f"{m + 1} {u:.17g} {v:.17g} {w:.17g}{spin}"
                                       for m, (u, v, w) in enumerate(velocity)]
    return "\n".join(lines) + "\n"


def pair_table(epsilon, diameters):
    """Text of a file for pair_style table: [H 2] for the pairs small-small, small-large and large-large."""
    small, large = diameters
    text = []
    for name, sigma in (("small", small), ("middle", (small + large) / 2), ("large", large)):
        r = np.linspace(1e-6, 1, 1001) * sigma
        text += [name, f"N {len(r)} FPRIME {-epsilon / sigma**2:.17g} {-epsilon / sigma**2:.17g}", ""]
        text += [f"{i + 1} {s:.17g} {epsilon / 2 * (1 - s / sigma) ** 2:.17g} {epsilon / sigma * (1 - s / sigma):.17g}"
                 for i, s in enumerate(r)] + [""]
    return "\n".join(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path)
    parser.add_argument("data", type=Path)
    parser.add_argument("--style", choices=("sphere", "atomic"), default="sphere")
    parser.add_argument("--frame", type=int, default=0)
    args = parser.parse_args()
    try:
        with Run(args.run) as run:
            args.data.write_text(data_file(run, args.style, args.frame), encoding="utf-8")
    except PliantError as error:
        print(f"data_file.py: error: {error}", file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
