"""What the repair of a mesh found and left, as result.json holds it."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Repair"]


@dataclass(frozen=True)
class Repair:
    """The surface of one solid, made of triangles that were none, against those triangles.

    Distances are those of points drawn evenly on one from the other, over the diagonal of the box
    that holds the triangles.

    Attributes
    ----------
    cells: of the grid, along the longest side.
    pieces: solids that the triangles bound; the largest is kept.
    dropped: volume of the others over that of all.
    cavities: in them, that were filled.
    handles_before, handles: of the triangles, or None where they are not closed; of the surface.
    off_mean, off_largest: from the surface to the triangles.
    missed_mean, missed_largest: from the triangles that are not inside the solids to the surface.
    thin: area of the triangles over parts thinner than a cell, which were thickened, over that of
        all.
    sheets: area of the triangles that have no solid on either side, over that of all.
    """

    cells: int
    pieces: int
    dropped: float
    cavities: int
    handles_before: int | None
    handles: int
    off_mean: float
    off_largest: float
    missed_mean: float
    missed_largest: float
    thin: float
    sheets: float
