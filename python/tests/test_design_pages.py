"""Each decision in docs/design names tests that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted(page for page in (ROOT / "docs/design").glob("*.md") if page.name != "README.md")
DECISIONS = [(page, part) for page in PAGES for part in page.read_text(encoding="utf-8").split("\n## ")[1:]]


def named_tests(line):
    """(file, name) of the tests in a line such as "`tests/a.cpp`: `first` and `second`; `tests/b.cpp`: `third`"."""
    file = None
    for name in re.findall(r"`([^`]+)`", line):
        if name.startswith(("tests/", "scripts/")):
            file = ROOT / name.split()[0]
            assert file.exists(), name
        else:
            yield file, name


@pytest.mark.parametrize("page, decision", DECISIONS, ids=[decision.split("\n")[0] for _, decision in DECISIONS])
def test_decision(page, decision):
    for part in ("**Context.**", "**Decision.**", "**Price.**", "**Tests.**"):
        assert part in decision, f"{page.name} has no {part}"
    for file, name in named_tests(decision[decision.index("**Tests.**"):]):
        text = re.sub(r'"\s*\n\s*"', "", file.read_text(encoding="utf-8"))
        assert name in text, f"{page.name}: {file.name} has no test '{name}'"
