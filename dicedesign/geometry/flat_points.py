"""Points that span no solid, or hardly one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import DegenerateBodyError
from dicedesign.tolerances import FLATNESS_TOLERANCE

__all__ = ["flat_error", "thickness"]

Floats = NDArray[np.float64]


def thickness(local: Floats) -> float:
    """Extent of points (n, 3) across the plane that fits them best."""
    across = np.linalg.svd(local - local.mean(axis=0), full_matrices=False)[2][-1]
    return float(np.ptp(local @ across))


def flat_error(local: Floats) -> DegenerateBodyError:
    """The error for points (n, 3) that span no solid, which says whether they span a plane."""
    extents = np.linalg.svd(local - local.mean(axis=0), compute_uv=False)
    rank = int((extents > FLATNESS_TOLERANCE * extents[0]).sum())
    where = {1: "on one line", 2: "on one plane"}.get(rank, "too close to one plane")
    return DegenerateBodyError(
        f"points: expected points that span a solid, got {len(local)} points {where}; "
        "a body needs thickness in all three directions"
    )
