"""The page of throws: taps are in the file, all its pages show them, and nobody else gets in."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from functools import partial
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.finished import finished_box
from common.looks import check_looks
from PIL import Image

from benchmarks.browser import served_app
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.results.folder import read_result
from dicedesign.results.result import RESULT, Result
from dicedesign.throws.goodness_of_fit import judge_rolls
from dicedesign.throws.roll_log import RollLog
from dicedesign.view.rolls_page import RollsPage
from dicedesign.view.server import LOOPBACK, Gate

SIZES = {"phone": (390, 844), "desk": (1280, 800)}

FULL = pytest.mark.full

MIN_BUTTON = 56.0
"""Smallest side of a button for the thumb, in pixels."""

LAYOUT = """() => {
  const box = (element) => {
    const { left, top, right, bottom } = element.getBoundingClientRect();
    return [left, top + scrollY, right, bottom + scrollY];
  };
  return {
    blocks: [...document.querySelectorAll("button, .results, h1, #total")].map(box),
    faces: [...document.querySelectorAll(".face")].map(box),
  };
}"""
"""Boxes of elements on the whole page."""


def make_page(log: Path, probabilities: Sequence[float], die: Result | None = None) -> RollsPage:
    labels = [str(k + 1) for k in range(len(probabilities))] if die is None else die.labels
    judge = partial(judge_rolls, probabilities=probabilities, confidence=0.95)
    return RollsPage(RollLog(log, labels), probabilities, judge, "a die", die)


def serve_page(
    page: RollsPage, host: str = LOOPBACK, key: str = ""
) -> AbstractContextManager[Gate]:
    """Serve a page on this machine for a while, as if for a host and with a key."""
    return served_app(page.app, host, key)


def ask(gate: Gate, path: str, host: str, value: Any = None, method: str = "POST") -> Any:
    """Status and body of an answer to a request with a host name."""
    connection = HTTPConnection(LOOPBACK, gate.port, timeout=60.0)
    connection.request(method, path, json.dumps(value), {"Host": f"{host}:{gate.port}"})
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, body


def call(gate: Gate, path: str, value: Any = None) -> Any:
    """JSON value of a route."""
    status, body = ask(gate, path, LOOPBACK, value)
    assert status == 200, body
    return json.loads(body)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "rolls.csv"


@pytest.fixture
def box(tmp_path: Path) -> Result:
    """Box of 14 x 16 x 20 mm, whose first label has y upward."""
    plain = finished_box()
    facets = [
        replace(facet, upright=(0.0, 1.0, 0.0)) if facet.outcome == "1" else facet
        for facet in plain.result.facets
    ]
    die = replace(plain, result=replace(plain.result, facets=tuple(facets)))
    folder = tmp_path / "box"
    folder.mkdir()
    (folder / "die_plain.stl").write_bytes(stl_bytes(die.printed))
    (folder / RESULT).write_text(die.result.json_text())
    return read_result(folder)


@pytest.fixture
def tabs(browser: Any) -> Iterator[Any]:
    """Opens the page of a gate in a new window, and asserts that its scripts have no errors."""
    with ExitStack() as ends:
        messages: list[str] = []

        def open_tab(gate: Gate, size: str = "phone", scheme: str = "light") -> Any:
            width, height = SIZES[size]
            context = browser.new_context(
                viewport={"width": width, "height": height},
                color_scheme=scheme,
                reduced_motion="reduce",
                has_touch=True,
            )
            ends.callback(context.close)
            page = context.new_page()
            page.on("pageerror", lambda error: messages.append(str(error)))
            page.goto(gate.address)
            page.wait_for_selector(".face")
            return page

        yield open_tab
        assert messages == []


def wait_for_total(page: Any, total: int) -> None:
    page.wait_for_function(
        "n => document.getElementById('total').textContent === n", arg=str(total)
    )


def test_taps_are_in_the_file_and_on_the_page_that_is_opened_again(
    log: Path, box: Result, tabs: Any
) -> None:
    with serve_page(make_page(log, box.target, box)) as gate:
        page = tabs(gate)
        for outcome in (1, 5, 2):
            page.locator(".face").nth(outcome).tap()
        wait_for_total(page, 3)
        assert RollLog(log, box.labels).throws == ["2", "<6>", "3"]
        page.click("#undo")
        wait_for_total(page, 2)
        assert RollLog(log, box.labels).throws == ["2", "<6>"]
        # Pictures of all faces are there.
        page.wait_for_function("() => document.querySelectorAll('.face img').length === 6")
        assert page.evaluate("() => [...document.images].every((i) => i.naturalWidth > 0)")
    with serve_page(make_page(log, box.target, box)) as gate:
        page = tabs(gate)
        wait_for_total(page, 2)
        assert page.inner_text("#last .chip") == "<6>"
        counts = page.eval_on_selector_all(
            "#tally tr", "rows => rows.map((row) => parseInt(row.cells[2].textContent))"
        )
        assert counts == [0, 1, 0, 0, 0, 1]


def test_two_pages_and_an_editor_share_a_file(log: Path, tabs: Any) -> None:
    """Each has its own server, as two commands on one file have."""
    fair = [0.25] * 4
    with serve_page(make_page(log, fair)) as one, serve_page(make_page(log, fair)) as other:
        first, second = tabs(one), tabs(other)
        first.locator(".face").nth(0).click()
        wait_for_total(second, 1)
        second.locator(".face").nth(3).click()
        wait_for_total(first, 2)
        first.click("#undo")
        wait_for_total(second, 1)
        assert RollLog(log, "1234").throws == ["1"]
        log.write_text("label\n2\n2\n7\n")
        first.wait_for_selector("#error:not([hidden])")
        assert "7" in first.inner_text("#error")
        log.write_text("label\n2\n2\n3\n")
        wait_for_total(first, 3)
        first.wait_for_selector("#error", state="hidden")


def test_keys_log_throws(log: Path, tabs: Any) -> None:
    with serve_page(make_page(log, [0.2] * 5)) as gate:
        page = tabs(gate, "desk")
        wait_for_total(page, 0)
        # The theme comes first, and nothing can be taken back yet.
        for key in ("Tab", "Tab", "Enter", "ArrowRight", "ArrowRight", "Space", "ArrowLeft"):
            page.keyboard.press(key)
        page.keyboard.press("Enter")
        wait_for_total(page, 3)
        page.keyboard.press("Control+z")
        wait_for_total(page, 2)
        assert RollLog(log, "12345").throws == ["1", "3"]


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("outcomes", [*(pytest.param(k, marks=FULL) for k in (2, 6, 20)), 40])
def test_everything_is_in_its_place_and_readable(
    log: Path, tabs: Any, size: str, scheme: str, outcomes: int
) -> None:
    log.write_text("label\n" + "1\n" * 150 + "2\n" * 2)
    with serve_page(make_page(log, [1.0 / outcomes] * outcomes)) as gate:
        page = tabs(gate, size, scheme)
        wait_for_total(page, 152)
        page.wait_for_selector("#verdict.bad")
        layout = page.evaluate(LAYOUT)
        assert check_looks(page) > 2 * outcomes
    faces = np.array(layout["faces"])
    assert len(faces) == outcomes
    assert (faces[:, 2:] - faces[:, :2]).min() >= MIN_BUTTON
    blocks = np.array(layout["blocks"])
    for k, block in enumerate(blocks):
        others = np.delete(blocks, k, axis=0)
        overlap = np.minimum(block[2:], others[:, 2:]) - np.maximum(block[:2], others[:, :2])
        assert (overlap.min(axis=1) <= 0.5).all()


def test_many_taps_at_once_are_all_logged(log: Path) -> None:
    with serve_page(make_page(log, [0.5, 0.5])) as gate, ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda k: call(gate, "/roll", k % 2), range(40)))
        assert call(gate, "/start")["counts"] == [20, 20]
    assert RollLog(log, "12").counts.tolist() == [20, 20]


@pytest.mark.parametrize(
    ("counts", "style"),
    [((0, 0), "info"), ((5, 4), "info"), ((40, 4), "bad"), ((9999, 9999), "ok")],
)
def test_the_verdict_has_a_style(log: Path, counts: tuple[int, int], style: str) -> None:
    log.write_text("label\n" + "1\n" * counts[0] + "2\n" * counts[1])
    with serve_page(make_page(log, [0.5, 0.5])) as gate:
        verdict = call(gate, "/verdict")
        assert verdict["style"] == style
        assert (f"{sum(counts):,}" in verdict["text"]) == (sum(counts) > 0)


def test_a_picture_shows_the_side_to_read(log: Path, box: Result) -> None:
    """The silhouette of the box has the proportions of that side, and a small file."""
    with serve_page(make_page(log, box.target, box)) as gate:
        urls = call(gate, "/pictures")
    shapes = []
    for url in urls:
        png = base64.b64decode(url.partition(",")[2])
        assert url.startswith("data:image/png;base64,")
        assert len(url) <= 20_000
        opaque = np.asarray(Image.open(io.BytesIO(png)).convert("RGBA"))[..., 3] > 128
        shapes.append([int(opaque.any(axis=k).sum()) for k in (0, 1)])
    mm = shapes[0][0] / 20.0
    assert shapes[0] == pytest.approx([20.0 * mm, 16.0 * mm], abs=2.0)
    # Without a recorded label, the facet on the table is seen straight.
    for shape, facet in zip(shapes[1:], [1, 2, 3, 4, 5], strict=True):
        sides = np.delete([14.0, 16.0, 20.0], facet % 3)
        assert sorted(shape) == pytest.approx(mm * sides, abs=2.0)


def test_each_outcome_has_a_picture_of_its_own(convex_die: Path, log: Path) -> None:
    die = read_result(convex_die)
    with serve_page(make_page(log, die.target, die)) as gate:
        urls = call(gate, "/pictures")
    assert len(set(urls)) == len(die.labels)
    assert max(map(len, urls)) <= 20_000


def test_other_hosts_and_paths_without_the_key_are_refused(log: Path) -> None:
    host, key = "192.0.2.7", "secret"
    with serve_page(make_page(log, [0.5, 0.5]), host, key) as gate:
        for name in (host, "localhost"):
            status, page = ask(gate, f"/{key}/", name, method="GET")
            assert (status, b"<!doctype html>" in page) == (200, True)
            assert ask(gate, f"/{key}/static/rolls.js", name, method="GET")[0] == 200
            for path in ("/", "/roll", "/start", "/static/rolls.js", "/other/", "/other/roll"):
                for method in ("GET", "POST"):
                    assert ask(gate, path, name, 0, method)[0] == 404
        assert ask(gate, f"/{key}/roll", "attacker.example", 0)[0] == 403
        assert ask(gate, f"/{key}/roll", "192.0.2.8", 0)[0] == 403
        assert RollLog(log, "12").throws == []
        assert ask(gate, f"/{key}/roll", host, 1)[0] == 200
        assert RollLog(log, "12").throws == ["2"]
        # Numbers of no outcome.
        assert ask(gate, f"/{key}/roll", host, 2)[0] == 422
        assert ask(gate, f"/{key}/roll", host, -1)[0] == 422
        assert ask(gate, f"/{key}/roll", host, "1")[0] == 400
        assert RollLog(log, "12").throws == ["2"]
