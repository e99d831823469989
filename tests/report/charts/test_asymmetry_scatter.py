"""Distances against asymmetry with their densities."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_hex

from dicedesign.errors import InputError
from dicedesign.report.charts.png import png_bytes
from dicedesign.report.charts.scatter import asymmetry_scatter_figure
from dicedesign.report.charts.time_curves import DISTINCT

RNG = np.random.default_rng(3)
ASYMMETRY = RNG.gamma(4.0, 0.05, 60)
DISTANCES = {
    "geometric model vs MuJoCo": 0.5 * ASYMMETRY + RNG.gamma(2.0, 0.02, 60),
    "geometric model vs Bullet": RNG.gamma(2.0, 0.1, 60),
}


def test_every_body_has_a_point_of_each_comparison() -> None:
    figure = asymmetry_scatter_figure(ASYMMETRY, DISTANCES, "title", "note")
    main = figure.axes[0]
    (points,) = main.collections
    colors = np.array([to_hex(color) for color in points.get_facecolor()])
    for color, distances in zip(DISTINCT, DISTANCES.values(), strict=False):
        drawn = np.asarray(points.get_offsets())[colors == color]
        np.testing.assert_array_equal(drawn, np.column_stack([distances, ASYMMETRY]))
    (low, right), (bottom, top) = main.get_xlim(), main.get_ylim()
    assert (low, bottom) == (0.0, 0.0)
    assert right > max(distances.max() for distances in DISTANCES.values())
    assert top > ASYMMETRY.max()
    assert [text.get_text() for text in figure.texts] == ["title", "note"]
    assert png_bytes(figure) == png_bytes(
        asymmetry_scatter_figure(ASYMMETRY, DISTANCES, "title", "note")
    )


def test_the_legend_tells_the_correlations() -> None:
    (legend,) = asymmetry_scatter_figure(ASYMMETRY, DISTANCES, "title").legends
    texts = [text.get_text() for text in legend.get_texts()]
    for text, (name, distances) in zip(texts, DISTANCES.items(), strict=True):
        assert text.startswith(f"{name}: r = {np.corrcoef(ASYMMETRY, distances)[0, 1]:.2f} [")
        assert "p = " in text


def test_densities_integrate_to_one_and_share_the_axes_of_the_points() -> None:
    # Values at the border, where an estimate that is not reflected loses half.
    asymmetry = np.concatenate([ASYMMETRY, np.zeros(60)])
    distances = np.tile(DISTANCES["geometric model vs MuJoCo"], 2)
    figure = asymmetry_scatter_figure(asymmetry, {"a": distances, "b": asymmetry}, "title")
    main, top, right = figure.axes
    assert top.get_xlim() == main.get_xlim()
    assert right.get_ylim() == main.get_ylim()
    for line in top.lines:
        assert np.trapezoid(line.get_ydata(), line.get_xdata()) == pytest.approx(1.0, abs=0.05)
    (line,) = right.lines
    assert np.trapezoid(line.get_xdata(), line.get_ydata()) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("count", [1, 3, 7])
def test_text_stays_inside_and_apart(count: int) -> None:
    distances = {f"geometric model vs engine {k}": ASYMMETRY + RNG.random(60) for k in range(count)}
    figure = asymmetry_scatter_figure(ASYMMETRY, distances, "672 shapes", "800 drops each")
    figure.canvas.draw()
    title, note = (text.get_window_extent() for text in figure.texts)
    legend = figure.legends[0].get_window_extent()
    main, top, right = (axes.get_tightbbox() for axes in figure.axes)
    assert note.y0 >= 0.0
    assert note.y1 < legend.y0
    assert legend.y1 < main.y0
    assert top.y1 <= title.y0
    assert title.y1 <= figure.bbox.y1
    assert main.x0 >= 0.0
    assert right.x1 <= figure.bbox.x1
    assert legend.x1 <= figure.bbox.x1


@pytest.mark.parametrize("count", [0, 8])
def test_there_is_a_colour_for_each_comparison(count: int) -> None:
    distances = {str(k): ASYMMETRY for k in range(count)}
    with pytest.raises(InputError, match=f"expected 1 to 7 comparisons, got {count}"):
        asymmetry_scatter_figure(ASYMMETRY, distances, "title")


def test_values_must_be_distances() -> None:
    with pytest.raises(InputError, match="of at least 0, got -"):
        asymmetry_scatter_figure(ASYMMETRY, {"a": -ASYMMETRY}, "title")
    with pytest.raises(InputError, match="two measures of the same"):
        asymmetry_scatter_figure(ASYMMETRY, {"a": ASYMMETRY[1:]}, "title")
