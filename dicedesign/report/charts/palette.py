"""Colours shared by the figures."""

from __future__ import annotations

from typing import Final

__all__ = ["ACCENT", "BASINS", "DARK", "FAINT", "PALE"]

DARK: Final = "#1f2933"
"""Separatrices, axes and text."""

ACCENT: Final = "#c2571a"
"""What was achieved."""

PALE: Final = "#9fb3c8"
"""What was asked for."""

FAINT: Final = "#7b8794"
"""Hull arcs and reference lines."""

BASINS: Final = (
    "#7fb2de",
    "#f5b26b",
    "#86cf94",
    "#e58a8a",
    "#b9a0dc",
    "#f2dd6e",
    "#6fcfcb",
    "#eaa3cf",
    "#b5b08a",
    "#a9c94c",
    "#c79a74",
    "#c3ccd6",
    "#4f8fc0",
    "#d98324",
    "#4fa865",
    "#c25b5b",
    "#8b6fc0",
    "#c9ad1f",
    "#33a09b",
    "#c46aa3",
)
"""Colours of basins, the most probable first; they repeat after twenty."""
