"""The page of convex, thrown and reshaped dice."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from typing import Any

import pytest
from common.finished import finished_box
from common.parsed_html import Checker, parsed

from dicedesign.report.figures.figure import FIGURES
from dicedesign.report.pages.die_page import die_page
from dicedesign.report.pages.throwing import throwing_advice, throws_told
from dicedesign.results.parts import (
    Concave,
    Displacement,
    HullOfSurface,
    SimulatedThrows,
    SurfaceSize,
    ThrownOdds,
)
from dicedesign.results.result import Designed, Result
from dicedesign.throws.tables import Table, table_named

PNG = b"\x89PNG"
RESHAPED = {
    "concave": Concave(
        probabilities_before=(0.125,) * 6,
        elsewhere_before=0.25,
        displacement=Displacement(0.0312, 0.115),
        hull=HullOfSurface(430, 363, 3.2e-6),
        surface=SurfaceSize(3301, 6598),
        quality=("No two triangles <cross>.", "No triangle is inverted."),
        surface_quality={},
        self_intersections=0,
    ),
    "design": Designed(0.1),
    "rest_counts": (3, 1, 1, 1, 1, 17),
    "notes": ("7 vertices were welded",),
}
THROWN = ThrownOdds(
    table_named("board-game").as_dict()
    | {"restitution": 0.5, "friction": 0.3, "height": 0.1, "speed": 0.2, "spin": 10.0}
    | {"size": 0.0317, "name": "my <table>", "source": "guessed"},
    (0.16, 0.16, 0.16, 0.16, 0.16, 0.2),
    (),
    SimulatedThrows(
        "mujoco",
        1,
        100_100,
        60,
        (16_000, 16_000, 16_000, 16_000, 16_000, 20_000),
        (0.16, 0.16, 0.16, 0.16, 0.16, 0.2),
        ((0.158, 0.162),) * 6,
        0.005,
        (0.0023, 0.0077),
        0.0011,
    ),
)


def result(**changes: Any) -> Result:
    return finished_box(**changes).result


def page_of(images: dict[str, bytes] | None = None, **changes: Any) -> Checker:
    return parsed(die_page(result(**changes), images or {}))


def test_a_convex_die() -> None:
    images = dict.fromkeys(("bars", "convergence", "gauss_map", "views", "faces"), PNG)
    page = page_of(images)
    assert len(page.sources) == 5
    assert ("<6>", "16.667") in zip(page.cells, page.cells[1:], strict=False)
    assert {"start", "0.50", "301.2", "-", "smoothness & size", "0.25"} <= set(page.cells)
    for text in (
        "off_target: max |p - q| is 0.1 & more",
        *(FIGURES[name].title for name in images),
        *(FIGURES[name].caption for name in images),
        "held during the stage,",
        "its other 0",
        "(0.000, 1.500, -2.000) mm",
        "die_plain: die_plain.stl",
        "100 % infill",
        "the face down",
        "Set it down gently",
        "Thrown it has others; the command dicedesign throw shows by how much.",
    ):
        assert text in page.text
    for absent in ("On the table", "Measures", "Notes", "Quality of the surface"):
        assert absent not in page.text


def test_a_die_that_keeps_a_shape() -> None:
    names = ("rests", "before_after", "odds", "hull", "displacement", "energy")
    page = page_of(dict.fromkeys(names, PNG), **RESHAPED)
    assert len(page.sources) == 6
    at = page.cells.index("elsewhere")
    assert page.cells[at : at + 5] == ["elsewhere", "-", "25.000", "0.000", "-"]
    for text in (
        "3.12 % of the diagonal",
        "11.5 % of the diagonal",
        "3.2e-06 of the diagonal",
        "430",
        "6598",
        "No two triangles <cross>.",
        "7 vertices were welded",
        "the side that the die lies on",
    ):
        assert text in page.text
    assert "Facets" not in page.text
    order = [FIGURES[name].title for name in names]
    order += ["Quality of the surface", "Measures", "Notes", "Stages", "Files"]
    places = [page.text.index(title) for title in order]
    assert places == sorted(places)
    assert "cut into the side that is up" not in page.text
    marked = page_of(**RESHAPED, files={"die": "die.stl", "die_plain": "die_plain.stl"})
    assert "cut into the side that is up" in marked.text


def test_a_die_to_be_thrown() -> None:
    images = dict.fromkeys(("bars", "table", "rounds", "film", "views"), PNG) | {"throw": b"GIF89a"}
    page = page_of(images, thrown=THROWN)
    # Without the bars of odds that the die is not meant to have.
    assert len(page.sources) == 5
    assert FIGURES["bars"].title not in page.text
    assert sum(source.startswith("data:image/gif;") for source in page.sources) == 1
    assert "158" not in page.text
    assert "15.80 to 16.20" in page.cells
    for text in (
        "falls from 10 cm above the table",
        "moves sideways at 20 cm a second and spins 1.6 times a second",
        "bounces off with 50 % of its speed; the coefficient of friction is 0.3",
        "31.7 mm across",
        'This is the table "my <table>": guessed.',
        "In 100,100 throws that the design had not seen, simulated by MuJoCo, the outcomes'",
        "total variation of 0.0050",
        "A perfect die would show 0.0011",
        "off by 0.0023 to 0.0077",
        "60 throws did not come to rest",
        "40 came to rest on a facet without a label",
        "let it fall from about 10 cm above the table, with a little push and spin",
    ):
        assert text in page.text


def test_throws_that_tell_no_difference_and_none_at_all() -> None:
    assert THROWN.simulated is not None
    even = replace(THROWN.simulated, interval=(0.0, 0.004), unresolved=0, drops=100_000)
    text = page_of(thrown=replace(THROWN, simulated=even)).text
    assert "do not tell it from a perfect one" in text
    assert "off by at most 0.0040" in text
    assert "did not come to rest" not in text
    assert "without a label" not in text
    text = page_of(thrown=replace(THROWN, simulated=None)).text
    assert "No throws of it were simulated" in text
    text = page_of(thrown=replace(THROWN, table=table_named("carpet").as_dict())).text
    assert "it is set down on the table, turned at random. It does not bounce" in text
    assert "honey" in text
    assert "when it is let go" not in text


@pytest.mark.parametrize(
    ("table", "advice"),
    [
        ("carpet", "Set it down on the table"),
        ("paper", "let it fall from about 10 cm above the table, each time from another"),
    ],
)
def test_advice_for_gentle_tables(table: str, advice: str) -> None:
    assert advice in throwing_advice(replace(THROWN, table=table_named(table).as_dict()))


def test_throws_of_many_heights_and_spins() -> None:
    table = {**THROWN.table, "height": [0.05, 0.2], "speed": [0.0, 1.2], "spin": [2 * pi, 9 * pi]}
    thrown = replace(THROWN, table=table)
    assert "let it fall from 5 to 20 cm above" in throwing_advice(thrown)
    manner, _ = throws_told(thrown)
    assert "falls from 5 to 20 cm above the table, turned at random" in manner
    assert "moves sideways at 0 to 1.2 m a second and spins 1 to 4.5 times a second" in manner
    assert "of a range, each throw has a value of its own" in manner
    assert "of a range" not in throws_told(THROWN)[0]


def test_throws_by_a_named_hand() -> None:
    table = Table(**THROWN.table).thrown_by("cup")
    thrown = replace(THROWN, table=table.as_dict())
    assert throwing_advice(thrown).startswith("Throw it out of a cup: let it fall from 5 to 12 cm")
    manner, _ = throws_told(thrown)
    assert "are for throws out of a cup, in which it falls from 5 to 12 cm above" in manner
    assert 'the table "my <table>:cup": guessed; out of a cup, chosen, not measured' in manner


@pytest.mark.parametrize("changes", [{}, RESHAPED, {"thrown": THROWN}])
def test_pages_need_nothing_else_and_escape(changes: dict[str, Any]) -> None:
    images = {figure.name: PNG for figure in FIGURES}
    text = die_page(result(**changes), images)
    for part in ("http:", "https:", "<script", "<link", "<6>", "<cross>", "<table>:"):
        assert part not in text
    assert "<title>a &lt; box</title>" in text
    assert 'name="viewport"' in text
    assert all(source.startswith("data:image/") for source in parsed(text).sources)
    assert text == die_page(result(**changes), images)


def test_memory_since_the_start_is_said_so() -> None:
    assert "held from its start to the end of the stage," in page_of(peak_since="start").text


@pytest.mark.parametrize("name", FIGURES.names)
def test_figures_that_are_absent_leave_their_section_out(name: str) -> None:
    assert FIGURES[name].caption in page_of({name: PNG}).text
    assert FIGURES[name].caption not in page_of().text


def test_a_page_runs_no_script_and_loads_nothing() -> None:
    """Its policy stands before anything that could."""
    page = die_page(result(), {})
    policy = page.index("Content-Security-Policy")
    assert policy < page.index("<title>")
    assert "default-src 'none'" in page[policy:]
    assert "<script" not in page
