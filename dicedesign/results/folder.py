"""The folder of results that a run leaves."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from dicedesign.errors import OutputError
from dicedesign.results.record import RESULT, Result
from dicedesign.runtime.files import (
    atomic_write,
    interrupts_held,
    locked_folder,
    make_writable_folder,
    remove_partial_files,
)

__all__ = [
    "CHECKPOINT",
    "DATA_SHEETS",
    "PAGE",
    "RECIPE",
    "folder_of_results",
    "write_results",
]

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
    with interrupts_held("the results were complete by then"):
        _remove(folder, [RESULT, *(name for name in owned if name not in files)])
        for name, data in files.items():
            atomic_write(folder / name, data)
        atomic_write(folder / RESULT, told)
        _remove(folder, [CHECKPOINT])


@contextmanager
def folder_of_results(folder: Path) -> Iterator[None]:
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
        with locked_folder(folder):
            remove_partial_files(folder)
            yield
    except BaseException:
        for path in missing:
            # It may not have been made yet, or hold a checkpoint.
            with contextlib.suppress(OSError, ValueError):
                path.rmdir()
        raise


def _remove(folder: Path, names: Iterable[str]) -> None:
    try:
        for name in names:
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(
            f"{folder}: expected old results that can be removed, but {error.strerror}; choose "
            "another folder with --out"
        ) from error
