"""Objects led to their probabilities, by other facets or a linear map: judged on files read
back."""

from __future__ import annotations

from io import BytesIO
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.bodies import box

from dicedesign.fabricate.convex_object import ConvexObject, measure_resting
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import Placement, place_labels
from dicedesign.fabricate.label_reading import die_readings
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull, polyhedron_corners
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.triangles import Surface
from dicedesign.optimize.solvers.reshaping import Measured, largest_move, reshape, stretch
from dicedesign.optimize.starts.shapes import repulsion
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Status

TETRAHEDRON = {
    "name": "four",
    "target": {"probabilities": [0.3, 0.25, 0.25, 0.2]},
    "faces": "one",
}


def run_to_engraving(**entries: object) -> Work:
    work = Work(parse_recipe({**TETRAHEDRON, **entries}), None)
    run_stages(work, last="engrave")
    return work


@pytest.mark.parametrize(
    "entries",
    [
        {"edges": {"radius_mm": 2.0, "shape": "chamfer"}},
        {"engrave": {"style": "raised"}},
        {"engrave": {"balance": "opposite"}},
        {"engrave": {"balance": "none"}},
        {"engrave": False, "edges": True},
        {"target": {"fair": 6}, "symmetry": "Oh"},
        {"target": {"probabilities": [0.25, 0.75]}, "faces": "auto", "edges": True},
        pytest.param({"method": "paper", "start": {"prism": {}}}, marks=pytest.mark.full),
    ],
    ids=str,
)
def test_the_file_has_the_target_probabilities(entries: dict[str, object], tmp_path: Path) -> None:
    work = run_to_engraving(**entries)
    assert work.status is Status.CONVERGED, work.remarks
    path = tmp_path / "die.stl"
    path.write_bytes(work.files["die.stl"])
    # By the numbers of the file and, for the center of mass, of another library.
    judge = trimesh.load_mesh(path)
    assert judge.is_watertight
    poses = rest_poses(read_body(path), judge.center_mass)
    outcomes = outcome_probabilities(poses, work.die.directions, work.die.outcome_of)
    error, balance = outcomes.max_abs_error(work.target.probabilities), work.balance
    assert error == pytest.approx(balance.errors[-1], abs=1e-6)
    assert outcomes.elsewhere < 1e-9
    if balance.by == "none":
        assert error > 1e-5
        return
    # Labels of these leave the center of mass where it was.
    is_even = balance.by == "opposite" or work.die.symmetry is not None
    assert (balance.errors[0] < 1e-9) == is_even
    assert min(balance.errors) < 1e-9
    np.testing.assert_allclose(judge.center_mass, np.zeros(3), atol=1e-5)


@pytest.mark.parametrize("seed", range(2))
def test_facets_almost_in_one_plane(seed: int) -> None:
    """A border between two of them runs by millimeters as one of them is turned by its hundredth of
    a degree, and a label may not run along."""
    solid, directions, placements = folded_die(seed)
    convex_object = ConvexObject(EngravingOptions(), None)
    target = outcome_probabilities(rest_poses(solid.vertices), directions).probabilities
    end = reshape(solid, directions, placements, target, convex_object, measure_resting(None))
    assert end.errors[0] > 1e-6
    assert min(end.errors) < 1e-9


def folded_die(seed: int) -> tuple[ConvexHull, np.ndarray, list[Placement]]:
    """A labeled die of eight facets, on each of which a fold of an eighth of a degree parts a
    strip from what the die rests on, with corners off by up to a few 1e-12 of its size."""
    start = repulsion(8, 0)
    plain = convex_hull(15.0 * start.points)
    normals, folds = start.directions, []
    heights = plain.heights(np.zeros(3))[np.argmax(plain.normals @ normals.T, axis=0)]
    for normal, height in zip(normals, heights, strict=True):
        along = np.linalg.cross(normal, [0.3, 0.5, 0.8])
        along /= np.linalg.norm(along)
        # The fold runs 4.5 mm beside the foot of the origin.
        tilted = normal + np.radians(0.125) * along
        folds.append((tilted, height + np.radians(0.125) * 4.5))
    tilts, offsets = (np.array(part) for part in zip(*folds, strict=True))
    corners = polyhedron_corners(np.vstack([normals, tilts]), np.append(heights, offsets))
    noise = np.random.default_rng(seed).normal(size=corners.shape)
    solid = convex_hull(corners + 15e-12 * noise)
    facets = np.argmax(normals @ solid.normals.T, axis=1)
    places = die_readings(solid, facets, list("12345678"), "down")[0].places
    placements = place_labels(places, EngravingOptions(), solid.diameter)
    return solid, solid.normals[facets], placements


class PlainObject:
    """Labeled object that is its plain shape."""

    def make_balanced(self, core: ConvexHull, placements: object) -> Surface:
        return core.surface

    def carry_labels(self, placements: object, *hulls: object, **others: object) -> tuple[()]:
        return ()

    def bearing(self, placements: object) -> np.ndarray:
        return np.zeros((0, 3))


def test_a_center_of_mass_that_depends_on_the_shape() -> None:
    """A flatter body has a higher center: repeated corrections alone converge slowly."""
    start = repulsion(8, 0)
    core = convex_hull(start.points)

    def measure(surface: Surface, directions: np.ndarray) -> Measured:
        growth = np.ptp(surface.points[:, 2]) - np.ptp(core.vertices[:, 2])
        center = surface.centroid + (0.02 - 2.0 * growth) * np.eye(3)[2]
        outcomes = outcome_probabilities(rest_poses(surface.points, center), directions)
        return Measured(center, outcomes.probabilities)

    target = outcome_probabilities(rest_poses(core.vertices), start.directions).probabilities
    end = reshape(core, start.directions, (), target, PlainObject(), measure)
    assert end.errors[0] > 1e-3
    assert min(end.errors) < 1e-9
    np.testing.assert_allclose(end.measured.probabilities, target, atol=1e-9)


def test_the_largest_move_is_outward_or_inward() -> None:
    for moved in (0.3, -0.3):
        before, after = (
            convex_hull(list(product(ends, (-1.0, 1.0), (-1.0, 1.0))))
            for ends in ((-1.0, 1.0), (-1.0 - moved, 1.1))
        )
        assert largest_move(before, after) == pytest.approx(0.3)


def test_filled_labels_need_no_change() -> None:
    work = run_to_engraving(engrave={"balance": "fill"})
    assert work.balance.moved_mm < 1e-12
    engraved, inlay, plain = (
        trimesh.load_mesh(BytesIO(work.files[name]), file_type="stl")
        for name in ("die.stl", "die_inlay.stl", "die_plain.stl")
    )
    assert engraved.volume + inlay.volume == pytest.approx(plain.volume, rel=1e-6)
    both = engraved.volume * engraved.center_mass + inlay.volume * inlay.center_mass
    np.testing.assert_allclose(both / plain.volume, plain.center_mass, atol=1e-6)


SIDES = np.concatenate([np.eye(3), -np.eye(3)])


def probabilities_of(surface: Surface, directions: np.ndarray) -> np.ndarray:
    return outcome_probabilities(rest_poses(surface), directions).probabilities


def test_a_box_is_stretched_to_the_box_with_the_probabilities() -> None:
    """Opposite sides of a box are equal, and its proportions follow from the probabilities."""
    wanted = probabilities_of(box([10.0, 10.2, 9.9]), SIDES)
    cube = box([10.0] * 3)
    end = stretch(cube, SIDES, wanted)
    assert end.errors[0] > 1e-3
    assert end.errors[1] < 1e-11
    np.testing.assert_allclose(probabilities_of(end.surface, end.directions), wanted, atol=1e-11)
    lengths = np.linalg.eigvalsh(end.matrix) * 10.0
    np.testing.assert_allclose(
        np.sort(lengths / lengths.mean()), np.sort([10.0, 10.2, 9.9]) / 10.033333333, rtol=1e-6
    )
    np.testing.assert_allclose(end.surface.centroid, cube.centroid, atol=1e-12)
    # Opposite sides of any box are equal, so that these cannot be met.
    unequal = np.array([0.2, 0.16, 0.16, 0.14, 0.17, 0.17])
    end = stretch(cube, SIDES, unequal)
    assert end.errors[1] <= end.errors[0]
    assert end.errors[1] == pytest.approx(0.03, abs=0.02)
