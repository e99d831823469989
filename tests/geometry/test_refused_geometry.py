"""What geometry refuses: points, triangles, centers of mass, half-spaces, groups and surfaces."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import product

import numpy as np
import pytest
import trimesh
from common.bumpy import ball, bumpy_sphere, self_intersecting_sphere

import dicedesign as dd
from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.hulls.polygons import inscribed_circle
from dicedesign.geometry.meshes.body import Body, make_body, resolve_center_of_mass
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.geometry.point_groups import point_group
from dicedesign.geometry.surfaces.closed_surface import (
    decimate,
    make_surface,
    refine,
    require_dents,
)
from dicedesign.geometry.surfaces.repair import input_surface, repair_mesh
from dicedesign.geometry.triangles import Surface

NAN, INF = float("nan"), float("inf")
BALL = ball(2)
CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))
TURN = trimesh.transformations.random_rotation_matrix(num=1)[:3, :3]
CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
AXES = np.concatenate([np.eye(3), -np.eye(3)])
Row = tuple[Callable[..., object], list, type[InputError], str]


def nan_at(points: np.ndarray, row: int) -> np.ndarray:
    return np.where(np.arange(len(points))[:, None] == row, NAN, points)


BODIES: list[Row] = [
    *[
        (make_body, [points], InputError, f"real numbers, got {text}")
        for points, text in (
            ([], r"shape \(0,\); pass one row"),
            (np.zeros((5, 2)), r"shape \(5, 2\)"),
            ([[1, 2, 3], [1, 2]], "rows of different lengths"),
            ([["a", "b", "c"]] * 4, "dtype <U1"),
        )
    ],
    *[
        (make_body, [CORNERS, triangles], InputError, text)
        for triangles, text in (
            ([[0, 1, 2], [0, 1, 4]], "points 0 to 3, got point 4 in triangle 1"),
            ([[0, 1, 2, 3]], r"triangles as an \(n, 3\) array"),
            ([[0.0, 1.0, 2.0]], "integer numbers, got dtype float64"),
        )
    ],
    (make_body, [nan_at(CUBE, 5)], DegenerateBodyError, "in point 5"),
    (make_body, [CORNERS[:3] * 4], DegenerateBodyError, "at least 4 distinct points .*, got 3"),
    (make_body, [1e-100 * np.array(CORNERS)], DegenerateBodyError, "another unit of length"),
    (make_body, [1e300 * np.array(CORNERS)], DegenerateBodyError, "another unit of length"),
]

HULLS: list[Row] = [
    *[
        (convex_hull, [points], DegenerateBodyError, text)
        for points, text in (
            (np.repeat(CUBE[:1], 5, axis=0), "got one repeated"),
            (CUBE * [1, 1, 0] @ TURN, "got 8 points on one plane"),
        )
    ],
    *[
        (convex_hull, [CUBE, tolerance], InputError, r"tolerance: expected a number in \[0, 1\)")
        for tolerance in (-1.0, 1.0, NAN, "0.1")
    ],
    *[
        (polyhedron_corners, [normals, offsets], InputError, text)
        for normals, offsets, text in (
            (AXES[:, :2], np.ones(6), r"got shape \(6, 2\)"),
            (nan_at(AXES, 0), np.ones(6), "finite normals, got .*row 0"),
            (AXES, np.ones(5), r"expected 6 finite offsets, got shape \(5,\)"),
            (AXES, [1, 1, 1, 1, 1, INF], r"expected 6 finite offsets, got \[.*inf"),
            (AXES[:5], np.ones(5), "half-spaces"),
            (AXES, [1, 1, 1, 1, 1, -0.5], "half-spaces"),
        )
    ],
    *[
        (inscribed_circle, [polygon], InputError, "polygon: expected")
        for polygon in (np.zeros((3, 2)), np.zeros((2, 2)), np.zeros((3, 3)), np.full((3, 2), NAN))
    ],
    *[
        (point_group, [name], InputError, f"expected one of C1, Cs, .* Ih, got '{name}'")
        for name in ("c3", "C0", "C13", "S3", "D3v")
    ],
]


def named(points: object, triangles: object = None) -> Body:
    return make_body(points, triangles, name="thing")


def shells(*parts: Surface) -> Body:
    whole = trimesh.util.concatenate([trimesh.Trimesh(p.points, p.triangles) for p in parts])
    return named(whole.vertices, whole.faces)


def scaled(surface: Surface, factor: float, x: float = 0.0) -> Surface:
    return surface.with_points(factor * surface.points + [x, 0.0, 0.0])


def bent_sheet() -> Body:
    """The upper side of a box, bent."""
    box = trimesh.creation.box().subdivide().subdivide()
    points, upper = box.vertices.copy(), (box.triangles[:, :, 2] > 0.4).all(axis=1)
    points[:, 2] = 0.05 * np.sin(9.0 * points[:, 0]) * np.cos(9.0 * points[:, 1])
    return named(points, box.faces[upper])


def klein_bottle(n: int = 6) -> Body:
    """A grid whose seam is joined the wrong way around."""
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))

    def index(i: np.ndarray, j: np.ndarray) -> np.ndarray:
        return (i % n) * n + np.where(i >= n, -j, j) % n

    a, b, c, d = index(i, j), index(i + 1, j), index(i, j + 1), index(i + 1, j + 1)
    triangles = np.concatenate((np.stack((a, b, c), 1), np.stack((b, d, c), 1)))
    return named(np.random.default_rng(0).normal(size=(n * n, 3)), triangles)


def pinched_torus() -> Body:
    """The tube is pinched to one point."""
    mesh = trimesh.creation.torus(2.0, 0.5, major_sections=24, minor_sections=12)
    points, ring = np.asarray(mesh.vertices).copy(), np.arange(12)
    points[0] = (2.0, 0.0, 0.0)
    return named(points, np.where(np.isin(mesh.faces, ring), 0, mesh.faces))


FINGER, LARGE = self_intersecting_sphere(), bumpy_sphere(5)
TORUS = trimesh.creation.torus(2.0, 0.5, major_sections=48, minor_sections=24)
TORUS = Surface(np.asarray(TORUS.vertices), np.asarray(TORUS.faces))
AGAIN = TORUS.with_points(TORUS.points + np.array([0.3, 0.2, 0.1]))
TWO_TORI = Surface(
    np.vstack((TORUS.points, AGAIN.points)), np.vstack((TORUS.triangles, AGAIN.triangles + 1152))
)
EGG = ball(3)
EGG = EGG.with_points(EGG.points * [1.0, 1.0, 1.4] * (1.0 + 0.1 * EGG.points[:, 2:]))
RIPPLES = ball(3)
RIPPLES = RIPPLES.with_points(RIPPLES.points * (1.0 + 0.01 * np.sin(7.0 * RIPPLES.points[:, :1])))
TETRAHEDRA = np.vstack((TETRAHEDRON, np.array([0, 1, 4, 5])[TETRAHEDRON]))
CORNERS_OF_TWO = np.array([*CORNERS, [0, -1, 0], [0, 0, -1]], dtype=float)

SURFACES: list[Row] = [
    *[
        (make_surface, [body], error, text)
        for body, error, text in (
            (
                named(BALL.points * [1.0, 1.0, 1e-14], BALL.triangles),
                DegenerateBodyError,
                "encloses a volume",
            ),
            (named(CORNERS_OF_TWO, TETRAHEDRA), InputError, "1 edges with more than two triangles"),
            (klein_bottle(), InputError, "one-sided.*not orientable"),
            (pinched_torus(), InputError, r"several at 1 points .*, the first at \(2, 0, 0\)"),
            (shells(FINGER), InputError, "does not meet itself.*the first near.*repair: true"),
            (
                shells(BALL, scaled(BALL, 0.5), scaled(BALL, 0.3, -4.0)),
                InputError,
                r"got 3 shells: .* 1 inside it \(cavities or parts\) and 1 outside",
            ),
        )
    ],
    (require_dents, [scaled(EGG, 1e-6, 3e-6)], InputError, "a convex one; take method"),
    (require_dents, [RIPPLES], InputError, "nearly a sphere"),
    (decimate, [TORUS, 3], InputError, "expected at least 4 points, got 3"),
    (decimate, [TWO_TORI, 1500], InputError, "got none from 2304 points by any reduction"),
    (refine, [Surface(TORUS.points, TORUS.triangles[1:]), 2000], InputError, "NotManifold"),
    (repair_mesh, [bent_sheet()], DegenerateBodyError, "give them a thickness"),
    (input_surface, [named(LARGE.points, LARGE.triangles[1:]), 300], InputError, "3 edges with"),
    (stl_bytes, [Surface(nan_at(CUBE, 3), TETRAHEDRON)], InputError, "finite in float32.*in row 3"),
    (stl_bytes, [Surface(1e300 * CUBE, TETRAHEDRON)], InputError, "finite in float32"),
]

BOX = trimesh.creation.box()
OPEN = trimesh.Trimesh(BOX.vertices, BOX.faces[1:], process=False)
center_of = partial(resolve_center_of_mass, make_body(CORNERS, TETRAHEDRON), np.zeros(3))

MASSES: list[Row] = [
    *[
        (center_of, [request], InputError, 'expected "hull" or three finite numbers x,y,z, got')
        for request in ("surface", [1.0, 2.0], [1.0, 2.0, NAN], 4.0)
    ],
    *[
        (dd.weighted_body, [[(BOX, density)]], InputError, "density")
        for density in (-1.0, INF, "1")
    ],
    *[
        (dd.weighted_body, [parts], InputError, text)
        for parts, text in (
            ([(BOX.copy().apply_scale(3.0), 1e308)], "finite mass"),
            ([(BOX, 0.0)], "mass above 0"),
            ([], "at least one"),
            ([(BOX, 1.0), (OPEN, 2.0)], "closed"),
            ([(np.asarray(BOX.vertices), 1.0)], "closed"),
        )
    ],
]


@pytest.mark.parametrize(
    ("make", "arguments", "error", "text"), [*BODIES, *HULLS, *SURFACES, *MASSES]
)
def test_refused(
    make: Callable[..., object],
    arguments: list,
    error: type[InputError],
    text: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Coarse grids take less time.
    monkeypatch.setattr("dicedesign.geometry.surfaces.repair.CELLS", 40)
    with pytest.raises(error, match=text):
        make(*arguments)
