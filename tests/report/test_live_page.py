"""The page of a die that turns: what it holds, and the same facets in solid, table and map."""

from __future__ import annotations

import json
import zipfile
from dataclasses import replace
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from common.finished import finished_box, page_text
from common.parsed_html import parse_page
from manifold3d import Manifold
from pygltflib import GLTF2
from scipy.spatial import KDTree

from dicedesign.fabricate.die import FinishedDie
from dicedesign.fabricate.file_formats import BODY_COLOR, LABEL_COLOR, Part
from dicedesign.geometry.triangles import Surface, doubled_area_vectors
from dicedesign.palette import BASINS
from dicedesign.report import pages
from dicedesign.report.pages import facet_parts, rests_of_triangles, three_script

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


def engrave_mesh(points: np.ndarray, triangles: np.ndarray) -> FinishedDie:
    die = finished_box()
    assert die.engraved is not None
    return replace(die, engraved=replace(die.engraved, points=points, triangles=triangles))


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", [-1, 1])
def test_an_engraving_belongs_to_the_facet_around_it(axis: int, side: int) -> None:
    points, triangles = with_pocket(side, axis)
    die = engrave_mesh(points, triangles)
    rests = rests_of_triangles(Surface(points, triangles), die)
    normals = die.plain.poses.normals[rests]
    inside = (np.abs(points[triangles].mean(axis=1)) < EXTENTS / 2.0 - 1e-6).all(axis=1)
    assert inside.sum() >= 10
    assert (normals[inside] == side * np.eye(3)[axis]).all()
    outward = doubled_area_vectors(points, triangles)[~inside]
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    np.testing.assert_allclose(normals[~inside], outward, atol=1e-6)


def test_parts_hold_each_triangle_once_in_the_color_of_its_basin() -> None:
    """An inlay belongs to the facet that it fills."""
    points, triangles = with_pocket(1, 2)
    die = engrave_mesh(points, triangles)
    labels = (np.abs(points[triangles].mean(axis=1)) < EXTENTS / 2.0 - 1e-6).all(axis=1)
    corners = np.array([[2.0, 2.0, 9.5], [-2.0, 2.0, 9.5], [0.0, -2.0, 9.5]])
    inlay = Part(corners, np.array([[0, 1, 2]]), "labels", "#222222")
    *parts, filled = facet_parts([Part(points, triangles, "die", "#123456", labels), inlay], die)
    assert [part.name for part in parts] == [f"facet-{k}" for k in range(6)]
    assert [part.color for part in parts] == list(BASINS[:6])
    whole = np.concatenate([part.triangles for part in parts])
    assert sorted(map(tuple, whole)) == sorted(map(tuple, triangles))
    (marked,) = (part for part in parts if part.labels is not None and part.labels.any())
    assert marked.groups()[1][:2] == ("labels", LABEL_COLOR)
    assert len(marked.groups()[1][2]) == labels.sum()
    assert filled.name == f"labels-{np.argmax(die.plain.poses.normals[:, 2])}"
    assert (filled.color, len(filled.triangles)) == ("#222222", len(inlay.triangles))


def test_only_parts_of_a_shape_that_touch_the_table_belong_to_a_rest() -> None:
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
    die = replace(engrave_mesh(points, triangles), reshaped=shape)
    rests = rests_of_triangles(Surface(points, triangles), die)
    assert (rests[-4:] == -1).all()
    assert len(set(rests[:-4].tolist())) == 5
    colors = {
        part.name: part.color for part in facet_parts([Part(points, triangles, "a", "")], die)
    }
    assert colors.pop("body") == BODY_COLOR
    outcomes = plain.outcomes.outcome_of_rest.tolist()
    for name, color in colors.items():
        assert color == BASINS[outcomes[int(name.removeprefix("facet-"))]]


@pytest.mark.parametrize("content", [None, "<script>other();</script>"])
def test_a_trimesh_without_its_viewer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: str | None
) -> None:
    spec = ModuleSpec("trimesh", None, origin=str(tmp_path / "__init__.py"))
    monkeypatch.setattr(pages, "find_spec", lambda name: spec)
    archive = tmp_path / "resources" / "templates" / "viewer.zip"
    archive.parent.mkdir(parents=True)
    if content is not None:
        with zipfile.ZipFile(archive, "w") as file:
            file.writestr("viewer.html.template", content)
    three_script.cache_clear()
    assert three_script() is None
    three_script.cache_clear()


def gltf_triangles(data: bytes, node: int) -> np.ndarray:
    """Corners (t, 3, 3) in mm, z upward, of a node of a GLB."""
    file = GLTF2.load_from_bytes(data)
    blob = file.binary_blob()
    corners = []
    for primitive in file.meshes[file.nodes[node].mesh].primitives:
        accessor = file.accessors[primitive.attributes.POSITION]
        view = file.bufferViews[accessor.bufferView]
        part = blob[view.byteOffset : view.byteOffset + view.byteLength]
        corners.append(np.frombuffer(part, "<f4").reshape(-1, 3, 3))
    return 1e3 * np.concatenate(corners)[..., [0, 2, 1]] * [1.0, -1.0, 1.0]


def test_table_map_and_solid_have_the_same_facets(fair_d3: Path) -> None:
    """The solid is the one of die.stl, and most of a facet is where the die touches the table."""
    page = parse_page((fair_d3 / "report.html").read_text("utf-8"))
    assert b"MIT" in page.unpack("three")[:200]
    data = page.unpack("solid")
    nodes = {node.name: k for k, node in enumerate(GLTF2.load_from_bytes(data).nodes)}
    corners = {name: gltf_triangles(data, node) for name, node in nodes.items()}
    whole = np.concatenate(list(corners.values()))
    wanted = np.asarray(trimesh.load(fair_d3 / "die.stl", process=False).triangles)
    _, match = KDTree(wanted.mean(axis=1)).query(whole.mean(axis=1))
    assert sorted(match.tolist()) == list(range(len(wanted)))
    rolls = np.stack([np.roll(whole, k, axis=1) for k in range(3)])
    assert np.abs(rolls - wanted[match]).max(axis=(2, 3)).min(axis=0).max() < 1e-5

    facets = json.loads((fair_d3 / "result.json").read_text())["facets"]
    numbers = [str(k) for k in range(len(facets))]
    assert sorted(page.facets("tr")) == numbers
    assert page.facets("path") == 2 * numbers
    assert set(nodes) - {"body"} == {f"facet-{k}" for k in numbers}
    rows = {a["data-facet"]: a for a in page.tagged("tr") if "data-facet" in a}
    for number, facet in zip(numbers, facets, strict=True):
        row, normal = rows[number], np.array(facet["normal"])
        np.testing.assert_allclose(np.array(row["data-down"].split(), float), normal, atol=1e-5)
        own = corners[f"facet-{number}"]
        turned = np.cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0])
        flush = (turned @ normal > 0.999 * np.linalg.norm(turned, axis=1)) & (
            (own @ normal).min(axis=1) > float(row["data-height"]) - 1e-2
        )
        area = 0.5 * np.linalg.norm(turned[flush], axis=1).sum()
        assert 0.7 * facet["polygon_area_mm2"] < area <= 1.001 * facet["polygon_area_mm2"]


def test_a_large_solid_is_left_out_and_table_and_map_are_linked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pages, "MAX_TRIANGLES", 10)
    page = parse_page(page_text(finished_box(), {"gauss_map": b"\x89PNG"}))
    assert page.tagged("canvas") == []
    numbers = [str(k) for k in range(6)]
    assert sorted(page.facets("tr")) == numbers
    assert page.facets("path") == 2 * numbers
    assert set(page.packed) == {""}
