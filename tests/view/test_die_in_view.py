"""An engraved die in color, and the tally of its throws."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from common.browser import OpenedPage
from common.kernels import compiled_only

from dicedesign.recipe.pipeline import run
from dicedesign.recipe.reading import parse_recipe
from dicedesign.view.body_panel import describe_tally
from dicedesign.view.nodes import split_engraved
from dicedesign.view.sources import open_source
from dicedesign.view.viewed_body import ViewedBody


@pytest.fixture(scope="module")
def cube(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a die with the labels a, a, b, b, b, c."""
    folder = tmp_path_factory.mktemp("outputs") / "cube"
    target = {"fair": 6, "labels": ["a", "a", "b", "b", "b", "c"]}
    entries = {"name": "cube", "target": target, "symmetry": "Oh", "figures": False}
    run(parse_recipe({**entries, "report": False}), folder)
    return folder


def load(path: Path) -> ViewedBody:
    return open_source(path).load(path.name, lambda _: None)


def test_facets_of_an_engraved_die_are_told_from_its_labels(cube: Path) -> None:
    viewed = load(cube)
    assert [row.label for row in viewed.rows] == ["a", "b", "c"]
    np.testing.assert_allclose(
        [row.probability for row in viewed.rows], [1 / 3, 1 / 2, 1 / 6], atol=1e-7
    )
    body = viewed.shape.body
    assert body.triangles is not None
    split = split_engraved((body.points, body.triangles), viewed)
    assert split is not None
    points, labels, of_facet = split
    assert len(labels) + sum(map(len, of_facet.values())) == len(body.triangles)
    assert set(of_facet) == set(range(6))
    half = np.abs(viewed.hull.vertices).max()
    for facet, triangles in of_facet.items():
        # All corners are in the plane of the facet; its area is the square less its label.
        heights = points[triangles] @ viewed.hull.normals[facet]
        np.testing.assert_allclose(heights, half, rtol=3e-3)
    depths = np.abs(points[labels].mean(axis=1)).max(axis=1)
    assert (depths < half - 1e-2).all()


def test_a_body_without_outcomes_is_not_split(cube: Path) -> None:
    viewed = load(cube / "die_plain.stl")
    body = viewed.shape.body
    assert body.triangles is not None
    assert split_engraved((body.points, body.triangles), viewed) is None


def test_the_tally_says_what_a_test_says() -> None:
    fair = np.full(4, 0.25)
    assert "nothing speaks against it" in describe_tally(np.array([26, 24, 27, 23]), fair, "carpet")
    assert "hardly has them" in describe_tally(np.array([60, 20, 10, 10]), fair, "carpet")


@compiled_only
def test_throws_are_counted_on_the_page(open_page: Callable[..., OpenedPage], cube: Path) -> None:
    opened = open_page(cube)

    def cells(column: int) -> list[str]:
        found = opened.page.query_selector_all(f"#tally tbody td:nth-child({column})")
        return [each.inner_text() for each in found]

    for throws in (100, 200):
        opened.button("Throw 100")
        opened.until(lambda throws=throws: sum(map(int, cells(3))) == throws)
    assert cells(1) == ["a", "b", "c"]
    assert "200 throws onto carpet" in opened.page.inner_text("#tally-sentence")
    assert opened.errors == []
