"""tests/mutations.toml: each entry has its mechanism in the source, and a test of a guarantee in docs/reference/reliability.md."""

import sys
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

import mutations  # noqa: E402

from test_reliability import ROWS, exists, parts  # noqa: E402

ENTRIES = mutations.mutations()


def named_on_the_page(place, name):
    """Whether a guarantee names the test, or its file."""
    return any(place in (where, Path(where or "").stem) and name.startswith(test.removeprefix("test_").removesuffix("…").rstrip("_ "))
               for _, tests in ROWS for where, test in parts(tests))


@pytest.mark.parametrize("entry", ENTRIES, ids=[f"{entry['file']}: {entry['test']}" for entry in ENTRIES])
def test_entry(entry):
    assert (ROOT / entry["file"]).read_text(encoding="utf-8").count(entry["text"]) == 1, "the file must have `text` once"
    assert entry["change"] != entry["text"]
    place, name = mutations.place_and_name(entry)
    assert exists(place, name) and named_on_the_page(place, name)
    assert sum(entry["guarantee"] in guarantee for guarantee, _ in ROWS) == 1


def test_results_are_of_these_entries():
    """An entry without a result was not run; results of removed or changed entries must go."""
    table = pd.read_csv(mutations.RESULTS, dtype=str, keep_default_na=False)
    known = [mutations.row(entry) for entry in ENTRIES]
    assert len(known) == len({tuple(row.values()) for row in known})
    for row in table.to_dict("records"):
        assert {name: row[name] for name in known[0]} in known
        assert row["result"] == "fails"


def test_page_states_the_number_of_results():
    table = pd.read_csv(mutations.RESULTS)
    page = (ROOT / "docs/reference/reliability.md").read_text(encoding="utf-8")
    assert f"{len(table)} of {len(ENTRIES)} changes" in page
