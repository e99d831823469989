"""`symmetry` in a recipe: given, of the start, or automatic."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dicedesign.errors import InputError, RecipeError
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.coordinates import orbits_of_directions
from dicedesign.optimize.looks import rate_looks
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.results.parts import Status

PAIRED = [2, 3, 4, 5, 6, 7, 8, 10, 9, 11, 12]
"""Totals of two dice on the hendecahedron's facets, such that half-turns map equally probable ones
to each other."""


def recipe(**entries: object) -> Recipe:
    return parse_recipe({"name": "die", "start": {"search": {}}, **entries})


@pytest.mark.parametrize(
    ("entries", "group", "pairs"),
    [
        ({"target": {"sum_of_dice": [6, 6]}}, "C2v", 5),
        (
            {
                "target": {"sum_of_dice": [6, 6]},
                "start": {"hendecahedron": "bisymmetric"},
                "assignment": [str(label) for label in PAIRED],
            },
            "C2",
            5,
        ),
    ],
)
def test_a_symmetric_die_is_symmetric_to_rounding(
    entries: dict[str, object], group: str, pairs: int
) -> None:
    given = recipe(**entries, symmetry=group)
    work = design_recipe(given, last="check")
    assert work.status is Status.CONVERGED
    probabilities = work.solid.outcomes.probabilities
    assert np.abs(probabilities - work.target.probabilities).max() <= 1e-12
    # The symmetry maps 2 to 12, 3 to 11 and so on.
    assert np.abs(probabilities - probabilities[::-1]).max() <= 1e-15
    assert np.sum(np.abs(np.diff(np.sort(probabilities))) <= 1e-15) >= pairs
    hull = work.die.hull
    for element in point_group(group):
        apart = hull.vertices @ element.T @ hull.vertices.T
        images = hull.vertices[np.argmax(apart - (hull.vertices**2).sum(1) / 2.0, axis=1)]
        assert np.abs(hull.vertices @ element.T - images).max() <= 1e-13


@pytest.mark.parametrize(
    ("entries", "group"),
    [
        ({"target": {"fair": 4}}, "D2"),
        ({"target": {"fair": 6}, "start": {"prism": {"height": 1.0}}}, "D6h"),
    ],
)
def test_preferences_improve_a_die_that_symmetry_makes_fair(
    entries: dict[str, object], group: str
) -> None:
    given = recipe(**entries, symmetry=group)
    work = design_recipe(given, last="check")
    assert work.status is Status.CONVERGED
    values = [s.terms["preferences"] for s in work.die.steps if "preferences" in s.terms]
    assert (np.diff(values) <= 1e-15).all()
    assert len(values) > 2


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"symmetry": "C5v"}, "symmetry: expected outcomes of equal probability to fill whole"),
        (
            {"symmetry": "Cs", "method": {"exact": {"coordinates": "vertices"}}},
            "symmetry: expected the exact method with coordinates: facets",
        ),
        (
            {
                "symmetry": "Cs",
                "center_of_mass": [0, 0, 0],
                "start": {"hendecahedron": "bisymmetric"},
            },
            "center_of_mass: expected uniform with a symmetry",
        ),
    ],
)
def test_bad_entries_are_explained(entries: dict[str, object], message: str) -> None:
    with pytest.raises(RecipeError, match=message):
        recipe(target={"sum_of_dice": [6, 6]}, **entries)


def test_a_start_without_the_symmetry_is_refused() -> None:
    given = recipe(
        target={"sum_of_dice": [6, 6]}, start={"hendecahedron": "bisymmetric"}, symmetry="Cs"
    )
    with pytest.raises(InputError, match="expected directions that the point group maps onto"):
        design_recipe(given, last="start")


def test_images_with_unequal_probabilities_are_refused() -> None:
    given = recipe(
        target={"sum_of_dice": [6, 6]}, start={"hendecahedron": "bisymmetric"}, symmetry="C2"
    )
    with pytest.raises(InputError, match="expected labels 4 and 9 to be equally probable, as C2"):
        design_recipe(given, last="start")


def test_none_is_no_symmetry_and_is_written_as_none() -> None:
    given = recipe(target={"fair": 4}, symmetry="none")
    assert given.symmetry is None
    assert given.as_dict()["symmetry"] == "none"
    assert recipe(target={"fair": 4}, symmetry="Td").as_dict()["symmetry"] == "Td"


def design_symmetric(**entries: Any) -> Work:
    work = Work(parse_recipe({"name": "d", "symmetry": "auto", "engrave": False, **entries}))
    run_stages(work, last="design")
    return work


def test_a_fair_die_is_fair_by_symmetry_alone() -> None:
    thrown = {"exact": {"probabilities": "thrown"}}
    work, name = design_symmetric(target={"fair": 10}, method=thrown), "D5d"
    assert work.status is Status.CONVERGED
    assert work.recipe.symmetry == name
    assert work.recipe.as_dict()["symmetry"] == name
    assert any(name in note for note in work.notes)
    group = work.recipe.group()
    assert set(orbits_of_directions(work.die.directions, group)) == {0}


def test_auto_takes_a_symmetry_of_a_given_start() -> None:
    work = design_symmetric(target={"fair": 5}, start={"prism": {}})
    assert work.recipe.symmetry == "D5h"
    # Equally probable outcomes on opposite facets, or on adjacent ones.
    order = {"target": {"binomial": 3}, "start": {"prism": {}}}
    work = design_symmetric(**order, assignment=[0, 1, 3, 2])
    group = work.recipe.group()
    orbits = orbits_of_directions(work.die.directions, group)
    assert orbits[0] == orbits[3] != orbits[1]
    assert orbits[1] == orbits[2]
    assert design_symmetric(**order, assignment=[0, 1, 2, 3]).recipe.symmetry is None


def test_auto_is_none_without_equal_probabilities() -> None:
    thrown = {"exact": {"probabilities": "thrown"}}
    work = design_symmetric(target={"probabilities": [0.5, 0.3, 0.2]}, method=thrown)
    assert work.recipe.symmetry is None
    assert work.recipe.group() is None
    assert work.status is Status.CONVERGED


def test_equally_probable_outcomes_of_a_thrown_die_are_images() -> None:
    work = design_symmetric(target={"binomial": 4}, method={"exact": {"probabilities": "thrown"}})
    assert work.status is Status.CONVERGED
    group = work.recipe.group()
    orbits = orbits_of_directions(work.die.directions, group)
    assert orbits[0] == orbits[4]
    assert orbits[1] == orbits[3]
    assert len(np.unique(orbits)) == 3


@pytest.mark.parametrize(("sides", "group"), [(4, "Td"), (6, "Oh"), (20, "Ih")])
def test_the_most_handsome_fair_die_is_the_platonic_solid(sides: int, group: str) -> None:
    work = design_symmetric(target={"fair": sides})
    assert work.die.symmetry == group
    assert len(work.die.hull.normals) == sides
    # The recipe that is written makes the same die again.
    assert work.recipe.symmetry == "auto"
    again = design_symmetric(**work.recipe.as_dict())
    np.testing.assert_array_equal(again.die.hull.vertices, work.die.hull.vertices)


def test_the_chosen_die_is_at_least_as_handsome_as_the_first() -> None:
    for target in ({"binomial": 3}, {"probabilities": [0.4, 0.3, 0.2, 0.1]}):
        chosen = design_symmetric(target=target)
        first = design_symmetric(target=target, symmetry="none")
        assert chosen.status is first.status is Status.CONVERGED
        looks = [rate_looks(each.die.hull, each.die.directions) for each in (first, chosen)]
        assert looks[1].measure >= looks[0].measure
        assert all(0.0 <= quality <= 1.0 for quality in vars(looks[1]).values())


def test_thrown_dice_are_symmetric_by_default() -> None:
    thrown = {"method": {"exact": {"probabilities": "thrown"}}}
    for entries, expected in (
        (thrown, "auto"),
        ({**thrown, "symmetry": "none"}, None),
        ({**thrown, "symmetry": "Cs"}, "Cs"),
        ({**thrown, "start": {"prism": {}}}, None),
        ({}, "auto"),
        ({"start": {"prism": {}}}, None),
        ({"method": {"exact": {"coordinates": "vertices"}}}, None),
        ({"prior": "vmf:0,0,-1:5"}, None),
    ):
        recipe = parse_recipe({"name": "d", "target": {"fair": 5}, **entries})
        assert recipe.symmetry == expected
        again = parse_recipe(recipe.as_dict())
        assert again.symmetry == expected
