#!/usr/bin/env python3
"""Writes the pages of docs/validation from their templates, scripts/validation_pages/*.md.in, and the measured values in validation/.

  scripts/validation_pages.py            write the pages
  scripts/validation_pages.py --check    exit 1 if a page is not current

A template is Markdown. `<!-- of: FIGURE LEVEL -->` sets the default of the rows that it names from there on. Then:

  <<SPECIFICATION>>      value and error, as pliant/reproduce/rows.py has specifications; several are joined by "to"
  <<%.1f SPECIFICATION>> value alone, in this format
  <<3 SPECIFICATION>>    value and error with so many digits after the point, for values that look equal otherwise
  <<? SPECIFICATION>>    verdict of the row or rows
  <!-- not in reproduced.csv: FILE; FILE -->   end of a passage, or line after a table, whose numbers have no rows

and four kinds of tables, each between ":::" and ":::", an item a line:

  ::: rows FIGURE LEVEL            a line per label, the part of the quantities for which * stands
  label: HEADER
  where: REGULAR EXPRESSION        labels that are shown (default: all of the first column)
  HEADER := QUANTITY with *        a column; {FIGURE LEVEL} before the quantity names other rows. "HEADER ? := ..." has the verdict
                                   in a column after it, "HEADER [%] := ..." percents; "QUANTITY @ WORDS" is the number behind these words in the note
  remarks                          a last column with the notes of the rows

  ::: grid FIGURE LEVEL            a line per label, a column per value of the part for which # stands
  label: HEADER
  where: REGULAR EXPRESSION
  HEADER with # := QUANTITY with # and *

  ::: list FIGURE LEVEL            a line per row: quantity, ours, published, verdict, note
  where: REGULAR EXPRESSION
  otherwise: TEXT                  in place of the table while there are no such rows

  ::: file TABLE [TABLE]           a line per value of a column of validation/TABLE.csv, averaged over seeds
  label: HEADER := COLUMN
  scatter                          errors from the scatter of the seeds alone, without the errors of single runs
  HEADER := COLUMN [pandas query]
"""

import argparse
import re
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "python"))

from pliant import ensemble  # noqa: E402
from pliant.reproduce.figure import VALIDATION  # noqa: E402
from pliant.reproduce.rows import Rows, Value, evaluate, reproduced  # noqa: E402
from pliant.script import with_error  # noqa: E402

TEMPLATES, PAGES = ROOT / "scripts/validation_pages", ROOT / "docs/validation"
#: Verdicts as the pages show them.
VERDICTS = {"yes": "**yes**", "no": "no", "no verdict": "no verdict", "no number": "–", "": "–"}
#: Names of rows as the pages show them, in this order.
SYMBOLS = [(re.compile(a), b) for a, b in (
    (r"\|F_zeta\|/\|F_mu\|", "F_ζ/F_μ"), (r"\|dtheta\|", "Δθ"), (r"\bdr_(?:NA|na)\b", "Δr_NA"), (r"\b[dD]2_min\b", "D²_min"),
    (r"<R>", "⟨R⟩"), (r"chi2", "χ²"), (r"\blambda_c\b", "λ_c"), (r"\blambda\b", "λ"), (r"\bbeta\b", "β"),
    (r"\btheta_w = (\d+)", r"θ_w = \1°"), (r"\btheta_w\b", "θ_w"), (r"\b(\d+)/(\d+) degrees", r"\1°/\2°"),
    (r"\bzeta = ", "ζ/ζ0 = "), (r"\bmu = ", "μ/μ0 = "), (r"\bzeta\b", "ζ"), (r"\bmu\b", "μ"), (r"\bphi_c\b", "φ_c"), (r"\bphi\b", "φ"),
    (r"\bdelta(?=_crit|\b)", "δ"), (r"\^2\b", "²"), (r"\^3\b", "³"), (r"\bsqrt\b", "√"), (r"\binf\b", "∞"))]
#: Notes that other columns show.
SHOWN = re.compile(r"k at its bound|lambda_c (?:lies outside|is known to).*|a step between two lambda|with beta free.*|chi2/dof.*|as many parameters as points|the exponent published.*|\[H 5\] draws.*")
INLINE = re.compile(r"<<(\?|%[\w.]+|\d(?= ))? ?(.*?)>>")
#: Marks the end of a passage without rows: † on the page. After a table the mark is a line of its own, which can name the files.
MARK = re.compile(r" ?<!-- not in reproduced\.csv(?:: (.*?))? -->(\n?)")


class TemplateError(Exception):
    """A template names a row or a table that is not there."""


def _power_of_ten(match):
    power = str(int(match[2])).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return ("" if match[1] == "1" else f"{match[1]}·") + f"10{power}"


def symbols(text):
    """A name of a row with Greek letters, safe in a cell of a table."""
    text = re.sub(r"\b([\d.]+)e([+-]\d+)\b", _power_of_ten, text)
    for pattern, replacement in SYMBOLS:
        text = pattern.sub(replacement, text)
    return text.replace("|", "\\|")


def _digits(value, count):
    """A number with so many significant digits, without a power of ten between 10^-4 and 10^6; whole numbers
    unchanged."""
    if value == round(value) or not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{max(count, len(f'{abs(value):.0f}')) if abs(value) < 1e6 else count}g}"
    return f"{value:.{max(count - 1 - int(np.floor(np.log10(abs(value)))), 0)}f}"


def _exponent_at_bound(value):
    return "k at its bound" in value.note and re.match("(?:from Q'?, )?beta", value.row["quantity"]) is not None


def shown(value, factor=1):
    """'1.50 ± 0.05', with a mark where k is at its bound; '–' for no number. Numbers without an error
    have 3 or 4 digits."""
    if np.isnan(value.value):
        return "–"
    of_lambda_c = value.row is not None and "lambda_c" in value.row["quantity"]  # other rows have its remark, too
    if of_lambda_c and "lies outside the values of" in value.note:
        return "outside the range of λ"
    if of_lambda_c and (known := re.search(r"known to within a factor of ([\d.]+)", value.note)):
        return f"{_digits(value.value, 1)} within a factor of {known[1]}" if float(known[1]) < 100 else "unknown"
    number, error = factor * value.value, factor * value.error
    if error > 0:
        text = with_error(number, error)
    elif value.row is None:
        text = f"{number:.4g}"
    else:
        exact = abs(number) < 1e-10  # the residual of as many points as parameters
        text = "0" if exact else _digits(number, 3 if re.match("chi2|residual", value.row["quantity"]) else 4)
    return text.replace("-", "−") + (" (k = 0)" if _exponent_at_bound(value) else "")


def verdict(values):
    """The verdicts of rows."""
    return "; ".join(VERDICTS[one.agree] for one in values)


def _checked(specification, default, rows):
    try:
        found = evaluate(specification, default, rows)
    except (AssertionError, SyntaxError, TypeError, NameError, AttributeError) as error:
        raise TemplateError(f"'{specification}': {error}") from None
    return [one if isinstance(one, Value) else Value(float(one)) for one in found]


def inline(match, default, rows):
    how, specification = match[1], match[2]
    found = _checked(specification, default, rows)
    if how == "?":
        return verdict(found)
    if how and how.isdigit():
        return "; ".join(f"{one.value:.{how}f} ± {one.error:.{how}f}".replace("-", "−") for one in found)
    return " to ".join((how % one.value).replace("-", "−") if how else shown(one) for one in found)


def dagger(match):
    """What a page shows in place of a MARK."""
    if match.start() > 0:
        return " †" + match[2]
    files = ", ".join(f"`{file}`" for file in match[1].split("; ")) if match[1] else ""
    return f"\n{f'† {files}'.strip()}\n"


def table(headers, lines):
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (headers, ["---"] * len(headers), *lines))


def _items(lines):
    """[(name, text)] of 'label: TEXT', 'where: TEXT', 'otherwise: TEXT', 'remarks', 'scatter' and 'HEADER := TEXT'."""
    found = [re.fullmatch(r"(label|where|otherwise): (.*)|(.+?) := (.*)|(remarks|scatter)", line) for line in lines]
    if None in found:
        raise TemplateError(f"'{lines[found.index(None)]}' is no line of a table")
    return [(one[1] or one[3] or one[5], one[2] or one[4] or "") for one in found]


def _remarks(notes):
    parts = [part for note in notes for part in note.split("; ") if part and not SHOWN.fullmatch(part)]
    return symbols("; ".join(dict.fromkeys(parts)))


def rows_table(default, lines, rows):
    """A table of rows: a column per kind of quantity, a line per label."""
    items = _items(lines)
    settings = {name: text for name, text in items if name in ("label", "where", "remarks")}
    columns = []
    for header, quantity in items:
        if header in settings:
            continue
        own = re.match(r"\{([\w.-]+ [\w-]+)\} (.*)", quantity)
        of, quantity = own.groups() if own else (default, quantity)
        columns.append((header.removesuffix(" ?"), header.endswith(" ?"), of, *quantity.partition(" @ ")[::2]))
    found = []
    for header, judged, of, quantity, words in columns:
        before, star, after = quantity.partition("*")
        if not star:
            raise TemplateError(f"the column '{header}' has no * in '{quantity}'")
        own = rows.of_figure.get(tuple(of.split()), [])
        cells = {row["quantity"][len(before):len(row["quantity"]) - len(after)]: row for row in own
                 if row["quantity"].startswith(before) and row["quantity"].endswith(after)
                 and len(row["quantity"]) > len(before) + len(after)}
        values = {label: rows.one(*of.split(), row["quantity"]) for label, row in cells.items()
                  if re.fullmatch(settings.get("where", ".*"), label)}
        found.append({label: value.noted(words) for label, value in values.items() if words in value.note} if words else values)
    labels = list(found[0]) + [label for one in found[1:] for label in one if label not in found[0] and "where" in settings]
    if not labels:
        raise TemplateError(f"no row of {default} matches the table '{lines[0]}'")
    headers = [settings.get("label", "")]
    for header, judged, *_ in columns:
        headers += [header, "within 2 errors"] if judged else [header]
    result = []
    for label in dict.fromkeys(labels):
        cells, notes = [symbols(label)], []
        for (header, judged, *_), own in zip(columns, found):
            value = own.get(label)
            cells.append(shown(value, 100 if header.endswith("[%]") else 1) if value else "–")
            cells += [verdict([value]) if value else "–"] if judged else []
            notes += [value.note] if value else []
        result.append(cells + ([_remarks(notes)] if "remarks" in settings else []))
    return table(headers + (["remarks"] if "remarks" in settings else []), result)


def grid_table(default, lines, rows):
    """A table of one quantity, a column per value of #, a line per label *."""
    items = _items(lines)
    settings = {name: text for name, text in items if name in ("label", "where")}
    (header, quantity), = (item for item in items if item[0] not in settings)
    pattern = re.escape(quantity).replace(re.escape("#"), "(?P<column>.+?)").replace(re.escape("*"), "(?P<label>.+)")
    cells = {}
    for row in rows.of_figure.get(tuple(default.split()), []):
        found = re.fullmatch(pattern, row["quantity"])
        if found and re.fullmatch(settings.get("where", ".*"), found["label"]):
            cells.setdefault(found["label"], {})[found["column"]] = rows.one(*default.split(), row["quantity"])
    columns = sorted({column for own in cells.values() for column in own}, key=lambda text: tuple(map(float, text.split(" to "))))
    if not cells:
        raise TemplateError(f"no row of {default} matches '{quantity}'")
    return table([settings.get("label", ""), *(symbols(header.replace("#", column)) for column in columns)],
                 [[symbols(label), *(shown(own[column]) if column in own else "" for column in columns)] for label, own in cells.items()])


def list_table(default, lines, rows):
    """A table with a line per row."""
    settings = dict(_items(lines))
    where = settings.get("where", ".*")
    result = []
    for row in rows.of_figure.get(tuple(default.split()), []):
        if re.fullmatch(where, row["quantity"]):
            value = rows.one(*default.split(), row["quantity"])
            known = "–" if np.isnan(value.row["published"]) else shown(value.published)
            result.append([symbols(row["quantity"]), shown(value), known, VERDICTS[value.agree], _remarks([value.note])])
    if not result:
        if "otherwise" in settings:
            return settings["otherwise"]
        raise TemplateError(f"no row of {default} matches '{where}'")
    return table(["quantity", "ours", "published", "within 2 errors", "remarks"], result)


@cache
def _read(name):
    return pd.read_csv(next(iter(sorted(VALIDATION.glob(f"{name}.csv*"))), VALIDATION / f"{name}.csv"))


def file_table(names, lines, _):
    """A table of means over seeds of files of measured values."""
    data, items = pd.concat([_read(name) for name in names.split()], ignore_index=True), _items(lines)
    label, own = items[0][1].split(" := ")
    mean = ensemble.scatter if ("scatter", "") in items else ensemble.average
    columns = []
    for header, text in (item for item in items[1:] if item[0] != "scatter"):
        column, query = re.fullmatch(r"(\S+)(?: \[(.*)\])?", text).groups()
        points = mean(data.query(query) if query else data, [own], column)
        columns.append((header, {key: Value(value, error) for key, value, error in zip(points[own], points[column], points[column + "_error"])}))
    keys = sorted({key for _, one in columns for key in one})
    return table([label, *(header for header, _ in columns)],
                 [[key if isinstance(key, str) else symbols(f"{key:.4g}"), *(shown(one[key]) if key in one else "–" for _, one in columns)] for key in keys])


TABLES = {"rows": rows_table, "grid": grid_table, "list": list_table, "file": file_table}


def runs_table(named):
    """The sources of the rows of a page: tables of runs, seeds, CPU time and commits."""
    kinds = {}
    for row in named:
        kinds.setdefault((row["figure"], row["level"]), row)
    lines = [[f"`{figure} {level}`", ", ".join(f"`{one}`" for one in row["table"].split("; ")), row["seeds"], f"{float(row['cpu_hours']):.2g}",
              ", ".join(one[:7] for one in row["commit"].split("; "))] for (figure, level), row in sorted(kinds.items())]
    return table(["figure, level", "tables of runs, `validation/….csv`", "seeds", "CPU hours", "commits"], lines)


def page(text, csv):
    """A page, from the text of its template and the table reproduced.csv."""
    rows, default, result = Rows(csv), "", []
    blocks = re.split(r"^::: *(.*?)\n(.*?)^:::$\n?", text, flags=re.M | re.S)
    for i in range(0, len(blocks), 3):
        for line in blocks[i].splitlines(keepends=True):
            if of := re.fullmatch(r"<!-- of: (.+) -->\n?", line):
                default = of[1]
            else:
                result.append(MARK.sub(dagger, INLINE.sub(lambda match, of=default: inline(match, of, rows), line)))
        if i + 1 < len(blocks):
            kind, _, of = blocks[i + 1].partition(" ")
            if kind not in TABLES:
                raise TemplateError(f"'::: {blocks[i + 1]}' is no table: {', '.join(TABLES)}")
            result.append(TABLES[kind](of, [line for line in blocks[i + 2].splitlines() if line.strip()], rows) + "\n")
    return "".join(result).rstrip() + "\n\n## Runs behind this page\n\n" + runs_table(rows.named) + "\n"


def pages(templates=TEMPLATES, csv=None):
    """{name of the page: its text}. Raises TemplateError."""
    found = {}
    for path in sorted(templates.glob("*.md.in")):
        try:
            found[path.stem] = page(path.read_text(encoding="utf-8"), reproduced() if csv is None else csv)
        except TemplateError as error:
            raise TemplateError(f"{path.name}: {error}") from None
    return found


def stale(found, folder=PAGES):
    """Names of the pages of a folder that are not as they would be written now."""
    return [name for name, text in found.items()
            if not (folder / name).exists() or (folder / name).read_text(encoding="utf-8") != text]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if a page is not current")
    given = parser.parse_args()
    try:
        found = pages()
    except TemplateError as error:
        print(f"validation_pages.py: error: {error}", file=sys.stderr)
        return 2
    old = stale(found)
    if given.check:
        for name in old:
            print(f"docs/validation/{name} is not current; run scripts/validation_pages.py")
        return 1 if old else 0
    PAGES.mkdir(parents=True, exist_ok=True)
    for name in old:
        (PAGES / name).write_text(found[name], encoding="utf-8")
    print(f"{len(old)} of {len(found)} pages written")
    return 0


if __name__ == "__main__":
    sys.exit(main())
