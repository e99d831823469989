"""What the page shows of a body is what the model says, before and after it is dragged."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.browser import PATIENCE, OpenedPage, gizmo_place
from common.paths import public_data

import dicedesign as dd

SHOWN = 6e-6
"""Half of the last digit of probabilities that the page tells, and a little."""

SIDES = (20.0, 30.0, 40.0)


@pytest.fixture
def block(tmp_path: Path) -> Path:
    path = tmp_path / "block.stl"
    trimesh.creation.box(SIDES).export(path)
    return path


def matches(opened: OpenedPage, poses: dd.RestPoses) -> bool:
    shown, told = np.sort(opened.probabilities()), np.sort(poses.probabilities)
    return len(shown) == len(told) and bool(np.abs(shown - told).max() < SHOWN)


def pull(opened: OpenedPage, axis: int, by: float) -> None:
    """Pull an arrow of the gizmo, by units of the scene, until the page shows that."""
    before = opened.updates()
    at, axes = gizmo_place(opened.view)
    opened.drag(at + 0.5 * axes[:, axis], at + (0.5 + by) * axes[:, axis])
    opened.until(lambda: opened.updates() > before)
    opened.page.wait_for_timeout(1000.0)


def test_a_dragged_center_and_a_dragged_corner_have_the_probabilities_of_the_model(
    open_page: Callable[..., OpenedPage], block: Path, tmp_path: Path
) -> None:
    opened = open_page(block)
    body = dd.read_body(block)
    assert matches(opened, dd.rest_poses(body))
    np.testing.assert_allclose(opened.center(), 0.0, atol=1e-5)
    opened.page.wait_for_timeout(2000.0)

    pull(opened, axis=0, by=0.15)
    moved = opened.center()
    assert 1.0 < moved[0] < 9.0
    np.testing.assert_allclose(moved[1:], 0.0, atol=1e-4)
    assert matches(opened, dd.rest_poses(body, moved))

    # Far out of the hull: it stays inside, and the page says so.
    pull(opened, axis=0, by=1.0)
    assert 9.9 < opened.center()[0] < 10.0

    opened.button("Undo")
    opened.until(lambda: matches(opened, dd.rest_poses(body, moved)))
    opened.button("Start over")
    opened.until(lambda: matches(opened, dd.rest_poses(body)))

    opened.choose("Drag", "Corner")
    opened.page.wait_for_timeout(1000.0)
    before = opened.view.exhibit.viewed
    assert before is not None
    pull(opened, axis=1, by=0.2)
    viewed = opened.view.exhibit.viewed
    assert viewed is not None
    assert viewed.dragged
    corners = np.array(
        [[np.abs(v - w).max() for w in before.hull.vertices] for v in viewed.hull.vertices]
    )
    assert (corners.min(axis=1) > 1.0).sum() == 1
    with opened.page.expect_download() as waiting:
        opened.button("Download STL")
    saved = tmp_path / "saved.stl"
    waiting.value.save_as(saved)
    assert matches(opened, dd.rest_poses(dd.read_body(saved)))
    assert opened.elsewhere == []
    assert opened.errors == []


def test_a_clicked_bar_stands_the_body_and_a_throw_ends_on_a_rest(
    open_page: Callable[..., OpenedPage], block: Path
) -> None:
    opened = open_page(block)
    exhibit = opened.view.exhibit
    poses = dd.rest_poses(dd.read_body(block))
    viewed = exhibit.viewed
    assert viewed is not None
    for place in (5, 2):
        opened.page.locator("#probabilities tbody tr").nth(place).click()
        wanted = viewed.poses.normals[viewed.rows[place].rest]
        opened.until(lambda wanted=wanted: float(exhibit.down @ wanted) > 1.0 - 1e-9)
    opened.choose("Thrown onto", "hard-wood")
    opened.until(lambda: len(opened.rows()[0]) == 4)
    thrown = dd.throw_probabilities(dd.read_body(block), poses, "hard-wood")
    np.testing.assert_allclose(np.sort(opened.probabilities()), np.sort(thrown), atol=SHOWN)
    for button in ("Throw it", "Let it go"):
        opened.button(button)
        opened.until(lambda: "came to rest" in (opened.page.text_content("#notice") or ""))
        assert (viewed.poses.normals @ exhibit.down).max() > 1.0 - 1e-3
        said = opened.page.text_content("#notice") or ""
        label = said.removesuffix(".").split()[-1]
        (row,) = (row for row in viewed.rows if row.label == label)
        assert float(viewed.poses.normals[row.rest] @ exhibit.down) > 1.0 - 1e-3
        exhibit.page.soon(lambda: exhibit.page.say(""))
        opened.until(lambda: opened.page.query_selector("#notice") is None)


def test_a_public_model_has_its_probabilities_on_the_page(
    open_page: Callable[..., OpenedPage],
) -> None:
    path = public_data("models/spot.obj")
    opened = open_page(path)
    told = np.sort(dd.rest_poses(dd.read_body(path)).probabilities)[::-1]
    shown = np.sort(opened.probabilities())[::-1]
    np.testing.assert_allclose(shown, told[: len(shown)], atol=SHOWN)
    assert opened.elsewhere == []


def test_every_browser_shows_what_was_typed_in_one_after_a_reload_too(
    open_page: Callable[..., OpenedPage], block: Path
) -> None:
    opened = open_page(block)
    other = opened.page.context.new_page()
    other.set_default_timeout(PATIENCE)
    other.goto(opened.view.page.gate.address)
    other.wait_for_selector("#probabilities")
    field = opened.page.locator("input[inputmode='decimal']").first
    field.fill("3")
    field.press("Tab")
    told = dd.rest_poses(dd.read_body(block), [3.0, 0.0, 0.0])
    opened.until(lambda: matches(opened, told))
    opened.page.reload()
    opened.page.wait_for_selector("#probabilities")
    assert matches(opened, told)
    assert other.inner_text("#probabilities") == opened.page.inner_text("#probabilities")
    assert other.inner_text("#center") == opened.page.inner_text("#center") == "3, 0, 0"
