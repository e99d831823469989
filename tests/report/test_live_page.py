"""The page of a run that turns: what it holds and may run, the same facets everywhere."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import re
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
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


def test_an_engraving_belongs_to_the_facet_around_it() -> None:
    for axis in range(3):
        for side in (-1, 1):
            points, triangles = with_pocket(side, axis)
            die = engrave_mesh(points, triangles)
            rests = rests_of_triangles(Surface(points, triangles), die)
            normals = die.plain.poses.normals[rests]
            middles = points[triangles].mean(axis=1)
            inside = (np.abs(middles) < EXTENTS / 2.0 - 1e-6).all(axis=1)
            assert inside.sum() >= 10
            assert (normals[inside] == side * np.eye(3)[axis]).all()
            outward = doubled_area_vectors(points, triangles)[~inside]
            outward /= np.linalg.norm(outward, axis=1, keepdims=True)
            np.testing.assert_allclose(normals[~inside], outward, atol=1e-6)


def test_parts_hold_each_triangle_once_in_the_color_of_its_basin() -> None:
    points, triangles = with_pocket(1, 2)
    die = engrave_mesh(points, triangles)
    middles = points[triangles].mean(axis=1)
    labels = (np.abs(middles) < EXTENTS / 2.0 - 1e-6).all(axis=1)
    parts = facet_parts([Part(points, triangles, "die", "#123456", labels)], die)
    assert [part.name for part in parts] == [f"facet-{k}" for k in range(6)]
    assert [part.color for part in parts] == list(BASINS[:6])
    whole = np.concatenate([part.triangles for part in parts])
    assert sorted(map(tuple, whole)) == sorted(map(tuple, triangles))
    marked = [part for part in parts if part.labels is not None and part.labels.any()]
    assert len(marked) == 1
    assert marked[0].groups()[1][:2] == ("labels", LABEL_COLOR)
    assert len(marked[0].groups()[1][2]) == labels.sum()


def test_an_inlay_belongs_to_the_facet_that_it_fills() -> None:
    points, triangles = with_pocket(-1, 0)
    die = engrave_mesh(points, triangles)
    filling = Manifold.cube([DEPTH, 4.0, 4.0], True).translate([-7.0 + DEPTH / 2.0, 0.0, 0.0])
    mesh = filling.to_mesh()
    inlay = Part(mesh.vert_properties[:, :3], np.asarray(mesh.tri_verts), "labels", "#222222")
    parts = facet_parts([Part(points, triangles, "die", "#eeeeee"), inlay], die)
    rest = int(np.argmin(die.plain.poses.normals[:, 0]))
    assert [part.name for part in parts[6:]] == [f"labels-{rest}"]
    assert parts[6].color == "#222222"
    assert len(parts[6].triangles) == len(inlay.triangles)


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


@pytest.fixture
def trimesh_archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The archive of a trimesh that is to be made."""
    spec = ModuleSpec("trimesh", None, origin=str(tmp_path / "__init__.py"))
    monkeypatch.setattr(pages, "find_spec", lambda name: spec)
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
def test_a_trimesh_without_one(trimesh_archive: Path, content: bytes | str | None) -> None:
    if isinstance(content, bytes):
        trimesh_archive.write_bytes(content)
    elif content is not None:
        with zipfile.ZipFile(trimesh_archive, "w") as archive:
            archive.writestr("viewer.html.template", content)
    assert three_script() is None


def test_no_trimesh_at_all(trimesh_archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pages, "find_spec", lambda name: None)
    assert three_script() is None


class Taken(HTMLParser):
    """Elements of a page by tag, and the text of its scripts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[tuple[dict[str, str | None], str]] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag == "script":
            self.scripts.append((dict(attrs), ""))

    def handle_data(self, data: str) -> None:
        if self.elements and self.elements[-1][0] == "script" and self.scripts[-1][1] == "":
            self.scripts[-1] = (self.scripts[-1][0], data)

    def tagged(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]

    def held(self, name: str) -> bytes:
        """The unpacked content of an element of data."""
        (text,) = [text for attributes, text in self.scripts if attributes.get("id") == name]
        return gzip.decompress(base64.b64decode(text))

    def facets(self, tag: str) -> list[str]:
        return [a["data-facet"] or "" for a in self.tagged(tag) if "data-facet" in a]


@pytest.fixture(scope="module")
def page(fair_d3: Path) -> Taken:
    return Taken((fair_d3 / "report.html").read_text("utf-8"))


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


def test_it_loads_nothing(page: Taken, fair_d3: Path) -> None:
    text = re.sub(r"[A-Za-z0-9+/=]{400,}", "", (fair_d3 / "report.html").read_text("utf-8"))
    assert "http:" not in text
    assert "https:" not in text
    for tag, attributes in page.elements:
        assert tag not in ("link", "iframe", "object", "embed", "base", "form")
        for name in ("src", "href", "action", "data"):
            assert (attributes.get(name) or "data:image/").startswith("data:image/")
        assert not any(name.startswith("on") for name in attributes)
    parse_page((fair_d3 / "report.html").read_text("utf-8"))


def test_its_policy_allows_its_own_scripts_alone(page: Taken) -> None:
    (policy,) = [a["content"] or "" for a in page.tagged("meta") if "http-equiv" in a]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    assert set(rules) <= {
        "default-src",
        "base-uri",
        "form-action",
        "img-src",
        "style-src",
        "script-src",
    }
    assert rules["img-src"] == "data:"
    inline = [text.encode() for attributes, text in page.scripts if "type" not in attributes]
    assert len(inline) == 1
    sums = [
        base64.b64encode(hashlib.sha256(content).digest()).decode()
        for content in (*inline, page.held("three"))
    ]
    assert rules["script-src"].split() == [f"'sha256-{each}'" for each in sums]


def test_its_solid_is_the_file_s(page: Taken, fair_d3: Path) -> None:
    data = page.held("solid")
    nodes = GLTF2.load_from_bytes(data).nodes
    corners = np.concatenate([gltf_triangles(data, k) for k in range(len(nodes))])
    wanted = np.asarray(trimesh.load(fair_d3 / "die.stl", process=False).triangles)
    assert len(corners) == len(wanted)
    _, match = KDTree(wanted.mean(axis=1)).query(corners.mean(axis=1))
    assert len(set(match.tolist())) == len(wanted)
    rolls = np.stack([np.roll(corners, k, axis=1) for k in range(3)])
    apart = np.abs(rolls - wanted[match]).max(axis=(2, 3)).min(axis=0)
    assert apart.max() < 1e-5


def test_table_map_and_solid_name_the_same_facets(page: Taken, fair_d3: Path) -> None:
    facets = json.loads((fair_d3 / "result.json").read_text())["facets"]
    numbers = [str(k) for k in range(len(facets))]
    assert sorted(page.facets("tr")) == numbers
    assert page.facets("path") == 2 * numbers
    data = page.held("solid")
    nodes = {node.name: k for k, node in enumerate(GLTF2.load_from_bytes(data).nodes)}
    assert {name for name in nodes if name != "body"} == {f"facet-{k}" for k in numbers}
    rows = [a for a in page.tagged("tr") if "data-facet" in a]
    for number, facet, row in zip(numbers, facets, rows, strict=True):
        normal = np.array(facet["normal"])
        np.testing.assert_allclose(
            np.array((row["data-down"] or "").split(), float), normal, atol=1e-5
        )
        # Most of a facet is where the die touches the table.
        corners = gltf_triangles(data, nodes[f"facet-{number}"])
        turned = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        flush = (turned @ normal > 0.999 * np.linalg.norm(turned, axis=1)) & (
            (corners @ normal).min(axis=1) > float(row["data-height"] or 0) - 1e-2
        )
        area = 0.5 * np.linalg.norm(turned[flush], axis=1).sum()
        assert 0.7 * facet["polygon_area_mm2"] < area <= 1.001 * facet["polygon_area_mm2"]


@pytest.mark.parametrize("fault", ["viewer", "triangles"])
def test_without_a_view_table_and_map_are_linked(
    fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if fault == "viewer":
        monkeypatch.setattr(pages, "three_script", lambda: None)
    else:
        monkeypatch.setattr(pages, "MAX_TRIANGLES", 10)
    text = page_text(finished_box(), {"gauss_map": b"\x89PNG"})
    page = Taken(text)
    assert "The die cannot be turned here" in parse_page(text).text
    assert page.tagged("canvas") == []
    numbers = [str(k) for k in range(6)]
    assert sorted(page.facets("tr")) == numbers
    assert page.facets("path") == 2 * numbers
    assert [attributes for attributes, _ in page.scripts] == [{}]
