"""What others take for resting probabilities: solid angles of facets, and trimesh's stable poses.

Both let a body that falls towards a facet land on it, however it would roll on the way. That is
right where every facet, edge and corner carries an equilibrium, and wrong elsewhere.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from scipy.spatial import cKDTree

from dicedesign.bench.measures.processes import CrashError, HangError, Watchdog, in_turn
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import signed_solid_angle
from dicedesign.rest.equilibria import Equilibria
from dicedesign.rest.tracing import destined_facets
from dicedesign.runtime.arrays import Floats, Integers

__all__ = [
    "MOST_CORNERS",
    "TrimeshError",
    "TrimeshRequest",
    "TrimeshTimer",
    "matched",
    "solid_angle_probabilities",
    "trimesh_poses",
    "trimesh_seconds",
]


class TrimeshError(RuntimeError):
    """trimesh gave no answer; the message says why."""


def solid_angle_probabilities(equilibria: Equilibria) -> Floats:
    """Share of the solid angle (m,) that each facet covers as seen from the center of mass, passed
    on to the facet on which a body comes to rest that is let go on it."""
    hull = equilibria.hull
    corners = equilibria.radii[hull.triangles]
    angles = signed_solid_angle(corners[:, 0], corners[:, 1], corners[:, 2], np)
    facets = np.arange(len(hull.normals))
    owner = np.repeat(facets, np.diff(hull.facet_start) - 2)
    shares = _gathered(owner, angles / (4.0 * np.pi), len(facets))
    return _gathered(destined_facets(equilibria, facets), shares, len(facets))


@dataclass(frozen=True)
class TrimeshRequest:
    """What trimesh is asked for.

    Attributes
    ----------
    points: (n, 3), triangles: (t, 3) into them.
    center: (3,) mean center of mass.
    variance: its `sigma`, the square of the spread along each axis, in squared length units.
    samples: how many centers of mass; seed: of these, where the installed trimesh takes one.
    """

    points: Floats
    triangles: Integers
    center: Floats
    variance: float = 0.0
    samples: int = 1
    seed: int = 0


def trimesh_poses(request: TrimeshRequest) -> tuple[Floats, Floats]:
    """Rests and their probabilities by `trimesh.poses.compute_stable_poses`.

    It draws centers of mass from a normal distribution, leaves out those outside of the hull, and
    takes the mean over them of the facets' solid angles, passed on by toppling over edges. It knows
    lengths too small to count, so it is given the body at a size of about 1.

    Returns (k, 3) normals that point down and (k,) probabilities.

    Raises
    ------
    TrimeshError: trimesh raised an error, found no rest, or gave something else than numbers.
    """
    import trimesh

    compute = trimesh.poses.compute_stable_poses
    # A power of two, which rounds nothing.
    size = 2.0 ** int(np.frexp(np.ptp(request.points, axis=0).max())[1])
    options: dict[str, Any] = {
        "sigma": request.variance / size**2,
        "n_samples": request.samples,
    }
    if "seed" in inspect.signature(compute).parameters:
        options["seed"] = request.seed
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            mesh = trimesh.Trimesh(request.points / size, request.triangles, process=False)
            transforms, shares = compute(mesh, center_mass=request.center / size, **options)
        except Exception as error:  # whatever its algorithm runs into
            raise TrimeshError(f"{type(error).__name__}: {error}") from error
    if len(shares) == 0:
        raise TrimeshError("no poses")
    if not (np.isfinite(shares).all() and np.isfinite(transforms).all()):
        raise TrimeshError("poses that are not numbers")
    return -np.asarray(transforms)[:, 2, :3], np.asarray(shares)


def matched(
    hull: ConvexHull, normals: Floats, shares: Floats, angle: float
) -> tuple[Floats, float]:
    """Shares (k,) of rests with normals (k, 3), put on the facets with the nearest normals.

    angle: largest one in radians between two normals that count as the same.
    Returns (m,), and the largest share that found no facet.
    """
    distances, nearest = cKDTree(hull.normals).query(normals)
    near = distances <= 2.0 * np.sin(angle / 2.0)
    found = _gathered(nearest[near], shares[near], len(hull.normals))
    return found, float(shares[~near].max(initial=0.0))


def _gathered(places: Integers, values: Floats, count: int) -> Floats:
    """(count,) sums of the values (k,) at each of the places (k,)."""
    sums = np.zeros(count)
    np.add.at(sums, places, values)
    return sums


MOST_CORNERS: Final = 2000
"""trimesh is left out for hulls of more vertices: it takes a second for 1,000."""

LIMIT: Final = 60.0
"""Seconds after which trimesh is stopped."""

ROUNDS: Final = 3


def trimesh_seconds(request: TrimeshRequest) -> float:
    """Median seconds of the processor of trimesh, which computes the hull itself."""
    return in_turn([partial(trimesh_poses, request)], 0.0, rounds=ROUNDS)[0]


class TrimeshTimer:
    """Measures trimesh in a process of its own, as it may hang.

    seconds: `trimesh_seconds`, or another that can be imported by name.
    limit: seconds after which it is stopped.
    """

    def __init__(
        self, seconds: Callable[[TrimeshRequest], float] = trimesh_seconds, limit: float = LIMIT
    ) -> None:
        self._dog = Watchdog(seconds)
        self._limit = limit

    def __enter__(self) -> TrimeshTimer:
        return self

    def __exit__(self, *error: object) -> None:
        self._dog.__exit__(None, None, None)

    def __call__(self, request: TrimeshRequest) -> tuple[float | None, str]:
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
