"""Runs the rows of a sweep: what became of each, one process per row, stop and go on."""

import ctypes
import dataclasses
import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from functools import cached_property
from pathlib import Path

from .errors import OutputError, RunError
from .files import no_links, write_atomically
from .script import remark
from .sweep_lock import RowLock, Taken, owner

#: `status` in summary.json of runs that have nothing left to do.
FINISHED = ("done", "clogged", "empty")
STOPPED_CODE = 75
# What ends a worker in order. Slurm, terminals and GNU parallel may send several at once; those are one request.
_STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)
# How runs are asked to stop: not with what batch systems send to all processes, as a second signal of one kind kills.
_ASK = signal.SIGUSR1
_LIBC = ctypes.CDLL(None, use_errno=True)
_PR_SET_PDEATHSIG = 1
_RUN_FILES = ("run.h5", "run.xdmf", "summary.json", "checkpoint-a.h5", "checkpoint-b.h5")


@dataclasses.dataclass(frozen=True)
class State:
    """`kind` is done, failed, stopped, running or waiting; `status` is that of the summary where the run is done."""

    kind: str
    status: str
    message: str = ""


class RowFolder:
    """The folder of a row: the run's own files, log.txt, the lock, and row.json with the options it was started with
    and how the last attempt ended."""

    def __init__(self, output, row, base):
        """`base`: the folder that relative names of options files begin from."""
        self.row, self.base = row, Path(base)
        self.path = Path(output) / row.id
        self.lock_path = self.path / "lock"
        self.log_path = self.path / "log.txt"

    def _json(self, name):
        """A JSON object of the folder; empty where it is missing or damaged (a machine that went down)."""
        try:
            value = json.loads((self.path / name).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return value if isinstance(value, dict) else {}

    def _write_record(self, record):
        write_atomically(self.path / "row.json", json.dumps(record, indent=1) + "\n")

    @cached_property
    def _identity(self):
        """What must not change once there is a run: scenario, options, and what is in an options file."""
        identity = {"scenario": self.row.scenario, "options": self.row.options}
        if "options_file" in self.row.options:
            try:
                content = (self.base / self.row.options["options_file"]).read_bytes()
            except OSError as error:
                raise RunError(f"row '{self.row.id}': options_file {error.filename} cannot be read "
                               f"({error.strerror})") from None
            identity["options_file_sha256"] = hashlib.sha256(content).hexdigest()
        return identity

    def check(self):
        """Raises RunError if the folder holds a run with other options than the row's."""
        now, before = self._identity, self._json("row.json").get("run")
        if before == now or not (self.path / "run.h5").exists():
            return
        if before is None:
            raise RunError(f"{self.path}: holds a run that no sweep has made; move it elsewhere")
        old, new = ({"scenario": run["scenario"]} | run["options"] for run in (before, now))
        changes = [f"{name} was {old.get(name, 'not given')} and is {new.get(name, 'not given')}"
                   for name in sorted(old | new) if old.get(name) != new.get(name)]
        raise RunError(f"row '{self.row.id}' (line {self.row.line}) was run with other options: "
                       f"{'; '.join(changes) or 'the options file has changed'}. Give the row another name, or delete "
                       f"{self.path} to run it anew")

    def state(self, mine=False):
        """What became of the row. `mine`: the lock is known to be the caller's."""
        status = self._json("summary.json").get("status")
        if status in FINISHED:
            return State("done", status)
        holder = None if mine else owner(self.lock_path)
        if holder:
            return State("running", "running", f"on {holder}")
        record = self._json("row.json")
        if record.get("run") != self._identity:  # never run; a failure that left no run may have been corrected
            return State("waiting", "waiting")
        code = record.get("exit_code")
        if code is None or code == STOPPED_CODE or -code in _STOP_SIGNALS:
            return State("stopped", "stopped")
        return State("failed", "failed", record.get("message", "summary.json is gone"))

    def start(self, program):
        """(command, changes of the environment) of the next attempt; the lock must be held. Goes on from a checkpoint
        if there is one; what an attempt without one has left is deleted."""
        go_on = any(self.path.glob("checkpoint-[ab].h5"))
        if not go_on:
            for name in _RUN_FILES:
                (self.path / name).unlink(missing_ok=True)
        self._write_record({"run": self._identity})
        command = [str(program), self.row.scenario, *arguments(self.row.options, self.base),
                   "-restart" if go_on else "-output", str(self.path)]
        return command, {"OMP_NUM_THREADS": self.row.options.get("threads", "1")}

    def end(self, code, log_start):
        """Writes down how an attempt has ended; its output begins at `log_start` of log.txt."""
        record = {"run": self._identity, "exit_code": code}
        if code == 0 and self._json("summary.json").get("status") not in FINISHED:
            record["exit_code"] = 1
        if record["exit_code"] != 0:
            record["message"] = f"{self._end_text(code)}: {self._last_error(log_start)}"
        self._write_record(record)

    @staticmethod
    def _end_text(code):
        if code < 0:
            return f"killed by {signal.Signals(-code).name}"
        return f"exit code {code}" if code else "exit code 0 without a result"

    def _last_error(self, start):
        with open(self.log_path, encoding="utf-8", errors="replace") as log:
            log.seek(start)
            lines = [line.strip() for line in log if line.strip()]
        errors = [line for line in lines if "error:" in line]
        return (errors or lines or ["no output"])[-1]


def arguments(options, base):
    """The options as the program takes them; relative names of options files begin from the folder `base`."""
    if "options_file" in options:
        options = options | {"options_file": str(Path(base) / options["options_file"])}
    return [text for name, value in options.items() for text in (f"-{name}", value)]


def _stop_with(parent):
    """A function for the child of the process `parent` to call: when that one ends, however it does, the run is asked to
    stop. It is a process group of its own: Ctrl-C must reach the sweep alone, which then asks every run once; but not a
    session of its own, as Linux may share the machine out by sessions, whatever their niceness."""
    def call():
        os.setpgid(0, 0)
        _LIBC.prctl(_PR_SET_PDEATHSIG, int(_ASK), 0, 0, 0)
        if os.getppid() != parent:  # has ended before
            os._exit(STOPPED_CODE)
    return call


class _Job:
    """A row that runs here."""

    def __init__(self, folder, lock, program):
        self.folder, self.lock = folder, lock
        self.asked = self.killed = False
        self.started = time.monotonic()
        command, needs = folder.start(program)
        with open(folder.log_path, "ab", opener=no_links) as log:
            self._log_start = log.tell()
            self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                                            env=os.environ | needs, pass_fds=[lock.fd], preexec_fn=_stop_with(os.getpid()))
        lock.name(self.process.pid)

    @property
    def seconds(self):
        return time.monotonic() - self.started

    def ended(self):
        self.lock.beat()
        if self.process.poll() is None:
            return False
        if not self.killed:  # else it is as if the machine had gone down: to be run again
            self.folder.end(self.process.returncode, self._log_start)
        self.lock.close()
        return True


class Sweep:
    """Runs rows with a number of workers until none is left or a signal comes. A patient one waits for rows that others
    run, such as those that a killed sweep has left."""

    def __init__(self, folders, program, workers, retry=False, patient=True):
        self._folders, self._program, self._workers = folders, program, workers
        self._retry, self._patient = retry, patient
        self._terminal = sys.stdout.isatty()
        self._jobs, self._seconds, self._taken = [], [], []
        self._stop_at, self._kill, self._shown_at = None, False, 0.0
        self.states = {}

    def run(self):
        """{row id: State} at the end. SIGINT, SIGTERM, SIGHUP and SIGUSR1 have the runs stop with checkpoints; a
        second signal, two seconds later, kills them."""
        heard = [s for s in _STOP_SIGNALS if signal.getsignal(s) != signal.SIG_IGN]  # nohup ignores SIGHUP
        before = {s: signal.signal(s, self._on_signal) for s in heard}
        try:
            self._run()
        finally:
            for job in self._jobs:  # only after an error in here
                if not job.asked:
                    job.process.send_signal(_ASK)
            for s, handler in before.items():
                signal.signal(s, handler)
        return self.states

    def _on_signal(self, *_):
        now = time.monotonic()
        if self._stop_at is None:
            self._stop_at = now
        elif now - self._stop_at > 2:
            self._kill = True

    def _run(self):
        todo = []
        for folder in self._folders:
            state = self.states[folder.row.id] = folder.state()
            if state.kind in ("waiting", "stopped", "running") or (state.kind == "failed" and self._retry):
                todo.append(folder)
            elif len(self._folders) == 1:  # a task of an array says what it found
                self._report(folder, state)
        todo.reverse()
        while self._jobs or ((todo or self._taken) and self._stop_at is None):
            free = [folder for folder in self._taken if owner(folder.lock_path) is None]
            self._taken = [folder for folder in self._taken if folder not in free]
            todo.extend(free)
            while todo and len(self._jobs) < self._workers and self._stop_at is None:
                self._begin(todo.pop())
            for job in [job for job in self._jobs if job.ended()]:
                self._jobs.remove(job)
                state = job.folder.state(mine=True)
                if state.kind == "done":
                    self._seconds.append(job.seconds)
                self._report(job.folder, state)
            self._ask_to_stop()
            self._progress()
            if self._jobs or self._taken:
                time.sleep(0.05)
        self._clear_line()

    def _begin(self, folder):
        try:
            folder.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{folder.path}: cannot be made ({error.strerror})") from None
        try:
            lock = RowLock(folder.lock_path)
        except Taken as taken:
            self._report(folder, State("running", "running", f"on {taken}"))
            if self._patient:
                self._taken.append(folder)
            return
        state = self.states[folder.row.id] = folder.state(mine=True)
        if state.kind == "done" or (state.kind == "failed" and not self._retry):  # another worker was here meanwhile
            lock.close()
            return self._report(folder, state)
        try:
            self._jobs.append(_Job(folder, lock, self._program))
        except OSError as error:
            raise OutputError(f"row '{folder.row.id}' cannot be started ({error.filename}: {error.strerror})") from None
        finally:
            if not self._jobs or self._jobs[-1].lock is not lock:
                lock.close()
        self.states[folder.row.id] = State("running", "running")

    def _report(self, folder, state):
        self.states[folder.row.id] = state
        self._clear_line()
        remark(row_text(folder.row, state))

    def _ask_to_stop(self):
        if self._stop_at is None:
            return
        for job in self._jobs:
            if self._kill:
                job.killed = True
                job.process.kill()
            elif not job.asked:
                job.process.send_signal(_ASK)
                job.asked = True

    def _progress(self):
        if not self._terminal or time.monotonic() - self._shown_at < 0.5:
            return
        self._shown_at = time.monotonic()
        line = count_text(self.states.values())
        if self._stop_at is not None:
            line = "stopping: " + line
        elif self._seconds:
            line += f", ETA {duration_text(self._left_seconds())}"
        self._clear_line()
        print(line, end="", flush=True)

    def _left_seconds(self):
        mean = sum(self._seconds) / len(self._seconds)
        waiting = sum(state.kind in ("waiting", "stopped") for state in self.states.values())
        return (waiting * mean + sum(max(mean - job.seconds, 0) for job in self._jobs)) / self._workers

    def _clear_line(self):
        if self._terminal:
            print("\r\033[K", end="", flush=True)


def row_text(row, state):
    """'row 3 (hopper_width=4): failed: exit code 3: …'."""
    return f"row {row.number} ({row.id}): {state.status}" + (f": {state.message}" if state.message else "")


def count_text(states):
    """'done 3/20, running 2, failed 1, waiting 14' of States; stopped ones where there are some."""
    kinds = [state.kind for state in states]
    parts = [f"done {kinds.count('done')}/{len(kinds)}"]
    parts += [f"{kind} {kinds.count(kind)}" for kind in ("running", "failed")]
    if "stopped" in kinds:
        parts.append(f"stopped {kinds.count('stopped')}")
    return ", ".join([*parts, f"waiting {kinds.count('waiting')}"])


def duration_text(seconds):
    """'35 s', '12 min', '1 h 02 min'."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"
