#!/usr/bin/python3
"""Damages the files of a small run in many ways, one at a time, and checks that nothing wrong comes of it.

  scripts/flip_bits.py [--program FILE] [--frames NAME] [--file NAME] [--stride N] [--whole] [PART …]

Parts (default: all):
  reader      run.h5 and summary.json, read by python/pliant: all data as they were, or RunError
  restart     run.h5 under -restart: the run ends as without the flip, or exit code 2 or 4 with one line
  checkpoint  both checkpoints under -restart: the same

Every N-th byte is changed, one bit of it, another one at each byte; --whole: all bits of every byte. At each 20th of these
bytes, the file is also cut, and a sector of zeros is put there. Findings are a process that dies of a signal, a
traceback and a value that differs: the script prints them, with exit code 1.
"""

import argparse
import hashlib
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "python"))

from pliant import PliantError, Run  # noqa: E402
from pliant.sweep import sweep_table  # noqa: E402

CUT, ZEROS = "cut", "zeros"
SECTOR = 512  # bytes
#: The files that a part damages.
PARTS = {"reader": ("run.h5", "summary.json"), "restart": ("run.h5",), "checkpoint": ("checkpoint-a.h5", "checkpoint-b.h5")}
# Few particles, so that most bytes belong to the format.
OPTIONS = {"n": 12, "hopper_wall_distance": 5, "hopper_width": 3, "zeta": 0.3, "mu": 0.5, "pack_fraction": 0.7,
           "frame_interval": 0.5, "sample_interval": 0.1}
# Default frames, and smaller frames.
FRAMES = {"whole": {},
          "small": {"frame_fields": "velocities,contacts", "frame_precision": "single", "frame_deflate": 6}}
CLOCK = ("cpu_seconds", "wall_seconds", "particle_steps_per_second", "ns_per_particle_step", "ns_per_vertex_step", "parameters",
         "longest_sample_interval")


def pliant(program, **options):
    """The finished process."""
    words = [text for name, value in options.items() for text in (f"-{name}", str(value))]
    return subprocess.run([program, "hopper", *words], capture_output=True, encoding="utf-8", errors="replace", timeout=300,
                          env=os.environ | {"OMP_NUM_THREADS": "1"})


def make_run(program, folder, frames="whole"):
    """A small run with a checkpoint of its start and one of its end."""
    options = OPTIONS | FRAMES[frames]
    for result in (pliant(program, output=folder, **options, t_end=0.5), pliant(program, restart=folder, t_end=1)):
        if result.returncode != 0:
            sys.exit(f"flip_bits.py: {result.stderr}")
    return folder


def flips(size, stride, whole=False):
    """(byte, how) of a file of this size; how: the bit, CUT or ZEROS."""
    bits = [(at, bit) for at in range(size) for bit in range(8)] if whole else [(at, at // stride % 8)
                                                                               for at in range(0, size, stride)]
    return bits + [(at, how) for at, _ in bits[::20] for how in (CUT, ZEROS)]


def flipped(data, at, how):
    """The bytes of a damaged file."""
    if how == CUT:
        return data[:at]
    if how == ZEROS:
        return data[:at] + bytes(min(SECTOR, len(data) - at)) + data[at + SECTOR:]
    changed = bytearray(data)
    changed[at] ^= 1 << how
    return bytes(changed)


# ---- content of a run ---------------------------------------------------------------------------------------------


def _values(value):
    """Text of a value that differs wherever a bit does."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()}"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_values(value[key])}" for key in sorted(value)) + "}"
    if hasattr(value, "to_numpy"):
        return f"{list(value.columns)} {_values(value.to_numpy(dtype=float))}"
    return repr(value)


def frame_values(frame, chosen):
    """Text of a frame with the fields `chosen`, as -frame_fields names them."""
    fields = [name for name in ("velocities", "contact_count", "wall_force", "contacts")
              if chosen == "all" or name in chosen.split(",")]
    return f"{frame.time!r} {frame.step} " + " ".join(_values(getattr(frame, name))
                                                      for name in ("positions", "centres", "active", *fields))


def everything(folder):
    """{part: text} of all data that the reader returns for a run. Raises RunError."""
    with Run(folder) as run:
        geometry, topology = run.geometry, run.topology
        return {"manifest": _values(run.manifest), "summary": _values(run.summary), "series": _values(run.series),
                "vectors": _values(run.vector_series), "events": _values(run.events), "height": _values(run.profile.height),
                "topology": _values(vars(topology)), "geometry": _values(vars(geometry)),
                "frames": "\n".join(frame_values(frame, run.options["frame_fields"]) for frame in run.frames),
                "row": _values(sweep_table([run]).drop(columns="run").iloc[0].to_dict())}


# ---- the reader --------------------------------------------------------------------------------------------------------


def judge(folder, truth):
    """Result of the reader for a folder: same, refused, or a description of the fault."""
    try:
        found = everything(folder)
    except PliantError as error:
        return "refused" if "\n" not in str(error) else f"a message of several lines: {error!r}"
    except Exception as error:  # noqa: BLE001 - any is a finding
        return f"{type(error).__name__}: {error}"
    different = [part for part in truth if found[part] != truth[part]]
    return f"other values: {', '.join(different)}" if different else "same"


def _read_in_child(folder, name, data, todo, truth):
    """The verdict on each change from a child process, as they come, until it is done or dead."""
    receive, send = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(receive)
        with open(send, "w", encoding="utf-8") as out:
            for at, how in todo:
                (folder / name).write_bytes(flipped(data, at, how))
                print(json.dumps(judge(folder, truth)), file=out, flush=True)
        os._exit(0)
    os.close(send)
    judged = 0
    with open(receive, encoding="utf-8") as lines:
        for judged, line in enumerate(lines, 1):
            yield json.loads(line)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if judged < len(todo):
        yield f"killed by signal {-code}"


def check_reader(run, name, chosen, progress=False):
    """[(byte, how, verdict)] of a file of a run. progress: a line after each twentieth of the changes, and the findings
    at once."""
    with tempfile.TemporaryDirectory(prefix="pliant-flips-") as scratch:
        folder = Path(scratch) / "run"
        shutil.copytree(run, folder)
        truth, data = everything(folder), (run / name).read_bytes()
        found = []
        while len(found) < len(chosen):
            left = chosen[len(found):]
            for verdict, (at, how) in zip(_read_in_child(folder, name, data, left, truth), left):
                found.append((at, how, verdict))
                if progress and verdict not in GOOD:
                    print(f"  {name}, byte {at}, {how}: {verdict}", flush=True)
                if progress and len(found) % max(1, len(chosen) // 20) == 0:
                    print(f"  {name}: {len(found)} of {len(chosen)} changes", flush=True)
    return found


# ---- the program -------------------------------------------------------------------------------------------------------


def end_of(folder):
    """The end of a resumed run: the newest state, the counters of the summary, and the data of the reader, with the
    frames that it refuses."""
    states = []
    for path in sorted(folder.glob("checkpoint-[ab].h5")):
        with h5py.File(path) as file:
            state = file["state"]
            states.append((int(state.attrs["step"]), {name: state[name][()].tobytes() for name in state if name not in CLOCK}))
    with Run(folder) as run:
        frames = []
        for index in range(len(run.frames)):
            try:
                frames.append(frame_values(run.frames[index], run.options["frame_fields"]))
            except PliantError:
                frames.append(None)
        counters = {name: value for name, value in run.summary.items() if name not in CLOCK}
        values = {"summary": _values(counters), "series": _values(run.series), "vectors": _values(run.vector_series),
                  "events": _values(run.events)}
    return max(states, key=lambda state: state[0]), values, frames


def judge_restart(program, folder, truth):
    """Result of the program for a folder: same, refused, or a description of the fault."""
    result = pliant(program, restart=folder, t_end=1.5)
    lines = result.stderr.splitlines()
    if result.returncode not in (0, 2, 4):
        return f"exit code {result.returncode}: {result.stderr[-200:]}"
    if len(lines) > (result.returncode != 0) + 1 or any("internal" in line or "HDF5-DIAG" in line for line in lines):
        return f"messages: {result.stderr[-300:]}"
    if result.returncode:
        return "refused" if lines and "error: " in lines[-1] else f"exit code {result.returncode} without a line"
    try:
        state, values, frames = end_of(folder)
    except Exception as error:  # noqa: BLE001 - any is a finding
        return f"the continued run cannot be read: {type(error).__name__}: {error}"
    different = [name for name in values if values[name] != truth[1][name]]
    if state != truth[0] or different:
        return f"another end: {', '.join(different) or 'state'}"
    if len(frames) != len(truth[2]) or any(a not in (None, b) for a, b in zip(frames, truth[2])):
        return "other frames"
    if None in frames and not lines:
        return "a damaged frame that no line names"
    return "same" if not lines else "same, with a warning"


def check_program(program, run, name, chosen, until=float("inf")):
    """[(byte, how, verdict)] of a file of a run; fewer at the time `until`."""
    found = []
    with tempfile.TemporaryDirectory(prefix="pliant-flips-") as scratch:
        folder = Path(scratch) / "run"
        shutil.copytree(run, folder)
        if (result := pliant(program, restart=folder, t_end=1.5)).returncode != 0:
            sys.exit(f"flip_bits.py: {result.stderr}")
        truth, data = end_of(folder), (run / name).read_bytes()
        for at, how in chosen:
            if time.monotonic() > until:
                break
            shutil.rmtree(folder)
            shutil.copytree(run, folder)
            (folder / name).write_bytes(flipped(data, at, how))
            found.append((at, how, judge_restart(program, folder, truth)))
    return found


# ---- the command -------------------------------------------------------------------------------------------------------

GOOD = ("same", "same, with a warning", "refused")


def check(part, files, program, run, stride, whole, seconds):
    """[(file, byte, how, verdict)] of a part; of the program's, each file for so many seconds at most."""
    found = []
    for name in files:
        chosen = flips((run / name).stat().st_size, stride, whole)
        judged = check_reader(run, name, chosen, progress=True) if part == "reader" else \
            check_program(program, run, name, random.Random(1).sample(chosen, len(chosen)), time.monotonic() + seconds)
        found += [(name, *one) for one in judged]
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--program", default=str(ROOT / "build/apps/pliant"), help="default: that of the build")
    parser.add_argument("--frames", choices=FRAMES, default="whole",
                        help="small: chosen fields, single precision and compressed (default: whole)")
    parser.add_argument("--file", metavar="NAME", help="damage this file only, such as summary.json (default: all of the parts)")
    parser.add_argument("--stride", type=int, default=1, metavar="N", help="change every N-th byte (default: each)")
    parser.add_argument("--whole", action="store_true", help="all bits of every byte")
    parser.add_argument("--seconds", type=float, default=float("inf"), metavar="X",
                        help="end restarts from a file after so long, in random order (default: when all are done)")
    given = parser.parse_args()
    if given.stride < 1 or not set(given.parts) <= set(PARTS):
        parser.error(f"--stride must be positive, and parts are {', '.join(PARTS)}")
    chosen = {part: [name for name in PARTS[part] if given.file in (None, name)] for part in given.parts or PARTS}
    if not any(chosen.values()):
        parser.error(f"--file: no part of {', '.join(chosen)} damages {given.file}")
    bad = 0
    with tempfile.TemporaryDirectory(prefix="pliant-flips-") as scratch:
        run = make_run(given.program, Path(scratch) / "run", given.frames)
        for part, files in chosen.items():
            found = check(part, files, given.program, run, given.stride, given.whole, given.seconds)
            for name in dict.fromkeys(name for name, *_ in found):
                counts = Counter(verdict for file, *_, verdict in found if file == name)
                good = ", ".join(f"{counts[verdict]} {verdict}" for verdict in GOOD if counts[verdict])
                wrong = sum(counts.values()) - sum(counts[verdict] for verdict in GOOD)
                print(f"{part}, {name} of {(run / name).stat().st_size} bytes: {sum(counts.values())} changes, {good}; {wrong} findings", flush=True)
                bad += wrong
            for name, at, how, verdict in [one for one in found if one[3] not in GOOD][:20]:
                print(f"  {name}, byte {at}, {how if how in (CUT, ZEROS) else f'bit {how}'}: {verdict}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
