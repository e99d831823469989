"""The folder of results that a run leaves, written and read back."""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.errors import InputError, OutputError
from dicedesign.results.result import RESULT, Result
from dicedesign.runtime.files import (
    atomic_write,
    hold_interrupts,
    lock_folder,
    make_writable_folder,
    read_file,
    remove_partial_files,
)
from dicedesign.tolerances import PROBABILITY_SUM_TOLERANCE

CHECKPOINT: Final = "checkpoint.npz"
"""State of a search that can be resumed; gone once the search is finished."""

RECIPE: Final = "recipe.yaml"
"""The recipe with every default written out."""

PAGE: Final = "report.html"
"""The report."""

DATA_SHEETS: Final = ("data_sheet.pdf", "data_sheet.png")
"""The page to print."""

SOLIDS: Final = (
    "die.stl",
    "die_inlay.stl",
    "die_oriented.stl",
    "die_plain.stl",
)
"""The die with its labels cut in, bodies that fill these, the die as it lies on a print bed,
without labels, and pillars under the one on the bed."""


def write_results(
    folder: Path, files: Mapping[str, bytes], result: Result, names: Iterable[str]
) -> None:
    """Write the files of a finished run, and remove those that an earlier run left.

    Each file appears whole or not at all, and `RESULT` last: a folder that has it is complete. An
    interrupt waits until then.

    Parameters
    ----------
    folder: an existing one.
    files: contents by name. result: the content of `RESULT`.
    names: of the files that runs may leave beside `SOLIDS`, `RECIPE`, `PAGE` and `DATA_SHEETS`.

    Raises
    ------
    OutputError: a file cannot be removed or written.
    """
    owned = dict.fromkeys([*SOLIDS, RECIPE, PAGE, *DATA_SHEETS, *names])
    told = result.json_text().encode("utf-8")
    with hold_interrupts("the results were complete by then"):
        remove_files(folder, [RESULT, *(name for name in owned if name not in files)])
        for name, data in files.items():
            atomic_write(folder / name, data)
        atomic_write(folder / RESULT, told)
        remove_files(folder, [CHECKPOINT])


@contextmanager
def open_results_folder(folder: Path) -> Iterator[None]:
    """Have a folder alone that can be written, made if missing; what a killed process left half
    written is removed, and folders in which an error leaves nothing go again.

    Raises
    ------
    InputError: another process is writing into it. OutputError: it cannot be written.
    """
    missing = [path for path in (folder, *folder.parents) if not os.path.exists(path)]
    try:
        # Nobody waits for a die that cannot be kept.
        make_writable_folder(folder)
        with lock_folder(folder):
            remove_partial_files(folder)
            yield
    except BaseException:
        for path in missing:
            # It may not have been made yet, or hold a checkpoint.
            with contextlib.suppress(OSError, ValueError):
                path.rmdir()
        raise


def remove_files(folder: Path, names: Iterable[str]) -> None:
    """Remove files of a folder where they are there. Raises OutputError."""
    try:
        for name in names:
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(
            f"{folder}: expected old results that can be removed, but {error.strerror}; choose "
            "another folder with --out"
        ) from error


def read_result(folder: Path | str) -> Result:
    """The result in a folder that a run left.

    Raises InputError: no run left that folder, or its result.json is damaged.
    """
    from pydantic import TypeAdapter, ValidationError

    path = Path(folder) / RESULT
    try:
        result = TypeAdapter(Result).validate_json(read_file(path, "a result"))
        _check(result)
        result = dataclasses.replace(result, folder=Path(folder))
    except (ValueError, RecursionError) as error:
        if isinstance(error, ValidationError):
            first = error.errors()[0]
            key = ".".join(str(part) for part in first["loc"]) or "the file"
            is_old = first["type"] == "missing" and key == "design"
            reason = "the layout of an older version" if is_old else f"{key}: {first['msg']}"
        else:
            reason = getattr(error.__cause__, "strerror", None) or str(error)
        raise InputError(
            f"{path}: expected the result of a finished run, got {reason}; name a folder that "
            "`dicedesign run` left, or run its recipe.yaml again"
        ) from error
    return result


def _check(result: Result) -> None:
    """Raise ValueError where labels, probabilities and facets do not fit together."""
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
    if not {label for label, _ in result.shown} <= set(labels):
        raise ValueError("facets with labels that the die has not")
    if "die_plain" not in result.files:
        raise ValueError("no file of the die")
