"""GLB files, read by pygltflib."""

from __future__ import annotations

import numpy as np
import pytest
from pygltflib import GLTF2

from dicedesign.fabricate.file_formats import BODY_COLOR, FILE_FORMATS, LABEL_COLOR
from dicedesign.geometry.solid import solid_properties

GLB = FILE_FORMATS["glb"]


def vectors(file: GLTF2, number: int) -> np.ndarray:
    """(n, 3) of an accessor."""
    accessor = file.accessors[number]
    assert (accessor.type, accessor.componentType) == ("VEC3", 5126)
    view = file.bufferViews[accessor.bufferView]
    assert view.byteOffset % 4 == 0
    data = file.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
    values = np.frombuffer(data, dtype="<f4").reshape(-1, 3)
    assert len(values) == accessor.count
    if accessor.min:
        np.testing.assert_array_equal(values.min(axis=0), np.float32(accessor.min))
        np.testing.assert_array_equal(values.max(axis=0), np.float32(accessor.max))
    return values.astype(np.float64)


def light(color: str) -> np.ndarray:
    """Amounts of light of a colour in sRGB (IEC 61966-2-1)."""
    shown = [int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
    return np.array([s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shown])


def test_coordinates_are_in_metres_with_y_upward(contents) -> None:
    file = GLTF2.load_from_bytes(GLB.write(contents))
    (mesh,), (part,) = file.meshes, contents.parts
    assert [file.scenes[file.scene].nodes, file.nodes[0].mesh] == [[0], 0]
    x, y, z = 1e-3 * part.points.T
    expected = np.stack([x, z, -y], axis=1)
    for primitive, are_labels in zip(mesh.primitives, (False, True), strict=True):
        points = vectors(file, primitive.attributes.POSITION).reshape(-1, 3, 3)
        corners = expected[part.triangles[part.labels == are_labels]]
        np.testing.assert_allclose(points, corners, rtol=0.0, atol=1e-9)
        normals = vectors(file, primitive.attributes.NORMAL).reshape(-1, 3, 3)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=2), 1.0, atol=1e-6)
        areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        large = np.linalg.norm(areas, axis=1) > 1e-8
        along = (normals * areas[:, None]).sum(axis=2) / np.linalg.norm(areas, axis=1)[:, None]
        assert along[large].min() > 0.9999


def test_colours_and_facts_are_read(contents) -> None:
    data = GLB.write(contents)
    file = GLTF2.load_from_bytes(data)
    assert file.asset.version == "2.0"
    assert file.asset.extras == contents.facts
    assert file.scenes[0].name == "box & co"
    primitives = file.meshes[0].primitives
    for primitive, color in zip(primitives, (BODY_COLOR, LABEL_COLOR), strict=True):
        material = file.materials[primitive.material].pbrMetallicRoughness
        np.testing.assert_allclose(material.baseColorFactor[:3], light(color), atol=1e-6)
        assert material.baseColorFactor[3] == 1.0
        assert material.metallicFactor == 0.0
    assert len(data) % 4 == 0
    assert int.from_bytes(data[8:12], "little") == len(data)


def test_parts_are_nodes(inlaid, tmp_path) -> None:
    path = tmp_path / "inlaid.glb"
    path.write_bytes(GLB.write(inlaid))
    file = GLTF2().load(str(path))
    assert [node.name for node in file.nodes] == ["die", "inlay"]
    volume, center = solid_properties(*GLB.read_back(path))
    assert volume == pytest.approx(1000.0, rel=1e-6)
    np.testing.assert_allclose(center, 0.0, atol=1e-5)
