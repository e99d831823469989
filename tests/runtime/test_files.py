"""Regular files are read, and files are written atomically."""

from __future__ import annotations

import errno
import json
import os
import signal
import socket
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from dicedesign.errors import InputError, MeshFileError, OutputError
from dicedesign.runtime.files import (
    atomic_write,
    json_text,
    make_writable_folder,
    read_file,
    read_text,
    remove_files,
)


def a_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(os.path.relpath(path))


SPECIAL: dict[str, Callable[[Path], object]] = {
    "a directory": Path.mkdir,
    "a pipe or a device": os.mkfifo,
    "got a pipe or a device": lambda path: path.symlink_to("/dev/zero"),
    "No such device": a_socket,
    "Too many levels": lambda path: path.symlink_to(path),
}


@pytest.mark.parametrize("kind", SPECIAL)
def test_special_files_are_refused(tmp_path: Path, kind: str) -> None:
    """Pipes and devices do not block."""
    path = tmp_path / "special.stl"
    SPECIAL[kind](path)
    signal.alarm(20)
    try:
        with pytest.raises(MeshFileError, match=rf"special\.stl: expected .*{kind}.*; ") as caught:
            read_file(path, "a mesh", error=MeshFileError)
    finally:
        signal.alarm(0)
    # One error, not nested ones.
    assert str(caught.value).count("special.stl") == 1


def test_regular_files_and_links_to_them_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes("\ufeffä".encode())
    (tmp_path / "link").symlink_to(path)
    for one in (path, tmp_path / "link"):
        assert read_file(one, "a text", most=5) == "\ufeffä".encode()
        assert read_text(one, "a text") == "ä"
    with pytest.raises(InputError, match=r"a\.txt: expected a text of at most 0 MiB, got 0; name"):
        read_file(path, "a text", most=4)
    path.write_bytes(b"\xff")
    with pytest.raises(InputError, match=r"a\.txt: expected a text in UTF-8"):
        read_text(path, "a text")
    for size in (1 << 24, (1 << 24) + 1):
        os.truncate(path, size)
        message = "in UTF-8" if size == 1 << 24 else "at most 16 MiB"
        with pytest.raises(MeshFileError, match=message):
            read_text(path, "a text", error=MeshFileError)
    with pytest.raises(InputError, match=r"expected a readable file, got '(open: )?embedded null"):
        read_file(Path("a\0b"), "a text")


def test_json_is_finite() -> None:
    assert json.loads(json_text({"a": [1.5, None]})) == {"a": [1.5, None]}
    for number in (float("nan"), float("inf")):
        with pytest.raises(ValueError, match="not JSON compliant"):
            json_text({"a": number})


def test_atomic_write_gives_the_usual_permissions(tmp_path: Path) -> None:
    (tmp_path / "usual").write_bytes(b"")
    atomic_write(tmp_path / "written", b"")
    assert (tmp_path / "written").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_links_are_followed(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    file, link, loop = (tmp_path / name for name in ("there/file", "link", "loop"))
    link.symlink_to(file)
    for data in (b"new", b"old"):
        atomic_write(link, data)
        assert (link.is_symlink(), file.read_bytes()) == (True, data)
    loop.symlink_to(loop)
    with pytest.raises(OutputError, match="Too many levels"):
        atomic_write(loop, b"")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link", "loop", "there"]


def device(path: Path, name: str) -> Path:
    """System device for a test to write to; for root a copy, as a bug could replace the device."""
    own = Path("/dev") / name
    if os.geteuid() != 0:
        return own
    try:
        os.mknod(path, stat.S_IFCHR | 0o666, own.stat().st_rdev)
        path.open("wb").close()
    except PermissionError:
        pytest.skip("root may make no devices here")
    return path


def test_devices_and_pipes_are_written_directly(tmp_path: Path) -> None:
    null, link = device(tmp_path / "null", "null"), tmp_path / "link"
    link.symlink_to(null)
    atomic_write(link, b"data")
    assert link.is_symlink()
    assert null.is_char_device()
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    atomic_write(pipe, b"data")
    assert os.read(reader, 9) == b"data"
    os.close(reader)
    assert pipe.is_fifo()
    with pytest.raises(OutputError, match="No space left"):
        atomic_write(device(tmp_path / "full", "full"), b"data")


KILLED = """
import os, signal, sys
from pathlib import Path
from dicedesign.runtime.files import atomic_write
step = {step}
def kill(*a, **k):
    os.kill(os.getpid(), signal.SIGKILL)
setattr(os, step, kill)
atomic_write(Path(sys.argv[1]), b"new" * 100_000)
"""


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_crash_leaves_the_old_content(tmp_path: Path, step: str) -> None:
    """A reader sees the old content until the new is complete."""
    path = tmp_path / "result.json"
    path.write_bytes(b"old")
    with path.open("rb") as reader:
        command = [sys.executable, "-c", KILLED.format(step=repr(step)), str(path)]
        assert subprocess.run(command, check=False).returncode == -signal.SIGKILL
        assert path.read_bytes() == b"old"
        atomic_write(path, b"new")
        assert reader.read() == b"old"
    assert path.read_bytes() == b"new"


def test_file_and_folder_are_synced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "result.json"
    syncs: list[tuple[bool, int, bool]] = []

    def record(handle: int) -> None:
        status = os.fstat(handle)
        is_file = stat.S_ISREG(status.st_mode)
        syncs.append((is_file, status.st_size if is_file else 0, path.exists()))

    monkeypatch.setattr(os, "fsync", record)
    handles = len(os.listdir("/proc/self/fd"))
    atomic_write(path, b"data")
    assert syncs == [(True, 4, False), (False, 0, True)]
    assert len(os.listdir("/proc/self/fd")) == handles


def test_a_full_disk_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left"):
        atomic_write(tmp_path / "new.stl", b"data")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_names_the_path_and_leaves_nothing(tmp_path: Path) -> None:
    parent = tmp_path / "file"
    parent.write_bytes(b"kept")
    with pytest.raises(
        OutputError, match=r"file/die\.stl: expected to write .*choose another path$"
    ):
        atomic_write(parent / "die.stl", b"data")
    (tmp_path / "folder").mkdir()
    for path in ("missing/die.stl", "folder"):
        with pytest.raises(OutputError, match=path):
            atomic_write(tmp_path / path, b"data")
    assert {path.name for path in tmp_path.iterdir()} == {"file", "folder"}
    assert parent.read_bytes() == b"kept"


def test_folders_are_made_and_refused(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "deep"
    for _ in range(2):
        make_writable_folder(folder)
        assert list(folder.iterdir()) == []
    if Path("/proc/self").exists():
        with pytest.raises(OutputError, match=r"^/proc: expected a folder that can be written"):
            make_writable_folder(Path("/proc"))
    (folder / "old").touch()
    remove_files(folder, ["old", "missing"])
    assert list(folder.iterdir()) == []
    with pytest.raises(OutputError, match="expected old results that can be removed, but"):
        remove_files(tmp_path, ["new"])
