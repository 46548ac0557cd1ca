"""Rows of a sweep that differ only in the seed, run by one process: pliant -ensemble."""

import contextlib
import fcntl
import json
import os
import shutil

from .ensemble_run import write_member
from .errors import OutputError, RunError
from .files import no_links, write_json
from .run_file import RunFile
from .script import remark

#: Folder of ensembles in the folder of a sweep. No row can have this name.
FOLDER = ".ensembles"
_FAILED_CODE = 3
_STOPPED_CODE = 75


def consecutive(rows):
    """Lists of rows with consecutive seeds, as an ensemble has them."""
    parts = []
    for row in sorted(rows, key=_seed):
        if parts and _seed(row) == _seed(parts[-1][-1]) + 1:
            parts[-1].append(row)
        else:
            parts.append([row])
    return parts


def _seed(row):
    return int(row.row.options["seed"])


class EnsembleFolder:
    """The folder of an ensemble of rows (RowFolder) with consecutive seeds. A run is given to the folder of its row when it has ended.
    The folder of the ensemble exists until all have ended; if the sweep is killed, the next sweep collects the runs."""

    environment = {"OMP_NUM_THREADS": "1"}  #: changes of the environment of the program

    def __init__(self, rows, workers):
        """`workers`: the largest number of runs at a time"""
        self.path = rows[0].path.parent / FOLDER / rows[0].row.id
        self.rows, self.base = rows, rows[0].base
        self.slots = min(len(rows), workers)  #: runs at a time
        self.log_path = self.path / "log.txt"

    @classmethod
    def of_rows(cls, path, rows):
        """The folder `path` that an earlier sweep has left, with its rows by their row.json."""
        self = cls(rows, len(rows))
        self.path, self.log_path = path, path / "log.txt"
        return self

    def start(self, program):
        """The command of the ensemble."""
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be made ({error.strerror})") from None
        for row in self.rows:
            row.start_in(self.path.name)
        return [*self.rows[0].command(program), "-output", str(self.path), "-ensemble", str(len(self.rows)),
                "-ensemble_workers", str(self.slots)]

    def end(self, code, output):
        """Writes down how the runs have ended, after a process with this output."""
        self.collect()
        if code not in (0, _STOPPED_CODE):
            for row in self.rows:
                if row.state().kind == "stopped":
                    row.end(code, self._in_folder_of(row, output))

    def hand_over(self):
        """Gives each run that has ended, since the last call, to its row, also while other runs continue. Returns these rows. Raises
        RunError."""
        if not (self.path / "ensemble.h5").exists():
            return []
        new = []
        with contextlib.closing(RunFile(self.path / "ensemble.h5")) as file:
            members, first = file["members"], json.loads(file.text(file["ensemble"]))["first_seed"]
            for row in self.rows:
                if row.awaits_ensemble() and (name := f"{_seed(row) - first:06d}") in members:
                    self._write_row(row, members[name], json.loads(file.text(members[name]["summary"])))
                    new.append(row)
        return new

    def collect(self):
        """Gives the runs that have ended to their rows, and removes the folder. If two processes call this, the first one does it."""
        try:
            with self._locked(), contextlib.suppress(FileNotFoundError):
                self.hand_over()
                shutil.rmtree(self.path)
        except RunError as error:
            remark(f"{error}; the runs of this ensemble start again")
            shutil.rmtree(self.path, ignore_errors=True)

    @contextlib.contextmanager
    def _locked(self):
        with contextlib.ExitStack() as stack:
            with contextlib.suppress(OSError):  # removed by another process, or a file system without locks
                fcntl.flock(stack.enter_context(open(self.path / "run.lock", "r+b", opener=no_links)), fcntl.LOCK_EX)
            yield

    def _in_folder_of(self, row, text):
        """A text of the program, which contains the folder of the ensemble, with the folder of a row."""
        return text.replace(str(self.path), str(row.path))

    def _write_row(self, row, member, summary):
        """The files of a run alone, without checkpoints and run.xdmf. The summary is the last file, because it makes the row done."""
        warnings = [self._in_folder_of(row, text) for text in summary.pop("warnings")]
        output = [f"pliant: warning: {text}" for text in warnings]
        failed = summary["status"] == "failed"
        if failed:
            summary["message"] = self._in_folder_of(row, str(summary.get("message")))
            output.append(f"pliant: error: {summary['message']}")
        for name in ("seed", "results"):  # entries that only members have
            del summary[name]
        text = "".join(f"{line}\n" for line in output)
        with open(row.log_path, "a", encoding="utf-8", opener=no_links) as log:
            log.write(text)
        if "manifest" in member:
            part = row.path / ".run.h5.tmp"
            part.unlink(missing_ok=True)
            write_member(member, part)
            os.replace(part, row.path / "run.h5")
        write_json(row.path / "summary.json", summary)
        row.end(_FAILED_CODE if failed else 0, text)
