"""Every sentence and row of docs/validation/what-we-learned.md with a number or a verdict refers to rows: its tag <sup>w1</sup> names an
entry of validation/statements.txt, whose head describes the format."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pliant.reproduce.figure import VALIDATION
from pliant.reproduce.rows import Rows, Value, evaluate, reproduced

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/validation/what-we-learned.md"
TAG = re.compile(r"(?<!such as )<sup>(w\d+)</sup>")
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

#: Names of options in the names of rows, where they differ from the column.
IN_ROWS = {"n": "N", "hopper_wall_distance": "W", "hopper_width": "w", "e_sp": "E_sp", "k_l": "K_l", "k_b": "K_b",
           "hopper_angle": "theta_w", "lam": "lambda", "e_c": "E_c"}


# ---- texts -----------------------------------------------------------------------------------------------------------

def _as_float(match):
    text, power, bare = match[1], match[2], match[3]
    if bare:
        return 10.0 ** int(bare.translate(SUPERSCRIPT)) * (-1 if text[0] in "−-" else 1), 0.0
    mantissa, factor = text.split("·")[0].replace("−", "-"), 10.0 ** int(power.translate(SUPERSCRIPT)) if power else 1.0
    return float(mantissa) * factor, _unit(mantissa) * factor


def _unit(text):
    """The value of a unit of the last digit of a number; trailing zeros of a whole number do not count as digits."""
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
        if head := re.fullmatch(r"\[(w\d+)\] ?(.*)", line):
            assert head[1] not in found, f"statements.txt has two entries {head[1]}"
            found[head[1]] = (head[2], own := [])
        else:
            words, separator, specification = line.partition(" := ")
            assert separator, f"statements.txt: no ' := ' in '{line}'"
            own.append((words.strip(), specification.strip()))
    return found


def statements(text):
    """[sentence or row of a table] that has a tag, or needs one because it has a number or a verdict."""
    found = []
    for block in text.split("\n"):
        if block.startswith(("|--", "| --", "#", "![")) or not block.strip():
            continue
        if block.startswith("|"):
            found.append(block)
        else:
            block = re.sub(r"^\d+\. ", "", block)
            block = re.sub(r"([.:])((?:\*\*)?)(<sup>\w+</sup>)", r"\3\1\2", block)
            found += re.split(r"(?<=[.!?])(?<!App\.)(?<!Fig\.)(?:\*\*)? (?=[^a-z])", block)
    heads = {line for line, after in zip(text.split("\n"), text.split("\n")[1:]) if after.startswith(("|--", "| --"))}
    heads |= {one for one in found if one.startswith("**") and not re.search(r"\d|<sup>", one)}  # a heading of the sentences after it
    return [one for one in found if one not in heads and (TAG.search(one) or NUMBER.search(_plain(one)) or JUDGES.search(_plain(one)))]


def _plain(statement):
    """The statement, blank where digits are not numbers."""
    return NO_NUMBERS.sub(lambda m: " " * len(m[0]), statement)


@cache
def _setting(tables, column):
    """The values of a column of the results of these tables."""
    values = set()
    for table in tables.split("; "):
        for path in (VALIDATION / "measured").glob(f"{table}.*.csv.xz"):
            data = pd.read_csv(path, nrows=5000)
            if column == "lam" and {"mu", "zeta"} <= set(data):
                data = data.assign(lam=data["zeta"] / data["mu"])
            values |= set(data[column].dropna()) if column in data else set()
    return frozenset(values)


def _is_setting(before, after, value, unit, named):
    """Whether a number is an option of the runs of a statement: 'N = 1600', '20°', '30 t0', or a number in the name of a row."""
    symbol = re.search(r"(" + "|".join(map(re.escape, SETTINGS)) + r")(?: =|) (?:[\d.;,°⁰¹²³⁴⁵⁶⁷⁸⁹ ]|to|and|or)*$", before)
    column = "hopper_angle" if after.startswith("°") else "t_end" if after.startswith(" t0") else SETTINGS[symbol[1]] if symbol else None
    return bool(column) and any(_is(value, unit, one) for row in named for one in _named_values(row["quantity"], column)
                                or _setting(row["table"], column))


def _named_values(quantity, column):
    """The values of an option that the name of a row gives: its runs have no others."""
    name = re.escape(IN_ROWS.get(column, column))
    return {float(m) for m in re.findall(rf"(?<!\w){name}(?: = |=)(\d+(?:\.\d+)?(?:e[+-]?\d+)?)", quantity)}


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


def faults(text, tied, table):
    """[(statement, fault)] of a page."""
    return [(one, wrong) for one in statements(text) if (wrong := check(one, tied, table))]


@pytest.fixture(scope="module")
def tied():
    return entries((VALIDATION / "statements.txt").read_text(encoding="utf-8"))


def test_every_statement_agrees_with_its_rows(tied):
    found = faults(PAGE.read_text(encoding="utf-8"), tied, reproduced())
    assert not found, "\n".join(f"{PAGE.name}: {one[:120]}\n    " + "\n    ".join(wrong) for one, wrong in found)


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
    return "; ".join(wrong for one in statements(sentence) for wrong in check(one, entries(ties), ROWS))


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


def test_a_value_computed_from_an_undecided_row_is_undecided():
    undecided = ROWS.assign(agree="no verdict")
    for table, verdict in ((ROWS, "no"), (undecided, "no verdict")):
        found = evaluate("judged(2 * {beta: soft, N = 800} / Value(2), {beta: soft, N = 800}.published)", "H2 full", Rows(table))
        assert found[0].agree == verdict


def test_a_tagged_sentence_without_a_number_or_verdict_is_checked():
    ties = "[w1] H2 full\nneither := every('no', {beta: soft, N = 800})\n"
    assert problems("Soft has neither exponent<sup>w1</sup>.", ties) == ""
    assert "'neither' is not in it" in problems("Soft has each exponent<sup>w1</sup>.", ties)


@pytest.mark.parametrize("text", ["It holds.", "It is 7.", "As published both agree."])
def test_a_sentence_with_a_number_or_verdict_needs_a_tag(text):
    assert "no tag" in problems(text)


def test_every_entry_is_used_once(tied):
    tags = TAG.findall(PAGE.read_text(encoding="utf-8"))
    assert sorted(tags) == sorted(tied)
