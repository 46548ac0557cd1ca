"""scripts/error_ratios.py: errors of single runs against the scatter between seeds."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

import error_ratios  # noqa: E402


def table(groups, seeds, error, rng):
    """Results of `groups` orifice widths: a quantity with scatter 1 between seeds."""
    rows = [{"hopper_width": w, "status": "done", "Q": 10 + rng.normal(), "Q_error": error, "row": f"hopper_width={w},seed={s}", "seed": s}
            for w in range(groups) for s in range(1, seeds + 1)]
    return pd.DataFrame(rows)


def test_ratios_of_known_scatter(tmp_path):
    rng = np.random.default_rng(1)
    (tmp_path / "kept").mkdir()
    table(400, 3, 0.5, rng).to_csv(tmp_path / "kept/a.flows.csv.xz", index=False)
    (found,) = error_ratios.summary(tmp_path).itertuples()
    assert (found.kind, found.quantity, found.groups, found.runs) == ("flows", "Q", 400, 1200)
    assert abs(found.mean - 2) < 0.15 and abs(found.typical - 2) < 0.25


def test_groups_at_rest_and_pairs_are_omitted():
    rng = np.random.default_rng(2)
    data = table(3, 3, 1, rng)
    data.loc[0, "status"] = "clogged"
    data.loc[3, "Q"] = 0
    assert len(error_ratios.ratios(data)) == 1
    assert error_ratios.ratios(table(3, 2, 1, rng)) == []


def test_page_has_the_ratios_of_the_kept_results():
    """Only the tables of the channel: the tables of hoppers take half a minute."""
    page = (ROOT / "docs/validation/single-runs.md").read_text(encoding="utf-8").splitlines()
    rows = error_ratios.lines(error_ratios.summary(pattern="channel/*.motion.csv.xz"))
    assert len(rows) > 6 and not set(rows) - set(page)
