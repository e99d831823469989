"""Defects of the triangles of a surface, and how far they are distorted."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dicedesign.geometry.sphere import angle_between, norms
from dicedesign.geometry.surfaces.self_intersections import (
    intersecting_triangles,
    intersection_groups,
)
from dicedesign.geometry.triangles import Surface, doubled_area_vectors, edge_neighbors, find_parts
from dicedesign.runtime.arrays import Booleans, Floats, Integers, sums_by_index
from dicedesign.tolerances import SHARP_TURN, SLIVER_ANGLE

LISTED = 20
"""Most triangles and places listed in the plain data, beside their number."""

SHARE = 0.95
"""Share of the area whose largest distortion is given."""

TURNED_SHARE = 0.99
"""Share of the area whose largest turn is given."""

PEAK = 0.05
"""Radius, over the diagonal, of a sphere as curved as what grows to make a peak."""


@dataclass(frozen=True, eq=False)
class SurfaceQuality:
    """Defects of a closed surface.

    Attributes
    ----------
    points, triangles: their numbers.
    genus: number of handles.
    edges: shortest, mean and longest edge, relative to the diagonal of the surface's box.
    smallest_angle: of all triangles, in radians.
    slivers: (s,) triangles whose smallest angle is below `SLIVER_ANGLE`.
    inverted: (v,) triangles that face away, by more than a right angle, from the surface at two or
        three of their corners and did not in the reference. Which way it faces at a point is the
        mean of the normals around it, weighted by their angles there (Thuermer and Wuethrich,
        Computing vertex normals from polygonal facets, 1998).
    folds: (f, 2) pairs of triangles with a common edge at which the surface turns by more than
        `SHARP_TURN` and did not in the reference.
    intersections: (m, 2) pairs of triangles that meet, as from `intersecting_triangles`.
    places: (k, 3) middles of groups of such triangles, see `intersection_groups`.
    distortion: against the reference, see `surface_distortion`; None without one.
    turns: against the reference, see `surface_turns`; None without one.
    """

    points: int
    triangles: int
    genus: int
    edges: tuple[float, float, float]
    smallest_angle: float
    slivers: Integers
    inverted: Integers
    folds: Integers
    intersections: Integers
    places: Floats
    distortion: dict[str, float] | None
    turns: SurfaceTurns | None

    def sentences(self) -> tuple[str, ...]:
        """The defects in words, one sentence each; none for a surface without any."""

        def count(items: NDArray[Any], noun: str) -> str:
            return f"{len(items)} {noun}{'' if len(items) == 1 else 's'}"

        defects = []
        if len(self.intersections):
            at = "; ".join(
                "(" + ", ".join(f"{x:.4g}" for x in place) + ")" for place in self.places[:3]
            )
            defects.append(
                f"the surface intersects itself: {count(self.intersections, 'pair')} of triangles "
                f"in {count(self.places, 'place')}, near {at}"
            )
        if len(self.folds):
            defects.append(f"the surface is folded sharply at {count(self.folds, 'edge')}")
        if len(self.inverted):
            defects.append(f"{count(self.inverted, 'triangle')} turned over")
        if len(self.slivers):
            defects.append(
                f"{count(self.slivers, 'sliver')} with an angle below "
                f"{np.degrees(SLIVER_ANGLE):.3g} degrees, the smallest "
                f"{np.degrees(self.smallest_angle):.2g}"
            )
        return tuple(defects)

    def data(self) -> dict[str, Any]:
        """Plain numbers and lists for a result file: angles in degrees, at most 20 of each list,
        None for an infinite distortion."""
        data: dict[str, Any] = {
            "points": self.points,
            "triangles": self.triangles,
            "genus": self.genus,
            "edges_over_diagonal": dict(
                zip(("shortest", "mean", "longest"), self.edges, strict=True)
            ),
            "smallest_angle_degrees": float(np.degrees(self.smallest_angle)),
        }
        for name in ("slivers", "inverted", "folds", "intersections"):
            items = getattr(self, name)
            data[name] = {"count": len(items), "first": items[:LISTED].tolist()}
        places = {"places": self.places[:LISTED].tolist()}
        data["self_intersections"] = data.pop("intersections") | places
        if self.distortion is not None:
            data["distortion"] = {
                name: value if np.isfinite(value) else None
                for name, value in self.distortion.items()
            }
        if self.turns is not None:
            data["turns"] = asdict(self.turns)
        return data


def surface_quality(surface: Surface, reference: Surface | None = None) -> SurfaceQuality:
    """Look for defects of a closed surface.

    reference: the surface that it was deformed from, with its triangles. Folds and inverted
    triangles of the reference do not count; slivers do.
    """
    points, triangles = surface.points, surface.triangles
    corners = points[triangles]
    lengths = norms(np.roll(corners, -1, axis=1) - corners) / surface.diagonal
    smallest = _angles(corners).min(axis=1)
    neighbors = edge_neighbors(triangles)
    sharp, inverted = _is_sharp(surface, neighbors), _is_inverted(surface)
    if reference is not None:
        sharp &= ~_is_sharp(reference, neighbors)
        inverted &= ~_is_inverted(reference)
    triangle, corner = np.nonzero(sharp)
    folds = np.stack((triangle, neighbors[triangle, corner]), axis=1)
    intersections = intersecting_triangles(points, triangles)
    groups = intersection_groups(triangles, intersections)
    return SurfaceQuality(
        points=len(points),
        triangles=len(triangles),
        genus=1 - (len(points) - len(triangles) // 2) // 2,
        edges=(float(lengths.min()), float(lengths.mean()), float(lengths.max())),
        smallest_angle=float(smallest.min()),
        slivers=np.flatnonzero(smallest < SLIVER_ANGLE),
        inverted=np.flatnonzero(inverted),
        folds=folds[folds[:, 0] < folds[:, 1]],
        intersections=intersections,
        places=np.array([corners[group].mean(axis=(0, 1)) for group in groups]).reshape(-1, 3),
        distortion=None if reference is None else surface_distortion(surface, reference),
        turns=None if reference is None else surface_turns(surface, reference),
    )


def surface_distortion(surface: Surface, reference: Surface) -> dict[str, float]:
    """Distortion of a surface's triangles against a reference.

    The reference has the surface's triangles and some area.

    A triangle is stretched by factors `a >= b` along two orthogonal directions. It is distorted in
    shape by `a / b`, 1 for a similar triangle (the quasi-conformal error of Sander et al., Texture
    mapping progressive meshes, 2001). It is distorted in size by its area over its area in the
    reference, or the inverse if that is larger, apart from the ratio of the whole surfaces' areas.
    Means and shares are weighted by the area of the reference; a triangle that has lost its area is
    distorted infinitely, and one that had none is left out.

    Returns `shape_mean`, `shape_most` and `shape_largest`: of the distortion in shape, the mean,
    the value that 95 % of the area keep to, and the largest; `size_...` likewise of the distortion
    in size.

    Source: Pinkall and Polthier, Computing discrete minimal surfaces, 1993: the sum of squared
    stretches is the Dirichlet energy, a sum over edges with the cotangents of angles.
    """
    before, after = (
        norms(doubled_area_vectors(each.points, each.triangles)) for each in (reference, surface)
    )
    old, new = (each.points[each.triangles] for each in (reference, surface))
    spread = np.zeros(len(old))
    with np.errstate(divide="ignore", invalid="ignore"):
        for k in range(3):
            a, b = old[:, k - 1] - old[:, k], old[:, k - 2] - old[:, k]
            opposite = new[:, k - 1] - new[:, k - 2]
            spread += (a * b).sum(axis=1) / before * (opposite * opposite).sum(axis=1)
    has_area = before > 0.0
    spread, before, after = spread[has_area], before[has_area], after[has_area]
    ratio = after / before * (before.sum() / after.sum())
    with np.errstate(divide="ignore", invalid="ignore"):
        half = np.where(after > 0.0, np.maximum(0.5 * spread / after, 1.0), np.inf)
        size = np.maximum(ratio, 1.0 / ratio)
    figures = {}
    for name, values in (("shape", half + np.sqrt((half - 1.0) * (half + 1.0))), ("size", size)):
        order = np.argsort(values)
        covered = np.cumsum(before[order])
        most = values[order[np.searchsorted(covered, SHARE * covered[-1])]]
        figures[f"{name}_mean"] = float(np.average(values, weights=before))
        figures[f"{name}_most"], figures[f"{name}_largest"] = float(most), float(values.max())
    return figures


@dataclass(frozen=True)
class SurfaceTurns:
    """What the eye sees of a deformation: how far a surface turned, and where it became sharper.

    Attributes
    ----------
    mean_degrees, most_degrees, largest_degrees: angle between the normals of triangles before and
        after: the mean by area, what 99 % of the area keep to, and the largest.
    edge_before_degrees, edge_after_degrees: largest angle between the normals of neighbors.
    peaks: groups of neighboring points whose mean curvature, positive where a surface is convex,
        has grown by more than that of a sphere with a radius of 5 % of the diagonal.
    """

    mean_degrees: float
    most_degrees: float
    largest_degrees: float
    edge_before_degrees: float
    edge_after_degrees: float
    peaks: int

    @property
    def sentence(self) -> str:
        """All in a sentence."""
        peaks = f"{self.peaks or 'no'} peak{'' if self.peaks == 1 else 's'} came up"
        return (
            f"the surface turned by {self.mean_degrees:.2g} degrees on average, 99 % of it by at "
            f"most {self.most_degrees:.2g}; its sharpest edge has {self.edge_after_degrees:.3g} "
            f"degrees, {self.edge_before_degrees:.3g} before; {peaks}"
        )


def surface_turns(surface: Surface, reference: Surface) -> SurfaceTurns:
    """Turns of a closed surface against the reference that it was deformed from, which has its
    triangles. Triangles that have no area in one of both do not count; areas are the reference's.

    Source: for the mean curvature of edges Steiner's formula, as in Sullivan, Curvatures of smooth
    and discrete surfaces, 2008.
    """
    neighbors = edge_neighbors(surface.triangles)
    area = norms(doubled_area_vectors(reference.points, reference.triangles))
    old, new = _normals(reference), _normals(surface)
    counted = (norms(old) > 0.0) & (norms(new) > 0.0)
    turns, weights = np.degrees(angle_between(old, new))[counted], area[counted]
    order = np.argsort(turns)
    covered = np.cumsum(weights[order])
    (edge_before, before), (edge_after, after) = (
        _curvatures(each, normals, neighbors)
        for each, normals in ((reference, old), (surface, new))
    )
    is_peak = after - before > 1.0 / PEAK
    tails, heads = surface.triangles.ravel(), np.roll(surface.triangles, -1, axis=1).ravel()
    within = is_peak[tails] & is_peak[heads]
    parts = find_parts(tails[within], heads[within], len(is_peak))
    return SurfaceTurns(
        mean_degrees=float(np.average(turns, weights=weights)),
        most_degrees=float(turns[order[np.searchsorted(covered, TURNED_SHARE * covered[-1])]]),
        largest_degrees=float(turns.max()),
        edge_before_degrees=edge_before,
        edge_after_degrees=edge_after,
        peaks=len(np.unique(parts[is_peak])),
    )


def _curvatures(surface: Surface, normals: Floats, neighbors: Integers) -> tuple[float, Floats]:
    """Largest angle between neighbors in degrees, and the mean curvature (n,) at the points, with
    the diagonal as the unit: positive where the surface is convex."""
    triangles, points = surface.triangles, surface.points / surface.diagonal
    tails, heads = np.roll(triangles, -1, axis=1), np.roll(triangles, -2, axis=1)
    along = points[heads] - points[tails]
    beyond = normals[neighbors]
    turns = np.where(neighbors >= 0, angle_between(normals[:, None], beyond), 0.0)
    is_convex = (np.linalg.cross(normals[:, None], beyond) * along).sum(axis=2) >= 0.0
    # Each edge has two triangles, and gives half of its curvature to each of its ends.
    shares = norms(along) * np.where(is_convex, turns, -turns) / 8.0
    areas = norms(doubled_area_vectors(points, triangles)) / 6.0
    count = len(points)
    curvature = sums_by_index(tails.ravel(), shares.ravel(), count)
    curvature += sums_by_index(heads.ravel(), shares.ravel(), count)
    area = sums_by_index(triangles.ravel(), areas.repeat(3), count)
    mean = np.divide(curvature, area, out=np.zeros(count), where=area > 0.0)
    return float(np.degrees(turns.max())), mean


def _angles(corners: Floats) -> Floats:
    """(t, 3) angles of triangles (t, 3, 3) at their corners."""
    edges = np.roll(corners, -1, axis=1) - corners
    return angle_between(edges, -np.roll(edges, 1, axis=1))


def _normals(surface: Surface) -> Floats:
    """(t, 3) unit normals; 0 for a triangle without area."""
    vectors = doubled_area_vectors(surface.points / surface.diagonal, surface.triangles)
    lengths = norms(vectors)[:, None]
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)


def _is_sharp(surface: Surface, neighbors: Integers) -> Booleans:
    """(t, 3) whether the surface turns by more than `SHARP_TURN` from triangles to neighbors."""
    normals = _normals(surface)
    turns = angle_between(normals[:, None], normals[neighbors])
    return (neighbors >= 0) & (turns > SHARP_TURN)


def _is_inverted(surface: Surface) -> Booleans:
    """(t,) whether triangles face away from the surface at two or three of their corners."""
    normals, triangles = _normals(surface), surface.triangles
    weighted = _angles(surface.points[triangles])[:, :, None] * normals[:, None]
    at_points = sums_by_index(triangles.ravel(), weighted.reshape(-1, 3), len(surface.points))
    away = (normals[:, None] * at_points[triangles]).sum(axis=2) < 0.0
    return away.sum(axis=1) >= 2
