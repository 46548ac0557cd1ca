"""Files that are there whole or not at all, files that users name, and JSON files with a checksum."""

import contextlib
import json
import lzma
import math
import os
import re
import stat
import tempfile
import time
import zlib

from .errors import OutputError, RunError

_KINDS = {stat.S_IFDIR: "a folder", stat.S_IFLNK: "a symbolic link", stat.S_IFIFO: "a FIFO", stat.S_IFSOCK: "a socket"}
_FORMAT = 2  # format of JSON files; 2 has a checksum
_SEAL = re.compile(rb'"crc32": "([0-9a-f]{8})"\n}\n\Z')
#: Errors of pandas.read_csv for missing files, damaged archives (.xz) and files that are not tables.
TABLE_ERRORS = (OSError, ValueError, EOFError, lzma.LZMAError)
_STALE = 600  # s; a partial file of a killed process is not written any more


def write_atomically(path, content, mode=0o666):
    """Replaces the file `path` by `content`, text or bytes, with the permissions `mode` less the umask. The content is first
    written to a new file in the same folder, so that no link is followed. Raises OutputError."""
    mask = os.umask(0)
    os.umask(mask)
    temporary = None
    try:
        for left in path.parent.glob(f".{path.name}.*.tmp"):
            with contextlib.suppress(FileNotFoundError):  # another process has just created it
                if time.time() - left.lstat().st_mtime > _STALE:
                    left.unlink()
        fd, temporary = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".tmp", dir=path.parent)
        with open(fd, "wb") as file:
            os.fchmod(fd, mode & ~mask)
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(fd)
        os.replace(temporary, path)
    except OSError as error:
        if temporary is not None and os.path.exists(temporary):
            os.unlink(temporary)
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from None


def open_regular(path, flags=os.O_RDONLY):
    """Descriptor of a regular file, usable as the opener of open(); never waits. RunError if the name belongs to
    anything else, or, with O_NOFOLLOW among the flags, to a link or a file with several names; OSError."""
    own = bool(flags & os.O_NOFOLLOW)
    cure = "remove it" if own else "put a file in its place, or name another"

    def check(status):
        if not stat.S_ISREG(status.st_mode):
            raise RunError(f"{path}: is {_KINDS.get(stat.S_IFMT(status.st_mode), 'a device')}, not a file; {cure}")
        if own and status.st_nlink > 1:
            raise RunError(f"{path}: is a file with other names (hard links); {cure}")

    with contextlib.suppress(FileNotFoundError):
        check(os.stat(path, follow_symlinks=not own))
    fd = os.open(path, flags | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY, 0o666)
    try:
        check(os.fstat(fd))
    except RunError:
        os.close(fd)
        raise
    return fd


def no_links(path, flags):
    """Opener for files in folders of others: fails where the name is a link."""
    return open_regular(path, flags | os.O_NOFOLLOW)


def read_bytes(path, most=1 << 30):
    """The bytes of a regular file; None if there is no file. Raises RunError, also if it has more than `most` bytes."""
    try:
        with open(path, "rb", opener=open_regular) as file:
            data = file.read(most + 1)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        raise RunError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if len(data) > most:
        raise RunError(f"{path}: is too large; the limit is {most} bytes")
    return data


def finite(value):
    """The same value with null for NaN and infinity, which JSON lacks."""
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def write_json(path, value):
    """Writes a dict as JSON between the members "format" and "crc32", the CRC-32 of all bytes before that name. Raises
    OutputError."""
    text = json.dumps({"format": _FORMAT} | value, indent=1)[:-2] + ",\n "
    write_atomically(path, f'{text}"crc32": "{zlib.crc32(text.encode()):08x}"\n}}\n')


def decoded_json(path, data):
    """The dict in the bytes of the JSON file `path`, without format and checksum. Files of older versions have neither and
    are not checked. Raises RunError."""
    try:
        value = json.loads(data.decode())
    except (ValueError, RecursionError) as error:
        raise RunError(f"{path}: is damaged: not JSON ({str(error).splitlines()[0]}); restore it from a backup") from None
    if not isinstance(value, dict):
        raise RunError(f"{path}: is damaged: not a JSON object; restore it from a backup")
    seal = _SEAL.search(data)
    # Each of the two members shows that the file has a checksum: damage cannot hide both.
    if ("format" in value or "crc32" in value) and (seal is None or zlib.crc32(data[:seal.start()]) != int(seal[1], 16)):
        raise RunError(f"{path}: is damaged or was edited: its checksum does not fit; restore it from a backup, or delete "
                       "its members format and crc32 to use it as it is")
    return {name: entry for name, entry in value.items() if name not in ("format", "crc32")}


def read_json(path):
    """The dict in a JSON file; None if there is no file. Raises RunError."""
    data = read_bytes(path)
    return None if data is None else decoded_json(path, data)
