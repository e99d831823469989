"""Dice of the page, without a browser: texts, candidates, dressed dice, throws and files."""

from __future__ import annotations

import threading
import zipfile
from base64 import b64decode
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from common.kernels import compiled_only
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

import dicedesign as dd
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.triangles import Surface
from dicedesign.recipe.pipeline import Work, run, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.goodness_of_fit import chi_square
from dicedesign.view.dice import Recent, Shop, Stopped
from dicedesign.view.meshes import die_mesh

TARGET = {"text": "1/2, 1/3, 1/6"}
PROBABILITIES = [1 / 2, 1 / 3, 1 / 6]
QUICK = {"figures": False, "report": False, "print": False}
DRESSES: list[dict[str, Any]] = [
    {},
    {"labels": "letters", "edges": "fillet"},
    {"labels": "icons", "style": "raised"},
    {"labels": "pips", "edges": "chamfer"},
    {"labels": "own", "texts": ["yes", "no", "later"], "font": "DejaVu Serif", "size_mm": 40},
    {"printer": "sla", "size_mm": 20},
]


@pytest.fixture(scope="module")
def shop() -> Shop:
    return Shop()


@pytest.fixture(scope="module")
def dice(shop: Shop) -> list[dict[str, Any]]:
    """Cards of the first dice: the cube with six faces, and the dodecahedron."""
    news = list[dict[str, Any]]()
    shop.find_dice({**TARGET, "count": 2}, news.append, lambda: None)
    cards = {one["die"]["id"]: one["die"] for one in news if "die" in one}
    (order,) = [one["order"] for one in news if "order" in one]
    return [cards[number] for number in order]


def test_dice_are_those_of_a_design(shop: Shop, dice: list[dict[str, Any]]) -> None:
    assert [card["faces"] for card in dice] == [6, 12]
    for card in dice:
        assert card["style"] == "ok"
        assert card["is_read_on_top"]
    target = {"probabilities": ["1/2", "1/3", "1/6"]}
    result = dd.run({"name": "die", "target": target, "candidates": 2, **QUICK})
    assert [one.faces for one in result.candidates] == [6, 12]


def unpack(mesh: dict[str, Any]) -> tuple[Surface, np.ndarray]:
    """Surface of a mesh as the page gets it, and its codes."""
    points = np.frombuffer(b64decode(mesh["points"]), "<f4").reshape(-1, 3).astype(np.float64)
    triangles = np.frombuffer(b64decode(mesh["triangles"]), "<u4").reshape(-1, 3).astype(np.int64)
    return Surface(points, triangles), np.frombuffer(b64decode(mesh["codes"]), "<u1")


@pytest.mark.parametrize("dress", DRESSES)
def test_what_is_shown_is_what_is_saved(
    shop: Shop, dice: list[dict[str, Any]], tmp_path: Path, dress: dict[str, Any]
) -> None:
    query = {"die": dice[1]["id"], "dress": dress}
    shown = shop.dress(query)
    name, data = shop.file({**query, "kind": "stl"})
    (tmp_path / name).write_bytes(data)
    poses = rest_poses(read_body(tmp_path / name))
    rests = np.sort(np.repeat(np.array(PROBABILITIES) / [6, 4, 2], [6, 4, 2]))
    np.testing.assert_allclose(np.sort(poses.probabilities), rests, atol=1e-8)
    surface, codes = unpack(shown["mesh"])
    assert len(codes) == len(surface.triangles)
    np.testing.assert_allclose(surface.volume, read_body(tmp_path / name).surface.volume, rtol=1e-5)
    np.testing.assert_allclose(surface.centroid, 0.0, atol=1e-4)
    assert poses.hull.diameter == pytest.approx(shown["size_mm"], rel=0.15)
    # Read on top: the facet above a rest has the code of its outcome.
    middles = surface.points[surface.triangles].mean(axis=1)
    for rest in shown["mesh"]["rests"]:
        height = middles @ -np.array(rest["down"])
        top = codes[height > height.max() - 1e-3]
        assert len(top)
        assert set(top.tolist()) & {rest["outcome"], rest["outcome"] | 128}
        assert not {code & 63 for code in top.tolist()} & {0, 1, 2} - {rest["outcome"]}
    assert (codes >= 128).any()
    # Edges are all that is parallel to no facet and lies on the hull; labels are below or above it.
    is_edge = codes == 63
    normals = trimesh.Trimesh(surface.points, surface.triangles, process=False).face_normals
    assert is_edge.any() == ("edges" in dress)
    flatness = (normals @ poses.normals.T).max(axis=1)
    assert (flatness[is_edge] < 0.9999).all()
    hull = ConvexHull(surface.points).equations
    depths = -(middles @ hull[:, :3].T + hull[:, 3]).max(axis=1)
    assert (depths[is_edge] < 0.1).all()


def test_flat_sides_without_an_outcome_are_no_edges() -> None:
    """A d3 has six ends on which it does not rest."""
    recipe = {"name": "d3", "target": {"fair": 3}, "faces": "one", "start": {"prism": {}}}
    work = Work(parse_recipe({**recipe, "edges": {"radius_mm": 1.0}, "engrave": False}))
    run_stages(work, last="throws")
    mesh, sides = die_mesh(work), work.plain.poses.hull.normals
    normals = trimesh.Trimesh(mesh.points, mesh.triangles, process=False).face_normals
    is_flat, side = (normals @ sides.T).max(axis=1) > 0.9999, np.argmax(normals @ sides.T, axis=1)
    np.testing.assert_array_equal(mesh.codes == 63, ~is_flat)
    shown = {int(k): set(mesh.codes[is_flat & (side == k)].tolist()) for k in range(len(sides))}
    assert sorted(map(sorted, shown.values())) == [[0], [1], [2], *[[62]] * 6]


def test_a_recipe_makes_the_die_again(
    shop: Shop, dice: list[dict[str, Any]], tmp_path: Path
) -> None:
    query = {"die": dice[1]["id"], "dress": {"labels": "icons", "size_mm": 32}}
    name, data = shop.file({**query, "kind": "yaml"})
    (tmp_path / name).write_bytes(data)
    run(tmp_path / name, tmp_path / "again", changes=["figures=false", "report=false"])
    _, stl = shop.file({**query, "kind": "stl"})
    assert (tmp_path / "again" / "die.stl").read_bytes() == stl
    # A shop that has forgotten the design makes it anew.
    assert Shop().file({**query, "kind": "stl"}) == shop.file({**query, "kind": "stl"})


def test_files_have_the_chosen_colors(
    shop: Shop, dice: list[dict[str, Any]], tmp_path: Path
) -> None:
    query = {"die": dice[0]["id"], "dress": {}, "colors": ["#3e6b57", "#f7edd2"]}
    name, data = shop.file({**query, "kind": "obj"})
    (tmp_path / name).write_bytes(data)
    poses = rest_poses(read_body(tmp_path / name))
    np.testing.assert_allclose(poses.probabilities, 1 / 6, atol=1e-8)
    (tmp_path / "die.3mf").write_bytes(shop.file({**query, "kind": "3mf"})[1])
    with zipfile.ZipFile(tmp_path / "die.3mf") as archive:
        model = archive.read("3D/3dmodel.model").decode().lower()
    assert "#3e6b57" in model
    assert "#f7edd2" in model


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("50, 30, 20", [0.5, 0.3, 0.2]),
        ("50%, 30%", [0.5, 0.3, 0.2]),
        ("50 30 20", [0.5, 0.3, 0.2]),
        ("50%; 30%; 30%", [5 / 11, 3 / 11, 3 / 11]),
        ("1 2 3", [1 / 6, 2 / 6, 3 / 6]),
        ("50/30/20", [0.5, 0.3, 0.2]),
        ("33%, 33%, 33%", [1 / 3, 1 / 3, 1 / 3]),
        ("1 in 3", [1 / 3, 2 / 3]),
        ("3", [1 / 3, 1 / 3, 1 / 3]),
        ("Coin", [0.5, 0.5]),
    ],
)
def test_a_wrong_text_is_corrected(shop: Shop, text: str, meant: list[float]) -> None:
    answer = shop.target({"text": text})
    assert answer["error"]
    corrected = shop.target({"text": answer["fix"]})
    np.testing.assert_allclose(corrected["probabilities"], meant, atol=1e-9)


@settings(deadline=None, max_examples=40)
@given(st.text(max_size=20) | st.text("0123456789%/:,. d", max_size=12))
def test_any_text_gets_an_answer(text: str) -> None:
    answer = Shop().target({"text": text})
    if "error" in answer:
        assert answer["error"]
        assert answer["fix"] is None or "probabilities" in Shop().target({"text": answer["fix"]})
    else:
        assert sum(answer["probabilities"]) == pytest.approx(1.0)
        assert len(answer["labels"]) == len(answer["colors"]) == len(answer["texts"])


def test_labels_that_do_not_fit_are_named(shop: Shop, dice: list[dict[str, Any]]) -> None:
    query = {"die": dice[1]["id"], "dress": {"size_mm": 12, "labels": "own"}}
    with pytest.raises(dd.InputError, match="labels: expected 3, one for each outcome, got 2"):
        shop.dress({**query, "dress": query["dress"] | {"texts": ["a", "b", ""]}})
    with pytest.raises(dd.InputError, match="a different one"):
        shop.dress({**query, "dress": query["dress"] | {"texts": ["a", "b", "a"]}})
    with pytest.raises(dd.InputError, match="a die of at least"):
        shop.dress({**query, "dress": query["dress"] | {"texts": ["extraordinary", "b", "c"]}})


def test_small_details_get_a_larger_size(shop: Shop, dice: list[dict[str, Any]]) -> None:
    query = {"die": dice[1]["id"], "dress": {"size_mm": 16, "style": "raised"}}
    says = shop.printing(query)
    assert says["style"] == "bad"
    larger = {**query, "dress": query["dress"] | {"size_mm": says["size_mm"]}}
    assert shop.printing(larger)["style"] != "bad"
    assert shop.printing({"die": dice[1]["id"], "dress": {}})["style"] == "ok"


@pytest.mark.parametrize("table", [None, pytest.param("board-game", marks=compiled_only)])
def test_throws_have_the_probabilities(
    shop: Shop, dice: list[dict[str, Any]], table: str | None
) -> None:
    query = {"die": dice[1]["id"], "dress": {"labels": "icons"}, "table": table, "seed": 5}
    thrown = shop.throw({**query, "count": 1000})
    counts = np.array(thrown["counts"])
    assert counts.sum() == 1000
    assert chi_square(counts, np.array(PROBABILITIES)).p_value > 1e-3
    assert shop.throw({**query, "count": 1000}) == thrown
    one = shop.throw({**query, "count": 1})
    assert one["counts"][one["outcome"]] == sum(one["counts"]) == 1
    quaternions = np.frombuffer(b64decode(one["motion"]["quaternions"]), "<f4").reshape(-1, 4)
    x, y, z, w = quaternions[-1].tolist()
    # Third row of the rotation matrix.
    up = np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    np.testing.assert_allclose(-up, one["down"], atol=0.05)
    with pytest.raises(dd.InputError, match="count"):
        shop.throw({**query, "count": 0})


def test_counts_are_judged_by_what_is_known(shop: Shop, dice: list[dict[str, Any]]) -> None:
    query = {"die": dice[1]["id"], "dress": {}, "table": "board-game"}

    def style(counts: list[int]) -> str:
        return str(shop.judge({**query, "counts": counts})["style"])

    assert style([0, 0, 0]) == style([3, 2, 1]) == "info"
    assert style([300, 200, 100]) == "ok"
    assert style([330, 170, 100]) == "warn"
    assert style([400, 100, 100]) == "bad"


def test_what_is_there_does_not_wait_for_what_is_made() -> None:
    is_due = threading.Event()
    recent = Recent(lambda key: key if key == "quick" or is_due.wait(60.0) else "late", most=2)
    assert recent.get("quick") == "quick"
    with ThreadPoolExecutor() as pool:
        slow = pool.submit(recent.get, "slow")
        quick = pool.submit(recent.get, "quick")
        try:
            assert quick.result(timeout=20.0) == "quick"
            assert not slow.done()
        finally:
            is_due.set()
        assert slow.result() == "slow"


@compiled_only
def test_rounded_edges_leave_a_symmetric_die_right_when_thrown(shop: Shop) -> None:
    news = list[dict[str, Any]]()
    shop.find_dice({"text": "d7", "count": 1}, news.append, lambda: None)
    query = {"die": news[0]["die"]["id"], "dress": {"edges": "fillet"}}
    forecast = shop.work(query).forecast
    assert forecast is not None
    np.testing.assert_allclose(forecast.probabilities, 1 / 7, atol=2e-3)
    thrown = shop.throw({**query, "table": "board-game", "count": 1000, "seed": 1})
    assert chi_square(np.array(thrown["counts"]), np.full(7, 1 / 7)).p_value > 1e-3


def test_a_design_that_nobody_wants_ends(shop: Shop) -> None:
    news = list[dict[str, Any]]()

    def check() -> None:
        if news:
            raise Stopped

    with pytest.raises(Stopped):
        shop.find_dice({"text": "d10"}, news.append, check)
    assert len(news) == 1
