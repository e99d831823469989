"""Dice under a prior, and printed dice with a given center of mass, judged by their files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import dicedesign as dd
from dicedesign.errors import InputError
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import run, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.report.pages import throwing_advice
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses
from dicedesign.results.folder import read_result

BARE = {"print": False, "figures": False, "report": False, "engrave": False}


def lower_half(axis: tuple[float, float, float], count: int) -> np.ndarray:
    """(count, 3) random directions of the half-sphere around an axis."""
    drawn = np.random.default_rng(11).normal(size=(count, 3))
    return drawn * np.sign(drawn @ np.array(axis))[:, None]


@pytest.mark.parametrize(
    ("target", "prior"),
    [
        ({"fair": 6}, "half:0,0,-1"),
        ({"probabilities": [0.5, 0.3, 0.2]}, "vmf:1,0,0:2"),
    ],
)
def test_the_target_is_met_under_the_prior(target: dict[str, object], prior: str) -> None:
    given = parse_recipe({"name": "die", "target": target, "prior": prior, **BARE})
    work = design_recipe(given, last="check")
    wanted = work.target.probabilities
    assert work.status is dd.Status.CONVERGED, work.remarks
    assert work.solid.outcomes.max_abs_error(wanted) <= 1e-12
    assert work.plain.max_abs_error < 1e-6
    # Under a uniform prior it is off.
    even = outcome_probabilities(work.plain.poses.under(None), work.die.directions)
    assert even.max_abs_error(wanted) > 0.01


def test_the_labeled_file_has_the_probabilities_of_random_directions(
    tmp_path: Path,
) -> None:
    axis = (0.0, 0.6, -0.8)
    recipe = {**BARE, "engrave": True, "edges": True, "print": {"printer": "fdm", "infill": 0.4}}
    text = "half:" + ",".join(map(str, axis))
    given = parse_recipe({"name": "die", "target": {"fair": 5}, "prior": text, **recipe})
    work = design_recipe(given, last="engrave")
    assert work.status is dd.Status.CONVERGED, work.remarks
    assert work.engraved is not None
    path = tmp_path / "die.stl"
    path.write_bytes(work.files["die.stl"])
    poses = dd.rest_poses(dd.read_body(path))
    outcomes = outcome_probabilities(poses.under(text), work.die.directions)
    assert outcomes.max_abs_error(work.target.probabilities) < 1e-6
    rolled = poses.under(dd.SampledDirections(lower_half(axis, 20_000)))
    counted = outcome_probabilities(rolled, work.die.directions)
    # Four standard deviations.
    assert counted.max_abs_error(work.target.probabilities) < 4.0 * np.sqrt(0.16 / 20_000)
    run_stages(work, after="engrave", last="tolerances")
    result = work.result()
    assert result.prior == text
    assert text in throwing_advice(result.thrown, result.prior)
    assert result.infill.max_abs_error < 0.05
    assert np.abs(np.array(result.tolerances.deviations)).max() < 0.1


def test_a_uniform_prior_is_no_prior() -> None:
    given = parse_recipe({"name": "die", "target": {"fair": 4}, "prior": "uniform"})
    assert (given.prior, given.as_dict()["prior"]) == (None, "uniform")


# A given center of mass.


def recipe(inside: Any, **entries: Any) -> dict[str, Any]:
    return {
        "name": "weighted",
        "target": {"fair": 5},
        "start": {"prism": {"sides": 5}},
        "center_of_mass": [0.05, 0.02, 0.0],
        "size_mm": 40,
        "inside": inside,
        "print": False,
        "figures": False,
        "report": False,
        **entries,
    }


def probabilities(mesh: trimesh.Trimesh, center: np.ndarray, count: int) -> np.ndarray:
    """The largest probabilities of a mesh with a center of mass."""
    poses = rest_poses(np.asarray(mesh.vertices).astype(np.float32), center)
    return np.sort(poses.probabilities)[::-1][:count]


def test_a_cavity_below_labels(tmp_path: Path) -> None:
    result = run(parse_recipe(recipe({"by": "cavity", "wall_mm": 1.5})), tmp_path)
    assert result.converged
    mesh = trimesh.load(tmp_path / "die.stl")
    assert mesh.is_watertight
    # The given center of mass is at the origin, and so is that of the file.
    np.testing.assert_allclose(mesh.center_mass, 0.0, atol=1e-5)
    np.testing.assert_allclose(probabilities(mesh, mesh.center_mass, 5), 0.2, atol=1e-6)
    assert result.inside.wall_mm >= 1.5 * (1.0 - 1e-4)
    assert result.engraved.max_abs_error <= 1e-6
    assert read_result(tmp_path).inside == result.inside


def test_a_cavity_of_a_die_under_a_prior(tmp_path: Path) -> None:
    prior = "vmf:0,0,-1:1"
    result = run(parse_recipe(recipe("cavity", engrave=False, prior=prior)), tmp_path)
    mesh = trimesh.load(tmp_path / "die.stl")
    corners = np.asarray(mesh.vertices).astype(np.float32)
    computed = rest_poses(corners, mesh.center_mass).under(prior).probabilities
    np.testing.assert_allclose(computed[:5], 0.2, atol=1e-6)
    assert result.converged
    assert result.engraved.max_abs_error == pytest.approx(
        np.abs(computed[:5] - 0.2).max(), abs=1e-7
    )


def test_infill_has_a_file_of_its_own(tmp_path: Path) -> None:
    result = run(parse_recipe(recipe("infill", engrave=False)), tmp_path)
    assert result.converged
    assert "die_sparse.stl" in result.files.values()
    assert result.inside.off_mm <= 1e-4 < result.inside.shift_mm


def test_a_wall_without_room_is_refused() -> None:
    with pytest.raises(InputError, match=r"inside: .*wall_mm"):
        run(parse_recipe(recipe({"wall_mm": 19.0}, engrave=False)))
