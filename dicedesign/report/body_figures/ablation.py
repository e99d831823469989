"""A die by the paper's method, and without one regularizer after the other, as in figure 9."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from dicedesign.geometry.sphere import angle_between
from dicedesign.report.body_figures.body_figure import (
    BODY_FIGURES,
    Ablation,
    BodyFigure,
)
from dicedesign.report.charts.palette import ACCENT, BASINS, rgb
from dicedesign.report.charts.paper import NOTE, Paper, Picture
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.render.shading import MATERIAL
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["ablation_figure"]

PIXELS: Final = 360

COLUMNS: Final = 2

GAP: Final = 24.0

TITLES: Final = 64.0
"""Room above each pair of pictures."""

SIDE: Final = np.array([1.0, -0.7, 0.5])

NOTE_BELOW: Final = (
    "Each die from two opposite sides. In pale colours the facets of the outcomes, in a strong one "
    "further rests that count for one of them."
)


def ablation_figure(ablations: Sequence[Ablation]) -> Paper:
    """Dice, each from two sides, with what was left out in their design, how far their odds are
    off, and how far rests are from the most probable one of their outcome."""
    rows = -(-len(ablations) // COLUMNS)
    wide, tall = 2.0 * PIXELS + GAP, PIXELS + TITLES + GAP
    paper = Paper(COLUMNS * wide + GAP, rows * tall + 40.0)
    for number, ablation in enumerate(ablations):
        row, column = divmod(number, COLUMNS)
        left, top = GAP + column * wide, GAP + row * tall
        for k, side in enumerate((SIDE, -SIDE)):
            paper.picture(_view(ablation, side), left + k * PIXELS, top + TITLES)
        middle = left + PIXELS
        paper.text(ablation.name, (middle, top + 12.0))
        paper.text(_told(ablation), (middle, top + 42.0), size=NOTE)
    paper.text(NOTE_BELOW, (paper.width / 2.0, paper.height - 22.0), size=NOTE)
    return paper


def _told(ablation: Ablation) -> str:
    main, normals = np.unique(_main(ablation)), ablation.poses.normals
    pairs = np.triu_indices(len(main), 1)
    apart = angle_between(normals[main[pairs[0]]], normals[main[pairs[1]]]).min(initial=np.pi)
    rests, outcomes = len(normals), len(main)
    said = (
        f"|p − q| up to {ablation.error:.1e}, outcomes {np.degrees(apart):.0f}° apart, {rests} "
        f"rests for {outcomes} of them"
    )
    stray = float(np.degrees(_strays(ablation).max()))
    return f"{said}, up to {stray:.1f}° off" if rests > outcomes else said


def _main(ablation: Ablation) -> Integers:
    """(k,) the most probable rest of the outcome of each rest, which come the most probable
    first."""
    _, first, number = np.unique(ablation.outcomes, return_index=True, return_inverse=True)
    return np.asarray(first[number])


def _strays(ablation: Ablation) -> Floats:
    """(k,) angles in radians from each rest to the most probable one of its outcome."""
    normals = ablation.poses.normals
    return angle_between(normals, normals[_main(ablation)])


def _view(ablation: Ablation, side: Floats) -> Picture:
    surface = _painted(ablation)
    center = (surface.points.min(axis=0) + surface.points.max(axis=0)) / 2.0
    radius = 1.03 * float(np.linalg.norm(surface.points - center, axis=1).max())
    return render(surface, Camera(side, np.array([0.0, 0.0, 1.0]), center, radius), PIXELS)


def _painted(ablation: Ablation) -> Surface:
    """The hull with its rests in colour."""
    hull, poses = ablation.poses.hull, ablation.poses
    colors = np.tile(np.asarray(MATERIAL, dtype=np.float64), (len(hull.normals), 1))
    pale = 0.35 + 0.65 * rgb(BASINS)
    first = np.unique(_main(ablation))
    colors[poses.facets] = rgb([ACCENT])[0]
    colors[poses.facets[first]] = pale[ablation.outcomes[first] % len(pale)]
    of_triangle = np.repeat(np.arange(len(hull.normals)), np.diff(hull.facet_start) - 2)
    corners = hull.vertices[hull.triangles].reshape(-1, 3)
    flat = np.arange(len(corners)).reshape(-1, 3)
    return Surface(corners, flat, colors[of_triangle].repeat(3, axis=0), smooth=False)


BODY_FIGURES.register(
    BodyFigure(
        name="ablation",
        line="a recipe's die by the paper's method, and without one regularizer after the other",
        rank=60,
        draw=lambda subject: ablation_figure(subject.make_ablations()),
    )
)
