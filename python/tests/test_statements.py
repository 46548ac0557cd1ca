"""Every sentence of docs/validation/what-we-learned.md, and every row of the first table of docs/validation/validation.md, with a number or a verdict
is tied to rows: its tag <sup>w1</sup> names an entry of validation/statements.txt, which says there how to read the format."""

import operator
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pliant.reproduce import published
from pliant.reproduce.figure import AGREE

ROOT = Path(__file__).resolve().parents[2]
VALIDATION = ROOT / "validation"
PAGES = {"docs/validation/what-we-learned.md": "w", "docs/validation/validation.md": "v"}  #: page: first letter of its tags
TAG = re.compile(r"<sup>([wv]\d+)</sup>")
NUMBER = re.compile(r"(?<![\w.])([−-]?\d+(?:\.\d+)?(?:·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?|[−-]?10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))(?: ± (\d+(?:\.\d+)?))?(?![\w])")
VERDICT = re.compile(r":\s+(?:\*\*)?(yes|no verdict|no)\b")
JUDGES = re.compile(r"\b(yes|no|holds?|fails?|agrees?|within|does not|do not|neither|none|confirm\w*|contradict\w*|reproduce[sd]?|match\w*|differs?|"
                    r"compatible|excluded?s?|equals?|as published|larger|smaller|lower|higher|weaker|stronger|rises?|falls?|grows?)\b", re.I)
SUPERSCRIPT = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
#: Not numbers of ours: code, references, links, published exponents, dimensions, numbers of a list and of figures of [T].
NO_NUMBERS = re.compile(r"`[^`]*`|!?\[[^\]]*\]\([^)]*\)|\[[HT][^\]]*\]|\[\d+[a-c]?(?:, ?\d*[a-c]?)*\]|[135]/2|\b[23]D\b|<sup>\w+</sup>|"
                        r"\((?:A|[234])\.\d+[ab]?(?:, (?:A|[234])\.\d+[ab]?)*\)")
#: Names of a setting on the pages, and in the tables of results.
SETTINGS = {"N": "n", "W": "hopper_wall_distance", "w": "hopper_width", "E_sp": "e_sp", "K_l": "k_l", "K_b": "k_b", "θ_w": "hopper_angle",
            "λ": "lam", "contacts of": "e_c", "E_c": "e_c", "φ": "phi", "μ/μ0": "mu", "ζ/ζ0": "zeta"}


# ---- values ----------------------------------------------------------------------------------------------------------

@dataclass(frozen=True)
class Value:
    """A number with its standard error, and the verdict of its row."""

    value: float
    error: float = 0.0
    agree: str = ""
    note: str = ""
    row: dict = None

    @property
    def published(self):
        return Value(self.row["published"], self.row["published_error"])

    @property
    def deviation(self):
        return Value(self.row["deviation"])

    def noted(self, words):
        """The number behind these words in the note."""
        return Value(float(re.search(re.escape(words) + r" ([\d.e+-]*\d)", self.note)[1]))


def _with(operation, relative):
    def apply(a, b):
        a, b = (x if isinstance(x, Value) else Value(x) for x in (a, b))
        value = operation(a.value, b.value)
        error = (abs(value) * np.hypot(a.error / a.value, b.error / b.value) if relative else np.hypot(a.error, b.error))
        return Value(value, float(error))
    return apply


for _name, _operation, _relative in (("add", operator.add, False), ("sub", operator.sub, False), ("mul", operator.mul, True),
                                     ("truediv", operator.truediv, True)):
    _apply = _with(_operation, _relative)
    setattr(Value, f"__{_name}__", _apply)
    setattr(Value, f"__r{_name}__", lambda a, b, f=_apply: f(b, a))


@cache
def reproduced():
    return pd.read_csv(VALIDATION / "reproduced.csv", keep_default_na=False)


def _number(text):
    return float(text) if text not in ("", None) else np.nan


def _value(row):
    own = {name: _number(row[name]) for name in ("ours", "error", "published", "published_error", "deviation")}
    return Value(own["ours"], own["error"], row["agree"], row["note"], row | own)


def _of_figure(table):
    """{(figure, level): [row]}, remembered for the table."""
    if id(table) not in _INDEX:
        found = _INDEX.setdefault(id(table), {})
        for row in table.to_dict("records"):
            found.setdefault((row["figure"], row["level"]), []).append(row)
    return _INDEX[id(table)]


_INDEX = {}


class Rows:
    """The rows of reproduced.csv as specifications name them, and those that one of them has named."""

    def __init__(self, table):
        self.of_figure, self.named = _of_figure(table), []

    def one(self, figure, level, quantity):
        found = [row for row in self.of_figure.get((figure, level), []) if row["quantity"] == quantity]
        assert len(found) == 1, f"{len(found)} rows of {figure} {level} are called '{quantity}'"
        self.named += found
        return _value(found[0])

    def matching(self, figure, level, pattern):
        found = [row for row in self.of_figure.get((figure, level), []) if re.fullmatch(pattern, row["quantity"])]
        assert found, f"no row of {figure} {level} matches '{pattern}'"
        self.named += found
        return [_value(row) for row in found]


def evaluate(specification, default, rows):
    """The values of an entry's specification: [Value or bool], one for each number of its text."""
    known = []

    def named(match):
        opening, text = match[1], match[2]
        own = re.match(r"([A-Za-z][\w.-]*) (full|quick|as-run): (.*)", text)
        figure, level, quantity = own.groups() if own else (*default.split(), text)
        known.append((rows.matching if opening == "all" else rows.one)(figure, level, quantity))
        return f"known[{len(known) - 1}]"

    code = re.sub(r"(all)?\{([^{}]*)\}", named, specification)
    result = eval(code, {"__builtins__": {}, "known": known, **FUNCTIONS})  # noqa: S307: our own file
    return list(result) if isinstance(result, (tuple, list)) else [result]


@cache
def _column(table, name):
    """The values of a column of the table validation/TABLE.csv."""
    return set(pd.read_csv(VALIDATION / f"{table}.csv", comment="#")[name])


def _values(arguments):
    return [v for one in arguments for v in (one if isinstance(one, (list, tuple)) else [one])]


@cache
def _measured(name, column):
    """The values of a column of results, validation/measured/NAME.csv."""
    return set(pd.read_csv(VALIDATION / "measured" / f"{name}.csv")[column].dropna())


def _kept(name, column, **where):
    """The mean of a column of validation/measured/NAME.csv over the rows with these values of other columns."""
    data = pd.read_csv(VALIDATION / "measured" / f"{name}.csv")
    for other, value in where.items():
        data = data[data[other] == value]
    assert len(data), f"{name} has no row with {where}"
    return Value(float(data[column].mean()))


def _change(reference, others):
    return Value(max(abs(one.value - reference.value) for one in others))


#: Functions that specifications may call; `of` are rows, or lists of them.
FUNCTIONS = {
    # numbers
    "Value": Value, "TRUE_RATIO": Value(published.CODE_LAMBDA[2]), "value": lambda v: Value(v.value),
    "abs": lambda v: Value(abs(v.value), v.error), "percent": lambda v: Value(100 * v.value, 100 * v.error),
    "relative": lambda v: Value(100 * v.error / abs(v.value)),
    "low": lambda *of: min(_values(of), key=lambda v: v.value), "high": lambda *of: max(_values(of), key=lambda v: v.value),
    "span": lambda *of: [min(_values(of), key=lambda v: v.value), max(_values(of), key=lambda v: v.value)],
    "count": lambda verdict, *of: Value(sum(v.agree == verdict for v in _values(of))), "number": lambda *of: Value(len(_values(of))),
    "farthest": lambda *of: Value(max(abs(v.row["deviation"]) for v in _values(of))), "change": _change,
    "seeds": lambda v: Value(_seeds(v.row["seeds"])),
    "distributions": lambda: Value(len(set(published.DELTA) & _measured("channel/pair.motion", "distribution")
                                       | set(published.DELTA) & _measured("channel/distributions.motion", "distribution"))),
    "judged": lambda v, known: Value(v.value, v.error, "yes" if abs(v.value - known.value) <= AGREE * np.hypot(v.error, known.error) else "no"),
    # whether it is so
    "every": lambda verdict, *of: all(v.agree == verdict for v in _values(of)),
    "never": lambda verdict, *of: all(v.agree != verdict for v in _values(of)),
    "notes": lambda words, *of: all(words in v.note for v in _values(of)),
    "is_bound": lambda *of: all("k at its bound" in v.note for v in _values(of)),
    "near": lambda a, b, k: bool(abs(a.value - b.value) <= k * np.hypot(a.error, b.error)),
    "beyond": lambda k, *of: all(v.row["deviation"] * np.sign(k) > abs(k) for v in _values(of)),
    "falls": lambda a, b: bool(a.value - b.value > 2 * np.hypot(a.error, b.error)),
    # values of a column
    "column": _column, "measured": _measured, "kept": _kept,
}


def _seeds(text):
    return sum(int(part.split("-")[-1]) - int(part.split("-")[0]) + 1 for part in text.split(","))


# ---- texts -----------------------------------------------------------------------------------------------------------

def _as_float(match):
    text, power, bare = match[1], match[2], match[3]
    if bare:
        return 10.0 ** int(bare.translate(SUPERSCRIPT)) * (-1 if text[0] in "−-" else 1), 0.0
    mantissa, factor = text.split("·")[0].replace("−", "-"), 10.0 ** int(power.translate(SUPERSCRIPT)) if power else 1.0
    return float(mantissa) * factor, _unit(mantissa) * factor


def _unit(text):
    """The value of a unit of the last digit of a number; trailing zeros of a whole number are no digits."""
    if "." in text:
        return 10.0 ** -len(text.split(".")[1])
    return 10.0 ** (len(text) - len(text.rstrip("0"))) if text.strip("-0") else 1.0


def numbers(text):
    """[(value, unit of its last digit, error or None, unit of that)] of a text."""
    return [(*_as_float(m), *((float(m[4]), _unit(m[4])) if m[4] else (None, None))) for m in NUMBER.finditer(NO_NUMBERS.sub(" ", text))]


def _is(printed, unit, value):
    return abs(printed - value) <= 0.5 * unit * (1 + 1e-6) + 1e-12 * abs(value)


def compare(text, found):
    """The numbers of a text that disagree with [Value, bool, set] of its specification; empty if all agree."""
    if all(isinstance(one, (bool, np.bool_)) for one in found):
        return "" if all(found) else "is not true"
    printed = numbers(text)
    if isinstance(found[0], set):
        missing = [value for value, unit, *_ in printed if not any(_is(value, unit, float(one)) for one in found[0] if one == one)]
        return f"{missing} is not in the table" if missing else ""
    if len(printed) != len(found):
        return f"has {len(printed)} numbers, its specification {len(found)}"
    for (value, unit, error, error_unit), one in zip(printed, found):
        one = one if isinstance(one, Value) else Value(float(one))
        if not _is(value, unit, one.value):
            return f"{value:g} is {one.value:.6g}"
        if error is not None and not _is(error, error_unit, one.error):
            return f"the error {error:g} of {value:g} is {one.error:.3g}"
    verdict = VERDICT.search(text)
    if verdict and any(one.agree != verdict[1] for one in found):
        return f"'{verdict[1]}' is '{'/'.join(one.agree for one in found)}'"
    return ""


def entries(text):
    """{tag: (default 'FIGURE LEVEL', [(text, specification)])} of statements.txt."""
    found = {}
    for line in text.splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        if head := re.fullmatch(r"\[([wv]\d+)\] ?(.*)", line):
            assert head[1] not in found, f"statements.txt has two entries {head[1]}"
            found[head[1]] = (head[2], own := [])
        else:
            words, separator, specification = line.partition(" := ")
            assert separator, f"statements.txt: no ' := ' in '{line}'"
            own.append((words.strip(), specification.strip()))
    return found


def statements(page, text):
    """[sentence or row of a table] of a page that need a tag: those with a number or a verdict."""
    if page == "docs/validation/validation.md":
        text = text.split("## In short")[1].split("\n## ")[0]
    found = []
    for block in text.split("\n"):
        if block.startswith(("|--", "| --", "#", "![")) or not block.strip() or (page == "docs/validation/validation.md" and not block.startswith("|")):
            continue
        if block.startswith("|"):
            found.append(block)
        else:
            block = re.sub(r"^\d+\. ", "", block)
            block = re.sub(r"([.:])((?:\*\*)?)(<sup>\w+</sup>)", r"\3\1\2", block)
            found += re.split(r"(?<=[.!?])(?<!App\.)(?<!Fig\.)(?:\*\*)? (?=[^a-z])", block)
    heads = {line for line, after in zip(text.split("\n"), text.split("\n")[1:]) if after.startswith(("|--", "| --"))}
    heads |= {one for one in found if one.startswith("**") and not re.search(r"\d|<sup>", one)}  # a heading of the sentences after it
    return [one for one in found if one not in heads and (NUMBER.search(_plain(one)) or JUDGES.search(_plain(one)))]


def _plain(statement):
    """The numbers of the statement; a row of the summary without its last cell, which names figures and seeds."""
    last = statement.rstrip("| ").rfind("|")
    if statement.startswith("|") and re.search(r"`[\w.-]+ (full|quick|as-run)`|the same", statement[last:]):
        statement = statement[:last]
    return NO_NUMBERS.sub(lambda m: " " * len(m[0]), statement)


@cache
def _setting(tables, column):
    """The values of a column of the results of these tables."""
    values = set()
    for table in tables.split("; "):
        for path in (VALIDATION / "measured").glob(f"{table}.*.csv"):
            data = pd.read_csv(path, nrows=5000)
            if column == "lam" and {"mu", "zeta"} <= set(data):
                data = data.assign(lam=data["zeta"] / data["mu"])
            values |= set(data[column].dropna()) if column in data else set()
    return frozenset(values)


def _is_setting(before, after, value, unit, named):
    """Whether a number is an option of the runs of a statement: 'N = 1600', '20°', '30 t0', or a number in the name of a row."""
    symbol = re.search(r"(" + "|".join(map(re.escape, SETTINGS)) + r")(?: =|) (?:[\d.;,°⁰¹²³⁴⁵⁶⁷⁸⁹ ]|to|and|or)*$", before)
    column = "hopper_angle" if after.startswith("°") else "t_end" if after.startswith(" t0") else SETTINGS[symbol[1]] if symbol else None
    if column and any(_is(value, unit, one) for row in named for one in _setting(row["table"], column)):
        return True
    return bool(symbol or column) and any(_is(value, unit, float(m)) for row in named
                                          for m in re.findall(r"(?<![\w.])\d+(?:\.\d+)?(?:e[+-]?\d+)?", row["quantity"]))


def check(statement, tied, table):
    """The faults of a statement; empty if each of its numbers agrees with a row."""
    tags = TAG.findall(statement)
    if not tags:
        return ["has a number or a verdict and no tag"]
    wrong, rows, plain = [], Rows(table), _plain(statement)
    left, at = plain, 0
    for tag in tags:
        if tag not in tied:
            return [f"statements.txt has no entry {tag}"]
        default, lines = tied[tag]
        for words, specification in lines:
            if words == "also":  # rows that only name settings
                evaluate(specification, default, rows)
                continue
            place = statement.find(words, at)
            if place < 0:
                wrong.append(f"'{words}' is not in it, or not in the order of statements.txt")
                continue
            at = place + len(words)
            left = left[:place] + " " * len(words) + left[place + len(words):]
            try:
                problem = compare(words, evaluate(specification, default, rows))
            except (AssertionError, SyntaxError, TypeError, NameError, AttributeError) as error:
                problem = f"{type(error).__name__} {error} in '{specification}'"
            if problem:
                wrong.append(f"'{words}': {problem}")
    for m in NUMBER.finditer(left):
        if not _is_setting(plain[:m.start()], plain[m.end():], *_as_float(m), rows.named):
            wrong.append(f"{m[0]} (…{plain[max(0, m.start() - 30):m.end() + 5]}…) has no row")
    return wrong


def faults(page, text, tied, table):
    """[(statement, fault)] of a page."""
    return [(one, wrong) for one in statements(page, text) if (wrong := check(one, tied, table))]


@pytest.fixture(scope="module")
def tied():
    return entries((VALIDATION / "statements.txt").read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", PAGES)
def test_every_statement_agrees_with_its_rows(page, tied):
    found = faults(page, (ROOT / page).read_text(encoding="utf-8"), tied, reproduced())
    assert not found, "\n".join(f"{page}: {one[:120]}\n    " + "\n    ".join(wrong) for one, wrong in found)


# ---- the check itself ------------------------------------------------------------------------------------------------

ROWS = pd.DataFrame([
    {"figure": "H2", "level": "full", "quantity": "beta: soft, N = 800", "ours": "2.283", "error": "0.038", "published": "1.5",
     "published_error": "0", "deviation": "20.6", "agree": "no", "note": "k at its bound", "table": "hopper/limits", "seeds": "1-3"},
    {"figure": "H2", "level": "full", "quantity": "beta: hard, N = 800", "ours": "1.497", "error": "0.051", "published": "1.5",
     "published_error": "0", "deviation": "-0.1", "agree": "yes", "note": "", "table": "hopper/limits", "seeds": "1-3"}])
TIES = """[w1] H2 full
2.283 ± 0.038: no := {beta: soft, N = 800}
k at its bound 0 := is_bound({beta: soft, N = 800})
1.50 ± 0.05: yes := {beta: hard, N = 800}
1.5 to 2.3 := span(all{beta: .*})
"""
SENTENCE = "Of N = 800 β is 2.283 ± 0.038: no (k at its bound 0), hard 1.50 ± 0.05: yes, 1.5 to 2.3<sup>w1</sup>."


def problems(sentence, ties=TIES):
    return "; ".join(wrong for one in statements("docs/validation/what-we-learned.md", sentence) for wrong in check(one, entries(ties), ROWS))


def test_a_sentence_that_agrees_with_its_rows_has_no_fault():
    assert problems(SENTENCE) == ""
    assert problems("Fit the exponent for your own hopper.") == ""


@pytest.mark.parametrize(("old", "new", "message"), [
    ("2.283 ± 0.038", "2.284 ± 0.038", "is not in it"), ("<sup>w1</sup>", "", "no tag"), ("w1", "w2", "no entry w2"),
    ("1.5 to 2.3", "1.5 to 2.3 and 7", "7 .* has no row"), ("N = 800", "N = 801", "801 .* has no row"),
    ("yes, 1.5", "no, 1.5", "is not in it")])
def test_a_changed_or_untied_sentence_is_a_fault(old, new, message):
    assert re.search(message, problems(SENTENCE.replace(old, new)))


@pytest.mark.parametrize(("old", "new", "message"), [
    ("2.283 ± 0.038", "2.284 ± 0.038", "2.284 is 2.283"), ("± 0.05", "± 0.06", "the error 0.06 of 1.5 is 0.051"),
    ("0.038: no", "0.038: yes", "'yes' is 'no'"), ("1.5 to 2.3", "1.5 to 2.4", "2.4 is 2.283"),
    ("is_bound({beta: soft", "is_bound({beta: hard", "is not true"), ("{beta: hard, N = 800}", "{beta: harder}", "0 rows")])
def test_a_number_or_verdict_that_its_rows_do_not_have_is_a_fault(old, new, message):
    """Sentence and entry changed alike: the row disagrees with both."""
    assert message in problems(SENTENCE.replace(old, new), TIES.replace(old, new))


@pytest.mark.parametrize("text", ["It holds.", "It is 7.", "As published both agree."])
def test_a_sentence_with_a_number_or_verdict_needs_a_tag(text):
    assert "no tag" in problems(text)


def test_every_entry_is_used_once(tied):
    tags = [tag for page in PAGES for tag in TAG.findall(re.sub(r"such as <sup>\w+</sup>", "", (ROOT / page).read_text(encoding="utf-8")))]
    assert sorted(tags) == sorted(tied)
