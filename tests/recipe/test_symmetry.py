"""`symmetry` in a recipe: given, of the start, or automatic."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.coordinates import orbits_of_directions
from dicedesign.optimize.looks import rate_looks
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.pipeline import Callbacks, Work, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.results.parts import Status

PAIRED = {
    "target": {"sum_of_dice": [6, 6]},
    "start": {"hendecahedron": "bisymmetric"},
    "assignment": [str(label) for label in (2, 3, 4, 5, 6, 7, 8, 10, 9, 11, 12)],
}
"""Totals of two dice on the hendecahedron's facets, such that half-turns map equally probable ones
to each other."""


def recipe(**entries: object) -> Recipe:
    return parse_recipe({"name": "die", "start": {"search": {}}, "engrave": False, **entries})


def test_a_symmetric_die_is_symmetric_to_rounding() -> None:
    work = design_recipe(recipe(**PAIRED, symmetry="C2"), last="check")
    assert work.status is Status.CONVERGED
    probabilities = work.solid.outcomes.probabilities
    assert np.abs(probabilities - work.target.probabilities).max() <= 1e-12
    # The symmetry maps 2 to 12, 3 to 11 and so on.
    assert np.abs(probabilities - probabilities[::-1]).max() <= 1e-15
    hull = work.die.hull
    for element in point_group("C2"):
        apart = hull.vertices @ element.T @ hull.vertices.T
        images = hull.vertices[np.argmax(apart - (hull.vertices**2).sum(1) / 2.0, axis=1)]
        assert np.abs(hull.vertices @ element.T - images).max() <= 1e-13


def test_preferences_improve_a_die_that_symmetry_makes_fair() -> None:
    work = design_recipe(recipe(target={"fair": 4}, symmetry="D2"), last="check")
    assert work.status is Status.CONVERGED
    values = [s.terms["preferences"] for s in work.die.steps if "preferences" in s.terms]
    assert len(values) > 2
    assert (np.diff(values) <= 1e-15).all()


@pytest.mark.parametrize(("symmetry", "message"), [("Cs", "directions"), ("C2", "4 and 9.*C2")])
def test_starts_without_the_symmetry_are_refused(symmetry: str, message: str) -> None:
    given = recipe(**{**PAIRED, "assignment": "in_order"}, symmetry=symmetry)
    with pytest.raises(InputError, match=message):
        design_recipe(given, last="start")


THROWN = {"exact": {"probabilities": "thrown"}}


def design_symmetric(**entries: Any) -> Work:
    work = Work(parse_recipe({"name": "d", "symmetry": "auto", "engrave": False, **entries}))
    run_stages(work, last="design")
    assert work.status is Status.CONVERGED
    return work


def orbits_of(work: Work) -> list[int]:
    """Orbit of the direction of each outcome."""
    return list(orbits_of_directions(work.die.directions, work.recipe.group()))


def test_a_fair_die_for_a_table_is_fair_by_symmetry_alone() -> None:
    work = design_symmetric(target={"fair": 10}, method=THROWN)
    assert work.recipe.symmetry == work.recipe.as_dict()["symmetry"] == "D5d"
    assert any("D5d" in note for note in work.notes)
    assert set(orbits_of(work)) == {0}


def test_equally_probable_outcomes_of_a_die_for_a_table_are_images() -> None:
    orbits = orbits_of(design_symmetric(target={"binomial": 4}, method=THROWN))
    assert (orbits[0], orbits[1]) == (orbits[4], orbits[3])
    assert len(set(orbits)) == 3
    work = design_symmetric(target={"probabilities": [0.5, 0.3, 0.2]}, method=THROWN)
    assert work.recipe.symmetry is work.recipe.group() is None


def test_auto_takes_a_symmetry_of_a_given_start() -> None:
    work = design_symmetric(target={"fair": 5}, start={"prism": {}})
    assert work.recipe.symmetry == "D5h"
    # Equally probable outcomes on opposite facets, or on adjacent ones.
    order = {"target": {"binomial": 3}, "start": {"prism": {}}}
    work = design_symmetric(**order, assignment=[0, 1, 3, 2])
    orbits = orbits_of(work)
    assert orbits[0] == orbits[3] != orbits[1] == orbits[2]
    assert design_symmetric(**order, assignment=[0, 1, 2, 3]).recipe.symmetry is None


@pytest.mark.parametrize(
    ("sides", "group"),
    [
        (4, "Td"),
        pytest.param(6, "Oh", marks=pytest.mark.full),
        pytest.param(20, "Ih", marks=pytest.mark.full),
    ],
)
def test_the_most_handsome_fair_die_is_the_platonic_solid(sides: int, group: str) -> None:
    """The search counts the dice it tried; the recipe that is written makes the same die again."""
    parts: list[tuple[int, int, str]] = []
    target = {"fair": sides}
    given = parse_recipe({"name": "d", "target": target, "faces": "one", "engrave": False})
    callbacks = Callbacks(on_part=lambda *part: parts.append(part))
    work = design_recipe(given, callbacks, last="design")
    assert work.die.symmetry == group
    assert len(work.die.hull.normals) == sides
    done, wholes, units = zip(*parts, strict=True)
    assert (set(units), len(set(wholes))) == ({"dice"}, 1)
    assert 0 == done[0] < done[-1] < wholes[0]
    assert list(done) == sorted(done)
    again = design_symmetric(**work.recipe.as_dict())
    np.testing.assert_array_equal(again.die.hull.vertices, work.die.hull.vertices)


def test_the_chosen_die_is_at_least_as_handsome_as_the_first() -> None:
    target = {"probabilities": [0.4, 0.3, 0.2, 0.1]}
    dice = [design_symmetric(target=target, symmetry=symmetry).die for symmetry in ("none", "auto")]
    first, chosen = (rate_looks(die.hull, die.directions) for die in dice)
    assert chosen.measure >= first.measure
    assert all(0.0 <= quality <= 1.0 for quality in vars(chosen).values())
