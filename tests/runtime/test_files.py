"""Files are written whole or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from dicedesign.errors import OutputError
from dicedesign.runtime.files import atomic_write, make_writable_folder


def test_atomic_write_replaces_and_leaves_only_the_file(tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    path.write_bytes(b"old and longer")
    atomic_write(path, b"new")
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]


def test_atomic_write_gives_the_usual_permissions(tmp_path: Path) -> None:
    (tmp_path / "usual").write_bytes(b"")
    atomic_write(tmp_path / "written", b"")
    assert (tmp_path / "written").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_a_failed_write_names_the_path_and_leaves_nothing(tmp_path: Path) -> None:
    parent = tmp_path / "file"
    parent.write_bytes(b"kept")
    with pytest.raises(
        OutputError, match=r"file/die\.stl: expected to write .*choose another path$"
    ):
        atomic_write(parent / "die.stl", b"data")
    with pytest.raises(OutputError, match="missing"):
        atomic_write(tmp_path / "missing" / "die.stl", b"data")
    assert list(tmp_path.iterdir()) == [parent]
    assert parent.read_bytes() == b"kept"


def test_a_folder_in_the_way_leaves_no_partial_file(tmp_path: Path) -> None:
    (tmp_path / "die.stl").mkdir()
    with pytest.raises(OutputError):
        atomic_write(tmp_path / "die.stl", b"data")
    assert [entry.name for entry in tmp_path.iterdir()] == ["die.stl"]


def test_a_folder_is_made_and_left_empty(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "deep"
    for _ in range(2):
        make_writable_folder(folder)
        assert list(folder.iterdir()) == []


def test_a_folder_without_permission_is_told_from_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(self: Path, *arguments: object, **options: object) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(Path, "touch", refuse)
    with pytest.raises(OutputError) as caught:
        make_writable_folder(tmp_path)
    assert str(caught.value) == (
        f"{tmp_path}: expected a folder that can be written, got 'Permission denied'; choose "
        "another with --out"
    )


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="a folder of Linux's")
def test_a_folder_that_exists_and_takes_no_files_is_refused() -> None:
    with pytest.raises(OutputError, match=r"^/proc: expected a folder that can be written"):
        make_writable_folder(Path("/proc"))
