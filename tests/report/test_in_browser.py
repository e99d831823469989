"""In a browser: what a person sees of a report first, at any width and on paper. The facet under
the pointer in one place is shown in all."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterator
from itertools import pairwise
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
DRAWN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
BOXES = """() => [...document.querySelectorAll("body *")].map((element) => {
  const box = element.getBoundingClientRect();
  return [element.tagName, box.left, box.top, box.right, box.bottom];
}).filter(([tag, left, top, right, bottom]) => right > left && bottom > top)"""
"""Tags and boxes of visible elements."""

CONTRAST = """() => {
  const channels = (text) => text.match(/[\\d.]+/g).map(Number);
  const light = ([r, g, b]) => [r, g, b].map((c) => c / 255)
    .map((c) => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
    .reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
  const ground = (element) => {
    for (let at = element; at; at = at.parentElement) {
      const color = channels(getComputedStyle(at).backgroundColor);
      if (color.length === 3 || color[3] === 1) return color;
    }
    return [255, 255, 255];
  };
  return [...document.querySelectorAll("body *")].filter((element) =>
    element.checkVisibility({ visibilityProperty: true })
    && [...element.childNodes].some((node) => node.nodeType === 3 && node.data.trim())
  ).map((element) => {
    const pair = [channels(getComputedStyle(element).color), ground(element)].map(light);
    return (Math.max(...pair) + 0.05) / (Math.min(...pair) + 0.05);
  });
}"""
"""Contrasts of visible texts with the ground behind them. Source: Web Content Accessibility
Guidelines 2.2."""

MAX_BYTES = 2_000_000


class Opened:
    """Page with its requests and its messages."""

    def __init__(self, browser: Any, file: Path, **options: Any) -> None:
        self.page = browser.new_page(reduced_motion="reduce", **options)
        self.requests: list[str] = []
        self.messages: list[str] = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("console", lambda message: self.messages.append(message.text))
        self.page.on("pageerror", lambda error: self.messages.append(str(error)))
        self.page.goto(file.as_uri())
        self.page.wait_for_selector("#view.live")

    def shows(self, facet: str | None, tags: tuple[str, ...] = ("tr", "path")) -> bool:
        """Whether a facet alone is marked, in the elements and in the view, which is drawn at once
        for those who want no motion."""
        self.page.evaluate(DRAWN)
        marked = {(tag.lower(), name) for tag, name in self.page.evaluate(SHOWN)}
        in_view = self.page.evaluate("document.getElementById('view').dataset.shown || ''")
        expected = set() if facet is None else {(tag, facet) for tag in tags}
        return marked == expected and in_view == (facet or "")

    def view(self) -> np.ndarray:
        """Colors (h, w, 3) of the view, from 0 to 255."""
        data = self.page.locator("canvas").screenshot()
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=float)

    def shown_share(self, label: str) -> float:
        """Share of the view in the hue of an outcome; what is not shown is pale."""
        chip = self.page.locator(f"tr[data-facet] .chip:text-is('{label}')").first
        color = chip.evaluate("chip => getComputedStyle(chip).backgroundColor")
        expected = np.array([int(value) for value in re.findall(r"\d+", color)[:3]], float)
        view = self.view()
        strength = view.max(axis=2) - view.min(axis=2)
        hue = (view - view.min(axis=2, keepdims=True)) / np.maximum(strength, 1.0)[..., None]
        wanted = (expected - expected.min()) / np.ptp(expected)
        return float(((np.abs(hue - wanted).max(axis=2) < 0.12) & (strength > 60.0)).mean())

    def move(self, selector: str, x: float, y: float) -> None:
        """Move the pointer to a place in an element, in pixels from its upper left."""
        box = self.page.locator(selector).bounding_box()
        self.page.mouse.move(box["x"] + x, box["y"] + y)


@pytest.fixture(scope="module")
def report(fair_d3: Path) -> Path:
    return fair_d3 / "report.html"


@pytest.fixture(scope="module")
def opened(browser: Any, report: Path) -> Iterator[Opened]:
    # The map is far below the view.
    opened = Opened(browser, report, viewport={"width": 1100, "height": 6000})
    yield opened
    assert opened.requests == [report.as_uri()]
    assert opened.messages == []
    opened.page.close()


def test_the_facet_under_the_pointer_is_shown_in_table_view_and_map(
    opened: Opened, report: Path
) -> None:
    """What shows an outcome is turned to the viewer, in its color; all else is pale."""
    scale = opened.page.locator(".covered img").bounding_box()["width"] / MAP_SIZE[0]
    discs = place_discs(rest_poses(read_body(report.parent / "die_plain.stl")))
    assert opened.shows(None)
    facets = json.loads((report.parent / "result.json").read_text())["facets"]
    labels = [facet["label"] for facet in facets]
    for number, facet in enumerate(facets):
        others = [label for label in labels if label != facet["label"]]
        opened.page.hover(f"tr[data-facet='{number}']")
        assert opened.shows(str(number))
        assert opened.shown_share(facet["label"]) > 0.05
        assert max(map(opened.shown_share, others)) < 0.002
        opened.page.hover("h1")
        assert opened.shows(None)
        assert max(map(opened.shown_share, others)) > 0.01
        opened.move("canvas", 3.0, 3.0)
        assert opened.shows(None)
        normal = np.array(facet["normal"])
        disc = max(discs, key=lambda disc: float(disc.heights(normal)))
        # A little aside of its middle, where the figure has a dot.
        x, y = scale * disc.to_paper(disc.project(normal)) + [4.0, 4.0]
        opened.move(".covered img", x, y)
        assert opened.shows(str(number))
        assert opened.shown_share(facet["label"]) > 0.05
    opened.page.hover("h1")


def test_a_face_under_the_pointer_is_found_in_the_table(opened: Opened) -> None:
    """The die begins as in its picture: the first outcome is above the middle of the view."""
    box = opened.page.locator("canvas").bounding_box()
    opened.page.hover("tr[data-facet='0']")
    opened.page.hover("h1")
    opened.move("canvas", box["width"] / 2.0, 0.42 * box["height"])
    assert opened.shows("0")
    opened.page.hover("h1")


def test_keys_and_drags_turn_the_die(opened: Opened) -> None:
    page, before = opened.page, opened.view()
    opened.move("canvas", 5.0, 5.0)
    page.mouse.down()
    page.mouse.move(*np.add(page.locator("canvas").bounding_box()["x"], [105.0, 5.0]), steps=4)
    page.mouse.up()
    page.hover("h1")
    views = [before, opened.view()]
    page.focus("canvas")
    for key in ("ArrowRight", "+"):
        page.keyboard.press(key)
        views.append(opened.view())
    assert all((one != other).any() for one, other in pairwise(views))
    page.focus("tr[data-facet='0']")
    assert opened.shows("0")
    page.keyboard.press("Tab")
    assert opened.shows("1")


def test_a_finger_taps(browser: Any, report: Path) -> None:
    opened = Opened(browser, report, viewport={"width": 400, "height": 2400}, has_touch=True)
    page = opened.page
    page.tap("tr[data-facet='1']")
    assert opened.shows("1")
    page.tap("tr[data-facet='0']")
    assert opened.shows("0")
    page.tap("canvas", position={"x": 5.0, "y": 5.0})
    assert opened.shows(None)
    box = page.locator("canvas").bounding_box()
    page.tap("canvas", position={"x": box["width"] / 2.0, "y": 0.42 * box["height"]})
    assert opened.shows("0")
    assert opened.messages == []
    page.close()


def test_a_shape_stands_on_the_rest_that_is_pointed_at(browser: Any, tmp_path: Path) -> None:
    """Of a box of 14 x 16 x 20 mm more is seen on its smallest side than on its largest."""
    die, file = finished_box(concave=CONCAVE), tmp_path / "box.html"
    file.write_text(page_text(die), "utf-8")
    opened = Opened(browser, file, viewport={"width": 1100, "height": 900})
    heights: dict[int, list[int]] = {0: [], 1: [], 2: []}
    for number, facet in enumerate(die.result.facets):
        opened.page.hover(f"tr[data-facet='{number}']")
        assert opened.shows(str(number), ("tr",))
        # The ground and the table are pale, so the die is what is darker.
        dark = opened.view().max(axis=2) < 205.0
        heights[int(np.abs(facet.normal).argmax())].append(int(dark.any(axis=1).sum()))
    assert 0 < max(heights[0]) < min(heights[2])
    assert opened.messages == []
    opened.page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", [(1280, 800), (390, 844)])
def test_the_first_screen_has_the_die_and_its_verdicts(
    browser: Any, report: Path, size: tuple[int, int], scheme: str
) -> None:
    width, height = size
    opened = Opened(
        browser, report, viewport={"width": width, "height": height}, color_scheme=scheme
    )
    page = opened.page
    assert [text.split(".")[0] for text in page.locator(".verdict").all_inner_texts()] == [
        "Set down: good",
        "Thrown: good",
    ]
    for place in (page.locator(".verdict").last, page.locator("nav")):
        box = place.bounding_box()
        assert box["y"] > 0.0
        assert box["y"] + box["height"] <= height
    assert page.locator("canvas").bounding_box()["width"] >= 0.4 * width
    # The die itself, in one color or another.
    drawn = np.ptp(opened.view(), axis=2) > 60.0
    columns = np.flatnonzero(drawn.any(axis=0))
    assert columns[-1] - columns[0] > (0.25 if width > height else 0.4) * width
    page.evaluate("document.querySelectorAll('details').forEach((part) => (part.open = true))")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    for _, left, _, right, _ in page.evaluate(BOXES):
        assert left >= 0.0
        assert right <= width
    contrasts = page.evaluate(CONTRAST)
    assert len(contrasts) > 50
    assert min(contrasts) >= 4.5
    assert report.stat().st_size <= MAX_BYTES
    page.close()


def test_no_other_script_runs_and_nothing_is_fetched(browser: Any, report: Path) -> None:
    page = browser.new_page()
    page.goto(report.as_uri())
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


@pytest.mark.parametrize("scripts", [False, True])
def test_without_webgl_or_scripts_the_table_and_the_map_are_there(
    browser: Any, report: Path, scripts: bool
) -> None:
    page = browser.new_page(java_script_enabled=scripts)
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null;")
    page.goto(report.as_uri())
    assert page.locator("tr[data-facet]").count() == 3
    assert page.locator(".covered img").is_visible()
    assert page.locator(".still").is_visible()
    assert not page.locator("canvas").is_visible()
    if scripts:
        page.hover("tr[data-facet='1']")
        assert len(page.evaluate(SHOWN)) == 3
    page.close()


def test_a_report_is_printed_on_one_page(browser: Any, report: Path) -> None:
    """The page as it is laid out for paper, within margins of 12 mm, and its PDF."""
    page = browser.new_page()
    page.goto(report.as_uri())
    page.emulate_media(media="print")
    for paper, size in (("A4", (210.0, 297.0)), ("Letter", (215.9, 279.4))):
        width, height = ((np.array(size) - 24.0) / 25.4 * 96.0).astype(int).tolist()
        page.set_viewport_size({"width": width, "height": height})
        text = page.inner_text("body")
        for facet in json.loads((report.parent / "result.json").read_text())["facets"]:
            assert re.search(rf"^{facet['label']}\s+33\.333\s+33\.333", text, re.MULTILINE)
        for part in ("fair_d3", "Set down: good", "Thrown: good", "Print", "Read"):
            assert part in text
        assert "Numbers for experts" not in text
        boxes = page.evaluate(BOXES)
        pictures = [box for tag, *box in boxes if tag == "IMG"]
        assert len(pictures) == 2
        assert min((right - left) * (lower - upper) for left, upper, right, lower in pictures) > 3e4
        for _, left, upper, right, lower in boxes:
            assert 0 <= left <= right <= width + 1
            assert 0 <= upper <= lower <= height + 1
        pdf = page.pdf(format=paper)
        assert re.findall(rb"/Type\s*/Pages\s*/Count (\d+)", pdf) == [b"1"]
    page.close()
