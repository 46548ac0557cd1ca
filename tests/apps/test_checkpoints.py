"""Checkpoints that are damaged, or edited with a valid checksum: the run resumes from the other checkpoint and reports
it, or ends with the faults of both. tests/scenarios/checkpoints.cpp goes through every entry."""

import re
import shutil
import zlib

import h5py
import numpy as np
import pytest
from conftest import Results, assert_same_runs, hopper, pliant
from test_parallel import complaints, needs_mpi, on_any_ranks, on_ranks

HEAD = 512
LAST = {"t_end": 1.5}


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """A run with checkpoints at t = 0.5 (a) and t = 1 (b); and copies of its earlier states: "start.h5", "half.h5"."""
    folder = tmp_path_factory.mktemp("two") / "run"
    hopper(folder, t_end=0)  # one for its start, one for its end
    for end, before in ((0.5, "start.h5"), (1, "half.h5")):
        shutil.copy(folder / "run.h5", folder.parent / before)
        result = pliant("hopper", restart=folder, t_end=end)
        assert result.returncode == 0, result.stderr
    return folder


@pytest.fixture
def run(two, tmp_path):
    shutil.copytree(two, tmp_path / "run")
    return tmp_path / "run"


@pytest.fixture(scope="module")
def from_older(two, tmp_path_factory):
    """The result of resuming from the older checkpoint."""
    folder = tmp_path_factory.mktemp("older") / "run"
    shutil.copytree(two, folder)
    (folder / "checkpoint-b.h5").unlink()
    result = pliant("hopper", restart=folder, **LAST)
    assert result.returncode == 0 and result.stderr == ""
    return Results(folder)


def head(image):
    line = b"pliant checkpoint, format 2; %d bytes from byte 512 on with the CRC-32 %08x\n"
    return (line % (len(image), zlib.crc32(image))).ljust(HEAD, b"\0")


def edit(path, change):
    """change(group) gets the group /state; the checksum is made to fit."""
    with h5py.File(path, "r+") as file:
        change(file["state"])
    image = path.read_bytes()[HEAD:]
    path.write_bytes(head(image) + image)


def set_value(name, value):
    def change(state):
        state[name][...] = value
    return change


def set_options(change):
    def edit_text(state):
        state.attrs["options"] = change(state.attrs["options"])
    return edit_text


def set_events(count):
    def change(state):
        state["events"][...] = state["crossed"][...] = count
    return change


def flip(path, at, bit=0):
    data = bytearray(path.read_bytes())
    data[at] ^= 1 << bit
    path.write_bytes(data)


def test_the_head_is_a_line_of_text(two):
    data = (two / "checkpoint-a.h5").read_bytes()
    assert data[:HEAD] == head(data[HEAD:])
    with h5py.File(two / "checkpoint-a.h5") as file:
        assert file.userblock_size == HEAD and file["state/x"].shape == (120,) and file["state/skin"][()] > 0


def test_one_bit_of_an_option(run, from_older):
    """0.3 becomes 0.2, which is as good a value."""
    path = run / "checkpoint-b.h5"
    data = path.read_bytes()
    zeta = data.index(b'"zeta":{')
    flip(path, data.index(b"0.3", zeta) + 2)
    assert b'0.2' in path.read_bytes()[zeta:zeta + 200]
    result = pliant("hopper", restart=run, **LAST)
    assert result.returncode == 0
    assert "checkpoint-b.h5 is damaged" in result.stderr
    assert "resuming from" in result.stderr and "checkpoint-a.h5 (step 500)" in result.stderr
    assert_same_runs(Results(run), from_older)


def test_both_damaged(run):
    before = (run / "run.h5").read_bytes()
    for name in ("checkpoint-a.h5", "checkpoint-b.h5"):
        flip(run / name, 3000)
    result = pliant("hopper", restart=run, **LAST)
    assert result.returncode == 2 and result.stderr.count("\n") == 1
    assert "checkpoint-a.h5 is damaged" in result.stderr and "checkpoint-b.h5 is damaged" in result.stderr
    assert (run / "run.h5").read_bytes() == before


WRONG = {
    "id": (set_value("id", 1000000), "id[0] = 1000000 is not in the range 0 … 59"),
    "ranks": (set_value("rank_particles", 1000000), "rank_particles = 1000000 is not in the range"),
    "skin": (set_value("skin", np.nan), "skin = nan is not finite"),
    "json": (set_options(lambda text: text[:len(text) // 2]), "not a JSON object"),
    "option": (set_options(lambda text: text.replace('"zeta":{', '"zetta":{')), "-zetta is unknown"),
    "size": (set_options(lambda text: text.replace('"value":60}', '"value":600000}')), "id has 60 values"),
    "removed": (lambda state: state.pop("v"), "no real numbers named v"),
    "samples": (set_value("samples", 1000), "rows of /series"),
    "frames": (set_value("frames", 1000), "frames"),
    "events": (set_events(1000), "rows of /events"),
}


@pytest.mark.parametrize("name", WRONG)
def test_an_edited_checkpoint(name, run, from_older):
    change, message = WRONG[name]
    edit(run / "checkpoint-b.h5", change)
    result = pliant("hopper", restart=run, **LAST)
    assert result.returncode == 0 and result.stderr.count("\n") == 1, result.stderr
    assert "checkpoint-b.h5" in result.stderr and message in result.stderr
    assert "checkpoint-a.h5 (step 500)" in result.stderr
    assert_same_runs(Results(run), from_older)
    # The damaged checkpoint was overwritten.
    for name, time in (("a", 0.5), ("b", 1.5)):
        with h5py.File(run / f"checkpoint-{name}.h5") as file:
            assert file["state"].attrs["time"] == pytest.approx(time)


@pytest.mark.parametrize("name", WRONG)
def test_two_edited_checkpoints(name, run):
    change, message = WRONG[name]
    for file in ("checkpoint-a.h5", "checkpoint-b.h5"):
        edit(run / file, change)
    result = pliant("hopper", restart=run, **LAST)
    assert result.returncode == 2 and result.stderr.count("\n") == 1, result.stderr
    assert message in result.stderr and "internal" not in result.stderr


@needs_mpi
@pytest.mark.parametrize("both", [False, True], ids=["one", "both"])
def test_edited_checkpoints_on_ranks(both, run, from_older):
    edit(run / "checkpoint-b.h5", WRONG["id"][0])
    if both:
        edit(run / "checkpoint-a.h5", WRONG["skin"][0])
    result = on_ranks(2, "hopper", restart=run, **LAST)
    assert result.returncode == (2 if both else 0), result.stderr
    (complaint,) = complaints(result)
    assert WRONG["id"][1] in complaint and (WRONG["skin"][1] in complaint) == both
    if not both:
        assert np.allclose(Results(run).frames[-1]["positions"], from_older.frames[-1]["positions"], rtol=0, atol=1e-9)


def test_a_checkpoint_without_a_head(run):
    for name in ("checkpoint-a.h5", "checkpoint-b.h5"):
        data = (run / name).read_bytes()
        (run / name).write_bytes(data[HEAD:])
    result = pliant("hopper", restart=run, **LAST)
    assert result.returncode == 2 and "is of format 1" in result.stderr and "version that wrote it" in result.stderr


def test_what_the_user_asks_for_is_no_fault_of_a_checkpoint(run):
    result = pliant("hopper", restart=run, hopper_width=5)
    assert result.returncode == 2
    assert result.stderr == ("pliant: error: -hopper_width 5.0: the stored run has 3.0, and a restart cannot change it; "
                             "leave it out, or start a new run in another folder\n")
    result = pliant("hopper", restart=run, implicit="shape")
    assert result.returncode == 2 and result.stderr.count("-implicit shape") == 1


def test_an_older_run_file(run, two, from_older):
    """Restored from a copy that was made before the last checkpoint."""
    shutil.copy(two.parent / "half.h5", run / "run.h5")
    result = pliant("hopper", restart=run, **LAST)
    assert result.returncode == 0 and result.stderr.count("\n") == 1, result.stderr
    assert "run.h5 has 2 frames" in result.stderr and "checkpoint-b.h5 needs 3" in result.stderr
    assert "resuming from" in result.stderr and "checkpoint-a.h5 (step 500)" in result.stderr
    assert_same_runs(Results(run), from_older)


def cut(path):
    path.write_bytes(path.read_bytes()[:-1000])


@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=needs_mpi)])
@pytest.mark.parametrize("how", ["older", "cut", "missing"])
def test_a_run_file_that_fits_no_checkpoint(how, ranks, run, two):
    path = run / "run.h5"
    shutil.copy(two.parent / "start.h5", path)
    {"older": lambda _: None, "cut": cut, "missing": lambda path: path.unlink()}[how](path)
    before = {file.name: file.read_bytes() for file in run.iterdir()}
    result = on_any_ranks(ranks, "hopper", restart=run, **LAST)
    assert result.returncode == 2, result.stderr
    (complaint,) = complaints(result)
    assert "run.h5" in complaint and "restore it from a backup, or start again with another -output" in complaint
    for name in ("checkpoint-a.h5", "checkpoint-b.h5"):
        assert (name in complaint) == (how == "older")
    assert {file.name: file.read_bytes() for file in run.iterdir()} == before


@needs_mpi
def test_an_older_run_file_on_ranks(run, two, from_older):
    shutil.copy(two.parent / "half.h5", run / "run.h5")
    result = on_ranks(2, "hopper", restart=run, **LAST)
    assert result.returncode == 0, result.stderr
    (complaint,) = complaints(result)
    assert "checkpoint-b.h5 needs 3" in complaint and "checkpoint-a.h5 (step 500)" in complaint
    assert np.allclose(Results(run).frames[-1]["positions"], from_older.frames[-1]["positions"], rtol=0, atol=1e-9)


@pytest.mark.parametrize("scenario, options", [
    ("raft", {"rows": 3, "columns": 3, "delta": 0.05, "v_wall": 1e-3, "sample_interval": 5}),
    ("clog", {"n": 8, "g": 0.1, "phi_c": 3e-4, "sample_interval": 5})])
def test_droplets_with_a_checkpoint_that_counts_too_much(scenario, options, tmp_path):
    run = tmp_path / "run"
    assert pliant(scenario, output=run, t_end=20, **options).returncode == 0
    assert pliant(scenario, restart=run, t_end=40).returncode == 0
    newer = max(run.glob("checkpoint-*.h5"), key=step_of)
    edit(newer, set_value("samples", 1000))
    result = pliant(scenario, restart=run, t_end=60)
    assert result.returncode == 0 and result.stderr.count("\n") == 1, result.stderr
    assert f"{newer.name} needs 1000" in result.stderr and "resuming from" in result.stderr
    times = Results(run).series["time"]
    assert times[-1] == 60 and (np.diff(times) > 0).all()


def step_of(checkpoint):
    with h5py.File(checkpoint) as file:
        return file["state"].attrs["step"]


def test_a_damaged_frame_is_one_warning(run):
    """HDF5 1.10 loses memory over it, and would complain at the end."""
    path = run / "run.h5"
    data = path.read_bytes()
    # A name in the head of the second frame; /manifest/datasets has the name behind a slash.
    flip(path, [found.start() for found in re.finditer(rb"(?<!/)contact_count", data)][1])
    result = pliant("hopper", restart=run, **LAST)
    assert result.returncode == 0, result.stderr
    (line,) = result.stderr.splitlines()
    assert "warning" in line and "/frames/000001" in line
