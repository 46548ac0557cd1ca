"""Runs the same soft particles or frictional disks in LAMMPS: writes its input from a run of Pliant, and reads its log."""

import os
import re
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

here = Path(__file__).resolve().parent
sys.path.insert(0, str(here.parents[1] / "python"))
from pliant import Run  # noqa: E402  (the folder of the package comes first)

from harness import BenchError, Unsupported, run  # noqa: E402
from .data_file import data_file, pair_table  # noqa: E402

# Pair styles that compute [H 2] (and [H 6]) exactly, and one approximate pair style.
EXACT, NEARLY = ("granular", "table"), ("gran_hooke",)
SKIN = 0.2  # costs differ by less than 5 % between 0.1 and 0.3


def program():
    path = shutil.which("lmp")
    if path is None:
        raise Unsupported("lmp is not installed (scripts/setup.sh --benchmarks)")
    return path


@dataclass(frozen=True)
class Peer:
    seconds: float         #: CPU time of the loop
    kinetic_energy: float  #: mean over the second half of the run
    height: float          #: mean over the remaining particles, at the end
    particles: int         #: left at the end


def reference(folder):
    """The same quantities of Pliant's own run; its last frame is at the end."""
    with Run(folder) as r:
        frame, series = r.frame(-1), r.series
        late = series.kinetic_energy[series.time > series.time.iloc[-1] / 2]
        return Peer(r.summary["cpu_seconds"], float(late.mean()), float(frame.centres[frame.active][:, -1].mean()),
                    int(frame.active.sum()))


def peer(folder, pair, steps, every, pin):
    """Runs LAMMPS for `steps` from the first frame of the run in `folder`; a row of its log every `every` steps."""
    with Run(folder) as r:
        small, large = np.unique(r.topology.sigma)
        options, dim = r.parameters, r.dim
        data, table = r.path / f"{pair}.data", r.path / "pair.table"
        data.write_text(data_file(r, "atomic" if pair == "table" else "sphere"), encoding="utf-8")
        table.write_text(pair_table(options["e_sp"], (small, large)), encoding="utf-8")
        variables = {"data": data.resolve(), "table": table.resolve(), "pair": pair, "skin": SKIN, "steps": steps,
                     "every": every, "dt": options["dt"], "epsilon": options["e_sp"], "epsilon_w": options["e_w"],
                     "mu": options["mu"], "zeta": options["zeta"], "W": r.geometry.W, "w": r.geometry.w,
                     "small": f"{small:.17g}", "large": f"{large:.17g}", "m": np.pi / (2 * dim)}
    return _run("hopper2d.in" if dim == 2 else "pile3d.in", variables, pin)


def channel(folder, lists, steps, every, pin):
    """LAMMPS run of the first push in a channel without substrate; `lists`: bin or multi."""
    with Run(folder) as r:
        options, data = r.parameters, r.path / "disks.data"
        data.write_text(data_file(r, "sphere"), encoding="utf-8")
        variables = {"data": data.resolve(), "lists": lists, "skin": SKIN, "steps": steps, "every": every,
                     "dt": r.summary["dt"], "k": options["stiffness"], "kt": 2 / 7 * options["stiffness"],
                     "damping": lammps_restitution(options["restitution"]), "mu": options["mu_disk"],
                     "width": options["channel_width"], "arm": options["channel_arm"],
                     "speed": options["plunger_speed"]}
    return _run("channel.in", variables, pin)


def spheres(folder, pair, steps, every, pin):
    """LAMMPS run of frictional spheres in a closed cylinder; `pair`: granular or gran_hooke_history."""
    with Run(folder) as r:
        small, large = np.unique(r.topology.sigma)
        options, data = r.parameters, r.path / "spheres.data"
        data.write_text(data_file(r, "sphere"), encoding="utf-8")
        variables = {"data": data.resolve(), "pair": pair, "skin": SKIN, "steps": steps, "every": every,
                     "dt": options["dt"], "epsilon": options["e_disk"], "epsilon_w": options["e_w"],
                     "mu": options["mu_disk"], "mu_wall": options["mu_wall"],
                     "zeta": damping_ratio(options["restitution"]),
                     "damping": lammps_restitution(options["restitution"]), "kt": options["tangential_stiffness"],
                     "ratio": options["tangential_damping"], "W": r.geometry.W, "small": f"{small:.17g}",
                     "large": f"{large:.17g}"}
    return _run("spheres3d.in", variables, pin)


def damping_ratio(restitution):
    return brentq(lambda z: np.exp(-2 * z * np.arccos(z) / np.sqrt(1 - z * z)) - restitution, 1e-6, 1 - 1e-6)


def lammps_restitution(restitution):
    """The damping coefficient for which LAMMPS' damping, alpha sqrt(m k), is 2 zeta sqrt(m k): its polynomial for alpha is made
    for Hertz' contacts."""
    zeta = damping_ratio(restitution)
    alpha = np.poly1d([4.8218, -18.022, 27.467, -22.348, 11.087, -4.2783, 1.2728])
    return brentq(lambda e: alpha(e) - 2 * zeta, 0.0, 1.0)


def _run(script, variables, pin):
    command = [*pin, program(), "-in", script, "-nocite", "-log", "none"]
    for name, value in variables.items():
        command += ["-var", name, value]
    log = run(command, cwd=here, env={**os.environ, "OMP_NUM_THREADS": "1"}).output
    try:
        _, rows = log.split("Step Atoms", 1)
        rows = [line.split() for line in rows.split("Loop time")[0].splitlines()[1:] if line.strip()]
        rows = np.array(rows, float)
        # The loop time is wall time; its share of a core makes it comparable with Pliant's CPU time.
        wall = float(re.search(r"Loop time of (\S+)", log)[1])
        share = float(re.search(r"([\d.]+)% CPU use", log)[1]) / 100
    except (ValueError, TypeError) as error:
        raise BenchError(f"the log of LAMMPS cannot be read ({error}): {' '.join(map(str, command))}") from None
    late = rows[rows[:, 0] > rows[-1, 0] / 2]
    return Peer(wall * share, late[:, 2].mean(), rows[-1, 3], int(rows[-1, 1]))
