"""pliant-sweep with the real program: two widths and two seeds, stopped once and merged."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import h5py
import pandas as pd
import pytest
from conftest import HANGS, PROGRAM, SMALL, Results, hopper, pliant, same, wait_for
from test_ensemble import values

COMMAND = [sys.executable, Path(__file__).resolve().parents[2] / "python/pliant-sweep"]


def start(*arguments):
    return subprocess.Popen([*COMMAND, *map(str, arguments), "--program", PROGRAM], encoding="utf-8", stdout=subprocess.PIPE,
                            stderr=subprocess.STDOUT)


@contextmanager
def paused(lock):
    """The process that has the lock stands still: a status takes longer than a small ensemble."""
    process = int(lock.read_text(encoding="utf-8").split()[1])
    os.kill(process, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(process, signal.SIGCONT)


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


# ---- rows in ensembles

PACK = {"scenario": "pack", "n": 20, "pressure": 1e-3}


def write_table(path, *rows):
    """A table with a line for each dict."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    lines = [columns, *([str(row.get(name, "")) for name in columns] for row in rows)]
    path.write_text("".join(",".join(line) + "\n" for line in lines), encoding="utf-8")
    return path


def sweep(table, *arguments, code=0):
    process = start(table, *arguments)
    output, _ = process.communicate(timeout=HANGS)
    assert process.returncode == code, output
    return output


def assert_same_rows(a, b):
    """Equal bit for bit, but for the data for ParaView, which ensembles leave out."""
    with h5py.File(a / "run.h5") as file, h5py.File(b / "run.h5") as other:
        mine, others = values(file), values(other)
    assert mine.keys() == others.keys() and len(mine) > 40 and all(same(mine[name], others[name]) for name in mine)
    assert Results(a).counters() == Results(b).counters()


def ensembles_left(folder):
    return list((folder / ".ensembles").glob("*"))


def records(folder):
    return {path.parent.name: json.loads(path.read_text(encoding="utf-8")) for path in folder.glob("*/row.json")}


def test_rows_of_ensembles_equal_single_runs(tmp_path):
    table = write_table(tmp_path / "t.csv", SMALL | {"hopper_width": 3, "seeds": "1-4"}, SMALL | {"hopper_width": 4, "seeds": '"1,2,7"'},
                        PACK | {"seeds": "5-6"}, SMALL | {"hopper_width": 5, "seed": 2, "threads": 1})
    sweep(table, "--ensembles", "-j", 2)
    sweep(table, "-o", tmp_path / "alone", "-j", 2)
    assert ensembles_left(tmp_path / "t") == []
    together = {name for name, record in records(tmp_path / "t").items() if "ensemble" in record}
    assert len(together) == 8 and all("seed=7" not in name and "threads" not in name for name in together)
    results, alone = (pd.read_csv(tmp_path / folder / "results.csv", dtype=str, index_col="row") for folder in ("t", "alone"))
    assert list(results.index) == list(alone.index) and list(results.columns) == list(alone.columns)
    of_the_command = ["run", "output", "ensemble", "ensemble_workers", "cpu_seconds", "wall_seconds", "particle_steps_per_second",
                      "ns_per_particle_step", "ns_per_vertex_step"]
    pd.testing.assert_frame_equal(results.drop(columns=of_the_command, errors="ignore"), alone.drop(columns=of_the_command, errors="ignore"))
    assert (tmp_path / "t/units.csv").read_bytes() == (tmp_path / "alone/units.csv").read_bytes()
    units = pd.read_csv(tmp_path / "t/units.csv", index_col="column")["unit"]
    assert units["energy"] == "eps" and units["max_force"] == "eps/sigma_avg"
    for row in results.index:
        assert_same_rows(tmp_path / "t" / row, tmp_path / "alone" / row)
    assert "done 10/10" in sweep(table)  # also without --ensembles


def test_failed_rows_of_ensembles(tmp_path):
    table = write_table(tmp_path / "t.csv", PACK | {"pressure": 1e-6, "max_iterations": 250, "seeds": "1-6"},
                        SMALL | {"hopper_width": 8, "seeds": "1-2"})
    sweep(table, "--ensembles", code=3)
    sweep(table, "-o", tmp_path / "alone", code=3)
    results, alone = (pd.read_csv(tmp_path / folder / "results.csv", index_col="row") for folder in ("t", "alone"))
    assert list(results["status"]) == list(alone["status"]) and (results["status"] == "failed").sum() == 6
    assert list(results["message"].fillna("")[:6]) == list(alone["message"].fillna("")[:6])
    assert all("exit code 2: pliant: error: " in text for text in results["message"][6:])
    before = (tmp_path / "t/pack,max_iterations=250,n=20,pressure=1e-06,seed=1/run.h5").stat().st_mtime_ns
    assert "failed 6" in sweep(table, "--ensembles", code=3)
    assert (tmp_path / "t/pack,max_iterations=250,n=20,pressure=1e-06,seed=1/run.h5").stat().st_mtime_ns == before
    for more in (["--ensembles"], []):  # in an ensemble again, then alone
        sweep(table, "--retry", *more, code=3)
        again = pd.read_csv(tmp_path / "t/results.csv", index_col="row")
        assert list(again["status"]) == list(alone["status"])
        assert list(again["message"].fillna("")[:6]) == list(alone["message"].fillna("")[:6])
    assert (tmp_path / "t/pack,max_iterations=250,n=20,pressure=1e-06,seed=1/checkpoint-a.h5").exists()


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_an_interrupted_sweep_keeps_the_runs_of_its_ensemble(how, tmp_path):
    table = write_table(tmp_path / "t.csv", PACK | {"n": 200, "pressure": 1e-5, "seeds": "1-40"})
    process = start(table, "--ensembles", "-j", 2)
    stored = tmp_path / "t/.ensembles/pack,n=200,pressure=1e-05,seed=1/ensemble.h5"
    wait_for(lambda: stored.exists() and stored.stat().st_size > 5e5, process)
    if how == signal.SIGKILL:
        with paused(stored.with_name("run.lock")):
            counts = re.search(r"done (\d+)/40, running (\d+)", sweep(table, "--status", code=75))
        assert int(counts[1]) + int(counts[2]) == 40 and int(counts[2]) > 0
    process.send_signal(how)
    process.communicate(timeout=HANGS)
    assert process.returncode == (75 if how == signal.SIGTERM else -how)
    if how == signal.SIGKILL:  # the ensemble stops when the sweep has ended
        wait_for(lambda: "running 0" in start(table, "--status").communicate()[0])
        assert "stopped" in sweep(table, "--status", code=75)
    else:
        assert "stopped" in sweep(table, "--status", code=75)
    process = start(table, "--ensembles", "-j", 2)
    wait_for(lambda: any(record.get("exit_code") == 0 for record in records(tmp_path / "t").values()), process)
    # A row that was killed between its run.h5 and its record is written again.
    ended = [name for name, record in records(tmp_path / "t").items() if record.get("exit_code") == 0]
    kept = {path: path.stat().st_mtime_ns for path in (tmp_path / "t" / name / "run.h5" for name in ended)}
    assert "done 40/40" in process.communicate(timeout=HANGS)[0] and process.returncode == 0
    assert 0 < len(kept) < 40 and all(path.stat().st_mtime_ns == at for path, at in kept.items())
    sweep(table, "-o", tmp_path / "alone")
    results, alone = (pd.read_csv(tmp_path / folder / "results.csv", index_col="row") for folder in ("t", "alone"))
    assert results["fraction"].equals(alone["fraction"]) and ensembles_left(tmp_path / "t") == []


def test_a_killed_ensemble_makes_its_other_rows_fail(tmp_path):
    table = write_table(tmp_path / "t.csv", SMALL | {"t_end": 1000, "seeds": "1-3"}, SMALL | {"seed": 4})
    process = start(table, "--ensembles", "-j", 2)
    lock = tmp_path / "t/.ensembles" / name_of(SMALL | {"t_end": 1000, "seed": 1}) / "run.lock"
    wait_for(lambda: lock.exists() and "process" in lock.read_text(encoding="utf-8"), process)
    os.kill(int(lock.read_text(encoding="utf-8").split()[1]), signal.SIGKILL)
    output, _ = process.communicate(timeout=HANGS)
    assert process.returncode == 3 and output.count("killed by SIGKILL") == 6 and "done 1/4, running 0, failed 3" in output, output


def name_of(options):
    """The name of a row of these options."""
    return ",".join(f"{name}={options[name]}" for name in sorted(options, key=lambda name: (name == "seed", name)))


def test_a_sweep_with_ensembles_works_alone(tmp_path):
    options = SMALL | {"t_end": 3000, "clog_time": 3000}
    table = write_table(tmp_path / "t.csv", options | {"seeds": "1-3"})
    alone = start(table, "--ensembles")
    lock = tmp_path / "t/.ensembles" / name_of(options | {"seed": 1}) / "run.lock"
    wait_for(lambda: lock.exists() and "process" in lock.read_text(encoding="utf-8"), alone)
    for more in (["--ensembles"], []):
        output = sweep(table, *more, code=6)
        assert "another pliant-sweep" in output and "--ensembles" in output and "Traceback" not in output
    alone.send_signal(signal.SIGTERM)
    alone.communicate(timeout=HANGS)
    together = start(table)
    wait_for(lambda: list((tmp_path / "t").glob("*/run.lock")), together)
    assert "another pliant-sweep" in sweep(table, "--ensembles", code=6)
    together.send_signal(signal.SIGTERM)
    together.communicate(timeout=HANGS)


def test_rows_of_an_ensemble_end_one_after_the_other(tmp_path):
    """Each has its files, its status and its line of the output while others run, and the results of a row alone."""
    options = SMALL | {"t_end": 300, "frame_interval": 30}
    table = write_table(tmp_path / "t.csv", options | {"seeds": "1-12"})
    process = start(table, "--ensembles", "-j", 1)
    row = tmp_path / "t" / name_of(options | {"seed": 1})
    wait_for((row / "summary.json").exists, process)
    assert ensembles_left(tmp_path / "t") and Results(row).summary["status"] == "done"
    with paused(tmp_path / "t/.ensembles" / row.name / "run.lock"):
        counts = re.search(r"done (\d+)/12, running (\d+), failed 0, waiting 0", sweep(table, "--status", code=75))
    assert 0 < int(counts[1]) < 12
    process.send_signal(signal.SIGTERM)
    output, _ = process.communicate(timeout=HANGS)
    rows = re.findall(r"^row (\d+) \(.*\): (\w+)$", output, re.MULTILINE)
    assert process.returncode == 75 and rows[0] == ("1", "done") and rows[-1][1] == "stopped"
    assert sorted(int(row) for row, _ in rows) == list(range(1, 13))  # each once
    hopper(tmp_path / "alone", **options | {"seed": 1})
    assert_same_rows(row, tmp_path / "alone")


def test_a_message_on_an_ensemble_names_the_folders_of_its_rows(tmp_path):
    table = write_table(tmp_path / "t.csv", SMALL | {"seeds": "1-2"})
    folder = tmp_path / "t/.ensembles" / name_of(SMALL | {"seed": 1})
    folder.mkdir(parents=True)
    (folder / "run.h5").touch()
    output = sweep(table, "--ensembles", code=3)
    for seed in (1, 2):
        row = tmp_path / "t" / name_of(SMALL | {"seed": seed})
        assert f"{row} holds a single run" in output and ".ensembles" not in output
    assert "done 2/2" in sweep(table, "--ensembles", "--retry")


def test_a_longer_row_of_an_ensemble_starts_again(tmp_path):
    """The row has no checkpoint; its results equal the results of an uninterrupted run."""
    names = {"name": "x", "seeds": "1-2"}
    sweep(write_table(tmp_path / "t.csv", SMALL | names), "--ensembles")
    longer = write_table(tmp_path / "t.csv", SMALL | names | {"t_end": 9})
    assert "to be extended" in sweep(longer, "--status", code=75)
    sweep(longer, "--row", 1)
    sweep(longer, "--ensembles")
    for seed in (1, 2):
        hopper(tmp_path / str(seed), t_end=9, seed=seed)
        assert_same_rows(tmp_path / f"t/x,seed={seed}", tmp_path / str(seed))


def test_a_row_that_was_continued_by_hand(tmp_path):
    table = write_table(tmp_path / "t.csv", SMALL | {"name": "x", "t_end": 2})
    sweep(table)
    assert pliant("hopper", restart=tmp_path / "t/x", t_end=7).returncode == 0
    for t_end in (2, 5):
        write_table(table, SMALL | {"name": "x", "t_end": t_end})
        assert f"has t_end = {t_end}, but its run was continued by hand with t_end = 7 and has reached 7" in sweep(table, code=2)
    for t_end in (7, 8):
        assert "done 1/1" in sweep(write_table(table, SMALL | {"name": "x", "t_end": t_end}))
        assert Results(tmp_path / "t/x").summary["t"] == pytest.approx(t_end)


@pytest.mark.parametrize("more", [[], ["--ensembles"]], ids=str)
def test_a_changed_obstacle_is_an_error(more, tmp_path):
    (tmp_path / "ob.txt").write_text("-0.5 4\n0.5 4\n0 5\n", encoding="utf-8")
    table = write_table(tmp_path / "t.csv", SMALL | {"name": "x", "obstacle": "polygon:ob.txt", "seeds": "1-2"})
    sweep(table, *more)
    assert "done 2/2" in sweep(table, *more)
    (tmp_path / "ob.txt").write_text("-0.5 4\n0.5 4\n0 6\n", encoding="utf-8")
    for mode in (more, ["--status"]):
        assert "row 'x,seed=1' (line 2) was run with other options: the file ob.txt has changed" in sweep(table, *mode, code=2)


@pytest.mark.parametrize("mode", ["--row=1", "--slurm", "--parallel"])
def test_modes_without_ensembles(mode, tmp_path):
    table = write_table(tmp_path / "t.csv", SMALL | {"seeds": "1-2"})
    assert "--ensembles runs many rows in one process" in sweep(table, "--ensembles", mode, code=2)


def test_ensembles_are_no_columns(tmp_path):
    table = write_table(tmp_path / "t.csv", SMALL | {"ensemble": 3})
    assert "column 10: 'ensemble' cannot be given in a table" in sweep(table, code=2)
