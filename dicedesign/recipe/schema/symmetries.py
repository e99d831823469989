"""What a recipe may say of a die's symmetry."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.starts.orbit_layouts import OrbitLayouts
from dicedesign.runtime.arrays import Floats

__all__ = ["AUTO", "check_symmetry", "known_group"]

AUTO: Final = "auto"
"""A symmetry that is found once the recipe runs."""


def known_group(name: str | None) -> str | None:
    """A name that may be given. Raises InputError for another."""
    if name not in (None, AUTO):
        point_group(name)
    return name


def check_symmetry(
    name: str, exact: ExactOptions | None, center: Sequence[float] | None, target: Floats
) -> None:
    """Raise ValueError where a die cannot have a symmetry: with other methods, with a center of
    mass that is given, or where equal ones of the probabilities (k,) do not fill whole orbits."""
    if exact is None or exact.coordinates != "facets":
        raise ValueError(
            "symmetry: expected the exact method with coordinates: facets, got another; leave "
            "symmetry out, or change the method"
        )
    if center is not None:
        raise ValueError(
            "center_of_mass: expected uniform with a symmetry, got a point; leave one of them out"
        )
    if name != AUTO:
        OrbitLayouts(target, point_group(name))
