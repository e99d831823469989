"""Why tests of pages are skipped."""

from __future__ import annotations

from typing import Final

MISSING_BROWSER: Final = "no browser: "
"""Reasons for skipping tests that need one begin so."""
