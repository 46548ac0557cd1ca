"""Comments and texts in C++ sources, for the scripts that check them."""

import re

#: A comment (groups line, block), a text in quotes (string), a raw text (raw, with its mark) or a character.
TOKEN = re.compile(
    r'(?P<line>//[^\n]*)|(?P<block>/\*.*?\*/)|(?:u8|[uUL])?R"(?P<mark>[^()\\\s]{0,16})\((?P<raw>.*?)\)(?P=mark)"'
    r'|"(?P<string>(?:[^"\\\n]|\\.)*)"|\'(?:[^\'\\\n]|\\.)\'', re.DOTALL)


def without_comments(source):
    """The source with blanks in place of its comments; lines and columns stay."""
    return TOKEN.sub(lambda found: re.sub(r"[^\n]", " ", found[0]) if found["line"] or found["block"] else found[0], source)


def texts(source):
    """(line, text) of each text in quotes."""
    for found in TOKEN.finditer(source):
        text = found["string"] if found["string"] is not None else found["raw"]
        if text is not None:
            yield source.count("\n", 0, found.start()) + 1, text
