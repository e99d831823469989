"""Figures of finished dice, and one more from outside the package."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import pytest
from common.finished import finished_box
from common.parsed_html import parsed

from dicedesign.report.figures import FIGURES, Figure, figure_files
from dicedesign.report.pages import die_page


@pytest.fixture
def toy() -> Iterator[Figure]:
    figure = Figure(
        name="toy",
        line="a toy",
        title="A toy & its title",
        caption="What it shows.",
        wanted=lambda die: len(die.result.labels) == 6,
        draw=lambda die: b"GIF89a" + die.result.name.encode(),
        suffix=".gif",
    )
    yield FIGURES.register(figure)
    FIGURES.unregister("toy")


def test_a_figure_from_outside_is_drawn_and_shown(toy: Figure) -> None:
    die = finished_box()
    files = figure_files(die)
    assert files["toy"] == b"GIF89aa < box"
    page = parsed(die_page(die.result, files))
    places = [page.text.index(FIGURES[name].title) for name in ("bars", "convergence", "toy")]
    assert places == sorted(places)
    assert "What it shows." in page.text
    assert any(source.startswith("data:image/gif;") for source in page.sources)
    assert FIGURES["toy"].suffix == ".gif"


def test_a_convex_die_has_its_figures() -> None:
    files = figure_files(finished_box())
    assert list(files) == ["bars", "convergence", "gauss_map", "views"]
    assert all(data.startswith(b"\x89PNG") for data in files.values())
    assert files == figure_files(finished_box())


def test_figures_are_listed_without_what_draws_them() -> None:
    code = (
        "import sys\n"
        "from dicedesign.report.figures import FIGURES\n"
        "assert len(FIGURES.names) > 10\n"
        "assert all(figure.title and figure.caption and figure.line for figure in FIGURES)\n"
        "heavy = {'torch', 'matplotlib', 'PIL', 'manifold3d', 'scipy.optimize', 'pydantic'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
