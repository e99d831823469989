"""The state of a search for a concave die as a file, from which it goes on later."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from dicedesign.concave.result import ConcaveProgress, ConcaveStep, FilledHull
from dicedesign.errors import InputError
from dicedesign.results.trade_off import Draft
from dicedesign.runtime import checkpoint
from dicedesign.runtime.checkpoint import Arrays

__all__ = ["checkpoint_bytes", "read_checkpoint"]

_ARRAYS: Final = ("points", "hull_points", "center_of_mass", "directions")
"""Of `FilledHull`; all else is text in JSON."""


def checkpoint_bytes(progress: ConcaveProgress, search: Mapping[str, str]) -> bytes:
    """The content of a checkpoint.

    search: what the progress belongs to, by kind, as in `read_checkpoint`.
    """
    state: dict[str, Any] = {
        "attempts": progress.attempts,
        "seconds": progress.seconds,
        "best": None,
        "tried": [asdict(attempt) for attempt in progress.tried],
        "history": [asdict(step) for step in progress.history],
    }
    arrays = {}
    if progress.best is not None:
        best = dict(vars(progress.best))
        arrays = {name: best.pop(name) for name in _ARRAYS}
        state["best"] = best
    return checkpoint.checkpoint_bytes(search, state, arrays)


def read_checkpoint(path: Path, search: Mapping[str, str]) -> ConcaveProgress:
    """The progress in a file that `checkpoint_bytes` made.

    search: texts that must be those it was written with, by kind, such as "recipe".

    Raises
    ------
    InputError: the file is missing or damaged, or belongs to another search; the message names the
        kind that differs.
    """
    if not os.path.exists(path):
        raise InputError(
            f"{path}: expected the checkpoint of a run that was interrupted, got none; run without "
            "--resume to begin"
        )
    return checkpoint.read_checkpoint(
        path,
        search,
        _progress,
        anew="run without --resume to begin anew",
        elsewhere="choose another folder with --out",
    )


def _progress(state: dict[str, Any], arrays: Arrays) -> ConcaveProgress:
    best = state["best"]
    if best is not None:
        best = FilledHull(**{**best, **{name: arrays[name] for name in _ARRAYS}})
    return ConcaveProgress(
        attempts=state["attempts"],
        seconds=state["seconds"],
        best=best,
        tried=tuple(Draft(**attempt) for attempt in state["tried"]),
        history=tuple(ConcaveStep(**step) for step in state["history"]),
    )
