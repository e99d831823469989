"""Paths of the repository and of public data."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
"""Root of the repository."""

DATA = ROOT.parent / "shared" / "data"
"""Public models and published results, outside the repository."""

MISSING_DATA = "no public data: "
"""Prefix of the reasons for skipped tests; pytest lists these tests at the end."""


def public_data(name: str) -> Path:
    """Path of a public file. Skips the test if it is missing.

    With `pytest --require-public-data` the test fails.
    """
    path = DATA / name
    if not path.is_file():
        pytest.skip(f"{MISSING_DATA}{path}")
    return path
