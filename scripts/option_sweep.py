#!/usr/bin/python3
"""Runs each scenario with each numeric option at ten times its default and at a tenth of it, one at a time.

  scripts/option_sweep.py [--program FILE] [--jobs N] [CASE …]

Every run must end by itself with one of the program's exit codes. If the code is an error, the message must be one line
with the error and a cure ("fact; cure"). Anything else is a finding, which is printed, and the exit code is 1. Runs are
short; runs that take longer than --seconds are stopped by SIGTERM, and must then end with exit code 75.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "python"))

from pliant import Run  # noqa: E402

SMALL = "-n 20 -hopper_wall_distance 6 -hopper_width 3 -pack_fraction 0.6 -t_end 0.2"
PUSH = "channel -channel_width 6 -channel_arm 11 -distribution bidisperse -plunger_speed 20 -pushes 1"
CASES = {
    "hopper": f"hopper {SMALL} -zeta 0.3 -mu 0.5",
    "hopper-3d": f"hopper -dim 3 {SMALL} -zeta 0.3",
    "hopper-rough": f"hopper -model rough -n_vertices 8 {SMALL} -mu 0.5",
    "hopper-smooth": f"hopper -model smooth -n_vertices 8 {SMALL} -zeta 0.3",
    "hopper-disk": f"hopper -model disk {SMALL}",
    "hopper-disk-3d": f"hopper -model disk -dim 3 {SMALL}",
    "hopper-ts": f"hopper {SMALL} -zeta 0.3 -integrator ts",
    "discharge": f"hopper {SMALL} -zeta 0.3 -flow discharge -size_distribution normal",
    "channel": f"{PUSH} -stroke 1",
    "channel-rough": f"{PUSH} -stroke 0.5 -model rough -n_vertices 12 -area_fraction 0.5",
    "raft": "raft -rows 4 -columns 4 -t_end 20",
    "clog": "clog -n 20 -hopper_width 3 -t_end 20",
}
GOOD = {0: "done", 2: "bad input", 3: "numerical failure", 4: "output failure", 5: "out of memory", 6: "folder in use",
        75: "stopped"}


def run(program, options, folder, seconds):
    """(exit code, standard error) of a run that gets a signal to stop after so many seconds."""
    child = subprocess.Popen([program, *options, "-output", str(folder)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                             encoding="utf-8", errors="replace", env=os.environ | {"OMP_NUM_THREADS": "1"})
    try:
        errors = child.communicate(timeout=seconds)[1]
    except subprocess.TimeoutExpired:
        child.terminate()
        try:
            errors = child.communicate(timeout=60)[1]
        except subprocess.TimeoutExpired:
            child.kill()
            return None, child.communicate()[1]
    return child.returncode, errors


def numbers(program, case, scratch, seconds):
    """{name: value} of the non-zero numeric options of a case, with automatic values from the summary."""
    code, errors = run(program, case.split(), scratch / "defaults", seconds)
    if code != 0:
        sys.exit(f"option_sweep.py: {case}: {errors}")
    with Run(scratch / "defaults") as finished:
        options, found = finished.manifest["options"], finished.summary
    values = {name: option["value"] if option["value"] is not None else found.get(name)
              for name, option in options.items()}
    return {name: value for name, value in values.items()
            if isinstance(value, (int, float)) and not isinstance(value, bool) and value != 0}


def judge(code, errors):
    """The finding about the end of a run, or nothing."""
    if code is None:
        return "hangs: does not stop at SIGTERM"
    if code not in GOOD:
        return f"exit code {code}: {errors[-300:]}"
    lines = [line for line in errors.splitlines() if ": error: " in line]
    if code in (0, 75):
        return "an error that does not end the run" if lines else ""
    if len(lines) != 1 or "internal" in lines[0]:
        return f"exit code {code} without one line: {errors[-300:]}"
    return "" if any(cure in lines[0] for cure in (";", ",", "must be")) else f"a message without a cure: {lines[0]}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=", ".join(CASES))
    parser.add_argument("--program", default=str(ROOT / "build/apps/pliant"), help="default: that of the build")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="runs at a time (default: 2)")
    parser.add_argument("--seconds", type=float, default=20, metavar="X", help="of a run, before it is stopped (20)")
    parser.add_argument("--messages", action="store_true", help="print the message of every run that ends with an error")
    given = parser.parse_args()
    if not set(given.cases) <= set(CASES):
        parser.error(f"cases are {', '.join(CASES)}")
    bad = 0
    for name in given.cases or CASES:
        with tempfile.TemporaryDirectory(prefix="pliant-options-") as folder:
            scratch, case = Path(folder), CASES[name]
            todo = [(option, type(value)(value * 10) if up else value / 10)
                    for option, value in numbers(given.program, case, scratch, given.seconds).items() for up in (True, False)
                    if up or not isinstance(value, int) or value % 10 == 0]
            todo = [(option, int(value) if float(value).is_integer() else value) for option, value in todo]
            with ThreadPoolExecutor(given.jobs) as pool:
                ends = list(pool.map(lambda one: run(given.program, [*case.split(), f"-{one[1][0]}", str(one[1][1])],
                                                     scratch / f"run{one[0]}", given.seconds), enumerate(todo)))
        codes = Counter(code for code, _ in ends)
        print(f"{name}: {len(ends)} runs, " +
              ", ".join(f"{number} {GOOD.get(code, code)}" for code, number in sorted(codes.items(), key=str)), flush=True)
        for (option, value), (code, errors) in zip(todo, ends):
            if given.messages and code not in (0, 75):
                print(f"  -{option} {value}: {errors.strip()}")
            if finding := judge(code, errors):
                bad += 1
                print(f"  FOUND -{option} {value}: {finding}", flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
