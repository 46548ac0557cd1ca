"""Files of users and of the program: kinds of files, checksums of JSON."""

import errno
import os
import tempfile
from pathlib import Path

import pytest
from synthetic import write_run

from pliant import Run, RunError
from pliant.errors import OutputError
from pliant.files import no_links, open_regular, read_bytes, read_json, write_atomically, write_json

RECORD = {"run": {"scenario": "hopper", "options": {"a": "1"}}, "exit_code": 0, "µ": [1.5, None]}
#: As the program writes it: tests/io/summary.cpp.
BY_PROGRAM = b'{\n  "format": 2,\n  "status": "done",\n  "crc32": "e20d29dc"\n}\n'


def test_json_of_the_program(tmp_path):
    (tmp_path / "a.json").write_bytes(BY_PROGRAM)
    assert read_json(tmp_path / "a.json") == {"status": "done"}
    assert read_json(tmp_path / "none.json") is None


@pytest.mark.parametrize("writer", ["python", "program"])
def test_no_bit_of_a_json_file_can_change(writer, tmp_path):
    path = tmp_path / "a.json"
    write_json(path, RECORD) if writer == "python" else path.write_bytes(BY_PROGRAM)
    whole, value = path.read_bytes(), read_json(path)
    assert value == (RECORD if writer == "python" else {"status": "done"})
    for at in range(8 * len(whole)):
        data = bytearray(whole)
        data[at // 8] ^= 1 << at % 8
        path.write_bytes(data)
        with pytest.raises(RunError, match="a.json: is damaged") as error:
            read_json(path)
        assert "\n" not in str(error.value)
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        with pytest.raises(RunError, match="a.json: is damaged"):
            read_json(path)


def test_edited_and_older_json_files(tmp_path):
    path = tmp_path / "a.json"
    path.write_bytes(BY_PROGRAM.replace(b"done", b"gone"))
    with pytest.raises(RunError, match="was edited: .* delete its members format and crc32 to use it as it is"):
        read_json(path)
    path.write_text('{"status": "gone"}', encoding="utf-8")
    assert read_json(path) == {"status": "gone"}


def test_the_summary_of_a_run_is_checked(tmp_path):
    path, _ = write_run(tmp_path / "run", frames=1)
    summary = Run(path).summary
    write_json(path / "summary.json", summary)
    assert Run(path).summary == summary
    data = (path / "summary.json").read_bytes()
    (path / "summary.json").write_bytes(data.replace(b'"steps": 1000', b'"steps": 1001'))
    assert data != (path / "summary.json").read_bytes()
    with pytest.raises(RunError, match="its checksum does not fit"):
        Run(path).summary


def test_files_are_replaced_as_a_whole(tmp_path, monkeypatch):
    """By a new file in the same folder, synced to the disk before it takes their name. Links with its name are not
    followed."""
    path, precious, synced = tmp_path / "row.json", tmp_path / "precious", []
    path.write_text("old", encoding="utf-8")
    precious.write_text("mine", encoding="utf-8")
    monkeypatch.setattr(tempfile, "_name_sequence", iter(["first", "second"]))
    for name in ("row.json.tmp", ".row.json.tmp", ".row.json.first.tmp"):
        (tmp_path / name).symlink_to(precious)
    sync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda fd: synced.append(os.fstat(fd).st_ino) or sync(fd))

    def checked(temporary, target):
        assert Path(target) == path and path.read_text(encoding="utf-8") == "old"
        assert synced == [os.lstat(temporary).st_ino]
        replace(temporary, target)

    monkeypatch.setattr(os, "replace", checked)
    write_atomically(path, "new")
    assert path.read_text(encoding="utf-8") == "new" and path.lstat().st_ino == synced[0]
    assert precious.read_text(encoding="utf-8") == "mine"


def test_a_file_that_cannot_be_written_stays_as_it_was(tmp_path, monkeypatch):
    path = tmp_path / "row.json"
    path.write_text("old", encoding="utf-8")

    def full(_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left on device"):
        write_atomically(path, "new")
    assert path.read_text(encoding="utf-8") == "old" and list(tmp_path.iterdir()) == [path]


def test_files_that_are_no_files(tmp_path):
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "file").write_text("x", encoding="utf-8")
    (tmp_path / "link").symlink_to("file")
    os.link(tmp_path / "file", tmp_path / "other")
    for name, kind in (("fifo", "a FIFO"), ("/dev/zero", "a device"), (".", "a folder")):
        with pytest.raises(RunError, match=f"is {kind}, not a file"):
            read_bytes(tmp_path / name)
        with pytest.raises(RunError, match=f"is {kind}, not a file"):
            open_regular(tmp_path / name, os.O_RDWR | os.O_CREAT)
    assert read_bytes(tmp_path / "link") == b"x"
    with pytest.raises(RunError, match="a symbolic link"):
        no_links(tmp_path / "link", os.O_RDONLY)
    with pytest.raises(RunError, match="other names"):
        no_links(tmp_path / "file", os.O_RDONLY)
    with pytest.raises(RunError, match="cannot be read"):
        read_bytes("a\0b")


def test_parts_of_a_run_that_are_no_files(tmp_path):
    for name in ("run.h5", "summary.json"):
        path, _ = write_run(tmp_path / name[:3], frames=1)
        (path / name).unlink()
        os.mkfifo(path / name)
        with pytest.raises(RunError, match=f"{name}: is a FIFO, not a file"):
            Run(path)
