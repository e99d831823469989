"""The page shows the probabilities of the model, before and after dragging."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.browser import PATIENCE, OpenedPage, gizmo_place
from common.kernels import compiled_only
from common.paths import public_data

import dicedesign as dd

TOLERANCE = 6e-6
"""Slightly more than half of the last digit of the probabilities on the page."""

SIDES = (20.0, 30.0, 40.0)


@pytest.fixture
def block(tmp_path: Path) -> Path:
    path = tmp_path / "block.stl"
    trimesh.creation.box(SIDES).export(path)
    return path


def matches(opened: OpenedPage, poses: dd.RestPoses) -> bool:
    shown, expected = np.sort(opened.probabilities()), np.sort(poses.probabilities)
    return len(shown) == len(expected) and bool(np.abs(shown - expected).max() < TOLERANCE)


def pull(opened: OpenedPage, axis: int, by: float) -> None:
    """Pull an arrow of the gizmo by a length in the scene, and wait for the page."""
    before = opened.updates()
    at, axes = gizmo_place(opened.view)
    opened.drag(at + 0.5 * axes[:, axis], at + (0.5 + by) * axes[:, axis])
    opened.until(lambda: opened.updates() > before)
    opened.page.wait_for_timeout(1000.0)


def test_probabilities_follow_a_dragged_center_and_a_dragged_corner(
    open_page: Callable[..., OpenedPage], block: Path, tmp_path: Path
) -> None:
    opened = open_page(block)
    body = dd.read_body(block)
    assert matches(opened, dd.rest_poses(body))
    np.testing.assert_allclose(opened.center(), 0.0, atol=1e-5)
    opened.choose("Drag", "Center of mass")
    opened.page.wait_for_timeout(800.0)

    pull(opened, axis=0, by=0.15)
    moved = opened.center()
    assert 1.0 < moved[0] < 9.0
    np.testing.assert_allclose(moved[1:], 0.0, atol=1e-4)
    assert matches(opened, dd.rest_poses(body, moved))

    # A center dragged out of the hull stays inside.
    pull(opened, axis=0, by=1.0)
    assert 9.9 < opened.center()[0] < 10.0

    opened.button("Start over")
    opened.until(lambda: matches(opened, dd.rest_poses(body)))

    opened.choose("Drag", "Corner")
    opened.page.wait_for_timeout(800.0)
    before = opened.view.viewport.viewed
    pull(opened, axis=1, by=0.2)
    viewed = opened.view.viewport.viewed
    assert viewed.is_dragged
    corners = np.array(
        [[np.abs(v - w).max() for w in before.hull.vertices] for v in viewed.hull.vertices]
    )
    assert (corners.min(axis=1) > 1.0).sum() == 1
    with opened.page.expect_download() as waiting:
        opened.button("Download STL")
    saved = tmp_path / "saved.stl"
    waiting.value.save_as(saved)
    assert matches(opened, dd.rest_poses(dd.read_body(saved)))
    assert opened.foreign_urls == []
    assert opened.errors == []


@compiled_only
def test_a_clicked_bar_stands_the_body_and_a_throw_ends_on_a_rest(
    open_page: Callable[..., OpenedPage], block: Path
) -> None:
    opened = open_page(block)
    viewport = opened.view.viewport
    poses = dd.rest_poses(dd.read_body(block))
    viewed = viewport.viewed
    for place in (5, 2):
        opened.page.locator("#probabilities tbody tr").nth(place).click()
        normal = viewed.poses.normals[viewed.rows[place].rest]
        opened.until(lambda normal=normal: float(viewport.down @ normal) > 1.0 - 1e-9)
    opened.choose("Thrown onto", "hard-wood")
    opened.until(lambda: len(opened.rows()[0]) == 4)
    thrown = dd.throw_probabilities(dd.read_body(block), poses, "hard-wood")
    np.testing.assert_allclose(np.sort(opened.probabilities()), np.sort(thrown), atol=TOLERANCE)
    for button in ("Throw it", "Let it go"):
        opened.button(button)
        opened.until(lambda: "came to rest" in (opened.page.text_content("#notice") or ""))
        assert (viewed.poses.normals @ viewport.down).max() > 1.0 - 1e-3
        notice = opened.page.text_content("#notice") or ""
        label = notice.removesuffix(".").split()[-1]
        (row,) = (row for row in viewed.rows if row.label == label)
        assert float(viewed.poses.normals[row.rest] @ viewport.down) > 1.0 - 1e-3
        viewport.page.enqueue(lambda: viewport.page.notify(""))
        opened.until(lambda: opened.page.query_selector("#notice") is None)


@pytest.mark.full
def test_a_public_model_has_its_probabilities_on_the_page(
    open_page: Callable[..., OpenedPage],
) -> None:
    path = public_data("models/spot.obj")
    opened = open_page(path)
    expected = np.sort(dd.rest_poses(dd.read_body(path)).probabilities)[::-1]
    shown = np.sort(opened.probabilities())[::-1]
    np.testing.assert_allclose(shown, expected[: len(shown)], atol=TOLERANCE)
    assert opened.foreign_urls == []


@pytest.mark.full
def test_all_browsers_show_a_typed_center(
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
    expected = dd.rest_poses(dd.read_body(block), [3.0, 0.0, 0.0])
    opened.until(lambda: matches(opened, expected))
    opened.page.reload()
    opened.page.wait_for_selector("#probabilities")
    assert matches(opened, expected)
    assert other.inner_text("#probabilities") == opened.page.inner_text("#probabilities")
    assert other.inner_text("#center") == opened.page.inner_text("#center") == "3, 0, 0"
