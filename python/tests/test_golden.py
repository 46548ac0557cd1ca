"""scripts/golden.py: every difference between two runs is found and named."""

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))

import golden  # noqa: E402


def write(path, change=lambda file: None):
    with h5py.File(path, "w") as file:
        file["manifest/created"] = str(path)
        for n in range(3):
            frame = file.create_group(f"frames/{n:06d}")
            frame.attrs["time"] = 0.5 * n
            frame["positions"] = np.arange(6.0).reshape(3, 2) + n
        file["series/time"] = np.arange(4.0)
        file["series/Q"] = np.full(4, np.nan)
        file["series/Q"].attrs["crc32"] = len(str(path))
        file["events/particle"] = np.arange(2)
        change(file)
    return golden.read(path)


def edit(name, index, value):
    def change(file):
        file[name][index] = value
    return change


@pytest.mark.parametrize("change, expected", [
    (lambda file: None, []),
    (edit("frames/000001/positions", (2, 0), np.nextafter(5, 6)),
     ["frames/000001/positions[2, 0]: 5.0 | 5.000000000000001"]),
    (edit("frames/000000/positions", (0, 0), -0.0), ["frames/000000/positions[0, 0]: 0.0 | -0.0"]),
    (edit("series/Q", slice(2, 4), 0), ["series/Q[2]: nan | 0.0"]),
    (edit("events/particle", 1, 0), ["events/particle[1]: 1 | 0"]),
    (lambda file: file["frames/000002"].attrs.modify("time", 2.0), ["frames/000002@time: 1.0 | 2.0"]),
    (lambda file: file.move("series/Q", "series/flow_rate"),
     ["only the first has series/Q", "only the second has series/flow_rate"]),
], ids=["equal", "value", "sign", "nan", "event", "attribute", "names"])
def test_what_differs_is_named(change, expected, tmp_path):
    a = write(tmp_path / "a.h5")
    assert golden.compare(a, write(tmp_path / "the_other.h5", change)) == expected
    assert golden.counts(a) == (3, 4, 2)


@pytest.fixture
def program(tmp_path):
    """Makes a program that leaves the run above, with another time in the last row."""
    def make(name, time, code=0):
        path = tmp_path / name
        write(tmp_path / f"{name}.h5", edit("series/time", 3, time))
        path.write_text(f"""#!{sys.executable} -ISE
import os, shutil, sys
options = dict(zip(sys.argv[2::2], sys.argv[3::2]))
folder = options.get("-output") or options["-restart"]
os.makedirs(folder, exist_ok=True)
shutil.copy({str(tmp_path / name)!r} + ".h5", folder + "/run.h5")
sys.exit({code} and "pliant: error: no such option")
""", encoding="utf-8")
        path.chmod(0o755)
        return str(path)
    return make


def compare_programs(monkeypatch, folder, one, other, *options):
    monkeypatch.setattr(sys, "argv", ["golden", "--programs", one, other, "--folder", str(folder / "runs"), "--only",
                                      "sp", *options])
    return golden.main()


def test_programs_that_agree(program, tmp_path, monkeypatch, capsys):
    assert compare_programs(monkeypatch, tmp_path, program("one", 3), program("two", 3)) == 0
    assert capsys.readouterr().out.count(" equal\n") == 2


def test_programs_that_differ(program, tmp_path, monkeypatch, capsys):
    one, two = program("one", 3), program("two", 4)
    assert compare_programs(monkeypatch, tmp_path, one, two) == 1
    shown = capsys.readouterr()
    assert shown.out.count("series/time[3]: 3.0 | 4.0\n") == 2 and "different: sp;" in shown.err
    assert compare_programs(monkeypatch, tmp_path, one, two, "--except", "sp") == 0
    assert capsys.readouterr().out.count("4.0 (excepted)\n") == 2


def test_a_program_that_fails(program, tmp_path, monkeypatch, capsys):
    assert compare_programs(monkeypatch, tmp_path, program("one", 3), program("two", 3, code=1)) == 1
    assert "the second program failed: exit code 1: pliant: error: no such option" in capsys.readouterr().out
