"""`dicedesign repair` writes closed surfaces of one solid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from common.bumpy import bumpy_sphere
from PIL import Image

from dicedesign.cli.main import main
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.surfaces.closed_surface import make_surface
from dicedesign.runtime.arrays import Floats, Integers


def write_obj(path: Path, points: Floats, triangles: Integers) -> Path:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(triangles) + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_an_open_mesh_becomes_a_surface_of_the_same_solid(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("dicedesign.geometry.surfaces.repair.CELLS", 40)
    original = bumpy_sphere(2)
    # A sheet inside makes it more than a surface with a hole.
    triangles = np.vstack([original.triangles[5:], [[0, 50, 100]]])
    broken = write_obj(tmp_path / "broken.obj", original.points, triangles)
    out = tmp_path / "whole.glb"
    assert main(["repair", str(broken), str(out)]) == 0
    captured = capsys.readouterr()
    lines = captured.out.splitlines()
    table = {line.rsplit("  ", 2)[0].split("  ")[0]: line.split() for line in lines}
    surface, notes = make_surface(read_body(out))
    # A GLB file has each point once for each triangle.
    assert all(note.startswith("welded") for note in notes)
    assert surface.volume == pytest.approx(original.volume, rel=0.01)
    np.testing.assert_allclose(surface.centroid, original.centroid, atol=0.01)
    assert table["points"][1:] == [str(len(original.points)), str(len(surface.points))]
    assert table["handles"][-1] == "0"
    with Image.open(tmp_path / "whole_repair.png") as picture:
        assert picture.width > picture.height > 500
    assert "note: repaired the mesh" in captured.err


def test_a_sound_mesh_is_written_unchanged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    original = bumpy_sphere(1)
    path = write_obj(tmp_path / "fine.obj", original.points, original.triangles)
    assert main(["repair", str(path), str(tmp_path / "copy.obj")]) == 0
    assert "needed no repair" in capsys.readouterr().err
    body = read_body(tmp_path / "copy.obj")
    np.testing.assert_array_equal(body.points, original.points)
    np.testing.assert_array_equal(body.triangles, original.triangles)
    assert not (tmp_path / "copy_repair.png").exists()


def test_where_a_repaired_mesh_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    original = bumpy_sphere(1)
    path = write_obj(Path("a.obj"), original.points, original.triangles)
    data = path.read_bytes()
    Path("link.obj").symlink_to("a.obj")
    Path("folder").mkdir()
    for out in ("a.obj", "link.obj", "new/a.foo", "new/a"):
        assert main(["repair", "a.obj", "--out", out]) == 2
        assert out in capsys.readouterr().err
    assert main(["repair", "a.obj", "b.obj", "--out", "c.obj"]) == 2
    assert {each.name for each in tmp_path.iterdir()} == {"a.obj", "link.obj", "folder"}
    assert path.read_bytes() == data
    for arguments in ([], ["--out", "folder"], ["--out", "new/deep/a.stl"]):
        assert main(["repair", "a.obj", *arguments]) == 0
    written = ("a_repaired.obj", "folder/a_repaired.obj", "new/deep/a.stl")
    assert all(Path(each).is_file() for each in written)
