#!/usr/bin/python3
"""Disables mechanisms of the program one at a time, and checks that a test fails without each.

  scripts/mutations.py [--seconds S] [WORD …]

tests/mutations.toml has the changes, and the guarantees of docs/reference/reliability.md that depend on each mechanism. The
script works in a clone of the current commit, build-mutations: for each change it builds the tests or the program, runs the test
with and without the change, and writes the result to validation/mutations.csv. The results are: "fails" (as it must), "passes",
"does not build", "fails without the change", "takes too long". WORD: only changes whose file or test contains one of the
words, in this order. --seconds: do not begin another change after this time. Exit code 1 if a result is not "fails".
"""

import argparse
import os
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
TABLE, RESULTS = ROOT / "tests/mutations.toml", ROOT / "validation/mutations.csv"
SOURCE = ROOT / "build-mutations"
BUILD = SOURCE / "build"
COLUMNS = ["guarantee", "file", "text", "change", "test", "result", "commit"]
#: Targets that the tests of the program start or load.
PROGRAMS = ["pliant", "pliant_test_disk", "pliant_test_memory", "pliant_test_handlers"]
LONGEST = 900  # s of a test
NO_TESTS = 5   # exit code of pytest


def mutations():
    """The table as a list of dicts: guarantee, file, text, change, test."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))["mutation"]


def place_and_name(mutation):
    return mutation["test"].split(": ", 1)


def python_file(mutation):
    """Path of a Python test; None for a C++ test. Two folders may have files of the same name."""
    place, name = place_and_name(mutation)
    for folder in ("tests/apps", "python/tests", "tests/python"):
        path = SOURCE / folder / f"{place}.py"
        if path.is_file() and f"def test_{name}" in path.read_text(encoding="utf-8"):
            return path
    return None


def targets(mutation):
    """Targets of the build that the test of a mutation needs."""
    path = python_file(mutation)
    if path is None:
        return [f"test_{place_and_name(mutation)[0]}"]
    if path.parent == SOURCE / "tests/python":
        return [*PROGRAMS, "pliant_python"]
    return [] if path.parent == SOURCE / "python/tests" else PROGRAMS


def command(mutation):
    """Command of the test."""
    place, name = place_and_name(mutation)
    if path := python_file(mutation):
        return [sys.executable, "-B", "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", str(path), "-k", f"test_{name} and not ranks"]
    program = str(BUILD / f"tests/test_{place}")
    if name.endswith(".cpp"):
        return [program, "-#", f"[#{name.removesuffix('.cpp')}]"]
    return [program, name if name.startswith("[") else f"*{name}*"]


def passes(mutation):
    """Whether the test passes; None if it takes too long. Errors: SystemExit if there is no such test."""
    environment = {f"PLIANT_{name}": str(BUILD / path) for name, path in (
        ("PROGRAM", "apps/pliant"), ("TEST_DISK", "tests/libpliant_test_disk.so"), ("TEST_MEMORY", "tests/libpliant_test_memory.so"),
        ("TEST_HANDLERS", "tests/libpliant_test_handlers.so"))}
    if "pliant_python" in targets(mutation):
        environment["PYTHONPATH"] = str(BUILD / "python")
    try:
        done = subprocess.run(command(mutation), cwd=SOURCE, env=os.environ | environment | {"OMP_NUM_THREADS": "1"}, timeout=LONGEST,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", errors="replace")
    except subprocess.TimeoutExpired:
        return None
    if done.returncode == NO_TESTS or "No test cases matched" in done.stdout or "No tests ran" in done.stdout:
        sys.exit(f"mutations.py: error: no test {mutation['test']}")
    return done.returncode == 0


def build(names):
    """Whether the targets could be built."""
    return not names or subprocess.run(["cmake", "--build", BUILD, "--parallel", os.environ.get("JOBS", "2"), "--target", *names],
                                       stdout=subprocess.DEVNULL).returncode == 0


def result(mutation, sound):
    """Result of the test with the change. sound: results of the unchanged tests that are known, by name."""
    path, needed, test = SOURCE / mutation["file"], targets(mutation), mutation["test"]
    original = path.read_text(encoding="utf-8")
    if original.count(mutation["text"]) != 1:
        sys.exit(f"mutations.py: error: {mutation['file']} does not have this text once: {mutation['text']}")
    if test not in sound:
        if not build(needed):
            sys.exit("mutations.py: error: the unchanged program does not build")
        sound[test] = passes(mutation)
    if not sound[test]:
        return "fails without the change"
    path.write_text(original.replace(mutation["text"], mutation["change"]), encoding="utf-8")
    try:
        if not build(needed):
            return "does not build"
        return {True: "passes", False: "fails", None: "takes too long"}[passes(mutation)]
    finally:
        path.write_text(original, encoding="utf-8")


def row(mutation):
    """The entries of a mutation that identify its row in the results."""
    return {name: " ".join(mutation[name].split()) for name in COLUMNS[:5]}


def prepare():
    """Clones or updates the source, and configures a build: settings in the cache of an existing build remain. Returns the commit."""
    def git(*words):
        return subprocess.run(["git", *words], check=True, stdout=subprocess.PIPE, encoding="utf-8").stdout.strip()

    commit = git("-C", ROOT, "rev-parse", "HEAD")
    if not SOURCE.exists():
        git("clone", "-q", "--shared", "--no-checkout", ROOT, SOURCE)
    git("-C", SOURCE, "fetch", "-q", "origin", commit)
    git("-C", SOURCE, "checkout", "-q", "--force", "--detach", commit)
    return commit[:12]


def chosen(words):
    every = mutations()
    if not words:
        return every
    return [m for word in words for m in every if word in m["file"] or word in m["test"]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", metavar="WORD")
    parser.add_argument("--seconds", type=float, default=float("inf"), metavar="S")
    given = parser.parse_args()
    until, commit = time.monotonic() + given.seconds, prepare()
    todo, sound, bad = chosen(given.words), {}, 0
    if any(targets(m) for m in todo):
        subprocess.run(["cmake", "-S", SOURCE, "-B", BUILD, "-G", "Ninja"], check=True, stdout=subprocess.DEVNULL)
    for mutation in todo:
        if time.monotonic() > until:
            break
        found = row(mutation) | {"result": result(mutation, sound), "commit": commit}
        print(f"{mutation['file']}: {mutation['test']}: {found['result']}", flush=True)
        bad += found["result"] != "fails"
        kept = pd.read_csv(RESULTS, dtype=str) if RESULTS.exists() else pd.DataFrame(columns=COLUMNS)
        table = pd.concat([kept, pd.DataFrame([found])]).drop_duplicates(list(row(mutation)), keep="last")
        table.sort_values(["guarantee", "file", "test"])[COLUMNS].to_csv(RESULTS, index=False)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
