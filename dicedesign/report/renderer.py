"""Renderer of a solid with flat faces or a smooth surface, colored or not, on a table, or within a
shell of glass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label, uniform_filter

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.report.raster import Camera, Picture, rasterize
from dicedesign.runtime.arrays import Booleans, Floats, Integers, ragged_ranges

MATERIAL = np.array([0.94, 0.88, 0.76])
"""Color of a die in full light."""

LINE = np.array([0.20, 0.18, 0.16])
"""Color of outlines."""

SAMPLES = 2
"""Samples along each side of a pixel."""

LIGHT = np.array([-0.40, 0.55, 0.73])
"""Unit direction to the light: right, up, toward the camera."""

AMBIENT = 0.38
"""Brightness of surfaces that face away from the light."""

RECESS_SHADE = 0.45
"""Darkening of a recess as deep as the reach of its surroundings."""

PAINT_SHADE = 0.55
"""Strength of the shading of colored surfaces, on which darkness may have a meaning."""

SMOOTH_DEGREES = 35.0
"""Largest angle between two triangles of a smooth surface that are shaded as one."""

MAX_CORNERS = 100_000
"""Corners whose normals are computed at once."""

SHARP_DEGREES = 20.0
"""Angle above which edges of a solid with flat faces are outlined."""

STEP_SAMPLES = 2.0
"""Height, in samples, above which steps in depth are outlined."""

MIN_LINE_SAMPLES = 24
"""Number of samples of the shortest lines that are drawn."""

CHUNK_SAMPLES = 1 << 17
"""Number of samples that are shaded at once, which limits memory."""

GLASS = np.array([0.52, 0.57, 0.62])
"""Color of clear glass."""


@dataclass(frozen=True, eq=False)
class RenderMesh:
    """Surface to draw.

    Attributes
    ----------
    points: (n, 3) in any length unit.
    triangles: (t, 3), consistently oriented if the surface is smooth; both sides are drawn.
    colors: (n, 3) red, green and blue of each point from 0 to 1, or None for the material of dice.
    smooth: whether the triangles approximate a smooth surface; if not, edges sharper than 20
        degrees are outlined.
    """

    points: Floats
    triangles: Integers
    colors: Floats | None = None
    smooth: bool = True

    @cached_property
    def corner_normals(self) -> Floats:
        """(t, 3, 3) unit normals at the corners of triangles, to interpolate within each triangle.

        The normal at a corner is the mean, weighted by area, over the triangles at its vertex that
        turn at most 35 degrees from the triangle of the corner: smooth parts are shaded smoothly,
        and sharp edges stay sharp. Triangles without area have normals 0.
        """
        areas = doubled_area_vectors(self.points, self.triangles)
        flat = _normalize(areas)
        vertex = self.triangles.ravel()
        by_vertex = np.argsort(vertex, kind="stable")
        counts = np.bincount(vertex, minlength=len(self.points))
        starts = np.cumsum(counts) - counts
        sums = []
        for first in range(0, len(vertex), MAX_CORNERS):
            some = vertex[first : first + MAX_CORNERS]
            # Pairs of corners at one vertex.
            corner, place = ragged_ranges(starts[some], counts[some])
            triangle, other = (first + corner) // 3, by_vertex[place] // 3
            smooth = (flat[triangle] * flat[other]).sum(-1) >= np.cos(np.radians(SMOOTH_DEGREES))
            corner, other = corner[smooth], other[smooth]
            sums += [np.bincount(corner, areas[other, k], len(some)) for k in range(3)]
        columns = [np.concatenate([np.zeros(0), *sums[k::3]]) for k in range(3)]
        return _normalize(np.stack(columns, axis=1)).reshape(-1, 3, 3)


def color_triangles(points: Floats, triangles: Integers, colors: Floats) -> RenderMesh:
    """Solid with flat faces whose triangles (t, 3) have colors (t, 3)."""
    corners = points[triangles].reshape(-1, 3)
    flat = np.arange(len(corners)).reshape(-1, 3)
    return RenderMesh(corners, flat, colors.repeat(3, axis=0), smooth=False)


def color_facets(hull: ConvexHull, colors: Floats) -> RenderMesh:
    """Solid of a convex hull whose facets have colors (m, 3)."""
    # A facet of n corners is a fan of n - 2 triangles.
    of_triangles = colors.repeat(np.diff(hull.facet_start) - 2, axis=0)
    return color_triangles(hull.vertices, hull.triangles, of_triangles)


def render(
    surface: RenderMesh,
    camera: Camera,
    size: int,
    shell: RenderMesh | None = None,
    backdrop: Floats | None = None,
) -> Picture:
    """Picture of a surface, lit from the upper left, with silhouettes and steps outlined.

    Recesses are darker than their surroundings. A shell of glass shows its edges and its tints,
    both paler on the far side.

    Parameters
    ----------
    surface, camera: what to draw, and where to look from.
    size: pixels along each side, above 0.
    shell: convex shell of glass around the surface, made by `color_triangles`, or None; NaN as the
        color of a triangle means clear glass.
    backdrop: (size, size) brightness from 0 to 1 of the paper behind, or None for white.

    Returns
    -------
    (size, size, 3) uint8.
    """
    paper = np.ones((size, size)) if backdrop is None else backdrop
    picture = np.rint(255.0 * paper).astype(np.uint8)[..., None].repeat(3, axis=2)
    places = camera.pixel_positions(surface.points, size)
    around = places if shell is None else camera.pixel_positions(shell.points, size)
    # Draw the square of pixels around the body alone, with two more on each side for outlines.
    ends = np.stack([np.floor(around.min(axis=0)) - 2.0, np.ceil(around.max(axis=0)) + 2.0])
    low, high = ends[:, :2].astype(np.int64).clip(0, size)
    if (high <= low).any():
        return picture
    side = int((high - low).max())
    column, row = low.clip(max=size - side)
    window = picture[row : row + side, column : column + side]
    corner = np.array([column, row, 0.0])
    layers = [_surface_layer(surface, SAMPLES * (places - corner), camera, side)]
    if shell is not None:
        positions = SAMPLES * (around - corner)
        far = _glass_layer(positions * [1.0, 1.0, -1.0], shell, side, 0.6)
        layers = [far, *layers, _glass_layer(positions, shell, side, 1.0)]
    mixed = window / 255.0
    for color, opacity in layers:
        mixed = mixed * (1.0 - opacity) + color
    window[:] = np.rint(255.0 * mixed)
    return picture


def render_clear(surface: RenderMesh, camera: Camera, size: int, shadow: Floats) -> Picture:
    """Picture (size, size, 4) of a surface as `render` draws it, with its opacity.

    shadow: (size, size) opacity from 0 to 1 of a shadow behind it.
    """
    positions = SAMPLES * camera.pixel_positions(surface.points, size)
    color, opacity = _surface_layer(surface, positions, camera, size)
    opacity = opacity + (1.0 - opacity) * shadow[..., None]
    color = color / np.where(opacity > 0.0, opacity, 1.0)
    clear = np.concatenate([color, opacity], axis=2)
    return np.rint(255.0 * clear.clip(0.0, 1.0)).astype(np.uint8)


def _surface_layer(
    surface: RenderMesh, positions: Floats, camera: Camera, side: int
) -> tuple[Floats, Floats]:
    """Colors (side, side, 3) times opacities, and opacities (side, side, 1), of a surface.

    positions: (n, 3) of its points, in samples; side: of the window, in pixels.
    """
    fine = SAMPLES * side
    triangle_of_pixel, depth = rasterize(positions, surface.triangles, fine)
    covered = triangle_of_pixel >= 0
    flat = _facing_normals(positions, surface.triangles)
    sharp_degrees = 180.0 if surface.smooth else SHARP_DEGREES
    line = _outline(triangle_of_pixel, surface.triangles, flat, depth, sharp_degrees)
    lines = (0.8 if surface.smooth else 1.0) * line.reshape(fine, fine, 1)
    left = covered[..., None] - lines * covered[..., None]
    share, height = sample_means(covered * 1.0), sample_means(np.where(covered, depth, 0.0))
    recess = _recess_shade(share, height, 0.02 * side)
    corners = positions[surface.triangles]
    turned = surface.corner_normals @ camera.frame().T if surface.smooth else None
    behind = recess.repeat(SAMPLES, axis=0).repeat(SAMPLES, axis=1).ravel()
    samples = np.zeros((fine * fine, 1 if surface.colors is None else 3))
    seen = np.flatnonzero(covered)
    for start in range(0, len(seen), CHUNK_SAMPLES):
        sample = seen[start : start + CHUNK_SAMPLES]
        triangle = triangle_of_pixel.ravel()[sample]
        normals = flat[triangle]
        if surface.smooth or surface.colors is not None:
            weights, is_front = _weights(corners, triangle, *np.divmod(sample, fine))
        if turned is not None:
            sides = np.where(is_front, 1.0, -1.0)[:, None]
            normals = _normalize(_mix(turned[triangle], weights) * sides)
        shade = brightness(normals)
        tint = shade[:, None]
        if surface.colors is not None:
            colors = _mix(surface.colors[surface.triangles[triangle]], weights)
            tint = colors * (1.0 - PAINT_SHADE * (1.0 - shade * behind[sample]))[:, None]
        samples[sample] = tint * left.reshape(-1, 1)[sample]
    full = recess[..., None] * MATERIAL if surface.colors is None else np.ones(3)
    color = full * sample_means(samples.reshape(fine, fine, -1))
    lined = sample_means(lines)
    return color + lined * LINE, sample_means(left) + lined


def _glass_layer(
    positions: Floats, shell: RenderMesh, side: int, strength: float
) -> tuple[Floats, Floats]:
    """Colors times opacities, and opacities, of the near side of a shell, as `_surface_layer`."""
    assert shell.colors is not None
    tints = shell.colors[shell.triangles[:, 0]]
    triangle_of_pixel, depth = rasterize(positions, shell.triangles, SAMPLES * side)
    normals = _facing_normals(positions, shell.triangles)
    clear = np.isnan(tints[:, :1])
    opacity = strength * np.where(clear, 0.1 + 0.2 * (1.0 - normals[:, 2:]) ** 2, 0.7)
    glass = np.hstack([opacity * np.where(clear, GLASS, tints), opacity])
    # Samples that see nothing have the index -1, which is the last row.
    samples = np.vstack([glass, np.zeros(4)])[triangle_of_pixel]
    # Edges between coplanar triangles are not drawn.
    edge = _outline(triangle_of_pixel, shell.triangles, normals, depth, 1.0)
    edge = edge.reshape(triangle_of_pixel.shape)
    samples[edge] += 0.2 * strength * (np.append(LINE, 1.0) - samples[edge])
    pixels = sample_means(samples)
    return pixels[..., :3], pixels[..., 3:]


def brightness(normals: Floats) -> Floats:
    """Brightness (...) from 0 to 1 of surfaces with unit normals (..., 3) in the camera's frame."""
    return AMBIENT + (1.0 - AMBIENT) * (normals @ LIGHT).clip(0.0)


def sample_means(samples: NDArray[Any]) -> Floats:
    """Mean (h, w, ...) over the 2 x 2 samples (2 h, 2 w, ...) of each pixel."""
    rows = samples[::2] + samples[1::2]
    return np.asarray((rows[:, ::2] + rows[:, 1::2]) / SAMPLES**2)


def _facing_normals(positions: Floats, triangles: Integers) -> Floats:
    """Unit normals (t, 3), toward the camera and in its frame, of triangles at positions (n, 3) in
    pixels; 0 for triangles without area, which no pixel sees."""
    normals = doubled_area_vectors(positions * np.array([1.0, -1.0, 1.0]), triangles)
    return _normalize(normals * np.where(normals[:, 2:] < 0.0, -1.0, 1.0))


def _normalize(vectors: Floats) -> Floats:
    """Unit vectors (t, 3) along vectors (t, 3); 0 stays 0."""
    lengths = norms(vectors)[:, None]
    return vectors / np.where(lengths > 0.0, lengths, 1.0)


def _weights(
    corners: Floats, triangle: Integers, row: NDArray[np.intp], column: NDArray[np.intp]
) -> tuple[Floats, Booleans]:
    """Barycentric coordinates (m, 3) of the centers of samples in the triangles that they see, and
    whether they see the outer sides of these.

    corners: (t, 3, 3) column, row and depth of the corners of triangles; triangle: (m,) triangle of
    each sample; row, column: (m,) positions of the samples.
    """
    first, one, other = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    doubled = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    # The few samples in slivers take the first corner.
    scale = np.where(np.abs(doubled) > 1e-6, doubled, np.inf)[triangle]
    x, y = column + 0.5 - first[triangle, 0], row + 0.5 - first[triangle, 1]
    second = (x * other[triangle, 1] - y * other[triangle, 0]) / scale
    third = (y * one[triangle, 0] - x * one[triangle, 1]) / scale
    weights = np.stack([1.0 - second - third, second, third], axis=1).clip(0.0, 1.0)
    return weights / weights.sum(axis=1, keepdims=True), doubled[triangle] < 0.0


def _mix(values: Floats, weights: Floats) -> Floats:
    """Means (m, 3), by weights (m, 3), of values (m, 3, 3) at the corners of triangles."""
    return np.asarray(np.einsum("mk,mkc->mc", weights, values))


def blur(pixels: Floats, reach: float) -> Floats:
    """Pixels (h, w), blurred by three running means, which is close to a Gaussian.

    reach: standard deviation in pixels, above 0. Beyond the border all is 0.
    """
    half = max(round((np.sqrt(4.0 * reach**2 + 1.0) - 1.0) / 2.0), 1)
    for _ in range(3):
        pixels = uniform_filter(pixels, 2 * half + 1, mode="constant")
    return pixels


def _recess_shade(coverage: Floats, height: Floats, reach: float) -> Floats:
    """Part of their light that pixels (h, w) keep; the less, the farther they are behind the mean
    depth of their surroundings.

    coverage: (h, w) part of each pixel that sees the surface; height: (h, w) mean depth in samples,
    0 off the surface; reach: radius of the surroundings, in pixels.
    """
    mean_height = height / np.where(coverage > 0.0, coverage, 1.0)
    behind = blur(height, reach) - mean_height * blur(coverage, reach)
    return np.asarray(1.0 - RECESS_SHADE * (behind / (SAMPLES * reach)).clip(0.0, 1.0))


def _outline(
    triangle_of_pixel: Integers,
    triangles: Integers,
    normals: Floats,
    depth: Floats,
    sharp_degrees: float,
) -> Booleans:
    """Mask (n * n,) of the samples on both sides of silhouettes, sharp edges and steps in depth.

    Slivers one sample wide between parts of one surface have no outlines, where triangles meet in a
    point there is no step, and specks are left out.

    triangle_of_pixel: (n, n) triangle of each sample, or -1.
    triangles: (t, 3) indices of points; normals: (t, 3), toward the camera.
    depth: (n, n) toward the camera, in samples.
    sharp_degrees: angle between the normals at an edge above which it is sharp.
    """
    triangle, height, side = triangle_of_pixel.ravel(), depth.ravel(), len(triangle_of_pixel)
    line = np.zeros(triangle.shape, dtype=bool)

    def parts(one: Integers, other: Integers, offset: tuple[float, float], apart: int) -> Booleans:
        """Whether an edge or a step parts samples, a number of samples apart."""
        first, second = normals[triangle[one]], normals[triangle[other]]
        parted = (first * second).sum(-1) < np.cos(np.radians(sharp_degrees))
        # Distance of each of two surface points from the plane of the other.
        rise = height[other] - height[one]
        away = [np.abs(apart * (n[:, :2] @ offset) + n[:, 2] * rise) for n in (first, second)]
        step = np.flatnonzero(~parted & (np.minimum(*away) > STEP_SAMPLES))
        ends = [triangles[triangle[sample[step]]] for sample in (one, other)]
        parted[step] = ~(ends[0][:, :, None] == ends[1][:, None]).any(axis=(1, 2))
        return np.asarray(parted)

    for step, offset in ((1, (1.0, 0.0)), (side, (0.0, -1.0))):
        # Within a triangle there is neither an edge nor a step.
        sample = np.flatnonzero(triangle[:-step] != triangle[step:])
        if step == 1:
            sample = sample[sample % side != side - 1]
        border = (triangle[sample] < 0) | (triangle[sample + step] < 0)
        inner = np.flatnonzero(~border)
        both = sample[inner]
        border[inner] = parts(both, both + step, offset, 1)
        # They also part the samples before and after, on the body and in the same row or column.
        inner = inner[border[inner]]
        before, after = sample[inner] - step, sample[inner] + 2 * step
        known = (before >= 0) & (after < len(triangle))
        if step == 1:
            known &= before // side == after // side
        known[known] &= (triangle[before[known]] >= 0) & (triangle[after[known]] >= 0)
        border[inner[known]] = parts(before[known], after[known], offset, 3)
        line[sample[border]] = True
        line[sample[border] + step] = True
    # Where a step is hardly one, it comes and goes.
    pieces, _ = label(line.reshape(side, side), np.ones((3, 3)))
    return np.asarray(line & (np.bincount(pieces.ravel()) >= MIN_LINE_SAMPLES)[pieces.ravel()])


def render_shadow(
    points: Floats,
    triangles: Integers,
    heights: Floats,
    up: Floats,
    camera: Camera,
    size: int,
    reach: float,
) -> Floats:
    """Brightness (size, size) from 0 to 1 of a white table under a body that is lit from above.

    The lower the body is above a point of the table, the darker it is there.

    Parameters
    ----------
    points, triangles: (n, 3) and (t, 3) of the body, in any length unit.
    heights: (n,) heights of the points above the table, at least 0.
    up: (3,) unit vector.
    camera: looks from above the table; size: pixels along each side.
    reach: height over which shadows fade.
    """
    positions = camera.pixel_positions(points - heights[:, None] * up, size)
    positions[:, 2] = -heights / reach
    triangle_of_pixel, depth = rasterize(positions, triangles, size)
    dark = np.where(triangle_of_pixel >= 0, 0.18 + 0.45 * np.exp(6.0 * depth), 0.0)
    return np.asarray(1.0 - blur(dark, 0.012 * reach * size / camera.half_width))


def with_shadow(points: Floats, up: Floats) -> Floats:
    """Points (2 n, 3) of a body on a table and of its shadow; up: (3,) unit vector."""
    heights = points @ up
    return np.concatenate([points, points - (heights - heights.min())[:, None] * up])


def render_on_table(surface: RenderMesh, up: Floats, camera: Camera, size: int) -> Picture:
    """Picture of a body on a table; up: (3,) unit vector."""
    points, heights = surface.points, surface.points @ up
    heights -= heights.min()
    reach = camera.half_width
    table = render_shadow(points, surface.triangles, heights, up, camera, size, reach)
    return render(surface, camera, size, backdrop=table)
