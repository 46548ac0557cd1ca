"""pliant-reproduce: tables into runs, runs into figures and rows. A small program stands for pliant, and copies runs
that were made before."""

import argparse
import dataclasses
import json
import math
import os
import re
import signal
import sys
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from synthetic import write_run
from synthetic_channel import channel_tracks, write_channel_run
from test_clog import made_table
from test_plots import assert_picture
from test_raft import K1, write_raft

from pliant import PliantError, beverloo, beverloo_figures, clog_analysis as clog, ensemble, plotting, symbols
from pliant.files import read_json, write_json
from pliant.reproduce import command, disk_motion, figure, hopper_runs, measure, packings, published
from pliant.reproduce.figure import Figure, Quantity, agree, deviation, rows, seeds_text, write_rows
from pliant.reproduce.published import Published
from pliant.reproduce.readings import plateau
from pliant.sweep_rows import read_rows

HERE = Path(__file__).resolve().parent
COMMAND = HERE.parent / "pliant-reproduce"
LAWS = {"mu": (0.15, 1.6, 1.5), "zeta": (0.42, 2.4, 0.5)}
TABLE = "e_sp,mu,zeta,hopper_width,seeds\n" + "".join(
    f"100,{mu},{zeta},{w},1-2\n" for mu, zeta in (("31.6", ""), ("", "0.316")) for w in (3, 5, 8, 10))

#: Tables whose figures show single runs.
ONE_SEED = ("quick/three", "raft/three", "quick/small-droplets", "channel/snapshot")

# Copies the run of its row, and records the call; a row without a run fails. The rows from the number in the file
# `stop` on stop all.
PROGRAM = """#!/bin/sh
[ "$1" = -scenarios ] && exec echo hopper
[ "$2" = -help_markdown ] && exit 0
while [ $# -gt 1 ]; do
  case $1 in -output) out=$2;; -restart) echo "pliant: error: nothing to restart in $2" >&2; exit 2;; esac
  shift
done
row=${out##*/}
echo "$row" >> "$RUNS/log"
if [ -e "$RUNS/stop" ] && [ $(wc -l < "$RUNS/log") -ge $(cat "$RUNS/stop") ]; then kill -TERM $PPID; exit 75; fi
cp "$RUNS/$row/"* "$out/" 2>/dev/null || { echo "pliant: error: no run $row" >&2; exit 3; }
"""


@pytest.fixture(autouse=True)
def quickly(monkeypatch):
    monkeypatch.setattr(ensemble, "RESAMPLES", 12)
    monkeypatch.setitem(matplotlib.rcParams, "savefig.dpi", 60)


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """Folder with a run for every row of TABLE, named like it."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "table.csv").write_text(TABLE, encoding="utf-8")
    rng = np.random.default_rng(1)
    for row in read_rows(folder / "table.csv", "hopper"):
        options = {name: float(value) for name, value in row.options.items()}
        law = LAWS["mu" if "mu" in options else "zeta"]
        Q = float(beverloo.beverloo(options["hopper_width"], *law)) * (1 + 0.02 * rng.normal())
        path, _ = write_run(folder / row.id, mu=options.get("mu", 0.0), zeta=options.get("zeta", 0.0), n=20, frames=1,
                            samples=60, w=options["hopper_width"], Q=Q, Q_error=0.02 * Q, seed=int(options["seed"]),
                            extra={"e_sp": (100, "")})
        summary = json.loads((path / "summary.json").read_text(encoding="utf-8"))
        (path / "summary.json").write_text(json.dumps(summary | {"cpu_seconds": 9.0}), encoding="utf-8")
    return folder


@pytest.fixture
def call(tmp_path, made, monkeypatch, capsys):
    """A function that runs the command, which must have `code`, and returns its output; in a separate folder. Pictures
    take most of the time: without `pictures` they are empty files."""
    runs = tmp_path / "runs"
    runs.mkdir()
    for path in made.iterdir():
        (runs / path.name).symlink_to(path)
    (tmp_path / "program").write_text(PROGRAM, encoding="utf-8")
    (tmp_path / "program").chmod(0o755)
    (tmp_path / "mine.csv").write_text(TABLE, encoding="utf-8")
    (tmp_path / "validation").mkdir()
    (tmp_path / "validation/quick").mkdir()
    (tmp_path / "validation/quick/limits.csv").write_text(TABLE, encoding="utf-8")
    (tmp_path / "validation/quick/stiff.csv").write_text(TABLE.replace("1-2", "1"), encoding="utf-8")
    monkeypatch.setattr(command, "VALIDATION", tmp_path / "validation")
    monkeypatch.setattr(sys, "argv", [str(COMMAND)])
    monkeypatch.setenv("RUNS", str(runs))
    monkeypatch.chdir(tmp_path)

    save = plotting.save

    def save_empty(picture, *paths):
        matplotlib.pyplot.close(picture)
        for path in paths:
            path.touch()

    def run(*arguments, code=0, pictures=False):
        monkeypatch.setattr(plotting, "save", save if pictures else save_empty)
        capsys.readouterr()
        try:
            result, error = command.main([*map(str, arguments), "--program", str(tmp_path / "program")]), ""
        except PliantError as raised:
            result, error = raised.exit_code, str(raised)
        output = capsys.readouterr().out + error
        assert result == code, output
        return output
    return run


def started(tmp_path):
    log = tmp_path / "runs/log"
    return log.read_text(encoding="utf-8").split() if log.exists() else []


# --- The registry

@pytest.mark.parametrize("one", command.FIGURES.values(), ids=list(command.FIGURES))
def test_every_figure_has_tables(one):
    assert one.title and one.measure in measure.MEASURES and one.quick_note
    for level in figure.LEVELS:
        assert one.tables(level) or level == "as-run"
        for name in one.tables(level):
            table = read_rows(figure.VALIDATION / f"{name}.csv", "hopper")
            assert level != "quick" or len(table) <= 180, name
            # Errors need seeds: several at most points, except in figures that show single runs.
            seeds = {row.options.get("seed") for row in table}
            assert len(seeds) > 1 or name in ONE_SEED, name


@pytest.mark.parametrize("one", command.FIGURES.values(), ids=list(command.FIGURES))
def test_runs_of_a_point_differ_in_the_seed_alone(one):
    for level in figure.LEVELS:
        paths = [figure.VALIDATION / f"{name}.csv" for name in one.tables(level)]
        if paths or level != "as-run":
            figure.check_rows(one, [(path, read_rows(path, "hopper")) for path in paths])


def own_table(tmp_path, columns, values):
    """[(path, rows)] of one table of hoppers with these lines, two seeds each."""
    path = tmp_path / "mine.csv"
    path.write_text(f"{columns},seeds\n" + "".join(f"{line},1-2\n" for line in values), encoding="utf-8")
    return [(path, read_rows(path, "hopper"))]


@pytest.mark.parametrize("name, columns, values, told", [
    ("H2", "mu,hopper_width,n", ("5,4,800", "5,4,400"), None),
    ("H7", "mu,hopper_width,hopper_wall_distance", ("5,4,50", "5,4,40"), "-hopper_wall_distance (50 and 40)"),
    ("H2", "mu,hopper_width,model,friction_point", ("5,4,smooth,vertex", "5,4,smooth,"), "-friction_point (vertex and none)"),
    ("readings-deformable", "mu,hopper_width,model,friction_point", ("31.6227766,4,smooth,vertex", "31.6227766,4,smooth,"), None),
    ("H2", "mu,hopper_width", ("5,4", "5,6", "10,4"), None),
    ("H2", "mu,hopper_width,dt", ("5,4,", "5,6,1e-3", "5,4,1e-3"), "-dt (none and 0.001)"),
    ("H7", "mu,hopper_width,e_sp", ("5,4,50", "5,4,100"), None),
    ("H7", "mu,hopper_width", ("5,4", "10,4"), "-mu (5 and 10)"),
    ("H4", "mu,zeta,hopper_width", ("10,1,4", "5,1,4", "5,,4", "5,1,6"), None),
    ("H4", "mu,zeta,hopper_width", ("10,1,4", "5,0.5,4"), "-mu (10 and 5)"),
    ("H6", "mu,hopper_width,model,e_c", ("5,4,smooth,250", "5,4,smooth,1e4"), None),
    ("H6", "mu,hopper_width,model,e_w", ("5,4,smooth,250", "5,4,smooth,1e4"), "-e_w (250 and 10000)"),
    ("H5", "mu,hopper_width,model", ("5,4,sp", "5,4,rough"), "-model (sp and rough)"),
    ("H12", "mu,hopper_width,t_end", ("5,4,50", "5,4,100"), None),
    ("duration", "mu,hopper_width,t_end", ("5,4,50", "5,4,100"), None),
    ("T2.14", "rows,columns,v_wall", ("3,3,1e-4", "4,4,2e-4", "3,3,2e-4"), "-v_wall (0.0001 and 0.0002)"),
    ("T4.3", "g,hopper_width,delta", ("0.01,3,0.01", "0.01,3,0.02"), "-delta (0.01 and 0.02)"),
    ("T3.11", "distribution,area_fraction", ("T4,0.77", "T4,0.72"), "-area_fraction (0.77 and 0.72)"),
    ("T3.choices", "distribution,area_fraction", ("T4,0.77", "T4,0.72"), None),
    ("J1", "n,fraction,start_pressure", ("64,0.9,0.01", "64,0.845,1e-6", "128,0.9,0.01"), None),
    ("J1", "n,force_tolerance", ("64,1e-6", "64,1e-8"), "-force_tolerance (1e-06 and 1e-08)"),
    ("J5", "shear_rate,strain", ("1e-3,20", "1e-3,10", "1e-4,5"), None)])
def test_runs_that_a_figure_would_average(tmp_path, name, columns, values, told):
    """If a figure takes two rows for seeds of one point, the error names their differences."""
    tables = own_table(tmp_path, columns, values)
    if told is None:
        return figure.check_rows(command.FIGURES[name], tables)
    with pytest.raises(PliantError, match=re.escape(f"they differ in {told}, which {name} would average")) as raised:
        figure.check_rows(command.FIGURES[name], tables)
    path, _ = tables[0]
    assert f"line 2, and {path}, line {len(values) + 1}" in str(raised.value)


@pytest.mark.parametrize("name, columns, values, refused", [
    ("H13", "mu,hopper_width,model", ("5,4,smooth", "5,6,rough"), "no run has soft particles (-model sp)"),
    ("H13", "mu,hopper_width,model", ("5,4,smooth", "5,6,"), None),
    ("H14", "mu,hopper_width", ("5,4", "5,6"), "no run has deformable particles (-model rough or smooth)"),
    ("readings-deformable", "mu,hopper_width", ("5,4", "5,6"), "no run has deformable particles"),
    ("H12", "mu,hopper_width,dim", ("5,4,2", "5,6,3"), "shows 2D runs only"),
    ("H2", "mu,hopper_width,dim", ("5,4,2", "5,6,3"), None),
    ("H12", "mu,hopper_width,dim", ("5,4,flat",), None),  # the program reports the fault
    # a file of options may have the option
    ("H14", "mu,hopper_width,options_file", ("5,4,smooth.yaml", "5,6,smooth.yaml"), None)])
def test_runs_that_a_figure_does_not_show(tmp_path, name, columns, values, refused):
    """They are refused before they run."""
    tables = own_table(tmp_path, columns, values)
    if refused is None:
        return figure.check_rows(command.FIGURES[name], tables)
    with pytest.raises(PliantError, match=re.escape(refused)):
        figure.check_rows(command.FIGURES[name], tables)


def test_quick_tables_are_small():
    """In steps of all particles; docs/how-to/reproduce.md has their CPU times."""
    for one in command.FIGURES.values():
        steps = 0.0
        for name in one.quick:
            for row in read_rows(figure.VALIDATION / f"{name}.csv", "hopper"):
                o = {"n": "1600", "t_end": "100", "model": "sp"} | row.options
                if row.scenario == "hopper" and o.get("flow") != "discharge":
                    dt = 1e-3 if o["model"] == "sp" else 7.5e-5 / 10  # a vertex is half of a particle's work
                    steps += float(o["n"]) * float(o["t_end"]) / dt
        # 12 ns for each of one core
        assert steps * 12e-9 < 500, one.name


def test_every_figure_is_in_the_documentation():
    page = (HERE.parents[1] / "docs/how-to/reproduce.md").read_text(encoding="utf-8")
    for one in command.FIGURES.values():
        assert f"| {one.name} | {one.title} | {one.quick_note} |" in page


def test_list_and_names(call):
    output = call("list")
    for name, one in command.FIGURES.items():
        assert f"{name} " in output and one.title in output
    assert "did you mean H2?" in call("H22", code=2)
    assert "list shows all" in call("xyz", code=2)
    assert command.figure_by_name("h2") is command.FIGURES["H2"]


# --- Rows

@pytest.mark.parametrize("value, error, known, answer", [
    (1.5, 0.1, Published(1.6, 0.0, ""), "yes"), (1.5, 0.1, Published(1.71, 0.0, ""), "no"),
    (1.5, 0.1, Published(1.75, 0.1, ""), "yes"), (1.5, 0.1, Published(1.8, 0.1, ""), "no"),
    (1.5, 0.1, None, "no number"), (math.nan, math.nan, Published(1.5, 0.1, ""), "no number"),
    (1.5, math.nan, Published(1.5, 0.1, ""), "no number"),
    # Without errors there is no verdict; one error is enough.
    (1.5, 0.0, Published(1.5, 0.0, ""), "no number"), (1.5, 0.0, Published(1.6, 0.0, ""), "no number"),
    (1.5, 0.0, Published(1.6, 0.1, ""), "yes"), (1.5, 0.0, Published(1.8, 0.1, ""), "no")])
def test_agreement(value, error, known, answer):
    assert agree(Quantity("x", value, error, known)) == answer
    assert agree(Quantity("x", value, error, known, decides=False)) == (answer if answer == "no number" else "no verdict")


def test_deviation_is_signed():
    assert deviation(Quantity("x", 1.0, 0.3, Published(2.0, 0.4, ""))) == pytest.approx(-2.0)
    assert math.isnan(deviation(Quantity("x", 1.0, 0.3)))


def test_seeds_text():
    assert seeds_text([3, 1, 2, 7, 7, 9, 10]) == "1-3,7,9-10"


def one_figure(draw=None):
    return Figure("X1", "a title", ("a",), ("b",), "flows", draw)


def test_rows_and_their_file(tmp_path):
    data = pd.DataFrame({"table": "a", "row": ["r", "r", "s"], "seed": [1, 1, 2], "commit": ["abc", "abc", "def"],
                         "cpu_seconds": [1800.0, 1800.0, 1800.0]})
    first = rows(one_figure(), "quick", [Quantity("beta", 1.0, 0.5, Published(1.5, 0.0, "H 2"), "so"),
                                         Quantity("k", 2.0, math.nan)], data, ["a"])
    assert list(first.columns) == figure.COLUMNS
    assert first.iloc[0].to_dict() | {"note": "so"} == {
        "figure": "X1", "level": "quick", "quantity": "beta", "ours": 1.0, "error": 0.5, "published": 1.5,
        "published_error": 0.0, "deviation": -1.0, "agree": "yes", "source": "H 2", "note": "so", "cpu_hours": 1.0,
        "commit": "abc; def", "seeds": "1-2", "table": "a"}
    path = tmp_path / "reproduced.csv"
    write_rows(path, first)
    write_rows(path, first.assign(level="full"))
    write_rows(path, rows(one_figure(), "quick", [Quantity("beta", 3.0, 0.1)], data, ["a"]))
    table = pd.read_csv(path)
    assert list(zip(table["level"], table["quantity"], table["ours"])) == [("full", "beta", 1), ("full", "k", 2),
                                                                           ("quick", "beta", 3)]
    path.unlink()
    for level in ("quick", "full"):
        write_rows(path, first.assign(level=level, commit="12345678e012"))  # not a number
    assert set(pd.read_csv(path, dtype=str)["commit"]) == {"12345678e012"}
    path.write_text("a,b\n1,2\n", encoding="utf-8")
    with pytest.raises(PliantError, match="not a table of this command"):
        write_rows(path, first)


# --- The command

def test_a_figure(call, tmp_path):
    output = call("H2", pictures=True)
    assert "larger" in output and f"pliant-sweep {tmp_path}/validation/quick/limits.csv --output" in output
    assert_picture(tmp_path / "reproduced/H2-quick.png")
    assert (tmp_path / "reproduced/H2-quick.pdf").read_bytes().startswith(b"%PDF")
    table = pd.read_csv(tmp_path / "reproduced/reproduced.csv").set_index("quantity")
    beta = table.loc["beta: soft, E_sp = 100, friction only"]
    assert beta["ours"] == pytest.approx(1.5, abs=0.3) and beta["published"] == 1.5 and beta["agree"] == "yes"
    assert table.loc["beta: soft, E_sp = 100, drag only", "published"] == 0.5
    assert set(table["seeds"]) == {"1-2"} and set(table["table"]) == {"quick/limits; quick/stiff"}
    # 16 runs of 9 s; the other 8 rows repeat runs
    assert table["cpu_hours"].iloc[0] == pytest.approx(16 * 9 / 3600, rel=1e-3)
    assert len(started(tmp_path)) == 24
    # The results are stored next to it; the same command again runs nothing and changes nothing.
    measured = tmp_path / "reproduced/measured/quick/limits.flows.csv"
    assert {"row", "seed", "commit", "cpu_seconds", "Q", "Q_error"} <= set(pd.read_csv(measured).columns)
    before = (tmp_path / "reproduced/reproduced.csv").read_text(encoding="utf-8")
    call("H2", "quick")
    assert len(started(tmp_path)) == 24 and (tmp_path / "reproduced/reproduced.csv").read_text(encoding="utf-8") == before


def test_the_command_it_prints_runs_the_same(call, tmp_path):
    output = call("H2", "--table", "mine.csv", "-j", 2)
    line = next(line.split("by hand: pliant-sweep ")[1] for line in output.splitlines() if "by hand" in line)
    from pliant.sweep_command import main as sweep
    assert sweep([*line.split(), "--program", str(tmp_path / "program"), "--status"]) == 0


def test_a_table_of_ones_own(call, tmp_path):
    call("H2", "--table", "mine.csv")
    assert (tmp_path / "reproduced/H2-mine.png").exists() and (tmp_path / "reproduced/H2-mine.pdf").exists()
    table = pd.read_csv(tmp_path / "reproduced/reproduced.csv")
    assert set(table["level"]) == {"own"} and set(table["table"]) == {"mine"}
    assert "--table goes with one figure" in call("H2", "full", "--table", "mine.csv", code=2)
    assert "--table goes with one figure" in call("all", "--table", "mine.csv", code=2)
    assert "none.csv" in call("H2", "--table", "none.csv", code=2)
    # Runs that would count as seeds are not started; a run in two tables is one seed.
    begun = len(started(tmp_path))
    (tmp_path / "dt.csv").write_text("mu,hopper_width,dt\n31.6,3,\n31.6,3,1e-3\n", encoding="utf-8")
    assert "they differ in -dt" in call("H2", "--table", "dt.csv", code=2) and len(started(tmp_path)) == begun
    (tmp_path / "again.csv").write_text("".join(TABLE.splitlines(True)[:3]), encoding="utf-8")
    output = call("H2", "--table", "mine.csv", "--table", "again.csv")
    assert "4 runs that two tables have count once" in output
    both = pd.read_csv(tmp_path / "reproduced/reproduced.csv").set_index("table")
    assert (both.loc["mine; again", "ours"].to_numpy() == both.loc["mine", "ours"].to_numpy()).all()


def test_a_failed_run_does_not_spoil_the_rest(call, tmp_path):
    (tmp_path / "runs/e_sp=100,hopper_width=8,mu=31.6,seed=1").unlink()
    output = call("H2", "--table", "mine.csv", code=3)
    assert "failed 1" in output and "no run e_sp=100,hopper_width=8,mu=31.6,seed=1" in output
    table = pd.read_csv(tmp_path / "reproduced/reproduced.csv")
    assert table["cpu_hours"].iloc[0] == pytest.approx(15 * 9 / 3600, rel=1e-3)
    assert (tmp_path / "reproduced/H2-mine.png").exists()


def test_a_stop_and_the_rest_later(call, tmp_path, monkeypatch):
    (tmp_path / "runs/stop").write_text("1", encoding="utf-8")
    monkeypatch.setattr(signal, "getsignal", lambda s: signal.SIG_DFL)
    assert "run the same command again" in call("H2", "--table", "mine.csv", "-j", 1, code=75)
    assert len(started(tmp_path)) == 1 and not (tmp_path / "reproduced/H2-mine.png").exists()
    (tmp_path / "runs/stop").unlink()
    call("H2", "--table", "mine.csv")
    assert len(started(tmp_path)) == 17


def test_campaigns_over_several_sittings(call, tmp_path, monkeypatch):
    """Stored rows are not run again, and can be drawn without their runs."""
    limits = tmp_path / "validation/quick/limits.csv"
    limits.write_text(TABLE.replace("1-2", "1"), encoding="utf-8")
    assert "no stored results of H2" in call("H2", "--kept", code=2)
    call("H2", "--keep")
    kept = tmp_path / "validation/measured/quick/limits.flows.csv.xz"
    assert len(pd.read_csv(kept)) == 8 and len(started(tmp_path)) == 16
    whole = kept.read_bytes()
    for damaged in (whole[:60], whole[:20] + b"x" * 40 + whole[60:], b"row,seed"):
        kept.write_bytes(damaged)
        assert f"{kept}: cannot be read as a table" in call("H2", "--kept", code=2)
    kept.write_bytes(whole)
    limits.write_text(TABLE, encoding="utf-8")
    (tmp_path / "runs/stop").write_text("18", encoding="utf-8")
    with monkeypatch.context() as m:
        m.setattr(signal, "getsignal", lambda s: signal.SIG_DFL)
        call("H2", "quick", "--keep", "-j", 1, code=75)
    assert len(pd.read_csv(kept)) == 9 and len(started(tmp_path)) == 18  # finished runs are stored when it is stopped
    (tmp_path / "runs/stop").unlink()
    call("H2", "quick", "--keep", "-o", "elsewhere")
    table = pd.read_csv(kept)
    assert len(table) == 16 and len(set(table["row"])) == 16 and len(started(tmp_path)) == 25
    limits.write_text(TABLE + "100,,0.316,20,1-4\n", encoding="utf-8")
    output = call("H2", "--kept", "-o", "third")
    assert "quick/limits: 16 of 20 runs are kept" in output and "quick/stiff: 8 of 8 runs are kept" in output
    assert len(started(tmp_path)) == 25 and (tmp_path / "third/H2-quick.png").exists()
    again, first = (pd.read_csv(tmp_path / folder / "reproduced.csv") for folder in ("third", "elsewhere"))
    pd.testing.assert_frame_equal(again, first, check_exact=True)  # stored and new numbers have the same digits
    assert "no stored results of H2 full" in call("H2", "full", "--kept", code=2)
    # Rows removed from the table are not drawn, but stay stored.
    limits.write_text(TABLE.replace("1-2", "1"), encoding="utf-8")
    table[table["row"] != table["row"].iloc[0]].to_csv(kept, index=False)
    output = call("H2", "--kept", "-o", "fourth")
    assert "8 of its runs are left out" in output and "quick/limits: 7 of 8 runs are kept" in output
    assert set(pd.read_csv(tmp_path / "fourth/reproduced.csv")["cpu_hours"]) == {0.02}  # 8 runs; 7 are in both tables
    call("H2", "quick", "--keep", "-o", "fifth")
    assert set(pd.read_csv(kept)["row"]) == set(table["row"]) and len(started(tmp_path)) == 26
    kept.write_text("no\x00table", encoding="utf-8")
    assert "limits.flows.csv" in call("H2", "--kept", code=2)


def test_all(call, tmp_path, monkeypatch):
    chosen = {name: command.FIGURES[name] for name in ("H2", "H3", "H10")}
    monkeypatch.setattr(command, "FIGURES", chosen)
    (tmp_path / "validation/quick/hard.csv").write_text(TABLE.replace("1-2", "2"), encoding="utf-8")
    output = call("all", "quick", code=3)  # H3 has no table here
    assert "H3: " in output and "without a figure: H3" in output
    assert {path.name for path in (tmp_path / "reproduced").glob("*.png")} == {"H2-quick.png", "H10-quick.png"}
    assert set(pd.read_csv(tmp_path / "reproduced/reproduced.csv")["figure"]) == {"H2", "H10"}
    # The table that both have was run once.
    assert len(started(tmp_path)) == 16 + 8 + 8
    call("all", "--kept")  # without stored values: no failure, no figure


def test_tables_as_run(call, tmp_path, monkeypatch):
    chosen = {name: dataclasses.replace(command.FIGURES[name], as_run=as_run) for name, as_run in (
        ("H2", ("quick/stiff",)), ("H10", ()))}
    monkeypatch.setattr(command, "FIGURES", chosen)
    assert "H10 has no table as run; these have: H2" in call("H10", "as-run", code=2)
    call("all", "as-run", "--keep")
    assert len(started(tmp_path)) == 8 and (tmp_path / "reproduced/H2-as-run.png").exists()
    table = pd.read_csv(tmp_path / "reproduced/reproduced.csv")
    assert set(table["level"]) == {"as-run"} and set(table["figure"]) == {"H2"}
    assert "8 of 8 runs are kept" in call("H2", "as-run", "--kept")
    call("H2", "--kept", "-o", "other")  # not "as run": quick tables, of which stiff has stored values
    assert {path.name for path in (tmp_path / "other").glob("*.png")} == {"H2-quick.png"}


def test_output_that_cannot_be_written(call, tmp_path):
    (tmp_path / "file").touch()
    assert "cannot be made" in call("H2", "-o", "file/x", code=4)
    if os.getuid():
        (tmp_path / "closed").mkdir(mode=0o500)
        assert "cannot be written" in call("H2", "-o", "closed", code=4)


# --- Figures from measured results

def flow_rows(lams=(np.inf,), laws=None, **columns):
    """Measured flows of made laws: a row per lambda, width and seed."""
    rng, lines = np.random.default_rng(3), []
    for lam in lams:
        mu = 31.6 if lam < 0.01 else 0.0 if np.isinf(lam) else 0.316 / lam
        zeta = 0.316 if lam >= 0.01 else lam * 31.6
        law = (laws or (lambda lam: LAWS["zeta"]))(lam)
        for w in (3.0, 4.0, 6.0, 8.0, 10.0):
            for seed in (1, 2, 3):
                Q = float(beverloo.beverloo(w, *law)) * (1 + 0.01 * rng.normal())
                lines.append({"model": "sp", "dim": 2, "status": "done", "mu": mu, "zeta": zeta, "e_sp": 100.0,
                              "e_c": 1e4, "k_l": 10.0, "k_b": 0.1, "bending_edges": "unit", "hopper_angle": 90.0,
                              "hopper_width": w, "n": 1600, "hopper_wall_distance": 50, "t_end": 100, "Q": Q,
                              "Q_error": 0.01 * Q, "Q_corrected": 0.9 * Q, "Q_corrected_error": 0.01 * Q, "seed": seed,
                              "commit": "abc", "cpu_seconds": 1.0, "table": "t", "row": f"{lam}-{w}-{seed}-{columns}"} | columns)
    return pd.DataFrame(lines)


def drawn(name, data, tmp_path=None):
    """{quantity: Quantity} of a figure, which must not be empty if it is saved."""
    picture, quantities = command.FIGURES[name].draw(data)
    if tmp_path:
        picture.set_layout_engine("none")  # takes half of the time
        picture.savefig(tmp_path / "x.png", dpi=80)
        assert_picture(tmp_path / "x.png")
    matplotlib.pyplot.close(picture)
    found = {q.name: q for q in quantities}
    assert len(found) == len(quantities), "a name is there twice"
    return found


LAMS = (0.0, 1e-3, 1e-2, 0.05, 0.1, 1.0, np.inf)


def test_lambda_as_run_is_that_of_the_codes_numbers():
    """10 sqrt(10) and 1/sqrt(10), the same numbers in both, are 0.01, for any unit of the drag per mass."""
    for dim, mu, zeta in ((2, 8.505, 1.539), (3, 28.4, 4.111)):
        table = pd.DataFrame({"mu": [31.6227766, mu, mu, 0.0], "zeta": [0.316227766, zeta, 0.0, zeta], "dim": dim,
                              "drag": ["per_particle", "per_mass", "per_mass", "per_mass"]})
        assert hopper_runs.with_limit(table)["lam"].to_numpy() == pytest.approx([0.01, 0.01, 0, np.inf], rel=1e-3)


def crossing_law(lam, lam_c=0.05):
    from pliant.crossover import crossover
    return 0.3, 1.5, float(crossover(lam, lam_c, 0.8, 0.5, 1.5))


def test_figure_4_finds_lambda_c(tmp_path):
    found = drawn("H4", flow_rows(LAMS, crossing_law), tmp_path)
    middle = found["lambda_c, published ends: soft, E_sp = 100"]
    assert middle.value == pytest.approx(0.05, rel=0.1) and agree(middle) == "yes" and middle.error > 0
    assert found["beta at lambda = 0: soft, E_sp = 100"].value == pytest.approx(1.5, abs=0.1)
    assert found["beta at lambda = inf: soft, E_sp = 100"].published.value == 0.5
    end = "beta, fitted end (friction): soft, E_sp = 100"
    assert found[end].value == pytest.approx(1.5, abs=0.1) and found[end].note == ""
    below = drawn("H4", flow_rows((0.0, 1e-5, 1e-4, 1e-3, np.inf), crossing_law))
    assert "lambda_c lies outside" in below[end].note
    begun = flow_rows((0.1,), dim=3, n=6400).iloc[:2]  # a campaign in 3D
    assert list(drawn("H4", pd.concat([flow_rows(LAMS, crossing_law), begun], ignore_index=True))) == list(found)
    with pytest.raises(PliantError, match="no lambda has enough widths"):
        command.FIGURES["H4"].draw(begun)
    labels = [command.FIGURES["H4"].draw(flow_rows(LAMS, crossing_law, drag=drag))[0].axes[0].get_xlabel() for drag in ("per_length", "per_mass")]
    assert ["numbers of the program" in label for label in labels] == [False, True]


def test_a_curve_with_an_exponent_at_the_bound_of_k_decides_nothing():
    """A second row has the fit to exponents without this bound, and has its own verdict."""
    def law(lam):
        C, k, beta = crossing_law(lam)
        return (C, -2.0, 2.5) if lam == 0 else (C, k, beta)
    found = drawn("H4", flow_rows(LAMS, law))
    for name in ("lambda_c, published ends", "lambda_c, free ends", "beta, fitted end (friction)", "beta, fitted end (drag)"):
        one = found[f"{name}: soft, E_sp = 100"]
        assert agree(one) in ("no verdict", "no number") and "no verdict on beta at lambda = 0" in one.note, name
    end, free = (found[f"beta, fitted end (friction){which}: soft, E_sp = 100"] for which in ("", ", k unbounded"))
    assert free.value > end.value + 0.1 and agree(free) in ("yes", "no")
    assert "no verdict" not in found["lambda_c, free ends, k unbounded: soft, E_sp = 100"].note
    assert not any("unbounded" in name for name in drawn("H4", flow_rows(LAMS, crossing_law)))


def test_figure_6_compares_angles(tmp_path):
    data = pd.concat([flow_rows(LAMS, lambda lam, c=c: crossing_law(lam, c), hopper_angle=angle, drag_friction_ratio=r,
                                drag_friction_ratio_error=0.01)
                      for angle, c, r in ((90.0, 0.05, 0.1), (30.0, 0.005, 0.5))], ignore_index=True)
    found = drawn("H6", data, tmp_path)
    assert found["lambda_c, published ends: theta_w = 90"].value == pytest.approx(0.05, rel=0.1)
    assert found["lambda_c, published ends: theta_w = 30"].value == pytest.approx(0.005, rel=0.15)
    assert found["lambda_c, published ends: theta_w = 30"].published.value == 0.005
    assert found["|F_zeta|/|F_mu| at lambda = 0.01, theta_w = 30"].value == pytest.approx(0.5)
    steeper = found["|F_zeta|/|F_mu| at lambda = 0.01, theta_w = 30 over its value at theta_w = 90"]
    assert steeper.value == pytest.approx(5) and agree(steeper) == "no"  # published: a plateau
    # For forces proportional to lambda, at the middle: the error combines the errors of lambda_c and of the forces
    data["drag_friction_ratio"] = 3 * data["zeta"] / data["mu"].where(data["mu"] > 0)
    data["drag_friction_ratio_error"] = 0.01 * data["drag_friction_ratio"]
    found = drawn("H6", data[data["mu"] > 0])
    middle, ratio = (found[f"{name}, free ends: theta_w = 90"] for name in ("lambda_c", "|F_zeta|/|F_mu| at lambda_c"))
    assert ratio.value == pytest.approx(3 * middle.value, rel=1e-3)
    assert middle.error / middle.value < ratio.error / ratio.value < middle.error / middle.value + 0.02


@pytest.mark.parametrize("name", ["H4", "H6", "H11", "H12"])
def test_an_exponent_with_k_at_its_bound_decides_nothing(name):
    """Also where the name of the quantity is changed on its way: the law has k below 0."""
    data = flow_rows((0.0, 0.01, np.inf), lambda lam: (0.4, -1.5, 1.5 if lam < 0.01 else 0.5))
    found = {name: q for name, q in drawn(name, data).items() if "beta at lambda = 0" in name}
    assert found and all("k at its bound" in q.note and agree(q) in ("no verdict", "no number") for q in found.values())
    assert any(agree(q) == "no verdict" for q in found.values())


def test_figure_10_compares_hard_soft_particles_with_stiff_deformable_ones(tmp_path):
    soft = flow_rows((0.0, np.inf), e_sp=1e5)
    stiff = flow_rows((0.0, np.inf), lambda lam: (LAWS["zeta"][0] * (4 if lam == 0 else 1), *LAWS["zeta"][1:]), model="smooth", k_b=100.0)
    few = flow_rows((0.0, np.inf), model="smooth", k_b=100.0, n=400)  # without soft particles
    found = {name: q for name, q in drawn("H10", pd.concat([soft, stiff, few], ignore_index=True), tmp_path).items() if name.startswith("Q of")}
    name = "Q of smooth, K_l = 10, K_b = 100 over soft, E_sp = 100000, N = 1600, w = {}, {} only"
    assert set(found) == {name.format(w, limit) for w in (3, 4, 6, 8, 10) for limit in ("friction", "drag")}
    friction, drag = (found[name.format(6, limit)] for limit in ("friction", "drag"))
    assert friction.value == pytest.approx(4, rel=0.05) and agree(friction) == "no"
    assert drag.value == pytest.approx(1, rel=0.05) and agree(drag) == "yes"


def test_figure_6_of_the_limits_alone(tmp_path):
    """No run has both forces, nor a ratio of them."""
    data = flow_rows((0.0, np.inf), crossing_law, hopper_angle=30.0, drag_friction_ratio=np.nan)
    found = drawn("H6", data, tmp_path)
    assert found["beta at lambda = inf: theta_w = 30"].value == pytest.approx(0.5, abs=0.1)
    assert not any("F_zeta" in name for name in found)


@pytest.mark.parametrize("name", ["H4", "H12"])
def test_exponents_without_an_error(name, tmp_path):
    """Three widths, one seed, and runs too short for blocks: points without bars."""
    data = pd.concat([flow_rows(LAMS, crossing_law, n=n) for n in (800, 1600)], ignore_index=True)
    data = data[(data["seed"] == 1) & data["hopper_width"].isin((3, 6, 10))]
    found = drawn(name, data.assign(Q_error=np.nan), tmp_path)
    assert all(np.isnan(q.error) for key, q in found.items() if key.startswith("beta at"))


def test_runs_without_a_rate():
    with pytest.raises(PliantError, match="no lambda has enough widths"):
        command.FIGURES["H4"].draw(flow_rows(LAMS, crossing_law).assign(Q=np.nan))


def test_deformable_particles_between_the_limits(tmp_path, capsys):
    """[H 4] has the points of the flat bottom; [H 6] a separate curve for each angle and model."""
    smooth = {"model": "smooth", "drag_friction_ratio_error": 0.01}
    data = pd.concat([flow_rows(LAMS, crossing_law, hopper_angle=90.0, drag_friction_ratio=0.1, drag_friction_ratio_error=0.01),
                      flow_rows(LAMS, crossing_law, hopper_angle=30.0, drag_friction_ratio=0.2, drag_friction_ratio_error=0.01),
                      flow_rows(LAMS, lambda lam: crossing_law(lam, 0.2), hopper_angle=90.0, drag_friction_ratio=0.3, **smooth),
                      flow_rows(LAMS, lambda lam: crossing_law(lam, 0.01), hopper_angle=30.0, drag_friction_ratio=0.6, **smooth)],
                     ignore_index=True)
    found = drawn("H4", data, tmp_path)
    assert "210 runs of steeper hoppers are left out" in capsys.readouterr().out
    assert found["lambda_c, published ends: smooth, K_l = 10, K_b = 0.1"].value == pytest.approx(0.2, rel=0.15)
    assert found["lambda_c, published ends: soft, E_sp = 100"].value == pytest.approx(0.05, rel=0.15)
    found = drawn("H6", data, tmp_path)
    assert found["lambda_c, published ends: theta_w = 30, smooth, K_l = 10, K_b = 0.1"].value == pytest.approx(0.01, rel=0.15)
    ratio = "|F_zeta|/|F_mu| at lambda = 0.01, theta_w = 30, "
    assert found[ratio + "smooth, K_l = 10, K_b = 0.1"].value == pytest.approx(0.6)
    assert found[ratio + "soft, E_sp = 100"].value == pytest.approx(0.2)


def test_figure_6_compares_contacts(tmp_path):
    """Softer contacts and printed contacts are separate curves; soft particles, without this choice, are one curve."""
    data = pd.concat([flow_rows(LAMS, lambda lam, c=c: crossing_law(lam, c), hopper_angle=20.0, model=model, e_c=e_c)
                      for model, e_c, c in (("smooth", 250.0, 0.01), ("smooth", 1e4, 0.1), ("sp", 250.0, 0.05),
                                            ("sp", 1e4, 0.05))], ignore_index=True)
    found = drawn("H6", data, tmp_path)
    middle = "lambda_c, published ends: theta_w = 20, "
    assert found[middle + "smooth, K_l = 10, K_b = 0.1, E_c = 250"].value == pytest.approx(0.01, rel=0.15)
    assert found[middle + "smooth, K_l = 10, K_b = 0.1, E_c = 10000"].value == pytest.approx(0.1, rel=0.15)
    assert found[middle + "soft, E_sp = 100"].value == pytest.approx(0.05, rel=0.15)


def test_an_exponent_that_lambda_does_not_change(tmp_path):
    """There is no lambda_c: no agreement with the published one, and none in the picture."""
    data = pd.concat([flow_rows(LAMS, lambda lam: LAWS["mu"], hopper_angle=angle) for angle in (90.0, 30.0)], ignore_index=True)
    for name in ("H4", "H6"):
        free = [q for key, q in drawn(name, data, tmp_path).items() if key.startswith("lambda_c, free ends")]
        assert free and all(np.isnan(q.error) for q in free)


def test_figure_5_finds_the_exponents(tmp_path):
    rng, lines = np.random.default_rng(4), []
    for lam, power in ((0.0, 0.5), (0.05, 0.0), (np.inf, -0.5)):
        for w in (4.0, 6.0, 10.0):
            for seed in (1, 2):
                for h in (0.0, 1.0, 2.0, 5.0, 16.0):
                    v = w**power * max(1 - h / 5, 0.1) * (1 + 0.01 * rng.normal())
                    lines.append({"mu": 0.0 if np.isinf(lam) else 1.0, "zeta": 1.0 if np.isinf(lam) else lam, "seed": seed,
                                  "hopper_width": w, "height": h, "v": v, "v_error": 0.01 * v, "table": "t", "row": f"{w}-{seed}"})
    found = drawn("H5", pd.DataFrame(lines), tmp_path)
    # Far from the orifice, and its fall close to it: both follow the same power here.
    assert found["exponent of the speed at h = 15 in w, lambda = 0"].value == pytest.approx(0.5, abs=0.1)
    assert found["speed at h = 15, w = 4, lambda = 0.05"].value == pytest.approx(0.1, rel=0.1)
    assert found["fall of v_g per height below h = 2, w = 4, lambda = 0.05"].value == pytest.approx(0.2, rel=0.1)
    for lam, power in (("0", 0.5), ("0.05", 0.0), ("inf", -0.5)):
        one = found[f"exponent of v_g(h = 0) in w, lambda = {lam}"]
        assert one.value == pytest.approx(power, abs=0.05) and one.published.value == power and 0 < one.error < 0.05


def test_figures_2_and_3_name_what_is_published(tmp_path):
    hard = flow_rows((0.0, np.inf), lambda lam: LAWS["zeta" if lam else "mu"], e_sp=1e5)
    soft = flow_rows((0.0, np.inf), lambda lam: LAWS["zeta" if lam else "mu"])
    found = drawn("H2", pd.concat([hard, soft]), tmp_path)
    assert found["k: soft, E_sp = 100000, friction only"].published.value == 1.6
    assert found["k: soft, E_sp = 100, friction only"].published is None
    assert found["C: soft, E_sp = 100, drag only"].published.value == 0.42
    spheres = drawn("H3", soft.assign(dim=3), tmp_path)
    assert spheres["beta: soft, E_sp = 100, friction only"].published.value == 2.5
    assert spheres["C: soft, E_sp = 100, friction only"].published is None


def test_several_coefficients_are_several_curves(tmp_path):
    laws = {5.0: (0.3, 1.2, 1.4), 31.62278: (0.15, 1.6, 1.5)}
    data = [flow_rows((0.0,), lambda lam, law=law: law).assign(mu=mu) for mu, law in laws.items()]
    data.append(flow_rows((0.0,), lambda lam: laws[31.62278]).assign(mu=31.6227766, seed=4))  # stored with fewer digits
    data.append(flow_rows((np.inf,)))
    found = drawn("H2", pd.concat([*data, flow_rows((np.inf,)).assign(dim=3)], ignore_index=True), tmp_path)
    for mu, law in (("5", laws[5.0]), ("31.62", laws[31.62278])):
        assert found[f"beta: soft, E_sp = 100, mu = {mu}, friction only"].value == pytest.approx(law[2], abs=0.08)
    assert {"beta: soft, E_sp = 100, drag only", "beta: soft, E_sp = 100, 3D, drag only"} <= found.keys()


def test_friction_of_coulomb_is_another(capsys):
    disks = flow_rows((0.0,), lambda lam: (1.0, 1.0, 1.0)).assign(model="disk", mu=0.4)
    both = pd.concat([flow_rows((0.0,), lambda lam: LAWS["mu"]), disks], ignore_index=True)
    assert {name for name in drawn("H2", both) if name.startswith("beta:")} == {"beta: soft, E_sp = 100, friction only"}
    assert "15 runs of frictional disks are left out" in capsys.readouterr().out
    with pytest.raises(PliantError, match="no run has"):
        command.FIGURES["H2"].draw(disks)


IN_LIMITS = ("H7", "H13", "readings", "deformable", "readings-deformable", "coefficients", "protocol", "duration",
             "duration-deformable")


def test_what_a_figure_cannot_use(tmp_path):
    with pytest.raises(PliantError, match="friction only or drag only"):
        command.FIGURES["H2"].draw(flow_rows((0.05,)))
    narrow = reading_rows("friction", 1.5).query("hopper_width == 6")
    assert len(narrow) == 3
    for name in ("H4", "H6", "H11", "H12", *IN_LIMITS):
        data = narrow.assign(model="smooth") if "deformable" in name else narrow
        with pytest.raises(PliantError, match="enough widths"):
            command.FIGURES[name].draw(data.assign(Q_corrected=1.0, Q_corrected_error=0.1))
    for name in ("H6", "H7", "H11", "H12", "H13"):
        with pytest.raises(PliantError, match="shows 2D runs only"):
            command.FIGURES[name].draw(flow_rows((0.0, 0.1, np.inf), dim=3))
    for name, other in (("H13", "deformable"), ("H14", "soft")):
        with pytest.raises(PliantError, match="no run has"):
            command.FIGURES[name].draw(flow_rows((0.0, np.inf), model="sp" if other == "soft" else "smooth"))


def test_figures_7_13_and_14_find_offset_and_prefactor(tmp_path):
    both = (0.0, np.inf)
    data = pd.concat([flow_rows(both, lambda lam: LAWS["zeta" if lam else "mu"], e_sp=e) for e in (50.0, 1e3, 1e5)])
    found = drawn("H13", data, tmp_path)
    one = found["C with the published beta held: soft, E_sp = 1000, drag only"]
    assert one.value == pytest.approx(0.42, abs=0.02) and one.published.value == 0.42 and agree(one) == "yes"
    assert found["C, beta free: soft, E_sp = 1000, friction only"].value == pytest.approx(0.15, abs=0.05)
    fall = found["C at E_sp = 50 over C at 1000, friction only"]  # within the range of the paper
    assert fall.value == pytest.approx(1.0, abs=0.03) and fall.published.value == 2 and 0 < fall.error < 0.05
    shapes = pd.concat([flow_rows(both, lambda lam: LAWS["zeta" if lam else "mu"], model="smooth", k_l=kl, k_b=kb)
                        for kl in (1.0, 10.0) for kb in (0.01, 100.0)])
    found = drawn("H7", pd.concat([data, shapes]), tmp_path)
    hard = found["k with the published beta held: soft, E_sp = 100000, friction only"]
    assert hard.value == pytest.approx(1.6, abs=0.05) and hard.published.value == 1.6 and agree(hard) == "yes"
    assert found["k with the published beta held: soft, E_sp = 1000, drag only"].published is None
    smooth = found["k with the published beta held: smooth, K_l = 10, K_b = 100, drag only"]
    assert smooth.value == pytest.approx(2.4, abs=0.05) and smooth.published.value == 3.4
    assert found["k with the published beta held: smooth, K_l = 1, K_b = 0.01, drag only"].published.value == 1.0
    beta = found["beta: smooth, K_l = 10, K_b = 100, friction only"]
    assert beta.value == pytest.approx(1.5, abs=0.05) and beta.published.value == 1.5 and beta.error > 0
    assert len(drawn("H14", shapes, tmp_path)) == 4 * 2 * 2
    # Runs with bending of full edges are not seeds of runs with unit vectors; labels distinguish them if both occur.
    full = flow_rows(both, lambda lam: (2 * LAWS["zeta"][0], *LAWS["zeta"][1:]), model="smooth", k_l=1.0, k_b=100.0,
                     bending_edges="full")
    found = drawn("H14", pd.concat([shapes, full]), tmp_path)
    name = "C with the published beta held: smooth, K_l = 1, K_b = 100{}, drag only".format
    assert found[name(", full edges")].value == pytest.approx(2 * found[name("")].value, rel=0.05)
    found = drawn("H7", pd.concat([shapes[(shapes["k_l"] != 1) | (shapes["k_b"] != 100)], full]), tmp_path)
    assert "k with the published beta held: smooth, K_l = 1, K_b = 100, full edges, drag only" in found
    assert not any("full" in name for name in drawn("H14", full))


def test_models_and_sizes_have_maps_of_their_own(tmp_path):
    """Runs with rough particles, or with more particles, are not seeds of runs with smooth particles of the same
    stiffness."""
    def shapes(factor, **others):
        return pd.concat([flow_rows((0.0,), lambda lam: (factor * LAWS["mu"][0], *LAWS["mu"][1:]), k_l=kl, k_b=0.1, **others)
                          for kl in (1.0, 10.0)])

    every = [shapes(1, model="smooth", n=400), shapes(2, model="smooth", n=1600), shapes(3, model="rough", n=400)]
    picture, _ = command.FIGURES["H7"].draw(pd.concat(every))
    titles = [axes.get_title(loc="left") for axes in picture.axes]
    matplotlib.pyplot.close(picture)
    assert [title for title in titles if title] == [f"$k$: {name}, friction only" for name in (
        "smooth, $N$ = 400", "smooth, $N$ = 1600", "rough, $N$ = 400")]
    found = drawn("H14", pd.concat(every), tmp_path)
    first, larger, rough = (found[f"C with the published beta held: {name}, friction only"].value for name in (
        "smooth, K_l = 10, K_b = 0.1, N = 400", "smooth, K_l = 10, K_b = 0.1, N = 1600", "rough, K_l = 10, K_b = 0.1, N = 400"))
    assert (larger, rough) == (pytest.approx(2 * first, rel=0.05), pytest.approx(3 * first, rel=0.05))
    assert not any("N = " in name for name in drawn("H14", every[0]))


def test_figure_12_finds_how_C_grows(tmp_path):
    data = pd.concat([flow_rows((0.0, np.inf), lambda lam, n=n: (0.1 * (n / 800) ** (0.25 if lam else 1.0), 1.5,
                                                                 0.5 if lam else 1.5), n=n) for n in (800, 1600, 3200)])
    found = drawn("H12", data, tmp_path)
    for name, power in (("friction only", 1.0), ("drag only", 0.25)):
        one = found[f"p of C ~ N^p, {name}"]
        assert one.value == pytest.approx(power, abs=0.05) and 0 < one.error < 0.1
        assert agree(one) == ("yes" if power == 1 else "no number")


def test_figure_11_tells_the_two_rates_apart(tmp_path):
    data = flow_rows(LAMS, crossing_law)
    data["Q_corrected"] = [float(beverloo.beverloo(row.hopper_width, 0.3, 1.5, 1.0)) for row in data.itertuples()]
    data["Q_corrected_error"] = 0.01 * data["Q_corrected"]
    found = drawn("H11", data, tmp_path)
    assert found["from Q, beta at lambda = inf: soft, E_sp = 100"].value == pytest.approx(0.5, abs=0.1)
    assert found["from Q', beta at lambda = inf: soft, E_sp = 100"].value == pytest.approx(1.0, abs=0.1)


def test_figure_8_fits_discharges(tmp_path):
    data = flow_rows((np.inf,), lambda lam: (0.2, 1.47, 0.49), hopper_angle=45.0)
    data = data.assign(c0=data["Q"], c0_error=data["Q_error"], Q=np.nan)
    found = drawn("H8", data)  # stored before the second hopper existed
    assert agree(found["beta of c0(w), 45/45 degrees"]) == agree(found["k of c0(w), 45/45 degrees"]) == "yes"
    upright = data.assign(hopper_angle_left=0.0, c0=1.2 * data["c0"], row=data["row"] + "u")
    found = drawn("H8", pd.concat([data.assign(hopper_angle_left=None), upright]), tmp_path)
    assert found["C of c0(w), 45/0 degrees"].value == pytest.approx(1.2 * found["C of c0(w), 45/45 degrees"].value)
    assert agree(found["beta of c0(w), 45/0 degrees"]) == "yes"
    ratio = found["c0 of 45/0 over 45/45 degrees, mean over w"]
    assert ratio.value == pytest.approx(1.2) and 0 < ratio.error < 0.02 and agree(ratio) == "no number"
    assert agree(found["chi2/dof of c0 of 45/0 over 45/45 degrees = 1 at every w"]) == "no"
    data = pd.concat([data.assign(hopper_angle_left=np.nan), upright])
    as_run = data.assign(zeta=1.54, e_sp=138.9, c0=0.5 * data["c0"], row=data["row"] + "r")
    found = drawn("H8", pd.concat([data, as_run]), tmp_path)
    assert found["C of c0(w), 45/0 degrees, zeta = 1.54"].value == pytest.approx(0.12, rel=0.1)
    assert found["c0 of 45/0 over 45/45 degrees, mean over w, zeta = 0.316"].value == pytest.approx(1.2)
    with pytest.raises(PliantError, match="no discharge"):
        command.FIGURES["H8"].draw(data.assign(c0=np.nan, c0_error=np.nan))


READING = {"friction": "whole", "drag": "per_particle", "contact_law": "harmonic", "e_w": 1e4, "count": "crossing",
           "removal_depth": np.nan, "reinsertion_gap": 0.0, "reinsertion_lateral_speed": np.nan, "pack_fraction": 0.84,
           "dt": np.nan, "max_overlap": 0.3, "steady": True, "steady_start": 5.0}
AS_RUN = {"friction": "tangential", "drag": "per_mass", "contact_law": "linear", "e_w": 694.0, "e_sp": 138.9,
          "count": "removal", "removal_depth": 2.5, "reinsertion_gap": 0.8333, "reinsertion_lateral_speed": 0.01, "dt": 2.5e-4}


def reading_rows(limit, beta, **columns):
    """Measured flows of one reading, with this exponent; as printed but for the columns."""
    coefficients = {"mu": 31.6227766, "zeta": 0.0} if limit == "friction" else {"mu": 0.0, "zeta": 0.316227766}
    return flow_rows((0.0,), lambda lam: (0.4, 1.2, beta), **(READING | coefficients | columns))


def test_readings_are_told_apart(tmp_path):
    data = pd.concat([
        reading_rows("friction", 2.2), reading_rows("friction", 1.8, friction="tangential"),
        reading_rows("friction", 2.1, **{"count": "removal", "removal_depth": 2.5}), reading_rows("friction", 2.0, dt=2.5e-4),
        reading_rows("friction", 1.5, mu=8.505, **AS_RUN),
        reading_rows("friction", 1.9, mu=31.6, **(AS_RUN | {"e_sp": 100.0})),
        # drag per mass is nothing where there is no drag: one reading, 6 runs a point
        reading_rows("friction", 1.7, e_w=694.0), reading_rows("friction", 1.7, e_w=694.0, drag="per_mass"),
        reading_rows("drag", 0.9, e_sp=1e4), reading_rows("drag", 0.5, zeta=1.54, **AS_RUN)], ignore_index=True)
    found = drawn("readings", data, tmp_path)
    betas = {name.removeprefix("beta: "): q.value for name, q in found.items()
             if name.startswith("beta: ") and "from w" not in name}
    assert betas == {name: pytest.approx(beta, abs=0.1) for name, beta in {
        "printed, friction only": 2.2, "printed, tangential friction, friction only": 1.8,
        "printed, counted at removal, friction only": 2.1, "printed, dt = 0.00025, friction only": 2.0,
        "as run, friction only": 1.5, "as run, E_sp = 100, mu = 31.6, friction only": 1.9,
        "printed, E_w = 694, friction only": 1.7, "printed, E_sp = 10000, drag only": 0.9, "as run, drag only": 0.5}.items()}
    # only k of hard particles has been published
    assert found["k: printed, E_sp = 10000, drag only"].published.value == 3.4
    assert found["k: as run, drag only"].published is None


DEFORMABLE_AS_RUN = {"friction": "tangential", "drag": "per_mass", "e_c": 115.7, "e_w": 13.9, "count": "removal",
                     "reinsertion_gap": 0.8333, "area_energy": "relative", "bending_edges": "full", "wall_diameter": 0.1976}


def test_deformable_particles_are_told_apart(tmp_path):
    as_run = reading_rows("friction", 1.5, model="rough", mu=8.505, **DEFORMABLE_AS_RUN)
    smooth = reading_rows("drag", 0.6, model="smooth", zeta=1.54, edge_force="twofold", edge_width=0.2,
                          **(DEFORMABLE_AS_RUN | {"e_w": 1000.0}))
    # As printed, and stored before the choice of laws existed.
    printed = reading_rows("drag", 0.9, model="smooth").drop(columns=["friction", "drag", "count", "e_w", "reinsertion_gap"])
    small = reading_rows("friction", 2.0, model="rough", n=400, hopper_wall_distance=30)
    data = pd.concat([as_run, smooth, printed, reading_rows("friction", 1.8, model="rough", e_c=250.0), small,
                      reading_rows("friction", 2.2)], ignore_index=True)
    found = drawn("deformable", data, tmp_path)
    betas = {name.removeprefix("beta: "): q.value for name, q in found.items() if name.startswith("beta: ")}
    kind = "K_l = 10, K_b = 0.1"
    assert betas == {name: pytest.approx(beta, abs=0.1) for name, beta in {
        f"as run: rough, {kind}, friction only": 1.5, f"as run, E_w = 1000: smooth, {kind}, drag only": 0.6,
        f"printed, N = 400, W = 30: rough, {kind}, friction only": 2.0,
        f"printed: smooth, {kind}, drag only": 0.9, f"printed, E_c = 250: rough, {kind}, friction only": 1.8}.items()}
    # Contact parameters that all rows share are not named, because they do not distinguish readings.
    soft = [reading_rows(limit, 1.6, model="smooth", e_c=250.0, e_w=250.0, **law) for limit, law in (
        ("friction", {}), ("friction", {"friction": "tangential"}), ("drag", {}), ("drag", {"drag": "per_mass"}))]
    found = drawn("readings-deformable", pd.concat(soft, ignore_index=True), tmp_path)
    assert {name for name in found if name.startswith("beta: ")} == {f"beta: {name}: smooth, {kind}, {limit} only" for limit, name in (
        ("friction", "printed"), ("friction", "printed, tangential friction"), ("drag", "printed"), ("drag", "printed, drag per mass"))}
    with pytest.raises(PliantError, match="no run has deformable particles"):
        command.FIGURES["deformable"].draw(reading_rows("friction", 2.2))


def test_labels_name_friction_at_the_vertex_and_not_at_the_contact(tmp_path):
    smooth = {"model": "smooth", "e_c": 250.0, "e_w": 250.0}
    contact, vertex = (reading_rows("friction", 1.5, friction_point=point, **smooth) for point in ("contact", "vertex"))
    vertex["Q"] *= 0.8
    drag = reading_rows("drag", 0.9, friction_point="contact", **smooth)  # without friction the point is nothing
    found = drawn("readings-deformable", pd.concat([contact, vertex, drag], ignore_index=True), tmp_path)
    kind = "smooth, K_l = 10, K_b = 0.1"
    assert {name for name in found if name.startswith("beta: ")} == {
        f"beta: printed, friction at the vertex: {kind}, friction only", f"beta: printed: {kind}, friction only",
        f"beta: printed: {kind}, drag only"}
    assert found[f"Q with friction at the vertex over Q at the contact, w = 6: printed: {kind}"].value == pytest.approx(0.8, rel=0.02)


SINGLE = {"readings": "mu,zeta,e_sp,friction,contact_law,count,removal_depth,hopper_width",
          "readings-deformable": "model,mu,zeta,edge_force,friction_point,area_energy,k_a,hopper_width"}


@pytest.mark.parametrize(("name", "lines", "refused"), [
    ("readings", ("31.6227766,,100,,,,,4", "31.6227766,,100,tangential,,,,4", "31.6227766,,100,,,removal,2.5,4"), None),
    ("readings", ("31.6227766,,100,,,,,4", "31.6227766,,100,tangential,linear,,,4"), "-contact_law, -friction"),
    ("readings", ("31.6227766,,100,,,,,4", "8.505,,138.9,,,,,4"), "-e_sp, -mu"),
    ("readings", ("31.6227766,,100,,,,,4", "8.505,,138.9,,,,,4", "8.505,,100,,,,,4"), None),  # one by one
    ("readings", ("31.6227766,,100,,,,,4", "31.6227766,,1e4,,,,,4", "31.6227766,,1e4,tangential,,,,4"), None),
    ("readings", (",0.316227766,100,tangential,,,,4", ",0.316227766,100,,linear,,,4"), None),  # friction is nothing there
    ("readings-deformable", ("smooth,31.6227766,,,,,,4", "smooth,31.6227766,,,vertex,,,4", "smooth,31.6227766,,,,relative,2000,4"), None),
    ("readings-deformable", ("smooth,31.6227766,,,,,,4", "smooth,31.6227766,,twofold,vertex,,,4", "smooth,31.6227766,,twofold,,,,4"), None),
    ("readings-deformable", ("smooth,31.6227766,,,,,,4", "smooth,31.6227766,,twofold,,relative,2000,4"), "-area_energy, -edge_force"),
    ("readings-deformable", ("smooth,31.6227766,,,,,,4", "smooth,31.6227766,,twofold,vertex,,,4"), "-edge_force, -friction_point")])
def test_a_single_difference_that_is_two_is_refused(tmp_path, name, lines, refused):
    tables = own_table(tmp_path, SINGLE[name], lines)
    if refused is None:
        return figure.check_rows(command.FIGURES[name], tables)
    with pytest.raises(PliantError, match=re.escape(f"in {refused}")) as raised:
        figure.check_rows(command.FIGURES[name], tables)
    assert "changes one option" in str(raised.value) and ", line " in str(raised.value)


def test_a_reading_in_a_file_of_options_is_refused(tmp_path):
    tables = own_table(tmp_path, "mu,hopper_width,options_file", ("31.6227766,4,as_run.yaml",))
    with pytest.raises(PliantError, match="line 2: has options in as_run.yaml"):
        figure.check_rows(command.FIGURES["readings"], tables)


def test_the_command_refuses_a_single_difference_that_is_two(call, tmp_path):
    (tmp_path / "two.csv").write_text(SINGLE["readings"] + ",seeds\n31.6227766,,100,,,,,4,1-2\n31.6227766,,100,tangential,linear,,,4,1-2\n", encoding="utf-8")
    assert "two.csv, line 3" in call("readings", "--table", tmp_path / "two.csv", code=2)
    assert started(tmp_path) == []


TABLES_AS_RUN = sorted({"quick/deformable", *(name for one in command.FIGURES.values() for name in one.as_run)})


@pytest.mark.parametrize("name", TABLES_AS_RUN)
def test_tables_as_run_are_those_of_the_examples(name):
    """Except the stiffness, which the tables explain, the rounding of zeta, and the options that a table varies."""
    differ = {"e_sp", "e_c", "k_l", "k_b", "rough_contact", "mu", "zeta", "dim", "n", "hopper_wall_distance", "hopper_width",
              "hopper_angle", "t_end", "dt", "seed", "frame_interval", "sample_interval", "lip_contact", "n_vertices", "output"}
    files = {"sp": "as_run.yaml", "rough": "as_run_rough.yaml", "smooth": "as_run_smooth.yaml"}
    models = set()
    for row in read_rows(figure.VALIDATION / f"{name}.csv", "hopper"):
        if row.options.get("drag") != "per_mass":  # a row as printed, for comparison
            assert {"friction", "count", "contact_law", "reinsertion_gap"}.isdisjoint(row.options)
            continue
        model, three = row.options.get("model", "sp"), row.options.get("dim") == "3"
        example = dict(re.findall(r"^(\w+): (\S+)", (figure.VALIDATION.parent / "examples" / files[model]).read_text(encoding="utf-8"), re.M))
        own = differ | {"model"} | ({"e_w"} if three or model != "sp" else set())
        assert {k: v for k, v in row.options.items() if k not in own} == {k: v for k, v in example.items() if k not in own}
        mu, zeta = (float(row.options.get(key) or 0) for key in ("mu", "zeta"))
        lam = zeta / mu / published.CODE_LAMBDA[3 if three else 2] if mu else np.inf
        if lam < 0.0101:
            assert mu == (28.4 if three else 8.505)
        if lam > 0.0099:
            assert zeta == pytest.approx(4.111 if three else 1.539, rel=1e-3)
        models.add(model)
    kinds = {"as-run/map": {"smooth"}, "as-run/lambda-stiff": {"smooth"}, "quick/deformable": {"rough", "smooth"}}
    named = {"rough", "smooth"} & set(re.split("[-/]", name))
    assert models == kinds.get(name, named or {"sp"})


def test_a_drifting_flow_shows_in_the_duration(tmp_path):
    touching = AS_RUN | {"reinsertion_gap": 0.0, "reinsertion_lateral_speed": np.nan}
    data = pd.concat([reading_rows("drag", beta, zeta=1.54, t_end=t, **AS_RUN) for t, beta in ((50, 0.7), (100, 0.5), (200, 0.3))]
                     + [reading_rows("drag", 0.6, zeta=1.54, t_end=t, **touching) for t in (50, 200)], ignore_index=True)
    found = drawn("duration", data, tmp_path)
    assert {name: q.value for name, q in found.items() if name.startswith("beta: ")} == {
        f"beta: {name}, drag only, t_end = {t}": pytest.approx(beta, abs=0.06) for name, t, beta in (
            ("as run", 50, 0.7), ("as run", 100, 0.5), ("as run", 200, 0.3),
            ("as run, reinserted touching", 50, 0.6), ("as run, reinserted touching", 200, 0.6))}


def test_a_drifting_flow_of_deformable_particles_shows_in_the_duration(tmp_path):
    smooth = {"model": "smooth", "zeta": 1.54, "edge_force": "twofold", "edge_width": 0.2} | DEFORMABLE_AS_RUN
    data = pd.concat([reading_rows("drag", beta, t_end=t, **(smooth | {"reinsertion_gap": gap}))
                      for gap, t, beta in ((0.8333, 30, 0.6), (0.8333, 100, 0.3), (0.0, 30, 0.7), (0.0, 100, 0.7))], ignore_index=True)
    found = drawn("duration-deformable", data, tmp_path)
    kind = "smooth, K_l = 10, K_b = 0.1, drag only"
    assert {name: q.value for name, q in found.items() if name.startswith("beta: ")} == {
        f"beta: {name}: {kind}, t_end = {t}": pytest.approx(beta, abs=0.06) for name, t, beta in (
            ("as run", 30, 0.6), ("as run", 100, 0.3), ("as run, reinserted touching", 30, 0.7),
            ("as run, reinserted touching", 100, 0.7))}


@pytest.mark.parametrize("status", ["clogged", "done"])  # done: a single particle keeps bouncing
def test_a_clogged_run_is_not_a_rate(status):
    data = reading_rows("drag", 0.9)
    data.loc[(data["hopper_width"] == 3) & (data["seed"] == 1), ["status", "Q", "Q_error"]] = [status, 0.0, np.nan]
    one = drawn("readings", data)["beta: printed, drag only"]
    assert one.value == pytest.approx(0.9, abs=0.05) and "1 of 15 runs clogged, left out (w = 3)" in one.note
    data.loc[data["hopper_width"] == 3, ["status", "Q", "Q_error"]] = [status, 0.0, np.nan]
    one = drawn("readings", data)["beta: printed, drag only"]
    assert one.value == pytest.approx(0.9, abs=0.1) and "1 clogged left out (w = 3)" in one.note


def test_no_law_of_the_width_where_the_widest_orifice_clogs():
    data = reading_rows("drag", 0.9)
    data.loc[(data["hopper_width"] == data["hopper_width"].max()) & (data["seed"] == 2), ["Q", "Q_error"]] = 0.0, np.nan
    row = beverloo.fit_seeds(data, ["dim"], opposite=True).iloc[0]
    assert row["fit"] is row["reference_fit"] is row["opposite_fit"] is None
    assert row["note"].startswith("the widest orifice clogs, too: no fit; 1 of 15 runs clogged, left out (w = 10)")


def test_residuals_of_the_published_and_of_the_opposite_exponent():
    found = drawn("readings", reading_rows("drag", 0.5))
    assert found["chi2/dof with beta = 1/2 held: printed, drag only"].value < 5
    assert found["residual of Q with beta = 1/2 held: printed, drag only"].value < 0.02
    # 3/2 of a law with 1/2: by an unweighted fit of its relative residuals
    wrong = found["residual of Q with beta = 3/2 held: printed, drag only"].value
    w = np.array([3.0, 4.0, 6.0, 8.0, 10.0])
    Q = beverloo.beverloo(w, 0.4, 1.2, 0.5)
    expected = beverloo.fit_beverloo(w, Q, 0.01 * Q, beta=1.5)
    assert wrong == pytest.approx(np.sqrt(np.mean((expected(w) / Q - 1) ** 2)), abs=0.02) and wrong > 0.1
    # Errors of three seeds, 0.01/sqrt(3) each: chi2 is about the sum of squares over them
    assert found["chi2/dof with beta = 3/2 held: printed, drag only"].value == pytest.approx(
        5 / 3 * wrong**2 / (0.01**2 / 3), rel=0.5)


@pytest.mark.filterwarnings("error::UserWarning", "error::RuntimeWarning")
def test_a_reading_without_an_exponent():
    """Too few widths, with drag only in all rows: a row without a point, and no warning."""
    few = pd.concat([reading_rows("friction", 1.5, mu=8.505), reading_rows("drag", 0.5)])
    few = few[few["hopper_width"] < 5]
    found = drawn("readings", pd.concat([reading_rows("friction", 2.2), few], ignore_index=True))
    assert np.isnan(found["beta: printed, drag only"].value) and np.isfinite(found["beta: printed, friction only"].value)


def test_readings_are_fitted_again_without_the_narrowest_orifice():
    """Where the narrowest one is not of the law, the fit without it finds the law; runs without one are fitted once."""
    data = reading_rows("drag", 0.5)
    data.loc[data["hopper_width"] == 3, ["Q", "Q_error"]] *= 0.7
    wide = reading_rows("friction", 1.5)
    found = drawn("readings", pd.concat([data, wide[wide["hopper_width"] > 3]]))
    first, second = found["beta: printed, drag only"], found["beta: printed, drag only, from w = 4 on"]
    assert second.value == pytest.approx(0.5, abs=3 * second.error) and 0 < second.error < 0.1
    assert abs(first.value - 0.5) > 4 * first.error
    assert found["chi2/dof with beta = 1/2 held: printed, drag only, from w = 4 on"].value < 5
    assert not any("friction only, from w" in name for name in found)


def test_the_ratio_of_the_prefactors():
    """Ratio of drag to friction, for each reading, with any names of its coefficients."""
    def rows(limit, C, **columns):
        data = reading_rows(limit, 0.5 if limit == "drag" else 1.5, **columns)
        return data.assign(Q=data["Q"] * C / 0.4, Q_error=data["Q_error"] * C / 0.4)
    as_run = {"friction": AS_RUN | {"mu": 8.505}, "drag": AS_RUN | {"zeta": 1.54}}
    data = pd.concat([rows("friction", 0.2), rows("drag", 5.6), rows("friction", 0.7, **as_run["friction"]),
                      rows("drag", 2.1, **as_run["drag"]), rows("friction", 0.5, mu=8.505), rows("drag", 3.0, zeta=1.54),
                      rows("friction", 0.9, mu=4.0), rows("drag", 3.0, e_w=694.0)], ignore_index=True)
    found = {name.split(": ")[1]: q for name, q in drawn("readings", data).items() if name.startswith("C of drag over")}
    assert {name: q.value for name, q in found.items()} == {name: pytest.approx(ratio, rel=0.1) for name, ratio in {
        "printed": 28, "as run": 3, "printed, as run coefficients": 6}.items()}
    assert agree(found["as run"]) == "yes" and agree(found["printed"]) == "no" and 0 < found["as run"].error < 0.2
    assert found["printed"].published.value == pytest.approx(2.8) and found["printed"].published.error == pytest.approx(0.2, abs=0.01)


def test_exponents_of_strong_dissipation():
    """Their mean over a stated range, and the rate times the coefficient."""
    betas = {1.0: 0.9, 3.16: 0.5, 10.0: 0.6, 31.6: 0.5}
    found = drawn("coefficients", pd.concat([reading_rows("drag", beta, zeta=z) for z, beta in betas.items()]))
    each = [found[f"beta: printed, zeta = {z:.3g}, drag only"] for z in (3.16, 10, 31.6)]
    one = found["beta, mean over zeta of 3 and more: printed, drag only"]
    weight = np.array([q.error ** -2 for q in each])
    chi2 = (weight * (np.array([q.value for q in each]) - one.value) ** 2).sum() / 2
    assert one.value == pytest.approx((weight * [q.value for q in each]).sum() / weight.sum())
    assert chi2 > 1.2 and one.error == pytest.approx(np.sqrt(chi2 / weight.sum())), "its own scatter counts"
    assert one.published.value == 0.5 and "3 points from 3.16 to 31.6" in one.note
    rate = found["Q zeta at w = 10: printed, zeta = 10, drag only"]
    assert rate.value == pytest.approx(10 * 0.4 * 8.8**0.6, rel=0.02) and 0 < rate.error < 0.02 * rate.value
    # One strong coefficient has no mean.
    found = drawn("coefficients", pd.concat([reading_rows("friction", 1.5, mu=mu) for mu in (1.0, 31.6)]))
    assert not any("mean over" in name for name in found)


def test_exponents_against_coefficients(tmp_path):
    laws = {0.1: 1.1, 1.0: 1.3, 10.0: 1.5, 100.0: 1.7}
    data = pd.concat([*(reading_rows("friction", beta, mu=mu, t_end=100 + mu) for mu, beta in laws.items()),
                      *(reading_rows("friction", 1.5, mu=mu, friction="tangential") for mu in (0.1, 100.0)),
                      *(reading_rows("drag", 1.5 - beta + 0.4, zeta=z) for z, beta in ((1.0, 1.3), (10.0, 1.5)))], ignore_index=True)
    found = drawn("coefficients", data, tmp_path)
    assert found["beta: printed, mu = 10, friction only"].value == pytest.approx(1.5, abs=0.1)
    slope = found["slope per decade about beta = 3/2: printed, friction only"]
    assert slope.value == pytest.approx(0.2, abs=0.08) and 0 < slope.error < 0.1
    # Within 0.1 of 3/2 over a decade; a plateau all over
    crossover = found["decades within 0.1 of beta = 3/2: printed, friction only"]
    assert crossover.value == pytest.approx(1, abs=0.5) and not crossover.note
    flat = found["decades within 0.1 of beta = 3/2: printed, tangential friction, friction only"]
    assert flat.value == pytest.approx(3, abs=0.2) and "lower limit" in flat.note
    assert found["slope per decade about beta = 1/2: printed, drag only"].value == pytest.approx(-0.2, abs=0.08)
    assert found["beta: printed, zeta = 10, drag only"].published.value == 0.5


def test_exponents_against_coefficients_in_3d(tmp_path):
    """Exponents of spheres, next to disks: compared with the exponents of their dimension, and named by the model in
    3D."""
    size = {"dim": 3, "n": 6400, "hopper_wall_distance": 25.0, "pack_fraction": 0.64}
    as_run = AS_RUN | size | {"e_w": 578.7, "e_sp": 115.7}
    data = pd.concat([
        *(reading_rows("friction", beta, mu=mu, **size) for mu, beta in ((1.0, 2.3), (10.0, 2.5), (100.0, 2.7))),
        *(reading_rows("drag", 1.5, zeta=z, **size) for z in (3.16, 10.0)), reading_rows("drag", 1.6, zeta=4.111, **as_run),
        *(reading_rows("drag", 0.5, zeta=z) for z in (3.16, 10.0))], ignore_index=True)
    found = drawn("coefficients-3d", data, tmp_path)
    expected = {"printed, 3D, mu = 10, friction only": (2.5, 2.5), "printed, 3D, zeta = 10, drag only": (1.5, 1.5),
                "as run, 3D, zeta = 4.11, drag only": (1.6, 1.5), "printed, zeta = 10, drag only": (0.5, 0.5)}
    assert {name: (found[f"beta: {name}"].value, found[f"beta: {name}"].published.value) for name in expected} == {
        name: (pytest.approx(beta, abs=0.1), known) for name, (beta, known) in expected.items()}
    assert found["decades within 0.1 of beta = 5/2: printed, 3D, friction only"].value == pytest.approx(1, abs=0.5)
    assert found["beta, mean over zeta of 3 and more: printed, 3D, drag only"].published.value == 1.5
    assert found["beta, mean over zeta of 3 and more: printed, drag only"].published.value == 0.5


def test_how_flat_an_exponent_is():
    x = np.array([-1.0, 0, 1, 2])
    (decades, error, ends), (slope, slope_error) = plateau(x, [1.1, 1.3, 1.5, 1.7], [0.02] * 4, 1.5)
    assert decades == pytest.approx(1.0, abs=0.01) and 0.02 < error < 0.3 and not ends
    assert slope == pytest.approx(0.2) and slope_error == pytest.approx(0.02 / np.sqrt(2))
    (decades, _, ends), (slope, _) = plateau(x, [1.5] * 4, [0.0] * 4, 0.5)
    assert (decades, ends) == (0, False) and math.isnan(slope)


def test_protocols_are_told_apart(tmp_path):
    one = {"mu": 5.0}
    wide = reading_rows("friction", 1.5, n=2400, hopper_wall_distance=75.0, **one)
    data = pd.concat([
        reading_rows("friction", 1.5, **one), reading_rows("friction", 1.7, n=3200, **one),
        reading_rows("friction", 1.4, t_end=200, **one), reading_rows("friction", 1.6, pack_fraction=0.6, **one),
        wide.assign(hopper_width=wide["hopper_width"] + 5), reading_rows("drag", 0.9), reading_rows("drag", 0.7, dt=5e-4)],
        ignore_index=True)
    found = drawn("protocol", data, tmp_path)
    betas = {name.removeprefix("beta: "): q.value for name, q in found.items() if name.startswith("beta: ")}
    assert betas.pop("printed, mu = 5: N = 2400, W = 75, w = 8 to 15, friction only") > 0
    assert betas == {name: pytest.approx(beta, abs=0.1) for name, beta in {
        "printed, mu = 5: reference, friction only": 1.5, "printed, mu = 5: N = 3200, friction only": 1.7,
        "printed, mu = 5: t_end = 200, friction only": 1.4, "printed, mu = 5: start at phi = 0.6, friction only": 1.6,
        "printed: reference, drag only": 0.9, "printed: dt = 0.0005, drag only": 0.7}.items()}


def raft_rows(rows, **columns):
    """Measured rows of rafts, by default one run each."""
    known = {"commit": "abc", "cpu_seconds": 1.0, "table": "t", "v_wall": 1e-4, "tilt": 0.0, "small_fraction": 0.0,
             "small_radius": 0.765, "delta": 0.00125}
    return pd.DataFrame([known | {"row": f"run {i}"} | row | columns for i, row in enumerate(rows)])


def test_figures_of_force_curves(tmp_path):
    rows = [{"row": f"{v}", "v_wall": v, "distance": D, "force": D - 3.7, "slope": 3.16, "slope_error": 0.001, "n": 3,
             "F_max": 0.110 + 12 * v, "F_min": -0.07 + 3 * v, "seed": 1} for v in (1e-4, 3e-4, 1e-3) for D in np.linspace(3.9, 3.5, 30)]
    found = drawn("T2.3", raft_rows(rows), tmp_path)
    assert found["F_max as v_wall goes to 0"].value == pytest.approx(0.110, abs=1e-6)
    assert found["F_min as v_wall goes to 0"].value == pytest.approx(-0.07, abs=1e-6)
    assert agree(found["F_max as v_wall goes to 0"]) == agree(found["stiffness at F = 0, slowest wall"]) == "yes"
    rows = [row | {"row": f"{seed}-{phi}", "seed": seed, "small_fraction": phi, "v_wall": 1e-4,
                   "F_max": 1.0 + 0.1 * seed} for row in rows[:30] for seed in (1, 2, 3) for phi in (0.0, 0.5)]
    peak = drawn("T2.6", raft_rows(rows), tmp_path)["highest peak, phi = 0.5"]
    assert peak.value == pytest.approx(1.2) and peak.error == pytest.approx(0.1 / math.sqrt(3))


def test_figures_of_reductions(tmp_path):
    rows = [{"row": f"seed {seed}", "seed": seed, "n": 49, "start_rows": 7, "rows": p, "x": 49 / p / (p + 1),
             "k_eq": (7 + 0.1 * seed) * 49 / p / (p + 1), "k_error": 0.01, "k1": 4.69, "E1": 0.00173,
             "F_max": 1.2 * 49 * 2 * math.sqrt(4.69 * 0.00173 / (p**3 + p**2))} for seed in (-1, 0, 1) for p in range(7, 2, -1)]
    found = drawn("T2.7", raft_rows(rows), tmp_path)
    one = found["k1 of k_eq = k1 q/(p+1)"]
    assert one.value == pytest.approx(7.0) and 0.02 < one.error < 0.08 and agree(one) == "yes"
    first, lattice = found["k1 of the reduction from 7 rows"], found["k1 of a linear lattice of 7 rows"]
    assert first.published.value == lattice.published.value == 5.27 and agree(lattice) == "no"
    assert lattice.value == pytest.approx(6.33, abs=0.005)
    assert agree(found["k1 of two droplets"]) == agree(found["E1 of two droplets"]) == "yes"
    # The first reduction is equal in all seeds, because all bonds hold; later reductions differ: each has a separate
    # error.
    alike = [row | {"k_eq": 5.53 + 1e-4 * row["seed"], "k_error": 1e-5} if row["rows"] == 7 else row | {"k_error": 1e-5} for row in rows]
    first, second = (drawn("T2.7", raft_rows(alike))[f"k1 of the reduction from {p} rows"] for p in (7, 6))
    assert first.error == pytest.approx(1e-4 / 0.875 / math.sqrt(3), rel=0.01) and second.error == pytest.approx(0.1 / math.sqrt(3), rel=0.01)
    single = raft_rows([row for row in rows if row["rows"] == 7])
    for name in ("T2.7", "T2.8"):
        with pytest.raises(PliantError, match="two reductions"):
            command.FIGURES[name].draw(single)
    found = drawn("T2.8", raft_rows(rows), tmp_path)
    assert found["F_max over 2 N sqrt(k1 E1/(p^3+p^2)), mean of reductions, N = 49"].value == pytest.approx(1.2)


def fracture_row(seed, **columns):
    return {"seed": seed, "n": 20, "rows": 4, "phi": 0.0, "delta": 0.00125, "tilt": 0.0, "inverse_size": 20**-0.5,
            "aspect": 1.25, "peaks": 3, "excess": 0, "competing": 0.0, "reductions": 100} | columns


def test_figures_of_fractures(tmp_path):
    law = [fracture_row(seed, phi=phi, small_fraction=phi, delta=0.1 * (1 + phi),
                        excess=34 * math.sqrt(phi * (1 - phi)) + seed * (0 < phi < 1),
                        peaks=3 + 34 * math.sqrt(phi * (1 - phi)))
           for seed in (-1, 0, 1) for phi in (0.0, 0.1, 0.25, 0.5, 0.75, 1.0)]
    found = drawn("T2.10", raft_rows(law), tmp_path)
    assert found["height of the excess, N = 20"].value == pytest.approx(17, abs=0.1)
    half = found["excess over its height at phi = 0.5, N = 20"]
    assert half.published.value == 1 and agree(half) == "yes" and half.error > 0
    alone = [row for row in law if row["phi"] == 0]
    larger = [row | {"n": 36, "rows": 6} for row in alone]  # one size only: the figure has no height
    assert {"N = 20" in name for name in drawn("T2.10", raft_rows(law + larger))} == {True}
    with pytest.raises(PliantError, match="two sizes"):
        command.FIGURES["T2.10"].draw(raft_rows(alone))
    found = drawn("T2.11", raft_rows(law), tmp_path)
    assert found["peaks at delta = 0.1, one size"].value == 3 and found["peaks at delta = 0.15, two sizes"].value == 20
    both = drawn("T2.11", raft_rows([*law, *(row | {"n": 36, "rows": 6, "peaks": 9} for row in law)]), tmp_path)
    assert both["peaks at delta = 0.15, two sizes, N = 20"].value == 20
    assert both["peaks at delta = 0.15, two sizes, N = 36"].value == 9

    sizes = [fracture_row(seed, n=p * p, rows=p, inverse_size=1 / p, aspect=1.0, competing=0.8 - 1.6 / p + 0.02 * seed)
             for seed in (-1, 0, 1) for p in (3, 4, 6, 8, 12)]
    limit = drawn("T2.14", raft_rows(sizes), tmp_path)["fraction of competing fractures as N goes to infinity"]
    assert limit.value == pytest.approx(0.8) and 0.005 < limit.error < 0.05 and agree(limit) == "no"
    judged = [row | {"unmatched": min(row["competing"] + 0.2, 1), "overlapping": float(row["n"] > 30)} for row in sizes]
    found = drawn("T2.14", raft_rows(judged), tmp_path)
    limit = found["fraction of unmatched fractures as N goes to infinity"]
    assert limit.value == pytest.approx(1.0) and agree(limit) == "yes"
    assert found["fraction of overlapping fractures, N = 16"].value == 0
    assert found["fraction of overlapping fractures, N = 144"].value == 1
    assert found["fraction of competing fractures as N goes to infinity"].value == pytest.approx(0.8)
    bent = [row | {"competing": 0.1 + 0.02 * row["seed"] + 0.6 * (row["n"] == 144)} for row in sizes]  # no line fits: its end decides nothing
    limit = drawn("T2.14", raft_rows(bent), tmp_path)["fraction of competing fractures as N goes to infinity"]
    assert agree(limit) == "no verdict" and "leave the line" in limit.note
    shapes = [fracture_row(seed, n=36, rows=p, aspect=36 / p**2, competing=1 / p) for seed in (1, 2) for p in (12, 6, 3)]
    assert drawn("T2.15", raft_rows(shapes), tmp_path)["fraction of competing fractures, q/p = 4"].value == pytest.approx(1 / 3)
    tilts = [fracture_row(seed, tilt=t, competing=f + 0.02 * seed) for seed in (-1, 0, 1)
             for t, f in ((0.0, 0.3), (0.1, 0.2), (0.2, 0.1), (0.5, 0.5), (1.0, 0.8))]
    least = drawn("T2.16", raft_rows(tilts).assign(tilt=[row["tilt"] for row in tilts]), tmp_path)
    least = least["tilt with the fewest competing fractures, N = 20"]
    assert least.value == 0.2 and agree(least) == "yes"


def test_figures_of_clogs(tmp_path):
    table = made_table(seeds=40).assign(commit="abc", cpu_seconds=1.0, table="t", seed=1)
    table["row"] = np.arange(len(table)).astype(str)
    found = drawn("T4.5", table, tmp_path)
    assert found["A"].value == pytest.approx(0.12, abs=0.08) and agree(found["B"]) in ("yes", "no")
    assert found["B"].value == pytest.approx(0.029, rel=0.35)
    assert found["B, emptied runs censored at N"].value == pytest.approx(0.029, rel=0.1)
    assert found["A, from P_clog"].published.value == 0.12 and "points" in found["B, from P_clog"].note
    assert found["B, phi_c = 0.0002 alone"].error > 0
    own = found["B, emptied runs censored at N, against B from the published w*"]
    half = clog.clog_law(2 * 2.96, 0.12, own.published.value, 190)
    assert own.value == found["B, emptied runs censored at N"].value and half == pytest.approx(0.5)
    found = drawn("T4.6", table, tmp_path)
    away, uncut = (found[f"P_clog minus its fit, {words}mean over points"] for words in ("", "emptied runs censored at N, "))
    assert abs(away.value) < 0.05 and abs(uncut.value) < 0.02
    assert drawn("T4.3", table, tmp_path)["w*/d at phi_c = 0.0002"].value > 3
    found = drawn("T4.4", table, tmp_path)
    assert {"w*/d, low cohesion", "w*/d over delta, high cohesion", "delta_crit"} == set(found)
    assert found["delta_crit"].value == pytest.approx(0.8, abs=0.15) and found["delta_crit"].error > 0
    gravity = table.assign(g=0.02 * table["hopper_width"] / 12, hopper_width=3.0)
    assert set(drawn("T4.2", gravity, tmp_path)) == {f"g_0 at phi_c = {phi:g}" for phi in (0, 5e-5, 1e-4, 2e-4)}
    for name in ("T4.2", "T4.3", "T4.5"):
        with pytest.raises(PliantError):
            command.FIGURES[name].draw(table[:1])
    flat = table.assign(status="empty")  # no middle anywhere
    assert all(math.isnan(q.value) for q in drawn("T4.3", flat, tmp_path).values())
    with pytest.raises(PliantError, match="passes one half"):
        command.FIGURES["T4.4"].draw(flat)


def disk_rows():
    rng, rows = np.random.default_rng(5), []
    for delta in (0.2, 0.3, 0.45):
        for seed in (1, 2, 3):
            D2 = 0.11 * delta + 0.09
            rows.append({"polydispersity": delta, "seed": seed, "disks": 300, "dr_na": 0.37 * (1 + 0.01 * rng.normal()),
                         "dr_na_error": 0.004, "d2_min": D2 * (1 + 0.01 * rng.normal()), "d2_min_error": 0.001,
                         "dr_na_clock": 0.4 * (1 + 0.01 * rng.normal()), "dr_na_clock_error": 0.004,
                         "d2_min_clock": (D2 - 0.02 * delta) * (1 + 0.005 * rng.normal()), "d2_min_clock_error": 0.001,
                         "rotation": 2 * math.pi * 0.046 * (1 + 0.01 * rng.normal()), "rotation_error": 0.003})
    return raft_rows(rows)


def test_figures_of_disks(tmp_path):
    found = drawn("T3.11", disk_rows(), tmp_path)
    assert {agree(q) for q in found.values()} == {"yes"} and len(found) == 4
    assert found["slope of D2_min/<R>^2 in delta"].value == pytest.approx(0.11, abs=0.02)
    assert found["D2_min/<R>^2 at delta = 0"].value == pytest.approx(0.09, abs=0.006)
    assert drawn("T3.14", disk_rows(), tmp_path)["slope of D2_min/<R>^2 in delta"].value == pytest.approx(0.09, abs=0.02)
    found = drawn("TA.2", disk_rows(), tmp_path)
    assert agree(found["|dtheta| in turns, mean of the distributions"]) == "yes"
    assert agree(found["|dtheta|, mean of the distributions"]) == "no"
    slope = found["slope of |dtheta| in turns in delta"]
    assert abs(slope.value) < 0.01 and slope.published.value == 0  # published: no trend
    assert found["|dtheta| in turns at delta = 0.45"].value == pytest.approx(0.046, rel=0.05)
    with pytest.raises(PliantError, match="no run has the quantity rotation"):
        command.FIGURES["TA.2"].draw(disk_rows().assign(rotation=np.nan))
    rows = [row | {"relative": x, "dr_na": 0.37 * x**0.74, "d2_min": 0.1 * x**1.47, "exponent_dr_na": 0.74 + 0.005 * s,
                   "exponent_dr_na_error": 0.005, "exponent_d2_min": 1.47 + 0.005 * s, "exponent_d2_min_error": 0.005}
            for s, row in enumerate(disk_rows().to_dict("records"), -4) for x in (0.2, 1.0, 5.0)]
    found = drawn("T3.12", raft_rows(rows), tmp_path)
    one = found["exponent of dr_na in the interval, centre"]
    assert one.value == pytest.approx(0.74) and 0.001 < one.error < 0.01 and agree(one) == "yes"


def packed(dim, n, seeds, onset, pressures=(1e-2, 1e-3, 1e-4, 1e-6), **columns):
    """Rows of `packings`: isostatic at the onset, and with p = 0.35 dphi, Z - Z_iso = 3 dphi^(1/2), G = 0.3 dphi^(1/2) above it."""
    rng, rows = np.random.default_rng(n), []
    for seed in range(seeds):
        phi_J = onset + 0.05 * n**-0.55 * rng.normal()
        for p in pressures:
            backbone, dphi = n - rng.integers(1, 4), p / 0.35
            contacts = dim * (backbone - 1) + 1 + round(1.5 * backbone * dphi**0.5 * (p > 1e-6))
            rows.append({"seed": seed, "row": f"{dim}-{n}-{seed}-{columns}", "model": "sp", "dim": dim, "n": n, "path": "decompress",
                         "start_fraction": 0.9, "start_pressure": 0.01, "pressure": p, "fraction": phi_J + dphi, "backbone": backbone,
                         "contacts": contacts, "coordination": 2 * contacts / backbone, "shear_modulus": 0.3 * dphi**0.5} | columns)
    return rows


def as_measured(rows):
    return pd.DataFrame(rows).assign(table="t", commit="abc", cpu_seconds=1.0)


@pytest.mark.parametrize("name, dim, limit", [("J1", 2, 0.842), ("J3", 3, 0.639)])
def test_figures_of_the_onset_of_jamming(name, dim, limit, tmp_path):
    """The limit of the fraction, for each path, the width of its distribution, and isostatic packings."""
    rows = []
    for n in (64, 256, 1024):
        shift = -0.1 * n ** (-1 / (dim * published.ONSET_NU))
        rows += packed(dim, n, 40, limit + shift) + packed(dim, n, 40, limit + 0.02 + shift, start_fraction=1.0)
    found = drawn(name, as_measured(rows), tmp_path)
    near, far = (found[f"phi_J, N to infinity, start at phi = {phi}, first p = 0.01"] for phi in ("0.9", "1"))
    assert near.value == pytest.approx(limit, abs=0.002) and 0 < near.error < 0.002 and agree(near) == "yes"
    assert far.value == pytest.approx(limit + 0.02, abs=0.002) and agree(far) == "no"
    width = found["exponent of N in the standard deviation of phi_J, start at phi = 0.9, first p = 0.01"]
    assert agree(width) == "yes" and 0.02 < width.error < 0.1
    assert found["Z, N to infinity, start at phi = 0.9, first p = 0.01"].value == pytest.approx(2 * dim, abs=0.002)
    counted = {n: found[f"packings with d (N' - 1) + 1 contacts, start at phi = 0.9, first p = 0.01, N = {n}"] for n in (64, 1024)}
    assert counted[64].value == 1 and agree(counted[64]) == "yes" and agree(counted[1024]) == "no verdict"
    more = as_measured([row | {"contacts": row["contacts"] + 1} for row in rows])
    assert agree(drawn(name, more)["packings with d (N' - 1) + 1 contacts, start at phi = 0.9, first p = 0.01, N = 64"]) == "no"
    with pytest.raises(PliantError, match="disks and spheres" if name == "J3" else "2D runs only"):
        command.FIGURES[name].draw(as_measured(packed(2, 64, 2, 0.84) + packed(3, 64, 2, 0.64)))


def test_figure_of_the_laws_above_jamming(tmp_path):
    found = drawn("J2", as_measured([row for n in (256, 4096) for row in packed(2, n, 20, 0.84)]), tmp_path)
    for name, power, error in (("p", 1, 0.02), ("Z - Z_iso", 0.5, 0.02), ("G", 0.5, 0.01)):
        high, low = (found[f"slope of {name} in phi - phi_J, p = {a} to {b}, N = 4096"] for a, b in (("0.01", "0.001"), ("0.001", "0.0001")))
        assert low.value == pytest.approx(power, abs=error) and low.published.value == power
        assert agree(high) in ("no verdict", "no number") and low.decides
    negative = as_measured([row | {"shear_modulus": -0.1} for row in packed(2, 64, 5, 0.84)])
    assert math.isnan(drawn("J2", negative)["slope of G in phi - phi_J, p = 0.001 to 0.0001, N = 64"].value)
    without = as_measured(packed(2, 64, 5, 0.84)).assign(shear_modulus=np.nan)
    assert not any("slope of G" in name for name in drawn("J2", without, tmp_path))


def test_errors_of_slopes_contain_correlations():
    """The error of a slope of means is the scatter of this slope between independent samples."""
    rng = np.random.default_rng(3)

    def sample():
        common = rng.normal(0, 0.2, (30, 1))  # both states of a run share it
        x = np.array([1e-2, 1e-3]) * np.exp(rng.normal(0, 0.2, (30, 2)))
        return packings._slope(x, x**0.5 * np.exp(common + rng.normal(0, 0.02, (30, 2))))

    slopes, errors = np.array([sample() for _ in range(300)]).T
    assert slopes.mean() == pytest.approx(0.5, abs=0.01)
    assert errors.mean() == pytest.approx(slopes.std(), rel=0.15)
    assert np.isnan(packings._slope(np.ones((1, 2)) * [2, 1], np.ones((1, 2)) * [2, 1])[1])


def polygon_rows(shapes, **columns):
    rng = np.random.default_rng(2)
    return [{"seed": s, "row": f"{a}-{s}", "model": "rough", "dim": 2, "n": 12, "n_vertices": 12, "k_b": 0.01, "shape_parameter": a,
             "pressure": p, "fraction": 0.5 + 0.01 * rng.normal(), "rim_fraction": 1 - 2 * abs((a or 1.0235) - 1.16) + 0.01 * rng.normal(),
             "contacts": 40 + s, "backbone": 12 - (a == 0), "coordination": 4 + 0.1 * s} | columns
            for a in shapes for s in range(4) for p in (1e-2, 1e-4)]


def test_figure_of_packings_of_polygons(tmp_path):
    found = drawn("J4", as_measured(polygon_rows((0, 1.08, 1.16))), tmp_path)
    of = "rough, N = 12, n_v = 12, K_b = 0.01"
    confluent = found[f"phi with rims, A0 = 1.16, {of}"]
    assert agree(confluent) == "yes" and found[f"phi with rims, A0 = 1.08, {of}"].published is None
    assert found[f"contacts of a particle, A0 = 1.08, {of}"].value == pytest.approx(2 * 41.5 / 12)
    # A regular polygon has the shape of its number of vertices.
    assert found[f"share of particles that are no rattlers, A0 = 1.023, {of}"].value == pytest.approx(11 / 12)
    low = as_measured(polygon_rows((1.16,), rim_fraction=0.8))
    assert agree(drawn("J4", low)[f"phi with rims, A0 = 1.16, {of}"]) == "no"
    with pytest.raises(PliantError, match="no run has deformable particles"):
        command.FIGURES["J4"].draw(as_measured(packed(2, 64, 2, 0.84)))


def mode_rows(more=0, crossover=1.0):
    """Rows of `packing_modes`: as many modes without stiffness as missing contacts, and `more`; energies with quadratic parts
    proportional to the power `crossover` of the pressure, and quartic ones."""
    amplitudes, rows = 10.0 ** np.arange(-5, -1), []
    for k_b, pre_stress in ((0.0, "dropped"), (0.01, "dropped"), (0.0, "kept")):
        for s in range(4):
            for p in (1e-4, 1e-5, 1e-6):
                missing = -s if k_b else 10 + s
                whole = {"seed": s, "row": f"{k_b}-{pre_stress}-{s}", "model": "rough", "dim": 2, "n": 8, "n_vertices": 12, "k_b": k_b,
                         "shape_parameter": 1.08, "pressure": p * (1 + 1e-7 * s), "missing": missing, "zero_modes": 2 + max(missing, 0) + more,
                         "pre_stress": pre_stress}
                if pre_stress == "dropped":
                    rows.append(whole)
                for kind, power, quadratic in (("no stiffness", 4, p**crossover), ("stiff", 2, 3.0)) if pre_stress == "kept" else ():
                    rows.append(whole | {"kind": kind, "exponent": power + 0.01 * s, "with_exponent": 0.8, "quadratic": quadratic,
                                         "crossover": quadratic**0.5 if power == 4 else np.nan})
                    rows += [whole | {"kind": kind, "amplitude": a, "energy": quadratic * a**2 + a**4} for a in amplitudes]
    return as_measured(rows)


def test_figure_of_quartic_modes(tmp_path):
    found = drawn("J6", mode_rows(), tmp_path)
    of = "rough, A0 = 1.08, K_b = {}, N = 8, n_v = 12"
    for k_b, missing in (("0", 11.5), ("0.01", -1.5)):
        share = found[f"packings whose missing contacts are as many as modes without stiffness, {of.format(k_b)}"]
        assert share.value == 1 and agree(share) == "yes" and found[f"missing contacts, {of.format(k_b)}"].value == missing
    for kind, power in (("no stiffness", 4), ("stiff", 2)):
        one = found[f"exponent of the energy in the displacement, {kind}, p = 1e-06, {of.format(0)}"]
        assert one.value == pytest.approx(power + 0.015) and one.published.value == power and agree(one) == "no verdict"
    low = found[f"exponent of p in the quadratic part, no stiffness, p = 1e-05 to 1e-06, {of.format(0)}"]
    assert low.value == pytest.approx(1) and low.published.value == 1 and low.decides
    half = found[f"exponent of p in the crossover, no stiffness, p = 1e-05 to 1e-06, {of.format(0)}"]
    assert half.value == pytest.approx(0.5) and half.published.value == 0.5
    wrong = drawn("J6", mode_rows(more=1, crossover=0.5))
    assert agree(wrong[f"packings whose missing contacts are as many as modes without stiffness, {of.format(0)}"]) == "no"
    assert wrong[f"exponent of p in the quadratic part, no stiffness, p = 1e-05 to 1e-06, {of.format(0)}"].value == pytest.approx(0.5)
    alone = mode_rows()
    assert len(drawn("J6", alone[alone["pre_stress"] == "dropped"].dropna(axis=1, how="all"), tmp_path)) == 4


def test_figure_of_flow_curves(tmp_path):
    """Newtonian below the onset, a power at it, a yield stress above it."""
    rng, rows = np.random.default_rng(4), []
    for fraction, law in ((0.78, lambda x: 2 * x), (0.8434, lambda x: 0.05 * x**0.28), (0.88, lambda x: 0.01 + 0.1 * x**0.5)):
        for rate in (1e-5, 1e-4, 1e-3, 1e-2, 3e-2):
            for seed in range(3):
                stress = law(rate) * (1 + 0.005 * rng.normal())
                rows.append({"seed": seed, "row": f"{fraction}-{rate}-{seed}", "model": "sp", "dim": 2, "n": 64, "zeta": 1.0,
                             "fraction": fraction, "shear_rate": rate, "flow_stress": stress, "flow_stress_error": 0.005 * stress,
                             "flow_pressure": 3 * stress, "flow_pressure_error": 0.01 * stress})
    found = drawn("J5", as_measured(rows), tmp_path)
    for symbol in ("sigma", "p"):
        powers = {phi: found[f"exponent of {symbol} in the rate, 1e-05 to 0.0001, phi = {phi}, N = 64, zeta = 1"]
                  for phi in (0.78, 0.8434, 0.88)}
        assert agree(powers[0.78]) == "yes" and powers[0.78].published.value == 1
        assert powers[0.8434].value == pytest.approx(0.28, abs=0.01) and agree(powers[0.8434]) == "no verdict"
        assert powers[0.88].published is None
    stress = found["yield stress of Herschel and Bulkley, phi = 0.88, N = 64, zeta = 1"]
    assert stress.value == pytest.approx(0.01, abs=3 * stress.error) and 0 < stress.error < 5e-4
    assert found["exponent of Herschel and Bulkley, phi = 0.88, N = 64, zeta = 1"].value == pytest.approx(0.5, abs=0.05)
    unsteady = as_measured(rows).assign(flow_stress=np.nan, flow_pressure=np.nan)
    with pytest.raises(PliantError, match="no flow is steady"):
        command.FIGURES["J5"].draw(unsteady)


@pytest.fixture(scope="module")
def channel_runs(tmp_path_factory):
    """[(row, folder)]: two seeds of two distributions, and one with another friction of the walls."""
    folder, runs = tmp_path_factory.mktemp("channels"), []
    for name, disks, options in (("a", 60, {}), ("b", 90, {}), ("b", 90, {"mu_wall": 0.8, "mu_wall_dynamic": 0.6, "mu_plunger_dynamic": 0.6})):
        for seed in (1, 2):
            run = folder / f"{name}-{len(options)}-{seed}"
            made = channel_tracks(frames=56, disks=disks, spacing=0.11, seed=seed)
            radius = np.where(np.arange(disks) % 3 == 0, 1.2, made.pushes[0].radius) if name == "b" else made.pushes[0].radius
            pushes = tuple(dataclasses.replace(push, radius=radius) for push in made.pushes)
            write_channel_run(run, dataclasses.replace(made, pushes=pushes), distribution=name, seed=seed,
                              **({"mu_wall": 0.4} | options))
            runs.append((run.name, run))
    return runs


def all_measured(name, runs):
    return pd.concat([measure.measured(name, row, run) for row, run in runs], ignore_index=True).assign(table="t")


def test_measures_of_disks(channel_runs):
    """From runs with a known motion: the names of pliant-analyse's result are those that are looked for."""
    table = all_measured("motion", channel_runs)
    assert len(table) == 6 and list(table["distribution"][::2]) == ["a", "b", "b"] and list(table["mu_wall"][::2]) == [0.4, 0.4, 0.8]
    assert table["polydispersity"].between(0.05, 0.9).all() and (table["dr_na"] > 0).all() and (table["d2_min"] > 0).all()
    assert_allclose(table["force"], 0.5)
    assert (table["largest_overlap"] == 0.01).all() and (table["jammed"] == 1).all()
    assert np.isfinite(table[["exponent_dr_na", "exponent_d2_min", "rotation", "dr_na_clock"]].to_numpy()).all()
    curve = measure.measured("intervals", *channel_runs[0])
    assert len(curve) > 2 and curve["dr_na"].is_monotonic_increasing and np.isfinite(curve["exponent_dr_na"]).all()
    sizes = measure.measured("sizes", *channel_runs[0])
    assert sizes["radius"].is_monotonic_increasing and sizes["disks"].sum() == 60 and (sizes["relative_dr_na"] > 0).all()
    near = measure.measured("distances", *channel_runs[0])
    assert set(near["radius"]) == set(sizes["radius"]) and near.groupby("radius").size().eq(40).all()
    cells = measure.measured("cells", *channel_runs[0])
    plug = cells[(cells["x"] > 27) & (cells["count"] > 50)]
    assert_allclose(plug["mean_x"], -plug["travel"], atol=0.08)
    shot = measure.measured("snapshots", *channel_runs[0])
    assert len(shot) == 60 and (shot["largest"] == 1).sum() == 15 and (shot["largest"] == 2).sum() == 1
    assert shot.loc[shot["largest"] == 2, "radius"].iloc[0] == shot["radius"].max()
    assert not (shot["largest"] * shot["smallest"]).any(), "the neighbourhoods are apart"


def test_an_analysis_is_made_once(channel_runs):
    """The analysis is stored in the folder of the run, and used if it has the default choices and belongs to the present state of
    the run."""
    run = channel_runs[0][1]
    measure.measured("motion", "x", run)
    path = run / "analysis.json"
    made = read_json(path)

    def found(changes):
        write_json(path, made | changes)
        return measure.measured("motion", "x", run)["dr_na"][0]

    true, other = made["dr_na"]["all"]["value"], {"dr_na": {"all": {"value": 7.0, "error": 1.0}}}
    assert found(other) == 7.0
    assert found(other | {"choices": made["choices"] | {"neighbours": 11}}) == pytest.approx(true, rel=1e-5)
    assert read_json(path)["choices"]["neighbours"] == 15
    assert found(other | {"run": made["run"] | {"frames": 7}}) == pytest.approx(true, rel=1e-5)
    assert read_json(path)["run"] == made["run"]


def test_figures_of_single_disks_and_cells(channel_runs, tmp_path):
    runs = channel_runs[:4:2]
    found = drawn("T3.4", all_measured("sizes", runs))
    assert set(found) == {"delta of a", "delta of b"}
    cells = all_measured("cells", runs)
    found = drawn("T3.5", cells, tmp_path)
    assert found["mean displacement over the plunger's, in the inlet, a"].value == pytest.approx(1, abs=0.06)
    assert found["mean displacement over the plunger's, in the outer corner, a"].value < 0.3
    shots = all_measured("snapshots", runs)
    assert not drawn("T3.6", shots) and not drawn("T3.7", shots, tmp_path)
    found = drawn("T3.13", cells)
    assert all(np.isfinite(q.value) for q in found.values()) and len(found) == 3
    found = drawn("TA.1", cells)
    assert len(found) == 6 and all(-1 <= q.value <= 1 for q in found.values())
    with pytest.raises(PliantError, match="rotation"):
        command.FIGURES["TA.1"].draw(cells.assign(rotation=np.nan))


def test_figures_of_sizes(channel_runs):
    sizes = all_measured("sizes", channel_runs[:4])
    assert len(drawn("T3.8", sizes)) == 8
    # Made: the largest move 0.84 times as far, wherever they are.
    known = sizes.assign(dr_na=np.where(sizes["radius"] > 3, 0.84, 1.0), relative_dr_na=np.where(sizes["radius"] > 3, 0.84, 1.0),
                         peak_dr_na=0.2 * sizes["relative_radius"])
    found = drawn("T3.8", known)
    for where in ("", ", in the same cells"):
        assert found["dr_NA/<R> of the largest disks over the smallest, a" + where].value == pytest.approx(0.84)
    assert drawn("T3.10", known)["slope of the peak of dr_NA/<R> in R/<R>, b"].value == pytest.approx(0.2)
    near = all_measured("distances", channel_runs[:4])
    bump = 1 + np.exp(-((near["distance"] - 0.75) / 0.2) ** 2) - 0.5 * np.exp(-((near["distance"] - 1.27) / 0.2) ** 2)
    found = drawn("T3.9", near.assign(dr_na=bump, dr_na_error=0.1))
    assert len(found) == 4 and {agree(q) for q in found.values()} == {"yes"}


@pytest.mark.parametrize("groups", [4, 5])
def test_a_long_legend_stands_above_the_curves(groups):
    new, axes = plt.subplots()
    for i in range(groups):
        axes.errorbar([0, 1], [i, i + 1], [0.1, 0.1], label=f"$K_l$ = {i}")
    beverloo_figures.groups_first(axes)
    box = axes.get_legend().get_window_extent()
    assert (box.y0 > axes.bbox.y1) == (groups == 5) and (box.y1 < axes.bbox.y1) == (groups == 4) and box.x1 < axes.bbox.x1
    plt.close(new)


def test_more_curves_than_colours(channel_runs):
    """Curves of one colour differ in marker or face."""
    styles = [tuple(plotting.symbol(i).values()) for i in range(16)]
    assert len(set(styles)) == 16 and plotting.symbol(2, turns=1) == plotting.symbol(10)
    sizes, near = (all_measured(name, channel_runs[:2]) for name in ("sizes", "distances"))
    many = [f"d{i}" for i in range(10)]
    with_ten = pd.concat([sizes.assign(distribution=name, radius=sizes["radius"] + 0.2 * k, row=sizes["row"] + name)
                          for k in (0, 1) for name in many], ignore_index=True)
    assert set(drawn("T3.4", with_ten)) == {f"delta of {name}" for name in many}
    radii = pd.concat([near.assign(radius=near["radius"] + 0.2 * k) for k in range(9)], ignore_index=True)
    drawn("T3.9", radii)
    motion = all_measured("motion", channel_runs)
    motion = motion[motion["distribution"] == "b"]
    found = drawn("T3.choices", pd.concat([motion.assign(distribution=name) for name in many], ignore_index=True))
    assert {f"dr_na, {name}" for name in many} <= set(found)
    softs = pd.concat([flow_rows(e_sp=50.0 * (1 + i)) for i in range(9)])
    picture, _ = command.FIGURES["H2"].draw(softs)
    points = [(c[0].get_color(), c[0].get_marker(), c[0].get_markerfacecolor()) for c in picture.axes[0].containers]
    matplotlib.pyplot.close(picture)
    assert len(set(points)) == 9


def test_what_non_affine_motion_depends_on(channel_runs, tmp_path):
    table = all_measured("motion", channel_runs)
    found = drawn("T3.choices", table, tmp_path)
    names = set(found)
    assert {"dr_na, b", "dr_na, b, mu_wall = 0.8/0.6"} <= names and not any(", a" in name for name in names)
    assert found["dr_na, b"].value == pytest.approx(table["dr_na"][2:4].mean())
    assert found["dr_na, b, mu_wall = 0.8/0.6"].value == pytest.approx(table["dr_na"][4:].mean())
    with pytest.raises(PliantError, match="one choice"):
        command.FIGURES["T3.choices"].draw(table[:4])
    # Plungers with separate friction; results stored before that option existed lack the columns.
    rows = table["distribution"] == "b"
    kept = table[rows][:2].drop(columns=["mu_plunger", "mu_plunger_dynamic"])
    plungers = table[rows][2:].assign(mu_wall=0.4, mu_wall_dynamic=np.nan, mu_plunger=0.2, mu_plunger_dynamic=0.15)
    found = drawn("T3.choices", pd.concat([kept, plungers], ignore_index=True), tmp_path)
    assert {"dr_na, b", "dr_na, b, mu_plunger = 0.2/0.15"} <= set(found)
    assert set(drawn("T3.choices", table.drop(columns=["mu_plunger", "mu_plunger_dynamic"]), tmp_path)) == names


def test_measures_of_rafts(tmp_path):
    """From runs with known force curves to the figures."""
    runs = [(f"{seed}-{phi}", write_raft(tmp_path / f"{seed}-{phi}", seed=seed, small_fraction=phi, v_wall=1e-4))
            for seed in (1, 2) for phi in (0.0, 0.5)]

    def all_of(name):
        return pd.concat([measure.measured(name, row, run) for row, run in runs], ignore_index=True).assign(table="t")
    reductions = all_of("reductions")
    assert len(reductions) == 4 * 3 and set(reductions["row"]) == {row for row, _ in runs}
    assert drawn("T2.7", reductions, tmp_path)["k1 of k_eq = k1 q/(p+1)"].value == pytest.approx(K1, rel=1e-2)
    assert len(drawn("T2.8", reductions, tmp_path)) == 2
    forces = all_of("forces")
    assert forces.groupby("row").size().max() <= 300 and forces["F_max"].iloc[0] == pytest.approx(0.4, abs=0.01)
    assert len(drawn("T2.9", forces, tmp_path)) == 2
    fractures = all_of("fractures")
    found = drawn("T2.10", fractures, tmp_path)
    assert found["excess over its height at phi = 0.5, N = 20"].value == pytest.approx(1)
    assert drawn("T2.11", fractures, tmp_path)["peaks at delta = 0, one size"].value == 3
    found = drawn("T2.14", fractures, tmp_path)
    assert [found[f"fraction of {name} fractures, N = 20, phi = 0.5, delta = 0.133"].value for name in (
        "competing", "overlapping", "unmatched")] == [0, 0.5, 0.5]


def test_measures_of_hoppers(soft, tmp_path):
    path, truth = soft
    table = measure.measured("flows", "a", path)
    assert table[["Q", "Q_error", "n", "hopper_angle", "seed"]].iloc[0].tolist() == [3.0, 0.1, 150, 60, 1]
    reading = measure.measured("readings", "a", path).iloc[0]
    assert reading["Q"] == 3.0 and math.isnan(reading["dt"]) and math.isnan(reading["removal_depth"])
    made = write_run(tmp_path / "b", extra={"friction": ("tangential", ""), "dt": (5e-4, "t0"), "e_w": (694, "")})[0]
    reading = measure.measured("readings", "b", made).iloc[0]
    assert (reading["friction"], reading["dt"], reading["e_w"]) == ("tangential", 5e-4, 694)
    assert set(symbols.parameters("hopper")) <= set(table)  # parameters from the program's list
    assert set(symbols.parameters("hopper")) <= set(reading.index)
    profile = measure.measured("profiles", "a", path)
    assert {"e_sp", "drag"} <= set(profile) and "k_l" not in profile
    assert np.interp(2, profile["height"], profile["v"]) == pytest.approx(np.interp(2, truth["heights"], truth["axis_speed"]),
                                                                          rel=0.05)
    assert measure.measured("clogs", "a", path)["status"].tolist() == ["done"]


def test_results_stored_before_a_parameter_was_added_have_its_default():
    stored = pd.DataFrame({"dt": [1e-4, 1e-4, 1e-4], "mu_disk": [0.3, 0.3, 0.5], "base_coupled": [True, np.nan, np.nan]})
    assert disk_motion.choices(stored)["changed"].tolist() == ["", "", "mu_disk = 0.5"]


def test_a_run_that_a_figure_cannot_use(soft):
    with pytest.raises(PliantError, match="not of raft"):
        measure.measured("reductions", "a", soft[0])


def test_every_kept_quantity_stands_once():
    rows = pd.read_csv(figure.VALIDATION / "reproduced.csv")
    assert not rows.duplicated(["figure", "level", "quantity"]).any()


def test_every_kept_quantity_is_of_all_that_is_kept():
    table = pd.read_csv(figure.VALIDATION / "reproduced.csv", keep_default_na=False)
    given = argparse.Namespace(kept=True, table=None, output=Path())
    stale = []
    for (name, level), rows in table.groupby(["figure", "level"]):
        one = command.figure_by_name(name)
        _, tables, data = command._measured(one, level, given, None)
        expected = figure.rows(one, level, [figure.Quantity("any", 1.0, 1.0)], data, [t.name for t in tables]).iloc[0]
        common = ["cpu_hours", "commit", "seeds", "table"]
        if len(rows[common].drop_duplicates()) > 1 or (rows[common].iloc[0] != expected[common]).any():
            stale.append(f"{name} {level}")
    assert not table["commit"].str.contains("dirty").any()
    assert not stale, "draw these again with --kept, and put their rows into validation/reproduced.csv"
