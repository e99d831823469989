"""Where the repository is, and public data beside it."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
"""The folder with recipes and README."""

DATA = ROOT.parent / "shared" / "data"
"""Public models and published results, where they lie beside the checkout."""

MISSING_DATA = "no public data: "
"""Reasons for skipping tests that need them begin so; a run ends with the list of these tests."""


def public_data(name: str) -> Path:
    """A file of the public data, by its path within them. Where it is missing, the test is skipped,
    which `pytest --require-public-data` makes a failure."""
    path = DATA / name
    if not path.is_file():
        pytest.skip(f"{MISSING_DATA}{path}")
    return path
