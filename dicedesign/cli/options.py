"""What several commands read, and how they print."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dicedesign.cli.commands import WithWorkers
from dicedesign.errors import InputError, check_whole
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.files import json_text

if TYPE_CHECKING:
    from dicedesign.batch.batch import Center
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.rest.poses import RestPoses
    from dicedesign.runtime.arrays import Floats
    from dicedesign.runtime.workers import Workers

MISSING_KERNELS: Final = (
    "without the compiled kernels this takes many times as long; install the package where "
    "there is a C++ compiler"
)

MAX_JOBS: Final = 4096
"""More processes than any machine bears."""


def check_worker_options(options: WithWorkers) -> None:
    """Raise InputError for a number of jobs or an address that cannot be meant."""
    if options.jobs is not None:
        check_whole("--jobs", options.jobs, most=MAX_JOBS)
    if options.scheduler is not None and "://" not in options.scheduler:
        raise InputError(
            "--scheduler: expected an address such as tcp://10.0.0.5:8786, got "
            f"{options.scheduler!r}; the scheduler prints its own when it starts"
        )


def workers_of(
    options: WithWorkers, unit: str, total: int, done: int = 0
) -> AbstractContextManager[Workers]:
    """The workers that the options ask for; unit, total, done: as of `open_workers`. Says whether
    those of this machine are slow."""
    from dicedesign.runtime.workers import open_workers

    if options.scheduler is None:
        note_missing_kernels()
    return open_workers(unit, total, done, jobs=options.jobs, scheduler=options.scheduler)


def note_missing_kernels() -> None:
    """Say on stderr that a command takes long as there are no kernels, if so."""
    if not kernels.available():
        with suppress(OSError):
            print_note(MISSING_KERNELS)


def print_note(text: str) -> None:
    """Say something on stderr."""
    print(f"note: {text}", file=sys.stderr)


def direction(vector: Iterable[float]) -> str:
    """A unit vector for people."""
    # Adding zero takes the sign off a zero.
    return "  ".join(f"{x + 0.0:8.5f}" for x in vector)


def percents(parts: Iterable[float] | None, form: str) -> list[str] | None:
    """Parts of 1 in percent, each in a format; None for none."""
    return None if parts is None else [f"{100.0 * part:{form}} %" for part in parts]


def percent_intervals(intervals: Floats) -> list[str]:
    """Limits (k, 2) of probabilities, in percent."""
    return [f"{low:7.3f}  {high:7.3f}" for low, high in 100 * intervals]


def text_table(*columns: tuple[str, str, Iterable[object] | None]) -> str:
    """A table, beginning with the names of its columns.

    columns: name, format, as of `format`, and values of each; None leaves it out. One whose format
        is empty is of texts and begins at the left; the others, numbers or texts of the format ">",
        end at the right.
    """
    texts = []
    for name, form, values in columns:
        if values is not None:
            cells = [name, *(format(value, form) for value in values)]
            width = max(map(len, cells))
            texts.append([cell.rjust(width) if form else cell.ljust(width) for cell in cells])
    return "\n".join("  ".join(row).rstrip() for row in zip(*texts, strict=True))


def plain_rows(columns: Mapping[str, Iterable[object] | None]) -> list[dict[str, Any]]:
    """A mapping of plain data for each row of a table; a column that is None is left out."""
    values = {
        name: [
            each.tolist() if isinstance(each, np.ndarray | np.generic) else each for each in column
        ]
        for name, column in columns.items()
        if column is not None
    }
    return [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True)]


def print_json(plain: object) -> None:
    """Print plain data, which have finite numbers only."""
    print(json_text(plain), end="")


def numbers(option: str, text: str, form: str) -> list[float]:
    """The finite numbers of a text such as "x,y,z", which is its form. Raises InputError naming the
    option."""
    count = form.count(",") + 1
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        word = {2: "two", 3: "three", 6: "six"}[count]
        raise InputError(f"{option}: expected {word} numbers {form}, got {text!r}")
    return values


def vector(option: str, text: str) -> tuple[float, float, float]:
    """The three finite numbers of "x,y,z". Raises InputError naming the option."""
    x, y, z = numbers(option, text, "x,y,z")
    return x, y, z


def center_of_mass(text: str | None) -> Center:
    """The center of mass that `--com` asks for."""
    if text is None or text == "hull":
        return text  # type: ignore[return-value]
    return vector("--com", text)


def read_poses(
    path: Path,
    center: Center | Floats = None,
    coplanar_tolerance: float | None = None,
    parts: Sequence[str] = (),
) -> tuple[Body, RestPoses]:
    """The body of a file and its rests; notes about them go to stderr.

    center, coplanar_tolerance: as in `rest_poses`; parts: what `--part` gives.
    """
    # Imported here, as commands of designed dice do without.
    from dicedesign.geometry.meshes.reading import read_body, without_solids
    from dicedesign.rest.poses import rest_poses

    with without_solids():
        body = read_body(path)
        others = [(read_body(file), density) for file, density in map(_part, parts)]
    if others:
        from dicedesign.geometry.meshes.manifold import weighted_body

        body = weighted_body([(body, 1.0), *others])
    poses = rest_poses(body, center, coplanar_tolerance=coplanar_tolerance)
    for each in poses.notes:
        print_note(each)
    return body, poses


def _part(text: str) -> tuple[Path, float]:
    """The file and the density that a `--part` gives."""
    path, _, density = text.rpartition(":")
    try:
        number = float(density)
    except ValueError:
        number = math.nan
    if not path or not 0.0 <= number < math.inf:
        raise InputError(
            f"--part: expected FILE:DENSITY with a density from 0 on, got {text!r}; write it such "
            "as ball.stl:7.8"
        )
    return Path(path), number
