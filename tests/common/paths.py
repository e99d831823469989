"""Paths of the repository, its pages and public data."""

from __future__ import annotations

import re
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


PAGES = [
    *(ROOT / f"{name}.md" for name in ("README", "CONTRIBUTING", "CHANGELOG")),
    *sorted((ROOT / "docs").glob("*.md")),
]
"""Pages of the documentation."""


def blocks(page: Path, language: str) -> list[str]:
    """Fenced code blocks of a language in a page."""
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def commands(page: Path) -> list[str]:
    """Shell commands in a page."""
    return [line for block in blocks(page, "sh") for line in block.splitlines()]
