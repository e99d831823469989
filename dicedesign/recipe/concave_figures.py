"""The pictures of a concave die's report."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from dicedesign.concave.result import ConcaveDie
from dicedesign.design.targets import Target
from dicedesign.recipe.concave_judging import JudgedSurface
from dicedesign.recipe.concave_summary import search_summary
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.report.charts.png import png_bytes
from dicedesign.report.figures.displacement import displacement_figure
from dicedesign.report.figures.odds_before_after import odds_before_after_figure
from dicedesign.report.figures.resting_views import resting_views_figure
from dicedesign.report.figures.stage_energies import stage_energies_figure
from dicedesign.report.figures.surface_views import (
    before_after_figure,
    crossings_figure,
    hull_overlay_figure,
    outcome_tints,
)
from dicedesign.report.render.cameras import three_cameras
from dicedesign.report.render.renderer import PaintedSurface, Shell
from dicedesign.runtime.arrays import Floats

__all__ = ["concave_figures"]

_UPRIGHT: Final = (".stl", ".3mf", ".xyz")
"""Files of programs for printing and construction, whose z axis is upward; in those of programs
for pictures it is y."""


def concave_figures(recipe: Recipe, judged: JudgedSurface, die: ConcaveDie) -> dict[str, bytes]:
    """PNG bytes of "rests", "before_after", "odds", "hull", "displacement", where the surface meets
    itself "crossings", and where there are steps to show "energy"."""
    target, up = recipe.target.target(), _upward(recipe)
    before, after, triangles = die.before.points, die.after.points, die.after.triangles
    cameras = three_cameras(np.concatenate([before, after]), up)
    outcomes, solid = judged.outcomes, judged.surface
    surface, shell = PaintedSurface(solid.points, solid.triangles), _shell(judged)
    around = three_cameras(solid.points, up)
    images = {
        "rests": _rests(judged, target, surface, shell, around[0].direction, die.directions),
        "before_after": before_after_figure(before, after, triangles, cameras),
        "odds": odds_before_after_figure(
            target.labels,
            target.probabilities,
            judged.before.odds,
            outcomes.odds,
            judged.before.elsewhere,
            outcomes.elsewhere,
        ),
        "hull": hull_overlay_figure(surface, shell, target.labels, around),
        "displacement": displacement_figure(before, after, triangles, cameras),
    }
    pairs = judged.quality.intersections
    if len(pairs) > 0:
        images["crossings"] = crossings_figure(after, triangles, pairs, cameras)
    history = search_summary(die)["history"]
    if history:
        images["energy"] = stage_energies_figure(history)
    return {name: png_bytes(figure) for name, figure in images.items()}


def _rests(
    judged: JudgedSurface,
    target: Target,
    surface: PaintedSurface,
    shell: Shell,
    front: Floats,
    directions: Floats,
) -> Figure:
    outcomes = judged.outcomes
    has_rest = (outcomes.rest_counts > 0)[:, None]
    # An outcome without a rest is shown where it was meant to be.
    downs = np.where(has_rest, judged.poses.normals[outcomes.main], directions)
    return resting_views_figure(surface, shell, downs, target.labels, outcomes.odds, front)


def _shell(judged: JudgedSurface) -> Shell:
    """The hull of the die, with the facets tinted that it rests on."""
    hull = judged.poses.hull
    of_facet = np.full(len(hull.normals), -1, dtype=np.int64)
    of_facet[judged.poses.facets] = judged.outcomes.outcome_of_rest
    # A facet of n corners is a fan of n - 2 triangles.
    of_triangle = np.repeat(of_facet, np.diff(hull.facet_start) - 2)
    return Shell(hull.vertices, hull.triangles, outcome_tints(of_triangle))


def _upward(recipe: Recipe) -> Floats:
    """The direction (3,) that is upward in the pictures."""
    mesh = recipe.start.mesh
    upright = mesh is None or Path(mesh.path).suffix.lower() in _UPRIGHT
    return np.array([0.0, 0.0, 1.0] if upright else [0.0, 1.0, 0.0])
