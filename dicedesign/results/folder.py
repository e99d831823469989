"""Folder of results: written by a run, and read back."""

from __future__ import annotations

import dataclasses
import os
import reprlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from dicedesign.errors import InputError
from dicedesign.results.result import RESULT, Result
from dicedesign.runtime.checkpoint import is_checkpoint
from dicedesign.runtime.files import (
    DESIGN_MEMORY_BYTES,
    check_memory,
    lock_folder,
    open_output_folder,
    read_file,
    remove_files,
    remove_partial_files,
)
from dicedesign.runtime.interrupts import hold_interrupts
from dicedesign.runtime.outputs import (
    MAX_LIST_BYTES,
    UNFINISHED,
    check_folder,
    checksums,
    is_file_name,
    replace_files,
)
from dicedesign.tolerances import PROBABILITY_SUM_TOLERANCE

CHECKPOINT = "checkpoint.npz"
"""State of an unfinished search, to resume it."""

RECIPE = "recipe.yaml"
"""Recipe with every default."""

PAGE = "report.html"
"""Report page."""

SOLIDS = ("die.stl", "die_inlay.stl", "die_oriented.stl", "die_plain.stl")
"""Die with labels, inlays that fill the labels, die oriented on the print bed, die without
labels."""


def write_results(folder: Path, files: Mapping[str, bytes], result: Result) -> Result:
    """Write the files of a finished run, and remove those of an earlier run.

    Each file appears whole or not at all, and `RESULT` last: a folder with it is complete. An
    interrupt waits until then. On a full disk the files of the earlier run stay.

    Parameters
    ----------
    folder: existing folder.
    files: contents by name. result: content of `RESULT`, without checksums.

    Returns the result with checksums.

    Raises
    ------
    InputError: a file is there that no earlier run has written.
    OutputError: a file cannot be removed or written.
    """
    with hold_interrupts("the results were complete by then"):
        sums = checksums(files)
        result = dataclasses.replace(result, sha256=sums)
        with replace_files(folder, files, sums, RESULT, result.json_text().encode("utf-8")):
            pass
        remove_files(folder, [CHECKPOINT])
    return result


@contextmanager
def open_results_folder(
    folder: Path, names: Iterable[str] = (), inputs: Iterable[Path] = ()
) -> Iterator[None]:
    """Make and lock a folder for results, and remove partial files of a killed process. If an error
    leaves the folder empty, remove it with its new parents.

    names: files that will be written or removed. inputs: files that are read.

    Raises
    ------
    InputError: one of these files is there and was not written by an earlier run, or is an input;
        or another process writes into the folder. OutputError: it cannot be written, or the memory
        does not suffice for a design.
    """
    check_memory(DESIGN_MEMORY_BYTES)
    with open_output_folder(folder), lock_folder(folder):
        path = folder / CHECKPOINT
        own = [CHECKPOINT] if os.path.lexists(path) and is_checkpoint(path) else []
        check_folder(folder, [*names, UNFINISHED], inputs, own)
        remove_partial_files(folder)
        yield


def read_result(folder: Path | str) -> Result:
    """Read the result of a finished run; its `changes` say which files have changed since.

    Raises InputError: the folder has no result.json, or an old or damaged one.
    """
    from pydantic import TypeAdapter, ValidationError

    path = Path(folder) / RESULT
    try:
        result = TypeAdapter(Result).validate_json(read_file(path, "a result", most=MAX_LIST_BYTES))
        _check(result)
        result = dataclasses.replace(result, folder=Path(folder))
    except (ValueError, RecursionError) as error:
        if isinstance(error, ValidationError):
            first = error.errors()[0]
            key = ".".join(map(str, first["loc"])) or "the file"
            if first["type"] == "json_invalid":
                reason = "text that is no JSON"
            elif first["type"] != "missing":
                reason = f"{key}: {reprlib.repr(first['input'])}"
            else:
                reason = f"{key}: nothing"
        else:
            reason = getattr(error.__cause__, "strerror", None) or str(error)
        raise InputError(
            f"{path}: expected the result of a finished run, got {reason}; name a folder "
            "written by `dicedesign run`, or run its recipe.yaml again"
        ) from error
    return result


def _check(result: Result) -> None:
    """Raise ValueError if labels, probabilities and facets are inconsistent."""
    labels, target = result.labels, np.array(result.target)
    if len(set(labels)) < len(labels) or len(target) != len(labels):
        raise ValueError(
            "labels that are not all different, or not as many as the target's probabilities"
        )
    if not (target > 0.0).all() or abs(target.sum() - 1.0) > PROBABILITY_SUM_TOLERANCE:
        raise ValueError("a target whose probabilities are not positive or do not sum to 1")
    lengths = {len(result.center_of_mass), *(len(facet.normal) for facet in result.facets)}
    vectors = np.concatenate([result.center_of_mass, *(facet.normal for facet in result.facets)])
    if lengths != {3} or not np.isfinite(vectors).all():
        raise ValueError("vectors that are not three finite numbers")
    if not {label for label, _ in result.outcome_normals} <= set(labels):
        raise ValueError("facets with unknown labels")
    if "die_plain" not in result.files:
        raise ValueError("no file of the die")
    if not all(map(is_file_name, [*result.files.values(), *result.sha256])):
        raise ValueError("files outside of the folder")
