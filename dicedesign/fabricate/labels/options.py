"""Options of labels; apart from the cutting, so that a recipe loads no solids."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from numbers import Real

from dicedesign.errors import InputError
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

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, Real) or isinstance(value, bool) or not math.isfinite(value):
                raise InputError(
                    f"{field.name}: expected a finite number, got {value!r}; correct it"
                )
        for name in ("depth_mm", "min_height_mm"):
            if getattr(self, name) <= 0:
                raise InputError(
                    f"{name}: expected a number above 0, got {getattr(self, name)}; enlarge it"
                )
        if not 0 <= self.margin < 1:
            raise InputError(f"margin: expected a number in [0, 1), got {self.margin}; correct it")
        if self.max_height_mm < self.min_height_mm:
            raise InputError(
                f"max_height_mm: expected at least min_height_mm = {self.min_height_mm}, got "
                f"{self.max_height_mm}; enlarge it or reduce min_height_mm"
            )
