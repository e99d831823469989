"""What a report says about throws."""

from __future__ import annotations

from typing import Any

import pytest
from common.parsed_html import parsed

from dicedesign.report.pages.die_page import report_html
from dicedesign.report.pages.throws_section import table_sections, throwing_advice
from dicedesign.throws.tables import table_named

IMAGES = {
    "table": b"\x89PNG table",
    "rounds": b"\x89PNG rounds",
    "film": b"\x89PNG film",
    "throw": b"GIF89a throw",
}


@pytest.fixture
def result() -> dict[str, Any]:
    table = table_named("board-game").as_dict()
    table |= {"restitution": 0.5, "friction": 0.3, "height": 0.1, "speed": 0.2, "spin": 10.0}
    return {
        "name": "die",
        "status": "converged",
        "message": "odds are met",
        "labels": ["a", "<b>"],
        "target": [0.25, 0.75],
        "probabilities": [0.5, 0.5],
        "engraved_max_abs_error": 0.25,
        "energy": {},
        "center_of_mass": [0.0, 0.0, 0.0],
        "facets": [],
        "unstable_facets": 0,
        "stages": [],
        "peak_since": "stage",
        "files": {},
        "thrown": {
            "table": table | {"size": 0.0317, "name": "my <table>", "source": "guessed"},
            "momentum": [0.26, 0.74],
            "rounds": [],
            "simulated": {
                "engine": "mujoco",
                "drops": 100100,
                "unresolved": 60,
                "counts": [25500, 74500],
                "frequencies": [0.255, 0.745],
                "intervals": [[0.2523, 0.2577], [0.7423, 0.7477]],
                "total_variation": 0.005,
                "interval": [0.0023, 0.0077],
                "noise_floor": 0.0011,
            },
        },
    }


def text_of(result: dict[str, Any]) -> str:
    return parsed("".join(table_sections(result, {}))).text


def test_the_throw_is_described(result) -> None:
    text = text_of(result)
    for part in (
        "falls from 10 cm above the table",
        "moves sideways at 20 cm a second and spins 1.6 times a second",
        "bounces off with 50 % of its speed; the coefficient of friction is 0.3",
        "31.7 mm across",
        'This is the table "my <table>": guessed.',
    ):
        assert part in text
    result["thrown"]["table"] = table_named("carpet").as_dict()
    text = text_of(result)
    assert "it is set down on the table, turned at random. It does not bounce" in text
    assert "honey" in text
    assert "when it is let go" not in text


def test_the_verdict_is_told_beside_a_perfect_die(result) -> None:
    text = text_of(result)
    for part in (
        "In 100,100 throws that the design had not seen, simulated by MuJoCo, the outcomes'",
        "total variation of 0.0050",
        "A perfect die would show 0.0011",
        "off by 0.0023 to 0.0077",
        "60 throws did not come to rest",
        "40 came to rest on a facet without a label",
    ):
        assert part in text
    result["thrown"]["simulated"] |= {"interval": [0.0, 0.004], "unresolved": 0, "drops": 100000}
    text = text_of(result)
    assert "do not tell it from a perfect one" in text
    assert "off by at most 0.0040" in text
    assert "did not come to rest" not in text
    assert "without a label" not in text


def test_odds_are_listed(result) -> None:
    cells = parsed("".join(table_sections(result, {}))).cells
    row = ["<b>", "75.00", "50.00", "74.00", "74.50", "74.23 to 74.77"]
    assert cells[6:] == row
    del result["thrown"]["simulated"]
    assert parsed("".join(table_sections(result, {}))).cells[4:] == row[:4]
    assert "No throws of it were simulated" in text_of(result)
    del result["thrown"]["momentum"]
    assert parsed("".join(table_sections(result, {}))).cells[3:] == row[:3]


def test_pictures_are_embedded_as_what_they_are(result) -> None:
    page = parsed("".join(table_sections(result, IMAGES)))
    kinds = [source.split(";")[0] for source in page.sources]
    assert kinds == ["data:image/png", "data:image/png", "data:image/gif", "data:image/png"]
    assert len(parsed("".join(table_sections(result, {"throw": b"GIF89a"}))).sources) == 1


def test_the_report_of_a_die_to_be_thrown(result) -> None:
    text = report_html(result, {**IMAGES, "bars": b"\x89PNG", "views": b"\x89PNG"})
    page = parsed(text)
    # Without that of the odds that the die is not meant to have.
    assert len(page.sources) == 5
    assert "Target and achieved odds" not in page.text
    assert "with the labels cut in" not in page.text
    assert "On the table" in page.text
    assert "Set it down gently" not in page.text
    assert "let it fall from about 10 cm above the table, with a little push and spin" in page.text
    del result["thrown"]
    page = parsed(report_html(result, {"bars": b"\x89PNG"}))
    assert "On the table" not in page.text
    assert "Set it down gently" in page.text
    assert "Thrown it has others; the command dicedesign throw shows" in page.text
    assert "Target and achieved odds" in page.text


@pytest.mark.parametrize(
    ("table", "advice"),
    [
        ("carpet", "Set it down on the table"),
        ("paper", "let it fall from about 10 cm above the table, each time from another"),
    ],
)
def test_advice_for_gentle_tables(table: str, advice: str) -> None:
    assert advice in throwing_advice(table_named(table).as_dict())
