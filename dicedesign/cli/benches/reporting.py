"""What the benches' command lines share: their options, their progress and what they leave."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.errors import InputError

if TYPE_CHECKING:
    from dicedesign.report.charts.paper import Paper

__all__ = [
    "add_folder_option",
    "add_json_option",
    "json_text",
    "print_row",
    "progress_bar",
    "require_figure_folder",
    "require_positive_seconds",
    "write_results",
]


def add_folder_option(parser: argparse.ArgumentParser, bench: str) -> None:
    """Add `--out`, the folder for the figure and the JSON file that are named after the bench."""
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("outputs/bench"),
        metavar="DIR",
        help=f"folder for {bench}.png and {bench}.json (default: outputs/bench)",
    )


def add_json_option(parser: argparse.ArgumentParser) -> None:
    """Add `--json`."""
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")


def require_positive_seconds(seconds: float) -> None:
    """Raise InputError unless `--seconds` is above 0."""
    if not seconds > 0.0:
        raise InputError(f"--seconds: expected a positive number, got {seconds:g}; give more")


def require_figure_folder(path: Path | None) -> None:
    """Raise InputError where the file of `--figure` cannot be, if there is to be one."""
    if path is not None and (path.is_dir() or not path.parent.is_dir()):
        raise InputError(
            f"--figure: expected a file in a folder that exists, got {path}; create the folder or "
            "choose another"
        )


@contextmanager
def progress_bar(unit: str) -> Iterator[Any]:
    """A tqdm bar on stderr that counts a unit in the plural; hidden unless that is a terminal."""
    from tqdm import tqdm

    with tqdm(file=sys.stderr, disable=not sys.stderr.isatty(), unit=f" {unit}") as bar:
        yield bar


def print_row(text: str) -> None:
    """Print lines of a table above the progress bar."""
    from tqdm import tqdm

    with tqdm.external_write_mode(sys.stdout):
        print(text, flush=True)


def json_text(record: Mapping[str, Any]) -> str:
    """A record of plain data as JSON. Infinity and what is not a number become null."""
    return json.dumps(_finite(record), indent=1, allow_nan=False)


def write_results(
    folder: Path, bench: str, figure: Paper, record: Mapping[str, Any], *, as_json: bool
) -> None:
    """Write the figure and the record into the folder of `--out`, and say so.

    as_json: the record is printed before, and what was written is said on stderr.
    Raises OutputError if the folder cannot be written any more.
    """
    from dicedesign.report.charts.png import png_bytes
    from dicedesign.runtime.files import atomic_write

    text = json_text(record)
    drawn, recorded = folder / f"{bench}.png", folder / f"{bench}.json"
    if as_json:
        print(text, flush=True)
    atomic_write(drawn, png_bytes(figure))
    atomic_write(recorded, f"{text}\n".encode())
    print(f"wrote {drawn} and {recorded}", file=sys.stderr if as_json else sys.stdout)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
