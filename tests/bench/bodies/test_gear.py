"""The gear that is cut into pieces."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from dicedesign.bench.bodies.gear import gear


def test_the_gear_keeps_flat_faces_and_sharp_edges():
    surface = gear()
    mesh = trimesh.Trimesh(surface.points, surface.triangles, process=False)
    assert mesh.bounds[:, 2] == pytest.approx([-0.25, 0.25], abs=1e-15)
    flat = np.abs(mesh.face_normals[:, 2]) > 0.5
    assert np.abs(mesh.face_normals[flat, 2]) == pytest.approx(1.0, abs=1e-12)
    assert mesh.face_normals[~flat, 2] == pytest.approx(0.0, abs=1e-12)
    # Shoelace formula of its outline and of the polygon that is its hole.
    face = mesh.area_faces[mesh.face_normals[:, 2] > 0.5].sum()
    assert surface.volume == pytest.approx(0.5 * face, rel=1e-12)
    turned = surface.points @ np.array(
        [
            [np.cos(2 * np.pi / 9), np.sin(2 * np.pi / 9), 0],
            [-np.sin(2 * np.pi / 9), np.cos(2 * np.pi / 9), 0],
            [0, 0, 1],
        ]
    )
    rim = np.linalg.norm(surface.points[:, :2], axis=1) > 1.06
    assert cKDTree(surface.points[rim]).query(turned[rim])[0].max() < 1e-12
