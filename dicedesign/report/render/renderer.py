"""Pictures of a solid: flat or smooth, perhaps coloured, perhaps within a shell of glass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dicedesign.report.render.pictures import Picture
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

_SHARP_DEGREES: Final = 20.0

_LINE_STRENGTH: Final = {False: 1.0, True: 0.8}
"""Of outlines of flat and of smooth surfaces."""

_PAINT_SHADE: Final = 0.55

_GLASS: Final = np.array([0.52, 0.57, 0.62])

_GLASS_OPACITY: Final = 0.10

_GLASS_GRAZING: Final = 0.20

_TINT_OPACITY: Final = 0.7

_FAR_OPACITY: Final = 0.6

_LEAST_AREA: Final = 1e-6

_EDGE_OPACITY: Final = 0.35

_FLAT_COSINE: Final = np.cos(np.radians(1.0))

_RECESS_REACH: Final = 0.02
"""Of the surroundings of a recess, over the extent of what is seen."""

_MARGIN: Final = 2
"""Pixels drawn around what is seen, for its outline."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface to draw.

    Attributes
    ----------
    points: (n, 3) in any length unit.
    triangles: (t, 3), oriented alike where the surface is smooth; both sides are drawn alike.
    colors: (n, 3) red, green and blue of each point from 0 to 1, or None for the material of dice.
    smooth: whether the triangles stand for a smooth surface, whose edges are not outlined, unlike
        those of a solid with flat faces that are sharper than 20 degrees.
    """

    points: Floats
    triangles: Integers
    colors: Floats | None = None
    smooth: bool = True

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


def render(
    surface: Surface,
    camera: Camera,
    size: int,
    shell: Shell | None = None,
    backdrop: Floats | None = None,
) -> Picture:
    """Picture of a surface, lit from the upper left, with silhouettes and steps outlined.

    Recesses are darker than their surroundings. Of a shell, the edges are drawn and the tinted
    triangles coloured, those on its far side paler.

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
    paper = np.ones((size, size)) if backdrop is None else backdrop
    picture = np.rint(255.0 * paper).astype(np.uint8)[..., None].repeat(3, axis=2)
    places = camera.pixel_positions(surface.points, size)
    around = places if shell is None else camera.pixel_positions(shell.vertices, size)
    window = _window(np.concatenate([places, around])[:, :2], size)
    if window is None:
        return picture
    column, row, side = window
    corner = np.array([column, row, 0.0])
    rows, columns = slice(row, row + side), slice(column, column + side)
    part = np.ones((side, side, 3))
    behind = picture[rows, columns] / 255.0
    part[: behind.shape[0], : behind.shape[1]] = behind
    layers = [_surface_layer(surface, SAMPLES * (places - corner), camera, side)]
    if shell is not None:
        positions = SAMPLES * (around - corner)
        far = _glass_layer(positions * [1.0, 1.0, -1.0], shell, side, _FAR_OPACITY)
        layers = [far, *layers, _glass_layer(positions, shell, side, 1.0)]
    for layer in layers:
        part *= 1.0 - layer.opacity[..., None]
        part += layer.color
    pixels = np.rint(255.0 * part).astype(np.uint8)
    picture[rows, columns] = pixels[: behind.shape[0], : behind.shape[1]]
    return picture


class _Window(NamedTuple):
    """A square part of a picture, which it may leave to the right and below."""

    column: int
    row: int
    side: int


def _window(places: Floats, size: int) -> _Window | None:
    """The part of a picture that shows places (n, 2), or None where none does."""
    low = np.floor(places.min(axis=0)).astype(int) - _MARGIN
    high = np.ceil(places.max(axis=0)).astype(int) + _MARGIN
    low, high = low.clip(0, size), high.clip(0, size)
    if (high <= low).any():
        return None
    return _Window(int(low[0]), int(low[1]), int((high - low).max()))


class _Layer(NamedTuple):
    """What is drawn in pixels: colours (n, n, 3) times opacities (n, n), and these."""

    color: Floats
    opacity: Floats


def _surface_layer(surface: Surface, positions: Floats, camera: Camera, side: int) -> _Layer:
    """The surface with points at positions (n, 3), in samples of a window of a side in pixels."""
    fine = SAMPLES * side
    seen, depth = rasterize(positions, surface.triangles, fine)
    covered = seen >= 0
    height = sample_means(np.where(covered, depth, 0.0))
    recess = recess_shade(sample_means(covered), height, _RECESS_REACH * side)
    corners = positions[surface.triangles]
    flat = facing_normals(corners)
    line = outline(seen, flat, depth, 180.0 if surface.smooth else _SHARP_DEGREES)
    strength = _LINE_STRENGTH[surface.smooth]
    lines = strength * line.astype(np.float32)
    left = covered.ravel() * (1.0 - lines)
    share, lines = (sample_means(a.reshape(fine, fine)) for a in (left, lines))
    if surface.smooth or surface.colors is not None:
        sample = np.flatnonzero(covered)
        triangle = seen.ravel()[sample]
        doubled = _doubled_areas(corners)
        weights = _weights(corners, doubled, triangle, *np.divmod(sample, fine))
    shade = np.zeros(fine * fine, dtype=np.float32)
    if surface.smooth:
        # Normals of triangles that are seen from behind are turned.
        turn = np.where(doubled > 0.0, 1.0, -1.0)[:, None, None]
        normals = _mixed(turn * (surface.corner_normals @ camera.frame().T), triangle, weights)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        shade[sample] = brightness(normals / np.where(lengths > 0.0, lengths, 1.0))
    else:
        # What sees nothing has the number -1, that of the last.
        shade = np.append(brightness(flat), 0.0).astype(np.float32)[seen].ravel()
    if surface.colors is None:
        color = (sample_means((shade * left).reshape(fine, fine)) * recess)[..., None] * MATERIAL
    else:
        # Shading is kept weak where darkness may have a meaning.
        dark = 1.0 - shade[sample] * _fine(recess).ravel()[sample]
        tint = _mixed(surface.colors[surface.triangles], triangle, weights)
        tint *= (left[sample] * (1.0 - _PAINT_SHADE * dark))[:, None]
        samples = np.zeros((fine * fine, 3))
        samples[sample] = tint
        color = sample_means(samples.reshape(fine, fine, 3))
    return _Layer(color + lines[..., None] * LINE, share + lines)


def _fine(pixels: Floats) -> Floats:
    """Pixels (h, w) as samples."""
    return pixels.repeat(SAMPLES, axis=0).repeat(SAMPLES, axis=1)


def _doubled_areas(corners: Floats) -> Floats:
    """(t,) twice the areas on paper of triangles (t, 3, 3), below 0 where they run clockwise."""
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(one[:, 1] * other[:, 0] - one[:, 0] * other[:, 1])


def _weights(
    corners: Floats,
    doubled: Floats,
    triangle: Integers,
    row: NDArray[np.intp],
    column: NDArray[np.intp],
) -> Floats:
    """Barycentric coordinates (m, 3) of samples' centres in triangles that they see.

    corners: (t, 3, 3) of triangles, column, row and depth; doubled: (t,) their `_doubled_areas`;
    triangle: (m,) of each sample; row, column: (m,) of the samples.
    """
    first, one, other = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    # The few samples in slivers take their first corner.
    wide = np.abs(doubled) > _LEAST_AREA
    scale = np.divide(-1.0, doubled, out=np.zeros_like(doubled), where=wide)
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


def _glass_layer(positions: Floats, shell: Shell, side: int, strength: float) -> _Layer:
    """The side of a shell that is nearer to the camera, in samples of a window of a side in
    pixels."""
    seen, _ = rasterize(positions, shell.triangles, SAMPLES * side)
    normals = facing_normals(positions[shell.triangles])
    slope = 1.0 - normals[:, 2]
    clear = np.isnan(shell.tints[:, 0])
    opacity = np.where(clear, _GLASS_OPACITY + _GLASS_GRAZING * slope**2, _TINT_OPACITY)
    tints = np.where(clear[:, None], _GLASS, shell.tints)
    # What sees nothing has the number -1, that of the last.
    opacity = np.append(strength * opacity, 0.0)
    samples = np.concatenate([opacity[:, None], opacity[:, None] * np.vstack([tints, LINE])], 1)[
        seen
    ]
    edge = np.zeros(seen.shape, dtype=bool)
    for this, next_one in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        change = seen[this] != seen[next_one]
        one, other = seen[this][change], seen[next_one][change]
        # Facets of more than three corners are several triangles.
        bent = (normals[one] * normals[other]).sum(-1) < _FLAT_COSINE
        edge[this][change] |= bent | (one < 0) | (other < 0)
    dark = strength * _EDGE_OPACITY
    samples[edge] += dark * (np.append(1.0, LINE) - samples[edge])
    pixels = sample_means(samples)
    return _Layer(pixels[..., 1:], pixels[..., 0])
