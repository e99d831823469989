"""A body of cells of a grid, each with its own density."""

from __future__ import annotations

import io
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import InputError, MeshFileError
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.meshes.mass_properties import summed
from dicedesign.runtime.arrays import Floats

VOXEL_ENDINGS: Final = frozenset({".npy", ".npz"})

SOURCE: Final = "densities of its cells"

EXPECTED: Final = (
    "a .npy array of densities by x, y, z, or a .npz archive of `density`, `spacing` and `origin`"
)


def voxel_body(
    density: ArrayLike,
    spacing: ArrayLike = 1.0,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    name: str = "cells",
) -> Body:
    """The body of all cells of a grid that have a density above 0, which is even in each.

    Parameters
    ----------
    density: (l, m, n) of the cells along x, y and z, finite, from 0 on, in any unit.
    spacing: length of a cell's sides, or (3,) those along x, y and z, above 0, in any unit.
    origin: (3,) the corner of the first cell, in that unit.
    name: what to call the body in messages.

    Returns
    -------
    Body of the corners that its hull can have, without triangles; its mass, center and inertia are
    in `mass_properties`.

    Raises
    ------
    InputError: shapes or numbers are others.
    DegenerateBodyError: as `make_body`.
    """
    cells = np.asarray(density)
    if cells.ndim != 3 or cells.dtype.kind not in "biuf":
        raise InputError(
            f"{name}: expected densities as an (l, m, n) array of numbers, got shape {cells.shape} "
            f"of {cells.dtype}; give one number for each cell"
        )
    usable = np.isfinite(cells) & (cells >= 0)
    if not usable.all():
        place = tuple(int(i) for i in np.argwhere(~usable)[0])
        raise InputError(
            f"{name}: expected finite densities from 0 on, got {float(cells[place]):g} in cell "
            f"{place}; correct it"
        )
    if not cells.any():
        raise InputError(f"{name}: expected a mass above 0, got no cell with any; correct it")
    sides, corner = _vector(spacing, "spacing", name), _vector(origin, "origin", name)
    if not (sides > 0.0).all():
        raise InputError(f"{name}: expected a spacing above 0, got {spacing!r}; correct it")
    # First what refuses lengths whose products would be no numbers.
    made = make_body(corner + sides * _outer_corners(cells > 0), name=name)
    weights = cells / cells.max()
    total = weights.sum(dtype=np.float64)
    # About the middle of the grid, in cells.
    places = [np.arange(count) - (count - 1) / 2.0 for count in cells.shape]
    along = [weights.sum(axis=axes, dtype=np.float64) for axes in ((1, 2), (0, 2), (0, 1))]
    center = np.array([row @ place for row, place in zip(along, places, strict=True)]) / total
    arms = [place - middle for place, middle in zip(places, center, strict=True)]
    spread = np.einsum("ijk,ai,bj,ck->abc", weights, *map(_powers, arms), optimize=True) / total
    products = _products(spread) + np.eye(3) / 12.0
    middle = corner + sides * (np.array(cells.shape) / 2.0 + center)
    found = summed(
        [float(total) * float(cells.max()) * float(sides.prod())],
        middle[None],
        (products * np.outer(sides, sides))[None],
        SOURCE,
    )
    return replace(made, mass_properties=found)


def parsed_voxels(data: bytes, path: Path) -> Body:
    """The body of a `VOXEL_ENDINGS` file's content. Raises MeshFileError where it is damaged or
    holds anything else, else as `voxel_body`."""
    try:
        loaded = np.load(io.BytesIO(data), allow_pickle=False)
        entries: dict[str, Any] = (
            {"density": loaded} if isinstance(loaded, np.ndarray) else dict(loaded)
        )
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise MeshFileError(
            f"{path}: expected {EXPECTED}, got one that cannot be read; save it again"
        ) from error
    unknown = sorted(entries.keys() - {"density", "spacing", "origin"})
    if "density" not in entries or unknown:
        raise MeshFileError(
            f"{path}: expected {EXPECTED}, got {', '.join(sorted(entries)) or 'nothing'}; rename "
            "what it holds"
        )
    return voxel_body(**entries, name=str(path))


def _vector(given: ArrayLike, what: str, name: str) -> Floats:
    try:
        vector = np.broadcast_to(np.asarray(given, dtype=np.float64), (3,))
    except (ValueError, TypeError):
        vector = np.full(3, np.nan)
    if not np.isfinite(vector).all():
        raise InputError(
            f"{name}: expected {what} as three finite numbers, got {given!r}; correct it"
        )
    return np.array(vector)


def _powers(arm: Floats) -> Floats:
    """(3, n) ones, the numbers and their squares."""
    return np.stack([np.ones_like(arm), arm, arm**2])


def _products(spread: Floats) -> Floats:
    """(3, 3) means of the products of two coordinates, from those (3, 3, 3) of their powers."""
    xx, yy, zz = spread[2, 0, 0], spread[0, 2, 0], spread[0, 0, 2]
    yz, xz, xy = spread[0, 1, 1], spread[1, 0, 1], spread[1, 1, 0]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _outer_corners(filled: Any) -> Floats:
    """(n, 3) corners, in cells, of the lowest and the highest filled cell of each column along
    z."""
    x, y = np.nonzero(filled.any(axis=2))
    columns = filled[x, y]
    low, high = columns.argmax(axis=1), filled.shape[2] - columns[:, ::-1].argmax(axis=1)
    corners = [
        np.stack([x + right, y + back, z], axis=1)
        for z in (low, high)
        for right in (0, 1)
        for back in (0, 1)
    ]
    return np.unique(np.concatenate(corners), axis=0).astype(np.float64)
