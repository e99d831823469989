"""Mass, center of mass and inertia of a body whose density is not the same everywhere."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats


@dataclass(frozen=True, eq=False)
class MassProperties:
    """What is known of how a body's mass lies.

    Attributes
    ----------
    mass: above 0, in the unit of the densities times the cubed unit of length.
    center_of_mass: (3,) in the body's coordinates.
    inertia: (3, 3) tensor about the center of mass over the mass, in squared units of length.
    source: where it is from, in words.
    """

    mass: float
    center_of_mass: Floats
    inertia: Floats
    source: str


def summed(
    masses: Sequence[float], centers: Floats, spreads: Floats, source: str
) -> MassProperties:
    """Those of pieces of a body.

    masses: (n,) from 0 on, not all 0; centers: (n, 3) of mass; spreads: (n, 3, 3) means of the
    products of two coordinates about those centers. Raises InputError: the mass is too large or too
    small for a number.
    """
    with np.errstate(over="ignore"):
        mass = float(np.sum(masses))
    if not 0.0 < mass < math.inf:
        raise InputError(
            f"{source}: expected a finite mass above 0, got {mass:g}; give them in another unit"
        )
    shares = np.asarray(masses) / np.max(masses)
    shares = shares / shares.sum()
    middle = centers.mean(axis=0)
    center = middle + shares @ (centers - middle)
    arms = centers - center
    spread = np.einsum("n,nij->ij", shares, spreads) + (shares[:, None] * arms).T @ arms
    inertia = np.trace(spread) * np.eye(3) - spread
    return MassProperties(mass, center, inertia, source)
