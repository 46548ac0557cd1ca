"""run.h5 as its last commit left it, and values compared with their checksums.

The running program appends to the file and changes, at each commit, only the structures that lead to frames and rows of tables
(docs/reference/file-format.md). `RunFile` copies that part when it is opened, so that it sees one state of the file however long
the program runs. HDF5 would share a file that is open twice within a process, and show the older of the two states;
therefore each snapshot has a separate file object.
"""

import io
import os
import struct
import threading
import time
import weakref
import zlib
from bisect import bisect_right
from collections import OrderedDict
from functools import cached_property
from pathlib import Path

import h5py
import numpy as np

from .errors import RunError
from .files import open_regular

_MAGIC = b"PLIANTJ1"
_TRAILER = struct.Struct("<QQQ8s")  # address of the journal, changes, CRC-32, magic
_CHANGE = struct.Struct("<QQ")      # address, size
_TABLES = ("series", "events")      # groups of datasets that grow
_ATTEMPTS = 40
_PAUSE = 0.005  # s between attempts; grows to ten times that
_DESCRIPTORS = 16  # open at a time in this process, for any number of runs
# Exceptions of h5py and NumPy for a damaged file.
_FAULTS = (OSError, KeyError, RuntimeError, ValueError, TypeError, OverflowError, MemoryError)


class _Changed(Exception):
    """The program has written while its file was being read."""


def _read(fd, address, size):
    """The bytes of a file from an address on; fewer at its end."""
    parts = []
    while size > 0 and (part := os.pread(fd, size, address)):
        parts.append(part)
        address, size = address + len(part), size - len(part)
    return b"".join(parts)


def _journal(fd, size):
    """(end, changes) of the whole journal at the end of a file: bytes by address; None without a journal."""
    if size < _TRAILER.size:
        return None
    trailer = _read(fd, size - _TRAILER.size, _TRAILER.size)
    if len(trailer) < _TRAILER.size:
        return None
    start, count, checksum, magic = _TRAILER.unpack(trailer)
    if magic != _MAGIC or start > size - _TRAILER.size:
        return None
    data = _read(fd, start, size - start)
    if zlib.crc32(data[:-16]) != checksum:
        return None
    changes, at = [], 0
    for _ in range(count):
        address, length = _CHANGE.unpack_from(data, at)
        at += _CHANGE.size
        changes.append((address, data[at:at + length]))
        at += length
    return start, changes


class _Descriptors:
    """File descriptors by user; the most recently used descriptors stay open, others are opened again."""

    def __init__(self, limit):
        self._limit, self._open, self._lock = limit, OrderedDict(), threading.RLock()

    def use(self, user, path, expected, function, *arguments):
        """function(descriptor of `path`, arguments …). OSError if the file is no longer the one whose (device, inode) is expected."""
        with self._lock:
            if user in self._open:
                self._open.move_to_end(user)
            else:
                while len(self._open) >= self._limit:
                    os.close(self._open.popitem(last=False)[1])
                fd = open_regular(path)
                status = os.fstat(fd)
                if expected is not None and (status.st_dev, status.st_ino) != expected:
                    os.close(fd)
                    raise OSError("another file has taken its place since it was opened")
                self._open[user] = fd
            return function(self._open[user], *arguments)

    def close(self, user):
        with self._lock:
            if user in self._open:
                os.close(self._open.pop(user))


_descriptors = _Descriptors(_DESCRIPTORS)


class _Blocks:
    """Bytes by address; blocks that overlap are joined."""

    def __init__(self, ranges=()):
        """ranges: (address, bytes) of one state of a file"""
        self._start, self._data = [], []
        for address, data in sorted(ranges, key=lambda r: (r[0], len(r[1]))):
            if self._start and address <= self._start[-1] + len(self._data[-1]):
                last = self._data[-1]
                last += data[self._start[-1] + len(last) - address:]
            elif data:
                self._start.append(address)
                self._data.append(bytearray(data))

    def items(self):
        return list(zip(self._start, map(bytes, self._data)))

    def overlay(self, address, view):
        """Copies the known bytes from an address on; True if all of them are known."""
        end, known = address + len(view), 0
        at = max(0, bisect_right(self._start, address) - 1)
        while at < len(self._start) and self._start[at] < end:
            start, data = self._start[at], self._data[at]
            first, last = max(address, start), min(end, start + len(data))
            if first < last:
                view[first - address:last - address] = data[first - start:last - start]
                known += last - first
            at += 1
        return known == len(view)


class _Snapshot(io.RawIOBase):
    """One state of a growing file, for HDF5: the bytes that were copied are as they were, others come from the file."""

    def __init__(self, use, end, blocks, changes):
        """use(function, …) calls function(descriptor, …); `changes`: (address, bytes) of a journal"""
        super().__init__()
        self._use, self._end, self._at = use, end, 0
        # The blocks were copied with the changes in them: bytes that both have are the same.
        self._blocks, self.read = _Blocks(blocks + changes), []  # (address, bytes) that came from the file until it is sealed

    def seal(self):
        """From now on the snapshot does not change."""
        self._blocks, self.read = _Blocks(self._blocks.items() + self.read), None

    def ranges(self):
        """(address, size) of the copied parts."""
        return [(address, len(data)) for address, data in _Blocks(self._blocks.items() + (self.read or [])).items()]

    def readable(self):
        return True

    def seekable(self):
        return True

    def seek(self, offset, whence=os.SEEK_SET):
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._end}[whence]
        return self._at

    def tell(self):
        return self._at

    def readinto(self, buffer):
        whole = memoryview(buffer).cast("B")
        view = whole[:max(0, self._end - self._at)]
        whole[len(view):] = bytes(len(whole) - len(view))
        if not self._blocks.overlay(self._at, view):
            self._use(_read_into, self._at, view)
            self._blocks.overlay(self._at, view)
            if self.read is not None:
                self.read.append((self._at, bytes(view)))
        self._at += len(view)
        return len(view)


def _has(group, name):
    """Whether a group has a member, damaged or not: h5py's `in` takes a damaged one for missing."""
    return group.id.links.exists(name.encode())


def _names(group):
    """Names of the members of a group, sorted. Raises KeyError if their number differs from the program's count."""
    names = sorted(group)
    if (count := group.attrs["members"] if "members" in group.attrs else len(names)) != len(names):
        raise KeyError(f"it has {len(names)} members of {count}")
    return names


def _numbered(group):
    """Names of the frames in a group, in order. The program numbers them without gaps: they are looked up one by one,
    because HDF5 1.10 crashes if it lists names and finds two states of a group. Other groups keep their names."""
    names = [f"{k:06d}" for k in range(len(group))]
    if all(_has(group, name) for name in names):
        if "members" in group.attrs and group.attrs["members"] != len(names):
            raise KeyError(f"it has {len(names)} members of {group.attrs['members']}")
        return names
    if "members" in group.attrs:
        raise KeyError("frames are missing")
    return sorted((name for name in group if name.isdigit()), key=int)


def _read_into(fd, address, view):
    while len(view):
        count = os.preadv(fd, [view], address)
        if count == 0:  # the file was cut
            view[:] = bytes(len(view))
            return
        address, view = address + count, view[count:]


class RunFile:
    """run.h5 as it is at this moment. Raises RunError if the file is not a run.h5, or if the program writes without a
    pause."""

    def __init__(self, path):
        self.path = Path(path)
        self._token = object()
        self._identity = None
        self._file = None
        weakref.finalize(self, _descriptors.close, self._token)
        try:
            self._open()
        except OSError as error:
            raise RunError(f"{path}: cannot be read as HDF5 ({_line(error)})") from None

    def _use(self):
        """A function that calls others with the file's descriptor, without keeping this object alive."""
        token, path, identity = self._token, self.path, self._identity
        return lambda function, *arguments: _descriptors.use(token, path, identity, function, *arguments)

    def _stamp(self):
        """The data that change when the file is written: inode, size and time."""
        status = self._use()(os.fstat)
        return (status.st_dev, status.st_ino), status.st_size, status.st_mtime_ns

    def _open(self):
        self._identity = self._stamp()[0]
        ranges = []
        for attempt in range(_ATTEMPTS):
            before = self._stamp()
            snapshot = None
            try:
                snapshot = self._collect(before, ranges)
                self._file, self.frames = self._walk(snapshot)
                self._check(before, snapshot)
                snapshot.seal()
                self._opened = before
                return
            except (*_FAULTS, _Changed) as error:
                self.close()
                if not isinstance(error, _Changed) and self._stamp() == before:
                    raise OSError(_line(error)) from None
                # These parts are copied first next time, in one read, during which the program hardly writes.
                ranges = snapshot.ranges() if snapshot is not None else ranges
            time.sleep(_PAUSE * min(attempt + 1, 10))
        raise RunError(f"{self.path}: the program has written at each of {_ATTEMPTS} attempts to read it; open it again")

    def _collect(self, stamp, ranges):
        """A snapshot with the parts `ranges` of one state of the file."""
        use, size = self._use(), stamp[1]
        end, changes = use(_journal, size) or (size, [])
        first, second = ([(at, use(_read, at, count)) for at, count in ranges] for _ in range(2))
        if first != second or self._stamp() != stamp:
            raise _Changed
        blocks, journal = [], _Blocks(changes)
        for address, data in first:
            data = bytearray(data)
            journal.overlay(address, memoryview(data))
            blocks.append((address, bytes(data)))
        return _Snapshot(use, end, blocks, changes)

    @staticmethod
    def _walk(snapshot):
        """The file, and the names of its frames. Reads all data that the program will change, except rows of tables, to
        which it only appends: the structures that lead to frames and chunks of rows."""
        file = h5py.File(snapshot, "r")
        frames = _numbered(file["frames"]) if _has(file, "frames") else []
        if _has(file, "members"):  # an ensemble has them
            len(file["members"])
        for table in _TABLES:
            for name in _names(file[table]) if _has(file, table) else ():
                dataset = file[f"{table}/{name}"]
                if isinstance(dataset, h5py.Dataset) and dataset.chunks:
                    dataset.id.get_num_chunks()  # visits all of them
        return file, frames

    def _check(self, before, snapshot):
        """Raises _Changed if the data read meanwhile may belong to another state."""
        if not snapshot.read:
            return
        if self._stamp() != before:
            raise _Changed
        # Times of files have steps of milliseconds.
        again = self._collect(before, snapshot.ranges())
        view = bytearray(max(len(data) for _, data in snapshot.read))
        for address, data in snapshot.read:
            part = memoryview(view)[:len(data)]
            again.seek(address)
            again.readinto(part)
            if part != data:
                raise _Changed

    def close(self):
        if self._file is not None:
            self._file.close()
        self._file = None
        _descriptors.close(self._token)

    @property
    def closed(self):
        return self._file is None

    def check_open(self):
        """RunError if the file was closed."""
        if self.closed:
            raise RunError(f"{self.path.parent}: the run was closed; open it again")

    def __contains__(self, name):
        return name in self.root

    def __getitem__(self, name):
        """Group or dataset; RunError if there is none, or if it is damaged."""
        return self.root[name]

    @property
    def root(self):
        self.check_open()
        return Group(self, self._file, "/")

    def guard(self, name, function, *arguments):
        """function(arguments …); RunError where the part `name` of the file is damaged."""
        self.check_open()
        try:
            return function(*arguments)
        except _FAULTS as error:
            raise self.damaged(name, _line(error)) from None

    def damaged(self, name, why):
        """The RunError that reports it."""
        try:
            changed = self._stamp() != self._opened
        except OSError:
            changed = True
        if changed:
            return RunError(f"{self.path.parent}: {name} cannot be read ({why}): it is damaged, or the run was restarted "
                            "from an earlier checkpoint after it was opened here; open it again")
        return RunError(f"{self.path.parent}: {name} is damaged ({why})")

    def read(self, dataset):
        """All values of a dataset; RunError if they do not have the CRC-32 that the program has stored with them."""
        name = self.guard("a dataset", lambda: dataset.name)
        values = self.guard(name, lambda: dataset[()])
        stored = self.number(dataset, "crc32", None, np.uint32)
        if stored is not None and zlib.crc32(np.asarray(values, order="C")) != stored:
            raise self.damaged(name, "its checksum does not fit")
        return values

    def text(self, dataset):
        """The text in a dataset."""
        value = self.read(dataset)
        return self.guard(dataset.name, lambda: value.decode())

    def number(self, owner, name, otherwise, dtype=float):
        """An attribute of a group or dataset that is a number; `otherwise` if there is none. The attributes of h5py would
        take three times as long, which is half the time of reading one array of each of many frames."""
        try:
            if not h5py.h5a.exists(owner.id, name.encode()):
                return otherwise
            value = np.empty((), dtype)
            h5py.h5a.open(owner.id, name.encode()).read(value)
            return value.item()
        except _FAULTS as error:
            raise self.damaged(f"the attribute '{name}' of {owner.name}", _line(error)) from None


class Group:
    """A group of run.h5. Raises RunError for damaged data, which never count as missing."""

    def __init__(self, file, group, name):
        self._file, self._group, self.name = file, group, name

    @property
    def id(self):
        return self._group.id

    def __contains__(self, name):
        return self._file.guard(self._path(name), self._lists, name)

    def _lists(self, path):
        """Whether there is such a path below."""
        at, (*groups, last) = self._group, path.split("/")
        for part in groups:
            if not _has(at, part):
                return False
            at = at[part]
        return _has(at, last)

    def __getitem__(self, name):
        """Group, or dataset of h5py, which RunFile.read takes."""
        self._file.check_open()
        path = self._path(name)
        try:
            found = self._group[name]
        except _FAULTS as error:
            if name not in self:
                raise RunError(f"{self._file.path.parent}: run.h5 has no {path}") from None
            raise self._file.damaged(path, _line(error)) from None
        return Group(self._file, found, path) if isinstance(found, h5py.Group) else found

    def _path(self, name):
        return f"{self.name.rstrip('/')}/{name}"

    def names(self):
        """Names of all members, sorted."""
        return self._file.guard(self.name, _names, self._group)

    def copy(self, name, to):
        """Copies the member `name` into `to`, a group or file of h5py."""
        self._file.guard(self._path(name), self._group.copy, name, to)

    @cached_property
    def attrs(self):
        """Attribute name → value."""
        attributes = self._file.guard(f"the attributes of {self.name}", lambda: dict(self._group.attrs.items()))
        self._check_strings(attributes)
        return attributes

    def _check_strings(self, attributes):
        """Versions that stored texts as attributes have their CRC-32 next to them: RunError where it does not fit."""
        checksum = 0
        for name in sorted(attributes):
            if isinstance(value := attributes[name], str):
                checksum = zlib.crc32(f"{name}\0{value}\0".encode(), checksum)
        if attributes.get("crc32", checksum) != checksum:
            raise self._file.damaged(f"the attributes of {self.name}", "their checksum does not fit")


def _line(error):
    """The first line of an error's message."""
    return (str(error).splitlines() or [type(error).__name__])[0]
