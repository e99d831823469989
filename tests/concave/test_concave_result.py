"""Options, ranking and checkpoints of concave dice."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dicedesign.concave.options import ConcaveOptions, ConcavePaperOptions, HollowOptions
from dicedesign.concave.result import ConcaveProgress, FilledHull, angle_penalty, missing, rank
from dicedesign.concave.search import checkpoint_bytes, read_checkpoint
from dicedesign.errors import InputError, RecipeError
from dicedesign.recipe.reading import parse_recipe
from dicedesign.results.parts import Draft
from dicedesign.results.result import Step

BAD: list[tuple[type, dict[str, Any], str]] = [
    (ConcaveOptions, {"tolerance": 1.0}, "tolerance: expected a number below 1, got 1"),
    (ConcaveOptions, {"hull": "exact"}, "hull: expected 'gauss_newton' or 'paper', got 'exact'"),
    (
        ConcaveOptions,
        {"paper": ConcavePaperOptions()},
        "paper: expected hull: paper or fill: paper with it, got gauss_newton and corr",
    ),
    (
        ConcaveOptions,
        {"hollow": HollowOptions(), "fill": "paper"},
        "hollow: expected hull: gauss_newton and fill: correspondence with it, got gauss_n",
    ),
    (ConcaveOptions, {"points": 49}, "points: expected a number of at least 50, got 49"),
    (ConcaveOptions, {"margin_deg": 90.0}, "margin_deg: expected a number below 90"),
    (HollowOptions, {"wall_mm": math.nan}, "wall_mm: expected a finite number, got"),
    (ConcavePaperOptions, {"growth": 1.0}, "growth: expected a number above 1"),
]


@pytest.mark.parametrize(("kind", "options", "text"), BAD)
def test_values_out_of_range(kind: type, options: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        kind(**options)


def test_a_recipe_sets_the_paper_s_options() -> None:
    method = {
        "concave": {
            "hull": "paper",
            "fill": "paper",
            "paper": {"weights": {"barycenter": 0.3}, "bending": 0.5, "power": 3},
        }
    }
    entries = {"name": "die", "target": {"fair": 3}, "start": {"shape": "duck"}, "method": method}
    options = parse_recipe(entries).method.concave
    assert options.paper.weights.barycenter == 0.3
    assert options.paper.weights.apart == ConcavePaperOptions().weights.apart
    assert (options.paper.bending, options.paper.power) == (0.5, 3)
    method["concave"]["paper"] = {"weights": {"coplaner": 1.0}}
    with pytest.raises(RecipeError, match="coplaner"):
        parse_recipe(entries)


OPTIONS = ConcaveOptions(tolerance=0.01, apart_deg=40.0, margin_deg=10.0)
DIE = Draft(
    1, None, error=0.01, displacement=0.03, apart_deg=40.0, margin_deg=10.0, self_intersections=0
)
"""Die that just meets all limits."""


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("error", (0.01, 0.010001, 0.012, 0.5)),
        ("apart_deg", (40.0, 39.999, 20.0, 0.0)),
        ("margin_deg", (10.0, 9.999, 3.0, 0.0)),
        ("self_intersections", (0, 1, 7, 1000)),
    ],
)
def test_larger_violations_rank_lower(name: str, values: tuple[float, ...]) -> None:
    dice = [replace(DIE, **{name: value}) for value in values]
    violations = [missing(die, OPTIONS) for die in dice]
    assert violations[0] == 0.0
    assert (np.diff(violations) > 0.0).all()
    # Any converged die is better than a die with a violation, however small its displacement.
    far = replace(DIE, displacement=0.2)
    for die in dice[1:]:
        assert rank(far, OPTIONS) < rank(replace(die, displacement=0.001), OPTIONS)


SEARCH = {"target": "[0.5, 0.5]", "surface": "abc"}


def make_progress() -> ConcaveProgress:
    random = np.random.default_rng(5)
    draft = Draft(3, 0.1, 1e-300, 0.1 + 0.2, 100.0 / 3.0, 1.0 / 7.0, 7)
    arrays = (random.normal(size=shape) for shape in ((50, 3), (20, 3), 3, (2, 3)))
    steps = (
        Step(0, 0.1, 1.0 / 3.0, 0.25, stage="hull", attempt=3),
        Step(1, 0.2, 0.0, None, stage="fill", attempt=3),
    )
    return ConcaveProgress(5, 12.7, FilledHull(draft, *arrays, np.arange(2)), (draft,), steps)


def test_a_checkpoint_is_read_back_to_the_last_bit(tmp_path: Path) -> None:
    path, whole = tmp_path / "checkpoint.npz", make_progress()
    for given in (whole, replace(whole, best=None, tried=())):
        path.write_bytes(checkpoint_bytes(given, SEARCH))
        read = read_checkpoint(path, SEARCH)
        assert replace(read, best=None) == replace(given, best=None)
        assert (read.best is None) == (given.best is None)
        for name, value in vars(given.best).items() if given.best else ():
            np.testing.assert_array_equal(getattr(read.best, name), value)


def test_missing_damaged_and_foreign_checkpoints_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.npz"
    with pytest.raises(InputError, match="got none; run without --resume to start"):
        read_checkpoint(path, SEARCH)
    whole = checkpoint_bytes(make_progress(), SEARCH)
    path.write_bytes(whole)
    for kind in SEARCH:
        text = f"expected a checkpoint of this {kind}, got one of another"
        with pytest.raises(InputError, match=text):
            read_checkpoint(path, {**SEARCH, kind: "other"})
    others = []
    for content in ({"points": np.zeros(3)}, {"about": np.array([{}], dtype=object)}):
        np.savez(path, **content)
        others.append(path.read_bytes())
    for damaged in (b"", b"PK", whole[:700], whole[:-40], *others):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match="got a file that cannot be read as one"):
            read_checkpoint(path, SEARCH)


def test_angles_cost_one_at_their_minimum_and_nothing_far_above() -> None:
    options = ConcaveOptions(apart_deg=40.0, margin_deg=8.0)
    assert angle_penalty(179.0, 89.0, options) == 0.0
    assert angle_penalty(40.0, 89.0, options) == pytest.approx(1.0)
    assert angle_penalty(179.0, 8.0, options) == pytest.approx(1.0)
    assert angle_penalty(20.0, 4.0, options) == 2.0
    costs = [angle_penalty(40.0 * share, 89.0, options) for share in (1.0, 1.01, 1.02, 1.03)]
    np.testing.assert_allclose(np.diff(costs), costs[1] - 1.0, rtol=1e-9)
    assert costs[1] < 1.0
    assert angle_penalty(10.0, 89.0, ConcaveOptions(apart_deg=0.0, margin_deg=8.0)) == 0.0
