"""Files of a die that was designed on the page are read back, and its recipe is run again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.recipe.pipeline import Work, run, run_stages
from dicedesign.recipe.reading import parse_recipe, parse_target
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Status
from dicedesign.view.new_die_panel import PRESETS, die_file, finish_die

COIN = {"probabilities": ["1/2", "1/3", "1/6"], "labels": ["heads", "tails", "edge"]}


def design(**entries: Any) -> Work:
    work = Work(parse_recipe({"target": COIN, "name": "coin", **entries}))
    run_stages(work, last="numbering")
    return work


@pytest.mark.parametrize(
    ("entries", "rests"),
    [
        ({}, [1 / 6] * 6),
        ({"faces": "one"}, [1 / 2, 1 / 3, 1 / 6]),
        ({"method": "paper", "start": {"prism": {}}}, [1 / 2, 1 / 3, 1 / 6]),
    ],
)
def test_files_have_the_probabilities_and_the_recipe_makes_them_again(
    tmp_path: Path, entries: dict[str, Any], rests: list[float]
) -> None:
    die = finish_die(design(**entries))
    assert die.status is Status.CONVERGED
    for ending in ("stl", "3mf", "obj"):
        name, data = die_file(die, ending)
        assert name == f"coin.{ending}"
        (tmp_path / name).write_bytes(data)
        poses = rest_poses(read_body(tmp_path / name))
        np.testing.assert_allclose(poses.probabilities, rests, atol=1e-6)
    name, data = die_file(die, "yaml")
    (tmp_path / name).write_bytes(data)
    run(tmp_path / name, tmp_path / "again", changes=["figures=false", "report=false"])
    again = (tmp_path / "again" / "die.stl").read_bytes()
    assert again == (tmp_path / "coin.stl").read_bytes()


def test_labels_determine_the_size() -> None:
    labels = ["1000000000", "2000000000", "3000000000"]
    work = design(target={**COIN, "labels": labels})
    labeled = finish_die(work)
    size = labeled.recipe.size_mm
    assert size > 30.0
    with pytest.raises(InputError, match=r"use size_mm = \d+"):
        finish_die(work, size_mm=0.5 * size)
    plain = finish_die(work, size_mm=20.0, engrave=False)
    assert pdist(plain.finished.points).max() == pytest.approx(20.0, rel=1e-6)
    assert len(plain.finished.triangles) < len(labeled.finished.triangles)


def test_every_preset_is_a_target() -> None:
    for probabilities, labels in PRESETS.values():
        recipe = parse_recipe(
            {"name": "die", "target": parse_target(probabilities, labels or None)}
        )
        assert sum(recipe.target.target().probabilities) == pytest.approx(1.0)
