"""Options of labels; apart from the cutting, so that a recipe loads no solids."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real
from typing import Literal

from dicedesign.errors import InputError
from dicedesign.optimize.options import require_choice
from dicedesign.runtime.registry import STRICT

__all__ = ["EngravingOptions"]


@dataclass(frozen=True)
class EngravingOptions:
    """Sizes and depth of labels.

    Raises InputError for a value out of its range.
    """

    __pydantic_config__ = STRICT

    depth_mm: float = 0.6
    """Depth of the pockets below the facet, above 0. It does not scale with the die."""
    margin: float = 0.15
    """Part of the facet's inscribed radius that labels keep free, in [0, 1)."""
    min_height_mm: float = 2.5
    """Smallest legible digit height, above 0."""
    max_height_mm: float = 8.0
    """Largest digit height, at least `min_height_mm`."""
    style: Literal["engraved", "raised"] = "engraved"
    """`engraved` cuts labels in; `raised` sinks the field around them and leaves them standing, as
    high as the border of the facet, so that the die rests as without labels."""
    border_mm: float = 1.0
    """Width of the border around a sunk field, above 0."""
    balance: Literal["shape", "opposite", "fill", "none"] = "shape"
    """What makes up for the material that labels take away: `shape` moves the facets until the
    finished die has the odds; `opposite` hollows a hidden ball opposite to them; `fill` makes
    bodies that fill the labels in another color, equally dense; `none` leaves the odds as they
    come out."""
    read: Literal["auto", "up", "down", "both"] = "auto"
    """Where the label of an outcome lies: "down" on the facet that the die rests on; "up" on the
    level facet on top then, or around the corner on top where there is one; "both" below and on
    top; "auto" up where all facets on top are level or the die is a tetrahedron, as far as the
    labels fit there, and down elsewhere."""

    def __post_init__(self) -> None:
        for name in ("depth_mm", "margin", "min_height_mm", "max_height_mm", "border_mm"):
            value = getattr(self, name)
            if not isinstance(value, Real) or isinstance(value, bool) or not math.isfinite(value):
                raise InputError(f"{name}: expected a finite number, got {value!r}; correct it")
        for name in ("depth_mm", "min_height_mm", "border_mm"):
            if getattr(self, name) <= 0:
                raise InputError(
                    f"{name}: expected a number above 0, got {getattr(self, name)}; enlarge it"
                )
        if not 0 <= self.margin < 1:
            raise InputError(f"margin: expected a number in [0, 1), got {self.margin}; correct it")
        require_choice("style", self.style, "engraved", "raised")
        require_choice("balance", self.balance, "shape", "opposite", "fill", "none")
        require_choice("read", self.read, "auto", "up", "down", "both")
        if self.max_height_mm < self.min_height_mm:
            raise InputError(
                f"max_height_mm: expected at least min_height_mm = {self.min_height_mm}, got "
                f"{self.max_height_mm}; enlarge it or reduce min_height_mm"
            )
