#!/usr/bin/python3
"""Times whole runs and kernels on one core and writes benchmarks/results.md.

    benchmarks/run.py --build BUILD [--repetitions 5] [--cpu 1]

BUILD is a build folder configured with -DPLIANT_BUILD_BENCHMARKS=ON. All cases run once before any runs again, so that
a disturbance of the machine hits them alike. Times are CPU times of the run without its packing."""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

SOFT = "-hopper_width 10 -dt 1e-3"
FRICTION, DRAG = "-mu 31.6227766", "-zeta 0.316227766"
POLYGONS = "-n 400 -n_vertices 16 -hopper_wall_distance 25 -hopper_width 10 " + FRICTION
# Name, options, quantity of summary.json, target in ns.
CASES = [
    ("SP 2D, N = 1600, friction", f"-model sp {SOFT} {FRICTION} -t_end 30", "ns_per_particle_step", 25),
    ("SP 2D, N = 1600, drag", f"-model sp {SOFT} {DRAG} -t_end 30", "ns_per_particle_step", 25),
    ("SP 3D, N = 6400, friction", f"-model sp -dim 3 {SOFT} {FRICTION} -t_end 5", "ns_per_particle_step", 40),
    ("SP 3D, N = 6400, drag", f"-model sp -dim 3 {SOFT} {DRAG} -t_end 5", "ns_per_particle_step", 40),
    ("rough, E_c = 1e4", f"-model rough -e_c 1e4 {POLYGONS} -dt 6e-5 -t_end 2", "ns_per_vertex_step", 25),
    ("smooth, E_c = 1e4", f"-model smooth -e_c 1e4 {POLYGONS} -dt 6e-6 -t_end 0.3", "ns_per_vertex_step", 60),
    ("smooth, E_c = E_w = 1e3", f"-model smooth -e_c 1e3 -e_w 1e3 {POLYGONS} -dt 2e-5 -t_end 1", "ns_per_vertex_step", 60),
]


def run_case(program, pin, options):
    """Summary of one run."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "run"
        command = [*pin, program, "hopper", *options.split(), "-output", output]
        command += "-frame_interval 1e3 -sample_interval 1 -checkpoint_interval 0".split()
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"run.py: {' '.join(map(str, command))} failed: {done.stderr.strip()}")
        return json.loads((output / "summary.json").read_text())


def run_kernels(program, pin, repetitions):
    """{(case, kernel): {"per_point": (median, least, most) in ns, and counters}}."""
    command = [*pin, program, "--benchmark_format=json", f"--benchmark_repetitions={repetitions}",
               "--benchmark_enable_random_interleaving=true", "--benchmark_min_time=0.1"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"run.py: {program} failed: {done.stderr.strip()}")
    repeated = {}
    for row in sorted(json.loads(done.stdout)["benchmarks"], key=lambda row: row["family_index"]):
        if row["run_type"] == "iteration":
            repeated.setdefault(tuple(row["run_name"].split("/", 1)), []).append(row)
    kernels = {}
    for key, rows in repeated.items():
        ns = [1e9 * row["per_point"] for row in rows]
        kernels[key] = {name: rows[0][name] for name in
                        ("listed_per_point", "contacts_per_point", "rebuilds_per_1000_steps") if name in rows[0]}
        kernels[key]["per_point"] = (statistics.median(ns), min(ns), max(ns))
    return kernels


def cpu_model():
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown"


def loads():
    return " ".join(f"{load:.1f}" for load in os.getloadavg())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=Path, required=True, help="build folder")
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--cpu", type=int, default=max(os.sched_getaffinity(0)), help="core to run on")
    parser.add_argument("--output", type=Path, default=Path(__file__).parent / "results.md")
    args = parser.parse_args()
    program, kernel_program = args.build / "apps/pliant", args.build / "benchmarks/pliant_kernels"
    pin = ["taskset", "-c", str(args.cpu)]

    before = loads()
    summaries = [[] for _ in CASES]
    for _ in range(args.repetitions):
        for case, collected in zip(CASES, summaries):
            collected.append(run_case(program, pin, case[1]))
    kernels = run_kernels(kernel_program, pin, args.repetitions)
    version = subprocess.run([program, "-version"], capture_output=True, text=True, check=True).stdout.split("\n")
    text = ["# Benchmark results", "",
            "Written by `benchmarks/run.py`; what is timed, and how, stands there and in `kernels.cpp`.", "",
            f"- machine: {cpu_model()}, {os.cpu_count()} cores, one used; load average {before} before, {loads()} after",
            f"- program: {'; '.join(line for line in version if line)}",
            f"- {args.repetitions} repetitions, CPU time of the run without its packing", "",
            "## Whole runs", "",
            "ns per particle-step (soft) or vertex-step (deformable).", "",
            "The runs of deformable particles are short: they end while the packing settles, with fewer contacts than later. Their",
            "kernels (`verlet_step`) are timed after 2 to 3 t0 of flow.", "",
            "| case | median | min–max | target | over target | within 2× | steps | force evaluations |",
            "|---|---|---|---|---|---|---|---|"]
    for (name, _, quantity, target), collected in zip(CASES, summaries):
        ns = [summary[quantity] for summary in collected]
        ratio = statistics.median(ns) / target
        text.append(f"| {name} | {statistics.median(ns):.1f} | {min(ns):.1f}–{max(ns):.1f} | {target} | {ratio:.2f} | "
                    f"{'yes' if ratio <= 2 else 'no'} | {collected[0]['steps']} | {collected[0]['force_evaluations']} |")
    text += ["", "Options of the cases:", ""] + [f"- {name}: `{options}`" for name, options, *_ in CASES]

    names = list(dict.fromkeys(case for case, _ in kernels))
    rows = sorted({kernel for _, kernel in kernels})
    text += ["", "## Kernels", "", "ns per particle or vertex, median (min–max), of one evaluation, rebuild or step.", "",
             f"| kernel | {' | '.join(names)} |", "|---" * (len(names) + 1) + "|"]
    for row in rows:
        cells = [kernels.get((name, row)) for name in names]
        text.append(f"| {row} | " + " | ".join(
            "" if cell is None else "{:.2f} ({:.2f}–{:.2f})".format(*cell["per_point"]) for cell in cells) + " |")
    for row, counter, label in [("force/all", "listed_per_point", "listed pairs per point"),
                                ("force/all", "contacts_per_point", "touching pairs per point"),
                                ("verlet_step", "rebuilds_per_1000_steps", "list rebuilds per 1000 steps")]:
        text.append(f"| {label} | " + " | ".join(f"{kernels[name, row][counter]:.3g}" for name in names) + " |")
    args.output.write_text("\n".join(text) + "\n")
    print(f"written: {args.output}")


if __name__ == "__main__":
    main()
