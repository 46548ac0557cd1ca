"""The examples of docs/how-to/analysis.md run as they are printed."""

import re
from pathlib import Path

import pytest
from synthetic import write_run

PAGE = Path(__file__).resolve().parents[2] / "docs/how-to/analysis.md"


@pytest.mark.filterwarnings("error")
def test_examples_run(tmp_path, monkeypatch):
    write_run(tmp_path / "runs/first", n=150, angle=60.0)
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    assert len(blocks) > 6
    names = {}
    exec("\n".join(blocks), names)
    assert len(names["frames"]) == 3 and {"first.dump", "first.pvd"} <= {path.name for path in tmp_path.iterdir()}
