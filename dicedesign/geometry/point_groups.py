"""Point groups: the finite sets of rotations and reflections that a solid can have as symmetry.

All act about the origin, in this orientation. Groups with one main axis have it along z, and their
mirror plane across the axis, where there is one, is z = 0. In Cnv the plane y = 0 is a mirror; in
Dn, Dnh and Dnd the x axis is a two-fold axis. Cs has the mirror z = 0. The cubic and icosahedral
groups have two-fold or four-fold axes along x, y and z, three-fold axes along the diagonals of
these, and the icosahedral ones a five-fold axis along (0, 1, (1 + sqrt(5)) / 2).
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats

HIGHEST_ORDER = 12
"""Largest n of the main axis in Cn, Cnv, Cnh, Dn, Dnh and Dnd; S2n goes up to twice that."""

SAME_POLE = 0.999
"""Cosine of an angle between directions above which they are one pole; poles are at least 15
degrees apart."""

KNOWN_GROUPS = (
    f"C1, Cs, Ci, Cn, Cnv, Cnh, Dn, Dnh, Dnd with n from 2 to {HIGHEST_ORDER}, S4, S6, ... "
    f"S{2 * HIGHEST_ORDER}, T, Td, Th, O, Oh, I, Ih"
)
"""The names that `point_group` knows, in words."""

INVERSION = np.diag([-1.0, -1.0, -1.0])

MIRROR_Y = np.diag([1.0, -1.0, 1.0])

MIRROR_Z = np.diag([1.0, 1.0, -1.0])

HALF_TURN_X = np.diag([1.0, -1.0, -1.0])

HALF_TURN_Z = np.diag([-1.0, -1.0, 1.0])

MIRROR_DIAGONAL = np.eye(3)[[1, 0, 2]]

QUARTER_TURN_Z = MIRROR_Y[[1, 0, 2]]

CYCLIC_XYZ = np.eye(3)[[2, 0, 1]]
"""The third of a turn about (1, 1, 1), which takes x to y, y to z and z to x."""

GOLDEN = (1.0 + np.sqrt(5.0)) / 2.0

FIFTH_TURN = (
    np.array(
        [(GOLDEN - 1.0, -GOLDEN, 1.0), (GOLDEN, 1.0, GOLDEN - 1.0), (-1.0, GOLDEN - 1.0, GOLDEN)]
    )
    / 2.0
)
"""The fifth of a turn about (0, 1, `GOLDEN`)."""

OTHERS = {
    "C1": (),
    "Cs": (MIRROR_Z,),
    "Ci": (INVERSION,),
    "T": (HALF_TURN_Z, CYCLIC_XYZ),
    "Td": (HALF_TURN_Z, CYCLIC_XYZ, MIRROR_DIAGONAL),
    "Th": (HALF_TURN_Z, CYCLIC_XYZ, INVERSION),
    "O": (QUARTER_TURN_Z, CYCLIC_XYZ),
    "Oh": (QUARTER_TURN_Z, CYCLIC_XYZ, INVERSION),
    "I": (HALF_TURN_Z, CYCLIC_XYZ, FIFTH_TURN),
    "Ih": (HALF_TURN_Z, CYCLIC_XYZ, FIFTH_TURN, INVERSION),
}
"""Generators of the groups without a main axis of two turns or more."""


def point_group(name: str) -> Floats:
    """The matrices of a point group by its Schoenflies name, in the orientation of this module.

    Entries that are 0, 1/2 or 1, or minus these, are so to the last bit, and entries of equal size
    are equal to the last bit. The identity comes first; the order is fixed.

    name: one of `KNOWN_GROUPS`, such as "Cs", "C5v", "D3h" or "Oh".

    Raises InputError for another name.

    Returns (g, 3, 3) orthogonal matrices; a matrix times a position is the position's image.
    """
    if name in OTHERS:
        return _closure(OTHERS[name], 15)
    parts = re.fullmatch(r"([CDS])([1-9][0-9]*)([vhd]?)", name)
    generators = None if parts is None else _axial(parts[1], int(parts[2]), parts[3])
    if generators is None:
        raise InputError(f"expected one of {KNOWN_GROUPS}, got {name!r}; write it so")
    return _closure(*generators)


def fixed_space(group: Floats) -> Floats:
    """(3, 3) the orthogonal projection onto the positions that all elements (g, 3, 3) keep: all of
    space, a plane, a line or the origin alone. It is the mean of the elements."""
    return group.mean(axis=0)


def mirrors(group: Floats) -> Floats:
    """(r, 3, 3) the reflections at a plane among the elements (g, 3, 3)."""
    own_inverse = (group == group.transpose(0, 2, 1)).all(axis=(1, 2))
    return group[own_inverse & (np.linalg.det(group) < 0.0) & (np.trace(group, 0, 1, 2) > 0.0)]


def pole_orbits(group: Floats) -> list[Floats]:
    """The directions of all axes of rotation of a group (g, 3, 3), as one array (s, 3) of unit
    vectors for each set that the elements map onto each other; the first come from the element
    that comes first. Only these directions and those on mirror planes have fewer than g images."""
    orbits: list[Floats] = []
    for element in group[np.linalg.det(group) > 0.0][1:]:
        for pole in (_axis(element), -_axis(element)):
            if all((orbit @ pole < SAME_POLE).all() for orbit in orbits):
                images = group @ pole
                first = np.argmax(images @ images.T > SAME_POLE, axis=1)
                orbits.append(images[np.unique(first)])
    return orbits


def _axis(rotation: Floats) -> Floats:
    """(3,) unit vector along the axis of a rotation (3, 3), of which the largest component is
    positive."""
    # Half the sum of a rotation and its inverse is cos I + (1 - cos) a a^T.
    cosine = (np.trace(rotation) - 1.0) / 2.0
    square = (rotation + rotation.T) / 2.0 - cosine * np.eye(3)
    longest = square[:, np.argmax(np.diag(square))]
    return longest / np.linalg.norm(longest)


def _axial(family: str, number: int, suffix: str) -> tuple[list[Floats], int] | None:
    """Generators of a group with one main axis, and the n of the axis; None if there is none."""
    order = number // 2 if family == "S" else number
    if not 2 <= order <= HIGHEST_ORDER:
        return None
    turn, improper = _turn_z(2.0 * np.pi / order), MIRROR_Z @ _turn_z(np.pi / order)
    if family == "S":
        return ([improper], order) if number % 2 == 0 and not suffix else None
    generators = {
        "C": [turn],
        "Cv": [turn, MIRROR_Y],
        "Ch": [turn, MIRROR_Z],
        "D": [turn, HALF_TURN_X],
        "Dh": [turn, HALF_TURN_X, MIRROR_Z],
        "Dd": [improper, HALF_TURN_X],
    }.get(family + suffix)
    return None if generators is None else (generators, order)


def _turn_z(angle: float) -> Floats:
    """(3, 3) the rotation about z by an angle."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([(cosine, -sine, 0.0), (sine, cosine, 0.0), (0.0, 0.0, 1.0)])


def _closure(generators: Sequence[Floats], order: int) -> Floats:
    """(g, 3, 3) all products of some generators, of which every entry is the cosine of a multiple
    of a quarter of a turn over `order`; 0, 1/2 and 1 are exact."""
    step = np.arange(1, order + 1)
    positive = np.sin(np.pi * step / (2 * order))
    positive[3 * step == order] = 0.5
    positive[-1] = 1.0
    cosines = np.concatenate([[0.0], positive, -positive])
    elements = [np.eye(3)]
    for element in elements:
        for generator in generators:
            product = generator @ element
            nearest = np.abs(product[..., None] - cosines).argmin(axis=-1)
            exact = cosines[nearest]
            if not any(np.array_equal(exact, other) for other in elements):
                elements.append(exact)
    return np.stack(elements)
