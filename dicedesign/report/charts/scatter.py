"""Distances between predictions of the same bodies' rests, against the bodies' asymmetry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.stats import gaussian_kde

from dicedesign.errors import InputError
from dicedesign.report.charts.palette import DARK, FAINT
from dicedesign.report.charts.png import agg_figure
from dicedesign.report.charts.time_curves import DISTINCT, style_axes
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.statistics.correlation import correlation

__all__ = ["asymmetry_scatter_figure"]

_WIDTH: Final = 7.2

_LEFT: Final = 0.75

_MAIN: Final = (5.2, 3.9)
"""Inches of the scatter plot."""

_DENSITY: Final = 0.95
"""Inches between the axis and the highest value of the plots of densities."""

_GAP: Final = 0.1

_TITLE: Final = 0.4

_FOOT: Final = 0.38

_AXIS: Final = 0.6

_LEGEND_ROW: Final = 0.23
"""Inches."""

_CURVE_POINTS: Final = 256


def asymmetry_scatter_figure(
    asymmetry: Floats, distances: Mapping[str, Floats], title: str, note: str = ""
) -> Figure:
    """A point for each body and comparison, with the densities of the distances on top and of the
    asymmetry on the right; the legend gives each comparison's Pearson correlation with its 95 %
    interval and p-value.

    Densities are Gaussian kernel estimates, reflected at 0, that integrate to 1.

    Parameters
    ----------
    asymmetry: (n,) measure rho of each body, at least 0.
    distances: what is compared -> (n,) Wasserstein distances in radians, at least 0; up to 7.
    title: above the figure.
    note: small print at the foot.

    Raises
    ------
    InputError: there is nothing to compare, a value is negative, or as `correlation`.

    Source: figure 10.
    """
    if not 1 <= len(distances) <= len(DISTINCT):
        raise InputError(
            f"asymmetry scatter: expected 1 to {len(DISTINCT)} comparisons, got {len(distances)}; "
            "draw more in figures of their own"
        )
    found = {name: correlation(asymmetry, values) for name, values in distances.items()}
    lowest = min(float(values.min()) for values in (asymmetry, *distances.values()))
    if lowest < 0.0:
        raise InputError(
            f"asymmetry scatter: expected distances and asymmetries of at least 0, got {lowest:g}; "
            "pass Wasserstein distances and rho"
        )
    foot = _FOOT + _LEGEND_ROW * len(distances) + _AXIS
    height = foot + _MAIN[1] + _GAP + _DENSITY + _TITLE
    figure = agg_figure(_WIDTH, height)

    def axes_at(left: float, bottom: float, width: float, tall: float) -> Axes:
        return figure.add_axes((left / _WIDTH, bottom / height, width / _WIDTH, tall / height))

    main = axes_at(_LEFT, foot, *_MAIN)
    top = axes_at(_LEFT, foot + _MAIN[1] + _GAP, _MAIN[0], _DENSITY)
    right = axes_at(_LEFT + _MAIN[0] + _GAP, foot, _DENSITY, _MAIN[1])
    most = 1.05 * max(float(values.max()) for values in distances.values())
    _scatter(main, asymmetry, list(distances.values()))
    for values, color in zip(distances.values(), DISTINCT, strict=False):
        places, density = _density(values, most)
        top.plot(places, density, color=color, linewidth=1.4)
        top.fill_between(places, density, color=color, alpha=0.12, linewidth=0)
    places, density = _density(asymmetry, 1.05 * float(asymmetry.max()))
    right.plot(density, places, color=DARK, linewidth=1.4)
    right.fill_betweenx(places, density, color=DARK, alpha=0.12, linewidth=0)
    main.set(xlim=(0.0, most), ylim=(0.0, places[-1]))
    main.set(xlabel="Wasserstein distance W (rad)", ylabel="asymmetry ρ")
    style_axes(main, "")
    for axes in (top, right):
        axes.axis("off")
    top.set(xlim=main.get_xlim(), ylim=(0.0, None))
    right.set(xlim=(0.0, None), ylim=main.get_ylim())
    left = _LEFT / _WIDTH
    figure.text(left, 1.0 - 0.3 / height, title, fontsize=11, color=DARK)
    figure.text(left, 0.1 / height, note, fontsize=8.0, color=FAINT)
    figure.legend(
        [
            Line2D([], [], linestyle="", marker="o", markersize=6.0, color=color)
            for color in DISTINCT[: len(distances)]
        ],
        [f"{name}: {found[name]}" for name in distances],
        loc="lower left",
        bbox_to_anchor=(left, _FOOT / height),
        frameon=False,
        fontsize=9.5,
        labelcolor=DARK,
        handletextpad=0.2,
        borderaxespad=0.0,
        borderpad=0.0,
    )
    return figure


def _scatter(axes: Axes, asymmetry: Floats, distances: Sequence[Floats]) -> None:
    """Points body after body, so that no comparison lies on top of all others."""
    axes.scatter(
        np.stack(distances, axis=1).ravel(),
        np.repeat(asymmetry, len(distances)),
        s=12,
        c=DISTINCT[: len(distances)] * len(asymmetry),
        alpha=0.5,
        linewidths=0,
    )


def _density(values: Floats, most: float) -> tuple[Floats, Floats]:
    """Places from 0 to `most` and the density of values, at least 0, at them: a Gaussian kernel
    estimate of the width by Scott's rule whose part below 0 is folded back."""
    estimate = gaussian_kde(values)
    places = np.linspace(0.0, most, _CURVE_POINTS)
    return places, estimate(places) + estimate(-places)
