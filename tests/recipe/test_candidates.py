"""Dice with different numbers of faces for one target: `faces`, `purpose`, `candidates`, `pick`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dicedesign as dd
from dicedesign.errors import InputError
from dicedesign.recipe.pipeline import run
from dicedesign.recipe.reading import parse_recipe, parse_target
from dicedesign.results.result import Result
from dicedesign.throws.momentum_probabilities import throw_probabilities

BARE = dict.fromkeys(("engrave", "print", "figures", "report", "clock"), False)


def probabilities_of(result: Result, thrown: bool) -> np.ndarray:
    """(k,) probabilities of the outcomes of the file of a die, by the forward models."""
    body = dd.read_body(result.plain_file)
    poses = dd.rest_poses(body)
    faces = [facet for facet in result.facets if facet.label is not None]
    nearest = np.argmax(poses.normals @ np.array([face.normal for face in faces]).T, axis=1)
    outcome = [result.labels.index(str(faces[face].label)) for face in nearest]
    values = throw_probabilities(body, poses) if thrown else poses.probabilities
    return np.bincount(outcome, values, len(result.labels))


@pytest.mark.parametrize(
    ("text", "faces"), [("d7", 14), ("70%,20%,10%", 10), ("1/12,1/6,1/2,1/4", 12)]
)
def test_dice_of_equal_faces_come_first(text: str, faces: int) -> None:
    """Each outcome has its part of the faces, which all are equally probable."""
    die = dd.design(parse_target(text))
    poses = dd.rest_poses(die.vertices)
    np.testing.assert_allclose(poses.probabilities, np.full(faces, 1.0 / faces), atol=1e-12)
    shown = [facet.label for facet in die.result.facets]
    counts = [shown.count(label) for label in die.labels]
    np.testing.assert_allclose(np.array(counts) / faces, die.target, atol=1e-12)
    assert not die.result.is_warned


@pytest.fixture(scope="module")
def second(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """The second of two dice of 20 faces, for setting down."""
    target = {"probabilities": [0.5, 0.3, 0.2]}
    choice = {"faces": 20, "purpose": "setting-down", "candidates": 2, "pick": 2}
    recipe = {"name": "second", "target": target, **choice, **BARE}
    return run(recipe, tmp_path_factory.mktemp("candidates") / "second")


def test_another_die_is_picked(second: Result) -> None:
    assert second.converged
    names = [one.name for one in second.candidates]
    assert (len(set(names)), [one.faces for one in second.candidates]) == (2, [20, 20])
    np.testing.assert_allclose(probabilities_of(second, False), second.target, atol=1e-7)
    areas = [facet.polygon_area_mm2 for facet in second.facets]
    assert len(areas) == 20
    assert min(areas) < 0.99 * max(areas)


def test_a_written_recipe_makes_the_same_files(second: Result, tmp_path: Path) -> None:
    assert second.folder is not None
    run(second.folder / "recipe.yaml", tmp_path)
    files = {path.name: path.read_bytes() for path in second.folder.iterdir()}
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == files


@pytest.mark.parametrize(
    ("entries", "is_warned"),
    [
        # Without a measured bias, which the judge does not know.
        ({"faces": 20}, False),
        ({"start": {"prism": {}}}, True),
    ],
    ids=str,
)
def test_a_die_that_is_off_when_thrown_has_a_warning(
    entries: dict[str, Any], is_warned: bool, tmp_path: Path
) -> None:
    target = {"probabilities": [0.47, 0.31, 0.22]}
    result = run({"name": "die", "target": target, **entries, **BARE}, tmp_path)
    assert result.converged
    set_down, thrown = (probabilities_of(result, each) for each in (False, True))
    np.testing.assert_allclose(set_down, result.target, atol=1e-7)
    assert result.forecast is not None
    np.testing.assert_allclose(result.forecast.probabilities, thrown, atol=1e-6)
    error = np.abs(thrown / result.target - 1.0).max()
    assert error > 0.05 if is_warned else error < 0.01
    assert result.is_warned == result.message.startswith("Warning") == is_warned


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"faces": 7}, "faces: .*even number.*got 7"),
        ({"faces": 2}, "faces: .*from 4 to .*got 2"),
        ({"faces": 202}, "faces: .*to 200, got 202"),
        ({"faces": "many"}, "faces: .*one, auto"),
        ({"faces": 4}, "faces: .*at least 6.*got 4"),
        ({"faces": "auto", "start": {"prism": {}}}, "start: .*faces: auto"),
        ({"faces": "auto", "symmetry": "Cs"}, "symmetry: .*faces: auto"),
        ({"faces": "one", "candidates": 3}, "candidates: .*faces: one"),
        ({"pick": 13}, "pick: "),
        ({"purpose": "juggling"}, "purpose: .*throwing"),
    ],
)
def test_wishes_that_contradict_each_other(entries: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_recipe({"name": "die", "target": {"fair": 6}, **entries})


@pytest.mark.parametrize(("outcomes", "faces"), [(4, 4), (6, 6), (2, 200)])
def test_the_least_and_the_most_faces_are_allowed(outcomes: int, faces: int) -> None:
    recipe = parse_recipe({"name": "die", "target": {"fair": outcomes}, "faces": faces})
    assert recipe.faces == faces


@pytest.mark.parametrize(
    ("faces", "pick", "message"), [(6, 9, r"pick: expected 1 to \d, .*got 9"), (4, 1, "faces: .*4")]
)
def test_dice_that_are_not_found(faces: int, pick: int, message: str) -> None:
    with pytest.raises(InputError, match=message):
        dd.design({"fair": 2}, faces=faces, purpose="setting-down", pick=pick)
