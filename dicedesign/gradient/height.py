"""Support function of a body: the height of its center of mass, and the way it rolls.

Torch is imported only for tensors.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import as_numbers
from dicedesign.geometry.sphere import norms
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from torch import Tensor


@overload
def height(
    points: Tensor, directions: Tensor, center_of_mass: Tensor | None = None
) -> tuple[Tensor, Tensor]: ...


@overload
def height(
    points: ArrayLike, directions: ArrayLike, center_of_mass: ArrayLike | None = None
) -> tuple[Floats, Floats]: ...


def height(points: Any, directions: Any, center_of_mass: Any = None) -> tuple[Any, Any]:
    """Height U of the center of mass over the table, and its gradient on the sphere.

    A body that is let go rolls down this gradient. The minima of U are its rests, as found by
    `rest_poses`, between saddles and maxima.

    Parameters
    ----------
    points: (n, 3) corners of the body, in any length unit.
    directions: (..., 3) that point down in the body's frame, of any length but 0.
    center_of_mass: (3,) or None for that of the uniform solid hull.
    All are arrays, or differentiable tensors of float32 or float64, also under the transforms of
    `torch.func`; its `vmap` can map over points only with a given center of mass.

    Returns
    -------
    heights: (...,) in the points' unit.
    gradients: (..., 3) in this unit per radian, perpendicular to the direction; of one side, where
        two corners are equally low and U has a crease.

    Raises
    ------
    InputError: arrays or tensors of other shapes or kinds; in an array, a direction that is not
        finite or has length 0, which is NaN in the result of tensors.
    DegenerateBodyError: the points span no solid, and no center of mass is given.

    Source: eq. 3 and 4.
    """
    if hasattr(points, "requires_grad"):
        return _of_tensors(points, directions, center_of_mass)
    corners = as_numbers(points, "points").astype(np.float64)
    down = np.asarray(directions, dtype=np.float64)
    if down.shape[-1:] != (3,):
        raise InputError(
            f"directions: expected an array of shape (..., 3), got {down.shape}; pass three "
            "numbers for each"
        )
    sizes = norms(down)
    if not ((sizes > 0.0) & (sizes < np.inf)).all():
        raise InputError("directions: expected vectors of finite length above 0, got another")
    if center_of_mass is None:
        center = convex_hull(corners).centroid
    else:
        center = np.asarray(center_of_mass, dtype=np.float64)
        if center.shape != (3,) or not np.isfinite(center).all():
            raise InputError(f"center of mass: expected three numbers, got {center_of_mass!r}")
    return _lowest(corners - center, down / sizes[..., None])


def _of_tensors(points: Any, directions: Any, center_of_mass: Any) -> tuple[Tensor, Tensor]:
    import torch

    from dicedesign.gradient.body_function import double_tensor
    from dicedesign.gradient.rest_probabilities import evaluate_rests

    corners = double_tensor(points, "points", "n", 3)
    before = [f"d{place}" for place in range(getattr(directions, "ndim", 1) - 1)]
    down = double_tensor(directions, "directions", *before, 3)
    if center_of_mass is None:
        center = evaluate_rests(points).center_of_mass
    else:
        center = double_tensor(center_of_mass, "center of mass", 3)
    units = down / torch.linalg.vector_norm(down, dim=-1, keepdim=True)
    heights, slopes = _lowest(corners - center, units)
    return heights.to(points), slopes.to(points)


def _lowest(radii: Any, down: Any) -> tuple[Any, Any]:
    """Heights and gradients for points relative to the center of mass and unit directions."""
    lowest = radii[(down @ radii.T).argmax(-1)]
    heights = (lowest * down).sum(-1)
    return heights, lowest - heights[..., None] * down
