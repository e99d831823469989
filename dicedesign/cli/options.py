"""Commands with work for many processes: their options, their workers and their progress.

Vectors as command-line options."""

from __future__ import annotations

import argparse
import math

from dicedesign.errors import InputError

__all__ = ["add_engine_option", "add_worker_options", "check_worker_options", "numbers", "vector"]


def add_worker_options(parser: argparse.ArgumentParser, jobs_help: str, where: str = "") -> None:
    """Add `--jobs` and `--scheduler`; where: what their help begins with."""
    parser.add_argument("--jobs", type=int, metavar="J", help=where + jobs_help)
    parser.add_argument(
        "--scheduler",
        metavar="tcp://HOST:PORT",
        help=f"{where}run on the Dask cluster of this address; needs the extra 'cluster' (default: "
        "on this machine)",
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
    if options.jobs is not None and options.jobs < 1:
        raise InputError(f"--jobs: expected a whole number above 0, got {options.jobs}; raise it")
    if options.scheduler is not None and "://" not in options.scheduler:
        raise InputError(
            "--scheduler: expected an address such as tcp://10.0.0.5:8786, got "
            f"{options.scheduler!r}; the scheduler prints its own when it starts"
        )


WORDS = {3: "three", 6: "six"}


def numbers(option: str, text: str, form: str) -> list[float]:
    """The finite numbers of a text such as "x,y,z", which is its form. Raises InputError naming the
    option."""
    count = form.count(",") + 1
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != count or not all(map(math.isfinite, found)):
        raise InputError(f"{option}: expected {WORDS[count]} numbers {form}, got {text!r}")
    return found


def vector(option: str, text: str) -> tuple[float, float, float]:
    """The three finite numbers of "x,y,z". Raises InputError naming the option."""
    x, y, z = numbers(option, text, "x,y,z")
    return x, y, z
