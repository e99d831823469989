"""Dice whose recipes leave their symmetry open."""

from __future__ import annotations

from typing import Any

import numpy as np

from dicedesign.optimize.coordinates.linked import orbits_of_directions
from dicedesign.recipe.pipeline import run_stages
from dicedesign.recipe.reading import checked_recipe
from dicedesign.recipe.work import Work
from dicedesign.results.parts import Status


def designed(**entries: Any) -> Work:
    work = Work(checked_recipe({"name": "d", "symmetry": "auto", "engrave": False, **entries}))
    run_stages(work, last="design")
    return work


def test_a_fair_die_is_fair_by_symmetry_alone() -> None:
    work, name = designed(target={"fair": 10}), "D5d"
    assert work.status is Status.CONVERGED
    assert work.recipe.symmetry == name
    assert work.recipe.resolved()["symmetry"] == name
    assert any(name in note for note in work.notes)
    group = work.recipe.group()
    assert group is not None
    assert set(orbits_of_directions(work.die.directions, group)) == {0}


def test_of_a_given_start_it_takes_what_that_has() -> None:
    work = designed(target={"fair": 5}, start={"prism": {}})
    assert work.recipe.symmetry == "D5h"
    # Those that are as probable are opposite to each other, or not.
    order = {"target": {"binomial": 3}, "start": {"prism": {}}}
    work = designed(**order, assignment=[0, 1, 3, 2])
    group = work.recipe.group()
    assert group is not None
    orbits = orbits_of_directions(work.die.directions, group)
    assert orbits[0] == orbits[3] != orbits[1]
    assert orbits[1] == orbits[2]
    assert designed(**order, assignment=[0, 1, 2, 3]).recipe.symmetry is None


def test_without_equal_odds_there_is_none() -> None:
    work = designed(target={"probabilities": [0.5, 0.3, 0.2]})
    assert work.recipe.symmetry is None
    assert work.recipe.group() is None
    assert work.status is Status.CONVERGED


def test_equally_probable_outcomes_of_a_thrown_die_are_images() -> None:
    work = designed(target={"binomial": 4}, method={"exact": {"odds": "thrown"}})
    assert work.status is Status.CONVERGED
    group = work.recipe.group()
    assert group is not None
    orbits = orbits_of_directions(work.die.directions, group)
    assert orbits[0] == orbits[4]
    assert orbits[1] == orbits[3]
    assert len(np.unique(orbits)) == 3


def test_thrown_dice_are_symmetric_unless_they_are_told_otherwise() -> None:
    thrown = {"method": {"exact": {"odds": "thrown"}}}
    for entries, expected in (
        (thrown, "auto"),
        ({**thrown, "symmetry": "none"}, None),
        ({**thrown, "symmetry": "Cs"}, "Cs"),
        ({**thrown, "start": {"prism": {}}}, None),
        ({}, None),
    ):
        recipe = checked_recipe({"name": "d", "target": {"fair": 5}, **entries})
        assert recipe.symmetry == expected
        again = checked_recipe(recipe.resolved())
        assert again.symmetry == expected
