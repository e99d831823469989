"""The hull fill by correspondence on small surfaces, its contacts, and untangled surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from common.bumpy import ball, bent_capsule, bumpy_sphere, nearby_hull, unit
from common.dented_cube import dented_cube

from dicedesign.concave.correspondence import MAX_ROUNDS, Contacts, fill_by_correspondence
from dicedesign.concave.hull_problem import Elasticity, HeldCorners
from dicedesign.concave.untangling import untangle
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.surfaces.closed_surface import refine
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats, Integers


@dataclass
class Case:
    """Points with limits along normals that forces on the center of mass would exceed."""

    held: HeldCorners
    points: Integers
    facets: Integers
    normals: Floats
    bounds: Floats
    gradient: Floats
    raised: Floats
    misses: Floats

    @classmethod
    def of(cls, count: int, seed: int) -> Case:
        rng = np.random.default_rng(seed)
        surface = bent_capsule(14, 8)
        surface = surface.with_points(surface.points - surface.centroid)
        elasticity = Elasticity(surface)
        held = HeldCorners(elasticity, convex_hull(surface.points).source[::3])
        free = np.setdiff1d(np.arange(len(surface.points)), held.corners)
        points = rng.choice(free, count)
        facets = np.arange(count)
        normals = rng.normal(size=(count, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        bounds = rng.uniform(-0.02, 0.01, count)
        gradient = np.moveaxis(surface.centroid_derivatives(), 0, -1)
        responses = elasticity.center_responses(gradient).reshape(-1, 9)
        raised = held.hold(responses).reshape(gradient.shape)
        return cls(held, points, facets, normals, bounds, gradient, raised, rng.normal(size=3) / 50)

    def solve(self, contacts: Contacts) -> Floats:
        return contacts.solve(self.normals, self.bounds, self.gradient, self.raised, self.misses)

    def heights(self, displacement: Floats) -> Floats:
        """(c,) excess of each point over its bound."""
        return (displacement[self.points] * self.normals).sum(axis=1) - self.bounds

    def forces(self, displacement: Floats) -> Floats:
        """(n, 3) forces on all points, including the held corners."""
        every = self.held.elasticity.responses(np.arange(len(displacement)))
        return np.linalg.solve(every, displacement)


@pytest.mark.parametrize(("count", "seed"), [(0, 0), (6, 1), (60, 3)])
def test_contacts_only_push_and_are_not_passed(count: int, seed: int) -> None:
    case = Case.of(count, seed)
    contacts = Contacts(case.held)
    contacts.add(case.points, case.facets)
    displacement = case.solve(contacts)
    beyond = case.heights(displacement)
    assert beyond.max(initial=-1.0) < 1e-8
    np.testing.assert_allclose(beyond[contacts.active], 0.0, atol=1e-8)
    np.testing.assert_allclose(displacement[case.held.corners], 0.0, atol=1e-9)
    reached = np.einsum("nab,na->b", case.gradient, displacement)
    np.testing.assert_allclose(reached, case.misses, atol=1e-10)
    # All other forces are pushes of active contacts.
    free = np.setdiff1d(np.arange(len(displacement)), case.held.corners)
    forces = case.forces(displacement)[free].ravel()
    bearing = np.flatnonzero(contacts.active)
    pushes = np.zeros((len(displacement), 3, len(bearing)))
    pushes[case.points[bearing], :, np.arange(len(bearing))] = -case.normals[bearing]
    columns = np.concatenate([pushes[free], case.gradient[free]], axis=2).reshape(len(forces), -1)
    strengths, *_ = np.linalg.lstsq(columns, forces, rcond=None)
    np.testing.assert_allclose(columns @ strengths, forces, atol=1e-6 * np.abs(forces).max())
    assert strengths[: len(bearing)].min(initial=0.0) > -1e-6 * np.abs(strengths).max()


def fill(
    surface: Surface, hull: ConvexHull, corners: Integers, center: Floats
) -> tuple[Floats | None, list[float]]:
    energies: list[float] = []
    result = fill_by_correspondence(
        HeldCorners(Elasticity(surface), corners), hull, center, energies.append
    )
    if result is None:
        return None, energies
    points, energy = result
    assert energies[-1] == energy
    np.testing.assert_array_equal(points[corners], hull.vertices)
    assert sorted(convex_hull(points).vertices.tolist()) == sorted(hull.vertices.tolist())
    return points, energies


@pytest.mark.parametrize(
    ("surface", "amount"),
    [
        (unit(bumpy_sphere()), 0.05),
        (unit(bumpy_sphere(3)), 0.05),
        (unit(bent_capsule(18, 10)), 0.03),
    ],
)
def test_hull_and_center_of_mass_are_reached(surface: Surface, amount: float) -> None:
    hull = nearby_hull(surface, amount)
    corners = convex_hull(surface.points).source[hull.source]
    center = surface.centroid + np.array([0.01, -0.005, 0.01])
    points, _ = fill(surface, hull, corners, center)
    rounded = points.astype(np.float32).astype(np.float64)
    np.testing.assert_array_equal(np.sort(convex_hull(rounded).source), np.sort(corners))
    others = np.setdiff1d(np.arange(len(points)), corners)
    slacks = hull.heights(np.zeros(3)) - points[others] @ hull.normals.T
    assert slacks.min() > 1e-6 * surface.diagonal
    miss = surface.with_points(points).centroid - center
    assert np.linalg.norm(miss) < 1e-12 * surface.diagonal
    moved = np.linalg.norm(points - surface.points, axis=1) / surface.diagonal
    assert moved.mean() < 2.0 * amount + 0.05


def test_a_cube_with_points_on_its_sides_and_edges_is_filled() -> None:
    surface, _ = refine(dented_cube(), 300)
    surface = unit(surface)
    own = convex_hull(surface.points)
    corners = own.vertices + 0.02 * np.random.default_rng(0).normal(size=own.vertices.shape)
    hull = convex_hull(corners)
    assert fill(surface, hull, own.source[hull.source], surface.centroid)[0] is not None


@pytest.mark.parametrize(
    ("surface", "shift"),
    [
        (unit(bent_capsule(18, 10)), [0.8, 0.1, -0.2]),
        # All points of a convex surface are held.
        (unit(ball(1)), [0.05, 0.0, 0.0]),
    ],
)
def test_a_center_of_mass_out_of_reach(surface: Surface, shift: list[float]) -> None:
    hull = convex_hull(surface.points)
    points, energies = fill(surface, hull, hull.source, surface.centroid + np.array(shift))
    assert points is None
    assert len(energies) <= MAX_ROUNDS


@pytest.mark.parametrize("seed", range(3))
def test_triangles_that_are_turned_over_are_parted(seed: int) -> None:
    """Pairs of neighbors that have changed their places get free places without leaving the hull or
    moving its corners or the center of mass."""
    surface = unit(bumpy_sphere(3))
    hull = nearby_hull(surface, 0.02, seed)
    held = HeldCorners(Elasticity(surface), convex_hull(surface.points).source[hull.source])
    fill = fill_by_correspondence(held, hull, surface.centroid, lambda energy: None)
    assert fill is not None
    tangled: Floats = fill[0].copy()
    is_free = ~np.isin(surface.triangles, held.corners).any(axis=1)
    for triangle in surface.triangles[is_free][[5 * seed, -1 - seed]]:
        tangled[triangle[:2]] = tangled[triangle[1::-1]]
    assert len(intersecting_triangles(tangled, surface.triangles)) > 0
    parted = untangle(held, hull, surface.centroid, tangled)
    assert parted is not None
    points, _ = parted
    assert len(intersecting_triangles(points, surface.triangles)) == 0
    np.testing.assert_array_equal(points[held.corners], hull.vertices)
    others = np.delete(np.arange(len(points)), held.corners)
    slacks = hull.heights(np.zeros(3)) - points[others] @ hull.normals.T
    assert slacks.min() > 1e-6 * surface.diagonal
    miss = surface.with_points(points).centroid - surface.centroid
    assert np.linalg.norm(miss) < 1e-12 * surface.diagonal
    # What is far from the places stays there.
    assert np.median(np.linalg.norm(points - fill[0], axis=1)) < 1e-3
