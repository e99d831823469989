"""Bodies of the page for experts, without a browser."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from base64 import b64decode
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.finished import box_file
from common.kernels import compiled_only

import dicedesign as dd
from dicedesign.geometry.meshes.reading import read_stl
from dicedesign.palette import outcome_colors
from dicedesign.throws.goodness_of_fit import chi_square
from dicedesign.view.bodies import Bodies
from dicedesign.view.dice import Shop
from dicedesign.view.sources import open_source

BOX = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.0, 3.0)])


@pytest.fixture
def bodies(tmp_path: Path) -> Bodies:
    box_file(tmp_path, (1.0, 2.0, 3.0), "box.obj")
    return Bodies(Shop(), open_source(tmp_path))


@pytest.fixture
def box(bodies: Bodies) -> dict[str, Any]:
    return bodies.open({"name": "box.obj"})


def values(body: dict[str, Any]) -> np.ndarray:
    return np.array([row["probability"] for row in body["rows"]])


def corners_of(body: dict[str, Any]) -> np.ndarray:
    return np.array(body["hull"]["vertices"])


def test_a_body_has_its_rests(bodies: Bodies, box: dict[str, Any]) -> None:
    expected = dd.rest_poses(BOX)
    np.testing.assert_allclose(values(box), expected.probabilities, atol=1e-9)
    assert (box["corners"], box["facets"], box["rests"]) == (8, 6, 6)
    assert box["kind"] == "12 triangles"
    assert box["error"] is None
    # Each facet of the box is one rest, so each triangle has a code.
    codes = np.frombuffer(b64decode(box["mesh"]["codes"]), "<u1")
    assert sorted(codes.tolist()) == sorted([*range(6), *range(6)])
    assert box["colors"] == outcome_colors(6)
    with pytest.raises(dd.InputError, match="name"):
        bodies.open({"name": "sphere.obj"})


def test_changes_have_the_probabilities_of_the_model(bodies: Bodies, box: dict[str, Any]) -> None:
    corners, middle = corners_of(box), np.array(box["center"])
    center = middle + np.array([0.1, 0.2, 0.3])
    moved = bodies.change({"state": box["state"], "center": center.tolist()})
    expected = dd.rest_poses(corners, center).probabilities
    np.testing.assert_allclose(np.sort(values(moved)), np.sort(expected), atol=1e-12)
    pulled = bodies.change({"state": box["state"], "vertices": [3], "by": [0.2, 0.1, 0.4]})
    corners[3] += [0.2, 0.1, 0.4]
    expected = dd.rest_poses(corners).probabilities
    np.testing.assert_allclose(np.sort(values(pulled)), np.sort(expected), atol=1e-12)
    assert pulled["kind"] == "the dragged hull"
    # The state before is as it was, for a change that starts there again.
    again = bodies.change({"state": box["state"], "center": center.tolist()})
    np.testing.assert_array_equal(values(again), values(moved))
    uniform = bodies.change({"state": moved["state"], "uniform": True})
    np.testing.assert_allclose(values(uniform), values(box), atol=1e-12)


@pytest.mark.parametrize("corner", [-1, 8])
def test_a_corner_that_is_not_there_is_refused(
    bodies: Bodies, box: dict[str, Any], corner: int
) -> None:
    with pytest.raises(dd.InputError, match="vertices"):
        bodies.change({"state": box["state"], "vertices": [corner], "by": [0.1, 0.0, 0.0]})


def test_a_long_drag_leaves_what_it_began_with(bodies: Bodies, box: dict[str, Any]) -> None:
    other = bodies.open({"name": "box.obj"})
    first, latest = bodies.change({"state": box["state"], "uniform": True}), box
    for step in range(220):
        center = [1e-3 * step, 0.0, 0.0]
        latest = bodies.change({"state": first["state"], "center": center})
    # The body as it was opened, the state where the drag began, its end, and another tab's body.
    for state in (box, first, latest, other):
        assert bodies.change({"state": state["state"], "uniform": True})["rests"] == 6


def test_a_center_stays_inside(bodies: Bodies, box: dict[str, Any]) -> None:
    far = bodies.change({"state": box["state"], "center": [100.0, 0.0, 0.0]})
    assert "inside its hull" in far["note"]
    near = bodies.change({"state": box["state"], "center": box["center"]})
    assert near["note"] == ""
    with pytest.raises(dd.InputError, match="center of mass"):
        bodies.change({"state": box["state"], "center": [float("nan"), 0.0, 0.0]})


def test_the_map_has_each_basin_and_label(bodies: Bodies, box: dict[str, Any]) -> None:
    svg = bodies.gauss_map({"state": box["state"]})["svg"]
    root = ElementTree.fromstring(f"<maps>{svg}</maps>")
    space = "{http://www.w3.org/2000/svg}"
    fills = {path.get("fill") for path in root.iter(f"{space}path")}
    assert fills == set(box["colors"])
    labels = [text.text for text in root.iter(f"{space}text")]
    assert sorted(label for label in labels if label) == [str(number) for number in range(1, 7)]


def test_a_die_is_off_after_a_drag() -> None:
    shop = Shop()
    news = list[dict[str, Any]]()
    shop.find_dice({"text": "d6", "count": 1}, news.append, lambda: None)
    bodies = Bodies(shop, None)
    die = bodies.open({"die": news[0]["die"]["id"], "dress": {}})
    assert die["error"] < 1e-8
    moved = bodies.change({"state": die["state"], "center": [3.0, 0.0, 0.0]})
    assert moved["error"] == pytest.approx(np.abs(values(moved) - 1 / 6).max())
    assert moved["error"] > 0.01
    # Labels stay, as the mesh is the same.
    assert moved["mesh"]["codes"] == die["mesh"]["codes"]


def test_a_mesh_of_ones_own_is_read(bodies: Bodies, tmp_path: Path) -> None:
    content = box_file(tmp_path, (1.0, 1.0, 4.0), "own.stl").read_bytes()
    body = bodies.upload({"name": "../own.stl"}, content)
    assert body["name"] == "own.stl"
    expected = dd.rest_poses(BOX / [1.0, 2.0, 3.0] * [1.0, 1.0, 4.0]).probabilities
    np.testing.assert_allclose(values(body), expected, atol=1e-6)
    hull = read_stl(bodies.hull_file({"state": body["state"]}))
    np.testing.assert_allclose(hull.surface.volume, 4.0, rtol=1e-6)
    assert bodies.upload({"name": f"{'a' * 400}.stl"}, content)["rests"] == body["rests"]
    with pytest.raises(dd.InputError, match=r"^own\.stl"):
        bodies.upload({"name": "own.stl"}, b"solid nothing")


@pytest.mark.parametrize("table", [None, pytest.param("carpet", marks=compiled_only)])
def test_bodies_are_thrown(bodies: Bodies, box: dict[str, Any], table: str | None) -> None:
    query = {"state": box["state"], "table": table, "count": 500, "seed": 3}
    counts = np.array(bodies.throw(query)["counts"])
    assert counts.sum() == 500
    expected = values(box)
    if table is not None:
        expected = np.array(bodies.probabilities({"state": box["state"], "table": table})["thrown"])
        # The model and the simulation differ by some percent.
        assert np.abs(counts / 500 - expected).sum() / 2.0 < 0.1
    else:
        assert chi_square(counts, expected).p_value > 1e-3


def test_a_cloud_of_points_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "cloud.xyz"
    np.savetxt(path, np.random.default_rng(0).normal(size=(50, 3)))
    body = Bodies(Shop(), open_source(path)).open({"name": "cloud.xyz"})
    assert body["kind"] == "50 points"
    assert body["corners"] == len(corners_of(body)) < 50
