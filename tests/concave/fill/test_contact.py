"""Contacts of an elastic surface with the inside of a hull, against SciPy's quadratic programs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from common.bumpy import bent_capsule
from scipy.optimize import minimize

from dicedesign.concave.correspondence import Contacts
from dicedesign.concave.space_elasticity import Elasticity, HeldCorners
from dicedesign.geometry.hulls.hull import convex_hull
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
        surface = surface.moved(surface.points - surface.centroid)
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
        raised = held.held(responses).reshape(gradient.shape)
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


@pytest.mark.parametrize(("count", "seed"), [(1, 0), (6, 1), (25, 2), (60, 3)])
def test_no_contact_gives_way_and_none_pulls(count: int, seed: int) -> None:
    case = Case.of(count, seed)
    contacts = Contacts(case.held)
    contacts.add(case.points, case.facets)
    found = case.solved(contacts)
    beyond = case.heights(found)
    assert beyond.max() < 1e-8
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


@pytest.mark.parametrize("seed", range(4))
def test_the_work_is_that_of_a_quadratic_program(seed: int) -> None:
    case = Case.of(8, seed)
    contacts = Contacts(case.held)
    contacts.add(case.points, case.facets)
    found = case.solved(contacts)
    # Unknown are the displacements of the points in contact; all else follows them.
    among, place = np.unique(case.points, return_inverse=True)
    size = 3 * len(among)
    left = case.held.held(case.held.elasticity.responses(np.arange(len(found))))
    whole = np.kron(left, np.eye(3))
    center = case.gradient.reshape(-1, 3)
    rows = np.zeros((size, len(whole)))
    rows[np.arange(size), (3 * among[:, None] + np.arange(3)).ravel()] = 1.0
    sides = np.concatenate([rows, center.T])
    stiffness = np.linalg.inv(sides @ whole @ sides.T)
    normals = np.zeros((8, size))
    for row in range(8):
        normals[row, 3 * place[row] : 3 * place[row] + 3] = case.normals[row]

    def gradient(moved: Floats) -> Floats:
        return np.asarray(stiffness[:size] @ np.concatenate([moved, case.misses]))

    def work(moved: Floats) -> float:
        full = np.concatenate([moved, case.misses])
        return float(0.5 * full @ stiffness @ full)

    unit = 1.0 / abs(work(found[among].ravel()))
    expected = minimize(
        lambda moved: unit * work(moved),
        np.zeros(size),
        jac=lambda moved: unit * gradient(moved),
        method="SLSQP",
        constraints={
            "type": "ineq",
            "fun": lambda moved: case.bounds - normals @ moved,
            "jac": lambda moved: -normals,
        },
        options={"ftol": 1e-14, "maxiter": 2000},
    )
    assert expected.fun == pytest.approx(1.0, rel=1e-6)
    np.testing.assert_allclose(found[among].ravel(), expected.x, atol=1e-4)


def test_contacts_are_remembered_once() -> None:
    case = Case.of(5, 9)
    contacts = Contacts(case.held)
    contacts.add(case.points[:3], case.facets[:3])
    contacts.add(case.points, case.facets)
    np.testing.assert_array_equal(contacts.points, case.points)
    np.testing.assert_array_equal(contacts.facets, case.facets)
    others = Contacts(case.held)
    others.add(case.points, case.facets)
    np.testing.assert_allclose(case.solved(contacts), case.solved(others), atol=1e-12)
    np.testing.assert_array_equal(contacts.active, others.active)


def test_without_contacts_the_center_of_mass_alone_is_moved() -> None:
    case = Case.of(0, 10)
    found = case.solved(Contacts(case.held))
    reached = np.einsum("nab,na->b", case.gradient, found)
    np.testing.assert_allclose(reached, case.misses, atol=1e-12)
