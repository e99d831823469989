"""The way from a wish to a file on the page, in a browser: what a person sees and gets."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from common.die_page import DiePage
from common.finished import box_file
from common.kernels import compiled_only

import dicedesign as dd
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.poses import rest_poses

SIZES = {"laptop": (1280, 800), "desktop": (1920, 1080), "phone": (390, 844)}

FULL = pytest.mark.full

Open = Callable[..., DiePage]


def check_die_is_large(opened: DiePage) -> None:
    """The die is in the middle of what no panel covers, and fills most of it."""
    left, top, right, bottom = opened.die_box()
    assert max(right - left, bottom - top) > 0.45
    assert left > 0.02
    assert right < 0.98
    assert abs(left + right - 1.0) < 0.25


def check_nothing_overlaps(opened: DiePage) -> None:
    """Brand, steps, tools, panel and caption are beside each other."""
    names = (".brand", "#steps", ".tools", "#title", "#body", ".foot", "#caption")
    boxes = [opened.page.locator(name).bounding_box() for name in names]
    for k, a in enumerate(boxes):
        assert a is not None
        for b in boxes[:k]:
            assert b is not None
            width = min(a["x"] + a["width"], b["x"] + b["width"]) - max(a["x"], b["x"])
            height = min(a["y"] + a["height"], b["y"] + b["height"]) - max(a["y"], b["y"])
            assert min(width, height) <= 0.5, (a, b)


@compiled_only
@pytest.mark.parametrize(
    "name", ["phone", *(pytest.param(name, marks=FULL) for name in ("laptop", "desktop"))]
)
def test_the_way_to_a_file(open_page: Open, tmp_path: Path, name: str) -> None:
    """Type, pick, dress, try, take; each step looks right, and the file has the probabilities."""
    opened = open_page(size=SIZES[name], dark=name == "desktop")
    page = opened.page
    check_die_is_large(opened)
    opened.check_looks()
    check_nothing_overlaps(opened)
    page.fill("#target", "25%, 25%, 20%")
    page.press("#target", "Enter")
    error = page.wait_for_selector("#target-error:not([hidden])")
    assert error is not None
    field = page.locator("#target").bounding_box()
    box = error.bounding_box()
    assert field is not None
    assert box is not None
    assert 0.0 <= box["y"] - field["y"] - field["height"] < 16.0
    opened.check_looks()
    page.click("#target-error button")
    page.wait_for_selector("#target-error", state="hidden")
    assert page.input_value("#target") == "25%, 25%, 20%, 30%"
    one = json.dumps({"text": "1/2, 1/3, 1/6", "count": 1})
    page.route("**/dice", lambda route: route.continue_(post_data=one))
    page.fill("#target", "1/2, 1/3, 1/6")
    opened.next()
    page.wait_for_selector(".candidate")
    opened.next()
    assert opened.text("#title") == "Dress it"
    opened.choose("labels", "icons")
    opened.choose("edges", "fillet")
    page.wait_for_selector("#print-verdict.ok")
    check_die_is_large(opened)
    opened.check_looks()
    opened.next()
    assert [label for label, _ in opened.tally()] == ["heart", "star", "bolt"]
    page.click("#throw-one")
    page.wait_for_selector("#result:not([hidden])")
    shown = opened.text("#result .chip")
    assert dict(opened.tally())[shown].startswith("1 ")
    page.click("#throw-many:not([disabled])")
    page.wait_for_selector("#tally-verdict.ok, #tally-verdict.warn")
    assert sum(int(count.split()[0]) for _, count in opened.tally()) == 101
    throws = [value for path, value in opened.posts if path == "/throw"]
    assert [one["table"] for one in throws] == [page.input_value("#table")] * 2
    opened.check_looks()
    opened.next()
    opened.check_looks()
    poses = rest_poses(read_body(opened.download("stl", tmp_path)))
    np.testing.assert_allclose(poses.probabilities, 1 / 6, atol=1e-8)
    assert opened.download("3mf", tmp_path).stat().st_size > 1000
    assert "heart" in opened.download("yaml", tmp_path).read_text()
    opened.check()


@compiled_only
@FULL
def test_fields_and_die_are_one_state(open_page: Open) -> None:
    """Nobody gets a die, a count or a step of an earlier choice, however fast the clicks."""
    opened = open_page()
    page = opened.page
    one = json.dumps({"text": "1/2, 1/3, 1/6", "count": 1})
    page.route("**/dice", lambda route: route.continue_(post_data=one))
    page.fill("#target", "1/2, 1/3, 1/6")
    opened.next()
    page.wait_for_selector(".candidate")
    opened.next()
    page.wait_for_selector("#next:not([disabled])")
    opened.posts.clear()
    for labels in ("letters", "pips", "letters", "pips", "letters", "pips", "icons"):
        opened.choose("labels", labels)
    opened.next()
    assert [label for label, _ in opened.tally()] == ["heart", "star", "bolt"]
    dressed = [value["dress"] for path, value in opened.posts if path == "/dress"]
    assert len(dressed) < 7
    assert dressed[-1] == {"labels": "icons"}
    # A throw that nobody watches is counted, and the next one is free.
    page.click("#throw-many")
    opened.next()
    page.click("#back")
    page.wait_for_selector("#throw-many:not([disabled])")
    opened.until(lambda: sum(int(count.split()[0]) for _, count in opened.tally()) == 100)
    # Another size is another die.
    page.click("#back")
    page.fill("#size", "45")
    opened.next()
    assert opened.text("#caption").endswith("45 mm")
    assert [count for _, count in opened.tally()] == ["50 %", "33 %", "17 %"]
    # A die that cannot be dressed has no later steps.
    page.click("#back")
    page.route("**/dress", lambda route: route.abort())
    opened.choose("edges", "fillet")
    page.wait_for_selector("#print-verdict.bad")
    assert page.is_disabled("#next")
    assert page.is_disabled("#steps li:nth-child(5) button")
    page.unroute("**/dress")
    opened.choose("edges", "sharp")
    page.wait_for_selector("#next:not([disabled])")
    # Nor has a target without dice; this request gets no answer.
    page.unroute("**/dice")
    page.route("**/dice", lambda _: None)
    page.click("#steps li:first-child button")
    page.fill("#target", "d4")
    opened.next()
    page.wait_for_selector("#progress:not([hidden])")
    assert opened.text("#caption") == ""
    assert page.is_disabled("#steps li:nth-child(5) button")
    opened.check()


@FULL
def test_two_tabs_are_two_sessions(open_page: Open) -> None:
    opened = open_page()
    other = DiePage.open(opened.served, opened.page.context)
    for one, text in ((opened, "1/2, 1/3, 1/6"), (other, "d4")):
        one.page.fill("#target", text)
        one.next()
    for one in (opened, other):
        one.page.wait_for_selector(".candidate")
        one.next()
    assert opened.text("#caption").startswith("6 faces")
    assert other.text("#caption").startswith("4 faces")
    for one, text in ((opened, "1/2, 1/3, 1/6"), (other, "d4")):
        one.page.click("#steps li:nth-child(2) button")
        assert one.text("#title") == f"Dice for {text}"
        one.check()
    # Designs end with their pages.
    other.page.close()
    opened.page.close()
    for thread in threading.enumerate():
        if thread.name == "design":
            thread.join(timeout=60.0)
            assert not thread.is_alive()


def test_a_mesh_is_opened_dragged_and_started_over(open_page: Open, tmp_path: Path) -> None:
    sides = np.array([1.0, 1.5, 2.0])
    box_file(tmp_path, tuple(sides.tolist()), "box.obj")
    opened = open_page(tmp_path / "box.obj")
    page = opened.page
    assert opened.text("#title") == "box.obj"
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * sides / 2.0
    before = opened.tally("body-rows")
    expected = dd.rest_poses(corners).probabilities
    np.testing.assert_allclose(sorted(percents(before)), np.sort(expected), atol=1e-4)
    opened.check_looks()
    opened.choose("drag", "center")
    left, top, right, bottom = opened.die_box()
    panel = page.locator("#panel").bounding_box()
    assert panel is not None
    middle = 0.5 * (left + right) * panel["x"], 60.0 + 0.5 * (top + bottom) * 740.0
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(middle[0] + 40.0, middle[1], steps=3)
    page.mouse.up()
    opened.until(lambda: opened.tally("body-rows") != before)
    page.wait_for_timeout(500.0)
    center = np.array([float(page.input_value(f"#center-{axis}")) for axis in "xyz"])
    assert np.abs(center).max() > 0.05
    np.testing.assert_allclose(
        sorted(percents(opened.tally("body-rows"))),
        np.sort(dd.rest_poses(corners, center).probabilities),
        atol=2e-3,
    )
    page.click("#body-restart")
    opened.until(lambda: opened.tally("body-rows") == before)
    page.fill("#center-x", "abc")
    page.press("#center-x", "Enter")
    page.wait_for_selector("#center-error:not([hidden])")
    page.click("#body-map")
    page.wait_for_selector("#map:not([hidden]) svg path")
    opened.check_looks()
    opened.check()


def percents(rows: list[tuple[str, str]]) -> list[float]:
    """Percentages of rows, as parts of 1."""
    return [float(value.rstrip(" %")) / 100.0 for _, value in rows]


def test_a_die_that_is_dragged_says_how_far_it_is_off(open_page: Open) -> None:
    opened = open_page()
    page = opened.page
    page.click("#experts")
    page.wait_for_selector("#body-verdict.ok")
    assert len(opened.tally("body-rows")) == 7
    page.fill("#center-x", "3")
    page.press("#center-x", "Enter")
    page.wait_for_selector("#body-verdict.bad")
    off = max(abs(p - 1 / 7) for p in percents(opened.tally("body-rows")))
    says = opened.text("#body-verdict b")
    assert float(says.split("off by ")[1].split()[0]) == pytest.approx(100.0 * off, rel=0.05)
    opened.check_looks()
    page.click("#body-verdict button")
    page.wait_for_selector("#body-verdict.ok")
    # The steps come back with the die as it was.
    page.click("#experts")
    assert opened.text("#title") == "What do you want to roll?"
    assert opened.text("#caption") == "14 faces · 30 mm"
    opened.check()
