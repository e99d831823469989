"""Priors in recipes: files have the target probabilities under them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dicedesign as dd
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.report.pages import throwing_advice
from dicedesign.rest.outcomes import outcome_probabilities

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
    for prior in ("uniform", None):
        given = parse_recipe({"name": "die", "target": {"fair": 4}, "prior": prior})
        assert given.prior is None
        assert given.as_dict()["prior"] == "uniform"
    even = dd.design({"fair": 4}, start="repulsion", prior="vmf:0,0,1:0")
    assert np.abs(dd.rest_poses(even.vertices).probabilities - 0.25).max() < 1e-12
