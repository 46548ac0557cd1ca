"""Sweeps: tables into rows, rows into runs, stop and resume, folders in use, results. A small program stands for pliant."""

import fcntl
import json
import os
import shlex
import signal
import socket
import subprocess
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pandas as pd
import pytest
from synthetic import write_run

from pliant import PliantError, RunError, load_table, sweep_jobs
from pliant.files import read_json, write_atomically
from pliant.sweep_command import main
from pliant.sweep_ensembles import EnsembleFolder
from pliant.sweep_jobs import RowFolder, State, Sweep, count_text, duration_text, holder
from pliant.sweep_rows import canonical, expand_seeds, read_rows

HERE = Path(__file__).resolve().parent
COMMAND, PROGRAM = HERE.parent / "pliant-sweep", HERE / "fake_program.py"
PATIENCE = 300  # s; the machine may be busy


@pytest.fixture
def table(tmp_path):
    """A function that writes lines as the table of this test."""
    def write(*lines):
        path = tmp_path / "t.csv"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path
    return write


def rows_of(table):
    return read_rows(table, "hopper")


def start(table, *arguments):
    """pliant-sweep as a separate process."""
    return subprocess.Popen([sys.executable, COMMAND, table, "--program", PROGRAM, *map(str, arguments)], encoding="utf-8",
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE)


@pytest.fixture
def run(capsys, monkeypatch):
    """A function that runs pliant-sweep to its end, which must have `code`, and returns its output."""
    monkeypatch.setattr(sys, "argv", [str(COMMAND)])

    def call(table, *arguments, code=0):
        capsys.readouterr()
        try:
            result, error = main([str(table), "--program", str(PROGRAM), *map(str, arguments)]), ""
        except PliantError as raised:
            result, error = raised.exit_code, str(raised)
        output = capsys.readouterr().out + error
        assert result == code, output
        return output
    return call


def sweep(table, workers=2, retry=False):
    """The same within this process: {row id: State}."""
    folders = [RowFolder(table.with_suffix(""), row, table.parent, PROGRAM) for row in rows_of(table)]
    for folder in folders:
        folder.check()
    return Sweep(folders, PROGRAM, workers, retry).run()


def attempts(table, row):
    """Where each attempt of a row has begun."""
    path = table.with_suffix("") / row / "attempts"
    return [float(line.split()[0]) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []


def wait_for(condition):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.01)


# --- Tables

def test_rows(table):
    rows = rows_of(table("\ufeff# widths", "hopper_width,mu,scenario,seeds", "4.0,,,", "",
                           '5,1e-5,hopper,"1-2,7"', "# no row", " 6 ,, channel,"))
    assert [(r.number, r.line, r.scenario, r.id) for r in rows] == [
        (1, 3, "hopper", "hopper_width=4"),
        (2, 5, "hopper", "hopper_width=5,mu=1e-05,seed=1"),
        (3, 5, "hopper", "hopper_width=5,mu=1e-05,seed=2"),
        (4, 5, "hopper", "hopper_width=5,mu=1e-05,seed=7"),
        (5, 7, "channel", "channel,hopper_width=6")]
    assert rows[1].options == {"hopper_width": "5", "mu": "1e-05", "seed": "1"}


def test_ids_depend_on_the_row_alone(table):
    before = [r.id for r in rows_of(table("a,b", "1,2", "2,3"))]
    after = [r.id for r in rows_of(table("seeds,b,mode,a", "1,9,,9", ",3,,2.0", ",2.00,,1e0"))]
    assert after == ["a=9,b=9,seed=1", *reversed(before)]


def test_ids_name_folders(table):
    long = ",".join(["x" * 60] * 4)
    rows = rows_of(table("options_file,mode", "../a b.yaml,", "../a_b.yaml,", f'x,"{long}"', f'x,"{long}y"', ",good"))
    ids = [r.id for r in rows]
    assert len(set(ids)) == 5 and ids[4] == "mode=good"
    assert all("/" not in i and " " not in i and len(i) <= 200 for i in ids)


def test_names(table):
    assert [r.id for r in rows_of(table("name,a,seeds", "x,1,1-2", "y,1,"))] == ["x,seed=1", "x,seed=2", "y"]


def test_names_of_255_bytes_and_names_like_files(table):
    names = ["y" * 255, "results.csv.old", "slurm-x.log", "row.json"]
    assert [r.id for r in rows_of(table("name", *names))] == names
    assert [r.id for r in rows_of(table("name,seeds", "results.csv,1"))] == ["results.csv,seed=1"]


@pytest.mark.parametrize("text, same", [("4.0", "4"), ("4", "4"), ("+4", "4"), ("1e4", "10000"), ("0.10", "0.1"),
                                        ("31.6227766", "31.6227766"), ("9007199254740993", "9007199254740993"),
                                        ("1e-5", "1e-05"), ("1_0", "1_0"), ("nan", "nan"), ("1e999", "1e999"),
                                        ("sp", "sp"), (" rough ", "rough"), ("\u0663", "\u0663")])
def test_one_spelling_per_number(text, same):
    assert canonical(text) == same


def test_seeds():
    assert expand_seeds("1-3") == [1, 2, 3] and expand_seeds(" 1, 5 - 6,2") == [1, 5, 6, 2]


@pytest.mark.parametrize("lines, message", [
    ([], "the table is empty"),
    (["a,b"], "no rows"),
    (["a;b", "1;2"], "separated by commas"),
    (["a,,b", "1,2,3"], "column 2: has no name"),
    (["a,a", "1,2"], "two columns 'a'"),
    (["a,-b", "1,2"], "column 2: '-b' is not the name of an option"),
    (["a,output", "1,2"], "column 2: 'output' cannot be given"),
    (["a,seeds", "1,2,3"], r"line 2: 3 cells for 2 columns \(write lists in quotes"),
    (["a,b,c", "1,,2", "1,2"], r"line 3: 2 cells for 3 columns \(an empty cell needs its comma too: a,,b\)"),
    (["a,b", "1"], "line 2: 1 cell for 2 columns"),
    (["a,seeds", "1,x"], "line 2, column 'seeds': 'x' is neither"),
    (["a,seeds", "1,3-1"], "line 2, column 'seeds': the range 3-1 ends before it starts"),
    (["a,seeds", '1,"1-3,2"'], "line 2, column 'seeds': seed 2 occurs twice"),
    (["a,seeds,seed", "1,2,3"], "line 2: has a seed and seeds"),
    (["a,name", "1,x", "2,x"], "line 3: the row 'x' is there already, in line 2"),
    (["a", "# c", "1", "1.0"], "line 4: the row 'a=1' is there already, in line 3"),
    (["a", "9" * 5000], "line 2, column 'a': a number of 5000 characters"),
    (["a", "1." + "0" * 5000], "line 2, column 'a': a number of 5002 characters"),
    (["a,seeds", "1," + "9" * 5000], "line 2, column 'seeds': '9+' is neither"),
    (["\u0663a", "1"], "is not the name of an option"),
    (["a\u0663", "1"], "is not the name of an option"),
    (["a,name", "1,../x"], "line 2, column 'name': '../x' cannot name a folder"),
    *((["a,name", "1,x", f"2,{name}"], f"line 3, column 'name': '{name}' is the name of a file of the sweep")
      for name in ("results.csv", "units.csv", "report.html", "slurm.sh", "slurm-12.log")),
    (["a,name", "1,x", "2," + "y" * 256], "line 3, column 'name': 'y{50}…' makes a name of 256 characters; the limit is 255"),
    (["seeds,name", "5-12," + "y" * 248], "line 2, column 'name': 'y{50}…' makes a name of 256 characters"),
    (["a,scenario", "1,a b"], "line 2, column 'scenario': 'a b' is not the name"),
    (['a', '"1'], "cannot be read as a table"),
    (["a", "1\0"], r"cannot be read as a table|line 2, column 1: has the control character '\\x00'"),
    (["a,b", "1,2\x1b[2J"], r"line 2, column 2: has the control character '\\x1b'"),
    (["t_end", "-help"], "line 2, column 't_end': '-help' is the name of an option, not a value"),
    (["a", "--version"], "line 2, column 'a': '--version' is the name of an option"),
])
def test_bad_tables(table, lines, message):
    with pytest.raises(RunError, match=message):
        rows_of(table(*lines))


def test_values_that_begin_with_a_dash(table):
    assert [row.options["a"] for row in rows_of(table("a", "-1", "-inf", "-.5"))] == ["-1", "-inf", "-0.5"]


def test_a_table_that_is_no_file(tmp_path, run):
    os.mkfifo(tmp_path / "fifo.csv")
    (tmp_path / "device.csv").symlink_to("/dev/zero")
    for name, kind in (("fifo.csv", "a FIFO"), ("device.csv", "a device")):
        assert f"is {kind}, not a file" in run(tmp_path / name, code=2)
        with pytest.raises(RunError, match=f"is {kind}, not a file"):
            load_table(tmp_path / name)


@pytest.mark.parametrize("file, message", [("/dev/zero", "is a device, not a file"), ("fifo", "is a FIFO, not a file"),
                                           ("large", "the limit is 65536 bytes"), ("none", "No such file")])
def test_options_files_that_are_no_files(file, message, table, tmp_path, run):
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "large").write_bytes(b"#" * 65537)
    assert message in run(table("options_file", file), code=2)


@pytest.mark.parametrize("text", [
    "", "null", "3", "[]", '"text"', "{", "\0", "[" * 100000, '{"run": []}', '{"run": 3}', '{"run": {"scenario": "hopper"}}',
    '{"run": {"options": {}}}', '{"run": {"scenario": "hopper", "options": []}}',
    '{"run": {"scenario": "hopper", "options": {"a": 1}}}', '{"run": {"scenario": "hopper", "options": {"a": "1"}}, "exit_code": "0"}',
    '{"run": {"scenario": "hopper", "options": {"a": "1"}, "files_sha256": []}}',
    '{"run": {"scenario": "hopper", "options": {"a": "1"}}, "exit_code": 1, "message": []}',
    '{"run": {"scenario": "hopper", "options": {"a": "1"}}, "ensemble": 1}', '{"run": {"scenario": "hopper", "options": {"a": "1"}}, "ensemble": "../x"}'])
def test_records_of_other_shapes(text, table, tmp_path, run):
    (tmp_path / "t/x").mkdir(parents=True)
    (tmp_path / "t/x/row.json").write_text(text, encoding="utf-8")
    (tmp_path / "t/x/run.h5").write_text("run", encoding="utf-8")
    for mode in ("--status", "--merge", "--row=1"):
        assert "row.json: is " in run(table("name,a", "x,1"), mode, code=2)


def test_a_damaged_summary_leaves_the_other_rows(table, tmp_path, run):
    path = table("name", "x", "y")
    run(path, "--row", 1)
    (tmp_path / "t/x/summary.json").write_text("[]", encoding="utf-8")
    run(path, code=3)
    run(path, "--merge", code=3)
    results = pd.read_csv(tmp_path / "t/results.csv", index_col="row")
    assert list(results["status"]) == ["failed", "done"] and "summary.json: is damaged" in results["message"]["x"]


def test_messages_of_a_run_in_an_ensemble_name_the_folder_of_its_row(table, tmp_path):
    row = RowFolder(tmp_path / "t", rows_of(table("a,seed", "1,5"))[0], tmp_path)
    row.path.mkdir(parents=True)
    ensemble = EnsembleFolder([row], 1)
    row.start_in(ensemble.path.name)
    ensemble._write_row(row, {}, {"status": "failed", "seed": 5, "results": [], "warnings": [f"see {ensemble.path}/x"],
                                  "message": f"resume with -restart '{ensemble.path}'"})
    state = row.state()
    assert state.kind == "failed" and state.message == f"exit code 3: pliant: error: resume with -restart '{row.path}'"
    assert f"see {row.path}/x" in row.log_path.read_text(encoding="utf-8")
    assert read_json(row.path / "summary.json")["message"] == f"resume with -restart '{row.path}'"


def test_missing_table(tmp_path):
    with pytest.raises(RunError, match="none.csv: no such file"):
        rows_of(tmp_path / "none.csv")


@pytest.mark.parametrize("lines, message", [
    (["a,c", "1,", "1,2"], "line 3, column 'c': unknown option -c; did you mean -a?"),
    (["a,b", "1,1", "-2,5", "7,2"], "line 3, column 'a': -a -2: must be at least 0"),
    (["a,b", "1,1", "2,5", "3,x", "4,0"], "line 4, column 'b': -b x: not a finite number"),
    (["a,scenario", "1,", "2,hoper"], "line 3: unknown scenario 'hoper'"),
])
def test_options_are_checked_before_anything_runs(table, lines, message, tmp_path, run):
    path = table(*lines)
    assert message in run(path, code=2)
    assert not (tmp_path / "t").exists()


# --- Runs

def test_runs_and_skips(table, tmp_path, run):
    path = table("a,seeds,threads", "1,1-3,", "2,1,3")
    output = run(path, "-j", 2)
    assert output.splitlines()[-1] == "done 4/4, running 0, failed 0, waiting 0"
    assert all(attempts(path, f"a=1,seed={s}") == [0] for s in (1, 2, 3))
    threads = [(tmp_path / "t" / row / "attempts").read_text(encoding="utf-8").split()[1]
               for row in ("a=1,seed=1", "a=2,threads=3,seed=1")]
    assert threads == ["1", "3"]
    path = table("seeds,a,threads", "0,7,", "1-3,1.0,", "1,2,3")
    assert "row 1 (a=7,seed=0): done" in run(path)
    assert attempts(path, "a=1,seed=1") == [0] and attempts(path, "a=7,seed=0") == [0]
    results = pd.read_csv(tmp_path / "t/results.csv")
    assert list(results["row"]) == ["a=7,seed=0", "a=1,seed=1", "a=1,seed=2", "a=1,seed=3", "a=2,threads=3,seed=1"]


def test_number_of_workers(table, tmp_path):
    """Three at a time are enough for rows that wait for two others, and there are never more."""
    path = table("a,b,mode", *(f"{i},0.1,meet" for i in range(6)))
    sweep(path, workers=3)
    times = [json.loads(file.read_text(encoding="utf-8")) for file in tmp_path.glob("t/*/summary.json")]
    assert len(times) == 6
    assert max(sum(t["begun"] <= at["begun"] < t["ended"] for t in times) for at in times) == 3


def test_other_options_are_an_error(table, run):
    run(table("name,a,b", "x,1,", "y,1,"))
    output = run(table("name,a,b", "x,2,0", "y,1,"), code=2)
    assert "row 'x' (line 2) was run with other options: a was 1 and is 2; b was not given and is 0" in output


def test_a_longer_run_is_extended(table, tmp_path, run):
    """If only options have changed that a restart may change, the run resumes."""
    run(table("name,a,t_end,threads", "x,1,0.02,", "y,1,0.02,"))
    longer = table("name,a,t_end,threads", "x,1,0.05,", "y,1,0.02,2")
    assert "row 1 (x): waiting: to be extended: t_end was 0.02 and is 0.05" in run(longer, "--status", code=75)
    run(longer)
    assert [len(attempts(longer, row)) for row in "xy"] == [2, 1] and attempts(longer, "x")[1] >= 0.02
    assert "done 2/2" in run(longer)
    assert len(attempts(longer, "x")) == 2
    for line, words in (("x,1,0.03,", "t_end was 0.05 and is 0.03"), ("x,2,0.06,", "a was 1 and is 2"),
                        ("x,1,,", "t_end was 0.05 and is not given")):
        assert words in run(table("name,a,t_end,threads", line), code=2)
    # A sweep that is killed while it extends a row does not take the old result for the new one.
    (tmp_path / "t/y/summary.json").unlink()
    assert sweep(table("name,a,t_end", "y,1,0.07"))["y"].kind == "done"


def test_a_row_that_is_called_after_its_length_is_extended(table, run):
    """The longer run has a separate folder, and begins as a branch of the longest shorter run."""
    run(table("a,t_end", "1,0.02", "1,0.04", "2,0.05"))
    longer = table("a,t_end,seed", "1,0.06,", "2,0.03,", "1,0.06,7")
    run(longer)
    assert attempts(longer, "a=1,t_end=0.06")[0] >= 0.04
    assert attempts(longer, "a=2,t_end=0.03") == attempts(longer, "a=1,t_end=0.06,seed=7") == [0]
    assert attempts(longer, "a=1,t_end=0.04") == [0]


def test_a_row_that_was_continued_by_hand(table, tmp_path, run):
    """The row is an error until the table has the length of its run."""
    run(table("name,t_end", "x,0.02", "y,0.02"))
    subprocess.run([PROGRAM, "hopper", "-restart", tmp_path / "t/x", "-t_end", "0.07"], check=True, stdout=subprocess.DEVNULL,
                   env=os.environ | {"OMP_NUM_THREADS": "1"})
    for t_end in ("0.02", "0.05"):
        for mode in ((), ("--status",), ("--merge",), ("--row", 1)):
            output = run(table("name,t_end", f"x,{t_end}", "y,0.02"), *mode, code=2)
            assert f"row 'x' (line 2) has t_end = {t_end}, but its run was continued by hand with t_end = 0.07 and has reached 0.07" in output
            assert "Write t_end = 0.07 in the table" in output
    assert "done 2/2" in run(table("name,t_end", "x,0.07", "y,0.02"))
    assert "done 2/2" in run(table("name,t_end", "x,0.09", "y,0.02"))
    assert [round(t, 9) for t in attempts(tmp_path / "t.csv", "x")] == [0, 0.02, 0.07, 0.07]


def test_no_branch_begins_at_a_run_that_was_continued_by_hand(table, tmp_path, run):
    run(table("t_end", "0.02", "0.03"))
    subprocess.run([PROGRAM, "hopper", "-restart", tmp_path / "t/t_end=0.03", "-t_end", "0.07"], check=True, stdout=subprocess.DEVNULL,
                   env=os.environ | {"OMP_NUM_THREADS": "1"})
    run(table("t_end", "0.05"))
    assert attempts(tmp_path / "t.csv", "t_end=0.05") == [0.02]


@pytest.mark.parametrize("option, pushes, done, excess", [
    (5, 7, 7, True), (5, 7, 5, False), (7, 7, 7, False), (5, 5, 6, False)])
def test_pushes_beyond_the_row(option, pushes, done, excess, table, tmp_path):
    row = RowFolder(tmp_path / "t", rows_of(table("name,pushes", f"x,{option}"))[0], tmp_path)
    row.path.mkdir(parents=True)
    (row.path / "summary.json").write_text(json.dumps({"pushes": done, "parameters": {"pushes": {"value": pushes}}}), encoding="utf-8")
    assert (row._excess(row.row.options) == ("pushes", pushes, done)) == excess


def test_options_files_belong_to_the_options(table, tmp_path, run):
    (tmp_path / "o.yaml").write_text("a: 1\n", encoding="utf-8")
    path = table("options_file", "o.yaml")
    run(path)
    run(path)
    assert attempts(path, "options_file=o.yaml") == [0]
    (tmp_path / "o.yaml").write_text("a: 2\n", encoding="utf-8")
    assert "the file o.yaml has changed" in run(path, code=2)
    (tmp_path / "o.yaml").unlink()
    assert "o.yaml cannot be read" in run(path, code=2)


@pytest.mark.parametrize("option, value", [
    ("start", "f.csv"), ("start", "f.h5:3"), ("outline", "f.txt"), ("mesh", "f.off"), ("shape_outline", "f.txt"),
    ("obstacle", "polygon:f.txt"), ("obstacle", '"disk:0,4,1,polygon:1,2,3,4,4,4; polygon:f,1.txt"')])
def test_input_files_belong_to_the_options(option, value, table, tmp_path, run):
    name = {"start": value.split(":")[0], "obstacle": "f,1.txt" if "," in value else "f.txt"}.get(option, value)
    file = tmp_path / name
    file.write_text("1", encoding="utf-8")
    path = table(f"name,{option}", f"x,{value}")
    run(path)
    run(path)
    assert attempts(path, "x") == [0]
    file.write_text("2", encoding="utf-8")
    for mode in ((), ("--status",), ("--merge",), ("--row", 1)):
        assert f"row 'x' (line 2) was run with other options: the file {name} has changed. Give" in run(path, *mode, code=2)
    file.unlink()
    assert f"the file {name} cannot be read" in run(path, code=2)
    file.write_text("1", encoding="utf-8")
    assert "done 1/1" in run(path)


def test_rows_without_checksums_of_files_are_accepted(table, tmp_path, run):
    """As earlier versions wrote row.json, with the checksum of the options file alone."""
    for name in ("o.yaml", "f.csv"):
        (tmp_path / name).write_text("1", encoding="utf-8")
    path, record = table("name,options_file,start", "x,o.yaml,f.csv"), tmp_path / "t/x/row.json"
    run(path)
    before = read_json(record)
    before["run"]["options_file_sha256"] = before["run"].pop("files_sha256")["o.yaml"]
    record.write_text(json.dumps(before), encoding="utf-8")
    (tmp_path / "f.csv").write_text("2", encoding="utf-8")
    assert "done 1/1" in run(path) and attempts(path, "x") == [0]
    (tmp_path / "o.yaml").write_text("2", encoding="utf-8")
    assert "the file o.yaml has changed" in run(path, code=2)


def test_a_failure_is_tried_again_with_another_input_file(table, tmp_path):
    path = table("name,a,start", "x,-1,f.csv")
    assert sweep(path)["x"].kind == sweep(path)["x"].kind == "failed"
    (tmp_path / "f.csv").write_text("1", encoding="utf-8")
    assert RowFolder(tmp_path / "t", rows_of(path)[0], tmp_path, PROGRAM).state().kind == "waiting"


def test_foreign_runs_are_left_alone(table, tmp_path, run):
    (tmp_path / "t/x").mkdir(parents=True)
    (tmp_path / "t/x/run.h5").write_text("precious", encoding="utf-8")
    assert "holds a run that pliant-sweep has not made" in run(table("name,a", "x,1"), code=2)
    assert (tmp_path / "t/x/run.h5").read_text(encoding="utf-8") == "precious"


def test_failed_rows_do_not_spoil_the_others(table, tmp_path, run):
    path = table("name,mode", "w,bad", "x,", "y,die", "z,silent", "v,good")
    output = run(path, "-j", 1, code=3)
    failed = ["row 1 (w): failed: exit code 3: pliant: error: not finite",
              "row 3 (y): failed: killed by SIGKILL: no output",
              "row 4 (z): failed: exit code 0 without a result: no output"]
    assert output.splitlines()[-4:] == ["done 2/5, running 0, failed 3, waiting 0", *failed]
    results = pd.read_csv(tmp_path / "t/results.csv", index_col="row")
    assert list(results["status"]) == ["failed", "done", "failed", "failed", "done"]
    assert results["message"]["w"] == "exit code 3: pliant: error: not finite"
    # Only on request again, and then from the start, as there is no checkpoint.
    run(path, code=3)
    assert attempts(path, "w") == [0]
    run(path, "--retry", code=3)
    assert attempts(path, "w") == [0, 0] and attempts(path, "x") == [0]


def test_failures_without_a_run_may_be_corrected(table, tmp_path):
    path = table("name,a", "x,-1")
    assert sweep(path)["x"].kind == "failed"  # as --row does, without the check of options
    assert sweep(path)["x"] == State("failed", "failed", "exit code 2: pliant: error: -a -1: must be at least 0")
    assert sweep(table("name,a", "x,1"))["x"].kind == "done"


def test_a_row_whose_folder_is_in_use_waits(table, tmp_path, run):
    """Folder in use by a run that was started by hand: exit code 6 does not count as a failure of the row."""
    path, folder = table("name,mode", "x,gate", "y,"), tmp_path / "t/x"
    folder.mkdir(parents=True)
    row = RowFolder(tmp_path / "t", rows_of(path)[0], tmp_path)
    by_hand = subprocess.Popen(row.start(PROGRAM), stdout=subprocess.DEVNULL, env=os.environ | row.environment)
    wait_for(lambda: attempts(path, "x"))
    assert f"row 1 (x): running: process {by_hand.pid} on host {socket.gethostname()}" in run(path, "--status", code=75)
    sweep = start(path)
    wait_for(lambda: attempts(path, "y"))
    (folder / "go").touch()
    assert by_hand.wait() == 0
    output, _ = sweep.communicate(timeout=PATIENCE)
    assert sweep.returncode == 0 and output.count("row 1 (x): running") == 1, output
    assert attempts(path, "x") == [0]


def test_exit_code_6_is_tried_again(table, tmp_path, run, monkeypatch):
    """The lock alone decides: nothing that the sweep has seen before."""
    path, folder = table("name", "x"), tmp_path / "t/x"
    folder.mkdir(parents=True)
    monkeypatch.setattr(sweep_jobs, "holder", lambda folder: None)
    with open(folder / "run.lock", "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert "row 1 (x): running: another process" in run(path, "--row", 1, code=75)
        thread = threading.Timer(1.5, lock.close)
        thread.start()
        assert "done 1/1" in run(path)
    assert attempts(path, "x") == [0]
    assert "is in use by" in (folder / "log.txt").read_text(encoding="utf-8")


def test_the_message_of_a_failure_is_its_own(table, tmp_path):
    """A row reports the error of its run, not the message "folder in use" that another sweep has received."""
    folder = RowFolder(tmp_path / "t", rows_of(table("name", "x"))[0], tmp_path, PROGRAM)
    folder.path.mkdir(parents=True)
    folder.end(3, "pliant: error: not finite\npliant: error: t/x is in use by process 1 on host a; wait\n")
    assert folder.state().message == "exit code 3: pliant: error: not finite"


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_stop_and_go_on(table, how, tmp_path, run):
    path = table("name,mode", "x,gate", "y,gate", "z,")
    process = start(path, "-j", 2)
    wait_for(lambda: attempts(path, "x") and attempts(path, "y"))
    process.send_signal(how)
    process.send_signal(signal.SIGTERM)  # another one at once is the same request
    output, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 75 and errors == "", errors
    assert "row 1 (x): stopped" in output and "run the same command again" in output
    assert not attempts(path, "z")
    assert "stopped 2, waiting 1" in run(path, "--status", code=75)
    for name in "xy":
        (tmp_path / "t" / name / "go").touch()
    run(path)
    begun = attempts(path, "x")
    assert len(begun) == 2 and begun[0] == 0 and begun[1] > 0
    assert attempts(path, "z") == [0]


def test_runs_are_process_groups_of_the_session(table):
    """So that Ctrl-C reaches the sweep alone, and its niceness counts for its runs."""
    path = table("name,mode", "x,gate")
    process = start(path)
    wait_for(lambda: attempts(path, "x"))
    [run] = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text(encoding="utf-8").split()
    assert os.getpgid(int(run)) == int(run)
    assert os.getsid(int(run)) == os.getsid(process.pid)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 75


def test_ignored_signals_stay_ignored(table, tmp_path):
    path = table("name,mode", "x,gate")
    process = subprocess.Popen(["nohup", sys.executable, COMMAND, path, "--program", PROGRAM], stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT)
    wait_for(lambda: attempts(path, "x"))
    process.send_signal(signal.SIGHUP)
    (tmp_path / "t/x/go").touch()
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 0


def test_later_signals_kill(table, tmp_path, run):
    path, folder = table("name,b,mode", "x,1000,uncooperative"), tmp_path / "t/x"
    process = start(path)
    wait_for(lambda: attempts(path, "x"))
    begun = time.monotonic()
    while holder(folder) and time.monotonic() - begun < PATIENCE:
        process.send_signal(signal.SIGINT)
        until = time.monotonic() + 2.5
        while holder(folder) and time.monotonic() < until:
            time.sleep(0.05)
    assert time.monotonic() - begun > 2
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 75
    assert "stopped 1" in run(path, "--status", code=75)


def test_runs_of_a_killed_sweep_stop(table, tmp_path, run):
    path, folder = table("name,mode", "x,gate", "y,gate"), tmp_path / "t/x"
    process = start(path, "-j", 2)
    wait_for(lambda: attempts(path, "x") and attempts(path, "y"))
    process.kill()
    process.communicate()
    wait_for(lambda: not holder(folder) and not holder(tmp_path / "t/y"))
    assert (folder / "checkpoint-a.h5").exists() and "stopped 2" in run(path, "--status", code=75)
    for name in "xy":
        (tmp_path / "t" / name / "go").touch()
    assert "done 2/2" in run(path)
    begun = attempts(path, "x")
    assert len(begun) == 2 and begun[1] > 0


def test_a_sweep_waits_for_runs_that_go_on(table, tmp_path, run):
    """Runs of a killed sweep that do not stop at once are not started again, and count when they are done."""
    path, folder = table("name,b,mode", "x,4,uncooperative", "y,0,"), tmp_path / "t/x"
    process = start(path, "-j", 1)
    wait_for(lambda: attempts(path, "x"))
    process.kill()
    process.communicate()
    pid = int(holder(folder).split()[1])
    assert pid != process.pid
    os.kill(pid, 0)  # the run, which is alive
    output = run(path)
    assert f"row 1 (x): running: process {pid} on host {socket.gethostname()}" in output and "done 2/2" in output
    assert attempts(path, "x") == [0] and attempts(path, "y") == [0]


def test_a_row_does_not_wait(table, tmp_path, run):
    path = table("name,b,mode", "x,1000,gate")
    process = start(path)
    wait_for(lambda: attempts(path, "x"))
    assert "running: process" in run(path, "--row", 1, code=75)
    (tmp_path / "t/x/go").touch()
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=PATIENCE)


@pytest.mark.parametrize("arguments, code", [(["--status"], 4), (["--parallel"], 4), (["--help"], 4), ([], 0)])
def test_output_that_cannot_be_written(table, tmp_path, arguments, code):
    path = table("name", "x", "y")
    with open("/dev/full", "w", encoding="utf-8") as full:
        result = subprocess.run([sys.executable, COMMAND, path, "--program", PROGRAM, *arguments], encoding="utf-8", stdout=full,
                                stderr=subprocess.PIPE)
    assert result.returncode == code, result.stderr
    lines = result.stderr.splitlines()
    assert len(lines) == 1 and "standard output cannot be written: No space left" in lines[0], result.stderr
    assert arguments or len(pd.read_csv(tmp_path / "t/results.csv")) == 2


def test_links_are_not_followed(table, tmp_path, run):
    path, folder = table("name", "x"), tmp_path / "t/x"
    folder.mkdir(parents=True)
    precious = tmp_path / "precious"
    precious.write_text("mine", encoding="utf-8")
    for link in ("../results.csv", "../slurm.sh"):
        (folder / link).symlink_to(precious)
    (folder / "row.json").symlink_to(precious)
    assert "row.json: is damaged" in run(path, code=2)
    (folder / "row.json").unlink()
    run(path)
    run(path, "--slurm")
    assert precious.read_text(encoding="utf-8") == "mine"
    for link, code in (("log.txt", 2), ("run.lock", 3)):
        (tmp_path / "t" / link).mkdir()
        (tmp_path / "t" / link / link).symlink_to(precious)
        assert f"{link}: is a symbolic link, not a file" in run(table("name", link), code=code)
        (tmp_path / "t" / link / link).unlink()
        os.link(precious, tmp_path / "t" / link / link)
        assert f"{link}: is a file with other names" in run(table("name", link), code=code)
        (tmp_path / "t" / link / link).unlink()
        os.mkfifo(tmp_path / "t" / link / link)
        assert f"{link}: is a FIFO, not a file" in run(table("name", link), code=code)
    assert precious.read_text(encoding="utf-8") == "mine"


def test_names_run_no_commands(table, tmp_path, run):
    bad = tmp_path / "a\ntouch pwned\n.csv"
    bad.write_text("name\nx\n", encoding="utf-8")
    assert "control characters" in run(bad, "--slurm", code=2)
    assert "cannot name a folder" in run(table("name", "x"), "--slurm", "--output", tmp_path / 'a"b', code=2)
    assert list(tmp_path.glob("*/slurm.sh")) == []
    strange = tmp_path / "a$(touch pwned);touch pwned&'.csv"
    strange.write_text("name\nx\n", encoding="utf-8")
    assert str(strange) in shlex.split(run(strange, "--parallel"))
    run(strange, "--slurm")
    subprocess.run(["sh", strange.with_suffix("") / "slurm.sh"], env=os.environ | {"SLURM_ARRAY_TASK_ID": "1"}, check=True,
                   cwd=tmp_path)
    assert len(attempts(strange, "x")) == 1 and list(tmp_path.rglob("pwned")) == []


def test_a_result_that_is_gone(table, tmp_path, run):
    path = table("name", "x")
    run(path)
    (tmp_path / "t/x/summary.json").unlink()
    assert "failed: summary.json is gone" in run(path, "--status", code=3)


def test_killed_runs_begin_anew_without_a_checkpoint(table, tmp_path, run):
    """The remains of a crashed machine: a record of the start, a run without frames, a lock of a dead owner."""
    path = table("name,a", "x,1", "y,1")
    for name in "xy":
        folder = tmp_path / "t" / name
        folder.mkdir(parents=True)
        (folder / "row.json").write_text(json.dumps({"run": {"scenario": "hopper", "options": {"a": "1"}}}), encoding="utf-8")
        (folder / "run.h5").write_text("", encoding="utf-8")
        (folder / "run.lock").write_text(f"process 1 on host {socket.gethostname()}", encoding="utf-8")
    (tmp_path / "t/y/checkpoint-a.h5").write_text("0.5", encoding="utf-8")
    assert "stopped 2" in run(path, "--status", code=75)
    run(path)
    assert attempts(path, "x") == [0] and attempts(path, "y") == [0.5]


def test_one_row(table, tmp_path, run):
    path = table("a,seeds", "1,1-3")
    run(path, "--row", 2)
    assert attempts(path, "a=1,seed=2") == [0] and not attempts(path, "a=1,seed=1")
    assert run(path, "--row", 2) == "row 2 (a=1,seed=2): done\n"
    assert not (tmp_path / "t/results.csv").exists()
    assert "the table has the rows 1 … 3" in run(path, "--row", 4, code=2)
    assert "the table has the rows 1 … 3" in run(path, "--row", 0, code=2)


def test_progress_line(table):
    path = table("name,mode", "x,", "y,bad", "z,gate", "w,")
    leader, follower = os.openpty()
    process = subprocess.Popen([sys.executable, COMMAND, path, "--program", PROGRAM, "-j", "1"], stdout=follower)
    os.close(follower)
    text = b""
    while b"done 1/4, running 1, failed 1, waiting 1, ETA" not in text:
        text += os.read(leader, 1000)
    (path.with_suffix("") / "z/go").touch()
    while b"done 3/4, running 0, failed 1, waiting 0" not in text:
        text += os.read(leader, 1000)
    assert process.wait(PATIENCE) == 3
    os.close(leader)


def test_progress_of_an_ensemble(table, tmp_path):
    """Runs that have ended count as done, as many of the others as there are slots as running; the time left follows from them."""
    path = table("a,seeds", "1,1-20")
    folders = [RowFolder(path.with_suffix(""), row, path.parent, PROGRAM) for row in rows_of(path)]
    working = Sweep(folders, PROGRAM, 2, ensembles=True)
    working.states = {folder.row.id: folder.state() for folder in folders}
    [task] = working._tasks(folders)
    for folder in folders:
        folder.path.mkdir(parents=True)
        folder.start_in(task.path.name)
    job = object.__new__(sweep_jobs._Job)
    job.task, job.left, job.done, job.started = task, list(task.rows), 0, time.monotonic() - 30
    working._jobs.append(job)
    working._take(job, [])
    assert count_text(working.states.values()) == "done 0/20, running 2, failed 0, waiting 18" and working._left_seconds() is None
    for folder in task.rows[:5]:
        task._write_row(folder, {}, {"status": "done", "seed": 0, "results": [], "warnings": []})
    working._take(job, task.rows[:5])
    assert count_text(working.states.values()) == "done 5/20, running 2, failed 0, waiting 13"
    assert working._left_seconds() == pytest.approx(90, rel=0.05)  # 15 runs at the pace of 5 in 30 s


def test_status_changes_nothing(table, tmp_path, run):
    assert "row 1 (a=1): waiting" in run(table("a", "1"), "--status", code=75)
    assert not (tmp_path / "t").exists()


def test_a_reader_that_goes_away(table):
    process = subprocess.Popen([COMMAND, table("a,seeds", "1,1-20000"), "--status", "--program", PROGRAM],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout.readline().startswith(b"row 1 ")
    process.stdout.close()
    assert process.stderr.read() == b"" and process.wait(PATIENCE) == 141


def test_several_sweeps_share_the_rows(table, run):
    path = table("a,seeds,b", "1,1-12,0.1")
    processes = [start(path, "-j", 2) for _ in range(3)]
    for process in processes:
        process.communicate(timeout=PATIENCE)
        assert process.returncode in (0, 75)
    assert all(attempts(path, f"a=1,b=0.1,seed={s}") == [0] for s in range(1, 13))
    assert "done 12/12" in run(path)


def _write_often(path):
    for i in range(200):
        write_atomically(path, f"{i}\n")


def test_several_processes_write_one_file(tmp_path):
    with ProcessPoolExecutor(4) as pool:
        list(pool.map(_write_often, [tmp_path / "results.csv"] * 4))
    assert [path.name for path in tmp_path.iterdir()] == ["results.csv"]
    assert (tmp_path / "results.csv").read_text(encoding="utf-8") == "199\n"


def test_parallel_and_slurm_run_every_row(table, tmp_path, run):
    path = table("a,seeds,threads", "1,1-3,2")
    line = run(path, "--parallel", "-j", 3).strip()
    assert line.startswith("seq 3 | parallel -q -j 3 --termseq TERM,60000,KILL,25 ") and line.endswith(" --row {}")
    assert not (tmp_path / "t").exists()
    assert run(path, "--slurm").strip() == f"sbatch {tmp_path}/t/slurm.sh"
    script = (tmp_path / "t/slurm.sh").read_text(encoding="utf-8")
    assert "\n#SBATCH --array=1-3\n" in script and "\n#SBATCH --cpus-per-task=2\n" in script
    for task in (1, 2, 3):
        subprocess.run([tmp_path / "t/slurm.sh"], env=os.environ | {"SLURM_ARRAY_TASK_ID": str(task)}, check=True,
                       cwd="/", capture_output=True)
    assert "done 3/3" in run(path, "--status")


def test_program_is_named(table, tmp_path, run):
    output = run(table("a", "1"), "--program", tmp_path / "none", code=2)
    assert "none: there is no such program; name it with --program" in output


# --- Results

def test_a_table_that_is_not_there(tmp_path, run):
    assert run(tmp_path / "a.csv", code=2) == f"{tmp_path}/a.csv: no such file"


def test_results(table, tmp_path, run):
    path = table("name,hopper_width", "x,4", "y,5", "z,6", "w,7")
    for row in rows_of(path):
        if row.id != "w":
            write_run(tmp_path / "t" / row.id, w=float(row.options["hopper_width"]), n=20, frames=1, samples=10,
                      status="clogged" if row.id == "y" else "done", Q=0.0 if row.id == "y" else 3.0)
            record = {"run": {"scenario": "hopper", "options": row.options}, "exit_code": 0}
            (tmp_path / "t" / row.id / "row.json").write_text(json.dumps(record), encoding="utf-8")
    (tmp_path / "t/z/run.h5").write_text("damaged", encoding="utf-8")
    assert "results.csv: 3 of 4 rows are done" in run(path, "--merge", code=75)
    results = pd.read_csv(tmp_path / "t/results.csv", index_col="row")
    assert list(results.index) == ["x", "y", "z", "w"]
    assert list(results["status"]) == ["done", "clogged", "done", "waiting"]
    assert list(results["hopper_width"]) == [4, 5, 6, 7]
    assert results["Q"]["x"] == 3 and results["Q_error"]["x"] == 0.1 and results["Q"]["y"] == 0
    assert results["Q"][["z", "w"]].isna().all() and "cannot be read" in results["message"]["z"]
    units = pd.read_csv(tmp_path / "t/units.csv", index_col="column")["unit"]
    assert units["Q"] == units["Q_error"] == "sigma_avg^2/t0" and units["hopper_width"] == "sigma_avg"


def test_texts():
    states = [State("done", "clogged"), State("failed", "failed", "x"), State("waiting", "waiting")]
    assert count_text(states) == "done 1/3, running 0, failed 1, waiting 1"
    assert [duration_text(s) for s in (5, 120, 3700)] == ["5 s", "2 min", "1 h 02 min"]
