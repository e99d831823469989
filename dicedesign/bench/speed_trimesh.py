"""How long trimesh takes for the stable poses of points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.bench.heuristics import trimesh_poses
from dicedesign.bench.stopwatch import in_turn
from dicedesign.bench.watchdog import CrashError, HangError, Watchdog

__all__ = ["MOST_CORNERS", "Request", "TrimeshTimer", "trimesh_seconds"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

MOST_CORNERS: Final = 2000
"""trimesh is left out for hulls of more vertices: it takes a second for 1,000."""

LIMIT: Final = 60.0
"""Seconds after which trimesh is stopped."""

ROUNDS: Final = 3


@dataclass(frozen=True)
class Request:
    """A mesh of points (n, 3) and triangles (t, 3), its hull, with a center of mass (3,)."""

    points: Floats
    triangles: Integers
    center: Floats


def trimesh_seconds(request: Request) -> float:
    """Median seconds of `trimesh.poses.compute_stable_poses`, which computes the hull itself."""

    def ask() -> None:
        trimesh_poses(
            request.points, request.triangles, request.center, variance=0.0, samples=1, seed=0
        )

    return in_turn([ask], 0.0, rounds=ROUNDS)[0]


class TrimeshTimer:
    """Measures trimesh in a process of its own, as it may hang.

    seconds: `trimesh_seconds`, or another that can be imported by name.
    limit: seconds after which it is stopped.
    """

    def __init__(
        self, seconds: Callable[[Request], float] = trimesh_seconds, limit: float = LIMIT
    ) -> None:
        self._dog = Watchdog(seconds)
        self._limit = limit

    def __enter__(self) -> TrimeshTimer:
        return self

    def __exit__(self, *error: object) -> None:
        self._dog.__exit__(None, None, None)

    def __call__(self, request: Request) -> tuple[float | None, str]:
        """Its seconds, or None and why."""
        corners = len(np.unique(request.triangles))
        if corners > MOST_CORNERS:
            return None, f"no trimesh for more than {MOST_CORNERS:,} corners"
        try:
            return self._dog.call(request, self._limit), ""
        except HangError:
            return None, f"trimesh stopped after {self._limit:g} s"
        except CrashError as error:
            return None, f"trimesh failed: {error}"
