"""The page of a run: what it may run, what it holds, and that all of it names the same facets."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.finished import finished_box
from common.parsed_html import parsed
from pygltflib import GLTF2
from scipy.spatial import KDTree

from dicedesign.cli.main import main
from dicedesign.fabricate.file_formats import Part
from dicedesign.report import live_die as live_module
from dicedesign.report.live_die import live_die
from dicedesign.report.pages import die_page


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
    parsed((fair_d3 / "report.html").read_text("utf-8"))


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
    assert rules["script-src"].split() == [f"'sha256-{found}'" for found in sums]


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
    assert page.facets("tr") == numbers
    assert page.facets("path") == numbers
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


def test_two_runs_write_the_same_page(fair_d3: Path, tmp_path: Path) -> None:
    recipe = fair_d3 / "recipe.yaml"
    assert main(["run", str(recipe), "--no-clock", "--out", str(tmp_path / "again")]) == 0
    assert (tmp_path / "again" / "report.html").read_bytes() == (
        fair_d3 / "report.html"
    ).read_bytes()


def box_part() -> Part:
    body = finished_box().plain.body
    assert body.triangles is not None
    return Part("die", "#e8e3d8", body.points, body.triangles)


@pytest.mark.parametrize("fault", ["viewer", "triangles"])
def test_without_a_view_table_and_map_are_linked(
    fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if fault == "viewer":
        monkeypatch.setattr(live_module, "three_script", lambda: None)
    else:
        monkeypatch.setattr(live_module, "MOST_TRIANGLES", 10)
    die = finished_box()
    live = live_die(die, [box_part()])
    assert live.solid is None
    text = die_page(die.result, {"gauss_map": b"\x89PNG"}, live)
    page = Taken(text)
    assert live.left_out in parsed(text).text
    assert page.tagged("canvas") == []
    assert page.facets("tr") == page.facets("path") == [str(k) for k in range(6)]
    assert [attributes for attributes, _ in page.scripts] == [{}]


def test_without_figures_view_and_table_are_linked() -> None:
    die = finished_box()
    page = Taken(die_page(die.result, {}, live_die(die, [box_part()])))
    assert len(page.tagged("canvas")) == 1
    assert page.facets("path") == []
    assert len(page.facets("tr")) == 6
