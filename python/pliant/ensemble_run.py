"""Results of ensembles (-ensemble): many runs of one scenario in one file."""

import json
import tempfile
import weakref
from collections.abc import Sequence
from pathlib import Path

import h5py
import pandas as pd

from .errors import RunError
from .run import Run
from .run_file import RunFile


def write_member(member, path):
    """Writes a member of ensemble.h5, a group of a RunFile, to a new file `path` in the format of run.h5."""
    with h5py.File(path, "w-", libver=("earliest", "v110")) as file:
        for part in member.names():
            if part != "summary":
                member.copy(part, file)


class Ensemble(Sequence):
    """The ensemble in folder `path`, which has ended. Its items are the runs, numbered from 0, each a `Run`. Raises
    RunError if the folder holds no ensemble, or one that has not ended."""

    def __init__(self, path):
        self.path = Path(path)
        if not (self.path / "ensemble.h5").exists():
            raise RunError(f"{self.path}: not an ensemble (it has no ensemble.h5)")
        if not (self.path / "members.csv").exists():
            raise RunError(f"{self.path}: the ensemble has not ended; wait, or repeat its command to resume it")
        self._file = RunFile(self.path / "ensemble.h5")
        #: The settings that all runs share, and the varied option (of -ensemble_over) with its values.
        self.description = json.loads(self._file.text(self._file["ensemble"]))
        #: One row for each run: member (its number), seed, value of the varied option, status, results, message.
        self.table = pd.read_csv(self.path / "members.csv")

    def __repr__(self):
        return f"<Ensemble {self.path}: {len(self)} runs of {self.description['scenario']}>"

    def column(self, result):
        """The column of a result in `table` and `means`; RESULT_result for a result with the name of the varied option."""
        return f"{result}_result" if result == self.description["option"] else result

    @property
    def means(self):
        """One row for each value of the varied option: members (number of runs that have not failed), and for each
        result its mean over these runs and, in RESULT_error, the standard error of this mean."""
        option = self.description["option"]
        whole = self.table[self.table.status != "failed"]
        names = [name for name in whole if name not in ("member", "seed", option, "status", "message")]
        groups = whole.groupby(option, sort=True) if option else [(None, whole)]
        rows = []
        for value, group in groups:
            row = {option: value} if option else {}
            row["members"] = len(group)
            for name in names:
                row |= {name: group[name].mean(), f"{name}_error": group[name].sem()}
            rows.append(row)
        return pd.DataFrame(rows)

    def __len__(self):
        return len(self.table)

    def __getitem__(self, number):
        if isinstance(number, slice):
            return [self[k] for k in range(*number.indices(len(self)))]
        folder = tempfile.TemporaryDirectory(prefix="pliant-member-")
        run = self.extract(number, Path(folder.name) / f"{self.path.resolve().name}-{range(len(self))[number]}")
        weakref.finalize(run, folder.cleanup)
        return run

    def has_data(self, number):
        """Whether the run `number` has series and frames: a run that failed at its start has none."""
        return "manifest" in self._file["members"][f"{range(len(self))[number]:06d}"]

    def report(self, path=None, limit=None, member=None):
        """Writes the report of the ensemble for a browser, at most `limit` MB large (default: 5), to `path` (default: report.html
        in its folder), with the frames of the run `member`, or of as many runs as fit. Returns the path. Raises RunError, OutputError."""
        from .report import LIMIT
        from .report.ensemble import write_ensemble
        return write_ensemble(self, path, LIMIT if limit is None else limit, member)

    def extract(self, number, folder):
        """Writes run.h5 and summary.json of the run `number` to a new folder, and returns the Run of this folder. Raises
        RunError if the run failed before it had data."""
        folder = Path(folder)
        name = f"{range(len(self))[number]:06d}"
        member = self._file["members"][name]
        summary = json.loads(self._file.text(member["summary"]))
        if "manifest" not in member:
            raise RunError(f"{self.path}: run {int(name)} failed before it had data: {summary.get('message')}")
        # Members of files from before 2026-11-28 have no count of their parts, and can lack the series and hundreds of frames.
        if summary.get("status") == "done" and "members" not in member.attrs and "series" not in member:
            raise RunError(f"{self.path}: parts of run {int(name)} are missing in ensemble.h5; run the ensemble again")
        folder.mkdir(parents=True)
        write_member(member, folder / "run.h5")
        (folder / "summary.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
        return Run(folder)
