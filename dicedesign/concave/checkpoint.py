"""The state of a search for a concave die as a file, from which it goes on later."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import asdict
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.concave.result import ConcaveProgress, ConcaveStep, FilledHull
from dicedesign.errors import InputError
from dicedesign.runtime.files import read_file

__all__ = ["checkpoint_bytes", "read_checkpoint"]

_ARRAYS: Final = ("points", "hull_points", "directions")
"""Of `FilledHull`; all else is text in JSON."""

_DAMAGED: Final = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile)
"""Errors of NumPy, JSON and the classes about a file that is not such a state."""


def checkpoint_bytes(progress: ConcaveProgress, search: dict[str, str]) -> bytes:
    """The content of a checkpoint: arrays and a JSON text in NumPy's format, nothing pickled.

    search: what the progress belongs to, by kind, as in `read_checkpoint`.
    """
    about = {
        "search": search,
        "attempts": progress.attempts,
        "seconds": progress.seconds,
        "best": None,
        "history": [asdict(step) for step in progress.history],
    }
    arrays = {}
    if progress.best is not None:
        best = dict(vars(progress.best))
        arrays = {name: best.pop(name) for name in _ARRAYS}
        about["best"] = best
    file = io.BytesIO()
    np.savez(file, about=np.array(json.dumps(about)), **arrays)
    return file.getvalue()


def read_checkpoint(path: Path, search: dict[str, str]) -> ConcaveProgress:
    """The progress in a file that `checkpoint_bytes` made.

    search: texts that must be those it was written with, by kind, such as "recipe".

    Raises
    ------
    InputError: the file is missing or damaged, or belongs to another search; the message names the
        kind that differs.
    """
    if not path.exists():
        raise InputError(
            f"{path}: expected the checkpoint of a run that was interrupted, got none; run without "
            "--resume to begin"
        )
    try:
        with np.load(io.BytesIO(read_file(path, "a checkpoint")), allow_pickle=False) as file:
            about = json.loads(str(file["about"]))
            theirs, best = about["search"], about["best"]
            if best is not None:
                best = FilledHull(**best, **{name: file[name] for name in _ARRAYS})
        progress = ConcaveProgress(
            attempts=about["attempts"],
            seconds=about["seconds"],
            best=best,
            history=tuple(ConcaveStep(**step) for step in about["history"]),
        )
    except _DAMAGED as error:
        raise InputError(
            f"{path}: expected a checkpoint, got a file that cannot be read as one; run without "
            "--resume to begin anew"
        ) from error
    for kind, text in search.items():
        if theirs.get(kind) != text:
            raise InputError(
                f"{path}: expected a checkpoint of this {kind}, got one of another; run without "
                "--resume to begin anew, or choose another folder with --out"
            )
    return progress
