"""Every kind of path gives a body with the probabilities of the model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.finished import box_file

import dicedesign as dd
from dicedesign.results.result import RESULT
from dicedesign.view.sources import open_source
from dicedesign.view.viewed_body import MAX_DRAWN_TRIANGLES, decimate


def test_a_folder_of_meshes_has_them_all(tmp_path: Path) -> None:
    (tmp_path / "more").mkdir()
    box_file(tmp_path, name="b.obj")
    box_file(tmp_path / "more", (1.0, 1.0, 3.0), "a.stl")
    (tmp_path / "read.me").write_text("no mesh")
    source = open_source(tmp_path)
    assert source.names == ("b.obj", "more/a.stl")
    longest = source.load("more/a.stl", print)
    assert float(np.ptp(longest.hull.vertices, axis=0).max()) == pytest.approx(3.0)


@pytest.mark.parametrize("engrave", [False, True])
def test_a_finished_die_has_its_labels_and_probabilities(tmp_path: Path, engrave: bool) -> None:
    recipe = {
        "name": "d4",
        "target": {"probabilities": [0.1, 0.2, 0.3, 0.4], "labels": ["one", "2", "3", "4"]},
        "figures": False,
        "report": False,
        "engrave": engrave,
    }
    result = dd.run(recipe, out=tmp_path / "d4")
    viewed = open_source(tmp_path / "d4").load("d4", print)
    probabilities = result.engraved.probabilities if engrave else result.probabilities
    assert probabilities is not None
    assert [row.label for row in viewed.rows][:4] == ["one", "2", "3", "4"]
    np.testing.assert_allclose(
        [row.probability for row in viewed.rows][:4], probabilities, atol=1e-9
    )
    np.testing.assert_allclose([row.target for row in viewed.rows][:4], [0.1, 0.2, 0.3, 0.4])
    # Where the file with labels is missing, the plain one is shown.
    plain = replace(result, files={"die_plain": result.files["die_plain"]})
    (tmp_path / "d4" / RESULT).write_text(plain.json_text())
    viewed = open_source(tmp_path / "d4").load("d4", print)
    np.testing.assert_allclose(
        [row.probability for row in viewed.rows][:4], result.probabilities, atol=1e-9
    )


def test_a_recipe_is_designed_with_progress(tmp_path: Path) -> None:
    path = tmp_path / "d5.yaml"
    path.write_text("name: d5\ntarget: {fair: 5}\nengrave: false\n")
    texts: list[str] = []
    source = open_source(path)
    viewed = source.load("d5", texts.append)
    np.testing.assert_allclose([row.probability for row in viewed.rows], 0.2, atol=1e-6)
    assert any("step" in text for text in texts)


def test_a_decimated_mesh_is_small_and_similar() -> None:
    ball = trimesh.creation.icosphere(7, 5.0)
    points, triangles = np.asarray(ball.vertices), np.asarray(ball.faces)
    assert len(triangles) > MAX_DRAWN_TRIANGLES
    fewer, merged = decimate(points, triangles)
    assert 0.3 * MAX_DRAWN_TRIANGLES < len(merged) <= MAX_DRAWN_TRIANGLES
    assert np.abs(np.linalg.norm(fewer, axis=1) - 5.0).max() < 0.1
    assert trimesh.Trimesh(fewer, merged, process=False).volume == pytest.approx(
        ball.volume, rel=0.02
    )
    unchanged, _ = decimate(points[:100], triangles[:50] % 100)
    np.testing.assert_array_equal(unchanged, points[:100])
