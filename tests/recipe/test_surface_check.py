"""Verdicts on concave dice with a replaced search."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from common.dented_cube import MadeUpSearch, write_cube

from dicedesign.concave.result import Hollow
from dicedesign.geometry.meshes.body import shells_of
from dicedesign.geometry.meshes.reading import read_stl
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.triangles import Surface
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import Work
from dicedesign.recipe.reading import parse_recipe
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats


@pytest.fixture
def make_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Work]:
    """Function that runs a cube with moved points up to the check."""
    write_cube(tmp_path / "cube.obj")

    def make(change: Callable[[Floats], Floats], **options: float) -> Work:
        search = MadeUpSearch()
        search.change = change
        monkeypatch.setattr("dicedesign.recipe.concave.make_concave_die", search)
        entries = {
            "name": "cube",
            "target": {"fair": 6},
            "start": {"mesh": {"path": str(tmp_path / "cube.obj")}},
            "method": {"concave": {"attempts": 3, **options}},
        }
        return design_recipe(parse_recipe(entries), last="check")

    return make


@pytest.mark.parametrize("sides", [(1.0, 1.1, 1.25), (1.0, 0.9, 0.75), (1.0, 1.0, 1.0)])
def test_the_gap_is_the_distance_between_hulls_over_the_diagonal(
    sides: tuple[float, float, float], make_work: Callable[..., Work]
) -> None:
    """The designed hull is a cube; the surface is larger or smaller."""
    work = make_work(lambda points: points * sides)
    x, y, z = sides
    apart = max(z - 1.0, float(np.hypot(1.0 - y, 1.0 - z)) if z < 1.0 else 0.0)
    gap = work.concave.hull.gap
    assert gap == pytest.approx(apart / (2.0 * np.sqrt(x * x + y * y + z * z)), rel=1e-5, abs=1e-7)
    message = "; ".join(work.remarks)
    assert (Status.LOOSE.value in message) == (apart > 0.0)
    assert (f"{gap:.2g} of the diagonal" in message) == (apart > 0.0)
    assert work.concave.quality[-2].startswith("no pairs")
    assert "pairs of triangles" not in message
    before = np.array(work.concave.probabilities_before)
    np.testing.assert_allclose(before, 1.0 / 6.0, atol=1e-12)
    assert work.concave.elsewhere_before == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("attempts", "more"), [(3, True), (4, False)])
def test_more_attempts_are_advised_if_they_were_used_up(
    attempts: int, more: bool, make_work: Callable[..., Work]
) -> None:
    """The replaced search makes at most three."""
    work = make_work(lambda points: points * [1.0, 1.1, 1.25], attempts=attempts)
    assert any("method.concave.attempts" in remark for remark in work.remarks) == more
    assert any(f"best of {min(attempts, 3)} attempts" in remark for remark in work.remarks)


def test_more_seconds_are_advised_if_they_ran_out(make_work: Callable[..., Work]) -> None:
    """The replaced search reports 1.8 s."""
    for seconds, more in ((1.5, True), (2.0, False)):
        work = make_work(lambda points: points * [1.0, 1.1, 1.25], attempts=40, seconds=seconds)
        assert any("method.concave.seconds" in remark for remark in work.remarks) == more
        assert not any("method.concave.attempts" in remark for remark in work.remarks)


@pytest.mark.parametrize(
    ("option", "angle", "status"),
    [("apart_deg", 90.0, Status.TOO_NEAR), ("margin_deg", 45.0, Status.TIPPY)],
)
def test_small_angles_are_named_with_their_limits(
    option: str, angle: float, status: Status, make_work: Callable[..., Work]
) -> None:
    """The sides of a cube are 90 degrees apart, and it tips over an edge at 45 degrees."""
    assert make_work(lambda points: points, **{option: angle}).status is Status.CONVERGED
    work = make_work(lambda points: points, **{option: angle + 0.3})
    assert work.status is status
    message = "; ".join(work.remarks)
    assert f"method.concave.{option}" in message
    assert f"{angle:.3g} degrees" in message
    assert f"{angle + 0.3:.3g}" in message
    # Errors of the probabilities are worse.
    work = make_work(lambda points: points * [1.0, 1.1, 1.25], **{option: angle + 0.3})
    assert work.status is Status.OFF_TARGET
    assert status.value in "; ".join(work.remarks)


def test_outcomes_with_small_angles_are_named(
    make_work: Callable[..., Work],
) -> None:
    """A cube sheared by 3 : 10; its sides 1 and 3 have outward normals x and z."""

    def lean(points: Floats) -> Floats:
        return points + np.outer(points[:, 2], [0.3, 0.0, 0.0])

    work = make_work(lean, apart_deg=80.0, margin_deg=40.0)
    message = "; ".join(work.remarks)
    # Normals of the sheared sides are (1, 0, -0.3) and (0, 0, 1), and those opposite.
    apart = np.degrees(np.arctan2(1.0, 0.3))
    assert work.plain.outcomes.least_angle == pytest.approx(np.radians(apart), abs=1e-6)
    pairs = [
        pair for pair in ("1 and 6", "3 and 4") if f"{pair} are {apart:.3g} degrees" in message
    ]
    assert len(pairs) == 1
    # From (0, 0, -1) over the lower edge at (-1.3, 0, -1), beyond the center of mass by 0.7.
    left = np.degrees(np.arctan2(0.7, 1.0))
    assert np.degrees(work.plain.margins)[[2, 5]] == pytest.approx(left, abs=1e-4)
    for label in ("3", "6"):
        assert f"{label} tips over at {left:.3g} degrees" in message


def test_the_walls_of_a_marked_hollow_die_are_measured_in_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The printer makes walls of 0.8 mm."""
    write_cube(tmp_path / "cube.obj")
    wall_mm, depth_mm, size_mm, search = 1.2, 0.6, 40.0, MadeUpSearch()
    search.hollow = Hollow(wall_mm / size_mm, np.array([0.02, 0.01, 0.0]))
    monkeypatch.setattr("dicedesign.recipe.concave.make_concave_die", search)
    entries = {
        "name": "cube",
        "target": {"fair": 6},
        "start": {"mesh": {"path": str(tmp_path / "cube.obj")}},
        "method": {"concave": {"tolerance": 0.05, "hollow": {"wall_mm": wall_mm}}},
        "size_mm": size_mm,
        "engrave": {"depth_mm": depth_mm, "balance": "none"},
    }
    work = design_recipe(parse_recipe(entries), last="engrave")
    body = read_stl(work.files["die.stl"])
    shell = shells_of(body.triangles)
    shells = [Surface(body.points, body.triangles[shell == each]) for each in range(2)]
    outer, inner = sorted(shells, key=lambda each: -each.volume)
    assert outer.volume > 0.0 > inner.volume
    nearest = min(
        distances_from_surface(one, other.points[np.unique(other.triangles)]).min()
        for one, other in ((outer, inner), (inner, outer))
    )
    cavities = work.concave.cavities
    assert cavities.wall_mm == pytest.approx(wall_mm, rel=0.02)
    assert cavities.marked_wall_mm == pytest.approx(wall_mm - depth_mm, rel=0.05)
    assert cavities.marked_wall_mm == pytest.approx(nearest, rel=0.02)
    (note,) = [note for note in work.notes if "walls between marks and cavity" in note]
    measured = f"measure {cavities.marked_wall_mm:.2g} mm, fdm makes 0.8 mm or more"
    assert f"{measured}: raise method.concave.hollow.wall_mm" in note
