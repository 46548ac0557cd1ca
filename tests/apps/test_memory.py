"""Runs whose n-th allocation fails, for many n.

A preloaded library (tests/support/memory.c) makes the n-th allocation of the program, or of a library, fail. A run then
ends with exit code 5 and one line, or does without; -restart, or the same command, brings it to its end.
PLIANT_ALL_ALLOCATIONS=N tries N places per case and prints how the runs have ended.
"""

import os
import re
import subprocess
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from conftest import HANGS, PROGRAM, SMALL, Results, arguments, assert_same_runs

MEMORY = os.environ.get("PLIANT_TEST_MEMORY",
                        str(Path(PROGRAM).resolve().parents[1] / "tests/libpliant_test_memory.so"))
ALL = int(os.environ.get("PLIANT_ALL_ALLOCATIONS", "0"))
OUT_OF_MEMORY = 5
HOPPER = ("hopper", {**SMALL, "t_end": 1, "frame_interval": 0.2, "checkpoint_interval": 1e-4})
RAFT = ("raft", {"rows": 4, "columns": 5, "frame_interval": 20, "t_end": 60})
# Lists of several chunks, which threads make.
THREADS = ("hopper", {"n": 4200, "hopper_width": 3, "zeta": 0.3, "mu": 0.5, "t_end": 0.005, "frame_interval": 0.005,
                      "sample_interval": 0.005, "hopper_wall_distance": 60, "threads": 2})


def run(command, options, **settings):
    assert Path(MEMORY).exists(), f"{MEMORY}: build the tests"
    environment = {f"PLIANT_MEMORY_{name.upper()}": str(value) for name, value in settings.items()}
    if settings:
        environment["LD_PRELOAD"] = MEMORY
    return subprocess.run([PROGRAM, command, *arguments(options)], encoding="utf-8", capture_output=True, timeout=HANGS,
                          env={**os.environ, **environment})


def places(total, number):
    """Numbers of allocations: all where there are few, else evenly spaced, and more of the first."""
    number = ALL or number
    if total <= number:
        return list(range(1, total + 1))
    return sorted({1 + round((total - 1) * (k / (number - 1)) ** 1.5) for k in range(number)})


class Case:
    def __init__(self, tmp_path, command, options, **settings):
        self.tmp_path, self.command, self.options, self.settings = tmp_path, command, options, settings
        whole, count = tmp_path / "whole", tmp_path / "count"
        result = run(command, {**options, "output": whole}, count=count, **settings)
        assert result.returncode == 0, result.stderr
        self.whole, self.allocations = Results(whole), int(count.read_text(encoding="utf-8"))

    def fails(self, place):
        """Runs with this allocation failing, and then to its end. Returns the error of the first run, and its exit code."""
        folder = self.tmp_path / f"run{place}"
        first = run(self.command, {**self.options, "output": folder}, fails=place, **self.settings)
        found = [line for line in first.stderr.splitlines() if line.startswith("pliant: error: ")]
        if first.returncode != 0:
            checkpoint = any(folder.glob("checkpoint-?.h5"))
            again = {"restart": folder} if checkpoint else {**self.options, "output": folder}
            second = run(self.command, again)
            assert second.returncode == 0, f"allocation {place}: {first.stderr} then {second.stderr}"
        assert_same_runs(Results(folder), self.whole)
        return first.returncode, found

    def loop(self, number, check):
        with ThreadPoolExecutor(2) as pool:
            ends = Counter()
            for place, (code, found) in zip(places(self.allocations, number),
                                            pool.map(self.fails, places(self.allocations, number))):
                check(place, code, found)
                ends[code] += 1
        print(f"{self.command} {self.settings}: {self.allocations} allocations, exit codes {dict(ends)}")
        return ends


def check_program(place, code, found):
    assert code in (0, OUT_OF_MEMORY), f"allocation {place}: exit code {code}: {found}"
    assert len(found) == (code != 0)
    if code != 0:
        assert re.match(r"pliant: error: out of memory(: .* could not be allocated while \S+ MB were in use)?; free memory "
                        "on this machine", found[0]), found[0]


@pytest.mark.parametrize("command, options", [HOPPER, RAFT], ids=["hopper", "raft"])
def test_allocations_of_the_program(command, options, tmp_path):
    ends = Case(tmp_path, command, options).loop(12, check_program)
    assert ends[OUT_OF_MEMORY] > 6


def test_allocations_of_threads(tmp_path):
    """A failed allocation in a parallel region ends the program like any other."""
    command, options = THREADS
    ends = Case(tmp_path, command, options).loop(5, check_program)
    assert ends[OUT_OF_MEMORY] > 2


def test_no_memory_from_some_point_on(tmp_path):
    """With nothing left, not even for the message."""
    command, options = HOPPER
    case = Case(tmp_path, command, options)
    # Without the last allocations, which MPI and PETSc do not survive in their shutdown.
    for place in places(case.allocations * 9 // 10, 5):
        folder = tmp_path / f"none{place}"
        result = run(command, {**options, "output": folder}, fails=place, all=1)
        assert result.returncode == OUT_OF_MEMORY and "error: out of memory" in result.stderr, (place, result.stderr)
        checkpoint = any(folder.glob("checkpoint-?.h5"))
        result = run(command, {"restart": folder} if checkpoint else {**options, "output": folder})
        assert result.returncode == 0, result.stderr
        assert_same_runs(Results(folder), case.whole)


def test_allocations_of_hdf5(tmp_path):
    """HDF5 reports most allocations that fail, some as a file that cannot be read or written. Other failed allocations
    end HDF5 by a signal or with MPI's code 255: the run can be continued then, too."""
    command, options = HOPPER
    options = {**options, "t_end": 0.4, "checkpoint_interval": 0.1}

    def check(place, code, found):
        assert code in (0, 2, 3, 4, OUT_OF_MEMORY, 255, -6, -11), f"allocation {place}: exit code {code}: {found}"
        assert len(found) == (code != 0) or (code in (255, -6, -11) and not found)

    Case(tmp_path, command, options, of="libhdf5").loop(40, check)
