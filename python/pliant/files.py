"""Files that are there whole or not at all."""

import contextlib
import os
import tempfile
import time

from .errors import OutputError

_STALE = 600  # s; what a killed process has left of a file is no longer written


def write_atomically(path, text, mode=0o666):
    """Replaces the file `path` by `text`, with the permissions `mode` less the umask. What it is made of meanwhile is a
    new file beside it, so that no link is followed. Raises OutputError."""
    mask = os.umask(0)
    os.umask(mask)
    temporary = None
    try:
        for left in path.parent.glob(f".{path.name}.*.tmp"):
            with contextlib.suppress(FileNotFoundError):  # another process has just put it in its place
                if time.time() - left.lstat().st_mtime > _STALE:
                    left.unlink()
        fd, temporary = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".tmp", dir=path.parent)
        with open(fd, "w", encoding="utf-8") as file:
            os.fchmod(fd, mode & ~mask)
            file.write(text)
        os.replace(temporary, path)
    except OSError as error:
        if temporary is not None and os.path.exists(temporary):
            os.unlink(temporary)
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from None


def no_links(path, flags):
    """Opener for files in folders of others: fails where the name is a link."""
    return os.open(path, flags | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
