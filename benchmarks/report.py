"""Tables for the page and figures."""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
from pliant.plotting import ABOVE, COLORS, MARKERS, plt, write_figure  # noqa: E402  (the folder of the package comes first)

from harness import BenchError  # noqa: E402


def cell(value):
    if value is None or value != value:
        return ""
    return f"{value:.3g}" if isinstance(value, float) and abs(value) < 1000 else \
        f"{value:.0f}" if isinstance(value, float) else str(value)


def table(rows, columns):
    """`columns`: keys of the rows, or {key: head}."""
    heads = columns.values() if isinstance(columns, dict) else columns
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(columns) + "|"]
    for row in rows:
        row = dict(row)
        if "min" in row:
            row["min–max"] = f"{cell(row['min'])}–{cell(row['max'])}"
        lines.append("| " + " | ".join(cell(row.get(column)) for column in columns) + " |")
    return "\n".join(lines)


def origin(row):
    return (f"{row['date']}, commit {row['commit']}, {row['compiler']}, {row['machine']}; medians of "
            f"{row['repetitions']} repetition{'s' * (row['repetitions'] > 1)}.")


def block(name, contents, notes):
    """The text between the markers of `name`."""
    rows, columns, *shown = contents
    text = [table(shown[0] if shown else rows, columns), "", origin(rows[0])]
    if name in FIGURES:
        picture, caption, _ = FIGURES[name]
        text += ["", f"![{caption}](images/{picture})"]
    return "\n".join(text + [f"\nNote: {note}." for note in notes])


def insert(page, blocks):
    """Replaces the text between <!-- bench:begin NAME --> and <!-- bench:end NAME --> in the page."""
    text = page.read_text(encoding="utf-8")
    for name, new in blocks.items():
        marked = re.compile(rf"(<!-- bench:begin {name} -->\n).*?(<!-- bench:end {name} -->)", re.S)
        if not marked.search(text):
            raise BenchError(f"{page}: no markers for {name}")
        text = marked.sub(lambda match: f"{match[1]}\n{new}\n\n{match[2]}", text)
    page.write_text(text, encoding="utf-8")


def save(figure, path):
    path.parent.mkdir(parents=True, exist_ok=True)
    write_figure(figure, path)
    plt.close(figure)


def draw_scaling(rows, path):
    figure, axes = plt.subplots(figsize=(4.8, 3.4), layout="constrained")
    for i, case in enumerate(dict.fromkeys(row["case"] for row in rows)):
        mine = [row for row in rows if row["case"] == case]
        middle = [row["median"] for row in mine]
        error = [[m - row["min"] for m, row in zip(middle, mine)], [row["max"] - m for m, row in zip(middle, mine)]]
        axes.errorbar([row["N"] for row in mine], middle, error, color=COLORS[i], marker=MARKERS[i], capsize=2,
                      label=case)
    axes.set(xscale="log", ylim=(0, None), xlabel="particles or vertices", ylabel="ns per particle- or vertex-step")
    axes.legend()
    save(figure, path)


def draw_speedup(rows, path):
    figure, axes = plt.subplots(figsize=(5.4, 4.0), layout="constrained")
    most = max(row["workers"] for row in rows)
    axes.plot([1, most], [1, most], color="0.6", linewidth=0.8, label="ideal")
    cases = list(dict.fromkeys(row["case"] for row in rows))
    for kind, style in (("threads", "-"), ("ranks", "--")):
        for i, case in enumerate(cases):
            mine = [row for row in rows if row["case"] == case and row["run as"].endswith(kind)]
            middle = [row["speed-up"] for row in mine]
            error = [[m - row["5 %"] for m, row in zip(middle, mine)], [row["95 %"] - m for m, row in zip(middle, mine)]]
            line = axes.plot([1] + [row["workers"] for row in mine], [1] + middle, style, color=COLORS[i],
                             marker=MARKERS[i], label=f"{case}, {kind}")[0]
            axes.errorbar([row["workers"] for row in mine], middle, error, fmt="none", color=line.get_color(), capsize=2)
    axes.set(xlabel="threads or ranks", ylabel="speed-up over the serial run", ylim=(0, None),
             xticks=range(1, most + 1))
    axes.legend(**ABOVE | {"ncols": 3})  # inside it would lie over the lines of few workers
    save(figure, path)


#: Table: file, caption, how it is drawn.
FIGURES = {
    "scaling": ("performance-scaling.webp", "Cost of a step against the number of points", draw_scaling),
    "parallel": ("performance-speedup.webp", "Speed-up against threads and ranks", draw_speedup),
}
