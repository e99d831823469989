"""`dicedesign set`: dice in one style, measured by other libraries."""

from __future__ import annotations

import json
import math
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.parsed_html import parse_page

from dicedesign.cli.main import main
from dicedesign.fabricate.printers import PRINTERS
from dicedesign.rest.poses import rest_poses


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a set of three dice."""
    out = tmp_path_factory.mktemp("set") / "new"
    assert main(["set", "d4", "d6", "d%", "--out", str(out)]) == 0
    return out


def test_dice_have_their_bodies_sizes_labels_and_probabilities(folder: Path) -> None:
    dice = {die["name"]: die for die in json.loads((folder / "set.json").read_text())["dice"]}
    assert list(dice) == ["d4", "d6", "d00"]
    heights = {round(height, 3) for die in dice.values() for height in die["label_mm"]}
    assert len(heights) == 1
    assert min(heights) >= 2.5
    for name, die in dice.items():
        result = json.loads((folder / name / "result.json").read_text())
        body = trimesh.load(folder / name / "die.stl")
        poses = rest_poses(body.vertices, center_of_mass=body.center_mass)
        faces = len(result["labels"])
        np.testing.assert_allclose(poses.probabilities[:faces], 1.0 / faces, atol=2e-7)
        size = np.ptp(body.vertices @ poses.normals[:faces].T, axis=0)
        # The facets of the cube move when it is balanced.
        np.testing.assert_allclose(size, 16.0, atol=0.03)
        assert die["size_mm"] == pytest.approx(size.mean(), rel=1e-5)
        cosines = poses.normals[:faces] @ poses.normals[:faces].T
        if name == "d4":
            np.testing.assert_allclose(np.sort(cosines)[:, :-1], -1.0 / 3.0, atol=2e-3)
        else:
            np.testing.assert_allclose(cosines.min(axis=1), -1.0, atol=1e-5)
    labels = json.loads((folder / "d00" / "result.json").read_text())["labels"]
    assert labels == ["00", "10", "20", "30", "40", "50", "60", "70", "80", "90"]


def test_the_plate_has_the_dice_apart_and_flat_on_the_bed(folder: Path) -> None:
    scene = trimesh.load(folder / "plate.3mf")
    boxes = np.array([body.bounds for body in scene.dump()])
    volumes = [trimesh.load(folder / name / "die.stl").volume for name in ("d4", "d6", "d00")]
    np.testing.assert_allclose(
        sorted(body.volume for body in scene.dump()), sorted(volumes), rtol=1e-5
    )
    bed = [PRINTERS["fdm"].bed_width_mm, PRINTERS["fdm"].bed_depth_mm, math.inf]
    np.testing.assert_allclose(boxes[:, 0, 2], 0.0, atol=1e-5)
    assert (boxes[:, 0, :2] > 0.0).all()
    assert (boxes[:, 1] < bed).all()
    # They have room in one row, in the middle of the bed.
    middles = boxes[:, :, :2].mean(axis=1)
    np.testing.assert_allclose(middles[:, 1], bed[1] / 2.0, atol=1e-3)
    ends = boxes[:, 0, 0].min(), boxes[:, 1, 0].max()
    assert np.mean(ends) == pytest.approx(bed[0] / 2.0, abs=1e-3)
    for (low, high), (other_low, other_high) in combinations(boxes, 2):
        assert (np.maximum(low, other_low) - np.minimum(high, other_high)).max() > 4.9
    for body in scene.dump():
        touches = (body.triangles[:, :, 2] < 1e-4).all(axis=1)
        assert body.area_faces[touches].sum() > 20.0


def test_the_page_shows_the_dice_and_links_to_their_files(folder: Path) -> None:
    text = (folder / "index.html").read_text()
    page = parse_page(text)
    assert len(page.sources) == 4
    assert "3 of 3 dice" in page.text
    for name in ("d4", "d6", "d00"):
        for file in ("report.html", "die.stl", "recipe.yaml"):
            assert f'href="{name}/{file}"' in text
            assert (folder / name / file).exists()


def test_a_set_that_does_not_fit_on_the_bed_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["set", "d6", "--size", "190", "--out", str(out)]) == 2
    assert "dice that fit on the bed of fdm, 180 by 180 mm, got 1 row" in capsys.readouterr().err
    assert not out.exists()
