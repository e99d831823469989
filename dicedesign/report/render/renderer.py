"""Pictures of a smooth surface, perhaps coloured, perhaps within a shell of glass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.report.render.raster import Camera, rasterize
from dicedesign.report.render.shading import (
    LINE,
    MATERIAL,
    SAMPLES,
    brightness,
    corner_normals,
    facing_normals,
    outline,
    recess_shade,
    sample_means,
)
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["PaintedSurface", "Shell", "render_surface"]

_SHARP_DEGREES: Final = 180.0

_LINE_STRENGTH: Final = 0.8

_PAINT_SHADE: Final = 0.55

_GLASS: Final = np.array([0.52, 0.57, 0.62])

_GLASS_OPACITY: Final = 0.10

_GLASS_GRAZING: Final = 0.20

_TINT_OPACITY: Final = 0.7

_FAR_OPACITY: Final = 0.6

_LEAST_AREA: Final = 1e-6

_EDGE_OPACITY: Final = 0.35

_FLAT_COSINE: Final = np.cos(np.radians(1.0))


@dataclass(frozen=True, eq=False)
class PaintedSurface:
    """A surface to draw.

    Attributes
    ----------
    points: (n, 3) in any length unit.
    triangles: (t, 3), oriented alike; both sides are drawn alike.
    colors: (n, 3) red, green and blue of each point from 0 to 1, or None for the material of dice.
    """

    points: Floats
    triangles: Integers
    colors: Floats | None = None

    @cached_property
    def corner_normals(self) -> Floats:
        """(t, 3, 3), see `corner_normals`."""
        return corner_normals(self.points, self.triangles)


@dataclass(frozen=True, eq=False)
class Shell:
    """A convex shell of glass around a surface.

    Attributes
    ----------
    vertices: (v, 3) in the length unit of the surface.
    triangles: (h, 3).
    tints: (h, 3) red, green and blue from 0 to 1 of tinted triangles, and NaN of clear ones.
    """

    vertices: Floats
    triangles: Integers
    tints: Floats


def render_surface(
    surface: PaintedSurface,
    camera: Camera,
    size: int,
    shell: Shell | None = None,
    backdrop: Floats | None = None,
) -> NDArray[np.uint8]:
    """Picture of a surface, lit from the upper left, with silhouettes and steps outlined.

    Smooth parts are shaded smoothly; recesses are darker than their surroundings. Of a shell, the
    edges are drawn and the tinted triangles coloured, those on its far side paler.

    Parameters
    ----------
    surface: what to draw.
    camera: where to look from.
    size: pixels a side, above 0.
    shell: around the surface, or None.
    backdrop: (size, size) brightness from 0 to 1 of the paper behind, or None for white.

    Returns
    -------
    (size, size, 3) uint8.
    """
    fine = SAMPLES * size
    picture = np.ones((fine, fine, 3))
    if backdrop is not None:
        picture *= _fine(backdrop)[..., None]
    if shell is not None:
        positions = camera.pixel_positions(shell.vertices, fine)
        _draw_glass(picture, positions * [1.0, 1.0, -1.0], shell, _FAR_OPACITY)
    _draw_surface(picture, surface, camera)
    if shell is not None:
        _draw_glass(picture, positions, shell, 1.0)
    pixels = np.stack([sample_means(picture[..., k]) for k in range(3)], axis=-1)
    return np.rint(255.0 * pixels).astype(np.uint8)


def _fine(pixels: Floats) -> Floats:
    """Pixels (h, w) as samples."""
    return pixels.repeat(SAMPLES, axis=0).repeat(SAMPLES, axis=1)


def _draw_surface(picture: Floats, surface: PaintedSurface, camera: Camera) -> None:
    """Draw the surface over samples (f, f, 3)."""
    fine = len(picture)
    positions = camera.pixel_positions(surface.points, fine)
    seen, depth = rasterize(positions, surface.triangles, fine)
    covered = seen >= 0
    if not covered.any():
        return
    triangle = seen[covered]
    corners = positions[surface.triangles]
    doubled = _doubled_areas(corners)
    weights = _weights(corners, doubled, triangle, np.nonzero(covered))
    # Normals of triangles that are seen from behind are turned.
    side = np.where(doubled > 0.0, 1.0, -1.0)[:, None, None]
    normals = _mixed(side * (surface.corner_normals @ camera.frame().T), triangle, weights)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(lengths > 0.0, lengths, 1.0)
    height = sample_means(np.where(covered, depth, 0.0))
    shade = brightness(normals)
    shade *= _fine(recess_shade(sample_means(covered), height))[covered]
    if surface.colors is None:
        color = shade[:, None] * MATERIAL
    else:
        # Shading is kept weak where darkness may have a meaning.
        shade = 1.0 - _PAINT_SHADE * (1.0 - shade)
        color = shade[:, None] * _mixed(surface.colors[surface.triangles], triangle, weights)
    picture[covered] = color
    line = outline(seen, facing_normals(corners), depth, _SHARP_DEGREES)
    picture[line] += _LINE_STRENGTH * (LINE - picture[line])


def _doubled_areas(corners: Floats) -> Floats:
    """(t,) twice the areas on paper of triangles (t, 3, 3), below 0 where they run clockwise."""
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(one[:, 1] * other[:, 0] - one[:, 0] * other[:, 1])


def _weights(
    corners: Floats, doubled: Floats, triangle: Integers, samples: tuple[NDArray[np.intp], ...]
) -> Floats:
    """Barycentric coordinates (m, 3) of samples' centres in triangles that they see.

    corners: (t, 3, 3) of triangles, column, row and depth; doubled: (t,) their `_doubled_areas`;
    triangle: (m,) of each sample; samples: (m,) their rows and (m,) their columns.
    """
    first, one, other = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    # The few samples in slivers take their first corner.
    wide = np.abs(doubled) > _LEAST_AREA
    scale = np.divide(-1.0, doubled, out=np.zeros_like(doubled), where=wide)
    row, column = samples
    x = column + 0.5 - first[triangle, 0]
    y = row + 0.5 - first[triangle, 1]
    second = (x * other[triangle, 1] - y * other[triangle, 0]) * scale[triangle]
    third = (y * one[triangle, 0] - x * one[triangle, 1]) * scale[triangle]
    weights = np.stack([1.0 - second - third, second, third], axis=1).clip(0.0, 1.0)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _mixed(values: Floats, triangle: Integers, weights: Floats) -> Floats:
    """Values at corners (t, 3, 3) as means (m, 3) by weights (m, 3) over triangles (m,)."""
    mixed = weights[:, :1] * values[triangle, 0]
    mixed += weights[:, 1:2] * values[triangle, 1]
    mixed += weights[:, 2:] * values[triangle, 2]
    return mixed


def _draw_glass(picture: Floats, positions: Floats, shell: Shell, strength: float) -> None:
    """Draw the side of a shell that is nearer to the camera over samples (f, f, 3)."""
    seen, _ = rasterize(positions, shell.triangles, len(picture))
    covered = seen >= 0
    normals = facing_normals(positions[shell.triangles])
    slope = 1.0 - normals[:, 2]
    clear = np.isnan(shell.tints[:, 0])
    opacity = np.where(clear, _GLASS_OPACITY + _GLASS_GRAZING * slope**2, _TINT_OPACITY)
    tints = np.where(clear[:, None], _GLASS, shell.tints)
    opacity *= strength
    triangle = seen[covered]
    picture[covered] += opacity[triangle, None] * (tints[triangle] - picture[covered])
    edge = np.zeros_like(covered)
    for here, there in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        change = seen[here] != seen[there]
        one, other = seen[here][change], seen[there][change]
        # Facets of more than three corners are several triangles.
        bent = (normals[one] * normals[other]).sum(-1) < _FLAT_COSINE
        edge[here][change] |= bent | (one < 0) | (other < 0)
    picture[edge] += strength * _EDGE_OPACITY * (LINE - picture[edge])
