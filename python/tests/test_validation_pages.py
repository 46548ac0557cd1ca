"""The pages of docs/validation are those that scripts/validation_pages.py writes from validation/reproduced.csv."""

import importlib.util
import re
from pathlib import Path

import pandas as pd
import pytest

from pliant.reproduce.rows import reproduced

ROOT = Path(__file__).resolve().parents[2]
_SPEC = importlib.util.spec_from_file_location("validation_pages", ROOT / "scripts/validation_pages.py")
validation_pages = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(validation_pages)

SUMMARY = "validation.md"
MARK = "<!-- not in reproduced.csv"


@pytest.fixture(scope="module")
def found():
    return validation_pages.pages()


def test_every_page_is_current(found):
    assert validation_pages.stale(found) == [], "run scripts/validation_pages.py"


def test_a_changed_row_makes_its_pages_stale(found):
    table = reproduced().copy()
    changed = (table["figure"] == "readings") & (table["quantity"] == "beta: printed, drag only")
    table.loc[changed, "ours"] = "0.9"
    again = validation_pages.pages(csv=table)
    assert {name for name in found if again[name] != found[name]} == {SUMMARY, "hopper-limits.md"}


def test_the_summary_has_a_command_for_each_of_at_most_40_rows(found):
    rows = [line for line in found[SUMMARY].split("## Summary")[1].split("\n## ")[0].splitlines()
            if line.startswith("| ") and not line.startswith("| quantity")]
    assert 20 < len(rows) <= 40
    assert all(re.search(r"\| `[\w.-]+ (full|as-run)` \|$", row) for row in rows)


def summary_lines(page):
    return page.split("## Summary")[1].split("\n## ")[0].splitlines()


def published_parts(cell):
    """[(value, half a unit of its last digit)] of a cell: '3/2', '0.49; 1.47', '1.00 ± 0.20'."""
    parts = []
    for text in re.sub(r" ± [\d.]+|[°δ ]", "", cell).replace("−", "-").split(";"):
        over, _, under = text.partition("/")
        parts.append((float(over) / float(under or 1), 0.5 * 10.0 ** -len(text.partition(".")[2]) if not under else 1e-12))
    return parts


def wrong_published(templates, pages, rows):
    """The rows of the summary whose published values are not those that their verdicts were made with."""
    wrong = []
    for template, page in zip(templates, pages, strict=True):
        cells, shown = template.split(" | "), re.split(r"(?<!\\) \| ", page)
        if len(cells) < 5 or "<<?" not in cells[-2]:
            continue
        judged = validation_pages.evaluate(validation_pages.INLINE.search(cells[-2])[2], "", rows)
        parts = published_parts(shown[1])
        parts = parts if len(parts) == len(judged) else parts * len(judged)
        for (value, half), one in zip(parts, judged, strict=True):
            if one.row is not None and not abs(value - float(one.row["published"])) <= half * (1 + 1e-6):
                wrong.append(f"{shown[0]}: {value:g} is {one.row['published']}")
    return wrong


def test_published_values_of_the_summary_are_those_of_its_rows(found):
    template = summary_lines((validation_pages.TEMPLATES / (SUMMARY + ".in")).read_text(encoding="utf-8"))
    pages, rows = summary_lines(found[SUMMARY]), validation_pages.Rows(reproduced())
    assert len(pages) > 40 and wrong_published(template, pages, rows) == []
    for old, new in (("Fig. 2a] | 3/2", "Fig. 2a] | 5/2"), ("Fig. 5] | 1/2; −1/2", "Fig. 5] | 1/2; −3/2"), ("3.11a] | 0.37; 0", "3.11a] | 0.37; 1")):
        changed = [line.replace(old, new) for line in pages]
        assert changed != pages and len(wrong_published(template, changed, rows)) == 1, old


@pytest.mark.parametrize("path", sorted(validation_pages.TEMPLATES.glob("*.md.in")), ids=lambda path: path.stem)
def test_numbers_with_errors_come_from_rows(path):
    """A paragraph or table with a number and error that no row has is marked as such."""
    for block in re.split(r"\n\s*\n", path.read_text(encoding="utf-8")):
        if MARK not in block:
            left = validation_pages.INLINE.sub("", block)
            published = re.sub(r"(?:published )?(?:1\.6|3\.4) ± 0\.1|0\.12 ± 0\.03|0\.029 ± 0\.001", "", left)
            assert "±" not in published or "± its scatter" in published, published


def test_fits_with_k_at_its_bound_or_three_widths_have_no_verdict():
    table = reproduced()
    bound = table[table["note"].str.contains("k at its bound")]
    assert len(bound) > 100 and set(bound["agree"]) <= {"no verdict", "no number"}


def test_curves_with_an_exponent_at_the_bound_of_k_have_no_verdict():
    table = reproduced()
    curve = table["quantity"].str.extract(r"^(from Q'?, )?(?:beta at lambda = [^:]+|(lambda_c, (?:free|published) ends|beta, fitted end \(\w+\))): (.*)$")
    key = table["figure"] + "|" + table["level"] + "|" + curve[0].fillna("") + curve[2]
    bound = set(key[table["quantity"].str.contains("beta at lambda") & table["note"].str.contains("k at its bound")])
    of_curves = table[key.isin(bound) & curve[1].notna()]
    assert len(bound) > 20 and len(of_curves) >= 4 * len(bound) and set(of_curves["agree"]) == {"no verdict", "no number"}


# ---- the tables ------------------------------------------------------------------------------------------------------

ROWS = pd.DataFrame([
    {"figure": "H2", "level": "full", "quantity": quantity, "ours": ours, "error": error, "published": "1.5", "published_error": "0",
     "deviation": "1", "agree": agree, "note": note, "table": "hopper/limits", "seeds": "1-3", "cpu_hours": "0.5", "commit": "abcdef0123"}
    for quantity, ours, error, agree, note in (
        ("beta: soft, E_sp = 100", "2.283", "0.038", "no verdict", "k at its bound"), ("beta: soft, E_sp = 1e+06", "1.497", "0.051", "yes", "one clogged"),
        ("chi2/dof: soft, E_sp = 100", "0.12345", "", "no number", ""))])


def test_a_template_becomes_a_page():
    text = """# H
<!-- of: H2 full -->
It is <<{beta: soft, E_sp = 100}>>: <<? {beta: soft, E_sp = 100}>>, <<%.1f {beta: soft, E_sp = 1e+06}>>, <<3 {beta: soft, E_sp = 1e+06}>>.

::: rows H2 full
label: model
β ? := beta: *
χ² := chi2/dof: *
remarks
:::

::: grid H2 full
label: model
E_sp = # := beta: *, E_sp = #
:::
"""
    page = validation_pages.page(text, ROWS)
    assert "It is 2.28 ± 0.04 (k = 0): no verdict, 1.5, 1.497 ± 0.051." in page
    assert "| model | β | within 2 errors | χ² | remarks |" in page
    assert "| soft, E_sp = 100 | 2.28 ± 0.04 (k = 0) | no verdict | 0.123 |  |" in page
    assert "| soft, E_sp = 10⁶ | 1.50 ± 0.05 | **yes** | – | one clogged |" in page
    assert "| soft | 2.28 ± 0.04 (k = 0) | 1.50 ± 0.05 |" in page
    assert "| `H2 full` | `hopper/limits` | 1-3 | 0.5 | abcdef0 |" in page


def test_the_residual_of_as_many_points_as_parameters_is_zero():
    row = {"quantity": "residual of Q with beta free: soft"}
    assert validation_pages.shown(validation_pages.Value(1.9e-16, float("nan"), row=row), 100) == "0"
    assert validation_pages.shown(validation_pages.Value(1.9e-3, float("nan"), row=row), 100) == "0.190"


@pytest.mark.parametrize("of", ("", "from Q, ", "from Q', "))
def test_an_exponent_with_k_at_its_bound_is_marked(of):
    for quantity, marked in (("beta at lambda = 0.01: soft", True), ("C with beta free: soft", False)):
        value = validation_pages.Value(2.0, 0.1, note="k at its bound", row={"quantity": of + quantity})
        assert ("(k = 0)" in validation_pages.shown(value)) == marked, quantity


@pytest.mark.parametrize("text", ["<!-- of: H2 full -->\n<<{beta: hard}>>", "::: rows H2 full\nβ := gamma: *\n:::\n", "::: rows H2 full\nβ = beta: *\n:::\n",
                                  "::: other H2 full\nβ := beta: *\n:::\n", "::: list H3 full\n:::\n"])
def test_a_template_that_names_no_row_is_refused(text):
    with pytest.raises(validation_pages.TemplateError):
        validation_pages.page(text, ROWS)
