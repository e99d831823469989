"""Hostile files end within seconds, in an error of one line, and in little memory."""

from __future__ import annotations

import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hostile import INCLUDED, MESHES, ROBOTS

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.robots.bodies import list_bodies

SECONDS = 60
"""Time after which a reader counts as stuck; each takes less than two on an idle machine."""

MAX_BYTES = 1 << 29
"""Limit of the memory that a reader takes."""


@contextmanager
def within_limits() -> Iterator[None]:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    signal.alarm(SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert (after - before) << 10 < MAX_BYTES


def write(folder: Path, name: str, content: str | bytes) -> Path:
    (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return folder / name


def assert_named(error: InputError, path: Path) -> None:
    assert str(path) in str(error)
    assert len(str(error)) < 500 + len(str(path))


@pytest.mark.parametrize("name", MESHES)
def test_meshes(tmp_path: Path, name: str) -> None:
    path = write(tmp_path, name, MESHES[name]())
    with within_limits(), pytest.raises(InputError) as caught:
        read_body(path)
    assert_named(caught.value, path)


@pytest.mark.parametrize("name", ROBOTS)
def test_robots(tmp_path: Path, name: str) -> None:
    write(tmp_path, "large.xml", INCLUDED)
    path = write(tmp_path, name, ROBOTS[name]())
    with within_limits(), pytest.raises(InputError) as caught:
        list_bodies(path)[0].read()
    assert len(str(caught.value)) < 500 + len(str(path))
