"""The verdict on dice that keep the shape of a surface, from a made-up search."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from common.dented_cube import MadeUpSearch, write_cube

from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import Work
from dicedesign.recipe.reading import parse_recipe
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Work]:
    """The work up to the check of a cube whose points were moved by a function."""
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
def test_the_gap_is_how_far_hulls_differ_over_the_diagonal(
    sides: tuple[float, float, float], made: Callable[..., Work]
) -> None:
    """The designed hull is a cube: parts beyond it, or corners of it beyond what is there."""
    work = made(lambda points: points * sides)
    x, y, z = sides
    apart = max(z - 1.0, float(np.hypot(1.0 - y, 1.0 - z)) if z < 1.0 else 0.0)
    gap = work.concave.hull.gap
    assert gap == pytest.approx(apart / (2.0 * np.sqrt(x * x + y * y + z * z)), rel=1e-5, abs=1e-7)
    told = "; ".join(work.remarks)
    assert (Status.LOOSE.value in told) == (apart > 0.0)
    assert (f"{gap:.2g} of the diagonal" in told) == (apart > 0.0)
    assert work.concave.quality[-2].startswith("no pairs")
    assert "pairs of triangles" not in told
    before = np.array(work.concave.probabilities_before)
    np.testing.assert_allclose(before, 1.0 / 6.0, atol=1e-12)
    assert work.concave.elsewhere_before == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("attempts", "more"), [(3, True), (4, False)])
def test_more_attempts_are_advised_where_they_were_used_up(
    attempts: int, more: bool, made: Callable[..., Work]
) -> None:
    """The made-up search makes three at most."""
    work = made(lambda points: points * [1.0, 1.1, 1.25], attempts=attempts)
    assert any("method.concave.attempts" in remark for remark in work.remarks) == more
    assert any(f"best of {min(attempts, 3)} attempts" in remark for remark in work.remarks)


def test_more_seconds_are_advised_where_they_ran_out(made: Callable[..., Work]) -> None:
    """The made-up search says that it took 1.8 s."""
    for seconds, more in ((1.5, True), (2.0, False)):
        work = made(lambda points: points * [1.0, 1.1, 1.25], attempts=40, seconds=seconds)
        assert any("method.concave.seconds" in remark for remark in work.remarks) == more
        assert not any("method.concave.attempts" in remark for remark in work.remarks)


@pytest.mark.parametrize(
    ("option", "angle", "status"),
    [("apart_deg", 90.0, Status.TOO_NEAR), ("margin_deg", 45.0, Status.TIPPY)],
)
def test_angles_that_are_too_small_are_told_beside_those_that_were_wanted(
    option: str, angle: float, status: Status, made: Callable[..., Work]
) -> None:
    """Sides of a cube are 90 degrees apart, and it is tipped over an edge by 45; to single
    precision."""
    assert made(lambda points: points, **{option: angle}).status is Status.CONVERGED
    work = made(lambda points: points, **{option: angle + 0.3})
    assert work.status is status
    told = "; ".join(work.remarks)
    assert f"method.concave.{option}" in told
    assert f"{angle:.3g} degrees" in told
    assert f"{angle + 0.3:.3g}" in told
    # Probabilities that are off, and a surface that meets itself, are worse.
    work = made(lambda points: points * [1.0, 1.1, 1.25], **{option: angle + 0.3})
    assert work.status is Status.OFF_TARGET
    assert status.value in "; ".join(work.remarks)


def test_the_outcomes_that_are_too_near_and_those_that_are_left_are_named(
    made: Callable[..., Work],
) -> None:
    """A cube leaning by 3 : 10: its sides 1 and 3, of outward normals x and z, are sheared."""

    def lean(points: Floats) -> Floats:
        return points + np.outer(points[:, 2], [0.3, 0.0, 0.0])

    work = made(lean, apart_deg=80.0, margin_deg=40.0)
    told = "; ".join(work.remarks)
    # Normals of the sheared sides are (1, 0, -0.3) and (0, 0, 1), and those opposite.
    apart = np.degrees(np.arctan2(1.0, 0.3))
    assert work.plain.outcomes.least_angle == pytest.approx(np.radians(apart), abs=1e-6)
    pairs = [pair for pair in ("1 and 6", "3 and 4") if f"{pair} are {apart:.3g} degrees" in told]
    assert len(pairs) == 1
    # From (0, 0, -1) over the lower edge at (-1.3, 0, -1), beyond the center of mass by 0.7.
    left = np.degrees(np.arctan2(0.7, 1.0))
    assert np.degrees(work.plain.margins)[[2, 5]] == pytest.approx(left, abs=1e-4)
    for label in ("3", "6"):
        assert f"{label} is left at {left:.3g} degrees" in told
