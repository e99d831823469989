"""The folder of results that a run leaves."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from dicedesign.errors import OutputError
from dicedesign.runtime.clock import Clock
from dicedesign.runtime.files import atomic_write

__all__ = ["CHECKPOINT", "CONVERGED", "RunResult", "add_report", "write_results"]

CONVERGED: Final = "converged"
"""The one status of success."""

RESULT: Final = "result.json"

OWNED: Final = (
    "die.stl",
    "die_plain.stl",
    "recipe.yaml",
    "report.html",
    "bars.png",
    "convergence.png",
    "gauss_map.png",
    "views.png",
    "labels.png",
    "rests.png",
    "before_after.png",
    "odds.png",
    "hull.png",
    "displacement.png",
    "crossings.png",
    "energy.png",
    "table.png",
    "rounds.png",
    "film.png",
    "throw.gif",
)
"""Files that a run may write besides `RESULT`; those that it does not write are removed."""

CHECKPOINT: Final = "checkpoint.npz"
"""What a run that is not finished goes on from; removed once the results are there."""


@dataclass(frozen=True)
class RunResult:
    """What a run produced.

    Attributes
    ----------
    status: as in result.json; `CONVERGED` only if the finished die is within the tolerance.
    message: the same in a sentence.
    notes: what was repaired or assumed about the start, a size other than the recipe's, what was
        changed for printing, and odds that the engraving changes much, one sentence each.
    folder: where the files are.
    summary: the content of result.json.
    """

    status: str
    message: str
    notes: tuple[str, ...]
    folder: Path
    summary: dict[str, Any]

    @property
    def converged(self) -> bool:
        """Whether the die meets the recipe's tolerance."""
        return self.status == CONVERGED


def _files_by_kind(names: Iterable[str]) -> dict[str, str]:
    """Names of the files that are to be written, the page and `RESULT` included, by what they
    are."""
    given = {*names, "report.html"}
    written = [name for name in OWNED if name in given]
    return {Path(name).stem: name for name in [*written, RESULT]}


def add_report(
    files: dict[str, bytes],
    summary: dict[str, Any],
    images: Mapping[str, bytes],
    recipe: str,
    clock: Clock,
    page: Callable[[Mapping[str, Any], Mapping[str, bytes]], str],
) -> None:
    """Complete what a run leaves: add figures, recipe and page to the files, and to the summary
    "files", "stages" and "peak_since".

    images: bytes of the figures by name, "throw" as GIF and all others as PNG; page: makes the page
    of summary and figures.
    """
    files.update({_image_file(name): data for name, data in images.items()})
    files["recipe.yaml"] = recipe.encode("utf-8")
    summary["files"] = _files_by_kind(files)
    # The same list as the clock's: the page shows the stages before its own, result.json all.
    summary["stages"] = clock.stages
    summary["peak_since"] = clock.peak_since
    with clock.stage("report"):
        files["report.html"] = page(summary, images).encode("utf-8")


def _image_file(name: str) -> str:
    return f"{name}.gif" if name == "throw" else f"{name}.png"


def write_results(folder: Path, files: Mapping[str, bytes], summary: Mapping[str, Any]) -> None:
    """Write the files of a finished run, and remove those that an earlier run left.

    Each file appears whole or not at all, and `RESULT` last: a folder that has it is complete.

    Parameters
    ----------
    folder: an existing one.
    files: contents by name, all names in `OWNED`.
    summary: the content of `RESULT`.

    Raises
    ------
    OutputError: a file cannot be removed or written.
    """
    _remove(folder, [RESULT, *(name for name in OWNED if name not in files)])
    for name, data in files.items():
        atomic_write(folder / name, data)
    text = json.dumps(summary, indent=1, allow_nan=False) + "\n"
    atomic_write(folder / RESULT, text.encode("utf-8"))
    _remove(folder, [CHECKPOINT])


def _remove(folder: Path, names: Iterable[str]) -> None:
    try:
        for name in names:
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(
            f"{folder}: expected old results that can be removed, but {error.strerror}; choose "
            "another folder with --out"
        ) from error
