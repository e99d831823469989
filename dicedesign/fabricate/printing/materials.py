"""Materials by name, and how dense they are when printed solid."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

__all__ = ["MATERIALS", "Material"]

_SLICER: Final = "Prusa Research, filament profiles of PrusaSlicer 2.5, 2022"


@dataclass(frozen=True)
class Material:
    """A material.

    Attributes
    ----------
    title: how people write it.
    density_g_cm3: of the printed solid.
    source: of the density: author, title, year.
    """

    title: str
    density_g_cm3: float
    source: str


MATERIALS: Final = MappingProxyType(
    {
        "pla": Material("PLA", 1.24, _SLICER),
        "petg": Material("PETG", 1.27, _SLICER),
        "abs": Material("ABS", 1.04, _SLICER),
        "asa": Material("ASA", 1.07, _SLICER),
        "pc": Material("PC", 1.22, _SLICER),
        "resin": Material("resin", 1.15, "the middle of what makers of resins give, 1.1 to 1.2"),
        "pa12": Material("PA12", 0.93, "EOS, material data sheet PA 2200, 2010"),
    }
)
"""All materials by name."""
