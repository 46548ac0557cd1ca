"""scripts/check_links.py: dead links and names of pages that do not exist are found."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))

import check_links  # noqa: E402

GOOD = {
    "README.md": "# Title\n\n[a](docs/a.md) [b](docs/a.md#two-words-and-code) [c](#title) [d](https://example.org/x)\n"
                 "![picture](docs/b.png) `src/a.h`\n\n`[code](nowhere.md)`\n",
    "docs/a.md": "## Two words, and `code`\n\n## Two words, and `code`\n\n[up](../README.md) [again](#two-words-and-code-1)\n",
    "docs/b.png": "",
    "src/a.h": "// docs/a.md has the formulas, README.md the commands.\n",
    "src/README.md": "A page next to the source.\n",
}


@pytest.mark.parametrize("changed, expected", [
    ({}, None),
    ({"docs/c.md": "\n[a](a.md) [b](d.md)\n"}, "docs/c.md:2: d.md does not exist"),
    ({"docs/c.md": "[a](a.md#three)\n"}, "docs/c.md:1: a.md has no heading #three"),
    ({"docs/c.md": "[a](#three)\n"}, "docs/c.md:1: c.md has no heading #three"),
    ({"docs/c.md": "![a](c.png)\n"}, "docs/c.md:1: c.png does not exist"),
    ({"docs/c.md": "[a](../src)\n"}, "docs/c.md:1: ../src is a folder, and the site has no page for it"),
    ({"docs/c.md": "`src/b.h`\n"}, "docs/c.md:1: src/b.h does not exist"),
    ({"src/a.h": "\n// docs/gone.md has the formulas.\n"}, "src/a.h:2: docs/gone.md does not exist"),
], ids=["good", "page", "heading", "own heading", "picture", "folder", "path", "comment"])
def test_links(changed, expected, tmp_path):
    for name, text in (GOOD | changed).items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    assert check_links.check(tmp_path) == ([] if expected is None else [expected])


def test_a_folder_without_pages_is_an_error(tmp_path):
    assert "no pages" in check_links.check(tmp_path)[0]
