"""pliant-reproduce: tables into runs, runs into figures and rows. A small program stands for pliant, and copies runs
that were made before."""

import json
import math
import os
import signal
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
import pytest
from synthetic import write_run
from test_plots import assert_picture

from pliant import PliantError, beverloo, ensemble
from pliant.reproduce import command, figure, measure
from pliant.reproduce.figure import Figure, Quantity, agree, deviation, rows, seeds_text, write_rows
from pliant.reproduce.published import Published
from pliant.sweep_rows import read_rows

HERE = Path(__file__).resolve().parent
COMMAND = HERE.parent / "pliant-reproduce"
LAWS = {"mu": (0.15, 1.6, 1.5), "zeta": (0.42, 2.4, 0.5)}
TABLE = "e_sp,mu,zeta,hopper_width,seeds\n" + "".join(
    f"100,{mu},{zeta},{w},1-2\n" for mu, zeta in (("31.6", ""), ("", "0.316")) for w in (3, 5, 8, 10))

# Copies the run of its row, and writes down that it was asked to; a row without a run fails.
PROGRAM = """#!/bin/sh
[ "$1" = -scenarios ] && exec echo hopper
while [ $# -gt 1 ]; do
  case $1 in -output) out=$2;; -restart) echo "pliant: error: nothing to restart in $2" >&2; exit 2;; esac
  shift
done
row=${out##*/}
echo "$row" >> "$RUNS/log"
if [ -e "$RUNS/stop" ]; then kill -TERM $PPID; exit 75; fi
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
    (folder / "table.csv").write_text(TABLE)
    rng = np.random.default_rng(1)
    for row in read_rows(folder / "table.csv", "hopper"):
        options = {name: float(value) for name, value in row.options.items()}
        law = LAWS["mu" if "mu" in options else "zeta"]
        Q = float(beverloo.beverloo(options["hopper_width"], *law)) * (1 + 0.02 * rng.normal())
        path, _ = write_run(folder / row.id, mu=options.get("mu", 0.0), zeta=options.get("zeta", 0.0), n=20, frames=1,
                            samples=60, w=options["hopper_width"], Q=Q, Q_error=0.02 * Q, seed=int(options["seed"]),
                            extra={"e_sp": (100, "")})
        summary = json.loads((path / "summary.json").read_text())
        (path / "summary.json").write_text(json.dumps(summary | {"cpu_seconds": 9.0}))
    return folder


@pytest.fixture
def call(tmp_path, made, monkeypatch, capsys):
    """A function that runs the command, which must have `code`, and returns what it printed; in a folder of its own."""
    runs = tmp_path / "runs"
    runs.mkdir()
    for path in made.iterdir():
        (runs / path.name).symlink_to(path)
    (tmp_path / "program").write_text(PROGRAM)
    (tmp_path / "program").chmod(0o755)
    (tmp_path / "mine.csv").write_text(TABLE)
    (tmp_path / "validation").mkdir()
    (tmp_path / "validation/quick").mkdir()
    (tmp_path / "validation/quick/limits.csv").write_text(TABLE)
    (tmp_path / "validation/quick/stiff.csv").write_text(TABLE.replace("1-2", "1"))
    monkeypatch.setattr(command, "VALIDATION", tmp_path / "validation")
    monkeypatch.setattr(sys, "argv", [str(COMMAND)])
    monkeypatch.setenv("RUNS", str(runs))
    monkeypatch.chdir(tmp_path)

    def run(*arguments, code=0):
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
    return log.read_text().split() if log.exists() else []


# --- The registry

@pytest.mark.parametrize("one", command.FIGURES.values(), ids=list(command.FIGURES))
def test_every_figure_has_tables(one):
    assert one.title and one.measure in measure.MEASURES and one.quick_note
    for level in figure.LEVELS:
        assert one.tables(level)
        for name in one.tables(level):
            table = read_rows(figure.VALIDATION / f"{name}.csv", "hopper")
            assert level == "full" or len(table) <= 120, name
            # Errors need seeds: several at most points, but where a run shows one thing alone.
            seeds = {row.options.get("seed") for row in table}
            assert len(seeds) > 1 or name in ("quick/map", "quick/three", "raft/three"), name


def test_quick_tables_are_small():
    """In steps of all particles; what they take is in docs/reproduce.md."""
    for one in command.FIGURES.values():
        steps = 0.0
        for name in one.quick:
            for row in read_rows(figure.VALIDATION / f"{name}.csv", "hopper"):
                o = {"n": "1600", "t_end": "100", "model": "sp"} | row.options
                if row.scenario == "hopper" and o.get("flow") != "discharge":
                    dt = 1e-3 if o["model"] == "sp" else 7.5e-5 / 10  # a vertex is half of a particle's work
                    steps += float(o["n"]) * float(o["t_end"]) / dt
        # 12 ns for each of one core
        assert steps * 12e-9 < 450, one.name


def test_every_figure_is_in_the_documentation():
    page = (HERE.parents[1] / "docs/reproduce.md").read_text()
    for one in command.FIGURES.values():
        assert f"| {one.name} | {one.title} | {one.quick_note} |" in page


def test_list_and_names(call):
    output = call("list")
    for name, one in command.FIGURES.items():
        assert f"{name} " in output and one.title in output
    assert "did you mean H2?" in call("H22", code=2)
    assert "list shows all" in call("nonsense", code=2)
    assert command.figure_by_name("h2") is command.FIGURES["H2"]


# --- Rows

@pytest.mark.parametrize("value, error, known, answer", [
    (1.5, 0.1, Published(1.6, 0.0, ""), "yes"), (1.5, 0.1, Published(1.71, 0.0, ""), "no"),
    (1.5, 0.1, Published(1.75, 0.1, ""), "yes"), (1.5, 0.1, Published(1.8, 0.1, ""), "no"),
    (1.5, 0.1, None, "no number"), (math.nan, math.nan, Published(1.5, 0.1, ""), "no number"),
    (1.5, math.nan, Published(1.5, 0.1, ""), "no number"), (1.5, 0.0, Published(1.5, 0.0, ""), "yes"),
    (1.5, 0.0, Published(1.6, 0.0, ""), "no")])
def test_agreement(value, error, known, answer):
    assert agree(Quantity("x", value, error, known)) == answer


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
    path.write_text("a,b\n1,2\n")
    with pytest.raises(PliantError, match="no table of this command"):
        write_rows(path, first)


# --- The command

def test_a_figure(call, tmp_path):
    output = call("H2")
    assert "larger" in output and f"pliant-sweep {tmp_path}/validation/quick/limits.csv --output" in output
    assert_picture(tmp_path / "reproduced/H2-quick.png")
    assert (tmp_path / "reproduced/H2-quick.pdf").read_bytes().startswith(b"%PDF")
    table = pd.read_csv(tmp_path / "reproduced/reproduced.csv").set_index("quantity")
    beta = table.loc["beta: soft, E_sp = 100, friction only"]
    assert beta["ours"] == pytest.approx(1.5, abs=0.3) and beta["published"] == 1.5 and beta["agree"] == "yes"
    assert table.loc["beta: soft, E_sp = 100, drag only", "published"] == 0.5
    assert set(table["seeds"]) == {"1-2"} and set(table["table"]) == {"quick/limits; quick/stiff"}
    # 16 and 8 runs of 9 s
    assert table["cpu_hours"].iloc[0] == pytest.approx(24 * 9 / 3600, rel=1e-3)
    assert len(started(tmp_path)) == 24
    # What was measured stands beside; the same again runs nothing and changes nothing.
    measured = tmp_path / "reproduced/measured/quick/limits.flows.csv"
    assert {"row", "seed", "commit", "cpu_seconds", "Q", "Q_error"} <= set(pd.read_csv(measured).columns)
    before = (tmp_path / "reproduced/reproduced.csv").read_text()
    call("H2", "quick")
    assert len(started(tmp_path)) == 24 and (tmp_path / "reproduced/reproduced.csv").read_text() == before


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


def test_a_failed_run_does_not_spoil_the_rest(call, tmp_path):
    (tmp_path / "runs/e_sp=100,hopper_width=8,mu=31.6,seed=1").unlink()
    output = call("H2", "--table", "mine.csv", code=3)
    assert "failed 1" in output and "no run e_sp=100,hopper_width=8,mu=31.6,seed=1" in output
    table = pd.read_csv(tmp_path / "reproduced/reproduced.csv")
    assert table["cpu_hours"].iloc[0] == pytest.approx(15 * 9 / 3600, rel=1e-3)
    assert (tmp_path / "reproduced/H2-mine.png").exists()


def test_a_stop_and_the_rest_later(call, tmp_path, monkeypatch):
    (tmp_path / "runs/stop").touch()
    monkeypatch.setattr(signal, "getsignal", lambda s: signal.SIG_DFL)
    assert "run the same command again" in call("H2", "--table", "mine.csv", "-j", 1, code=75)
    assert len(started(tmp_path)) == 1 and not (tmp_path / "reproduced/H2-mine.png").exists()
    (tmp_path / "runs/stop").unlink()
    call("H2", "--table", "mine.csv")
    assert len(started(tmp_path)) == 17


def test_campaigns_over_several_sittings(call, tmp_path):
    """Rows that are kept are not run again, and rows can be drawn when the runs are gone."""
    limits = tmp_path / "validation/quick/limits.csv"
    limits.write_text(TABLE.replace("1-2", "1"))
    assert "nothing is kept of H2" in call("H2", "--kept", code=2)
    call("H2", "--keep")
    kept = tmp_path / "validation/measured/quick/limits.flows.csv"
    assert len(pd.read_csv(kept)) == 8 and len(started(tmp_path)) == 16
    limits.write_text(TABLE)
    call("H2", "quick", "--keep", "-o", "elsewhere")
    table = pd.read_csv(kept)
    assert len(table) == 16 and len(set(table["row"])) == 16 and len(started(tmp_path)) == 24
    call("H2", "--kept", "-o", "third")
    assert len(started(tmp_path)) == 24 and (tmp_path / "third/H2-quick.png").exists()
    again, first = (pd.read_csv(tmp_path / folder / "reproduced.csv") for folder in ("third", "elsewhere"))
    pd.testing.assert_frame_equal(again, first, rtol=1e-4, atol=1e-6)
    assert "nothing is kept of H2 full" in call("H2", "full", "--kept", code=2)
    kept.write_text("no\x00table")
    assert "limits.flows.csv" in call("H2", "--kept", code=2)


def test_all(call, tmp_path, monkeypatch):
    chosen = {name: command.FIGURES[name] for name in ("H2", "H3", "H10")}
    monkeypatch.setattr(command, "FIGURES", chosen)
    (tmp_path / "validation/quick/hard.csv").write_text(TABLE.replace("1-2", "2"))
    output = call("all", "quick", code=3)  # H3 has no table here
    assert "H3: " in output and "without a figure: H3" in output
    assert {path.name for path in (tmp_path / "reproduced").glob("*.png")} == {"H2-quick.png", "H10-quick.png"}
    assert set(pd.read_csv(tmp_path / "reproduced/reproduced.csv")["figure"]) == {"H2", "H10"}
    # The table that both have was run once.
    assert len(started(tmp_path)) == 16 + 8 + 8
    call("all", "--kept")  # nothing is kept: no failure, no figure


def test_output_that_cannot_be_written(call, tmp_path):
    (tmp_path / "file").touch()
    assert "cannot be made" in call("H2", "-o", "file/x", code=4)
    if os.getuid():
        (tmp_path / "closed").mkdir(mode=0o500)
        assert "cannot be written" in call("H2", "-o", "closed", code=4)


# --- Figures from what is measured

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
                              "e_c": 1e4, "k_l": 10.0, "k_b": 0.1, "hopper_angle": 90.0, "hopper_width": w, "n": 1600,
                              "hopper_wall_distance": 50, "t_end": 100, "Q": Q, "Q_error": 0.01 * Q, "Q_corrected": 0.9 * Q,
                              "Q_corrected_error": 0.01 * Q, "seed": seed, "commit": "abc", "cpu_seconds": 1.0,
                              "table": "t", "row": f"{lam}-{w}-{seed}-{columns}"} | columns)
    return pd.DataFrame(lines)


def drawn(name, data, tmp_path):
    """{quantity: Quantity} of a figure, which must show something."""
    picture, quantities = command.FIGURES[name].draw(data)
    picture.savefig(tmp_path / "x.png", dpi=60)
    matplotlib.pyplot.close(picture)
    assert_picture(tmp_path / "x.png")
    found = {q.name: q for q in quantities}
    assert len(found) == len(quantities), "a name is there twice"
    return found


LAMS = (0.0, 1e-3, 1e-2, 0.05, 0.1, 1.0, np.inf)


def crossing_law(lam, lam_c=0.05):
    from pliant.crossover import crossover
    return 0.3, 1.5, float(crossover(lam, lam_c, 0.8, 0.5, 1.5))


def test_figure_4_finds_lambda_c(tmp_path):
    found = drawn("H4", flow_rows(LAMS, crossing_law), tmp_path)
    middle = found["lambda_c, published ends: soft, E_sp = 100"]
    assert middle.value == pytest.approx(0.05, rel=0.1) and agree(middle) == "yes" and middle.error > 0
    assert found["beta at lambda = 0: soft, E_sp = 100"].value == pytest.approx(1.5, abs=0.1)
    assert found["beta at lambda = inf: soft, E_sp = 100"].published.value == 0.5


def test_figure_6_compares_angles(tmp_path):
    data = pd.concat([flow_rows(LAMS, lambda lam, c=c: crossing_law(lam, c), hopper_angle=angle, drag_friction_ratio=r,
                                drag_friction_ratio_error=0.01)
                      for angle, c, r in ((90.0, 0.05, 0.1), (30.0, 0.005, 0.5))], ignore_index=True)
    found = drawn("H6", data, tmp_path)
    assert found["lambda_c, published ends: theta_w = 90"].value == pytest.approx(0.05, rel=0.1)
    assert found["lambda_c, published ends: theta_w = 30"].value == pytest.approx(0.005, rel=0.15)
    assert found["lambda_c, published ends: theta_w = 30"].published.value == 0.005
    assert found["|F_zeta|/|F_mu| at lambda = 0.01, theta_w = 30"].value == pytest.approx(0.5)


def test_figure_5_finds_the_exponents(tmp_path):
    rng, lines = np.random.default_rng(4), []
    for lam, power in ((0.0, 0.5), (0.05, 0.0), (np.inf, -0.5)):
        for w in (4.0, 6.0, 10.0):
            for seed in (1, 2):
                for h in (0.0, 1.0, 2.0, 5.0):
                    v = w**power / (1 + h) * (1 + 0.01 * rng.normal())
                    lines.append({"mu": 0.0 if np.isinf(lam) else 1.0, "zeta": 1.0 if np.isinf(lam) else lam, "seed": seed,
                                  "hopper_width": w, "height": h, "v": v, "v_error": 0.01 * v})
    found = drawn("H5", pd.DataFrame(lines), tmp_path)
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


def test_what_a_figure_cannot_use(tmp_path):
    with pytest.raises(PliantError, match="friction only or drag only"):
        command.FIGURES["H2"].draw(flow_rows((0.05,)))
