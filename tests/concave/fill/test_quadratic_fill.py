"""The hull fill by quadratic programs on small surfaces."""

from __future__ import annotations

import sys
from importlib.util import find_spec

import numpy as np
import pytest
import trimesh
from common.bumpy import bent_capsule, bumpy_sphere, nearby_hull
from scipy import spatial

from dicedesign.concave.options import ConcavePaperOptions
from dicedesign.concave.paper_fill import fill_by_quadratic_programs
from dicedesign.concave.result import FillResult, FillStatus
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats

needs_clarabel = pytest.mark.skipif(
    find_spec("clarabel") is None,
    reason="the optional extra 'concave' is not installed",
)


def fill(
    surface: Surface, hull: ConvexHull, **options: float
) -> tuple[FillResult, list[float], Floats]:
    """Filled; the distances of the hull's corners from the surface are over its diagonal."""
    energies: list[float] = []
    result = fill_by_quadratic_programs(
        surface, hull, ConcavePaperOptions(**options), energies.append
    )
    assert energies[-1] == result.energy
    middle = hull.vertices.mean(axis=0)
    slacks = hull.heights(middle) - (result.points - middle) @ hull.normals.T
    assert slacks.min() > 0.0
    corners = result.points[surface.triangles]
    distances = [
        np.linalg.norm(
            trimesh.triangles.closest_point(corners, np.repeat(corner[None], len(corners), axis=0))
            - corner,
            axis=1,
        ).min()
        for corner in hull.vertices
    ]
    return result, energies, np.array(distances) / surface.diagonal


def bent_by(surface: Surface, points: Floats) -> float:
    """Sum of squared changes of angle between neighbouring triangles."""
    angles = []
    for places in (surface.points, points):
        mesh = trimesh.Trimesh(places, surface.triangles, process=False)
        angles.append(np.where(mesh.face_adjacency_convex, 1, -1) * mesh.face_adjacency_angles)
    return float(((angles[1] - angles[0]) ** 2).sum())


@needs_clarabel
@pytest.mark.parametrize(
    ("surface", "amount"), [(bumpy_sphere(), 0.04), (bent_capsule(18, 10), 0.02)]
)
def test_the_surface_spans_the_hull(surface: Surface, amount: float) -> None:
    hull = nearby_hull(surface, amount)
    result, _, distances = fill(surface, hull)
    assert result.status is FillStatus.FITTED
    assert distances.mean() <= 1e-3
    volumes = [spatial.ConvexHull(points).volume for points in (result.points, hull.vertices)]
    assert volumes[0] == pytest.approx(volumes[1], rel=0.02)
    moved = np.linalg.norm(result.points - surface.points, axis=1) / surface.diagonal
    assert moved.mean() < 1.5 * amount


@needs_clarabel
def test_what_resists_bending_bends_less() -> None:
    surface = bumpy_sphere()
    hull = nearby_hull(surface, 0.04)
    soft, stiff = (fill(surface, hull, bending=weight)[0].points for weight in (1e-4, 1.0))
    assert bent_by(surface, stiff) < 0.8 * bent_by(surface, soft)


@needs_clarabel
def test_its_own_hull_leaves_a_surface_as_it_is() -> None:
    surface = bumpy_sphere()
    result, _, _ = fill(surface, convex_hull(convex_hull(surface.points).vertices))
    assert result.status is FillStatus.FITTED
    np.testing.assert_allclose(result.points, surface.points, atol=5e-3 * surface.diagonal)


@needs_clarabel
def test_a_hull_far_away_from_the_surface() -> None:
    """The surface begins in the hull wherever it was."""
    surface = bumpy_sphere()
    hull = convex_hull(convex_hull(surface.points).vertices + 100.0)
    result, _, _ = fill(surface, hull)
    assert result.status is FillStatus.FITTED
    np.testing.assert_allclose(result.points, surface.points + 100.0, atol=0.02)


def test_without_clarabel_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "clarabel", None)
    surface = bumpy_sphere(1)
    with pytest.raises(InputError, match=r"pip install 'dicedesign\[concave\]'"):
        fill(surface, nearby_hull(surface, 0.02))


@needs_clarabel
def test_what_is_said_when_it_ends_before() -> None:
    """With a weight that hardly grows, the corners never come close."""
    surface = bent_capsule(14, 8)
    result, _, distances = fill(
        surface, nearby_hull(surface, 0.05), closest_point=1e-6, growth=1.001
    )
    assert result.status is FillStatus.STEP_LIMIT
    assert distances.mean() > 1e-3
