"""The hull fill by correspondence on small surfaces, and the contacts that it leans on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from common.bumpy import ball, bent_capsule, bumpy_sphere, nearby_hull, unit
from common.dented_cube import dented_cube

from dicedesign.concave.correspondence import MOST_ROUNDS, Contacts, fill_by_correspondence
from dicedesign.concave.hull_problem import Elasticity, HeldCorners
from dicedesign.concave.result import FillResult, FillStatus
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.surfaces.closed_surface import refine
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats, Integers


@dataclass
class Case:
    """A few points that are not to go as far along some normals as forces on the center of mass
    would move them."""

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

    def solved(self, contacts: Contacts) -> Floats:
        return contacts.solve(self.normals, self.bounds, self.gradient, self.raised, self.misses)

    def heights(self, displacement: Floats) -> Floats:
        """(c,) how far each point goes beyond its bound."""
        return (displacement[self.points] * self.normals).sum(axis=1) - self.bounds

    def forces(self, displacement: Floats) -> Floats:
        """(n, 3) on all points; on corners too, which hold them."""
        every = self.held.elasticity.responses(np.arange(len(displacement)))
        return np.linalg.solve(every, displacement)


@pytest.mark.parametrize(("count", "seed"), [(0, 0), (6, 1), (60, 3)])
def test_no_contact_gives_way_and_none_pulls(count: int, seed: int) -> None:
    case = Case.of(count, seed)
    contacts = Contacts(case.held)
    contacts.add(case.points, case.facets)
    found = case.solved(contacts)
    beyond = case.heights(found)
    assert beyond.max(initial=-1.0) < 1e-8
    np.testing.assert_allclose(beyond[contacts.active], 0.0, atol=1e-8)
    np.testing.assert_allclose(found[case.held.corners], 0.0, atol=1e-9)
    reached = np.einsum("nab,na->b", case.gradient, found)
    np.testing.assert_allclose(reached, case.misses, atol=1e-10)
    # What acts besides the corners and the center of mass are pushes of the bearing contacts.
    free = np.setdiff1d(np.arange(len(found)), case.held.corners)
    forces = case.forces(found)[free].ravel()
    bearing = np.flatnonzero(contacts.active)
    pushes = np.zeros((len(found), 3, len(bearing)))
    pushes[case.points[bearing], :, np.arange(len(bearing))] = -case.normals[bearing]
    columns = np.concatenate([pushes[free], case.gradient[free]], axis=2).reshape(len(forces), -1)
    strengths, *_ = np.linalg.lstsq(columns, forces, rcond=None)
    np.testing.assert_allclose(columns @ strengths, forces, atol=1e-6 * np.abs(forces).max())
    assert strengths[: len(bearing)].min(initial=0.0) > -1e-6 * np.abs(strengths).max()


def wanted(surface: Surface, amount: float) -> tuple[ConvexHull, Integers]:
    """A hull near the surface's own, and the points that are to be its corners."""
    hull = nearby_hull(surface, amount)
    return hull, convex_hull(surface.points).source[hull.source]


def fill(
    surface: Surface, hull: ConvexHull, corners: Integers, center: Floats
) -> tuple[FillResult, list[float]]:
    energies: list[float] = []
    result = fill_by_correspondence(Elasticity(surface), hull, corners, center, energies.append)
    assert energies[-1] == result.energy
    return result, energies


@pytest.mark.parametrize(
    ("surface", "amount"),
    [
        (unit(bumpy_sphere()), 0.05),
        (unit(bumpy_sphere(3)), 0.05),
        (unit(bent_capsule(18, 10)), 0.03),
    ],
)
def test_the_hull_and_the_center_of_mass_are_the_wanted_ones(
    surface: Surface, amount: float
) -> None:
    hull, corners = wanted(surface, amount)
    center = surface.centroid + np.array([0.01, -0.005, 0.01])
    result, _ = fill(surface, hull, corners, center)
    assert result.status is FillStatus.FITTED
    np.testing.assert_array_equal(result.points[corners], hull.vertices)
    found = convex_hull(result.points)
    assert sorted(found.vertices.tolist()) == sorted(hull.vertices.tolist())
    rounded = result.points.astype(np.float32).astype(np.float64)
    np.testing.assert_array_equal(np.sort(convex_hull(rounded).source), np.sort(corners))
    others = np.setdiff1d(np.arange(len(result.points)), corners)
    slacks = hull.heights(np.zeros(3)) - result.points[others] @ hull.normals.T
    assert slacks.min() > 1e-6 * surface.diagonal
    miss = surface.with_points(result.points).centroid - center
    assert np.linalg.norm(miss) < 1e-12 * surface.diagonal
    moved = np.linalg.norm(result.points - surface.points, axis=1) / surface.diagonal
    assert moved.mean() < 2.0 * amount + 0.05


def test_points_on_flat_sides_sink_by_a_hair() -> None:
    """A cube of some hundred points, most of them on its sides and edges."""
    surface, _ = refine(dented_cube(), 300)
    surface = unit(surface)
    own = convex_hull(surface.points)
    corners = own.vertices + 0.02 * np.random.default_rng(0).normal(size=own.vertices.shape)
    hull = convex_hull(corners)
    result, _ = fill(surface, hull, own.source[hull.source], surface.centroid)
    assert result.status is FillStatus.FITTED
    found = convex_hull(result.points)
    assert sorted(found.vertices.tolist()) == sorted(hull.vertices.tolist())


def test_a_center_of_mass_out_of_reach() -> None:
    surface = unit(bent_capsule(18, 10))
    hull = convex_hull(surface.points)
    result, steps = fill(surface, hull, hull.source, surface.centroid + np.array([0.8, 0.1, -0.2]))
    assert result.status is FillStatus.NO_PROGRESS
    assert len(steps) < MOST_ROUNDS


def test_a_convex_surface_has_nothing_to_move() -> None:
    """All its points are corners; they stay in place, and so does the center of mass."""
    surface = unit(ball(1))
    hull = convex_hull(surface.points)
    assert len(hull.vertices) == len(surface.points)
    center = surface.centroid + np.array([0.05, 0.0, 0.0])
    result, _ = fill(surface, hull, hull.source, center)
    np.testing.assert_array_equal(result.points[hull.source], hull.vertices)
