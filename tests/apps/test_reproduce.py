"""pliant-reproduce with the program itself: its tables hold options that there are, and a figure comes out of real runs."""

import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
from conftest import PROGRAM

PYTHON = Path(__file__).resolve().parents[2] / "python"
sys.path.insert(0, str(PYTHON))

from pliant.reproduce.command import FIGURES  # noqa: E402
from pliant.reproduce.figure import LEVELS, VALIDATION  # noqa: E402
from pliant.sweep_command import check_options, find_program  # noqa: E402
from pliant.sweep_rows import read_rows  # noqa: E402

TABLES = sorted({name for one in FIGURES.values() for level in LEVELS for name in one.tables(level)})


def test_tables_hold_options_that_there_are():
    """All at once: few rows hold every name and the ends of every range."""
    rows = [row for name in TABLES for row in read_rows(VALIDATION / f"{name}.csv", "hopper")]
    check_options(VALIDATION / "all tables", rows, find_program(PROGRAM), VALIDATION)


def test_a_figure_of_a_table_of_ones_own(tmp_path):
    (tmp_path / "mine.csv").write_text("n,hopper_wall_distance,hopper_width,zeta,t_end,seeds\n"
                                       + "".join(f"60,8,{w},1,20,1-2\n" for w in (2.5, 3, 4, 5)), encoding="utf-8")
    command = [sys.executable, "-B", PYTHON / "pliant-reproduce", "H2", "--table", "mine.csv", "--program", PROGRAM]
    for _ in range(2):
        subprocess.run(command, cwd=tmp_path, check=True, timeout=300, env=os.environ | {"OMP_NUM_THREADS": "1"})
    table = pd.read_csv(tmp_path / "reproduced/reproduced.csv", dtype={"commit": str}).set_index("quantity")
    beta = table.loc["beta: soft, E_sp = 100, drag only"]
    assert 0 < beta["ours"] < 3 and beta["error"] > 0 and beta["published"] == 0.5 and beta["cpu_hours"] > 0
    assert set(table["seeds"]) == {"1-2"} and table["commit"].str.match(r"[0-9a-f]{7,}|unknown").all()
    assert (tmp_path / "reproduced/H2-mine.png").stat().st_size > 10_000
    assert (tmp_path / "reproduced/H2-mine.pdf").stat().st_size > 5_000
