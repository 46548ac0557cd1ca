"""Runs in progress: whether a process writes to a folder, and repeated states of its run."""

import fcntl
import os
import time
from pathlib import Path

from .errors import RunError
from .files import no_links
from .run import Run
from .script import remark

LEAST_INTERVAL = 1.0  # s
_PAUSE = 0.2          # s between checks whether the run has ended


def holder(folder):
    """'process 12 on host x' that runs in the folder, by its run.lock; None if no process does. The lock is a flock, which
    ends with the process that holds it."""
    try:
        fd = no_links(folder / "run.lock", os.O_RDONLY)
    except OSError:
        return None
    try:
        fcntl.flock(fd, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return None
    except BlockingIOError:
        return os.pread(fd, 300, 0).decode(errors="replace").strip() or "another process"
    except OSError:  # a file system without locks
        return None
    finally:
        os.close(fd)


def in_use(folder):
    """Whether a process writes to the folder of a run and therefore holds the lock of run.lock."""
    try:
        return holder(Path(folder)) is not None
    except RunError:  # run.lock is a link, or no file
        return False


def states(folder, interval):
    """Yields (Run, whether a process still writes to it), now and every `interval` seconds until no process does. Waits for
    run.h5 while a process uses the folder. Raises RunError."""
    if not interval >= LEAST_INTERVAL:
        raise RunError(f"the interval is {interval:g} s: at least {LEAST_INTERVAL:g}")
    waiting = False
    while True:
        writing = in_use(folder)  # before the run is read: the last state is complete
        try:
            run = Run(folder)
        except RunError:
            if not writing:
                raise
            if not waiting:
                remark(f"{folder}: waits for the first data of the run")
            waiting = True
        else:
            with run:
                yield run, writing
            if not writing:
                return
        end = time.monotonic() + interval
        while time.monotonic() < end and in_use(folder):
            time.sleep(_PAUSE)
