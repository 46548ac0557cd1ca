"""A lock per row of a sweep, so that two workers never have the same run, on one machine or on several that share a
file system."""

import fcntl
import os
import socket
import time

from .errors import OutputError, RunError
from .files import no_links

HEARTBEAT = 30  #: s between renewals by an owner
STALE = 300     #: s without renewal after which an owner on another machine counts as dead


class Taken(Exception):
    """Another worker has the row; the text names the worker."""


def _elsewhere(path, note, fd):
    """Whether another machine has renewed the lock recently. RunError if the time is in the future and proves
    nothing."""
    if note.split()[0] == socket.gethostname():
        return False
    age = time.time() - os.fstat(fd).st_mtime
    if age < -STALE:
        raise RunError(f"{path}: its time is {-age:.0f} s in the future; set the clock, or delete the file if there is no {note}")
    return age < STALE


class RowLock:
    """Holds the lock file from construction to close(); raises Taken if another worker has it.

    The lock is the kernel's (flock) and ends with the last process that has inherited `fd`, so that it outlives a
    killed worker while the run continues, and needs no cleaning up. The file names the owner. Its age guards where
    machines mount a file system without sharing locks: a note of another machine that is younger than STALE counts as a
    lock.
    """

    def __init__(self, path):
        self._path = path
        try:
            self.fd = no_links(path, os.O_RDWR | os.O_CREAT)
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error.strerror})") from None
        try:
            self._flock()
            note = self._note()
            if note and _elsewhere(path, note, self.fd):
                raise Taken(note)
            self.name(os.getpid())
        except BaseException:
            os.close(self.fd)
            raise
        self._beat = time.monotonic()

    def _flock(self):
        for attempt in range(3):  # owner() of another process holds it for a moment
            try:
                return fcntl.flock(self.fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                time.sleep(0.05 * attempt)
            except OSError as error:
                raise OutputError(f"{self._path}: this file system has no locks ({error.strerror}); put the output on "
                                  "another one") from None
        raise Taken(self._note() or "another worker")

    def _note(self):
        return os.pread(self.fd, 200, 0).decode(errors="replace").strip()

    def name(self, pid):
        """Writes down which process has the row."""
        os.ftruncate(self.fd, 0)
        os.pwrite(self.fd, f"{socket.gethostname()} process {pid}".encode(), 0)

    def beat(self):
        """Renews the lock every HEARTBEAT seconds; call it often."""
        if time.monotonic() - self._beat > HEARTBEAT:
            os.utime(self.fd)
            self._beat = time.monotonic()

    def close(self):
        os.ftruncate(self.fd, 0)
        fcntl.flock(self.fd, fcntl.LOCK_UN)  # also for processes that have inherited it
        os.close(self.fd)


def owner(path):
    """The owner of the lock file, or None. Changes nothing."""
    try:
        fd = no_links(path, os.O_RDONLY)
    except OSError:
        return None
    try:
        note = os.pread(fd, 200, 0).decode(errors="replace").strip()
        if not note or _elsewhere(path, note, fd):
            return note or None
        fcntl.flock(fd, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return None
    except BlockingIOError:
        return note
    finally:
        os.close(fd)
