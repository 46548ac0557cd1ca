"""Runs the rows of a sweep, one process per row or per ensemble of rows: status, stop and resume."""

import contextlib
import ctypes
import dataclasses
import functools
import hashlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from functools import cached_property
from pathlib import Path

from .errors import OutputError, RunError
from .files import no_links, open_regular, read_bytes, read_json, write_json
from .follow import holder
from .script import remark
from .sweep_ensembles import FOLDER, EnsembleFolder, consecutive
from .sweep_rows import is_number

#: `status` in summary.json of runs that have nothing left to do.
FINISHED = ("done", "clogged", "at_rest", "empty", "jammed")
STOPPED_CODE = 75
IN_USE_CODE = 6  #: another process runs in the folder, or in the folder of the run to branch from
IN_USE_PAUSE = 1  #: s until a row is tried again whose folder was in use
# Signals that end a worker in order. Slurm, terminals and GNU parallel may send several at once; those are one request.
_STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)
# Signal that stops a run; batch systems do not send it to all processes, which matters because a second equal signal
# kills.
_ASK = signal.SIGUSR1
_LIBC = ctypes.CDLL(None, use_errno=True)
_PR_SET_PDEATHSIG = 1
#: Options whose larger value makes a run longer, with the entry of the summary that has reached it; a run cannot be made shorter.
_LENGTHS = {"t_end": "t", "pushes": "pushes"}
#: Options of rows that do not run in an ensemble: they would be options of all runs together.
_ALONE = ("threads", "max_wall_time")
_LARGEST_OPTIONS = 1 << 16  # bytes of an options file that the program reads
#: Options whose value names an input file; `-obstacle` may name several.
_FILE_OPTIONS = ("start", "outline", "mesh", "shape_outline")
_FILE = "file "  # before the name of an input file among changed options
# Time between two checks of a running ensemble: at least this, in s, and so many times the time of a check.
_LEAST_PAUSE, _PATIENCE = 1.0, 20


@dataclasses.dataclass(frozen=True)
class State:
    """`kind` is done, failed, stopped, running or waiting; `status` is the status in the summary if the run is done."""

    kind: str
    status: str
    message: str = ""


@functools.cache
def restart_rules(program, scenario):
    """{option: "may change", "fixed" or "not kept"}: its rule on restart, from the program's table."""
    text = subprocess.run([program, scenario, "-help_markdown"], encoding="utf-8", errors="replace", capture_output=True,
                          stdin=subprocess.DEVNULL, env=os.environ | {"OMP_NUM_THREADS": "1"}).stdout
    rules, at = {}, None
    for line in text.splitlines():
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)]
        if "on restart" in cells:
            at = cells.index("on restart")
        elif at is not None and len(cells) > at and cells[1].startswith("`-"):
            rules[cells[1].strip("`-")] = cells[at]
    return rules


class RowFolder:
    """The folder of a row: the run's own files, log.txt, and row.json with the options it was started with and how the
    last attempt ended. The program locks the folder while it runs there. A row of an ensemble has the name of the ensemble's
    folder in row.json, no checkpoints, and its files once its run has ended."""

    slots = 1  #: runs at a time

    def __init__(self, output, row, base, program=None):
        """`base`: the folder that relative names of files begin from. `program` lists which options a restart may change;
        without one, none."""
        self.row, self.base, self._program = row, Path(base).absolute(), program
        self.path = Path(output).absolute() / row.id
        self.log_path = self.path / "log.txt"

    @property
    def rows(self):
        """The rows that run together: this one."""
        return [self]

    @property
    def environment(self):
        """Changes of the environment of the program."""
        return {"OMP_NUM_THREADS": self.row.options.get("threads", "1")}

    def rows_of(self, ensemble):
        """The rows of this sweep, also of earlier tables, that are in an ensemble, as they were when it started."""
        found = []
        for file in self.path.parent.glob("*/row.json"):
            row = RowFolder(self.path.parent, dataclasses.replace(self.row, id=file.parent.name), self.base)
            with contextlib.suppress(RunError):  # the row reports it
                if row.ensemble() == ensemble:
                    row._identity = row._record()["run"]
                    row.row = dataclasses.replace(row.row, options=row._identity["options"])
                    found.append(row)
        return found

    def _summary(self):
        """Content of summary.json; empty without one. Raises RunError."""
        return read_json(self.path / "summary.json") or {}

    def _record(self):
        """The content of row.json; empty if there is none. Raises RunError."""
        path = self.path / "row.json"
        record = read_json(path) or {}
        run = record.get("run")
        if not (run is None or (isinstance(run, dict) and isinstance(run.get("scenario"), str) and _is_text(run.get("options")))
                ) or not isinstance((run or {}).get("files_sha256", {}), dict) or not isinstance(record.get("exit_code"), (int, type(None))) or not isinstance(record.get("message", ""), str
                ) or not _is_name(record.get("ensemble", "name")):
            raise RunError(f"{path}: is not a record of a sweep; restore it from a backup, or delete {self.path} to run the row again")
        return record

    def ensemble(self):
        """The folder of the ensemble of the row's last attempt, which may be gone; None if the row ran alone. Raises RunError."""
        name = self._record().get("ensemble")
        return None if name is None else self.path.parent / FOLDER / name

    def awaits_ensemble(self):
        """Whether the row is in an ensemble whose run of this row has not been given to it."""
        record = self._record()
        return "ensemble" in record and "exit_code" not in record

    def hand_over(self):
        """Rows that have ended while others of their ensemble run: none."""
        return []

    def _write_record(self, record):
        write_json(self.path / "row.json", record)

    @cached_property
    def _identity(self):
        """The settings that must not change once a run exists: scenario, options, and the contents of input files (null: of
        files that cannot be read)."""
        identity = {"scenario": self.row.scenario, "options": self.row.options}
        files = {name: _checksum(self.base / name) for name in input_files(self.row.options)}
        if "options_file" in self.row.options:
            path = self.base / self.row.options["options_file"]
            try:
                content = read_bytes(path, _LARGEST_OPTIONS)
            except RunError as error:
                raise RunError(f"row '{self.row.id}': options_file {error}") from None
            if content is None:
                raise RunError(f"row '{self.row.id}': options_file {path} cannot be read (No such file or directory)")
            files[self.row.options["options_file"]] = hashlib.sha256(content).hexdigest()
        return identity | ({"files_sha256": files} if files else {})

    def _changes(self, before):
        """{option or file: (old, new)} of the row against an earlier run; None: not given, or a file that cannot be read. Options
        that are not kept on restart do not count, nor do files without a checksum in row.json."""
        old, new = ({"scenario": run["scenario"]} | run["options"] for run in (before, self._identity))
        changed = {name: (old.get(name), new.get(name)) for name in sorted(old | new) if old.get(name) != new.get(name)}
        old, new = _checksums(before), _checksums(self._identity)
        return ({name: both for name, both in changed.items() if self._rule(name) != "not kept"}
                | {_FILE + name: (old[name], new[name]) for name in old if name in new and old[name] != new[name]})

    def _rule(self, name):
        return restart_rules(self._program, self.row.scenario).get(name) if self._program else None

    def _extends(self, changes):
        """Whether a restart can make all the changes."""
        return all(new is not None and self._rule(name) == "may change"
                   and not (name in _LENGTHS and old is not None and not _at_least(new, old))
                   for name, (old, new) in changes.items())

    def check(self):
        """Raises RunError if the folder holds a run with other options than the row's, which no restart can make of it."""
        before, identity = self._record().get("run"), self._identity
        if not (self.path / "run.h5").exists():
            return
        if before is None:
            raise RunError(f"{self.path}: holds a run that pliant-sweep has not made; move it elsewhere")
        row = f"row '{self.row.id}' (line {self.row.line})"
        changes = self._changes(before) if before != identity else {}
        if not self._extends(changes):
            raise RunError(f"{row} was run with other options: {_changes_text(changes)}. Give the row another name, or delete {self.path} "
                           "to run it again")
        if excess := self._excess(self.row.options):
            name, given, reached = excess
            raise RunError(f"{row} has {name} = {self.row.options[name]}, but its run was continued by hand with {name} = {given:.15g} "
                           f"and has reached {reached:.15g}. Write {name} = {given:.15g} in the table, give the row another name, or "
                           f"delete {self.path} to run it again")

    def _excess(self, options):
        """(option, its value in the run, value reached) if the run in the folder is longer than a run with these options."""
        try:
            summary = self._summary()
        except RunError:  # the state of the row reports it
            return None
        for name, entry in _LENGTHS.items():
            wanted, reached = options.get(name, ""), summary.get(entry)
            given = summary.get("parameters", {}).get(name, {}).get("value")
            if all(isinstance(value, (int, float)) for value in (given, reached)) and is_number(wanted):
                if min(given, reached) > float(wanted):  # a run may pass its own end by a part of a step
                    return name, given, reached
        return None

    def state(self):
        """The status of the row."""
        try:
            summary, record = self._summary(), self._record()
            holds = holder(self.path) or (holder(self.ensemble()) if self.awaits_ensemble() else None)
        except RunError as error:  # the other rows continue
            return State("failed", "failed", str(error))
        status = None if _digest(summary) == record.get("outdated_summary_sha256") else summary.get("status")
        before = record.get("run")
        changes = self._changes(before) if before not in (None, self._identity) else {}
        if status in FINISHED and not changes:
            return State("done", status)
        if holds:
            return State("running", "running", holds)
        if before is None or changes:  # never run; a failure that left no run may have been corrected
            extended = changes and (self.path / "run.h5").exists()
            return State("waiting", "waiting", f"to be extended: {_changes_text(changes)}" if extended else "")
        code = record.get("exit_code")
        if code is None or code == STOPPED_CODE or -code in _STOP_SIGNALS:
            return State("stopped", "stopped")
        return State("failed", "failed", record.get("message", "summary.json is gone"))

    def _shorter(self):
        """The folder of the longest run of this sweep that differs from the row in an earlier t_end alone; None without."""
        found = []
        for file in self.path.parent.glob("*/row.json"):
            other = RowFolder(file.parent.parent, dataclasses.replace(self.row, id=file.parent.name), self.base)
            if not other._has_run():
                continue
            try:
                record, status, busy = other._record().get("run"), other._summary().get("status"), holder(other.path)
            except RunError:  # its row reports it
                continue
            if other.path == self.path or record is None or status not in (*FINISHED, "stopped") or busy:
                continue
            if other._excess(self.row.options):
                continue
            changes = self._changes(record)
            if list(changes) == ["t_end"] and changes["t_end"][0] is not None and self._extends(changes):
                found.append((float(changes["t_end"][0]), other.path))
        return max(found)[1] if found else None

    def _has_run(self):
        return (self.path / "run.h5").exists() and any(self.path.glob("checkpoint-[ab].h5"))

    def start(self, program):
        """The command of the next attempt. The program resumes from a checkpoint if there is one, else from the checkpoint of
        a shorter run; it removes an attempt without frames. A run of an ensemble has no checkpoint and starts again."""
        self._remove_member()
        folders = ["-output", str(self.path)]
        if self._has_run():
            folders += ["-restart", str(self.path)]
        elif shorter := self._shorter():
            folders += ["-restart", str(shorter)]
        self._note_start({})
        return [*self.command(program), *folders]

    def command(self, program):
        """The command of the row without its folder."""
        return [str(program), self.row.scenario, *arguments(self.row.options, self.base)]

    def start_in(self, ensemble):
        """Notes that the row is run by the ensemble with this name."""
        self._remove_member()
        self._note_start({"ensemble": ensemble})

    def may_start_in_an_ensemble(self):
        """Whether there is nothing to resume or to branch from, and no other reason to run the row alone."""
        return (self.row.options.get("seed", "").isdigit() and not any(name in self.row.options for name in _ALONE)
                and not self._has_run() and (self.ensemble() is not None or not (self.path / "run.h5").exists())
                and self._shorter() is None)

    def settings(self):
        """All settings of the row but its seed, as a text."""
        identity = self._identity | {"options": {k: v for k, v in self.row.options.items() if k != "seed"}}
        return json.dumps(identity, sort_keys=True)

    def _remove_member(self):
        """Removes the run of an earlier ensemble, which cannot be resumed."""
        if self.ensemble() is not None and not self._has_run():
            for name in ("run.h5", "summary.json"):
                (self.path / name).unlink(missing_ok=True)

    def _note_start(self, more):
        # The summary first: if another sweep extends the row meanwhile, its record shows that there is nothing to extend.
        summary, before = self._summary(), self._record()
        record = {"run": self._identity} | more | _outdated(before)
        if self._changes(before.get("run") or self._identity):
            record["outdated_summary_sha256"] = _digest(summary)
        if record != before:
            self._write_record(record)

    def end(self, code, output):
        """Writes down how an attempt has ended, whose output is the text `output`."""
        before = self._record()
        record = {"run": self._identity, "exit_code": code} | {k: v for k, v in before.items() if k == "ensemble"}
        if code == 0 and self._summary().get("status") not in FINISHED:
            record["exit_code"] = 1
        if record["exit_code"] != 0:
            record["message"] = f"{self._end_text(code)}: {_last_error(output)}"
            record |= _outdated(before)
        self._write_record(record)

    @staticmethod
    def _end_text(code):
        if code < 0:
            return f"killed by {signal.Signals(-code).name}"
        return f"exit code {code}" if code else "exit code 0 without a result"


def _last_error(output):
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    # Other sweeps write to the file too, but only that the folder is in use.
    errors = [line for line in lines if "error:" in line and "is in use by" not in line]
    return (errors or lines or ["no output"])[-1]


def _digest(summary):
    return hashlib.sha256(json.dumps(summary).encode()).hexdigest()


def _outdated(record):
    """The entry of row.json by which the summary of a run that is being extended does not count as the summary of the
    longer run."""
    return {name: value for name, value in record.items() if name == "outdated_summary_sha256"}


def _at_least(new, old):
    return is_number(new) and is_number(old) and float(new) >= float(old)


def _is_text(options):
    return isinstance(options, dict) and all(isinstance(value, str) for value in options.values())


def _is_name(value):
    """Whether a value can name a folder below another one."""
    return isinstance(value, str) and value not in ("", "..") and value == Path(value).name


def _changes_text(changes):
    """'a was 1 and is 2; b was not given and is 0; the file c.txt has changed'."""
    return "; ".join(_change_text(name, old, new) for name, (old, new) in changes.items())


def _change_text(name, old, new):
    if name.startswith(_FILE):
        return f"the {name} {'cannot be read' if new is None else 'has changed'}"
    return f"{name} was {'not given' if old is None else old} and is {'not given' if new is None else new}"


def input_files(options):
    """Names of the input files of a row, as in the table, except the options file."""
    names = [re.sub(r"(?<=\.h5):[0-9]+$", "", options[name]) for name in _FILE_OPTIONS if name in options]  # FILE.h5:FRAME
    obstacles = re.split(r"(?:^|[,;\s])(disk|polygon):", options.get("obstacle", ""))
    polygons = [value.strip(",; ") for kind, value in zip(obstacles[1::2], obstacles[2::2]) if kind == "polygon"]
    return names + [value for value in polygons if not all(map(is_number, re.split("[, ]+", value)))]  # else corners


def _checksum(path):
    """SHA-256 of the content of a regular file; None if it cannot be read."""
    try:
        with open(path, "rb", opener=open_regular) as file:
            status = os.fstat(file.fileno())
        return _checksum_of_version(path, status.st_ino, status.st_size, status.st_ctime_ns)
    except (OSError, ValueError, RunError):
        return None


@functools.cache
def _checksum_of_version(path, *_version):
    """Rows with the same file read it once."""
    checksum = hashlib.sha256()
    with open(path, "rb", opener=open_regular) as file:
        while block := file.read(1 << 20):
            checksum.update(block)
    return checksum.hexdigest()


def _checksums(run):
    """{name of an input file: checksum} of a row.json, which formerly had the checksum of the options file alone."""
    former = {run["options"].get("options_file"): run["options_file_sha256"]} if "options_file_sha256" in run else {}
    return former | run.get("files_sha256", {})


def arguments(options, base):
    """The options as the program takes them; relative names of files begin from the folder `base`."""
    if "options_file" in options:
        options = options | {"options_file": str(Path(base) / options["options_file"])}
    return [text for name, value in options.items() for text in (f"-{name}", value)]


def _stop_with(parent):
    """A function for the child of the process `parent` to call: when the parent ends, in any way, the child gets a
    signal to stop. The child forms a separate process group, because Ctrl-C must reach the sweep alone, which then
    stops every run once; but not a separate session, because Linux may share the machine by sessions, independent of
    their niceness."""
    def call():
        os.setpgid(0, 0)
        _LIBC.prctl(_PR_SET_PDEATHSIG, int(_ASK), 0, 0, 0)
        if os.getppid() != parent:  # has ended before
            os._exit(STOPPED_CODE)
    return call


class _Job:
    """A row, or an ensemble of rows, that runs here."""

    def __init__(self, task, program):
        """`task`: a RowFolder or an EnsembleFolder"""
        self.task = task
        self.asked = self.killed = False
        self.left = list(task.rows)  #: rows whose runs have not ended
        self.done = 0                #: number of runs that are done
        self._next_hand_over = 0.0
        self.started = time.monotonic()
        command = task.start(program)
        self._log = open(task.log_path, "a+b", opener=no_links)
        self._log_start = self._log.seek(0, os.SEEK_END)
        self.process = subprocess.Popen(command, cwd=task.base, stdin=subprocess.DEVNULL, stdout=self._log, stderr=subprocess.STDOUT,
                                        env=os.environ | task.environment, preexec_fn=_stop_with(os.getpid()))

    @property
    def seconds(self):
        """Time so far, for each run at a time."""
        return (time.monotonic() - self.started) * self.task.slots

    @property
    def refused(self):
        """Whether another process ran in the folder."""
        return self.process.returncode == IN_USE_CODE

    def hand_over(self):
        """Rows that have ended since the last call while others of their ensemble run."""
        if time.monotonic() < self._next_hand_over:
            return []
        started = time.monotonic()
        try:
            return self.task.hand_over()
        except RunError:  # reported at the end
            return []
        finally:
            now = time.monotonic()
            self._next_hand_over = now + max(_LEAST_PAUSE, _PATIENCE * (now - started))

    def ended(self):
        if self.process.poll() is None:
            return False
        with self._log as log:
            log.seek(self._log_start)
            output = log.read().decode(errors="replace")
        if not self.killed and not self.refused:  # else treated like a lost machine: to be run again
            self.task.end(self.process.returncode, output)
        return True


class Sweep:
    """Runs rows with a number of workers until none is left or a signal comes. The program's lock makes sure that a row
    runs once at a time: exit code 6 means that another process has it. A patient sweep waits for such rows. With `ensembles`,
    rows that differ only in the seed run in one process."""

    def __init__(self, folders, program, workers, retry=False, patient=True, ensembles=False):
        self._folders, self._program, self._workers = folders, program, workers
        self._retry, self._patient, self._ensembles = retry, patient, ensembles
        self._terminal = sys.stdout.isatty()
        self._jobs = []
        self._ended = [0.0, 0]  # time of ended jobs, for each run at a time, and number of their runs that are done
        self._taken = []  # folders in use by other processes, and when to try them again
        self._reported = {}
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
        rows = []
        for folder in self._folders:
            self._collect(folder)
            state = self.states[folder.row.id] = folder.state()
            if state.kind in ("waiting", "stopped", "running") or (state.kind == "failed" and self._retry):
                rows.append(folder)
            elif len(self._folders) == 1:  # a task of an array reports its row
                self._report(folder, state)
        todo = self._tasks(rows)
        while self._jobs or ((todo or self._taken) and self._stop_at is None):
            todo.extend(folder for folder, at in self._taken if at <= time.monotonic())
            self._taken = [(folder, at) for folder, at in self._taken if at > time.monotonic()]
            while todo and todo[-1].slots <= self._free() and self._stop_at is None:
                self._begin(todo.pop())
            for job in list(self._jobs):
                if job.ended():
                    self._jobs.remove(job)
                    self._finish(job)
                else:
                    self._take(job, job.hand_over())
            self._ask_to_stop()
            self._progress()
            if self._jobs or self._taken:
                time.sleep(0.05)
        self._clear_line()

    def _free(self):
        return self._workers - sum(job.task.slots for job in self._jobs)

    def _tasks(self, rows):
        """Rows, and ensembles of rows, in reverse order."""
        groups = {}  # rows that differ only in the seed; a row that runs alone is a group
        for row in rows:
            together = self._ensembles and self.states[row.row.id].kind != "running" and row.may_start_in_an_ensemble()
            groups.setdefault(row.settings() if together else row.row.id, []).append(row)
        tasks = [EnsembleFolder(part, self._workers) if len(part) > 1 else part[0]
                 for group in groups.values() for part in (consecutive(group) if len(group) > 1 else [group])]
        return tasks[::-1]

    @staticmethod
    def _collect(folder):
        """Takes the results of an ensemble that a killed sweep has left."""
        with contextlib.suppress(RunError):  # its state reports it
            ensemble = folder.ensemble()
            if ensemble and ensemble.exists() and not holder(ensemble):
                EnsembleFolder.of_rows(ensemble, folder.rows_of(ensemble)).collect()

    def _begin(self, task):
        """Starts a task if its rows are left to do."""
        try:
            for folder in task.rows:
                folder.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{folder.path}: cannot be made ({error.strerror})") from None
        if not all([self._is_left(folder) for folder in task.rows]):
            return
        try:
            self._jobs.append(_Job(task, self._program))
        except OSError as error:
            raise OutputError(f"row '{task.rows[0].row.id}' cannot be started ({error.filename}: {error.strerror})") from None
        self._take(self._jobs[-1], [])

    def _take(self, job, ended):
        """Reports rows of a job that have ended. Of the others, as many run as there are slots: the program runs them in order."""
        for folder in ended:
            job.left.remove(folder)
            self._end(job, folder, folder.state())
        for k, folder in enumerate(job.left):
            kind = "running" if k < job.task.slots else "waiting"
            self.states[folder.row.id] = State(kind, kind)

    def _end(self, job, folder, state):
        job.done += state.kind == "done"
        self._report(folder, state)

    def _is_left(self, folder):
        """Whether a row is still to be run; reports it if another sweep was here meanwhile."""
        self._collect(folder)
        state = folder.state()
        if state.kind == "running":
            self._leave(folder, state)
        elif state.kind == "done" or (state.kind == "failed" and not self._retry):
            self._report(folder, state)
        else:
            return True
        return False

    def _finish(self, job):
        for folder in job.left:
            state = folder.state()
            if job.refused and state.kind != "done":
                self._leave(folder, state if state.kind == "running" else State("running", "running", "another process"))
            else:
                self._end(job, folder, state)
        self._ended = [self._ended[0] + job.seconds, self._ended[1] + job.done]

    def _leave(self, folder, state):
        """To the process that runs in the folder."""
        if self._reported.get(folder.row.id) != state:
            self._report(folder, state)
        if self._patient:
            self._taken.append((folder, time.monotonic() + IN_USE_PAUSE))

    def _report(self, folder, state):
        self.states[folder.row.id] = self._reported[folder.row.id] = state
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
        elif (left := self._left_seconds()) is not None:
            line += f", ETA {duration_text(left)}"
        self._clear_line()
        print(line, end="", flush=True)

    def _left_seconds(self):
        """Estimated time to the end, from the mean time of a run; None while no run is done."""
        measured = [job for job in self._jobs if job.done]
        done = self._ended[1] + sum(job.done for job in measured)
        if not done:
            return None
        mean = (self._ended[0] + sum(job.seconds for job in measured)) / done
        begun = [folder.row.id for job in self._jobs for folder in job.task.rows]
        waiting = sum(state.kind in ("waiting", "stopped") for row, state in self.states.items() if row not in begun)
        return (waiting * mean + sum(max(mean * len(job.task.rows) - job.seconds, 0) for job in self._jobs)) / self._workers

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
