"""STEP files, read by Open CASCADE."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from common.bodies import write_mesh

from dicedesign.errors import InputError
from dicedesign.fabricate.file_formats import (
    FILE_FORMATS,
    Contents,
    Part,
    file_bytes,
)
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import solid_properties
from dicedesign.rest.poses import rest_poses

STEP = FILE_FORMATS["step"]


@pytest.fixture
def occ():
    return pytest.importorskip("OCP")


def volume_and_center(path: Path) -> tuple[float, list[float]]:
    """By integrals over the faces of the solid in a file."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.STEPControl import STEPControl_Reader

    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(reader.OneShape(), properties)
    center = properties.CentreOfMass()
    return properties.Mass(), [center.X(), center.Y(), center.Z()]


def faces(data: bytes) -> int:
    return len(re.findall(rb"\bADVANCED_FACE\b", data))


def test_a_convex_die_has_a_face_for_each_facet(occ, tmp_path: Path) -> None:
    hull = convex_hull(10.0 * np.random.default_rng(3).normal(size=(12, 3)))
    path = tmp_path / "die.step"
    write_mesh(path, hull.vertices, hull.triangles)
    assert faces(path.read_bytes()) == len(hull.normals)
    volume, center = volume_and_center(path)
    expected = hull.surface.volume
    assert volume == pytest.approx(expected, rel=1e-9)
    np.testing.assert_allclose(center, hull.centroid, atol=1e-9)
    points, _ = STEP.read_back(path)
    np.testing.assert_allclose(
        np.sort(rest_poses(points).probabilities),
        np.sort(rest_poses(hull.vertices).probabilities),
        atol=1e-9,
    )


def test_labels_are_cut_into_the_faces(occ, contents, tmp_path: Path) -> None:
    path = tmp_path / "box.step"
    data = file_bytes(contents, STEP)
    assert data == file_bytes(contents, STEP)
    path.write_bytes(data)
    (part,) = contents.parts
    expected, center = solid_properties(part.points, part.triangles)
    for volume, middle in (volume_and_center(path), solid_properties(*STEP.read_back(path))):
        assert volume == pytest.approx(expected, rel=1e-9)
        np.testing.assert_allclose(middle, center, atol=1e-9)
    assert faces(data) < len(part.triangles) / 2


def test_parts_are_solids(occ, inlaid, tmp_path: Path) -> None:
    data = file_bytes(inlaid, STEP)
    assert len(re.findall(rb"\bMANIFOLD_SOLID_BREP\b", data)) == 2
    assert faces(data) == 11 + 6
    path = tmp_path / "inlaid.step"
    path.write_bytes(data)
    assert volume_and_center(path)[0] == pytest.approx(1000.0)
    assert solid_properties(*STEP.read_back(path))[0] == pytest.approx(1000.0)


def test_hollows_are_voids(occ, box, tmp_path: Path) -> None:
    outer, inner = box(10.0, 10.0, 10.0), box(2.0, 4.0, 6.0)
    points = np.concatenate([outer.vertices, inner.vertices + np.array([1.0, 0.0, 0.0])])
    triangles = np.concatenate([outer.triangles, inner.triangles[:, ::-1] + 8])
    path = tmp_path / "hollow.step"
    write_mesh(path, points, triangles)
    assert len(re.findall(rb"\bBREP_WITH_VOIDS\b", path.read_bytes())) == 1
    assert faces(path.read_bytes()) == 12
    expected = (1000.0 - 48.0, [-48.0 / 952.0, 0.0, 0.0])
    for volume, center in (volume_and_center(path), solid_properties(*STEP.read_back(path))):
        assert volume == pytest.approx(expected[0])
        np.testing.assert_allclose(center, expected[1], atol=1e-9)
    both = [outer.triangles, outer.triangles + 16, inner.triangles[:, ::-1] + 8]
    points = np.concatenate([points, outer.vertices + np.array([20.0, 0.0, 0.0])])
    with pytest.raises(InputError, match="expected a solid of one outer shell about its"):
        write_mesh(path, points, np.concatenate(both))


def test_open_surfaces_are_refused(occ, box) -> None:
    body = box(1.0, 1.0, 1.0)
    points, triangles = body.vertices.astype(float), body.triangles
    opened = Contents("box", [Part(points, triangles[1:], "box", "#ffffff")])
    with pytest.raises(InputError, match="expected closed surfaces, got one of 1 shells with 3 op"):
        file_bytes(opened, STEP)
