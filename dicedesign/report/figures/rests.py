"""The die lying on each of its outcomes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.picture_grid import picture_grid, trimmed
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.report.render.cameras import framed
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Shell, Surface, render
from dicedesign.report.render.scene import cameras_around, shell_of, surface_of
from dicedesign.report.render.shadow import shadowed_table
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

__all__ = ["rests_figure"]

_COLUMNS: Final = 4

_PIXELS: Final = 400

_PIXELS_OF_MANY: Final = 300

_RISE: Final = 18.0

_TURN: Final = 25.0


def rests_figure(
    surface: Surface,
    shell: Shell,
    downs: Floats,
    labels: Sequence[str],
    probabilities: Floats,
    front: Floats,
) -> Paper:
    """A die as it lies on a table after each outcome, and below that its underside.

    Parameters
    ----------
    surface: the die.
    shell: its convex hull, with its rests tinted; it is drawn over the undersides.
    downs: (k, 3) direction of the body that points down in each outcome, of any length above 0.
    labels: k outcomes, at least one.
    probabilities: (k,) in [0, 1], written beside the labels.
    front: (3,) direction of the body that is rather toward the viewer than away from him.

    Raises
    ------
    InputError: there is no outcome, or not one direction, label and probability for each.
    """
    if not 0 < len(downs) == len(labels) == len(probabilities):
        raise InputError(
            "outcomes: expected at least one, with one direction, one label and one probability "
            f"each, got {len(downs)} directions, {len(labels)} labels and {len(probabilities)} "
            "probabilities"
        )
    columns = min(_COLUMNS, len(downs))
    size = _PIXELS if columns < _COLUMNS else _PIXELS_OF_MANY
    rise = np.radians(_RISE)
    downs = downs / np.linalg.norm(downs, axis=1, keepdims=True)
    above, below, shadows = [], [], []
    for down in downs:
        level = _level(surface.points, down, front)
        direction = np.cos(rise) * level - np.sin(rise) * down
        above.append(Camera(direction, -down, np.zeros(3), 1.0))
        # As seen when the die is tipped backward, its front upward.
        below.append(Camera(down, level, np.zeros(3), 1.0))
        heights = surface.points @ down
        shadows.append(surface.points + (heights.max() - heights)[:, None] * down)
    seen = [np.concatenate([surface.points, shadow]) for shadow in shadows]
    cameras = framed([*above, *below], [*seen, *seen])
    lying, undersides = [], []
    for k in range(len(downs)):
        heights = surface.points @ -downs[k]
        table = shadowed_table(
            surface.points,
            surface.triangles,
            heights - heights.min(),
            -downs[k],
            cameras[k],
            size,
            cameras[k].half_width,
        )
        lying.append(render(surface, cameras[k], size, backdrop=table))
        undersides.append(render(surface, cameras[len(downs) + k], size, shell))
    written = [
        f"{label}: {100.0 * probability:.2f} %"
        for label, probability in zip(labels, probabilities.tolist(), strict=True)
    ]
    pictures, titles = [], []
    for first in range(0, len(downs), columns):
        row = slice(first, first + columns)
        blank = columns - len(labels[row])
        for views, texts in ((lying, written), (undersides, [f"{x}: underside" for x in labels])):
            pictures += trimmed(views[row] + blank * [np.full_like(views[0], 255)])
            titles += texts[row] + blank * [""]
    return picture_grid(pictures, titles, columns)


def _level(points: Floats, down: Floats, front: Floats) -> Floats:
    """The level unit direction (3,) to a viewer who sees points (n, 3) almost from their broad
    side, turned a little, and on the side of the front (3,) where there are two."""
    level = np.eye(3) - np.outer(down, down)
    spread = (points - points.mean(axis=0)) @ level
    # In rising order, and the first is that of `down`, along which there is none.
    _, narrow, long = np.linalg.eigh(spread.T @ spread)[1].T
    narrow, long = (axis if axis @ front >= 0.0 else -axis for axis in (narrow, long))
    turn = np.radians(_TURN)
    return np.asarray(np.cos(turn) * narrow + np.sin(turn) * long)


def _draw(die: FinishedDie) -> bytes:
    assert die.reshaped is not None
    outcomes = die.plain.outcomes
    has_rest = (outcomes.rest_counts > 0)[:, None]
    # An outcome without a rest is shown where it was meant to be.
    downs = np.where(has_rest, die.plain.poses.normals[outcomes.main], die.reshaped.directions)
    front = cameras_around(die)[0].direction
    labels = die.result.labels
    return rests_figure(surface_of(die), shell_of(die), downs, labels, outcomes.odds, front).png()


FIGURES.register(
    Figure(
        name="rests",
        line="the die as it lies after each outcome",
        rank=10,
        title="How the die lies after each outcome",
        caption=(
            "Above, the die on a table, with the outcome and its probability; below, its "
            "underside, as seen when the die is tipped backward. Coloured are the facets of its "
            "convex hull that it rests on, in the colour of their outcome."
        ),
        wanted=lambda die: die.reshaped is not None,
        draw=_draw,
    )
)
