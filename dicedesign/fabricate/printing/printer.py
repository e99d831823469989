"""Printers: what a kind of them can make, one file each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from dicedesign.errors import InputError
from dicedesign.runtime.folder_registry import FolderRegistry
from dicedesign.runtime.registry import Extension

__all__ = ["PRINTERS", "Printer"]

STANDARD_NOZZLE: Final = 0.4
"""Diameter in mm of the nozzle that the limits of printers with a nozzle are given for."""


@dataclass(frozen=True, kw_only=True)
class Printer(Extension):
    """A kind of printer. Lengths are in millimetres.

    Attributes
    ----------
    spot_mm: the finest that it draws: width of the nozzle, the pixel or the laser's spot.
    has_nozzle: whether that is a nozzle, which its owner may change.
    layer_mm: usual height of a layer.
    wall_mm: least thickness of a wall.
    groove_mm: least width of what is engraved; groove_depth_mm: its least depth.
    ridge_mm: least width of what stands between two grooves.
    raised_mm: least width of what is raised.
    overhang_deg: surfaces that look down and are nearer than this to level need supports; 0 where
        none do.
    dimensional_error_mm: by how much a dimension of a die's size is off at most, either way.
    shrinkage: linear, left after the printer's own compensation, as a share.
    materials: names of those it takes, the usual one first, see `MATERIALS`.
    sources: of these numbers: author, title, year.
    """

    spot_mm: float
    has_nozzle: bool
    layer_mm: float
    wall_mm: float
    groove_mm: float
    groove_depth_mm: float
    ridge_mm: float
    raised_mm: float
    overhang_deg: float
    dimensional_error_mm: float
    shrinkage: float
    materials: tuple[str, ...]
    sources: tuple[str, ...]

    def with_nozzle(self, diameter: float) -> Printer:
        """The same with a nozzle of another diameter, above 0: what it draws is as much wider and
        its layers as much higher. Raises InputError where it has none."""
        if not self.has_nozzle:
            raise InputError(
                f"nozzle_mm: expected a printer with a nozzle, got {self.name}, which has none; "
                "leave nozzle_mm out"
            )
        ratio = diameter / STANDARD_NOZZLE
        names = ("spot_mm", "layer_mm", "wall_mm", "groove_mm", "ridge_mm", "raised_mm")
        return replace(self, **{name: ratio * getattr(self, name) for name in names})


PRINTERS: Final[FolderRegistry[Printer]] = FolderRegistry(
    "printer", "dicedesign.fabricate.printing.printers", Printer
)
"""All kinds of printers, the most common first."""
