"""Options and output that several commands share."""

from __future__ import annotations

import math
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.cli.shared_options import WithFiles, WithWorkers
from dicedesign.errors import InputError, printable
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.files import json_text
from dicedesign.runtime.outputs import check_files

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from numpy.typing import ArrayLike
    from tqdm import tqdm

    from dicedesign.batch.rest_rows import Center
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.rest.poses import RestPoses
    from dicedesign.runtime.arrays import Floats

MISSING_KERNELS = (
    "without the compiled kernels this takes many times as long; install the package where "
    "there is a C++ compiler"
)


@dataclass(frozen=True)
class Workers:
    """Workers with a progress bar on stderr.

    Attributes
    ----------
    executor: executor of tasks.
    jobs: number of parallel tasks.
    bar: progress bar.
    """

    executor: Executor
    jobs: int
    bar: tqdm[Any]


@contextmanager
def workers_of(options: WithWorkers, unit: str, total: int, done: int = 0) -> Iterator[Workers]:
    """Open workers by the options, and note missing kernels.

    unit, total, done: as in `progress_bar`. Raises as `cluster_workers`.
    """
    # Most commands need none.
    from dicedesign.runtime import workers

    jobs = options.jobs
    with ExitStack() as stack:
        if options.scheduler is None:
            note_missing_kernels()
            jobs = min(jobs or os.cpu_count() or 1, total - done)
            executor = stack.enter_context(workers.local_workers(jobs))
        else:
            executor, threads = stack.enter_context(workers.cluster_workers(options.scheduler))
            jobs = jobs or threads
        bar = stack.enter_context(workers.progress_bar(unit, total, done))
        yield Workers(executor, jobs, bar)


def note_missing_kernels() -> None:
    """Print a note on stderr if the compiled kernels are missing."""
    if not kernels.available():
        with suppress(OSError):
            print_notes(MISSING_KERNELS)


def print_notes(*texts: object) -> None:
    """Print notes on stderr, one line each."""
    for text in texts:
        print(f"note: {printable(text)}", file=sys.stderr)


FIGURE_ENDINGS = (".pdf", ".svg", ".png")
"""Endings of files of figures."""


def require_ending(option: str, path: Path, *endings: str) -> None:
    """Raise InputError with the option's name if a path has another ending, in any case."""
    if path.suffix.lower() not in endings:
        *others, last = endings
        names = f"{', '.join(others)} or {last}" if others else last
        raise InputError(f"{option}: expected a path that ends in {names}, got {path}; rename it")


def require_figure(options: WithFiles, path: Path | None) -> None:
    """Raise InputError if a path given by --figure is none of a figure, or as `check_outputs`."""
    if path is not None:
        require_ending("--figure", path, *FIGURE_ENDINGS)
        check_outputs(options, path, option="--figure")


OUTPUTS = ("out", "file", "figure", "log")
"""Arguments that name files to write."""


def check_outputs(options: WithFiles, *paths: Path, option: str = "--out") -> None:
    """Raise InputError if files to write are there already, or are inputs.

    options: of the command; what they name besides `OUTPUTS` is an input. paths: files to write.
    option: that names them. Raises as `check_files`.
    """
    inputs = []
    for field in fields(options):
        value = getattr(options, field.name)
        for each in value if isinstance(value, list | tuple) else (value,):
            if field.name not in OUTPUTS and isinstance(each, str | Path):
                # Such as FILE:DENSITY and samples:FILE.
                parts = (str(each), *re.split("[:=,]", str(each)))
                inputs += [Path(part) for part in parts if part]
    check_files(paths, inputs, overwrite=options.overwrite, option=option)


def print_files(paths: Iterable[Path]) -> None:
    """Print the paths of the files that were written."""
    print(f"files: {', '.join(map(printable, paths))}")


def direction(vector: Iterable[float]) -> str:
    """Text of a unit vector."""
    # Adding zero removes the sign of -0.
    return "  ".join(f"{x + 0.0:8.5f}" for x in vector)


def percents(fractions: Iterable[float] | None, form: str) -> list[str] | None:
    """Texts of fractions in percent, in the given number format; None for None."""
    return None if fractions is None else [f"{100.0 * part:{form}} %" for part in fractions]


def percent_intervals(intervals: Floats) -> list[str]:
    """Texts of intervals (k, 2) of probabilities, in percent."""
    return [f"{low:7.3f}  {high:7.3f}" for low, high in 100 * intervals]


def text_table(*columns: tuple[str, str, Iterable[object] | None]) -> str:
    """Text of a table with column names.

    columns: name, format specification and values; a column whose values are None is skipped.
        Columns of an empty format are left-aligned, the others right-aligned.
    """
    texts = []
    for name, form, values in columns:
        if values is not None:
            cells = [name, *(format(value, form) for value in values)]
            width = max(map(len, cells))
            texts.append([cell.rjust(width) if form else cell.ljust(width) for cell in cells])
    return "\n".join("  ".join(row).rstrip() for row in zip(*texts, strict=True))


def plain_rows(columns: Mapping[str, Iterable[object] | None]) -> list[dict[str, Any]]:
    """Rows of a table as mappings of plain data; columns that are None are skipped."""
    values = {
        name: [
            each.tolist() if isinstance(each, np.ndarray | np.generic) else each for each in column
        ]
        for name, column in columns.items()
        if column is not None
    }
    return [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True)]


def print_json(plain: object) -> None:
    """Print plain data, all numbers finite, as JSON."""
    print(json_text(plain), end="")


def numbers(option: str, text: str, form: str = "x,y,z") -> Any:
    """Parse a tuple of finite numbers from a text of a form. Raises InputError with the option's
    name."""
    count = form.count(",") + 1
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not all(map(math.isfinite, values)):
        raise InputError(f"{option}: expected {count} numbers {form}, got {text!r}; correct it")
    return values


def center_of_mass(text: str | None) -> Center:
    """Parse the value of `--com`."""
    if text is None or text == "hull":
        return text  # type: ignore[return-value]
    center: Center = numbers("--com", text)
    return center


def find_poses(
    body: Body,
    com: str | None = None,
    coplanar_tolerance: float | None = None,
    parts: Iterable[str] = (),
    *,
    center: ArrayLike | None = None,
) -> tuple[Body, RestPoses]:
    """Add parts to a body and compute its rests; print their notes on stderr.

    com, coplanar_tolerance, parts: values of options; center: center of mass without `--com`.
    """
    # Commands about designed dice do not need these imports.
    from dicedesign.geometry.meshes.reading import read_body
    from dicedesign.rest.poses import rest_poses

    others = [(read_body(file), density) for file, density in map(_parse_part, parts)]
    if others:
        from dicedesign.geometry.meshes.manifold import weighted_body

        body = weighted_body([(body, 1.0), *others])
    place = center if com is None else center_of_mass(com)
    poses = rest_poses(body, place, coplanar_tolerance=coplanar_tolerance)
    print_notes(*poses.notes)
    return body, poses


def _parse_part(text: str) -> tuple[Path, float]:
    """Parse a `--part` into file and density."""
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
