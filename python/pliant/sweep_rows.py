"""The rows of a sweep: a CSV table of options, one run per row."""

import csv
import hashlib
import math
import re
from dataclasses import dataclass
from pathlib import Path

from .errors import RunError
from .files import open_regular

# Columns that are not options.
_OWN = ("name", "scenario", "seeds")
# Options that the sweep itself sets, or that make no run.
_REFUSED = ("output", "restart", "help", "version", "ensemble", "ensemble_over", "ensemble_workers")
_INTEGER = re.compile(r"[+-]?[0-9]+")
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_CONTROL = re.compile("[\0-\x1f\x7f-\x9f\ud800-\udfff]")
# As the program distinguishes names of options from values.
_OPTION = re.compile(r"--?(?!(inf|infinity|nan)$)[A-Za-z]", re.IGNORECASE)
_LONGEST_NUMBER = 100  # characters
_LONGEST_ID = 200  # characters; a longer name made from options is shortened
_LONGEST_NAME = 255  # bytes; the limit of most file systems
#: Files next to the folders of the rows, written by the sweep and by pliant-report.
_FILES = re.compile(r"results\.csv|units\.csv|report\.html|slurm\.sh|slurm-[0-9]+\.log")


@dataclass(frozen=True)
class Row:
    """One run. Rows are equal runs if scenario and options are."""

    number: int    #: 1, 2, … over the expanded table
    line: int      #: of the table, for messages
    scenario: str
    options: dict  #: option name → value as text; numbers in one spelling
    id: str        #: name of the run's folder


def is_number(text):
    return _NUMBER.fullmatch(text) is not None and math.isfinite(float(text))


def canonical(text):
    """One spelling per number, so that a spreadsheet that writes 4 for 4.0 does not create another row; other text is
    unchanged."""
    text = text.strip()
    if _NUMBER.fullmatch(text) and len(text) > _LONGEST_NUMBER:
        raise ValueError(f"a number of {len(text)} characters; the limit is {_LONGEST_NUMBER}")
    if _INTEGER.fullmatch(text):
        return str(int(text))
    if not is_number(text):
        return text
    value = float(text)
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)


def number(text):
    """The value as int or float, or as text if it is not a number."""
    if not is_number(text):
        return text
    return int(text) if _INTEGER.fullmatch(text) else float(text)


def expand_seeds(text):
    """'1-20' or '1,2,5', or both mixed, as a list. Raises ValueError with the fault."""
    seeds = []
    for part in text.split(","):
        found = re.fullmatch(r"\s*([0-9]{1,19})\s*(?:-\s*([0-9]{1,19})\s*)?", part)
        if not found:
            raise ValueError(f"'{part.strip()[:50]}' is neither a seed nor a range like 1-20")
        first, last = int(found[1]), int(found[2] or found[1])
        if last < first:
            raise ValueError(f"the range {part.strip()} ends before it starts")
        if last - first > 100_000:
            raise ValueError(f"the range {part.strip()} has more than 100000 seeds")
        seeds.extend(range(first, last + 1))
    repeated = next((s for s in seeds if seeds.count(s) > 1), None) if len(set(seeds)) < len(seeds) else None
    if repeated is not None:
        raise ValueError(f"seed {repeated} occurs twice")
    return seeds


def _derived_id(scenario, default, options):
    """A readable name that depends on nothing but the row's own options."""
    order = sorted(options, key=lambda name: (name == "seed", name))
    parts = ([] if scenario == default else [scenario]) + [f"{name}={options[name]}" for name in order]
    exact = ",".join(parts) or "defaults"
    clean = re.sub(r"[^A-Za-z0-9._+=,-]", "_", exact)
    if clean == exact and len(exact) <= _LONGEST_ID:
        return exact
    return f"{clean[:_LONGEST_ID - 9]}-{hashlib.sha256(exact.encode()).hexdigest()[:8]}"


def _lines(path):
    """(line number, cells) of every row but comments and empty lines."""
    try:
        with open(path, newline="", encoding="utf-8-sig", opener=open_regular) as file:
            reader = csv.reader(file, strict=True)
            for cells in reader:
                cells = [cell.strip() for cell in cells]
                if any(cells) and not cells[0].startswith("#"):
                    _check_text(path, reader.line_num, cells)
                    yield reader.line_num, cells
    except FileNotFoundError:
        raise RunError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RunError(f"{path}: cannot be read as a table ({error})") from None


def _check_text(path, line, cells):
    for i, cell in enumerate(cells, 1):
        if found := _CONTROL.search(cell):
            raise RunError(f"{path}, line {line}, column {i}: has the control character {ascii(found[0])}; remove it")


def _check_header(path, columns):
    if len(columns) == 1 and ";" in columns[0]:
        raise RunError(f"{path}: columns are separated by commas, not by semicolons")
    for i, column in enumerate(columns, 1):
        where = f"{path}, column {i}"
        if not column:
            raise RunError(f"{where}: has no name")
        if columns.count(column) > 1:
            raise RunError(f"{where}: there are two columns '{column}'")
        if column in _REFUSED:
            raise RunError(f"{where}: '{column}' cannot be given in a table")
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", column):
            raise RunError(f"{where}: '{column}' is not the name of an option (write it without the dash)")


def read_rows(path, scenario):
    """List of Row from a CSV file: columns are names of options without the dash (empty cells: not given), and
    `scenario` (the default is for rows without this cell), `name`, and `seeds`, which makes one row of each seed. Lines
    that begin with # are comments. Raises RunError that names line and column."""
    path, default = Path(path), scenario
    lines = _lines(path)
    _, columns = next(lines, (0, []))
    if not columns:
        raise RunError(f"{path}: the table is empty (it needs a line with the names of the columns)")
    _check_header(path, columns)

    rows, lines_of = [], {}
    for line, cells in lines:
        where = f"{path}, line {line}"
        if len(cells) > len(columns):
            raise RunError(f"{where}: {len(cells)} cells for {len(columns)} columns (write lists in quotes: \"1,2,5\")")
        if len(cells) < len(columns):
            raise RunError(f"{where}: {len(cells)} cell{'s' * (len(cells) > 1)} for {len(columns)} columns (an empty cell needs its comma too: a,,b)")
        given = {column: cell for column, cell in zip(columns, cells) if cell}
        own = {column: given.pop(column) for column in _OWN if column in given}
        scenario, name = own.get("scenario", default), own.get("name")
        if not re.fullmatch(r"[A-Za-z0-9_]+", scenario):
            raise RunError(f"{where}, column 'scenario': '{scenario}' is not the name of a scenario")
        if name is not None and not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9._+=-]*", name):
            raise RunError(f"{where}, column 'name': '{name}' cannot name a folder (letters, digits and . _ + = -)")
        options = {}
        for column, cell in sorted(given.items()):
            if _OPTION.match(cell):
                raise RunError(f"{where}, column '{column}': '{cell}' is the name of an option, not a value; write a value")
            try:
                options[column] = canonical(cell)
            except ValueError as error:
                raise RunError(f"{where}, column '{column}': {error}") from None
        variants = [options]
        if "seeds" in own:
            if "seed" in options:
                raise RunError(f"{where}: has a seed and seeds; leave one of them empty")
            try:
                variants = [options | {"seed": str(seed)} for seed in expand_seeds(own["seeds"])]
            except ValueError as error:
                raise RunError(f"{where}, column 'seeds': {error}") from None
        for variant in variants:
            row_id = _derived_id(scenario, default, variant) if name is None else name
            if name is not None and "seeds" in own:
                row_id += f",seed={variant['seed']}"
            if _FILES.fullmatch(row_id):
                raise RunError(f"{where}, column 'name': '{row_id}' is the name of a file of the sweep; write another one")
            if len(row_id) > _LONGEST_NAME:
                raise RunError(f"{where}, column 'name': '{row_id[:50]}…' makes a name of {len(row_id)} characters; the limit is "
                               f"{_LONGEST_NAME}")
            if row_id in lines_of:
                raise RunError(f"{where}: the row '{row_id}' is there already, in line {lines_of[row_id]}")
            lines_of[row_id] = line
            rows.append(Row(len(rows) + 1, line, scenario, variant, row_id))
    if not rows:
        raise RunError(f"{path}: the table has no rows")
    return rows
