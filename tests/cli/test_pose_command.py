"""`dicedesign pose` writes meshes in resting poses, read back by other code."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pygltflib
import pytest
import trimesh
from common.paths import public_data
from trimesh.visual.material import PBRMaterial

from dicedesign import read_body, rest_poses
from dicedesign.cli.main import main


@pytest.fixture
def egg(tmp_path: Path) -> Path:
    """A red solid without symmetry, off its origin, as GLB."""
    points = np.random.default_rng(1).normal([3.0, 1.0, -2.0], 1.0, (20, 3))
    mesh = trimesh.convex.convex_hull(points)
    mesh.visual = trimesh.visual.TextureVisuals(
        material=PBRMaterial(name="red", baseColorFactor=[255, 0, 0, 255])
    )
    path = tmp_path / "egg.glb"
    mesh.export(path)
    return path


def posed_files(capsys: pytest.CaptureFixture[str]) -> list[dict[str, object]]:
    files: list[dict[str, object]] = json.loads(capsys.readouterr().out)["files"]
    return files


@pytest.mark.parametrize(
    ("ending", "number"),
    [*zip(["stl", "obj", "ply", "off", "glb", "3mf"], [1, 2, 3] * 2, strict=True)],
)
def test_the_file_holds_the_mesh_in_that_pose(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], egg: Path, ending: str, number: int
) -> None:
    out = tmp_path / f"posed.{ending}"
    assert main(["pose", str(egg), "--pose", str(number), "--out", str(out), "--json"]) == 0
    (one,) = posed_files(capsys)
    poses = rest_poses(read_body(egg))
    assert one["probability"] == pytest.approx(poses.probabilities[number - 1], abs=1e-9)
    posed = trimesh.load(out, force="mesh")
    original = trimesh.load(egg, force="mesh")
    assert posed.volume == pytest.approx(original.volume, rel=1e-5)
    assert abs(posed.bounds[0, 2]) < 1e-6
    np.testing.assert_allclose(posed.center_mass[:2], 0.0, atol=1e-5)
    # It stands on the facet of that rest, whose area is on the plane.
    flat = np.abs(posed.triangles[:, :, 2]).max(axis=1) < 1e-5
    assert posed.area_faces[flat].sum() == pytest.approx(poses.areas[number - 1], rel=1e-4)
    moved = trimesh.transform_points(original.vertices, one["transform"])
    np.testing.assert_allclose(moved.min(axis=0), posed.bounds[0], atol=1e-5)
    np.testing.assert_allclose(moved.max(axis=0), posed.bounds[1], atol=1e-5)


def test_a_mesh_can_stand_on_any_facet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], egg: Path
) -> None:
    """The area of the facet is on the plane, and the center of mass above the origin."""
    poses = rest_poses(read_body(egg))
    for facet in range(len(poses.hull.normals)):
        out = tmp_path / f"out{facet}.stl"
        assert main(["pose", str(egg), "--facet", str(facet), "--out", str(out), "--json"]) == 0
        (one,) = posed_files(capsys)
        rests = np.flatnonzero(poses.facets == facet).tolist()
        assert one["facet"] == facet
        assert one["pose"] == (rests[0] + 1 if rests else None)
        assert (one["probability"] == 0.0) == (not rests)
        posed = trimesh.load(out)
        np.testing.assert_allclose(posed.center_mass[:2], 0.0, atol=1e-5)
        flat = np.abs(posed.triangles[:, :, 2]).max(axis=1) < 1e-5
        assert posed.area_faces[flat].sum() == pytest.approx(poses.hull.areas[facet], rel=1e-4)


def test_a_glb_keeps_its_material_and_a_ply_its_colors(tmp_path: Path, egg: Path) -> None:
    out = tmp_path / "out.glb"
    assert main(["pose", str(egg), "--out", str(out)]) == 0
    read = pygltflib.GLTF2().load(str(out))
    assert read.materials[0].name == "red"
    assert read.materials[0].pbrMetallicRoughness.baseColorFactor == [1.0, 0.0, 0.0, 1.0]
    cone = trimesh.creation.cone(1.0, 2.0, sections=9)
    colors = np.random.default_rng(2).integers(0, 255, (len(cone.faces), 4)).astype(np.uint8)
    cone.visual.face_colors = colors
    cone.export(tmp_path / "cone.ply")
    assert main(["pose", str(tmp_path / "cone.ply"), "--out", str(tmp_path / "posed.ply")]) == 0
    posed = trimesh.load(tmp_path / "posed.ply", process=False)
    np.testing.assert_array_equal(posed.visual.face_colors, colors)


def test_y_can_be_upward(tmp_path: Path, egg: Path) -> None:
    assert main(["pose", str(egg), "--up", "y", "--out", str(tmp_path / "y.glb")]) == 0
    assert main(["pose", str(egg), "--out", str(tmp_path / "z.glb")]) == 0
    y, z = (trimesh.load(tmp_path / f"{axis}.glb", force="mesh") for axis in "yz")
    assert abs(y.bounds[0, 1]) < 1e-6
    assert y.extents[1] == pytest.approx(z.extents[2], rel=1e-6)
    assert y.volume == pytest.approx(z.volume, rel=1e-5)
    # A rotation, not its mirror image.
    turned = z.vertices[:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    np.testing.assert_allclose(y.vertices, turned, atol=1e-6)


def test_a_pose_depends_on_the_seed_and_not_on_other_meshes(tmp_path: Path, egg: Path) -> None:
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "box.stl")
    alone, beside = tmp_path / "egg.obj", tmp_path / "both"
    arguments = ["--random", "--seed", "5"]
    assert main(["pose", str(egg), *arguments, "--out", str(alone)]) == 0
    both = [str(tmp_path / "box.stl"), str(egg)]
    assert main(["pose", *both, *arguments, "--format", "obj", "--out", str(beside)]) == 0
    assert (beside / "egg.obj").read_bytes() == alone.read_bytes()
    assert (
        main(["pose", str(egg), "--random", "--seed", "6", "--out", str(alone), "--overwrite"]) == 0
    )
    assert (beside / "egg.obj").read_bytes() != alone.read_bytes()


def test_a_bad_file_does_not_end_a_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], egg: Path
) -> None:
    folder = tmp_path / "meshes"
    (folder / "within").mkdir(parents=True)
    trimesh.creation.box((1, 2, 3)).export(folder / "box.stl")
    trimesh.creation.cylinder(1, 4, sections=9).export(folder / "within" / "rod.off")
    (folder / "bad.stl").write_text("rubbish")
    np.savetxt(folder / "points.xyz", np.random.default_rng(3).normal(size=(20, 3)))
    out = tmp_path / "new" / "posed"
    assert main(["pose", str(folder), "--out", str(out), "--jobs", "1"]) == 0
    captured = capsys.readouterr()
    assert "bad.stl: expected a .stl file" in captured.err
    assert "1 files could not be posed" in captured.err
    for name in ("box.stl", "within/rod.off", "points.xyz"):
        assert name in captured.out
        points = read_body(out / name).points
        assert abs(points[:, 2].min()) < 1e-6
    assert read_body(out / "box.stl").points[:, 2].max() == pytest.approx(1.0)


def test_outputs_have_default_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, egg: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((1, 2, 3)).export("box.stl")
    assert main(["pose", "box.stl"]) == 0
    assert abs(read_body("box_posed.stl").points[:, 2].min()) < 1e-6
    assert main(["pose", "box.stl", str(egg), "--jobs", "1"]) == 0
    assert {path.name for path in Path("posed").iterdir()} == {"box.stl", "egg.glb"}


def test_a_quantized_mesh_is_posed_in_its_size(tmp_path: Path) -> None:
    """trimesh would take its integers for lengths."""
    posed = []
    for name in ("quantized", "reference_float"):
        out = tmp_path / f"{name}.glb"
        assert main(["pose", str(public_data(f"cases/15_{name}.glb")), "--out", str(out)]) == 0
        posed.append(read_body(out))
    heights = [body.points[:, 2].max() for body in posed]
    assert heights[0] == pytest.approx(heights[1], rel=1e-3)
    probabilities = [rest_poses(body).probabilities for body in posed]
    np.testing.assert_allclose(*probabilities, atol=1e-5)
