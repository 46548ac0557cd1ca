"""A run that is still written: each Run is a snapshot of the file at its opening, and nothing keeps the file open."""

import gc
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from synthetic import write_run

from pliant import Run, RunError, load_runs, run_file, sweep_table

HERE = Path(__file__).resolve().parent


def grow(folder, frames=1, rows=5):
    """The data that a running program appends to the file."""
    with h5py.File(folder / "run.h5", "r+") as file:
        count = len(file["frames"])
        for k in range(count, count + frames):
            file.copy(f"frames/{count - 1:06d}", f"frames/{k:06d}")
            file[f"frames/{k:06d}"].attrs["time"] = 0.5 * k
        for data in file["series"].values():
            data.resize(len(data) + rows, axis=0)
            data[-rows:] = 7.0


def growing(folder, **options):
    """A run whose series can grow, in chunks; the last chunk is not full."""
    path, truth = write_run(folder, n=20, samples=70, **options)
    with h5py.File(path / "run.h5", "r+") as file:
        for name in list(file["series"]):
            values = file[f"series/{name}"][()]
            del file[f"series/{name}"]
            file["series"].create_dataset(name, data=values, chunks=(16, *values.shape[1:]),
                                          maxshape=(None, *values.shape[1:]))
    return path, truth


def descriptors(path):
    """How many descriptors this process has of a file."""
    found = 0
    for fd in Path("/proc/self/fd").iterdir():
        try:
            found += os.readlink(fd) == str(Path(path).resolve())
        except FileNotFoundError:
            pass
    return found


def without_cache(run):
    """Makes HDF5 read the run's file again at every lookup."""
    file = run._file._file.id
    config = file.get_mdc_config()
    config.set_initial_size, config.initial_size, config.min_size, config.max_size = True, 1024, 1024, 1024
    config.incr_mode = config.flash_incr_mode = config.decr_mode = 0
    file.set_mdc_config(config)
    return run


@pytest.mark.parametrize("cached", [True, False])
def test_each_run_is_the_file_as_it_was_when_it_was_opened(cached, tmp_path):
    path, truth = growing(tmp_path / "run")
    runs = []
    for k in range(4):
        runs.append(Run(path) if cached else without_cache(Run(path)))
        grow(path)
    for k, run in enumerate(runs):
        assert len(run.frames) == 3 + k and run.frames.times[-1] == 0.5 * (2 + k)
        assert len(run.series) == 70 + 5 * k and len(run.profile.weight) == 70 + 5 * k
        np.testing.assert_array_equal(run.series["crossed_area"][:70], truth["series"]["crossed_area"])
        assert (run.series["crossed_area"][70:] == 7.0).all()
        np.testing.assert_array_equal(run.frames[-1].centres, truth["centres"][-1])


def test_a_run_that_was_restarted_between_two_opens(tmp_path):
    path, _ = growing(tmp_path / "run")
    old = Run(path)
    with h5py.File(path / "run.h5", "r+") as file:  # from a checkpoint before the last frame and the last samples
        for data in file["series"].values():
            data.resize(40, axis=0)
    grow(path, frames=2, rows=60)
    summary = json.loads((path / "summary.json").read_text(encoding="utf-8")) | {"t": 8}
    (path / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    new = Run(path)
    assert len(new.frames) == 5 and len(new.series) == 100 and new.summary["t"] == 8
    assert len(old.frames) == 3 and "t" not in old.summary
    old.close()
    assert len(Run(path).frames) == 5


def test_rows_that_a_restart_has_replaced_are_not_passed_off_as_old_ones(tmp_path):
    path, _ = growing(tmp_path / "run")
    with h5py.File(path / "run.h5", "r+") as file:
        for data in file["series"].values():
            data.attrs["crc32"] = np.uint32(run_file.zlib.crc32(np.ascontiguousarray(data[()])))
    old = Run(path)
    with h5py.File(path / "run.h5", "r+") as file:
        for data in file["series"].values():
            data[20:] = 3.0
    with pytest.raises(RunError, match="restarted from an earlier checkpoint.*; open it again"):
        old.series


@pytest.mark.parametrize("writes", [1, 3])
def test_a_commit_while_the_file_is_opened(tmp_path, monkeypatch, writes):
    """All data read between two states are read again."""
    path, _ = growing(tmp_path / "run")
    walk, left = run_file.RunFile._walk, [writes]

    def interrupted(snapshot):
        file = h5py.File(snapshot, "r")
        list(file["series/time"][-1:])
        file.close()
        if left[0] > 0:
            left[0] -= 1
            grow(path)
        return walk(snapshot)

    monkeypatch.setattr(run_file.RunFile, "_walk", staticmethod(interrupted))
    run = Run(path)
    assert left == [0] and 2 + writes <= len(run.frames) <= 3 + writes
    assert len(run.series) == 70 + 5 * (len(run.frames) - 3)


def test_a_half_written_file_is_an_error_once(tmp_path, monkeypatch):
    path, _ = growing(tmp_path / "run")
    whole = (path / "run.h5").read_bytes()
    monkeypatch.setattr(run_file, "_ATTEMPTS", 3)
    monkeypatch.setattr(run_file, "_PAUSE", 0.001)
    walk = run_file.RunFile._walk

    def torn(snapshot):
        half = bytearray(whole)
        half[100:2000] = os.urandom(1900)
        (path / "run.h5").write_bytes(half)
        os.utime(path / "run.h5", ns=(time.time_ns(), time.time_ns()))
        return walk(snapshot)

    with monkeypatch.context() as patch:
        patch.setattr(run_file.RunFile, "_walk", staticmethod(torn))
        with pytest.raises(RunError, match="has written at each of 3 attempts.*open it again"):
            Run(path)
    (path / "run.h5").write_bytes(whole)
    assert len(Run(path).frames) == 3


def test_a_file_that_was_replaced_is_an_error(tmp_path, monkeypatch):
    path, _ = growing(tmp_path / "run")
    run = Run(path)
    monkeypatch.setattr(run_file._descriptors, "_limit", 1)
    write_run(tmp_path / "other", n=20)
    other = Run(tmp_path / "other")
    other.manifest
    os.replace(tmp_path / "other/run.h5", path / "run.h5")
    with pytest.raises(RunError, match="another file has taken its place"):
        run.frames[0].centres


def test_many_runs_need_few_descriptors(tmp_path):
    """300 of them where a process may have 256, by path and as objects."""
    path, _ = write_run(tmp_path / "one", n=20, frames=1, samples=5)
    for k in range(300):
        (tmp_path / f"sweep/{k:03d}").mkdir(parents=True)
        for name in ("run.h5", "summary.json"):  # a link is the same file to HDF5, and to the system another name
            os.link(path / name, tmp_path / f"sweep/{k:03d}/{name}")
    code = f"""
import resource, sys
sys.path.insert(0, {str(HERE.parent)!r})
from pliant import load_runs, sweep_table
resource.setrlimit(resource.RLIMIT_NOFILE, (256, 256))
runs = load_runs([{str(tmp_path / 'sweep')!r}])
assert len(runs) == 300 and sweep_table(runs).equals(sweep_table([{str(tmp_path / 'sweep')!r}]))
assert all(len(run.frames[0].centres) == 20 for run in runs)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("locale", ["C", "POSIX"])
def test_files_are_utf_8_in_every_locale(tmp_path, locale):
    path, _ = write_run(tmp_path / "run", n=20, frames=1)
    summary = json.loads((path / "summary.json").read_text(encoding="utf-8")) | {"message": "ζ ≤ ζ0"}
    (path / "summary.json").write_text(json.dumps(summary, ensure_ascii=False), encoding="utf-8")
    code = f"import sys; sys.path.insert(0, {str(HERE.parent)!r}); from pliant import Run, script; " \
           f"script.run(lambda: print(ascii(Run({str(path)!r}).summary['message']), chr(0x3b6)))"
    # In these two locales Python would use UTF-8 by default.
    environment = os.environ | {"LC_ALL": locale, "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    environment.pop("PYTHONIOENCODING", None)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, env=environment)
    assert done.returncode == 0 and done.stdout == b"'\\u03b6 \\u2264 \\u03b60' \\u03b6\n", done.stderr


def test_what_the_program_prints_is_utf_8_in_every_locale(tmp_path):
    program = tmp_path / "program"
    program.write_text("#!/bin/sh\necho hopper μ\n", encoding="utf-8")
    program.chmod(0o755)
    code = f"import sys; sys.path.insert(0, {str(HERE.parent)!r}); from pliant.sweep_command import first_scenario; " \
           f"print(first_scenario({str(program)!r}))"
    environment = os.environ | {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8", env=environment)
    assert done.stdout == "hopper\n", done.stderr


OF_A_RUN = ("manifest", "options", "scenario", "model", "droplets", "dim", "summary", "parameters", "topology", "geometry",
            "series", "vector_series", "events", "profile", "steady_start")
OF_A_FRAME = ("positions", "velocities", "centres", "images", "unwrapped_centres", "active", "angles", "contact_count",
              "touching", "wall_force", "wall_segments", "particle_velocities", "speeds", "polygons", "contacts", "wall_contacts",
              "reinsertions")


@pytest.mark.parametrize("read_before", [False, True])
def test_use_after_close(soft, read_before):
    run = Run(soft[0])
    frames, frame = run.frames, run.frames[0]
    if read_before:
        for name in OF_A_RUN:
            getattr(run, name)
        for name in OF_A_FRAME:
            getattr(frame, name)
    run.close()
    run.close()
    assert run.name == "soft" and "closed" in repr(run) and "t = 0" in repr(frame)
    for name in OF_A_RUN:
        with pytest.raises(RunError, match="the run was closed; open it again"):
            getattr(run, name)
    for name in OF_A_FRAME:
        with pytest.raises(RunError, match="the run was closed; open it again"):
            getattr(frame, name)
    for use in (lambda: len(frames), lambda: frames[0], lambda: frames[:1], lambda: frames.times, lambda: list(frames),
                lambda: run.frames[0], lambda: run.frame(0), lambda: run.measured("Q"), lambda: frame.attribute("time"),
                lambda: sweep_table([run])):
        with pytest.raises(RunError, match="the run was closed; open it again"):
            use()


def test_a_run_is_let_go_of_at_once(tmp_path):
    """No reference cycle keeps the file."""
    path, _ = write_run(tmp_path / "run", n=20)
    gc.collect()
    gc.disable()
    try:
        run = Run(path)
        frames, frame = run.frames, run.frames[0]
        frame.contacts, run.series, frames.times, run.frames[1].speeds
        assert descriptors(path / "run.h5") == 1
        del run
        assert len(frames) == 3  # frames keep the run open
        del frames, frame
        assert descriptors(path / "run.h5") == 0
    finally:
        gc.enable()


def test_load_runs_opens_what_is_there_now(tmp_path):
    path, _ = growing(tmp_path / "sweep/run")
    assert [len(run.frames) for run in load_runs([tmp_path / "sweep"])] == [3]
    grow(path)
    assert [len(run.frames) for run in load_runs([tmp_path / "sweep"])] == [4]
