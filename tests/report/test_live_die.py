"""The die of a page: triangles by the facet that it rests on, and the library that draws it."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from dataclasses import replace
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.finished import finished_box
from manifold3d import Manifold

from dicedesign.fabricate.die import FinishedDie
from dicedesign.fabricate.file_formats import BODY_COLOR, LABEL_COLOR, Part
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.report import live_die as live_module
from dicedesign.report.live_die import facet_parts, rests_of_triangles, three_script
from dicedesign.report.palette import BASINS

EXTENTS = np.array([14.0, 16.0, 20.0])
"""Of the box, whose facets are all rests."""

DEPTH = 0.7


def with_pocket(side: int, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles of the box with a pocket in its middle of the side + or - of an axis."""
    pocket = np.full(3, 4.0)
    pocket[axis] = 2.0 * DEPTH
    place = np.zeros(3)
    place[axis] = side * EXTENTS[axis] / 2.0
    cut = Manifold.cube(pocket.tolist(), True).translate(place.tolist())
    mesh = (Manifold.cube(EXTENTS.tolist(), True) - cut).to_mesh()
    return np.asarray(mesh.vert_properties, dtype=float)[:, :3], np.asarray(mesh.tri_verts)


def engraved_with(points: np.ndarray, triangles: np.ndarray) -> FinishedDie:
    die = finished_box()
    assert die.engraved is not None
    return replace(die, engraved=replace(die.engraved, points=points, triangles=triangles))


def test_what_is_cut_in_belongs_to_the_facet_around_it() -> None:
    for axis in range(3):
        for side in (-1, 1):
            points, triangles = with_pocket(side, axis)
            die = engraved_with(points, triangles)
            rests = rests_of_triangles(points, triangles, die)
            normals = die.plain.poses.normals[rests]
            middles = points[triangles].mean(axis=1)
            inside = (np.abs(middles) < EXTENTS / 2.0 - 1e-6).all(axis=1)
            assert inside.sum() >= 10
            assert (normals[inside] == side * np.eye(3)[axis]).all()
            outward = doubled_area_vectors(points, triangles)[~inside]
            outward /= np.linalg.norm(outward, axis=1, keepdims=True)
            np.testing.assert_allclose(normals[~inside], outward, atol=1e-6)


def test_parts_hold_each_triangle_once_in_the_colour_of_its_basin() -> None:
    points, triangles = with_pocket(1, 2)
    die = engraved_with(points, triangles)
    middles = points[triangles].mean(axis=1)
    labels = (np.abs(middles) < EXTENTS / 2.0 - 1e-6).all(axis=1)
    parts = facet_parts([Part("die", "#123456", points, triangles, labels)], die)
    assert [part.name for part in parts] == [f"facet-{k}" for k in range(6)]
    assert [part.color for part in parts] == list(BASINS[:6])
    whole = np.concatenate([part.triangles for part in parts])
    assert sorted(map(tuple, whole)) == sorted(map(tuple, triangles))
    marked = [part for part in parts if part.labels is not None and part.labels.any()]
    assert len(marked) == 1
    assert marked[0].groups()[1][:2] == ("labels", LABEL_COLOR)
    assert len(marked[0].groups()[1][2]) == labels.sum()


def test_an_inlay_goes_with_the_facet_that_it_fills() -> None:
    points, triangles = with_pocket(-1, 0)
    die = engraved_with(points, triangles)
    filling = Manifold.cube([DEPTH, 4.0, 4.0], True).translate([-7.0 + DEPTH / 2.0, 0.0, 0.0])
    mesh = filling.to_mesh()
    inlay = Part("labels", "#222222", mesh.vert_properties[:, :3], np.asarray(mesh.tri_verts))
    parts = facet_parts([Part("die", "#eeeeee", points, triangles), inlay], die)
    rest = int(np.argmin(die.plain.poses.normals[:, 0]))
    assert [part.name for part in parts[6:]] == [f"labels-{rest}"]
    assert parts[6].color == "#222222"
    assert len(parts[6].triangles) == len(inlay.triangles)


def test_of_a_shape_only_what_touches_the_table_belongs_to_a_rest() -> None:
    """The box with a deep dent in place of one side rests there too, on its rim."""
    plain = finished_box().plain
    corners = np.asarray(plain.poses.hull.vertices)
    sides = plain.poses.hull.triangles.tolist()
    top = [side for side in sides if (corners[side, 2] > 9.0).all()]
    rim = [7, 8] * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    points = np.concatenate([corners, [[0.0, 0.0, 2.0]], np.column_stack([rim, [10.0] * 4])])
    fan = [(9 + k, 9 + (k + 1) % 4, 8) for k in range(4)]
    triangles = np.array([side for side in sides if side not in top] + fan)
    shape: Any = object()
    die = replace(engraved_with(points, triangles), reshaped=shape)
    rests = rests_of_triangles(points, triangles, die)
    assert (rests[-4:] == -1).all()
    assert len(set(rests[:-4].tolist())) == 5
    colors = {
        part.name: part.color for part in facet_parts([Part("a", "", points, triangles)], die)
    }
    assert colors.pop("body") == BODY_COLOR
    outcomes = plain.outcomes.outcome_of_rest.tolist()
    for name, color in colors.items():
        assert color == BASINS[outcomes[int(name.removeprefix("facet-"))]]


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The archive of a trimesh that is to be made."""
    spec = ModuleSpec("trimesh", None, origin=str(tmp_path / "__init__.py"))
    monkeypatch.setattr(live_module, "find_spec", lambda name: spec)
    archive = tmp_path / "resources" / "templates" / "viewer.zip"
    archive.parent.mkdir(parents=True)
    three_script.cache_clear()
    yield archive
    three_script.cache_clear()


def test_the_installed_library_is_there_with_its_licence_and_without_trimesh_s_viewer() -> None:
    script = three_script()
    assert script is not None
    assert "MIT" in script[:200]
    assert "THREE.GLTFLoader=GLTFLoader" in script
    assert "$B64GLTF" not in script
    assert "</script" not in script


@pytest.mark.parametrize("content", [None, b"no archive", "<script>other();</script>"])
def test_a_trimesh_without_one(installed: Path, content: bytes | str | None) -> None:
    if isinstance(content, bytes):
        installed.write_bytes(content)
    elif content is not None:
        with zipfile.ZipFile(installed, "w") as archive:
            archive.writestr("viewer.html.template", content)
    assert three_script() is None


def test_no_trimesh_at_all(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_module, "find_spec", lambda name: None)
    assert three_script() is None
