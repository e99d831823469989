"""A die designed on the page, and its files, have the probabilities on the page."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from common.browser import OpenedPage

import dicedesign as dd
from dicedesign.optimize.options import legible
from dicedesign.optimize.preferences import PREFERENCES, Preference
from dicedesign.view.nodes import COLORS

TOLERANCE = 6e-6
"""Slightly more than half of the last digit of the probabilities on the page."""


class NewDie(OpenedPage):
    """Page without a path."""

    ready = "role=tab[name='New die']"

    def field(self, label: str, text: str) -> None:
        """Type into the field with a label."""
        path = f'//label[normalize-space()="{label}"]/following::input[not(@type="hidden")][1]'
        box = self.page.locator(f"xpath={path}")
        box.fill(text)
        box.blur()
        # Viser's client sends only the newest of several changes within some milliseconds.
        self.page.evaluate("() => new Promise((done) => setTimeout(done, 120))")

    def expand(self, folder: str, inside: str) -> None:
        """Open a folder, until a text inside is visible: a click may come before its script."""
        content = self.page.get_by_text(inside, exact=True)
        while not content.is_visible():
            self.page.get_by_text(folder, exact=True).click()
            self.page.wait_for_timeout(1000.0)

    def column(self, name: str, column: int) -> list[str]:
        return [row[column] for row in self.table(name)]

    def numbers(self, name: str, column: int) -> np.ndarray:
        """Column of percentages, as parts of 1."""
        return np.array([float(text) for text in self.column(name, column)]) / 100.0

    def state(self, state: str) -> str:
        """Wait for a state of the design, and return its text."""
        self.page.wait_for_selector(f'#design[data-state="{state}"]')
        return self.page.inner_text("#design")

    def text(self, name: str) -> str:
        self.page.wait_for_selector(f"#{name}")
        return self.page.inner_text(f"#{name}")

    def download(self, button: str, folder: Path) -> Path:
        with self.page.expect_download() as waiting:
            self.button(button)
        path = folder / waiting.value.suggested_filename
        waiting.value.save_as(path)
        return path


def probabilities_of(path: Path) -> np.ndarray:
    """(r,) probabilities of the rests of a file, in descending order."""
    return dd.rest_poses(dd.read_body(path)).probabilities


def test_a_die_is_chosen_typed_designed_and_saved(
    open_page: Callable[..., NewDie], tmp_path: Path
) -> None:
    """The page opens with a design; the menu, typed probabilities and the list of candidates give
    others."""
    new_die = open_page(kind=NewDie)
    menu = new_die.page.get_by_label("Die", exact=True).first
    assert "2d6" in menu.input_value()
    new_die.state("done")
    chances = np.minimum(np.arange(1, 12), np.arange(11, 0, -1)) / 36
    np.testing.assert_allclose(new_die.numbers("facets", 3), chances, atol=TOLERANCE)
    new_die.choose("Die", "Fair, 3 sides")
    new_die.until(lambda: len(new_die.table("facets")) == 3)
    new_die.state("done")
    np.testing.assert_allclose(new_die.numbers("facets", 3), 1 / 3, atol=TOLERANCE)

    new_die.button("Reset")
    new_die.until(lambda: new_die.page.query_selector("#design") is None)
    new_die.button("STL")
    assert "press Design first" in new_die.text("file-error")
    for probabilities, text in (
        ("1/2, 1/3", "expected a sum of 1, got 0.8333"),
        ("<b>: [", "expected a comma or a closing bracket, got '<b>: ['"),
    ):
        new_die.field("Probabilities", probabilities)
        new_die.until(lambda text=text: text in new_die.text("target-error"))
        new_die.button("Design")
    assert new_die.page.query_selector("#design") is None

    new_die.field("Probabilities", "1/2, 1/3, 1/6")
    new_die.field("Labels", "a, a, a")
    new_die.until(lambda: "expected at least two different" in new_die.text("target-error"))
    new_die.field("Labels", "heads, <i>, edge")
    new_die.until(lambda: new_die.page.query_selector("#target-error") is None)
    assert menu.input_value() == "Your own"
    new_die.button("Design")
    assert "millionth" in new_die.state("done")
    assert new_die.column("facets", 0) == ["heads", "<i>", "edge"]
    target = [1 / 2, 1 / 3, 1 / 6]
    for column in (2, 3):
        np.testing.assert_allclose(new_die.numbers("facets", column), target, atol=TOLERANCE)
    for size, text in (
        ("4", "use size_mm = "),
        ("large", "size: expected a number of millimeters, got 'large'"),
    ):
        new_die.field("Size in mm", size)
        new_die.page.wait_for_timeout(300.0)
        new_die.button("STL")
        new_die.until(lambda text=text: text in new_die.text("file-error"))
    new_die.field("Size in mm", "")
    new_die.page.wait_for_timeout(300.0)

    assert new_die.column("candidates", 0) == ["cube of 6 equal faces"]
    stl = new_die.download("STL", tmp_path)
    assert stl.name == "die.stl"
    assert new_die.column("printed", 0) == ["heads", "<i>", "edge"]
    np.testing.assert_allclose(new_die.numbers("printed", 2), target, atol=1e-6)
    for path in (stl, new_die.download("3MF", tmp_path)):
        np.testing.assert_allclose(probabilities_of(path), 1 / 6, atol=1e-6)

    new_die.button("Compare others")
    new_die.until(lambda: len(new_die.table("candidates")) == 4)
    assert "millionth" in new_die.state("done")
    new_die.page.locator("#candidates tbody tr", has_text="24 nearly equal faces").click()
    new_die.until(lambda: len(new_die.view.viewport.viewed.poses.facets) == 24)
    new_die.state("done")
    assert len(new_die.table("candidates")) == 4
    np.testing.assert_allclose(new_die.numbers("facets", 3), target, atol=TOLERANCE)
    stl, recipe = new_die.download("STL", tmp_path), new_die.download("Recipe", tmp_path)
    viewed = new_die.view.viewport.viewed
    dots: Any = new_die.view.page.scene.get_handle_by_name("/sphere/dots")
    nearest = (dots.points @ viewed.poses.normals.T).argmax(axis=0)
    np.testing.assert_array_equal(dots.colors[nearest], COLORS[viewed.row_of_rest])
    assert len(set(viewed.row_of_rest.tolist())) == 3
    assert recipe.name == "die.yaml"
    again = dd.run(recipe, tmp_path / "again", changes=["figures=false", "report=false"])
    assert (again.folder / "die.stl").read_bytes() == stl.read_bytes()
    assert new_die.errors == []


@pytest.fixture
def extension() -> Iterator[str]:
    """Name of a preference registered by an extension."""
    preference = Preference(
        name="levelness",
        line="has no effect",
        residuals=lambda die: 0.0 * die.rests.vertices.sum()[None],
    )
    PREFERENCES.register(preference)
    yield preference.name
    PREFERENCES.unregister(preference.name)


@pytest.mark.full
def test_extensions_and_their_weights(
    extension: str, open_page: Callable[..., NewDie], tmp_path: Path
) -> None:
    new_die = open_page(kind=NewDie)
    new_die.state("done")
    new_die.button("Reset")
    new_die.until(lambda: new_die.page.query_selector("#design") is None)
    new_die.field("Probabilities", "fair: 5")
    new_die.expand("More", "Preferences")
    new_die.expand("Preferences", extension)
    new_die.field(extension, "1.5")
    new_die.field("roundness", "1.7")
    new_die.page.wait_for_timeout(500.0)
    new_die.button("Design")
    new_die.state("done")
    recipe = yaml.safe_load(new_die.download("Recipe", tmp_path).read_text())
    assert recipe["target"]["fair"] == 5
    prefer = recipe["method"]["exact"]["prefer"]
    assert (prefer[extension], prefer["roundness"]) == (1.5, 1.7)
    assert prefer["circles"] == legible().circles


def test_the_target_of_a_loaded_die_fills_the_fields(
    open_page: Callable[[Path], OpenedPage], tmp_path: Path
) -> None:
    path = tmp_path / "coin.yaml"
    path.write_text("{name: coin, target: {probabilities: [1/2, 1/3, 1/6], labels: [a, b, c]}}")
    page = open_page(path).page
    page.get_by_role("tab", name="New die").click()
    for label, text in (("Probabilities", "1/2, 1/3, 1/6"), ("Labels", "a, b, c")):
        box = page.locator(f'xpath=//label[normalize-space()="{label}"]/following::input[1]')
        assert box.input_value() == text
