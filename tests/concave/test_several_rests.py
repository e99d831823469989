"""Outcomes of several rests: groups, ways to share them out, and smooth bending to the target."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from common.bodies import write_mesh
from common.bumpy import bumpy_sphere

from dicedesign.balance.cavity import reach
from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.rest_groups import group_rests, outcome_gap, share_groups
from dicedesign.concave.smooth_bending import SmoothBending
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import read_stl
from dicedesign.geometry.triangles import Surface
from dicedesign.recipe.pipeline import run
from dicedesign.rest.poses import RestPoses, analyze, rest_poses
from dicedesign.rest.roll import roll
from dicedesign.results.result import Result

TARGET = np.array([0.5, 0.3, 0.2])


def brick() -> RestPoses:
    """Rests of a box with edges of 1, 1.2 and 3."""
    corners = np.array(list(product((-0.5, 0.5), repeat=3))) * [1.0, 1.2, 3.0]
    return analyze(convex_hull(corners), np.zeros(3))


@pytest.mark.parametrize(
    ("barrier", "groups"), [(0.0, 6), (0.075, 6), (0.09, 4), (0.2, 2), (0.3, 1)]
)
def test_rests_of_a_box_are_grouped_by_its_edges(barrier: float, groups: int) -> None:
    """The center of mass rises by the half diagonal of two faces less half an edge: by .081 from
    the smallest faces to the largest, by .181 from the middle ones, and by .281 from the largest to
    the middle ones."""
    poses = brick()
    group = group_rests(poses, barrier)
    assert len(np.unique(group)) == groups == group.max() + 1
    if groups == 4:
        axis = np.abs(poses.normals).argmax(axis=1)
        ends, sides = group[axis == 2], group[axis == 0]
        assert set(ends.tolist()) <= set(sides.tolist())


@pytest.mark.parametrize(("similar", "groups"), [(89.0, 6), (91.0, 1)])
def test_similar_rests_are_one_group(similar: float, groups: int) -> None:
    """Neighboring faces of a box are at right angles."""
    assert group_rests(brick(), 0.0, np.radians(similar)).max() + 1 == groups


@pytest.fixture(scope="module")
def surface() -> Surface:
    """Bumpy sphere with its center of mass at the origin and a diagonal of 1."""
    given = bumpy_sphere(2)
    return given.with_points((given.points - given.centroid) / given.diagonal)


@pytest.fixture(scope="module")
def poses(surface: Surface) -> RestPoses:
    return rest_poses(surface)


def test_groups_only_join(poses: RestPoses) -> None:
    """Rests of a group stay together when the barrier is raised."""
    finer = group_rests(poses, 0.0)
    for barrier in (1e-4, 3e-4, 1e-3, 3e-3, 1e-2):
        coarser = group_rests(poses, barrier)
        assert coarser.max() <= finer.max()
        assert len(np.unique(finer * 1000 + coarser)) == finer.max() + 1
        finer = coarser


def test_groups_are_shared_out_near_the_target(poses: RestPoses) -> None:
    group = group_rests(poses, 3e-4)
    shares = np.bincount(group, poses.probabilities)
    assert len(shares) > 8
    ways = share_groups(poses, group, TARGET, 5)
    assert len({way.tobytes() for way in ways}) == 5
    for way in ways:
        assert set(way.tolist()) == {0, 1, 2}
        assert all(len(np.unique(way[group == number])) == 1 for number in range(len(shares)))
    # The nearest sums of all are hardly nearer than those of the first way.
    choices = np.array(list(product(range(3), repeat=9)))
    largest = np.sort(shares)[::-1]
    sums = np.stack([(choices == k) @ largest[:9] for k in range(3)], axis=1)
    nearest = np.abs(sums - TARGET).sum(axis=1).min()
    off = np.abs(np.bincount(ways[0], poses.probabilities) - TARGET).sum()
    assert off <= nearest + largest[9:].sum() + 0.1


def test_too_few_groups_have_no_way(poses: RestPoses) -> None:
    assert share_groups(poses, np.zeros(len(poses.normals), dtype=np.int64), TARGET, 5) == []


def test_the_gap_is_between_different_outcomes() -> None:
    poses = brick()
    axis = np.abs(poses.normals).argmax(axis=1)
    gap = outcome_gap(poses.normals, poses.probabilities, (axis == 0).astype(np.int64))
    assert gap == pytest.approx(np.pi / 2)
    assert outcome_gap(poses.normals, poses.probabilities, np.zeros(6, dtype=np.int64)) == np.pi
    sides = (poses.normals[:, 0] > 0.5).astype(np.int64) + 2 * (axis != 0)
    assert outcome_gap(poses.normals, poses.probabilities, sides) == pytest.approx(np.pi / 2)


def outcomes_by_rolling(surface: Surface, outcomes: np.ndarray, bent: Surface) -> np.ndarray:
    """Sums of a bent surface whose rests have the outcomes of the rests of the surface to which it
    rolls from there."""
    before, after = rest_poses(surface), rest_poses(bent)
    ends = np.array([roll(surface, normal)[-1].down for normal in after.normals])
    return np.bincount(
        outcomes[(ends @ before.normals.T).argmax(axis=1)], after.probabilities, len(TARGET)
    )


def test_a_solid_is_bent_a_little_to_the_target(surface: Surface, poses: RestPoses) -> None:
    way = share_groups(poses, group_rests(poses, 3e-4), TARGET, 1)[0]
    assert np.abs(np.bincount(way, poses.probabilities) - TARGET).max() > 1e-3
    bent = SmoothBending(surface).bend(way, TARGET, 1e-9, None, lambda *_: None)
    assert bent is not None
    after = surface.with_points(bent.points)
    np.testing.assert_allclose(bent.center_of_mass, after.centroid, rtol=0, atol=1e-15)
    np.testing.assert_allclose(bent.sums(3), TARGET, rtol=0, atol=1e-9)
    np.testing.assert_allclose(outcomes_by_rolling(surface, way, after), TARGET, rtol=0, atol=1e-9)
    assert np.linalg.norm(bent.points - surface.points, axis=1).mean() < 0.001


def test_a_cavity_leaves_the_surface_as_it_is(surface: Surface, poses: RestPoses) -> None:
    way = share_groups(poses, group_rests(poses, 3e-4), TARGET, 1)[0]
    room = reach(surface, 0.03)
    bent = SmoothBending(surface).bend(way, TARGET, 1e-9, room, lambda *_: None)
    assert bent is not None
    assert np.linalg.norm(bent.points - surface.points, axis=1).max() < 1e-7
    shift = bent.center_of_mass - surface.with_points(bent.points).centroid
    assert np.linalg.norm(shift) > 1e-4
    assert (room.heights(shift) > 0.0).all()
    moved = rest_poses(surface, surface.centroid + shift)
    near = (moved.normals @ bent.poses.normals.T).argmax(axis=1)
    sums = np.bincount(bent.outcomes[near], moved.probabilities, 3)
    np.testing.assert_allclose(sums, TARGET, rtol=0, atol=1e-6)


@pytest.fixture(scope="module")
def die(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """Die of the bumpy sphere, with labels."""
    folder = tmp_path_factory.mktemp("several")
    given = bumpy_sphere(2)
    write_mesh(folder / "ball.obj", given.points, given.triangles)
    recipe = {
        "name": "several",
        "target": {"probabilities": TARGET.tolist(), "labels": ["A", "B", "C"]},
        "start": {"mesh": {"path": str(folder / "ball.obj")}},
        "method": {"concave": {"rests": "several", "attempts": 3}},
        "print": None,
        "size_mm": 60,
        "engrave": {"balance": "shape"},
        "figures": False,
        "report": False,
    }
    return run(recipe, folder / "die")


def test_the_files_have_the_probabilities(die: Result) -> None:
    """The rests of the files are matched with the listed facets here."""
    assert die.status == "converged", die.message
    assert die.folder is not None
    outcomes = [die.labels.index(facet.outcome) for facet in die.facets]
    normals = np.array([facet.normal for facet in die.facets])
    assert len(outcomes) > 3
    for name, within in (("die_plain.stl", 1e-6), ("die.stl", 1e-6)):
        poses = rest_poses(read_stl((die.folder / name).read_bytes()))
        nearest = (poses.normals @ normals.T).argmax(axis=1)
        sums = np.bincount(np.array(outcomes)[nearest], poses.probabilities, 3)
        np.testing.assert_allclose(sums, TARGET, rtol=0, atol=within)


def test_the_surface_hardly_changes(die: Result) -> None:
    assert die.concave is not None
    assert die.concave.displacement.mean < 0.002
    turns = die.concave.surface_quality["turns"]
    assert turns["mean_degrees"] < 1.0
    assert turns["peaks"] == 0
    assert die.elsewhere == 0.0
    assert die.least_angle_deg >= 5.0


def test_each_outcome_has_a_main_rest_with_a_label(die: Result) -> None:
    labeled = [facet.label for facet in die.facets if facet.label is not None]
    assert set(labeled) == {"A", "B", "C"}
    assert die.engraved is not None


def test_the_paper_has_one_rest_for_an_outcome() -> None:
    with pytest.raises(InputError, match="rests: expected one with hull: paper"):
        ConcaveOptions(rests="several", hull="paper")


def test_more_outcomes_than_groups_leave_the_surface_and_the_target(tmp_path: Path) -> None:
    given = bumpy_sphere(2)
    write_mesh(tmp_path / "ball.obj", given.points, given.triangles)
    recipe = {
        "name": "many",
        "target": {"fair": 40},
        "start": {"mesh": {"path": str(tmp_path / "ball.obj")}},
        "method": {"concave": {"rests": "several"}},
        "print": None,
        "figures": False,
        "report": False,
    }
    result = run(recipe, tmp_path / "die")
    assert result.status == "unchanged"
    np.testing.assert_allclose(result.target, 1.0 / 40.0)
    assert result.concave is not None
    assert result.concave.displacement.largest == 0.0
