"""What a recipe may ask of labels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from dicedesign.fabricate.finish_options import EngravingOptions

__all__ = ["check_labels"]

LEAST_DEPTH: Final = 1e-6
"""Smallest depth of labels over the size of the die; files in single precision round what is not
much smaller."""


def check_labels(engrave: EngravingOptions, labels: Sequence[str], size_mm: float) -> None:
    """Raise ValueError where icons are for none of the labels, or the depth is too small for a die
    of a size."""
    for label in engrave.icons:
        if label not in labels:
            raise ValueError(
                f"engrave.icons: expected labels of the target, {', '.join(labels)}, got "
                f"{label!r}; rename or remove it"
            )
    if engrave.depth_mm < LEAST_DEPTH * size_mm:
        raise ValueError(
            f"engrave.depth_mm: expected at least {LEAST_DEPTH * size_mm:.3g}, a millionth of "
            f"size_mm, got {engrave.depth_mm:g}; enlarge it"
        )
