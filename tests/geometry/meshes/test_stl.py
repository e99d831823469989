from __future__ import annotations

import io
import struct

import numpy as np
import pytest
import trimesh

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.formats import stl_bytes


def load(data: bytes) -> trimesh.Trimesh:
    return trimesh.load(io.BytesIO(data), file_type="stl")


def test_stl_layout():
    box = trimesh.creation.box((4.0, 2.0, 1.0))
    data = stl_bytes(box.vertices, box.faces)
    assert not data.startswith(b"solid")
    assert struct.unpack("<I", data[80:84]) == (12,)
    assert len(data) == 84 + 50 * 12
    first = np.frombuffer(data[84:132], dtype="<f4").reshape(4, 3)
    np.testing.assert_array_equal(first[0], box.face_normals[0])
    np.testing.assert_array_equal(first[1:], box.triangles[0])


def test_triangles_that_vanish_in_float32_leave_the_solid_closed():
    corners = np.array([(10, 10, 10), (30, 10, 10), (10, 40, 10), (10, 10, 50)], dtype=float)
    inside = corners[0] + 1e-9 * (corners[1] + corners[2] - 2 * corners[0])
    vertices = np.vstack([corners, inside])
    triangles = np.array([(0, 2, 4), (2, 1, 4), (1, 0, 4), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
    data = stl_bytes(vertices, triangles)
    assert struct.unpack("<I", data[80:84]) == (4,)
    mesh = load(data)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(20 * 30 * 40 / 6)


def test_a_triangle_that_rounds_to_a_line_stays_with_a_zero_normal():
    vertices = np.array([(0, 0, 0), (1, 1e-60, 0), (2, 0, 0)], dtype=float)
    data = stl_bytes(vertices, np.array([(0, 1, 2)]))
    np.testing.assert_array_equal(np.frombuffer(data[84:96], dtype="<f4"), 0)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_coordinates_beyond_float32_are_refused(value):
    box = trimesh.creation.box((4.0, 2.0, 1.0))
    vertices = np.array(box.vertices)
    vertices[3, 1] = value
    with pytest.raises(
        InputError, match=r"^STL: expected vertices that are finite in float32, got \[.* in row 3; "
    ):
        stl_bytes(vertices, box.faces)
