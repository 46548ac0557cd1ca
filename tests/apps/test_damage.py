"""Damaged files of a run: changed bits, cuts, sectors of zeros; and names in its folder that are not files.
scripts/flip_bits.py goes through all bytes."""

import json
import os
import re
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import PROGRAM, hopper, pliant

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))

import flip_bits  # noqa: E402


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return flip_bits.make_run(PROGRAM, tmp_path_factory.mktemp("made") / "run")


@pytest.fixture
def run(made, tmp_path):
    shutil.copytree(made, tmp_path / "run")
    return tmp_path / "run"


def findings(found):
    return [one for one in found if one[-1] not in flip_bits.GOOD]


def texts_of(data, *texts, every):
    """(byte, bit) within the first of these texts in a file."""
    return [(at, at % 8) for text in texts for at in range(data.index(text), data.index(text) + len(text), every)]


def test_the_reader_gives_all_data_or_an_error(made):
    data = (made / "run.h5").read_bytes()
    chosen = flip_bits.flips(len(data), 4001)
    # Names of groups and columns in heads, and the manifest.
    chosen += texts_of(data, b"manifest", b"kinetic_energy", b"in_hopper", b"members", b'"zeta":{"', b"hopper2d", every=4)
    found = flip_bits.check_reader(made, "run.h5", chosen)
    assert len(found) == len(chosen) and not findings(found)
    assert {verdict for *_, verdict in found} == {"same", "refused"}


def test_the_reader_gives_all_data_or_an_error_of_small_frames(tmp_path):
    run = flip_bits.make_run(PROGRAM, tmp_path / "small", "small")
    data = (run / "run.h5").read_bytes()
    found = flip_bits.check_reader(run, "run.h5", flip_bits.flips(len(data), 8009))
    assert not findings(found) and {verdict for *_, verdict in found} == {"same", "refused"}


def test_the_reader_notices_every_bit_of_a_summary(made):
    chosen = flip_bits.flips((made / "summary.json").stat().st_size, 97)
    found = flip_bits.check_reader(made, "summary.json", chosen)
    assert {verdict for *_, verdict in found} == {"refused"}


def test_a_restart_ends_as_without_the_flip_or_is_refused(made):
    data = (made / "run.h5").read_bytes()
    chosen = flip_bits.flips(len(data), 23003) + texts_of(data, b'"zeta":{"', b"kinetic_energy", every=5)
    assert not findings(flip_bits.check_program(PROGRAM, made, "run.h5", chosen))


def test_a_damaged_view_is_not_opened(made):
    """HDF5 1.10 dies on opening a virtual dataset whose selections have a wrong number of dimensions."""
    data = (made / "run.h5").read_bytes()
    # A selection: type (hyperslab), version, reserved, length, number of dimensions (4 bytes).
    ranks = [found.end() - 3 for found in re.finditer(re.escape(struct.pack("<5I", 2, 1, 0, 24, 2)), data)]
    views = 5  # in each frame: centres, and vectors for run.xdmf
    assert len(ranks) == 3 * 2 * views
    assert not findings(flip_bits.check_reader(made, "run.h5", [(at, 2) for at in ranks]))
    assert not findings(flip_bits.check_program(PROGRAM, made, "run.h5", [(at, 2) for at in ranks[::2]]))


@pytest.mark.parametrize("name", ["checkpoint-a.h5", "checkpoint-b.h5"])
def test_a_damaged_checkpoint_changes_nothing(name, made):
    chosen = flip_bits.flips((made / name).stat().st_size, 5003)
    found = flip_bits.check_program(PROGRAM, made, name, chosen)
    assert {verdict for *_, verdict in found} == {"same, with a warning"}


def test_the_checks_find_what_is_wrong(made, monkeypatch):
    """A reader that omits a column, and a reader that dies."""
    chosen = flip_bits.flips(8, 4)
    whole = flip_bits.everything
    monkeypatch.setattr(flip_bits, "judge", lambda folder, truth: os.kill(os.getpid(), 9))
    assert {verdict for *_, verdict in flip_bits.check_reader(made, "summary.json", chosen)} == {"killed by signal 9"}
    monkeypatch.undo()
    truth = whole(made)
    monkeypatch.setattr(flip_bits, "everything", lambda folder: truth | {"series": ""})
    assert flip_bits.judge(made, truth) == "other values: series"


def test_one_file_can_be_chosen():
    """A name that no part damages is refused, instead of no change without a finding."""
    for part in ("reader", "restart"):
        done = subprocess.run([flip_bits.__file__, "--file", "checkpoint-a.h5", part], capture_output=True, encoding="utf-8", timeout=60)
        assert done.returncode == 2 and f"no part of {part} damages checkpoint-a.h5" in done.stderr


# ---- names that are not files ------------------------------------------------------------------------------------------

KINDS = {"fifo": (os.mkfifo, "is a FIFO, not a file"), "folder": (os.mkdir, "is a folder, not a file"),
         "device": (lambda path: os.symlink("/dev/zero", path), "is a device, not a file")}


def assert_refused(result, *words):
    assert result.returncode == 2 and result.stderr.count("\n") == 1, result.stderr
    for word in words:
        assert word in result.stderr


@pytest.mark.parametrize("kind", KINDS)
def test_parts_of_a_run_that_are_no_files(kind, run):
    make, message = KINDS[kind]
    for name in ("run.h5", "run.lock"):
        if (run / name).exists():
            os.rename(run / name, run / "saved")
        make(run / name)
        link = name == "run.lock" and kind == "device"
        assert_refused(pliant("hopper", restart=run, t_end=1.5), name, "is a symbolic link, not a file" if link else message)
        run.joinpath(name).rmdir() if kind == "folder" else (run / name).unlink()
        if (run / "saved").exists():
            os.rename(run / "saved", run / name)
    (run / "summary.json").unlink()
    make(run / "summary.json")
    assert_refused(pliant("hopper", output=run, **flip_bits.OPTIONS, t_end=1.5), "summary.json", message)
    (run / "summary.json").rmdir() if kind == "folder" else (run / "summary.json").unlink()
    (run / "checkpoint-b.h5").unlink()
    make(run / "checkpoint-b.h5")
    result = pliant("hopper", restart=run, t_end=1.5)
    assert f"checkpoint-b.h5 {message}" in result.stderr
    assert result.returncode == (4 if kind == "folder" else 0)  # a folder cannot be replaced by a file
    assert result.stderr.count("\n") == (2 if kind == "folder" else 1)


@pytest.mark.parametrize("kind", KINDS)
def test_files_of_options_that_are_no_files(kind, tmp_path):
    make, message = KINDS[kind]
    make(tmp_path / "given")
    for option, prefix in (("options_file", ""), ("outline", ""), ("obstacle", "polygon:")):
        assert_refused(pliant("hopper", output=tmp_path / "out", **{option: f"{prefix}{tmp_path / 'given'}"}), message)
    assert_refused(pliant("evaluate", tmp_path / "given"), message)
    assert not (tmp_path / "out").exists()


def test_pipes_of_the_shell_are_read(tmp_path):
    command = f"exec {PROGRAM} hopper -options_file <(echo '-hopper_width -1') -output {tmp_path / 'out'}"
    result = flip_bits.subprocess.run(["bash", "-c", command], encoding="utf-8", capture_output=True)
    assert_refused(result, "-hopper_width -1")


def test_a_lock_that_is_a_link_leaves_the_file_behind_it(run, tmp_path):
    (tmp_path / "precious").write_text("mine", encoding="utf-8")
    for link in (os.symlink, os.link):
        link(tmp_path / "precious", run / "run.lock")
        assert_refused(pliant("hopper", restart=run, t_end=1.5), "run.lock is a ")
        (run / "run.lock").unlink()
    assert (tmp_path / "precious").read_text(encoding="utf-8") == "mine"


def test_a_damaged_summary_does_not_decide_what_a_command_does(tmp_path):
    folder = tmp_path / "run"
    hopper(folder, t_end=0.5)
    path = folder / "summary.json"
    path.write_text(path.read_text(encoding="utf-8").replace('"status": "done"', '"status": "dona"'), encoding="utf-8")
    before = (folder / "run.h5").read_bytes()
    assert_refused(pliant("hopper", output=folder, t_end=0.5), "summary.json is damaged or was edited")
    assert (folder / "run.h5").read_bytes() == before
    summary = json.loads(path.read_text(encoding="utf-8"))
    summary.pop("format"), summary.pop("crc32")
    path.write_text(json.dumps(summary), encoding="utf-8")  # a summary of an older version
    assert_refused(pliant("hopper", output=folder, t_end=0.5), "holds a run that is finished (dona)")
