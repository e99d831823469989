"""Numbering of equally probable outcomes of given and designed dice."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from common.made_up_die import SIDES, box, run_to_design

from dicedesign.optimize.coordinates import orbits_of_directions
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.results.parts import RoundOfThrows, Status


def number_box(
    style: str, sides: tuple[float, float, float] = (1.0, 1.0, 1.0), **more: Any
) -> Work:
    """Run up to the stage "check" of a box with labels in the order of `SIDES`."""
    work = run_to_design(box(*sides), entries={"numbering": style, **more})
    run_stages(work, after="design", last="check")
    return work


def across(work: Work) -> list[float]:
    """Sums of the numbers on opposite facets."""
    directions = work.die.directions
    numbers = np.array([float(label) for label in work.target.labels])
    opposite = (directions @ directions.T).argmin(axis=1)
    return sorted(set((numbers + numbers[opposite]).tolist()))


def test_a_cube_gets_sums_of_seven() -> None:
    assert across(number_box("given")) == [5.0, 7.0, 9.0]
    work = number_box("standard", engrave=True)
    assert across(work) == [7.0]
    assert work.status is Status.CONVERGED
    assert any("sum to 7" in note for note in work.notes)
    # Labels follow their outcomes.
    run_stages(work, after="check", last="engrave")
    for direction, placement, text in zip(
        work.die.directions, work.engraved.placements, work.target.labels, strict=True
    ):
        assert placement.text == text
        np.testing.assert_allclose(placement.frame[:3, 2], -direction, atol=0.01)


@pytest.mark.parametrize("style", ["standard", "balanced"])
def test_probabilities_stay_with_their_labels(style: str) -> None:
    """Only opposite sides are interchangeable, and in a square box four sides."""
    for sides in ((4.0, 5.0, 6.0), (4.0, 4.0, 6.0)):
        work = number_box(style, sides)
        assert work.status is Status.CONVERGED
        before, after = SIDES, work.die.directions
        poses = work.plain.poses
        np.testing.assert_allclose(
            outcome_probabilities(poses, after).probabilities,
            outcome_probabilities(poses, before).probabilities,
            atol=1e-6,
        )
        assert sorted(map(tuple, after.tolist())) == sorted(map(tuple, before.tolist()))


def test_rounds_of_throws_are_reordered_too() -> None:
    requested = np.arange(6.0)
    thrown = RoundOfThrows(10, 0.0, 0.0, 0.0, True, tuple(requested), tuple(2.0 * requested))
    work = run_to_design(box(1.0, 1.0, 1.0), entries={"numbering": "standard"}, rounds=(thrown,))
    run_stages(work, after="design", last="numbering")
    (after,) = work.die.rounds
    of_side = (work.die.directions @ SIDES.T).argmax(axis=1)
    assert list(of_side) != list(range(6))
    np.testing.assert_array_equal(after.requested, requested[of_side])
    np.testing.assert_array_equal(after.frequencies, 2.0 * requested[of_side])


def test_a_symmetric_die_stays_symmetric() -> None:
    """Facets that the group maps to each other have equally probable labels."""
    probabilities = [1 / 8, 1 / 4, 1 / 8, 1 / 4, 1 / 8, 1 / 8]
    entries = {"symmetry": "D2h", "numbering": "standard", "engrave": False}
    recipe = parse_recipe({"name": "d6", "target": {"probabilities": probabilities}, **entries})
    work = design_recipe(recipe, last="check")
    assert work.status is Status.CONVERGED
    orbits = orbits_of_directions(work.die.directions, recipe.group())
    for orbit in np.unique(orbits):
        assert np.ptp(work.target.probabilities[orbits == orbit]) == 0.0


def test_a_die_with_a_missing_facet_is_not_renumbered() -> None:
    directions = SIDES.copy()
    directions[5] = [0.8, 0.6, 0.0]
    work = run_to_design(
        box(4.0, 5.0, 6.0), directions, Status.NO_PROGRESS, {"fair": 6}, {"numbering": "standard"}
    )
    run_stages(work, after="design", last="check")
    np.testing.assert_array_equal(work.die.directions, directions)
    assert any("no facet" in note for note in work.notes)
