"""Files with the state of long work, from which it goes on later."""

from __future__ import annotations

import io
import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import InputError, OutputError
from dicedesign.runtime.files import atomic_write, read_file, remove_partial_files

INTERVAL: Final = 5.0
"""Seconds after which what is new is written."""

SHARE: Final = 0.02
"""Of the time, at most so much goes into writing the file before the end."""


class AutosavedFile:
    """A file that one process writes, again and again as a whole: at any time it holds the old
    content or all of the new."""

    def __init__(self, path: Path, kind: str, content: Callable[[], bytes]) -> None:
        """kind: what it is, for messages, such as "a table"; content: makes what is to be written.
        Nothing is written yet, but what a killed process left half written is removed."""
        remove_partial_files(path.parent, path.name)
        self.path = path
        self._kind = kind
        self._content = content
        self._new = False
        self._written = _state(path)
        self._due = 0.0

    @property
    def is_due(self) -> bool:
        """Whether it was not written for so long that what is new should be."""
        return time.monotonic() >= self._due

    def change(self) -> None:
        """Take note that the content is new, and write it if that is due. Raises OutputError: as
        `save`."""
        self._new = True
        if self.is_due:
            self.save()

    def save(self) -> None:
        """Write the content if it is new.

        Raises OutputError: that cannot be done, or another process has written the file meanwhile.
        """
        if not self._new:
            return
        started = time.monotonic()
        data = self._content()
        if _state(self.path) not in (None, self._written):
            raise OutputError(
                f"{self.path}: expected {self._kind} that only this run writes, but another one "
                "has written it meanwhile; let that one end, then run the same command to go on"
            )
        atomic_write(self.path, data)
        self._written = _state(self.path)
        self._new = False
        ended = time.monotonic()
        self._due = ended + max(INTERVAL, (ended - started) / SHARE)

    def remove(self) -> None:
        """Remove it if it is there. Raises OutputError: that cannot be done."""
        try:
            self.path.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(
                f"{self.path}: expected a file that can be removed, got {error.strerror!r}; remove "
                "it"
            ) from error


def _state(path: Path) -> tuple[int, int] | None:
    """Size and time of the last change of a file; None where there is none."""
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return status.st_size, status.st_mtime_ns


Arrays = Mapping[str, NDArray[Any]]

State = TypeVar("State")

_ABOUT: Final = "about"
"""Name of the text beside the arrays."""

_WORK: Final = "work"
"""Key of the work in it, beside those of the state."""


def checkpoint_bytes(work: Mapping[str, str], state: Mapping[str, Any], arrays: Arrays) -> bytes:
    """The content of a checkpoint: arrays and a JSON text in NumPy's format, nothing pickled.

    Parameters
    ----------
    work: what the state belongs to, by kind, as in `read_checkpoint`.
    state: plain data by name. arrays: by name.
    """
    file = io.BytesIO()
    about = json.dumps({_WORK: dict(work), **state})
    held: dict[str, Any] = {_ABOUT: np.array(about), **arrays}
    np.savez(file, **held)
    return file.getvalue()


def read_checkpoint(
    path: Path,
    work: Mapping[str, str],
    restored: Callable[[Any, Arrays], State],
    *,
    restart: str,
    elsewhere: str,
) -> State:
    """The state in a file that `checkpoint_bytes` made.

    Parameters
    ----------
    work: texts that must be those it was written with, by kind, such as "seed".
    restored: makes the state of its plain data and its arrays.
    restart, elsewhere: how to start again, and how to leave the file alone, for messages.

    Raises
    ------
    InputError: the file is damaged, or belongs to other work; the message names the kind that
        differs.
    """
    data = io.BytesIO(read_file(path, "a checkpoint"))
    try:
        with np.load(data, allow_pickle=False) as file:
            about = json.loads(str(file[_ABOUT]))
            theirs = dict(about.pop(_WORK))
            values = {kind: theirs.get(kind) for kind in work}
            arrays = {name: file[name] for name in file.files if name != _ABOUT}
        state = restored(about, arrays) if values == work else None
    except Exception as error:
        # Of NumPy, zip, JSON or the state's own class: whatever it is, the file is no such state.
        raise InputError(
            f"{path}: expected a checkpoint, got a file that cannot be read as one; {restart}"
        ) from error
    for kind, text in work.items():
        if values[kind] != text:
            raise InputError(
                f"{path}: expected a checkpoint of this {kind}, got one of another; {restart}, or "
                f"{elsewhere}"
            )
    assert state is not None
    return state


class Checkpoint:
    """Results of pieces of work, rows of numbers by kind in the order in which they came, kept in a
    file at intervals: work that is begun again takes those there instead of doing them.

    In a context it is written when an error or an interrupt ends it, and removed when it ends well.
    """

    def __init__(self, path: Path | None = None, work: Mapping[str, str] | None = None) -> None:
        """path: None keeps no file. work: as of `read_checkpoint`, which raises where there is a
        file of other work."""
        self._work = dict(work or {})
        self._rows: dict[str, list[NDArray[Any]]] = {}
        self._file = None if path is None else AutosavedFile(path, "a checkpoint", self._content)
        if path is not None and os.path.lexists(path):
            self._rows = read_checkpoint(
                path,
                self._work,
                _rows,
                restart="remove it to start again",
                elsewhere="choose another with --out",
            )

    def rows(self, kind: str) -> Sequence[NDArray[Any]]:
        """The results of a kind so far, arrays (n,)."""
        return self._rows.setdefault(kind, [])

    def add(self, kind: str, rows: Sequence[NDArray[Any]]) -> None:
        """Take results in that belong together, and write the file if that is due. Raises
        OutputError."""
        self._rows.setdefault(kind, []).extend(rows)
        if self._file is not None:
            self._file.change()

    def require(self, fits: bool) -> None:
        """Raise InputError where rows are not what the work makes."""
        if not fits:
            path = None if self._file is None else self._file.path
            raise InputError(
                f"{path}: expected a checkpoint of this work, got rows of other lengths; remove it "
                "to start again"
            )

    def _content(self) -> bytes:
        lengths = {kind: [len(row) for row in rows] for kind, rows in self._rows.items() if rows}
        arrays = {kind: np.concatenate(self._rows[kind]) for kind in lengths}
        return checkpoint_bytes(self._work, {"rows": lengths}, arrays)

    def __enter__(self) -> Checkpoint:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._file is None:
            return
        if error is None:
            self._file.remove()
            return
        self._file.save()
        if isinstance(error, KeyboardInterrupt) and any(self._rows.values()):
            raise KeyboardInterrupt(
                f"what was done is in {self._file.path}; run the same command to go on"
            ) from error


def _rows(state: Mapping[str, Any], arrays: Arrays) -> dict[str, list[NDArray[Any]]]:
    """What `Checkpoint` keeps. Raises ValueError or KeyError: the lengths are not those of the
    arrays, or these are not of numbers."""
    rows = {}
    for kind, of_kind in state["rows"].items():
        array = arrays[kind]
        if array.dtype.kind not in "if" or array.shape != (sum(of_kind),) or min(of_kind) < 0:
            raise ValueError(f"{kind}: {array.dtype} {array.shape} for rows of {sum(of_kind)}")
        rows[kind] = np.split(array, np.cumsum(of_kind)[:-1])
    return rows
