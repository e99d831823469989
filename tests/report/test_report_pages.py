"""Pages of dice: what they say, and the die that turns with its table and its map."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.machinery import ModuleSpec
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from common.finished import CONCAVE, finished_box, finished_result, page_text
from common.made_up_die import SIDES, box, run_to_check
from common.parsed_html import Checker, parse_page
from manifold3d import Manifold
from pygltflib import GLTF2

from dicedesign.errors import InputError
from dicedesign.fabricate.die import FinishedDie
from dicedesign.fabricate.file_formats import Part
from dicedesign.geometry.triangles import Surface, doubled_area_vectors
from dicedesign.palette import BLANK, outcome_colors, text_color
from dicedesign.recipe.output import make_finished_die
from dicedesign.recipe.pipeline import run_stages
from dicedesign.report import colored_die, pages
from dicedesign.report.colored_die import color_parts, shown_rests
from dicedesign.report.figures import FIGURES
from dicedesign.report.pages import three_script, throwing_advice
from dicedesign.report.raster import encode_png
from dicedesign.results.parts import (
    READINGS,
    Draft,
    Search,
    SimulatedThrows,
    Status,
    TableResult,
    ThrowForecast,
    TradeOff,
)
from dicedesign.results.print_parts import PrintedLabel
from dicedesign.results.result import Designed, Engraved
from dicedesign.results.verdict import judge
from dicedesign.throws.tables import load_table

PNG = encode_png(np.full((4, 6, 3), 255, dtype=np.uint8))
RESHAPED = {
    "concave": CONCAVE,
    "design": Designed(0.1),
    "rest_counts": (3, 1, 1, 1, 1, 17),
    "notes": ("7 vertices were welded",),
}
SIXTH = (1.0 / 6.0,) * 6
THROWS = SimulatedThrows(
    "native",
    1,
    100_100,
    60,
    (16_000, 16_000, 16_000, 16_000, 16_000, 20_000),
    (0.16, 0.16, 0.16, 0.16, 0.16, 0.2),
    ((0.158, 0.162),) * 6,
    0.005,
    (0.0023, 0.0077),
    0.0011,
)
THROWN = TableResult(
    load_table("board-game").as_dict()
    | {"restitution": 0.5, "friction": 0.3, "height": 0.1, "speed": 0.2, "spin": 10.0}
    | {"size": 0.0317, "name": "my <table>", "source": "guessed"},
    (0.16, 0.16, 0.16, 0.16, 0.16, 0.2),
    (),
    THROWS,
)


@pytest.fixture(autouse=True)
def small_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw the die on few pixels; pages do not differ otherwise."""
    monkeypatch.setattr(colored_die, "MIN_PIXELS", 40)
    monkeypatch.setattr(pages, "DIE_PIXELS", 40)


def page_of(images: dict[str, bytes] | None = None, **changes: Any) -> Checker:
    return parse_page(page_text(finished_box(**changes), images))


def on_table(**entries: Any) -> dict[str, Any]:
    """Thrown die with other entries of its table."""
    return {"thrown": replace(THROWN, table={**THROWN.table, **entries})}


@pytest.mark.parametrize(
    ("changes", "shown", "absent"),
    [
        (
            {},
            ["max |p - q| is 0.1 & more", "(0.000, 1.500, -2.000) mm", "die_plain.stl", "2.25"],
            ["On the table", "Measures", "Notes", "Quality of the surface", "Attempts"],
        ),
        (
            RESHAPED,
            ["3.12 %", "11.5 %", "3.2e-06", "430", "6598", "<cross>", "7 vertices were welded"],
            ["Facets", "cut into the side that is up"],
        ),
        ({**RESHAPED, "files": {"die": "die.stl"}}, ["cut into the side that is up"], []),
        (
            {"thrown": THROWN},
            ["10 cm", "20 cm a second", "1.6 times", "50 %", "31.7 mm", "my <table>", "100,100"],
            ["158", "from a range"],
        ),
        (
            {"thrown": THROWN},
            ["0.0050", "0.0011", "0.0023 to 0.0077", "60 throws", "40 came to rest"],
            [],
        ),
        (
            {"thrown": replace(THROWN, simulated=replace(THROWS, interval=(0.0, 0.004)))},
            ["at most 0.0040"],
            [],
        ),
        ({"thrown": replace(THROWN, simulated=None)}, ["No throws"], ["100,100"]),
        (on_table(**load_table("carpet").as_dict()), ["honey"], ["at release"]),
        (
            on_table(height=[0.05, 0.2], speed=[0.0, 1.2], spin=[2 * pi, 9 * pi]),
            ["5 to 20 cm", "0 to 1.2 m a second", "1 to 4.5 times", "from a range"],
            [],
        ),
    ],
)
def test_a_page_shows_what_the_die_has(
    changes: dict[str, Any], shown: list[str], absent: list[str]
) -> None:
    text = page_of(**changes).text
    assert [part for part in shown if part not in text] == []
    assert [part for part in absent if part in text] == []


def row_of(cells: list[str], name: str, count: int) -> list[str]:
    """Cells after one with a name."""
    at = cells.index(name)
    return cells[at + 1 : at + 1 + count]


def test_tables_have_their_values() -> None:
    assert row_of(page_of().cells, "<6>", 1) == ["16.667"]
    assert row_of(page_of(**RESHAPED).cells, "elsewhere", 4) == ["-", "25.000", "0.000", "-"]
    assert "15.80 to 16.20" in page_of(thrown=THROWN).cells
    assert "5 to 20 cm" in throwing_advice(on_table(height=[0.05, 0.2])["thrown"])


def test_a_page_has_the_figures_that_were_drawn() -> None:
    """Thrown dice without the bars of probabilities that they are not meant to have."""
    text = page_of().text
    for name in FIGURES.names:
        assert FIGURES[name].caption in page_of({name: PNG}).text
        assert FIGURES[name].caption not in text
    page = page_of({"bars": PNG, "table": PNG, "throw": b"GIF89a"}, thrown=THROWN)
    assert [source[:15] for source in page.sources].count("data:image/gif;") == 1
    # The third shows the die.
    assert len(page.sources) == 3


@pytest.mark.parametrize("changes", [{}, RESHAPED, {"thrown": THROWN}])
def test_pages_need_nothing_else_and_escape(changes: dict[str, Any]) -> None:
    images = {figure.name: PNG for figure in FIGURES}
    text = page_text(finished_box(**changes), images)
    for part in ("http:", "https:", "<link", "<6>", "<cross>", "<table>:"):
        assert part not in text
    assert "<title>a &lt; box</title>" in text
    assert all(source.startswith("data:image/") for source in parse_page(text).sources)
    assert text == page_text(finished_box(**changes), images)


def attempts(drafts: tuple[Draft, ...], attempt: int | None = None) -> list[str]:
    """Cells of the page of a search with goals."""
    search = Search(40, None, attempt, TradeOff(0.005, 45.0, 10.0, 0.03, drafts))
    return page_of(concave=CONCAVE, search=search).cells


def test_the_best_attempts_are_listed_and_the_die_first() -> None:
    """Even attempts have the probabilities to the tolerance, the larger the number the farther they
    were moved; the third has become the die."""
    drafts = tuple(
        Draft(k, 1.5, 0.1, 0.01 * k, 50.0, 12.0, 0)
        if k % 2
        else Draft(
            k, None if k == 2 else 1.5, 0.001 + 0.001 * (k % 4 == 0), 0.01 * k, 50.0, 12.0, 0, 0.01
        )
        for k in range(1, 31)
    )
    listed, columns = attempts(drafts, 3), 9
    at = listed.index("3, this die")
    rows = [listed[at + columns * k : at + columns * (k + 1)] for k in range(12)]
    assert [row[0] for row in rows[1:]] == [str(2 * k) for k in range(1, 12)]
    assert rows[0][1:8] == ["3.00", "1.0e-01", "50.0", "12.0", "0", "-", "1.5"]
    assert rows[1][1:8] == ["2.00", "1.0e-03", "50.0", "12.0", "0", "0.01", "-"]
    assert "24" not in listed
    # Goals beside results.
    for goal, values in (
        ("at most 0.005", ["0.25", "0.05"]),
        ("at least 45°", ["-", "90.0°"]),
        ("at least 10°", ["-", "45.0°"]),
    ):
        assert row_of(attempts(()), goal, 2) == values
    with pytest.raises(InputError, match="concave"):
        finished_box().result.error_before  # noqa: B018


def printed_box(*sides: float, **entries: Any) -> FinishedDie:
    work = run_to_check(box(*sides), SIDES, entries=entries)
    run_stages(work, after="check", last="tolerances")
    return make_finished_die(work)


def test_a_page_has_the_measures_of_the_print() -> None:
    print_options = {"printer": "sla", "infill": 0.2, "walls_mm": 1.0}
    die = printed_box(1.0, 1.1, 1.2, engrave=True, print=print_options)
    facts, tolerances = die.result.printability, die.result.tolerances
    page = parse_page(page_text(die))
    for text in (f"{facts.weight_g:.3g} g", tolerances.answer, die.result.infill.advice):
        assert text in page.text
    assert "solid of one material" not in page.text
    for label in facts.labels:
        assert {label.text, f"{label.wall_mm:.2g}"} <= set(page.cells)
    for values in (tolerances.deviations, *tolerances.by_error.values()):
        assert {f"{100.0 * value:.3f}" for value in values} <= set(page.cells)
    # Missing values are dashes.
    concave = replace(
        facts,
        smallest_facet=None,
        labels=(PrintedLabel("<7>", None, None, None),),
        best=replace(facts.best, overhang_mm2=12.34, support_mm3=3.14, label="<7>"),
        file=replace(facts.file, open_edges=3),
    )
    page = parse_page(page_text(replace(die, result=replace(die.result, printability=concave))))
    assert row_of(page.cells, "<7>", 3) == ["-"] * 3
    for part in ("12.3 mm²", "3 mm³", "3 open edges"):
        assert part in page.text


# The die that turns.


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


def is_label(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(t,) whether a triangle is in the pocket of `with_pocket`."""
    return (np.abs(points[triangles].mean(axis=1)) < EXTENTS / 2.0 - 1e-6).all(axis=1)


@pytest.mark.parametrize("reading", ["down", "up"])
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", [-1, 1])
def test_an_engraved_facet_shows_the_outcome_that_is_read_on_it(
    axis: int, side: int, reading: str
) -> None:
    """Of the rest on it, or of the rest on the opposite facet for a die that is read on top."""
    points, triangles = with_pocket(side, axis)
    result = finished_box(engraved=Engraved(reading=READINGS[reading])).result
    labels, sign = is_label(points, triangles), {"down": 1, "up": -1}[reading]
    assert labels.sum() >= 10
    shown = shown_rests(Surface(points, triangles), labels, result, points)
    normals = sign * np.array([facet.normal for facet in result.facets])[shown]
    assert (normals[labels] == side * np.eye(3)[axis]).all()
    outward = doubled_area_vectors(points, triangles)[~labels]
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    np.testing.assert_allclose(normals[~labels], outward, atol=1e-6)


def test_parts_hold_each_triangle_once_in_the_color_of_its_outcome() -> None:
    """An inlay belongs to the facet that it fills."""
    points, triangles = with_pocket(1, 2)
    result = finished_box().result
    labels = is_label(points, triangles)
    corners = np.array([[2.0, 2.0, 9.5], [-2.0, 2.0, 9.5], [0.0, -2.0, 9.5]])
    inlay = Part(corners, np.array([[0, 1, 2]]), "labels", "#222222")
    parts = color_parts([Part(points, triangles, "die", "#123456", labels), inlay], result)
    middles = np.concatenate([part.points[part.triangles].mean(axis=1) for part in parts])
    expected = np.concatenate([points[triangles].mean(axis=1), corners.mean(axis=0)[None]])
    np.testing.assert_allclose(middles[np.lexsort(middles.T)], expected[np.lexsort(expected.T)])
    colors = dict(zip(result.labels, outcome_colors(6), strict=True))
    for part in parts:
        kind, _, rest = part.name.partition("-")
        color = colors[str(result.facets[int(rest)].outcome)]
        assert part.color == (text_color(color) if kind == "labels" else color)
    up = [facet.normal[2] > 0.5 for facet in result.facets].index(True)
    marked = [part for part in parts if part.name == f"labels-{up}"]
    assert [len(part.triangles) for part in marked] == [labels.sum(), 1]


def test_around_the_corner_on_top_all_is_in_one_color() -> None:
    """Each outcome of a tetrahedron has a third of each of three faces."""
    corners = np.array([(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)])
    faces = np.array([(1, 3, 2), (0, 2, 3), (0, 3, 1), (0, 1, 2)])
    facets = [(str(k), tuple(-corners[k] / np.sqrt(3.0))) for k in range(4)]
    result = finished_result([str(k) for k in range(4)], [0.25] * 4, facets)
    result = replace(result, engraved=Engraved(reading=READINGS["corner"]))
    parts = color_parts([Part(corners, faces, "die", BLANK)], result)
    assert sorted(part.name for part in parts) == [f"facet-{k}" for k in range(4)]
    for part in parts:
        area = areas(part.points[part.triangles]).sum()
        nearest = np.argmax(part.points[part.triangles].mean(axis=1) @ corners.T, axis=1)
        assert (nearest == int(part.name[-1])).all()
        assert area == pytest.approx(np.sqrt(3.0) / 4.0 * 8.0)


def test_only_parts_of_a_shape_that_touch_the_table_belong_to_a_rest() -> None:
    """The box with a deep dent in place of one side rests there too, on its rim."""
    die = finished_box(concave=CONCAVE)
    corners = np.asarray(die.plain.poses.hull.vertices)
    sides = die.plain.poses.hull.triangles.tolist()
    top = [side for side in sides if (corners[side, 2] > 9.0).all()]
    rim = [7, 8] * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    points = np.concatenate([corners, [[0.0, 0.0, 2.0]], np.column_stack([rim, [10.0] * 4])])
    fan = [(9 + k, 9 + (k + 1) % 4, 8) for k in range(4)]
    triangles = np.array([side for side in sides if side not in top] + fan)
    labels = np.zeros(len(triangles), bool)
    shown = shown_rests(Surface(points, triangles), labels, die.result, points)
    assert (shown[-4:] == -1).all()
    assert len(set(shown[:-4].tolist())) == 5
    parts = color_parts([Part(points, triangles, "a", "")], die.result)
    assert [part.color for part in parts if part.name == "body"] == [BLANK]


@pytest.mark.parametrize(
    ("changes", "marks"),
    [
        ({"status": "converged", "max_abs_error": 1e-9}, ("good", "caution")),
        ({"max_abs_error": 0.1}, ("not yet", "caution")),
        ({"status": "unsteady", "max_abs_error": 1e-9}, ("caution", "caution")),
        ({"status": "converged", "thrown": THROWN}, ("caution", "good")),
        ({"status": "off_table", "thrown": THROWN, "max_abs_error": 0.0}, ("good", "not yet")),
        ({"status": "converged", "forecast": (0.005, SIXTH)}, ("good", "good")),
        ({"status": "converged", "forecast": (0.3, (0.4, *SIXTH[1:]))}, ("good", "caution")),
    ],
)
def test_a_die_has_a_verdict_for_each_way_to_roll_it(
    changes: dict[str, Any], marks: tuple[str, str]
) -> None:
    result = finished_box().result
    known: dict[str, Any] = {"max_abs_error": 0.1 if "thrown" in changes else 0.0, **changes}
    if "forecast" in known:
        off, probabilities = known["forecast"]
        known["forecast"] = ThrowForecast("board-game", probabilities, off, off)
    set_down, thrown = judge(replace(result, **known))
    assert (set_down.mark.value, thrown.mark.value) == marks
    # Of the text of a status, a sentence has the flaw and not the advice.
    flaw, _, _ = Status[known.get("status", "converged").upper()].value.partition(";")
    assert (flaw in set_down.sentence) == (known.get("status") == "unsteady")
    assert ";" not in set_down.sentence + thrown.sentence


def test_a_trimesh_without_its_viewer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = ModuleSpec("trimesh", None, origin=str(tmp_path / "__init__.py"))
    monkeypatch.setattr(pages, "find_spec", lambda _: spec)
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


def areas(corners: np.ndarray) -> np.ndarray:
    """Areas (t,) of triangles with corners (t, 3, 3)."""
    sides = corners[:, 1:] - corners[:, :1]
    return 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)


def test_table_map_and_solid_have_the_same_facets(fair_d3: Path) -> None:
    """The solid is the one of die.stl; what shows an outcome is on top when the die rests so."""
    page = parse_page((fair_d3 / "report.html").read_text("utf-8"))
    assert b"MIT" in page.unpack("three")[:200]
    data = page.unpack("solid")
    nodes = {node.name: k for k, node in enumerate(GLTF2.load_from_bytes(data).nodes)}
    corners = {name: gltf_triangles(data, node) for name, node in nodes.items()}
    whole = np.concatenate(list(corners.values()))
    volume = (whole[:, 0] * np.cross(whole[:, 1], whole[:, 2])).sum() / 6.0
    solid = trimesh.load(fair_d3 / "die.stl")
    assert volume == pytest.approx(solid.volume, rel=1e-6)
    assert areas(whole).sum() == pytest.approx(solid.area, rel=1e-6)

    facets = json.loads((fair_d3 / "result.json").read_text())["facets"]
    numbers = [str(k) for k in range(len(facets))]
    assert sorted(page.facets("tr")) == numbers
    assert page.facets("path") == 2 * numbers
    assert set(nodes) == {"body"} | {f"{part}-{k}" for k in numbers for part in ("facet", "labels")}
    rows = {a["data-facet"]: a for a in page.tagged("tr") if "data-facet" in a}
    for number, facet in zip(numbers, facets, strict=True):
        row, normal = rows[number], np.array(facet["normal"])
        np.testing.assert_allclose(np.array(row["data-down"].split(), float), normal, atol=1e-5)
        np.testing.assert_allclose(np.array(row["data-side"].split(), float), -normal, atol=1e-5)
        own, heights = corners[f"facet-{number}"], float(row["data-height"]) - whole @ normal
        assert 0.7 * facet["polygon_area_mm2"] < areas(own).sum() <= facet["polygon_area_mm2"]
        for part in (own, corners[f"labels-{number}"]):
            assert (float(row["data-height"]) - part @ normal).min() > 0.4 * heights.max()


def test_a_large_solid_is_left_out_and_table_and_map_are_linked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pages, "MAX_TRIANGLES", 10)
    page = parse_page(page_text(finished_box(), {"gauss_map": PNG}))
    assert page.tagged("canvas") == []
    numbers = [str(k) for k in range(6)]
    assert sorted(page.facets("tr")) == numbers
    assert page.facets("path") == 2 * numbers
    assert set(page.packed) == {""}
