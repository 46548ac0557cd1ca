#!/usr/bin/python3
"""Runs short cases with two programs and compares their files, bit for bit; `scripts/golden.sh` builds the programs
and calls it."""

import argparse
import os
import shlex
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

GROUPS = ("topology", "geometry", "frames", "series", "series_axes", "events")  # all but the manifest
DERIVED = ("crc32", "members")  # checksum of the values and number of the members, which are compared themselves
TIMEOUT = 120      # seconds of a run, which takes one or two


class Case(NamedTuple):
    options: str
    half: float  # -t_end at which one run ends, to be continued
    end: float   # -t_end of both, at the latest
    ranks: int = 1


SOFT = "hopper -n 200 -hopper_wall_distance 14 -hopper_width 4 -zeta 0.3 -mu 0.5 -pack_fraction 0.8"
SPHERES = "hopper -dim 3 -n 400 -hopper_wall_distance 8 -hopper_width 4 -zeta 0.3 -mu 0.5 -pack_fraction 0.5"
POLYGONS = ("hopper -n 40 -n_vertices 12 -hopper_wall_distance 8 -hopper_width 3 -pack_fraction 0.7 "
            "-e_c 500 -e_w 500 -k_a 1000 -k_l 100")
FEW = "hopper -n 100 -hopper_wall_distance 10 -hopper_width 4 -pack_fraction 0.8"
DISKS = "hopper -model disk -mu_disk_dynamic 0.3 -mu_wall_dynamic 0.2"
RAFT = "raft -rows 3 -columns 3 -delta 0.01 -v_wall 1e-3 -sample_interval 10 -frame_interval 200"
CASES = {
    "sp": Case(f"{SOFT} -frame_interval 5", 25, 50),
    "sp-3d": Case(f"{SPHERES} -frame_interval 5", 12, 24),
    "sp-sizes": Case(f"{SOFT} -size_distribution normal -hopper_angle 45 -frame_interval 5", 15, 30),
    "rough": Case(f"{POLYGONS} -model rough -mu 1 -frame_interval 4", 16, 32),
    "smooth": Case(f"{POLYGONS} -model smooth -edge_width 0.3 -zeta 0.3 -mu 0.3 -frame_interval 2", 10, 20),
    "barrier": Case(f"{POLYGONS} -model smooth -edge_width 0.3 -zeta 0.3 -contact_law barrier", 5, 10),
    "discharge": Case(f"{FEW} -flow discharge -hopper_angle 45 -zeta 0.3", 15, 40),
    "disk": Case(f"{DISKS} -n 100 -hopper_wall_distance 10 -hopper_width 4 -pack_fraction 0.8", 5, 10),
    "disk-3d": Case(f"{DISKS} -dim 3 -n 200 -hopper_wall_distance 6 -hopper_width 4 -pack_fraction 0.5", 3, 6),
    "overdamped": Case(f"{FEW} -dynamics overdamped -integrator ts -zeta 1 -frame_interval 1", 2, 4),
    "ts-adaptive": Case(f"{FEW} -zeta 0.3 -integrator ts -ts_type rk -ts_rk_type 5dp -ts_rtol 1e-3", 12, 24),
    "ts-implicit": Case(f"{FEW} -zeta 0.3 -integrator ts -ts_type bdf -ts_rtol 1e-3 -dt 1e-2 -frame_interval 1", 2, 4),
    "raft": Case(RAFT, 1200, 1e6),
    "raft-lagged": Case(f"{RAFT} -mobility lagged", 1200, 1e6),
    "raft-extension": Case(f"{RAFT} -motion extension", 1200, 1e6),
    "clog": Case("clog -n 90 -seed 3 -g 0.1 -hopper_width 3 -phi_c 3e-4 -sample_interval 5 -frame_interval 20", 100, 1e6),
    "channel": Case("channel -channel_width 6 -channel_arm 11 -stroke 3 -distribution bidisperse -plunger_speed 20 "
                    "-pushes 2 -frame_travel 0.5", 0.08, 1e6),
    "sp-threads": Case(f"{SOFT} -threads 2 -frame_interval 5", 15, 30),
    "rough-ranks": Case(f"{POLYGONS} -model rough -mu 1", 5, 10, ranks=2),
}


class Failed(Exception):
    """A program did not end as it should."""


def environment(ranks):
    """Open MPI: no daemon for a single process; as root, and more ranks than free cores, none bound to one."""
    more = {"OMP_WAIT_POLICY": "passive"}
    if ranks == 1:
        more |= {"OMPI_MCA_ess_singleton_isolated": "1", "OMPI_MCA_orte_create_session_dirs": "0"}
    else:
        more |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
                 "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_mpi_yield_when_idle": "1",
                 "OMPI_MCA_hwloc_base_binding_policy": "none"}
    return os.environ | more


def run(program, case, options):
    """One process, or one mpiexec, to its end."""
    launcher = ["mpiexec", "-n", str(case.ranks)] if case.ranks > 1 else []
    try:
        result = subprocess.run([*launcher, program, *options], env=environment(case.ranks), encoding="utf-8",
                                capture_output=True, timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        raise Failed(f"still running after {TIMEOUT} s") from None
    if result.returncode != 0:
        complaint = [line for line in result.stderr.splitlines() if "error: " in line] or result.stderr.splitlines()[-1:]
        raise Failed(f"exit code {result.returncode}: {complaint[0] if complaint else ''}")


def make_runs(program, case, folder):
    """Writes folder/whole, and folder/continued: the same ended at half its time and continued."""
    words = shlex.split(case.options)
    whole, continued = folder / "whole", folder / "continued"
    run(program, case, [*words, "-t_end", f"{case.end:g}", "-output", str(whole)])
    run(program, case, [*words, "-t_end", f"{case.half:g}", "-output", str(continued)])
    run(program, case, [words[0], "-restart", str(continued), "-t_end", f"{case.end:g}"])


def read(path):
    """{name: values} of the datasets and attributes of a run, in the order of GROUPS."""
    values = {}

    def add(name, item):
        if isinstance(item, h5py.Dataset) and item.dtype.kind == "S":  # texts were attributes once
            group, _, key = name.rpartition("/")
            values[f"{group}@{key}"] = np.asarray(item[()].decode())
        elif isinstance(item, h5py.Dataset):
            values[name] = item[()]
        for key in item.attrs:
            if key not in DERIVED:
                values[f"{name}@{key}"] = np.asarray(item.attrs[key])

    with h5py.File(path) as file:
        for group in GROUPS:
            if group in file:
                file[group].visititems(lambda name, item, group=group: add(f"{group}/{name}", item))
                add(group, file[group])
    return values


def difference(a, b):
    """Where two arrays differ first, or None if they are equal bit for bit."""
    a, b = np.asarray(a), np.asarray(b)
    if a.dtype != b.dtype:
        return f": type {a.dtype} | {b.dtype}"
    if a.shape != b.shape:
        return f": shape {a.shape} | {b.shape}"
    if a.dtype.hasobject:
        unequal = np.flatnonzero(a.ravel() != b.ravel())
    else:
        bytes_of = [np.frombuffer(x.tobytes(), np.uint8).reshape(x.size, -1) for x in (a, b) if x.size]
        unequal = np.flatnonzero((bytes_of[0] != bytes_of[1]).any(axis=1)) if bytes_of else []
    if len(unequal) == 0:
        return None
    at = np.unravel_index(unequal[0], a.shape)
    index = f"[{', '.join(map(str, at))}]" if at else ""
    return f"{index}: {a[at]!r} | {b[at]!r}"


def compare(a, b):
    """The differences between the values of two runs: names that one of them lacks, then the first value; empty if equal."""
    found = []
    for have, lack, side in ((a, b, "first"), (b, a, "second")):
        extra = [name for name in have if name not in lack]
        if extra:
            more = f" and {len(extra) - 4} more" if len(extra) > 4 else ""
            found.append(f"only the {side} has {', '.join(extra[:4])}{more}")
    differences = [name + text for name in a if name in b and (text := difference(a[name], b[name])) is not None]
    if differences:
        more = f" (and {len(differences) - 1} more)" if len(differences) > 1 else ""
        found.append(differences[0] + more)
    return found


def counts(values):
    """Frames, rows of the series, events."""
    frames = sum(name.startswith("frames/") and name.endswith("@time") for name in values)
    events = [len(value) for name, value in values.items() if name.startswith("events/") and np.ndim(value)]
    return frames, len(values.get("series/time", ())), max(events, default=0)


def compare_case(name, programs, folder):
    """(rows of the table, whether all is equal)."""
    rows, failures = [], []
    folders = [folder / name / str(side) for side in range(2)]
    for side, program in enumerate(programs):
        folders[side].mkdir(parents=True)
        try:
            make_runs(program, CASES[name], folders[side])
        except Failed as failure:
            failures.append(f"the {('first', 'second')[side]} program failed: {failure}")
    if failures:
        return [(name, "", "", "", "", failure) for failure in failures], False
    equal = True
    for part in ("whole", "continued"):
        a, b = (read(side / part / "run.h5") for side in folders)
        frames, rows_, events = counts(a)
        found = compare(a, b)
        if frames < 3 or rows_ < 3:
            found.append("too little to compare")
        equal = equal and not found
        rows.append((name, part, frames, rows_, events, "; ".join(found) or "equal"))
    return rows, equal


def main():
    command = argparse.ArgumentParser(prog="golden", description=__doc__)
    command.add_argument("--programs", nargs=2, required=True)
    command.add_argument("--names", nargs=2, default=("first", "second"), help="of the programs")
    command.add_argument("--folder", type=Path, required=True, help="of the runs; made anew")
    command.add_argument("--jobs", type=int, default=1, help="cases at a time")
    command.add_argument("--except", dest="exceptions", action="append", default=[], choices=CASES, metavar="CASE",
                         help="a difference that does not count")
    command.add_argument("--only", action="append", choices=CASES, metavar="CASE", help="of " + ", ".join(CASES))
    args = command.parse_args()
    shutil.rmtree(args.folder, ignore_errors=True)
    print(f"{args.names[0]} | {args.names[1]}")
    print(f"{'case':<15} {'run':<10} {'frames':>6} {'rows':>6} {'events':>6}  result", flush=True)
    different = []
    names = args.only or list(CASES)
    with ThreadPoolExecutor(args.jobs) as pool:
        for name, (rows, equal) in zip(names, pool.map(lambda n: compare_case(n, args.programs, args.folder), names)):
            excepted = not equal and name in args.exceptions
            for row in rows:
                note = " (excepted)" if excepted and row[5] != "equal" else ""
                print("{:<15} {:<10} {:>6} {:>6} {:>6}  {}{}".format(*row, note), flush=True)
            if not equal and not excepted:
                different.append(name)
    if different:
        print(f"golden: different: {', '.join(different)}; runs in {args.folder}", file=sys.stderr)
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
