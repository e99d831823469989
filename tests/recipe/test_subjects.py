"""Subjects of figures: meshes, recipes and results folders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.recipe.pipeline import run
from dicedesign.recipe.subjects import subject_of

PAPER = {
    "name": "few",
    "target": {"binomial": 2},
    "start": {"prism": {}},
    "method": {"paper": {"steps": 40}},
    "figures": False,
    "report": False,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results folder of a run by the paper's method."""
    out = tmp_path_factory.mktemp("run") / "few"
    run(PAPER, out=out)
    return out


def test_a_recipe_and_its_folder_are_the_same_die(folder: Path) -> None:
    finished, designed = subject_of(folder), subject_of(folder / "recipe.yaml")
    assert finished.labels == designed.labels
    assert set(finished.labels or ()) >= {"0", "1", "2"}
    np.testing.assert_allclose(
        finished.poses.probabilities, designed.poses.probabilities, atol=1e-7
    )
    for subject in (finished, designed):
        before, after = convex_hull(subject.make_before().points), subject.poses.hull
        assert before.diameter == pytest.approx(after.diameter)
        np.testing.assert_allclose(before.centroid, after.centroid, atol=1e-9)
        # The prism is not the die.
        assert len(before.vertices) != len(after.vertices)


def test_a_die_under_a_prior_has_its_probabilities_and_labels_under_it(tmp_path: Path) -> None:
    prior = "half:0.2,0.3,-1"
    recipe = {**PAPER, "target": {"probabilities": [0.4, 0.3, 0.2, 0.1]}, "prior": prior}
    del recipe["start"], recipe["method"]
    out = tmp_path / "die"
    result = run({**recipe, "engrave": False, "print": False}, out=out)
    subject = subject_of(out)
    probabilities = dict(zip(subject.labels or (), subject.poses.probabilities, strict=True))
    for label, wanted in zip(result.labels, result.target, strict=True):
        assert probabilities[label] == pytest.approx(wanted, abs=1e-6)
    for facet in result.facets:
        if facet.label is not None:
            apart = np.linalg.norm(subject.poses.normals - facet.normal, axis=1)
            assert (subject.labels or ())[int(apart.argmin())] == facet.label


def test_a_recipe_that_searches_has_no_start(tmp_path: Path) -> None:
    recipe = tmp_path / "d4.yaml"
    recipe.write_text("name: d4\ntarget: {fair: 4}\nsymmetry: none\n")
    with pytest.raises(InputError, match="search"):
        subject_of(recipe).make_before()
