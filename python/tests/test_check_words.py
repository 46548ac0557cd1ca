"""scripts/check_words.py: findings in pages, comments and messages; text that does not count."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
sys.path.insert(0, str(SCRIPTS))

import check_words  # noqa: E402

#: Sentences as found in pages, comments and messages, and better sentences.
FOUND = [
    ("What links cannot show the script finds.", "what subject"),
    ("What is kept next is written in the same pass.", "what subject"),
    ("The list shows what touches.", "what"),
    ("Those of the base are equal.", "subject word"),
    ("Its mass is that of a sphere.", "word"),
    ("It is rebuilt.", "subject"),
    ("This is rebuilt.", "subject"),
    ("Which rank each particle has.", "subject"),
    ("The lists are made anew.", "word"),
    ("Particles are put back at the top.", "word"),
    ("The file has the run (in groups (one per frame) of numbers).", "word"),
    ("The list is rebuilt. It holds pairs.", "subject"),
]
GOOD = [
    "The neighbour list is rebuilt when a particle has moved half a skin.",
    "This list holds pairs, because they are touching.",
    "That model has no vertices.",
    "Which integrator should I use?",
    "Of the 40 rows, 30 agree.",
    "The rotation of the sphere is known; its base is flat, and there is no wall.",
]


def check(tmp_path, name, text):
    """{kind: lines} of a file, and its count of words."""
    path = tmp_path / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    counts, found = check_words.check(tmp_path)
    kinds = {}
    for _, line, _, kind, _, _ in found:
        kinds.setdefault(kind, []).append(line)
    return kinds, sum(counter["words"] for counter in counts.values())


@pytest.mark.parametrize("sentence, kinds", FOUND)
@pytest.mark.parametrize("name, frame", [("docs/page.md", "# Page\n\n{}\n"), ("src/a.h", "#pragma once\n\n/// {}\n"),
                                         ("python/a.py", '"""Module.\n\n{}"""\n'), ("scripts/a.sh", "#!/bin/sh\n\n# {}\n"),
                                         ("src/a.cpp", '\n\nfail("{}");\n')])
def test_finding(sentence, kinds, name, frame, tmp_path):
    found, _ = check(tmp_path, name, frame.format(sentence))
    assert {kind: [3] for kind in kinds.split()} == {kind: sorted(set(lines)) for kind, lines in found.items()}


@pytest.mark.parametrize("sentence", GOOD)
def test_good_sentences(sentence, tmp_path):
    assert check(tmp_path, "README.md", sentence + "\n") == ({}, len(check_words.WORD.findall(sentence)))


def test_code_in_pages_does_not_count(tmp_path):
    text = ("Run `what that of` now:\n\n    pliant what   # those of\n\n```\nwhat goes on\n```\n\n> what it says\n\n"
            "[text](what-we-learned.md) [what.md](a.md) <!-- what -->\n")
    found, words = check(tmp_path, "docs/page.md", text)
    assert (found, words) == ({}, 5)


def test_a_continued_list_item_is_prose(tmp_path):
    found, _ = check(tmp_path, "docs/page.md", "- First\n    line of what follows\n\n    a second paragraph of what\n")
    assert found == {"what": [2, 4]}


def test_comments_are_joined_and_strings_are_not_comments(tmp_path):
    found, _ = check(tmp_path, "tests/a.cpp", 'auto a = "// what is it";  // the list says\n// The numbers are that\n// of a list.\n')
    assert found == {"word": [1, 2]}


def test_strings_that_follow_each_other_are_one_message(tmp_path):
    found, words = check(tmp_path, "src/a.cpp", 'fail("the mass is that"\n     " of a sphere");\nuse("what");\n')
    assert (found, words) == ({"word": [1]}, 7)


def test_ceilings():
    counts = {("pages", "a.md"): {"words": 1000, "what": 2}, ("pages", "b.md"): {"words": 1000, "what": 1}}
    violations, rates = check_words.above(counts, {"pages": {"what": 1.4}, "comments": {"what": 1.0}})
    assert violations == ["pages: what 1.50 per 1000 words, ceiling 1.40"]
    assert rates == {"pages": {"what": 1.5}, "comments": {"what": 0}}


def test_command(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("A list.\n\nThe list of what moves.\n", encoding="utf-8")
    command = [sys.executable, "-B", SCRIPTS / "check_words.py"]
    listed = subprocess.run([*command, "--list", page], capture_output=True, text=True, encoding="utf-8", check=True).stdout
    assert listed.startswith(f"{page}:3: what: 'what moves.' -> ")
    counted = subprocess.run([*command, page], capture_output=True, text=True, encoding="utf-8", check=True).stdout
    assert f"{page}: what 1 in 7 words, lines 3\n" in counted
