"""run.h5 as its last commit left it, and values compared with their checksums.

A run that is killed while it commits leaves a journal of changes at the end of the file (docs/file-format.md). Here they
are made in memory; the file itself is the running program's.
"""

import io
import os
import struct
import zlib

import h5py
import numpy as np

from .errors import RunError

_MAGIC = b"PLIANTJ1"
_TRAILER = struct.Struct("<QQQ8s")  # address of the journal, changes, CRC-32, magic
_CHANGE = struct.Struct("<QQ")      # address, size


def journal(file):
    """(end, changes) of the whole journal at the end of a binary file: bytes by address; None if there is none."""
    size = file.seek(0, os.SEEK_END)
    if size < _TRAILER.size:
        return None
    file.seek(size - _TRAILER.size)
    start, count, checksum, magic = _TRAILER.unpack(file.read(_TRAILER.size))
    if magic != _MAGIC or start > size - _TRAILER.size:
        return None
    file.seek(start)
    data = file.read(size - start)
    if zlib.crc32(data[:-16]) != checksum:
        return None
    changes, at = [], 0
    for _ in range(count):
        address, length = _CHANGE.unpack_from(data, at)
        at += _CHANGE.size
        changes.append((address, data[at:at + length]))
        at += length
    return start, changes


class _Mended(io.RawIOBase):
    """A file with the changes of its journal."""

    def __init__(self, file, end, changes):
        super().__init__()
        self._file, self._end, self._changes, self._at = file, end, changes, 0

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
        view = memoryview(buffer).cast("B")[:max(0, self._end - self._at)]
        self._file.seek(self._at)
        count = self._file.readinto(view)
        first, last = self._at, self._at + count
        for address, data in self._changes:
            begin, end = max(first, address), min(last, address + len(data))
            if begin < end:
                view[begin - first:end - first] = data[begin - address:end - address]
        self._at = last
        return count

    def close(self):
        self._file.close()
        super().close()


def open_run_file(path):
    """An h5py.File of run.h5 for reading; OSError if it is not one."""
    file = open(path, "rb", buffering=0)
    found = journal(file)
    if found is None:
        file.close()
        # No lock: a run that is still being written may be read up to its last frame.
        return h5py.File(path, "r", locking=False)
    return h5py.File(_Mended(file, *found), "r")


def checked(dataset):
    """All values of a dataset; RunError if they do not have the CRC-32 that the program has stored with them."""
    values = dataset[()]
    stored = dataset.attrs.get("crc32")
    if stored is not None and zlib.crc32(np.ascontiguousarray(values)) != stored:
        raise RunError(f"{dataset.file.filename}: {dataset.name} is damaged (its checksum does not fit)")
    return values


def check_strings(group):
    """RunError if the strings among the attributes of a group do not have the CRC-32 stored with them."""
    stored, checksum = group.attrs.get("crc32"), 0
    if stored is None:
        return
    for name in sorted(group.attrs):
        if isinstance(value := group.attrs[name], str):
            checksum = zlib.crc32(f"{name}\0{value}\0".encode(), checksum)
    if checksum != stored:
        raise RunError(f"{group.file.filename}: the attributes of {group.name} are damaged (their checksum does not fit)")
