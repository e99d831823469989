"""The paper's own comparison of its geometric model with two simulators (section 4.1)."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats

__all__ = ["PRINTED_CORRELATIONS", "PublishedDistances", "read_published_distances"]

COLUMNS: Final = {
    "OT_us_IPC": "geometric model vs Rigid IPC",
    "OT_us_Bullet": "geometric model vs Bullet",
    "OT_IPC_Bullet": "Bullet vs Rigid IPC",
}
"""What the columns of distances compare."""

ASYMMETRY: Final = "weight_ratio"
"""The column of the asymmetry measure."""

PRINTED_CORRELATIONS: Final = {
    "geometric model vs Rigid IPC": (0.47, 1e-20),
    "geometric model vs Bullet": (0.13, 5e-4),
    "Bullet vs Rigid IPC": (0.07, 0.06),
}
"""Pearson's coefficient and its p-value as the paper's text gives them."""


@dataclass(frozen=True)
class PublishedDistances:
    """Shapes of the paper's figure 10.

    Attributes
    ----------
    asymmetry: (n,) asymmetry measure of each shape (equation 20), at least 0.
    distances: for each comparison of two models, by the names in `PRINTED_CORRELATIONS`, the
        Wasserstein distance (n,) between the rests they predict, in radians, in [0, pi].
    """

    asymmetry: Floats
    distances: dict[str, Floats]


def read_published_distances(path: str | Path) -> PublishedDistances:
    """The table that the paper's authors published.

    path: a comma-separated file whose first line names its columns, among them `weight_ratio`,
    `OT_us_IPC`, `OT_us_Bullet` and `OT_IPC_Bullet`, with one shape on each further line.

    Raises InputError: the file cannot be read, lacks a column, holds no shape, or has a value that
    is no number, negative, or a distance above pi.
    """
    path = Path(path)
    try:
        with path.open(encoding="utf-8", newline="") as file:
            table = csv.DictReader(file)
            names = table.fieldnames or []
            rows = list(table)
    except OSError as error:
        raise InputError(
            f"{path}: expected the published table of distances, got {error.strerror!r}; check the "
            "path"
        ) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            f"{path}: expected comma-separated text, got a file that is none ({error}); fetch the "
            "published table of distances again"
        ) from error
    missing = [name for name in (ASYMMETRY, *COLUMNS) if name not in names]
    if missing or not rows:
        raise InputError(
            f"{path}: expected columns {', '.join((ASYMMETRY, *COLUMNS))} and a line for each "
            f"shape, got {len(rows)} lines{' without ' + ', '.join(missing) if missing else ''}; "
            "pass the published table of distances"
        )
    values = {
        name: np.array([_value(row[name], path, line, name) for line, row in enumerate(rows, 2)])
        for name in (ASYMMETRY, *COLUMNS)
    }
    return PublishedDistances(
        values[ASYMMETRY], {label: values[name] for name, label in COLUMNS.items()}
    )


def _value(text: str | None, path: Path, line: int, name: str) -> float:
    """A number at least 0 and, of a distance, at most pi."""
    try:
        value = float(text or "")
    except ValueError:
        value = np.nan
    most = np.inf if name == ASYMMETRY else np.pi
    if not (0.0 <= value <= most and np.isfinite(value)):
        allowed = "a number of at least 0" if name == ASYMMETRY else "a number from 0 to pi"
        raise InputError(
            f"{path}: expected {allowed} in column {name} of line {line}, got {text!r}; correct it "
            "or fetch the published table of distances again"
        )
    return value
