"""Runs the program as a user does: as a process, judged by its output, exit code and files."""

import json
import os
import resource
import shutil
import signal
import subprocess
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

# Open MPI otherwise waits a fifth of a second for networks that are not there, on several ranks too.
for _name, _value in {"OMPI_MCA_pml": "ob1", "OMPI_MCA_btl": "self,vader"}.items():
    os.environ.setdefault(_name, _value)

# A shell that starts the tests in the background ignores these signals, and the programs would inherit this.
for _signal, _handler in {signal.SIGINT: signal.default_int_handler, signal.SIGQUIT: signal.SIG_DFL}.items():
    if signal.getsignal(_signal) is signal.SIG_IGN:
        signal.signal(_signal, _handler)

PROGRAM = os.environ.get("PLIANT_PROGRAM", "pliant")
# Seconds after which a process counts as hanging, also on a busy machine.
HANGS = 300
# A small hopper that flows at once: 60 particles, a few milliseconds per t0.
SMALL = {"n": 60, "hopper_wall_distance": 8, "hopper_width": 3, "zeta": 0.3, "mu": 0.5, "pack_fraction": 0.8,
         "t_end": 6, "frame_interval": 0.5, "sample_interval": 0.1}


def pytest_configure(config):
    config.addinivalue_line("markers", "ranks: starts mpiexec; ctest runs these by themselves (tests/CMakeLists.txt)")


def pytest_collection_modifyitems(items):
    if shutil.which("mpiexec") is None:
        for item in items:
            if item.get_closest_marker("ranks"):
                item.add_marker(pytest.mark.skip(reason="no mpiexec"))


def arguments(options):
    return [text for name, value in options.items() for text in (f"-{name}", str(value))]


def start(*command, **options):
    """The program as a child process, its output in pipes."""
    return subprocess.Popen([PROGRAM, *map(str, command), *arguments(options)], encoding="utf-8", stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE)


def pliant(*command, **options):
    """Runs the program to its end."""
    return subprocess.run([PROGRAM, *map(str, command), *arguments(options)], encoding="utf-8", capture_output=True,
                          timeout=HANGS)


def cpu_seconds_of_children():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def killed_after(cpu_seconds, *command, **options):
    """Runs the program; the system kills it after a given CPU time, independent of the load of the machine, by a signal
    that it does not handle. Returns whether this was before the end of the run."""
    child = subprocess.Popen([PROGRAM, *map(str, command), *arguments(options)], encoding="utf-8", stdout=subprocess.PIPE,
                             stderr=subprocess.PIPE, preexec_fn=lambda: signal.setitimer(signal.ITIMER_PROF, cpu_seconds))
    _, errors = child.communicate(timeout=HANGS)
    assert child.returncode in (0, -signal.SIGPROF), errors
    # A program that has written its summary may be killed while it closes down.
    return child.returncode != 0 and not (Path(options["output"]) / "summary.json").exists()


def killed_with(file, *command, output, **options):
    """Runs the program, and kills it once its folder has a file of that name."""
    child = start(*command, output=output, **options)
    wait_for((output / file).exists, child)
    end(child, signal.SIGKILL)


def stopped_until_done(*command, **options):
    """The same command until it is done, with three times the wall time of the last one, so that it is stopped several times
    on any machine. The number of stops."""
    wall_time, stops = 1e-3, 0
    while True:
        result = pliant(*command, **options, max_wall_time=wall_time)
        assert result.returncode in (0, 75) and result.stderr == "", result.stderr
        if result.returncode == 0:
            return stops
        assert "run the same command again" in result.stdout
        assert json.loads((Path(options["output"]) / "summary.json").read_text(encoding="utf-8"))["status"] == "stopped"
        wall_time, stops = 3 * wall_time, stops + 1


def hopper(folder, **options):
    """Runs the small hopper with some options changed; the run must succeed."""
    result = pliant("hopper", output=folder, **{**SMALL, **options})
    assert result.returncode == 0, result.stderr
    return Results(folder)


class Results:
    """The data of a run, read with h5py only."""

    def __init__(self, folder):
        self.folder = folder = Path(folder)
        self.frames, self.series, self.events, self.topology = [], {}, {}, {}
        with h5py.File(folder / "run.h5") as file:
            for name in sorted(file["frames"]):
                frame = {}
                file["frames"][name].visititems(
                    lambda path, item: frame.update({path: item[()]}) if isinstance(item, h5py.Dataset) else None)
                frame.update(file["frames"][name].attrs)
                self.frames.append(frame)
            self.series = {name: file["series"][name][()] for name in file["series"]}
            self.events = {name: item[()] for name, item in file.get("events", {}).items()}
            self.topology = {name: item[()] for name, item in file["topology"].items() if isinstance(item, h5py.Dataset)}
            self.geometry = {"segments": file["geometry/segments"][()], **file["geometry"].attrs}
        summary = folder / "summary.json"
        self.summary = json.loads(summary.read_text(encoding="utf-8")) if summary.exists() else None
        for name in ("format", "crc32"):
            (self.summary or {}).pop(name, None)

    def column(self, name):
        """[frames, …] of a dataset of every frame."""
        return np.array([frame[name] for frame in self.frames])

    def counters(self):
        """All entries of the summary that do not depend on the clock or on stops of the run."""
        clock = ("cpu_seconds", "wall_seconds", "particle_steps_per_second", "ns_per_particle_step",
                 "ns_per_vertex_step", "parameters")
        return {name: value for name, value in self.summary.items() if name not in clock}


def same(a, b):
    """Whether two datasets are equal bit for bit."""
    a, b = np.asarray(a), np.asarray(b)
    return a.shape == b.shape and a.tobytes() == b.tobytes()


def assert_same_runs(a, b):
    assert len(a.frames) == len(b.frames)
    for n, (one, other) in enumerate(zip(a.frames, b.frames)):
        assert one.keys() == other.keys()
        for name in one:
            assert same(one[name], other[name]), f"frame {n}: {name}"
    assert a.series.keys() == b.series.keys()
    for name in a.series:
        assert same(a.series[name], b.series[name]), f"series {name}"
    assert a.events.keys() == b.events.keys()
    for name in a.events:
        assert same(a.events[name], b.events[name]), f"events {name}"
    assert a.counters() == b.counters()


def wait_for(condition, process=None):
    end = time.monotonic() + HANGS
    while not condition():
        assert time.monotonic() < end, "waited too long"
        assert process is None or process.poll() is None, f"ended too early: {process.communicate()}"
        time.sleep(0.01)


def end(process, how=signal.SIGTERM):
    """Sends a signal; exit code, standard output, standard error."""
    process.send_signal(how)
    output, errors = process.communicate(timeout=HANGS)
    return process.returncode, output, errors
