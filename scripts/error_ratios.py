#!/usr/bin/python3
"""Compares the errors of single runs with the scatter between seeds, for the kept results: scripts/error_ratios.py

Each quantity in a table of validation/measured that has a column QUANTITY_error, and each group of at least three runs that
differ only in the seed, has the ratio (variance between the seeds) / (mean square of the errors). Groups with a run at rest
(clogged, or Q = 0) are omitted. Prints the table in docs/validation/single-runs.md: the root of the mean ratio, and the root
of the median ratio relative to the median for correct errors of normally distributed values. Both are 1 for correct errors;
a few groups whose runs differ in kind alter only the first.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import chi2

ROOT = Path(__file__).resolve().parents[1]
MEASURED = ROOT / "validation/measured"
PARAMETERS = ["dim", "model", "mu", "zeta", "e_sp", "e_c", "k_l", "k_b", "hopper_angle", "hopper_angle_left", "hopper_width", "n",
              "height", "radius", "distance", "relative", "neighbours"]


def quantities(table):
    return [name[:-6] for name in table if name.endswith("_error") and name[:-6] in table]


def ratios(table):
    """[(quantity, variance between seeds / mean square error, runs)] of a table of results."""
    options = table["row"].str.replace(r"(^|,)(seed=\d+|r-[0-9a-f]+)", "", regex=True)
    found = []
    for _, group in table.groupby(options.str.cat([table[name].astype(str) for name in PARAMETERS if name in table], ";")):
        at_rest = ("status" in group and (group["status"] == "clogged").any()) or ("Q" in group and (group["Q"] == 0).any())
        for name in [] if at_rest else quantities(table):
            known = group[np.isfinite(group[name]) & (group[name + "_error"] > 0)]
            if len(known) > 2:
                found.append((name, known[name].var() / (known[name + "_error"] ** 2).mean(), len(known)))
    return found


def summary(folder=MEASURED, pattern="*/*.csv.xz"):
    """One row per kind of table and quantity: mean (root of the mean ratio), typical, groups, runs."""
    found = []
    for path in sorted(folder.glob(pattern)):
        kind = path.name.split(".")[-3]
        found += [(kind, *one) for one in ratios(pd.read_csv(path))]
    rows = []
    for (kind, name), part in pd.DataFrame(found, columns=["kind", "quantity", "ratio", "runs"]).groupby(["kind", "quantity"]):
        free = part["runs"] - 1
        rows.append((kind, name, np.sqrt(np.average(part["ratio"], weights=free)),
                     np.sqrt(np.median(part["ratio"] * free / chi2.median(free))), len(part), part["runs"].sum()))
    return pd.DataFrame(rows, columns=["kind", "quantity", "mean", "typical", "groups", "runs"])


def lines(table):
    """The rows of the table in Markdown."""
    return ["| MEASURE | quantity | scatter / error, root mean square | typical | groups | runs |", "|---|---|---|---|---|---|",
            *(f"| `{r.kind}` | `{r.quantity}` | {r.mean:.2f} | {r.typical:.2f} | {r.groups} | {r.runs} |" for r in table.itertuples())]


if __name__ == "__main__":
    sys.stdout.write("\n".join(lines(summary())) + "\n")
