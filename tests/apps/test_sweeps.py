"""pliant-sweep with the real program: two widths and two seeds, stopped once and merged."""

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from conftest import HANGS, PROGRAM, SMALL, hopper, wait_for

COMMAND = [sys.executable, Path(__file__).resolve().parents[2] / "python/pliant-sweep"]


def start(*arguments):
    return subprocess.Popen([*COMMAND, *map(str, arguments), "--program", PROGRAM], encoding="utf-8", stdout=subprocess.PIPE,
                            stderr=subprocess.STDOUT)


def test_four_runs(tmp_path):
    options = SMALL | {"t_end": 300, "frame_interval": 10, "sample_interval": 1}
    del options["hopper_width"]
    table = tmp_path / "widths.csv"
    # Wide enough not to clog.
    table.write_text(",".join(["name", *options, "hopper_width", "seeds"]) + "\n"
                     + "".join(",".join([f"w{w}", *map(str, options.values()), str(w), "1-2"]) + "\n" for w in (3, 4)), encoding="utf-8")
    process = start(table, "-j", 1)
    wait_for((tmp_path / "widths/w3,seed=1/run.xdmf").exists, process)
    process.send_signal(signal.SIGTERM)
    output, _ = process.communicate(timeout=HANGS)
    assert process.returncode == 75 and "stopped" in output, output
    assert not (tmp_path / "widths/w4,seed=2").exists()

    process = start(table, "-j", 2)
    output, _ = process.communicate(timeout=HANGS)
    assert process.returncode == 0 and output.splitlines()[-1] == "done 4/4, running 0, failed 0, waiting 0", output
    results = pd.read_csv(tmp_path / "widths/results.csv", index_col="row")
    assert list(results.index) == ["w3,seed=1", "w3,seed=2", "w4,seed=1", "w4,seed=2"]
    assert list(results["seed"]) == [1, 2, 1, 2] and list(results["hopper_width"]) == [3, 3, 4, 4]
    assert (results["Q_error"] > 0).all()
    # A stopped and resumed row has the results of an uninterrupted run.
    alone = hopper(tmp_path / "alone", **options, hopper_width=3, seed=2).summary
    assert results["Q"]["w3,seed=2"] == alone["Q"]["value"]
    assert results["crossed_count"]["w3,seed=2"] == alone["crossed_count"]
    units = pd.read_csv(tmp_path / "widths/units.csv", index_col="column")["unit"]
    assert units["Q_error"] == alone["Q"]["unit"]


def test_two_sweeps_at_once(tmp_path):
    """Each row is run once, by one of them; both wait until all rows are done."""
    table = tmp_path / "t.csv"
    options = SMALL | {"t_end": 20}
    table.write_text(",".join([*options, "seeds"]) + "\n" + ",".join([*map(str, options.values()), "1-5"]) + "\n", encoding="utf-8")
    sweeps = [start(table, "-j", 2) for _ in range(2)]
    for process in sweeps:
        output, _ = process.communicate(timeout=HANGS)
        assert process.returncode == 0 and output.splitlines()[-1] == "done 5/5, running 0, failed 0, waiting 0", output
    results = pd.read_csv(tmp_path / "t/results.csv")
    assert list(results["status"]) == ["done"] * 5 and results["steps"].nunique() == 1
    for run in results["run"]:
        log = (Path(run) / "log.txt").read_text(encoding="utf-8")
        assert log.count("output in") == 1 and "continuing" not in log, log


FAKE = Path(__file__).resolve().parents[2] / "python/tests/fake_program.py"


@pytest.mark.parametrize("arguments", [
    ["hoper"], ["hopper", "-zetaa", 1], ["hopper", "-zeta", -1], ["hopper", "-zeta", "x"], ["hopper", "-seed", -1],
    ["hopper", "-seed", 1.5], ["hopper", "-threads", 0], ["hopper", "-restart", "empty"], ["hopper", "-output", "done"],
    ["hopper", "-output", "frames"]], ids=lambda a: " ".join(map(str, a)))
def test_the_stand_in_speaks_as_the_program(arguments, tmp_path, monkeypatch):
    """python/tests/fake_program.py, which has -a for -zeta and no units."""
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    hopper("frames", t_end=0)
    shutil.copytree("frames", "done")
    (Path("frames") / "summary.json").unlink()
    for checkpoint in Path().glob("*/checkpoint-*.h5"):
        checkpoint.unlink()

    def said(program, names):
        words = [re.sub(r"^-zeta", f"-{names['zeta']}", str(word)) for word in arguments]
        result = subprocess.run([program, *words], encoding="utf-8", capture_output=True)
        assert result.returncode == 2
        return re.sub(r" \(unit .*\)$", "", result.stderr).replace(f"-{names['zeta']}", "-zeta")

    assert said(FAKE, {"zeta": "a"}) == said(PROGRAM, {"zeta": "zeta"})


@pytest.mark.parametrize("column, value, message", [
    ("hopper_wdith", 3, "column 'hopper_wdith': unknown option -hopper_wdith; did you mean -hopper_width?"),
    ("model", "spp", "column 'model': -model spp"),
    ("size_fraction", 1.5, "column 'size_fraction': -size_fraction 1.5"),
    ("n", 10.5, "column 'n': -n 10.5"),
])
def test_options_are_checked_first(tmp_path, column, value, message):
    table = tmp_path / "t.csv"
    table.write_text(f"hopper_width,{column}\n3,\n4,{value}\n", encoding="utf-8")
    process = start(table)
    output, _ = process.communicate(timeout=HANGS)
    assert process.returncode == 2 and f"t.csv, line 3, {message}" in output, output
    assert os.listdir(tmp_path) == ["t.csv"]
