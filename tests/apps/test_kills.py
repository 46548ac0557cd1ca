"""run.h5 whenever the program is killed: every prefix of the writes of a run is replayed.

A preloaded library (tests/support/disk.c) records the writes of a run to its folder. From these the test makes the folders that would exist if the
program had been killed after each of the writes, or within it. PLIANT_ALL_KILLS=1 continues all
states that differ; otherwise some from each part of the run.
"""

import os
import shutil
import struct
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import pytest
from conftest import HANGS, PROGRAM, SMALL, Results, arguments, assert_same_runs, pliant, same, start, wait_for
from test_parallel import mpi_environment, needs_mpi

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))

from pliant import Run  # noqa: E402
from pliant.run_file import _journal  # noqa: E402

DISK = os.environ.get("PLIANT_TEST_DISK", str(Path(PROGRAM).resolve().parents[1] / "tests/libpliant_test_disk.so"))
ALL = os.environ.get("PLIANT_ALL_KILLS") == "1"
# The program writes a checkpoint whenever it reads the clock, frames and samples in between.
OFTEN = {"checkpoint_interval": 1e-4}
HOPPER = ("hopper", {**SMALL, "t_end": 6, "frame_interval": 0.3, "sample_interval": 0.02, **OFTEN})
CLOG = ("clog", {"n": 14, "g": 0.1, "hopper_width": 1.25, "phi_c": 3e-4, "dt": 0.2, "frame_interval": 20,
                 "sample_interval": 2, **OFTEN})


def on_disk(folder, *command, environment=None, **settings):
    """Runs a command whose files below `folder` are on the disk for tests."""
    assert Path(DISK).exists(), f"{DISK}: build the tests"
    settings = {f"PLIANT_DISK_{name.upper()}": str(value) for name, value in settings.items()}
    return subprocess.run(command, encoding="utf-8", capture_output=True, timeout=HANGS, env={
        **(environment or os.environ), **settings, "PLIANT_DISK_FOLDER": str(folder), "LD_PRELOAD": DISK})


class Change:
    """A change of the folder: created, written, cut, renamed or removed; or a sync, which changes nothing here."""

    def __init__(self, kind, name, offset, data):
        self.kind, self.name, self.offset, self.data = kind, name, offset, data

    def made(self, files, size=None):
        """Makes it, or the first `size` bytes of it, in a dict of the files' bytes."""
        files = dict(files)
        old = files.get(self.name, b"")
        if self.kind == "O":
            files[self.name] = b""
        elif self.kind == "W":
            data = self.data if size is None else self.data[:size]
            files[self.name] = old[:self.offset].ljust(self.offset, b"\0") + data + old[self.offset + len(data):]
        elif self.kind == "T":
            files[self.name] = old[:self.offset].ljust(self.offset, b"\0")
        elif self.kind == "R":
            files[self.data.decode()] = files.pop(self.name)
        elif self.kind == "U":
            del files[self.name]
        return files


def changes(log, folder):
    data, at, prefix = log.read_bytes(), 0, len(str(folder)) + 1
    while at < len(data):
        kind, length, offset, size = struct.unpack_from("<cIQQ", data, at)
        at += 21
        path, content = data[at:at + length].decode(), data[at + length:at + length + size]
        at += length + size
        if kind == b"R":
            content = content[prefix:]
        yield Change(kind.decode(), path[prefix:], offset, content)


def states_of(recorded):
    """The files after each change: bytes by name."""
    files = {}
    for change in recorded:
        files = change.made(files)
        yield files


def journal(data):
    """(end, changes) of the journal that the bytes of a run.h5 end with, or None."""
    with tempfile.TemporaryFile() as file:
        file.write(data)
        file.flush()
        return _journal(file.fileno(), len(data))


def promised(data):
    """(bytes that count, whether the file was at rest) of run.h5; no bytes before the first commit."""
    found = journal(data)
    if found is not None:
        end, parts = found
        data = bytearray(data[:end])
        for address, part in parts:
            data[address:address + len(part)] = part
        return bytes(data), False
    if not data.startswith(b"\x89HDF"):
        return None, False
    assert data[8] == 2  # version of the head
    (end,) = struct.unpack_from("<Q", data, 28)
    assert len(data) >= end
    return data[:end], len(data) == end


class Replay:
    """The writes of a run, and the states of its folder."""

    def __init__(self, tmp_path, command, options, launcher=(), environment=None):
        self.folder, log = tmp_path / "run", tmp_path / "log"
        result = on_disk(self.folder, *launcher, PROGRAM, command, *arguments({**options, "output": self.folder}),
                         environment=environment, log=log)
        assert result.returncode == 0, result.stderr
        self.command, self.tmp_path = command, tmp_path
        self.whole = Results(self.folder)
        self.changes = list(changes(log, self.folder))
        for files in self.states():
            pass
        for name, data in files.items():
            assert (self.folder / name).read_bytes() == data, f"{name} is not what was recorded"

    def states(self):
        """The files after each change, and within each that writes: bytes by name."""
        files = {}
        for change in self.changes:
            if change.kind == "W" and len(change.data) > 1:
                yield change.made(files, len(change.data) // 2)
            files = change.made(files)
            yield files

    def write(self, files, folder):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for name, data in files.items():
            (folder / name).write_bytes(data)

    def check(self):
        """Each state counts as a commit or the next one. Returns the number of commits, and for each of them and each pair
        of checkpoints the first state of the folder with the longest run.h5: with a complete journal, of which no
        change has been applied."""
        commits = [None]
        for files in self.states():
            data, quiet = promised(files.get("run.h5", b""))
            if quiet and data != commits[-1]:
                commits.append(data)
        for data in commits[1:]:
            self.check_commit(data)
        frames = list(self.frames_of(commits))
        commit, distinct = 0, {}
        for files in self.states():
            data, _ = promised(files.get("run.h5", b""))
            if data != commits[commit]:
                assert commit + 1 < len(commits) and data == commits[commit + 1], "neither the last commit nor the next"
                commit += 1
            # run.xdmf names existing frames only; checkpoints refer to existing data only.
            assert files.get("run.xdmf", b"").count(b"<Time ") <= frames[commit]
            pair = [files.get(f"checkpoint-{x}.h5", b"")[:80] for x in "ab"]  # their heads distinguish them
            if any(pair):
                assert commit > 0
                found = distinct.setdefault((commit, *pair), files)
                if len(files["run.h5"]) > len(found["run.h5"]):
                    distinct[commit, *pair] = files
        return len(commits) - 1, list(distinct.values())

    def frames_of(self, images):
        for data in images:
            if data is None:
                yield 0
                continue
            self.write({"run.h5": data}, self.tmp_path / "state")
            with h5py.File(self.tmp_path / "state/run.h5") as file:
                yield len(file["frames"])

    def check_commit(self, data):
        """All frames, rows and events of a commit are the run's."""
        folder = self.tmp_path / "state"
        self.write({"run.h5": data}, folder)
        part = Results(folder)
        for name, rows in part.series.items():
            assert same(rows, self.whole.series[name][:len(rows)])
        for name, rows in part.events.items():
            assert same(rows, self.whole.events[name][:len(rows)])
        assert len(part.frames) <= len(self.whole.frames)
        for frame, whole in zip(part.frames, self.whole.frames):
            assert frame.keys() == whole.keys() and all(same(frame[name], whole[name]) for name in frame)

    def read(self, files):
        """Reads the data that users read, with checksums. Returns the numbers of frames and of samples."""
        folder = self.tmp_path / "state"
        self.write(files, folder)
        with Run(folder) as run:
            run.options, run.topology, run.geometry
            samples = len(run.series) if "series" in run._file and run._file["series"].names() else 0
            for frame in run.frames:
                frame.positions, frame.velocities, frame.contacts
            return len(run.frames), samples

    def continued(self, states, check, *launcher, **options):
        """Resumes from each state; check(results)."""

        def go_on(numbered):
            number, files = numbered
            folder = self.tmp_path / f"continued{number}"
            self.write(files, folder)
            command = [*launcher, PROGRAM, self.command, *arguments({"restart": folder, **options})]
            environment = mpi_environment() if launcher else os.environ
            return folder, subprocess.run(command, encoding="utf-8", capture_output=True, timeout=HANGS, env=environment)

        with ThreadPoolExecutor(2) as pool:
            for folder, result in pool.map(go_on, enumerate(states)):
                assert result.returncode == 0 and result.stderr == "", result.stderr
                check(Results(folder))
                shutil.rmtree(folder)


def some(states, count):
    return states if ALL else states[::max(1, len(states) // count)]


@pytest.mark.parametrize("command, options", [HOPPER, CLOG], ids=["hopper", "clog"])
def test_every_kill(command, options, tmp_path):
    replay = Replay(tmp_path, command, options)
    commits, states = replay.check()
    assert len(replay.whole.frames) > 5 and len(states) > 10 and commits > len(replay.whole.frames)
    for files in some(states, 10):
        found = replay.read(files)
        assert found == replay.read({**files, "run.h5": promised(files["run.h5"])[0]})
    if command == "clog":  # a finished clog continues until it ends again
        last = [files[name] for files in states[-1:] for name in ("checkpoint-a.h5", "checkpoint-b.h5")]
        states = [files for files in states if [files.get("checkpoint-a.h5"), files.get("checkpoint-b.h5")] != last]
    replay.continued(some(states, 15), lambda run: assert_same_runs(run, replay.whole), checkpoint_interval=0)


@needs_mpi
def test_every_kill_on_ranks(tmp_path):
    launcher = ("mpiexec", "-n", "2")
    command, options = HOPPER
    replay = Replay(tmp_path, command, {**options, "t_end": 2}, launcher, mpi_environment())
    _, states = replay.check()

    def check(run):  # equal within rounding only, on ranks
        assert len(run.frames) == len(replay.whole.frames) and run.summary["status"] == "done"
        assert same(run.column("time"), replay.whole.column("time"))
        assert same(run.series["time"], replay.whole.series["time"])

    replay.continued(some(states, 3), check, *launcher)


def test_removed_file(tmp_path):
    """A run whose run.h5 has been deleted ends at the next flush, instead of losing data."""
    child = start("hopper", output=tmp_path / "run", **{**SMALL, "t_end": 1e5, "frame_interval": 1})
    wait_for((tmp_path / "run/run.xdmf").exists, child)
    (tmp_path / "run/run.h5").unlink()
    _, errors = child.communicate(timeout=HANGS)
    assert child.returncode == 4 and "run.h5 was removed" in errors


# ---- full disks

@pytest.mark.parametrize("room", [0, 5000, 30000, 60000, 150000, 400000, 700000])
def test_full_disk_without_fallocate(room, tmp_path):
    folder = tmp_path / "run"
    command, options = HOPPER
    options = {**options, "frame_interval": 0.1, "output": folder}
    result = on_disk(folder, PROGRAM, command, *arguments(options), bytes=room)
    assert result.returncode == 4, result.stderr
    lines = [line for line in result.stderr.splitlines() if line.startswith("pliant: error")]
    assert len(lines) == 1 and str(folder) in lines[0] and "No space left on device" in lines[0]
    if room < 400000:
        return
    frames = len(Results(folder).frames)
    assert frames > 0
    whole = pliant(command, **{**options, "output": tmp_path / "whole"})
    assert whole.returncode == 0
    if not list(folder.glob("checkpoint-?.h5")):
        return
    result = pliant(command, restart=folder, checkpoint_interval=0)
    assert result.returncode == 0, result.stderr
    assert_same_runs(Results(folder), Results(tmp_path / "whole"))
