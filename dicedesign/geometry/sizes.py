"""Sizes of solids that can be made."""

from __future__ import annotations

from typing import Final

LEAST_MM: Final = 1e-3

MOST_MM: Final = 1000.0
"""Smallest and largest distance between two corners."""
