"""`dicedesign scatter`: files are read back by other code, footprints are intersected."""

from __future__ import annotations

import json
import re
from collections import Counter
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
import trimesh
from manifold3d import CrossSection
from PIL import Image
from trimesh.visual.material import PBRMaterial

from dicedesign import read_body, rest_poses
from dicedesign.cli.main import main


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Folder of four meshes, one of them red with two parts, a point cloud and a broken file."""
    meshes = tmp_path / "meshes"
    (meshes / "within").mkdir(parents=True)
    trimesh.creation.box((1, 2, 3)).export(meshes / "box.stl")
    trimesh.creation.annulus(0.6, 1.2, 0.7, sections=16).export(meshes / "ring.obj")
    trimesh.creation.cylinder(0.5, 3, sections=7).export(meshes / "within" / "rod.off")
    two = trimesh.Scene()
    for name, shift in (("one", 0.0), ("two", 2.0)):
        part = trimesh.creation.icosphere(subdivisions=1)
        material = PBRMaterial(name=name, baseColorFactor=[255, 0, 0, 255])
        part.visual = trimesh.visual.TextureVisuals(material=material)
        two.add_geometry(
            part,
            geom_name=name,
            transform=trimesh.transformations.translation_matrix([shift, 0, 0]),
        )
    two.export(meshes / "two.glb")
    np.savetxt(meshes / "points.xyz", np.random.default_rng(3).normal(size=(20, 3)))
    (meshes / "bad.stl").write_text("rubbish")
    return meshes


def scatter(folder: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    assert main(["scatter", str(folder), *arguments, "--json"]) == 0
    answer: dict[str, Any] = json.loads(capsys.readouterr().out)
    return answer


def test_bodies_stand_on_the_floor_in_their_poses_apart_from_each_other(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "room.glb")
    answer = scatter(folder, capsys, "--count", "17", "--seed", "3", "--out", out)
    assert len(answer["bodies"]) == 17
    wide, deep = answer["floor"]
    shapes = []
    for body in answer["bodies"]:
        mesh, transform = read_body(folder / body["file"]), np.array(body["transform"])
        placed = mesh.points @ transform[:3, :3].T + transform[:3, 3]
        assert abs(placed[:, 2].min()) < 1e-6
        assert (np.abs(placed[:, :2]) <= [wide / 2, deep / 2]).all()
        poses = rest_poses(mesh)
        down = transform[:3, :3] @ poses.normals[body["pose"] - 1]
        np.testing.assert_allclose(down, [0.0, 0.0, -1.0], atol=1e-12)
        assert body["probability"] == poses.probabilities[body["pose"] - 1]
        shapes.append(CrossSection.hull_points(placed[:, :2].tolist()))
    for one, other in combinations(shapes, 2):
        assert (one ^ other).area() == 0.0
    counts = Counter(body["file"] for body in answer["bodies"])
    assert sorted(counts.values()) == [4, 4, 4, 5]


def test_the_glb_holds_each_mesh_once_and_each_body_as_a_node(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "room.glb"
    arguments = ("--count", "10", "--out", str(out), "--overwrite")
    answer = scatter(folder, capsys, *arguments)
    assert answer != scatter(folder, capsys, "--seed", "1", *arguments)
    assert answer == scatter(folder, capsys, *arguments)
    read = pygltflib.GLTF2().load(str(out))
    # Three files with one mesh, one with two, and the floor.
    assert len(read.meshes) == 6
    assert sorted(m.name for m in read.materials) == ["one", "two"]
    names = [node.name for node in read.nodes]
    assert {f"body {k}" for k in range(10)} < set(names)
    scene = trimesh.load(out)
    # In the file, y points up.
    back = np.linalg.inv(scene.graph["room"][0])
    assert np.linalg.det(back[:3, :3]) == pytest.approx(1.0)
    for k, body in enumerate(answer["bodies"]):
        np.testing.assert_allclose(back @ scene.graph[f"body {k}"][0], body["transform"], atol=1e-6)
    assert scene.bounds[0, 1] == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(scene.extents[[0, 2]], answer["floor"], rtol=1e-6)
    floor = scene.geometry["floor"]
    assert floor.area == pytest.approx(np.prod(answer["floor"]), rel=1e-6)
    np.testing.assert_allclose(floor.face_normals, [[0.0, 0.0, 1.0]] * 2, atol=1e-6)


def test_all_meshes_are_scaled_to_one_size(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    huge = trimesh.creation.box((1000, 500, 200))
    huge.export(folder / "huge.stl")
    out = str(tmp_path / "room.glb")
    assert main(["scatter", str(folder), "--out", out]) == 2
    assert "scale all to one size with --size" in capsys.readouterr().err
    answer = scatter(folder, capsys, "--count", "5", "--size", "2", "--out", out)
    for body in answer["bodies"]:
        points = read_body(folder / body["file"]).points
        assert np.ptp(points, axis=0).max() * body["scale"] == pytest.approx(2.0)
        turn = np.array(body["transform"])[:3, :3]
        np.testing.assert_allclose(turn @ turn.T, body["scale"] ** 2 * np.eye(3), atol=1e-12)


def test_the_picture_shows_the_colors_of_the_meshes(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, picture = str(tmp_path / "room.glb"), tmp_path / "room.png"
    scatter(folder, capsys, "--count", "9", "--out", out, "--figure", str(picture))
    with Image.open(picture) as image:
        assert image.width == 1600
        pixels = np.asarray(image.convert("HSV")).reshape(-1, 3)
    hues = np.bincount(pixels[pixels[:, 1] > 60, 0] // 16, minlength=16)
    assert np.count_nonzero(hues > 5000) >= 4


def test_a_small_floor_is_refused_with_a_sufficient_one(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "room.glb"
    arguments = ["scatter", str(folder), "--count", "20", "--out", str(out)]
    assert main([*arguments, "--floor", "9,6"]) == 2
    error = capsys.readouterr().err
    assert not out.exists()
    (placed, floor), *_ = re.findall(r"only (\d+) found.*take --floor ([\d.,]+),", error)
    assert 0 < int(placed) < 20
    assert main([*arguments, "--floor", floor]) == 0
