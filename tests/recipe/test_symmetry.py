"""`symmetry:` in a recipe: the die has it to rounding, and so do its odds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dicedesign.errors import InputError, RecipeError
from dicedesign.geometry.point_groups import point_group
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.reading import checked_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.results.parts import Status

PAIRED = [2, 3, 4, 5, 6, 7, 8, 10, 9, 11, 12]
"""Totals of two dice in the order of the hendecahedron's facets, with half-turns of each other
equally probable."""


def recipe(**entries: object) -> Recipe:
    return checked_recipe({"name": "die", "start": {"search": {}}, **entries})


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
    odds = work.solid.outcomes.odds
    assert np.abs(odds - work.target.probabilities).max() <= 1e-12
    # Mirror images or half-turns of each other: 2 and 12, 3 and 11, ...
    assert np.abs(odds - odds[::-1]).max() <= 1e-15
    assert np.sum(np.abs(np.diff(np.sort(odds))) <= 1e-15) >= pairs
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
def test_a_die_whose_odds_symmetry_fixes_is_improved_too(
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


def test_images_with_unequal_odds_are_refused() -> None:
    given = recipe(
        target={"sum_of_dice": [6, 6]}, start={"hendecahedron": "bisymmetric"}, symmetry="C2"
    )
    with pytest.raises(InputError, match="expected labels 4 and 9 to be equally probable, as C2"):
        design_recipe(given, last="start")


def test_none_is_no_symmetry_and_is_written_so(tmp_path: Path) -> None:
    given = recipe(target={"fair": 4}, symmetry="none")
    assert given.symmetry is None
    assert given.resolved()["symmetry"] == "none"
    assert recipe(target={"fair": 4}, symmetry="Td").resolved()["symmetry"] == "Td"
