"""Defects of the triangles of a surface, and how far they are distorted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dicedesign.geometry.sphere import angle_between, norms
from dicedesign.geometry.surfaces.self_intersections import (
    intersecting_triangles,
    intersection_groups,
)
from dicedesign.geometry.triangles import Surface, doubled_area_vectors, edge_neighbors
from dicedesign.runtime.arrays import Booleans, Floats, Integers, sums_by_index
from dicedesign.tolerances import SHARP_TURN, SLIVER_ANGLE

LISTED = 20
"""Most triangles and places listed in the plain data, beside their number."""

SHARE = 0.95
"""Share of the area whose largest distortion is given."""


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
