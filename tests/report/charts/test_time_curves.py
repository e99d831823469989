"""Panels of curves on logarithmic axes, scatter plots of distances."""

from __future__ import annotations

import numpy as np
import pytest
from common.drawings import is_whole, painted

from dicedesign.errors import InputError
from dicedesign.report.charts.palette import DARK, DISTINCT
from dicedesign.report.charts.scatter import asymmetry_scatter_figure, density
from dicedesign.report.charts.series import Curve, Style
from dicedesign.report.charts.time_curves import (
    DesignCurve,
    DesignPanel,
    Panel,
    design_methods_figure,
    panels_figure,
    time_against_size_figure,
)

LEVELS = {"float64 rounding": 2.0**-53}


def panel(title: str, *errors: float) -> Panel:
    seconds = [10.0 ** (k - 3) for k in range(len(errors))]
    exact = Curve([1e-3], [errors[-1]], Style(DISTINCT[1], "", marker="*"), "exact")
    return Panel(title, [Curve(seconds, errors, Style(DISTINCT[0]), "sampled"), exact], LEVELS)


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_panels_share_a_legend(count: int) -> None:
    paper = panels_figure([panel(f"body {k}", 0.1, 10.0 ** -(k + 2)) for k in range(count)], 3)
    assert [text for text in paper.texts if text.startswith("body")] == [
        f"body {k}" for k in range(count)
    ]
    for text in ("sampled", "exact", "float64 rounding"):
        assert paper.texts.count(text) == 1
    assert paper.texts.count("run time (s)") == min(count, 3)
    assert is_whole(paper)
    assert painted(paper, DISTINCT[0]).any()
    assert paper.png() == paper.png()


def test_zeros_are_drawn_at_a_border_that_says_so() -> None:
    assert "border: 0" in panels_figure([panel("with", 1e-2, 0.0)], 3).texts
    assert "border: 0" not in panels_figure([panel("without", 1e-2, 1e-4)], 3).texts
    assert is_whole(panels_figure([panel("all exact", 0.0)], 3))


def test_earlier_curves_lie_above_later_ones() -> None:
    same = [Curve([1.0, 2.0], [1.0, 2.0], Style(color, width=4.0)) for color in DISTINCT[:2]]
    paper = panels_figure([Panel("body", same)], 1)
    assert painted(paper, DISTINCT[0]).sum() > 10 * painted(paper, DISTINCT[1]).sum()


@pytest.mark.parametrize("panels", [[], [Panel("empty", ())], [panel("a", 0.1), Panel("b", ())]])
def test_each_panel_needs_a_point(panels: list[Panel]) -> None:
    with pytest.raises(InputError, match="expected a point in each panel"):
        panels_figure(panels, 3)


@pytest.mark.parametrize(
    ("seconds", "error"), [(0.0, 1e-3), (-1.0, 1e-3), (1.0, -1e-3), (1.0, float("nan"))]
)
def test_values_must_fit_logarithmic_axes(seconds: float, error: float) -> None:
    with pytest.raises(InputError, match="positive times or sizes and values of at least 0"):
        panels_figure([Panel("body", [Curve([seconds], [error])])], 3)


def test_times_against_sizes() -> None:
    curves = [Curve([10, 1000], [1e-5 * k, 1e-3 * k], label=f"way {k}") for k in (1, 2, 3)]
    paper = time_against_size_figure(curves, "title", "points", "two cores, today")
    assert {"title", "points", "way 1", "way 3", "two cores, today"} <= set(paper.texts)
    assert is_whole(paper)
    for color in (DARK, *DISTINCT[:2]):
        assert painted(paper, color).any()
    with pytest.raises(InputError, match="expected a point of each curve"):
        time_against_size_figure([*curves, Curve([], [])], "title", "points", "")
    with pytest.raises(InputError, match="expected positive times"):
        time_against_size_figure([Curve([10], [0.0])], "title", "points", "")
    with pytest.raises(InputError, match="expected a point"):
        time_against_size_figure([], "title", "points", "")


def test_methods_of_design() -> None:
    good = DesignCurve("m", (0.0, 1.0, 2.0), (0.3, 0.4, 1e-4), (0.1, 0.2, 0.0), True)
    bad = DesignCurve("n", (0.1, 1.0), (0.3, 0.2), (0.1, 0.2), False)
    paper = design_methods_figure([DesignPanel(name, 1e-3, (good, bad)) for name in ("r", "s")])
    assert {"r: error, max |p − q|", "s: dice energy", "tolerance"} <= set(paper.texts)
    for text in ("m", "n", "converged", "stopped short"):
        assert paper.texts.count(text) == 1
    assert is_whole(paper)
    with pytest.raises(InputError, match="expected a point in each panel"):
        design_methods_figure([DesignPanel("a", 0.1, (good,)), DesignPanel("b", 0.1, ())])


RNG = np.random.default_rng(3)
ASYMMETRY = RNG.gamma(4.0, 0.05, 60)
DISTANCES = {
    "a vs b": 0.5 * ASYMMETRY + RNG.gamma(2.0, 0.02, 60),
    "a vs c": RNG.gamma(2.0, 0.1, 60),
}


@pytest.mark.parametrize("count", [1, 2, 7])
def test_scatter_of_distances_tells_their_correlations(count: int) -> None:
    distances = {f"a vs {k}": ASYMMETRY + RNG.random(60) for k in range(count)}
    paper = asymmetry_scatter_figure(ASYMMETRY, distances, "title", "note")
    assert is_whole(paper)
    for name, values in distances.items():
        r = np.corrcoef(ASYMMETRY, values)[0, 1]
        (text,) = (text for text in paper.texts if text.startswith(name))
        assert text.startswith(f"{name}: r = {r:.2f} [")
        assert "p = " in text
    for color in DISTINCT[:count]:
        assert painted(paper, color).sum() > 60


def test_densities_integrate_to_one_also_at_the_border() -> None:
    values = np.concatenate([ASYMMETRY, np.zeros(60)])
    places, heights = density(values, 2.0 * values.max())
    assert np.trapezoid(heights, places) == pytest.approx(1.0, abs=0.05)


def test_what_cannot_be_scattered() -> None:
    for count in (0, 9):
        distances = {str(k): ASYMMETRY for k in range(count)}
        with pytest.raises(InputError, match=f"expected 1 to 8 comparisons, got {count}"):
            asymmetry_scatter_figure(ASYMMETRY, distances, "title")
    with pytest.raises(InputError, match="of at least 0, got -"):
        asymmetry_scatter_figure(ASYMMETRY, {"a": -ASYMMETRY}, "title")
    with pytest.raises(InputError, match="two measures of the same"):
        asymmetry_scatter_figure(ASYMMETRY, {"a": ASYMMETRY[1:]}, "title")
