"""Command lines, running programs and collecting their cost: shared by the suite and the study of integrators."""

import argparse
import csv
import datetime
import json
import math
import os
import platform
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


class BenchError(Exception):
    """One line: the command that failed, and its message."""


class Unsupported(BenchError):
    """A case that this machine or this program cannot run; the message is the reason."""


@dataclass(frozen=True)
class Finished:
    """A process that has ended well."""

    output: str
    cpu: float      #: s, user and system, of all its threads
    wall: float     #: s
    peak_kb: int    #: largest resident set


def run(command, timeout=7200, cwd=None, env=None):
    """Runs a command to its end; raises BenchError if it fails or takes longer than `timeout` seconds."""
    command = [str(word) for word in command]
    with tempfile.TemporaryFile("w+", encoding="utf-8") as output:
        start = time.monotonic()
        # A separate session, so that its child processes can be ended with it.
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, cwd=cwd,
                                   env=env, start_new_session=True)
        ended = threading.Event()
        peak = _Peak(process.pid, ended)
        alarm = threading.Timer(timeout, os.killpg, (process.pid, signal.SIGKILL))
        peak.start()
        alarm.start()
        try:
            _, status, usage = os.wait4(process.pid, 0)
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            raise
        finally:
            wall = time.monotonic() - start
            alarm.cancel()
            ended.set()
            peak.join()
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        text = output.read()
    if process.returncode != 0:
        lines = [line for line in text.splitlines() if line.strip()] or ["no message"]
        said = next((line for line in lines if "error" in line.lower()), lines[-1])
        if wall >= timeout:
            said = f"stopped after {timeout:g} s"
        raise BenchError(f"exit code {process.returncode}: {said.strip()} ({' '.join(command)})")
    return Finished(text, usage.ru_utime + usage.ru_stime, wall, peak.kb)


class _Peak(threading.Thread):
    """Follows the largest resident set of a process. (The value of wait4 includes this program, before the exec.)"""

    def __init__(self, pid, ended):
        super().__init__(daemon=True)
        self.status, self.ended, self.kb = Path(f"/proc/{pid}/status"), ended, 0

    def run(self):
        while not self.ended.wait(0.02):
            try:
                found = re.search(r"VmHWM:\s+(\d+)", self.status.read_text(encoding="utf-8"))
            except OSError:
                return
            if found:
                self.kb = int(found[1])


class Program:
    """The program to be timed, and its abilities."""

    def __init__(self, build, cpu):
        self.path = build / "apps/pliant"
        self.kernels = build / "benchmarks/pliant_benchmarks"
        self.speedup = build / "benchmarks/pliant_speedup"
        self.pin = ["taskset", "-c", str(cpu)]
        if not self.path.is_file():
            raise BenchError(f"{self.path} is not there; build it first (scripts/bench.sh does)")
        self.version = [line for line in run([self.path, "-version"]).output.splitlines() if line]
        self._help = run([self.path, "hopper", "-help"]).output

    def has_option(self, name):
        return f"  {name} " in self._help

    def hopper(self, options, output):
        """One run, on one core: (summary.json, Finished)."""
        return self.start("hopper", options, output)

    def start(self, scenario, options, output):
        """As `hopper`, for any scenario."""
        done = run([*self.pin, self.path, scenario, *options.split(), "-output", output])
        return json.loads((output / "summary.json").read_text(encoding="utf-8")), done

    def restart(self, folder, t_end):
        done = run([*self.pin, self.path, "hopper", "-restart", folder, "-t_end", f"{t_end:.9g}"])
        return json.loads((folder / "summary.json").read_text(encoding="utf-8")), done

    def about(self, label):
        """The text after `label` in the output of -version, e.g. commit."""
        for line in self.version:
            if line.startswith(label + " "):
                return line[len(label) + 1:]
        return "unknown"


def cpu_model():
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown"


@dataclass(frozen=True)
class Context:
    """The arguments of all parts."""

    program: Program
    scratch: Path        #: for runs; removed in the end
    repetitions: int
    quick: bool

    @property
    def origin(self):
        """Columns that every row ends with."""
        return {"repetitions": self.repetitions, "date": datetime.date.today().isoformat(),
                "commit": self.program.about("commit"), "compiler": self.program.about("compiler"),
                "machine": f"{cpu_model()}, {os.cpu_count()} cores"}

    def folder(self, name):
        """An empty place for a run."""
        path = self.scratch / name
        if path.exists():
            shutil.rmtree(path)
        return path


def parser(name, description, part, parts, quick_folder):
    """An ArgumentParser for --build, --only (a `part`, one of `parts`), --quick, --output and --cpu. `quick_folder` is
    the file in the build folder that --quick writes."""
    result = argparse.ArgumentParser(prog=f"{name}.sh", description=description)
    result.add_argument("--build", type=Path, default=ROOT / "build", help="build folder (default: build)")
    result.add_argument("--only", action="append", choices=list(parts), metavar=part,
                        help=f"one of {', '.join(parts)}; may be repeated (default: all)")
    result.add_argument("--quick", action="store_true", help="small and short, to test this itself; writes to "
                                                             f"BUILD/{quick_folder} unless --output is given")
    result.add_argument("--output", type=Path, metavar="FOLDER", help="default: docs")
    result.add_argument("--cpu", type=int, default=max(os.sched_getaffinity(0)), help="core of the serial runs")
    result.set_defaults(quick_folder=quick_folder)
    return result


def measure(arguments, repetitions, page, work):
    """Calls work(context, path of `page` in the folder of output), the page being a copy of that in docs at first, and
    returns the exit code; a BenchError becomes one line on stderr."""
    output = arguments.output or (arguments.build / arguments.quick_folder if arguments.quick else ROOT / "docs")
    try:
        program = Program(arguments.build, arguments.cpu)
        if not (output / page).exists():
            (output / page).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / "docs" / page, output / page)
        say("; ".join(program.version))
        with tempfile.TemporaryDirectory(prefix="pliant-bench-") as scratch:
            work(Context(program, Path(scratch), repetitions, arguments.quick), output / page)
        say(f"written to {output}")
    except BenchError as error:
        print(f"{Path(sys.argv[0]).name}: error: {error}", file=sys.stderr)
        return 1
    return 0


def interleave(jobs, repetitions, label):
    """{name: [results]} of jobs {name: callable}: all run once before any runs again, so that a disturbance of the
    machine hits them alike. A job that raises Unsupported is left out altogether; its reason is in the second dict."""
    results, reasons = {name: [] for name in jobs}, {}
    for repetition in range(repetitions):
        for name, job in jobs.items():
            if name in reasons:
                continue
            shown = name if isinstance(name, str) else ", ".join(map(str, name))
            say(f"{label}: {shown} ({repetition + 1}/{repetitions})")
            try:
                results[name].append(job(repetition))
            except Unsupported as reason:
                reasons[name] = str(reason)
                del results[name]
    return results, reasons


def spread(values):
    """Columns median, min, max."""
    return {"median": statistics.median(values), "min": min(values), "max": max(values)}


def say(text):
    print(text, file=sys.stderr, flush=True)


def rounded(value):
    """Four significant digits for floats; other values unchanged."""
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.4g}"
    return "" if value is None else str(value)


def write_csv(path, rows):
    path.parent.mkdir(parents=True, exist_ok=True)
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows({name: rounded(value) for name, value in row.items()} for row in rows)


def read_csv(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(row for row in file if not row.startswith("#")))
