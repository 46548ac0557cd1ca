"""Text is UTF-8 in every locale: no Python file of the project leaves the encoding to the system."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("benchmarks", "examples", "python", "scripts", "src", "tests")
_ENCODING_AT = {"read_text": 0, "write_text": 1}  # its place among the arguments


def python_files():
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix == ".py" or (path.suffix == "" and path.is_file() and b"python3" in path.read_bytes()[:30]):
                yield path


def name_of(function):
    """(the object on which it is called, its name)"""
    if isinstance(function, ast.Attribute):
        return getattr(function.value, "id", getattr(function.value, "attr", "")), function.attr
    return "", getattr(function, "id", "")


def mode_of(call, at, default="r"):
    """The mode, argument `at` of a function that opens files; "" if it is computed."""
    value = next((k.value for k in call.keywords if k.arg == "mode"), call.args[at] if len(call.args) > at else ast.Constant(default))
    return value.value if isinstance(value, ast.Constant) and isinstance(value.value, str) else ""


def unencoded(source):
    """(line, function) of each call that reads or writes text, a program's output too, in the encoding of the locale."""
    for call in ast.walk(ast.parse(source)):
        if not isinstance(call, ast.Call):
            continue
        owner, name = name_of(call.func)
        given = {keyword.arg: keyword.value for keyword in call.keywords}
        if "encoding" in given:
            continue
        if (owner, name) in (("", "open"), ("io", "open"), ("os", "fdopen")):
            text = "b" not in mode_of(call, 1)
        elif name == "open" and owner not in ("os", "h5a", "tarfile", "Image"):
            text = "b" not in mode_of(call, 0)
        elif name in _ENCODING_AT:
            text = len(call.args) <= _ENCODING_AT[name]
        else:
            text = any(isinstance(given.get(k), ast.Constant) and given[k].value for k in ("text", "universal_newlines")) \
                or name.endswith("TemporaryFile") and "b" not in mode_of(call, 0, "w+b")
        if text:
            yield call.lineno, name


@pytest.mark.parametrize("source, found", [
    ("open(p)", 1), ("open(p, 'w')", 1), ("open(p, mode='a')", 1), ("open(p, 'rb')", 0), ("open(p, encoding='utf-8')", 0),
    ("p.open()", 1), ("p.open('rb')", 0), ("h5py.h5a.open(p)", 0), ("tarfile.open(p)", 0), ("Image.open(p)", 0), ("p.read_text()", 1), ("p.read_text('utf-8')", 0), ("p.write_text(t)", 1),
    ("p.write_text(t, encoding='utf-8')", 0), ("os.open(p, flags)", 0), ("os.fdopen(fd, 'w')", 1),
    ("subprocess.run(c, text=True)", 1), ("subprocess.run(c, text=True, encoding='utf-8')", 0), ("subprocess.run(c)", 0),
    ("Popen(c, universal_newlines=True)", 1), ("tempfile.NamedTemporaryFile('w')", 1), ("TemporaryFile()", 0),
])
def test_calls(source, found):
    assert len(list(unencoded(source))) == found


def test_every_text_file_has_an_encoding():
    found = [f"{path.relative_to(ROOT)}:{line}: {name}" for path in python_files()
             for line, name in unencoded(path.read_text(encoding="utf-8"))]
    assert not found, "text without encoding=\"utf-8\":\n" + "\n".join(found)
