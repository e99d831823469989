"""Checkpoint files to resume long work."""

from __future__ import annotations

import io
import json
import os
import time
import zipfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import CheckpointError, InputError, OutputError
from dicedesign.runtime.files import (
    atomic_write,
    read_file,
    remove_files,
    remove_partial_files,
)
from dicedesign.runtime.interrupts import hold_interrupts
from dicedesign.runtime.workers import in_order

INTERVAL = 5.0
"""Minimum seconds between writes."""

SHARE = 0.02
"""Maximum share of run time for writing the file."""


class AutosavedFile:
    """File that one process rewrites atomically, at intervals."""

    def __init__(self, path: Path, kind: str, content: Callable[[], bytes]) -> None:
        """kind: name for messages, such as "a table"; content: makes the bytes to write. Writes
        nothing yet, but removes partial files of a killed process."""
        remove_partial_files(path.parent, path.name)
        self.path = path
        self._kind = kind
        self._content = content
        self._new = False
        self._written = _state(path)
        self._due = 0.0

    @property
    def is_due(self) -> bool:
        """Whether the interval since the last write has passed."""
        return time.monotonic() >= self._due

    def change(self) -> None:
        """Mark the content as new, and save it if that is due. Raises OutputError as `save`."""
        self._new = True
        if self.is_due:
            self.save()

    def save(self) -> None:
        """Write the content if it is new.

        Raises OutputError: the file cannot be written, or another process has written it.
        """
        if not self._new:
            return
        started = time.monotonic()
        data = self._content()
        if _state(self.path) not in (None, self._written):
            raise OutputError(
                f"{self.path}: expected {self._kind} that only this run writes, but another one "
                "is writing it; wait until that one has ended, then repeat the command to resume"
            )
        with hold_interrupts("nothing half-written was left"):
            atomic_write(self.path, data)
            self._written, self._new = _state(self.path), False
        ended = time.monotonic()
        self._due = ended + max(INTERVAL, (ended - started) / SHARE)


def _state(path: Path) -> tuple[int, int] | None:
    """Size and modification time of a file; None if it is missing."""
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return status.st_size, status.st_mtime_ns


Arrays = Mapping[str, NDArray[Any]]

State = TypeVar("State")

_ABOUT = "about"
"""Name of the JSON text in the archive."""

_WORK = "work"
"""Key of the work in that text."""


def checkpoint_bytes(work: Mapping[str, str], state: Mapping[str, Any], arrays: Arrays) -> bytes:
    """Content of a checkpoint: arrays and a JSON text in NumPy's format, without pickles.

    Parameters
    ----------
    work: texts that identify the work, by kind, as in `read_checkpoint`.
    state: plain data by name. arrays: by name.
    """
    file = io.BytesIO()
    about = json.dumps({_WORK: dict(work), **state})
    entries: dict[str, Any] = {_ABOUT: np.array(about), **arrays}
    np.savez(file, **entries)
    return file.getvalue()


def read_checkpoint(
    path: Path, work: Mapping[str, str], restore: Callable[[Any, Arrays], State]
) -> State:
    """Read the state from a file of `checkpoint_bytes`.

    Parameters
    ----------
    work: texts that must equal the stored ones, by kind, such as "seed".
    restore: makes the state from its plain data and arrays.

    Raises
    ------
    InputError: the file is missing or damaged. CheckpointError: it is of other work; the message
        names the differing kind.
    """
    if not os.path.lexists(path):
        raise InputError(
            f"{path}: expected the checkpoint of a run that was interrupted, got none; run without "
            "--resume to start again"
        )
    data = read_file(path, "a checkpoint")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            # NumPy does not compress them.
            if sum(member.file_size for member in archive.infolist()) > len(data):
                raise ValueError("more content than bytes")
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            about = json.loads(str(file[_ABOUT]))
            theirs = dict(about.pop(_WORK))
            stored_work = {kind: theirs.get(kind) for kind in work}
            arrays = {name: file[name] for name in file.files if name != _ABOUT}
        state = restore(about, arrays) if stored_work == work else None
    except Exception as error:
        # Errors of NumPy, zip, JSON or the class of the state all mean a damaged file.
        raise InputError(
            f"{path}: expected a checkpoint, got a file that cannot be read as one; remove it to "
            "start again"
        ) from error
    for kind, text in work.items():
        if stored_work[kind] != text:
            raise CheckpointError(
                f"{path}: expected a checkpoint of this {kind}, got one of another; remove it, run "
                "without --resume, or choose another folder with --out"
            )
    assert state is not None
    return state


def is_checkpoint(path: Path) -> bool:
    """Whether a file is a checkpoint, of any work."""
    try:
        read_checkpoint(path, {}, lambda *_: True)
    except InputError:
        return False
    return True


class Checkpoint:
    """Partial results, rows of numbers by kind, saved to a file at intervals so that repeated work
    can skip them.

    As a context, it saves the file after an error or an interrupt, and removes it on success.
    """

    def __init__(
        self,
        path: Path | None = None,
        work: Mapping[str, str] | None = None,
        *,
        resume: bool | None = None,
    ) -> None:
        """path: file, None for none. work: as in `read_checkpoint`, which raises for a file of
        other work. resume: whether to read the file, by an option --resume; None reads it if it
        exists."""
        self._work = dict(work or {})
        self._again = "repeat the command" if resume is None else "run it again with --resume"
        self._rows: dict[str, list[NDArray[Any]]] = {}
        self._file = None if path is None else AutosavedFile(path, "a checkpoint", self._content)
        if path is not None and (resume or (resume is None and os.path.lexists(path))):
            self._rows = read_checkpoint(path, self._work, _restore_rows)

    def rows(self, kind: str) -> Sequence[NDArray[Any]]:
        """Results of a kind so far, arrays (n,)."""
        return self._rows.setdefault(kind, [])

    def add(self, kind: str, rows: Sequence[NDArray[Any]]) -> None:
        """Add results that belong together, and save the file if that is due. Raises
        OutputError."""
        self._rows.setdefault(kind, []).extend(rows)
        if self._file is not None:
            self._file.change()

    def results(
        self,
        kind: str,
        tasks: Sequence[Callable[[], NDArray[Any]]],
        workers: Executor | None = None,
        on_result: Callable[[NDArray[Any]], object] = lambda _: None,
    ) -> list[NDArray[Any]]:
        """Results (n,) of tasks in order; those known of a kind are not run again.

        workers: run the tasks; None runs them in this thread. on_result: called with each result.
        Raises as `in_order` and `add`.
        """
        rows = self.rows(kind)
        for row in rows:
            on_result(row)
        new = tasks[len(rows) :]
        for row in (task() for task in new) if workers is None else in_order(new, workers):
            self.add(kind, [row])
            on_result(row)
        return list(rows)

    def save(self) -> None:
        """Save results that are not in the file. Raises OutputError."""
        if self._file is not None:
            self._file.save()

    def _content(self) -> bytes:
        lengths = {kind: [len(row) for row in rows] for kind, rows in self._rows.items() if rows}
        arrays = {kind: np.concatenate(self._rows[kind]) for kind in lengths}
        return checkpoint_bytes(self._work, {"rows": lengths}, arrays)

    def __enter__(self) -> Checkpoint:
        return self

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
        if self._file is None:
            return
        if error is None:
            remove_files(self._file.path.parent, [self._file.path.name])
            return
        self._file.save()
        # Complete results leave no file.
        is_resumable = any(self._rows.values()) and os.path.exists(self._file.path)
        if isinstance(error, KeyboardInterrupt) and is_resumable:
            raise KeyboardInterrupt(
                f"the results so far are in {self._file.path}; {self._again} to go on"
            ) from error


def _restore_rows(state: Mapping[str, Any], arrays: Arrays) -> dict[str, list[NDArray[Any]]]:
    """Restore the rows of a `Checkpoint`. Raises ValueError or KeyError if lengths and arrays do
    not match, or arrays are not numeric."""
    rows = {}
    for kind, of_kind in state["rows"].items():
        array = arrays[kind]
        if array.dtype.kind not in "if" or array.shape != (sum(of_kind),) or min(of_kind) < 0:
            raise ValueError(f"{kind}: {array.dtype} {array.shape} for rows of {sum(of_kind)}")
        rows[kind] = np.split(array, np.cumsum(of_kind)[:-1])
    return rows
