"""The folder of a run after a loss of power: the writes of a run are replayed on a disk that reorders them.

A preloaded library (tests/support/disk.c) records the writes and syncs of a run. The disk of this test may have written any
of the changes since the last sync of a file, sector by sector: each sector, and the length, is as it was at any moment
since then. The names in a folder are as after any of the changes since the last sync of the folder.
PLIANT_ALL_LOSSES=1 makes many more states, continues more of them, and adds a long run, threads and repeated kills.
"""

import functools
import io
import itertools
import json
import os
import random
import re
import shutil
import subprocess
import zlib

import h5py
import pytest
from conftest import HANGS, PROGRAM, SMALL, Results, arguments, assert_same_runs, same
from test_kills import CLOG, OFTEN, Replay, changes, on_disk, promised, states_of
from test_parallel import mpi_environment, needs_mpi

SECTOR = 512
ALL = os.environ.get("PLIANT_ALL_LOSSES") == "1"
SHORT_HOPPER = ("hopper", {**SMALL, "t_end": 2, "frame_interval": 0.3, "sample_interval": 0.05, **OFTEN})
# Its arrays are large pieces, which are written to the file at once.
LARGE_HOPPER = ("hopper", {"n": 4200, "hopper_width": 3, "zeta": 0.3, "mu": 0.5, "t_end": 0.02, "frame_interval": 0.01,
                           "sample_interval": 0.01, "hopper_wall_distance": 60, **OFTEN})
# More frames than one node of HDF5's tree of names has, and time series of several chunks.
LONG_HOPPER = ("hopper", {**SMALL, "t_end": 7, "frame_interval": 0.07, "sample_interval": 0.01, "checkpoint_interval": 0.1})
THREADS = os.environ | {"OMP_NUM_THREADS": "3"}


class Case:
    """A run whose writes are replayed; losses: the number of states of its folder if PLIANT_ALL_LOSSES=1."""

    def __init__(self, run, losses, environment=None):
        self.run, self.losses, self.environment = run, losses, environment


CASES = {"hopper": Case(SHORT_HOPPER, 30000), "clog": Case(CLOG, 30000), "large": Case(LARGE_HOPPER, 1500)}
LONG_CASES = {"long": Case(LONG_HOPPER, 10000), "threads": Case(LARGE_HOPPER, 500, THREADS)}


class File:
    """The bytes at the last sync, and the writes and cuts since then."""

    def __init__(self):
        self.synced, self.pending, self.now = b"", [], b""
        self.contents = {b""}  # at each moment since the last sync

    def change(self, change):
        self.now = change.made({change.name: self.now})[change.name]
        self.pending.append(change)
        self.contents.add(self.now)

    def sync(self):
        self.synced, self.pending, self.contents = self.now, [], {self.now}

    def lost(self, moment, length):
        """Its bytes after a loss of power: sector k as after moment(k) of the pending changes, the length as after `length`
        of them."""
        size = len(self.synced)
        sizes = [size]
        for change in self.pending:
            end = change.offset + len(change.data)
            size = change.offset if change.kind == "T" else 0 if change.kind == "O" else max(size, end)
            sizes.append(size)
        data = bytearray(self.synced.ljust(max(sizes), b"\0"))
        for number, change in enumerate(self.pending, 1):
            first, part = change.offset, change.data
            if change.kind != "W":  # cut bytes come back as zeros
                first = change.offset if change.kind == "T" else 0
                part = bytes(len(data) - first)
            for sector in range(first // SECTOR, (first + len(part) - 1) // SECTOR + 1 if part else 0):
                if moment(sector) >= number:
                    start, end = max(first, sector * SECTOR), min(first + len(part), (sector + 1) * SECTOR)
                    data[start:end] = part[start - first:end - first]
        return bytes(data[:sizes[length]])


class Disk:
    """Files and their names, synced and not."""

    def __init__(self):
        self.synced, self.now, self.pending = {}, {}, []

    @staticmethod
    def renamed(names, change):
        kind, name, file = change
        names = dict(names)
        if kind == "R":
            names.pop(name, None)
            name, file = file
        if kind == "U":
            names.pop(name, None)
        else:
            names[name] = file
        return names

    def change(self, change):
        kind, name = change.kind, change.name
        if kind == "S" and name == "":
            self.synced, self.pending = dict(self.now), []
        elif kind == "S":
            if name in self.now:  # others were removed while they were open
                self.now[name].sync()
        elif kind in "RU" or (kind == "O" and name not in self.now):
            file = {"O": File(), "U": None}.get(kind) if kind != "R" else (change.data.decode(), self.now[name])
            self.pending.append((kind, name, file))
            self.now = self.renamed(self.now, self.pending[-1])
        elif name in self.now:
            self.now[name].change(change)

    def lost(self, choose):
        """The files by name after a loss of power; choose: a random.Random."""
        how = choose.choice(["all", "none", "first", "some"])
        count = choose.randint(0, len(self.pending)) if how == "first" else len(self.pending) * (how != "none")
        names = self.synced
        for change in self.pending[:count]:
            if how != "some" or choose.random() < 0.5:
                names = self.renamed(names, change)
        return {name: self.lost_file(file, choose) for name, file in names.items()}

    @staticmethod
    def lost_file(file, choose):
        last = len(file.pending)
        length = choose.choice([0, last, choose.randint(0, last)])
        how, seed = choose.choice(["any", "all or none", "one", "but one", "in order"]), choose.randrange(1 << 30)
        chosen = choose.randint(0, last)
        if how == "in order":
            return file.lost(lambda sector: chosen, chosen)
        if how == "any":
            return file.lost(lambda sector: zlib.crc32(b"%d %d" % (seed, sector)) % (last + 1), length)
        if how == "all or none":
            return file.lost(lambda sector: zlib.crc32(b"%d %d" % (seed, sector)) % 2 * last, length)
        change = file.pending[chosen - 1] if chosen else None
        sectors = (range(change.offset // SECTOR, (change.offset + len(change.data)) // SECTOR + 1)
                   if change is not None and change.kind == "W" else range(0))
        inside, outside = (last, 0) if how == "one" else (max(0, chosen - 1), last)
        return file.lost(lambda sector: inside if sector in sectors else outside, length)


@functools.lru_cache(maxsize=200)
def counts_of(checkpoint):
    """(step, frames, samples) of the bytes of a checkpoint; None if they are damaged."""
    head = re.match(rb"pliant checkpoint, format 2; (\d+) bytes from byte 512 on with the CRC-32 ([0-9a-f]{8})\n",
                    checkpoint)
    if head is None or len(checkpoint) != 512 + int(head[1]) or zlib.crc32(checkpoint[512:]) != int(head[2], 16):
        return None
    with h5py.File(io.BytesIO(checkpoint)) as file:
        state = file["state"]
        return int(state.attrs["step"]), *(int(state[name][()].item()) for name in ("frames", "samples"))


@functools.lru_cache(maxsize=200)
def rows_of(run):
    """(frames, samples) of the bytes of a run.h5."""
    with h5py.File(io.BytesIO(run)) as file:
        return len(file["frames"]), min((len(item) for item in file["series"].values()), default=0)


def checkpoints_of(files):
    return [files[name] for name in ("checkpoint-a.h5", "checkpoint-b.h5") if name in files]


@functools.lru_cache(maxsize=200)
def count(data):
    """The committed bytes of a run.h5."""
    return promised(data)[0]


def losses(recorded, number, choose, first=0):
    """About `number` states of the folder after a loss of power at moments from change number `first` on, checked: (files,
    whether a checkpoint had been synced)."""
    disk, newest = Disk(), -1
    each = number / (len(recorded) - first)
    for position, change in enumerate(recorded):
        disk.change(change)
        if change.kind == "S" and change.name == "":
            synced = [counts_of(file.synced) for name, file in disk.synced.items() if re.match("checkpoint-[ab].h5", name)]
            newest = max((counts[0] for counts in synced), default=-1)
        for _ in range(int(each + choose.random()) if position >= first else 0):
            files = disk.lost(choose)
            found = [counts for counts in map(counts_of, checkpoints_of(files)) if counts is not None]
            assert len(found) == len(checkpoints_of(files)), "a damaged checkpoint"
            assert max((counts[0] for counts in found), default=-1) >= newest, "a synced checkpoint is lost"
            if found or newest >= 0:
                assert "run.h5" in files
            if "run.h5" in files:
                allowed = {count(data) for data in disk.now.get("run.h5", File()).contents}
                data = count(files["run.h5"])
                assert data is not None and data in allowed, "run.h5 is neither the synced commit nor a later one"
                frames, samples = rows_of(data)
                assert all(counts[1] <= frames and counts[2] <= samples for counts in found)
            if "summary.json" in files:
                json.loads(files["summary.json"])
            yield files, newest >= 0


def continued(replay, states, tmp_path, options, check, launcher=(), environment=None):
    """Continues the run from each state: with -restart if there was a checkpoint, else by the same command."""
    for number, (files, checkpoint) in enumerate(states):
        folder = tmp_path / f"continued{number}"
        replay.write(files, folder)
        arguments_ = {"restart": folder, "checkpoint_interval": 0} if checkpoint else {**options, "output": folder}
        result = subprocess.run([*launcher, PROGRAM, replay.command, *arguments(arguments_)], encoding="utf-8",
                                capture_output=True, timeout=HANGS, env=environment)
        assert result.returncode == 0 and result.stderr == "", result.stderr
        check(Results(folder))
        shutil.rmtree(folder)


def pick(states, number, choose):
    """The number of states, and some states of a run that has not ended."""
    picked, seen, found = [], 0, 0
    number = 30 * number if ALL else number
    for seen, state in enumerate(states, 1):
        if "summary.json" in state[0]:
            continue
        found += 1
        if len(picked) < number:
            picked.append(state)
        elif (place := choose.randrange(found)) < number:
            picked[place] = state
    return seen, picked


def report(number, picked):
    print(f"{number} states of the folder, {len(picked)} continued")


@pytest.mark.parametrize("case", (CASES | LONG_CASES if ALL else CASES).values(), ids=list(CASES | LONG_CASES if ALL else CASES))
def test_every_loss_of_power(case, tmp_path):
    """Whenever power is lost, run.h5 is the last commit or the next one, with all frames of the newest synced checkpoint,
    and the resumed run has the same bits."""
    choose = random.Random(1)
    command, options = case.run
    replay = Replay(tmp_path, command, options, environment=case.environment)
    assert len(replay.whole.frames) > 2
    number, picked = pick(losses(replay.changes, case.losses if ALL else 500, choose), 5, choose)
    assert number > 100
    report(number, picked)
    continued(replay, picked, tmp_path, options, lambda run: assert_same_runs(run, replay.whole), environment=case.environment)


def has_checkpoint(files):
    return "run.h5" in files and any(checkpoints_of(files)) and "summary.json" not in files


def within_commit(files):
    return has_checkpoint(files) and not promised(files["run.h5"])[1]


def killed_and_restarted(replay, recorded, first, usable, choose, tmp_path):
    """The writes until a kill from change number `first` on, at one of the states that are `usable`, and of a restart after
    it; and the number of the first write of the restart."""
    moments = [k for k, files in enumerate(states_of(recorded)) if k >= first and usable(files)]
    moment = choose.choice(moments or [len(recorded) - 1])
    folder, log = tmp_path / "killed", tmp_path / "killed.log"
    log.unlink(missing_ok=True)
    replay.write(next(itertools.islice(states_of(recorded), moment, None)), folder)
    result = on_disk(folder, PROGRAM, replay.command, *arguments({"restart": folder, **OFTEN}), log=log)
    assert result.returncode == 0, result.stderr
    return recorded[:moment + 1] + list(changes(log, folder)), moment + 1


@pytest.mark.parametrize("kills", [1, 2, 3] if ALL else [1])
def test_loss_of_power_after_kills(kills, tmp_path):
    """A restart that mends run.h5 syncs it as a commit does, also if the restart is killed in turn."""
    choose = random.Random(kills + 1)
    command, options = SHORT_HOPPER
    replay = Replay(tmp_path, command, options)
    for _ in range(20 if ALL else 2):
        recorded, first = replay.changes, 0
        for kill in range(kills):
            usable = within_commit if kill % 2 == 0 else has_checkpoint
            recorded, first = killed_and_restarted(replay, recorded, first, usable, choose, tmp_path)
        number, picked = pick(losses(recorded, 1000 if ALL else 100, choose, first=first - 1), 1, choose)
        assert number > 20
        report(number, picked)
        continued(replay, picked, tmp_path, options, lambda run: assert_same_runs(run, replay.whole))


@needs_mpi
def test_loss_of_power_on_ranks(tmp_path):
    choose = random.Random(3)
    command, options = SHORT_HOPPER
    launcher, environment = ("mpiexec", "-n", "2"), mpi_environment()
    options = {**options, "t_end": 0.3, "frame_interval": 0.1, "sample_interval": 0.02}
    replay = Replay(tmp_path, command, options, launcher, environment)
    number, picked = pick((state for state in losses(replay.changes, 10000 if ALL else 250, choose) if state[1]), 5, choose)
    assert number > 10
    report(number, picked)
    for files, _ in picked:
        replay.read(files)

    def check(run):  # equal within rounding only, on ranks
        assert len(run.frames) == len(replay.whole.frames) and run.summary["status"] == "done"
        assert same(run.column("time"), replay.whole.column("time"))
        assert same(run.series["time"], replay.whole.series["time"])

    continued(replay, picked, tmp_path, options, check)
    continued(replay, picked[:3] if ALL else [], tmp_path, options, check, launcher, environment)
