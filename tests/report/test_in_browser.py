"""In a browser, the facet under the pointer in one place is shown in all."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.finished import CONCAVE, finished_box, page_text
from PIL import Image

from dicedesign.geometry.meshes.reading import read_body
from dicedesign.report.discs import MAP_SIZE, place_discs
from dicedesign.rest.poses import rest_poses

SHOWN = "() => [...document.querySelectorAll('.shown')].map((x) => [x.tagName, x.dataset.facet])"
ACCENT = np.array([194, 87, 26])


class Opened:
    """Page with its requests and its messages."""

    def __init__(self, page: Any, file: Path) -> None:
        self.page = page
        self.requests: list[str] = []
        self.messages: list[str] = []
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("console", lambda message: self.messages.append(message.text))
        page.on("pageerror", lambda error: self.messages.append(str(error)))
        page.goto(file.as_uri())

    def shown(self) -> set[tuple[str, str]]:
        """Tags and facets of marked elements."""
        return {(tag.lower(), facet) for tag, facet in self.page.evaluate(SHOWN)}

    def facet_in_view(self) -> str:
        return str(self.page.evaluate("document.getElementById('view').dataset.shown || ''"))

    def marked_pixels(self) -> float:
        """Share of the view that has the color of the facet under the pointer."""
        return float((np.abs(self.pixels() - ACCENT).max(axis=2) < 40.0).mean())

    def pixels(self) -> np.ndarray:
        """Colors (h, w, 3) of the view, from 0 to 255."""
        data = self.page.locator("canvas").screenshot()
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=float)

    def settle(self) -> None:
        """Wait until the die, which turns at once for those who want no motion, is drawn."""
        frame = (
            "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
        )
        self.page.evaluate(frame)


@pytest.fixture
def opened(browser: Any, fair_d3: Path) -> Iterator[Opened]:
    # The map is far below the view.
    size = {"width": 1100, "height": 6000}
    page = browser.new_page(viewport=size, reduced_motion="reduce")
    view = Opened(page, fair_d3 / "report.html")
    page.wait_for_selector("#view:not([hidden])")
    yield view
    assert view.requests == [(fair_d3 / "report.html").as_uri()]
    assert view.messages == []
    page.close()


def facets(folder: Path) -> list[dict[str, Any]]:
    sections: list[dict[str, Any]] = json.loads((folder / "result.json").read_text())["facets"]
    return sections


def test_a_row_shows_its_facet_in_view_and_map(opened: Opened, fair_d3: Path) -> None:
    assert opened.shown() == set()
    assert opened.marked_pixels() < 0.002
    for facet in map(str, range(len(facets(fair_d3)))):
        opened.page.hover(f"tr[data-facet='{facet}']")
        opened.settle()
        assert opened.shown() == {("tr", facet), ("path", facet)}
        assert opened.facet_in_view() == facet
        assert opened.marked_pixels() > 0.1
    opened.page.hover("h1")
    assert opened.shown() == set()
    assert opened.marked_pixels() < 0.002


def test_the_view_shows_its_facet_in_table_and_map(opened: Opened, fair_d3: Path) -> None:
    """A facet that is turned to the viewer holds the middle of the view: the center of mass is
    above each facet that a die rests on."""
    box = opened.page.locator("canvas").bounding_box()
    middle = (box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0)
    for facet in map(str, range(len(facets(fair_d3)))):
        opened.page.hover(f"tr[data-facet='{facet}']")
        opened.settle()
        opened.page.hover("h1")
        opened.page.mouse.move(*middle)
        assert opened.shown() == {("tr", facet), ("path", facet)}
        assert opened.facet_in_view() == facet
    opened.page.mouse.move(box["x"] + 3.0, box["y"] + 3.0)
    assert opened.shown() == set()


def test_the_map_shows_its_basin_in_view_and_table(opened: Opened, fair_d3: Path) -> None:
    poses = rest_poses(read_body(fair_d3 / "die_plain.stl"))
    box = opened.page.locator(".covered img").bounding_box()
    scale = box["width"] / MAP_SIZE[0]
    for facet, section in enumerate(facets(fair_d3)):
        normal = np.array(section["normal"])
        disc = max(place_discs(poses), key=lambda disc: float(disc.heights(normal)))
        # A little aside of its middle, where the figure has a dot.
        x, y = scale * disc.to_paper(disc.project(normal)) + [4.0, 4.0]
        opened.page.mouse.move(box["x"] + x, box["y"] + y)
        opened.settle()
        assert opened.shown() == {("tr", str(facet)), ("path", str(facet))}
        assert opened.facet_in_view() == str(facet)
        assert opened.marked_pixels() > 0.1


def test_keys_do_as_the_pointer(opened: Opened) -> None:
    page = opened.page
    page.focus("canvas")
    before = page.locator("canvas").screenshot()
    page.keyboard.press("ArrowRight")
    assert page.locator("canvas").screenshot() != before
    turned = page.locator("canvas").screenshot()
    page.keyboard.press("+")
    assert page.locator("canvas").screenshot() != turned
    page.keyboard.press("Tab")
    opened.settle()
    assert opened.shown() == {("tr", "0"), ("path", "0")}
    page.keyboard.press("Tab")
    opened.settle()
    assert opened.shown() == {("tr", "1"), ("path", "1")}
    assert opened.facet_in_view() == "1"


def test_dragging_turns_the_die(opened: Opened) -> None:
    page = opened.page
    box = page.locator("canvas").bounding_box()
    page.mouse.move(box["x"] + 5.0, box["y"] + 5.0)
    before = page.locator("canvas").screenshot()
    page.mouse.down()
    page.mouse.move(box["x"] + 105.0, box["y"] + 5.0, steps=4)
    page.mouse.up()
    page.mouse.move(box["x"] + 5.0, box["y"] + 5.0)
    assert page.locator("canvas").screenshot() != before


def test_a_finger_taps(browser: Any, fair_d3: Path) -> None:
    size = {"width": 400, "height": 800}
    page = browser.new_page(viewport=size, has_touch=True, reduced_motion="reduce")
    opened = Opened(page, fair_d3 / "report.html")
    page.wait_for_selector("#view:not([hidden])")
    page.tap("tr[data-facet='1']")
    opened.settle()
    assert opened.shown() == {("tr", "1"), ("path", "1")}
    assert opened.marked_pixels() > 0.1
    page.tap("tr[data-facet='0']")
    assert opened.facet_in_view() == "0"
    opened.settle()
    page.tap("canvas", position={"x": 5.0, "y": 5.0})
    assert opened.shown() == set()
    box = page.locator("canvas").bounding_box()
    page.tap("canvas", position={"x": box["width"] / 2.0, "y": box["height"] / 2.0})
    assert opened.shown() == {("tr", "0"), ("path", "0")}
    assert opened.messages == []
    page.close()


def test_a_shape_stands_on_the_rest_that_is_pointed_at(browser: Any, tmp_path: Path) -> None:
    """Of a box of 14 x 16 x 20 mm more is seen on its smallest side than on its largest."""
    die = finished_box(concave=CONCAVE)
    file = tmp_path / "box.html"
    file.write_text(page_text(die), "utf-8")
    page = browser.new_page(viewport={"width": 1100, "height": 900}, reduced_motion="reduce")
    opened = Opened(page, file)
    page.wait_for_selector("#view:not([hidden])")
    rows: dict[int, list[int]] = {0: [], 1: [], 2: []}
    for number, facet in enumerate(die.result.facets):
        page.hover(f"tr[data-facet='{number}']")
        opened.settle()
        assert opened.shown() == {("tr", str(number))}
        # The table, which is pale, does not count.
        colored = np.ptp(opened.pixels(), axis=2) > 40.0
        rows[int(np.abs(facet.normal).argmax())].append(int(colored.any(axis=1).sum()))
    assert 0 < max(rows[0]) < min(rows[2])
    assert opened.messages == []
    page.close()


def test_no_other_script_runs_and_nothing_is_fetched(browser: Any, fair_d3: Path) -> None:
    page = browser.new_page()
    page.goto((fair_d3 / "report.html").as_uri())
    ran = """() => {
      const other = document.createElement("script");
      other.textContent = "window.ran = true";
      document.head.append(other);
      return window.ran === true;
    }"""
    assert page.evaluate(ran) is False
    blocked = """() => new Promise((done) => {
      document.addEventListener("securitypolicyviolation", (e) => done(e.effectiveDirective));
      fetch("https://example.org/").catch(() => 0);
    })"""
    assert page.evaluate(blocked) == "connect-src"
    page.close()


def test_without_scripts_the_page_is_as_printed(browser: Any, fair_d3: Path) -> None:
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto((fair_d3 / "report.html").as_uri())
    assert not page.locator("#view").is_visible()
    assert page.locator("tr[data-facet]").count() == len(facets(fair_d3))
    assert page.locator(".covered img").is_visible()
    context.close()


def test_without_webgl_table_and_map_are_linked(browser: Any, fair_d3: Path) -> None:
    page = browser.new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null;")
    opened = Opened(page, fair_d3 / "report.html")
    page.hover("tr[data-facet='1']")
    assert opened.shown() == {("tr", "1"), ("path", "1")}
    assert not page.locator("#view").is_visible()
    assert opened.messages == []
    page.close()


def test_the_view_is_omitted_in_print(opened: Opened) -> None:
    opened.page.emulate_media(media="print")
    assert not opened.page.locator("#view").is_visible()
    assert opened.page.locator(".covered img").is_visible()
    opened.page.emulate_media(media="screen")
    assert opened.page.locator("#view").is_visible()
