"""Options that several commands have, and what they print alike."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dicedesign.errors import InputError
from dicedesign.runtime.checks import check_whole
from dicedesign.runtime.files import atomic_write, json_text
from dicedesign.runtime.text import printable

if TYPE_CHECKING:
    from dicedesign.runtime.checkpoint import Checkpoint
    from dicedesign.runtime.workers import Workers

__all__ = [
    "MISSING_KERNELS",
    "add_engine_option",
    "add_worker_options",
    "check_worker_options",
    "checkpoint_beside",
    "direction",
    "json_path",
    "note_missing_kernels",
    "numbers",
    "percent_interval",
    "print_json",
    "vector",
    "workers_of",
    "write_table",
]

MISSING_KERNELS: Final = (
    "note: without the compiled kernels this takes many times as long; install the package where "
    "there is a C++ compiler"
)

MOST_JOBS: Final = 4096
"""More processes than any machine bears."""


def add_worker_options(parser: argparse.ArgumentParser, jobs_help: str, where: str = "") -> None:
    """Add `--jobs` and `--scheduler`; where: what their help begins with."""
    parser.add_argument("--jobs", type=int, metavar="J", help=where + jobs_help)
    parser.add_argument(
        "--scheduler",
        metavar="tcp://HOST:PORT",
        help=f"{where}run on the Dask cluster of this address, tls://HOST:PORT if encrypted; needs "
        "the extra 'cluster' (default: on this machine)",
    )


def add_engine_option(parser: argparse.ArgumentParser) -> None:
    """Add `--engine`, the simulator of throws."""
    from dicedesign.throws.engines.engine import ENGINES

    *lines, last = (f"{engine.name}: {engine.line}" for engine in ENGINES)
    parser.add_argument(
        "--engine",
        default="native",
        metavar="NAME",
        help=f"{'; '.join(lines)}; or {last} (default: native)",
    )


def check_worker_options(options: argparse.Namespace) -> None:
    """Raise InputError for a number of jobs or an address that cannot be meant."""
    if options.jobs is not None:
        check_whole("--jobs", options.jobs, most=MOST_JOBS)
    if options.scheduler is not None and "://" not in options.scheduler:
        raise InputError(
            "--scheduler: expected an address such as tcp://10.0.0.5:8786, got "
            f"{options.scheduler!r}; the scheduler prints its own when it starts"
        )


def workers_of(
    options: argparse.Namespace, unit: str, total: int, done: int = 0
) -> AbstractContextManager[Workers]:
    """The workers that the options ask for; unit, total, done: as of `open_workers`. Says whether
    those of this machine are slow."""
    from dicedesign.runtime.workers import open_workers

    if options.scheduler is None:
        note_missing_kernels()
    return open_workers(unit, total, done, jobs=options.jobs, scheduler=options.scheduler)


def note_missing_kernels() -> None:
    """Say on stderr that a command takes long as there are no kernels, if so."""
    from dicedesign.kernels import ops as kernels

    if not kernels.available():
        with suppress(OSError):
            print(MISSING_KERNELS, file=sys.stderr)


def json_path(path: Path) -> Path:
    """The path that `--out` gives for a table of throw parameters. Raises InputError: it does not
    end in .json."""
    if path.suffix != ".json":
        raise InputError(f"--out: expected a path that ends in .json, got {path}; rename it")
    return path


def checkpoint_beside(out: Path | None, work: Mapping[str, str]) -> Checkpoint:
    """The checkpoint of work whose result will be written, with a note if there is one already;
    without a result to be written, one that keeps no file.

    work: as of `Checkpoint`. Raises InputError: the one there is of other work.
    """
    from dicedesign.runtime.checkpoint import Checkpoint

    if out is None:
        return Checkpoint()
    path = out.with_suffix(".checkpoint.npz")
    checkpoint = Checkpoint(path, {**work, "version of dicedesign": version("dicedesign")})
    if os.path.exists(path):
        print(f"note: goes on from {printable(path)}", file=sys.stderr)
    return checkpoint


def write_table(path: Path, entries: dict[str, Any]) -> None:
    """Write the file of a table of throw parameters, and say so."""
    atomic_write(path, json_text(entries).encode())
    print(f"note: wrote {printable(path)}", file=sys.stderr)


def direction(vector: Iterable[float]) -> str:
    """A unit vector for people."""
    # Adding zero takes the sign off a zero.
    return "  ".join(f"{x + 0.0:8.5f}" for x in vector)


def percent_interval(interval: Iterable[float]) -> str:
    """Limits of a probability, in percent."""
    return "  ".join(f"{100 * limit:7.3f}" for limit in interval)


def print_json(plain: object) -> None:
    """Print plain data, which have finite numbers only."""
    print(json_text(plain), end="")


WORDS = {2: "two", 3: "three", 6: "six"}


def numbers(option: str, text: str, form: str) -> list[float]:
    """The finite numbers of a text such as "x,y,z", which is its form. Raises InputError naming the
    option."""
    count = form.count(",") + 1
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        raise InputError(f"{option}: expected {WORDS[count]} numbers {form}, got {text!r}")
    return values


def vector(option: str, text: str) -> tuple[float, float, float]:
    """The three finite numbers of "x,y,z". Raises InputError naming the option."""
    x, y, z = numbers(option, text, "x,y,z")
    return x, y, z
