"""scripts/cpp_source.py: comments and texts of C++ sources."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))

from cpp_source import texts, without_comments  # noqa: E402

SOURCE = 'a("x // y");  // z "t"\nchar q = \'"\'; /* b\n"c" */ d(R"(e "f" // g)");\n'


def test_comments_are_blanks():
    assert without_comments(SOURCE) == ('a("x // y");  ' + " " * 8 + "\nchar q = '\"'; " + " " * 4 + "\n" + " " * 6
                                        + ' d(R"(e "f" // g)");\n')


def test_texts():
    assert list(texts(SOURCE)) == [(1, "x // y"), (3, 'e "f" // g')]
