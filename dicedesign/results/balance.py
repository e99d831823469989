"""How a finished die came to its odds, as result.json holds it."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Balance"]


@dataclass(frozen=True)
class Balance:
    """How the finished die, with its labels and edges, came to the odds of its target.

    Attributes
    ----------
    by: "shape", "opposite", "fill" or "none", as in a recipe's `engrave`.
    unbalanced: (k,) odds that the finished die would have if the plain shape were only engraved;
        for a die to be thrown those by the momentum model, as its target is then.
    errors: largest difference from the target in each round, before coordinates are rounded to
        those of a file; the first is that of `unbalanced`, the least that of the die.
    moved_mm: largest distance from a corner of the plain shape to the planes of its facets as they
        were moved.
    stretch: of a die that keeps the shape of a surface, the largest relative change of a length.
    """

    by: str
    unbalanced: tuple[float, ...]
    errors: tuple[float, ...]
    moved_mm: float
    stretch: float | None = None
