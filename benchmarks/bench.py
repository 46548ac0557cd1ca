#!/usr/bin/python3
"""Compares the speed of Pliant with its targets, with LAMMPS and with itself; called by `scripts/bench.sh`.

Writes FOLDER/performance-data/*.csv, FOLDER/images/performance-*.webp and the tables of FOLDER/performance.md."""

import os
import sys

from harness import measure, parser, say, write_csv
from parts import PARTS
from report import FIGURES, block, insert


def loads():
    return " ".join(f"{load:.1f}" for load in os.getloadavg())


def time_parts(context, page, names):
    for name in names:
        say(f"== {name}; load average {loads()}")
        tables, notes = PARTS[name](context)
        # Each part is written when it is done, because a later one may fail.
        for key, contents in tables.items():
            write_csv(page.parent / "performance-data" / f"{key}.csv", contents[0])
            insert(page, {key: block(key, contents, notes)})
            if key in FIGURES:
                picture, _, draw = FIGURES[key]
                draw(contents[0], page.parent / "images" / picture)
        for note in notes:
            say(f"note: {note}")
        if not tables:
            insert(page, {name: f"Not measured: {'; '.join(notes)}."})
    say(f"load average {loads()} at the end")


def main():
    command = parser("bench", __doc__.splitlines()[0], "PART", PARTS, "bench")
    command.add_argument("--repetitions", type=int, help="default: 5, with --quick 1")
    args = command.parse_args()
    if args.repetitions is not None and args.repetitions < 1:
        command.error("--repetitions must be at least 1")
    repetitions = args.repetitions or (1 if args.quick else 5)
    return measure(args, repetitions, "performance.md",
                   lambda context, page: time_parts(context, page, args.only or PARTS))


if __name__ == "__main__":
    sys.exit(main())
