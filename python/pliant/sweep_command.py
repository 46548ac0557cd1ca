"""pliant-sweep: runs a table of options, a row a run."""

import argparse
import contextlib
import fcntl
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import unicodedata
from pathlib import Path

from .errors import FolderInUseError, OutputError, RunError
from .files import write_atomically
from .script import remark
from .sweep import results_tables
from .sweep_jobs import STOPPED_CODE, RowFolder, Sweep, arguments, count_text, row_text
from .sweep_rows import is_number, read_rows

FAILED_CODE = 3

_DESCRIPTION = """Runs every row of a CSV table: columns are options of pliant without the dash, one run a row. Columns
that are not options: scenario (default: the program's first, hopper), name, seeds (1-20 or 1,2,5: one run each). The same
command resumes stopped runs and skips finished ones. docs/how-to/sweeps.md has more."""

_EPILOG = """examples:
  pliant-sweep widths.csv -j 4
  pliant-sweep seeds.csv --ensembles
  pliant-sweep widths.csv --status
  pliant-sweep widths.csv --slurm && sbatch widths/slurm.sh

exit codes: 0 all rows are done, 2 bad table, 3 rows failed, 4 output failed, 6 another sweep works in the folder and one
of the two has --ensembles, 75 rows are left: run the same again"""


def find_program(given):
    """The pliant to run: `given`, or $PLIANT, or the one next to this command, of the build, or of the PATH."""
    here = Path(sys.argv[0]).resolve().parent
    if given or os.environ.get("PLIANT"):
        candidates = [given or os.environ["PLIANT"]]
    else:
        candidates = [Path(sys.argv[0]).absolute().parent / "pliant", here.parent / "build/apps/pliant", "pliant"]
    found = next(filter(None, (shutil.which(candidate) for candidate in candidates)), None)
    if found is None:
        raise RunError(f"{candidates[-1]}: there is no such program; name it with --program or in $PLIANT")
    return str(Path(found).absolute())


def first_scenario(program):
    """The scenario of rows that name none."""
    result = subprocess.run([program, "-scenarios"], encoding="utf-8", errors="replace", capture_output=True,
                            stdin=subprocess.DEVNULL, env=os.environ | {"OMP_NUM_THREADS": "1"})
    names = result.stdout.split()
    if result.returncode != 0 or not names:
        raise RunError(f"{program} -scenarios lists no scenarios: is it a pliant? " + _error(result))
    return names[0]


def _error(result):
    """The last line of an error, without the program's name."""
    line = (result.stderr.strip().splitlines() or ["no message"])[-1]
    return re.sub(r"^[^:]*: error: ", "", line)


def _probes(rows):
    """Rows with few options each that together hold every name, every text and the ends of every range of numbers."""
    for scenario in dict.fromkeys(row.scenario for row in rows):
        mine = [row for row in rows if row.scenario == scenario]
        wanted = []  # per option the rows to check
        for name in dict.fromkeys(name for row in mine for name in row.options):
            first = {row.options[name]: row for row in reversed(mine) if name in row.options}
            numbers = sorted(filter(is_number, first), key=float)
            fractions = [text for text in numbers if not float(text).is_integer()]
            texts = [text for text in first if not is_number(text)]
            wanted.append((name, [first[text] for text in
                                  dict.fromkeys(numbers[:1] + numbers[-1:] + fractions[:1] + texts)]))
        for i in range(max((len(found) for _, found in wanted), default=1)):
            yield scenario, {name: found[i] for name, found in wanted if i < len(found)}, mine[0]


def check_options(table, rows, program, base):
    """Calls the program to check names and values of all options before the first run; raises RunError with line and
    column. The program reads all options before it finds that there is nothing to restart in an empty folder."""
    with tempfile.TemporaryDirectory(prefix="pliant-sweep-") as empty:
        for scenario, probe, first in _probes(rows):
            options = arguments({name: row.options[name] for name, row in probe.items()}, base)
            result = subprocess.run([program, scenario, *options, "-restart", empty], cwd=base, encoding="utf-8",
                                    errors="replace", capture_output=True, stdin=subprocess.DEVNULL,
                                    env=os.environ | {"OMP_NUM_THREADS": "1"})
            if empty in result.stderr:
                continue
            message = _error(result)
            named = re.search(r"-([A-Za-z]\w*)", message)
            name = named[1] if named and named[1] in probe else None
            row = probe.get(name, first)
            column = name and ("seeds" if name == "seed" else name)
            raise RunError(f"{table}, line {row.line}" + (f", column '{column}'" if column else "") + f": {message}")


def write_results(output, folders):
    """results.csv, one row per run, and units.csv, the units of its columns. Returns the states of the rows."""
    entries = [(folder, folder.state()) for folder in folders]
    results, units = results_tables([(folder.row, folder.path, state) for folder, state in entries])
    for name, table in (("results.csv", results), ("units.csv", units)):
        write_atomically(output / name, table.to_csv(index=False))
    return [state for _, state in entries]


def run_rows(output, folders, program, workers, **how):
    """Runs the remaining rows of a sweep in the folder `output`; {row id: State}. `how` are further arguments of Sweep. A signal
    stops it. Raises FolderInUseError if another sweep works there and one of the two has ensembles."""
    with _share_of(output, alone=how.get("ensembles", False)):
        return Sweep(folders, program, workers, **how).run()


def default_workers(rows):
    """How many rows to run at a time: one per core, or fewer if rows use several threads."""
    return max(len(os.sched_getaffinity(0)) // _threads(rows), 1)


def _threads(rows):
    return max(int(row.options.get("threads", 1)) for row in rows)


def _row_command(table, output, program):
    launcher = Path(sys.argv[0]).absolute()
    return shlex.join([str(launcher), str(table.absolute()), "--output", str(output.absolute()), "--program", program])


def write_slurm(table, output, program, rows):
    """OUTPUT/slurm.sh: an array job with a task per row. Returns its path."""
    script = output / "slurm.sh"
    for found in re.findall(r'["\\%]', str(output.absolute())):
        raise RunError(f"{output}: Slurm cannot name a folder with {found} in it; choose another with --output")
    text = f"""#!/bin/sh
# Runs the rows of {table.name}, a task each: sbatch slurm.sh. The same command again resumes the remaining rows.
#SBATCH --job-name={re.sub(r'[^A-Za-z0-9._-]', '_', table.stem)}
#SBATCH --array=1-{len(rows)}
#SBATCH --ntasks=1
#SBATCH --cpus-per-task={_threads(rows)}
#SBATCH --output="{output.absolute()}/slurm-%a.log"
#SBATCH --signal=B:TERM@60
exec {_row_command(table, output, program)} --row "$SLURM_ARRAY_TASK_ID"
"""
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{output}: cannot be made ({error.strerror})") from None
    write_atomically(script, text, 0o777)
    return script


def _parser():
    parser = argparse.ArgumentParser(prog="pliant-sweep", description=_DESCRIPTION, epilog=_EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, metavar="TABLE.csv")
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER",
                        help="folder of the runs and of results.csv (default: the table's name without its ending)")
    parser.add_argument("-j", "--jobs", type=int, metavar="N", help="runs at a time (default: one per core, or "
                        "fewer if the table has the column threads)")
    parser.add_argument("--ensembles", action="store_true", help="run rows that differ only in the seed as one ensemble: faster for "
                        "runs of seconds, which get no checkpoints")
    parser.add_argument("--program", metavar="FILE", help="the pliant to run (default: $PLIANT, or the one next to this "
                        "command, of the build, or of the PATH)")
    parser.add_argument("--retry", action="store_true", help="run failed rows again, from their checkpoint if "
                        "there is one; an attempt without frames starts again")
    mode = parser.add_mutually_exclusive_group()
    mode.add_argument("--status", action="store_true", help="only show the status of each row")
    mode.add_argument("--merge", action="store_true", help="only write results.csv from the runs there are")
    mode.add_argument("--row", type=int, metavar="N", help="run the Nth row only, and leave results.csv as it is")
    mode.add_argument("--slurm", action="store_true", help="only write FOLDER/slurm.sh, an array job")
    mode.add_argument("--parallel", action="store_true", help="only print the command line for GNU parallel")
    return parser


def _code(states):
    kinds = {state.kind for state in states}
    if kinds & {"stopped", "waiting", "running"}:
        return STOPPED_CODE
    return FAILED_CODE if "failed" in kinds else 0


@contextlib.contextmanager
def _share_of(folder, alone):
    """Works in the folder of a sweep: alone, or together with others that do not want it alone. Raises FolderInUseError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be used ({error.strerror})") from None
    try:
        with contextlib.suppress(OSError):  # a file system without locks; the locks of the runs warn of it
            try:
                fcntl.flock(descriptor, fcntl.LOCK_NB | (fcntl.LOCK_EX if alone else fcntl.LOCK_SH))
            except BlockingIOError:
                raise FolderInUseError(f"{folder}: another pliant-sweep works there, and a sweep with --ensembles must be the only "
                                       "one; wait until it ends, or run both without --ensembles") from None
        yield
    finally:
        os.close(descriptor)


def main(arguments_=None):
    """Runs the command; returns the exit code."""
    parser = _parser()
    given = parser.parse_args(arguments_)
    if given.jobs is not None and given.jobs < 1:
        parser.error(f"-j {given.jobs}: at least one")
    if given.ensembles:
        for name in ("row", "slurm", "parallel"):
            if getattr(given, name):
                parser.error(f"--ensembles runs many rows in one process, --{name} one row in each; leave out one of them")
    for path in (given.table, given.output or given.table):
        if any(unicodedata.category(c) in ("Cc", "Cs") for c in str(path)):
            raise RunError(f"{ascii(str(path))}: a name here must be UTF-8 without control characters; rename it")
    program = find_program(given.program)
    rows = read_rows(given.table, first_scenario(program))
    base = given.table.absolute().parent
    output = given.output or given.table.with_suffix("")
    if output.exists() and not output.is_dir():
        raise OutputError(f"{output}: is not a folder; name another with --output")
    folders = [RowFolder(output, row, base, program) for row in rows]
    if given.row is not None:
        if not 1 <= given.row <= len(rows):
            raise RunError(f"--row {given.row}: the table has the rows 1 … {len(rows)}")
        folders = [folders[given.row - 1]]
    for folder in folders:
        folder.check()

    if given.status:
        states = {folder.row.id: folder.state() for folder in folders}
        for folder in folders:
            print(row_text(folder.row, states[folder.row.id]))
        print(count_text(states.values()))
        return _code(states.values())
    if given.merge:
        states = write_results(output, folders)
        print(f"wrote {output / 'results.csv'}: {sum(state.kind == 'done' for state in states)} of {len(folders)} rows are done")
        return _code(states)

    if given.row is None:
        check_options(given.table, rows, program, base)
    if given.slurm:
        print(f"sbatch {shlex.quote(str(write_slurm(given.table, output, program, rows)))}")
        return 0
    workers = 1 if given.row else given.jobs or default_workers(rows)
    if given.parallel:
        # Its default time limit is shorter than a checkpoint may take.
        print(f"seq {len(rows)} | parallel -q -j {workers} --termseq TERM,60000,KILL,25 "
              f"{_row_command(given.table, output, program)} --row {{}}")
        return 0

    states = run_rows(output, folders, program, workers, retry=given.retry, patient=given.row is None, ensembles=given.ensembles)
    if given.row is None:
        write_results(output, folders)
        remark(count_text(states.values()))
        for folder in folders:
            if states[folder.row.id].kind == "failed":
                remark(row_text(folder.row, states[folder.row.id]))
        if _code(states.values()) == STOPPED_CODE:
            remark("run the same command again to resume")
    return _code(states.values())
