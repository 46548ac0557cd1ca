#!/usr/bin/python3
"""Times Pliant beside its targets, LAMMPS and itself; `scripts/bench.sh` builds what it needs and calls it.

Writes FOLDER/performance-data/*.csv, FOLDER/images/performance-*.png and the tables of FOLDER/performance.md."""

import argparse
import os
import shutil
import sys
import tempfile
from pathlib import Path

from harness import BenchError, Context, Program, say, write_csv
from parts import PARTS
from report import FIGURES, block, insert

ROOT = Path(__file__).resolve().parents[1]


def loads():
    return " ".join(f"{load:.1f}" for load in os.getloadavg())


def main():
    parser = argparse.ArgumentParser(prog="bench.sh", description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=Path, default=ROOT / "build", help="build folder (default: build)")
    parser.add_argument("--only", action="append", choices=list(PARTS), metavar="PART",
                        help=f"one of {', '.join(PARTS)}; may be repeated (default: all)")
    parser.add_argument("--repetitions", type=int, help="default: 5, with --quick 1")
    parser.add_argument("--quick", action="store_true",
                        help="small and short, to test the suite itself; writes to BUILD/bench unless --output is given")
    parser.add_argument("--output", type=Path, metavar="FOLDER", help="default: docs")
    parser.add_argument("--cpu", type=int, default=max(os.sched_getaffinity(0)), help="core of the serial runs")
    args = parser.parse_args()
    if args.repetitions is not None and args.repetitions < 1:
        parser.error("--repetitions must be at least 1")
    output = args.output or (args.build / "bench" if args.quick else ROOT / "docs")
    repetitions = args.repetitions or (1 if args.quick else 5)
    page = output / "performance.md"
    try:
        program = Program(args.build, args.cpu)
        output.mkdir(parents=True, exist_ok=True)
        if not page.exists():
            shutil.copy(ROOT / "docs/performance.md", page)
        say("; ".join(program.version))
        with tempfile.TemporaryDirectory(prefix="pliant-bench-") as scratch:
            context = Context(program, Path(scratch), repetitions, args.quick)
            for name in args.only or PARTS:
                say(f"== {name}; load average {loads()}")
                tables, notes = PARTS[name](context)
                # Each part is written when it is done: what comes after it may fail.
                for key, contents in tables.items():
                    write_csv(output / "performance-data" / f"{key}.csv", contents[0])
                    insert(page, {key: block(key, contents, notes)})
                    if key in FIGURES:
                        picture, _, draw = FIGURES[key]
                        draw(contents[0], output / "images" / picture)
                for note in notes:
                    say(f"note: {note}")
                if not tables:
                    insert(page, {name: f"Not measured: {'; '.join(notes)}."})
        say(f"load average {loads()} at the end; written to {output}")
    except BenchError as error:
        print(f"bench.py: error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
