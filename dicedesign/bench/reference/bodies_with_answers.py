"""Bodies for the accuracy bench, with what is true of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.bench.reference.precision import evaluated_probabilities
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.meshes.center_of_mass import resolve_center_of_mass
from dicedesign.optimize.starts.kinds.hendecahedron import hendecahedron
from dicedesign.rest.basins import find_basins
from dicedesign.rest.equilibria import Equilibria, classify
from dicedesign.runtime.arrays import Floats
from tests.reference.extremes import large
from tests.reference.measurement import ORACLE_FACETS
from tests.reference.oracle import hull_probabilities
from tests.reference.sixty_digits import OracleError
from tests.reference.stiff import random_body

__all__ = ["Subject", "built_in_bodies", "make_subject"]


@dataclass(frozen=True)
class Subject:
    """A body with what is true of it.

    Attributes
    ----------
    name: for tables and figures.
    body: its points.
    center: (3,) center of mass.
    hull: its convex hull.
    exact: (m,) probability of each facet, mpmath numbers or floats.
    oracle: whether these are the oracle's and not this model's own in float64.
    tied: whether this model takes the mean over two centers of mass beside a balance; the other
        methods take the one between them.
    """

    name: str
    body: Body
    center: Floats
    hull: ConvexHull
    exact: Sequence[Any]
    oracle: bool
    tied: bool

    @property
    def rests(self) -> int:
        """How many facets the body rests on."""
        return sum(p > 0 for p in self.exact)

    @property
    def largest_deviation(self) -> float:
        """Standard deviation of one random direction's landing on the facet where it is largest."""
        shares = np.array([float(p) for p in self.exact])
        return float(np.sqrt((shares * (1.0 - shares)).max()))

    def classified(self) -> Equilibria:
        """The body's hull and its elements, found afresh, as every method needs them."""
        return classify(_hull(self.body), self.center)

    def error(self, shares: Floats) -> float:
        """Largest error of probabilities (m,) by facet."""
        return max(abs(float(p - q)) for p, q in zip(self.exact, shares.tolist(), strict=True))


def make_subject(name: str, body: Body, *, oracle_facets: int = ORACLE_FACETS) -> Subject:
    """A body with its exact probabilities, by the oracle for hulls of up to `oracle_facets` that it
    can answer for.

    Raises as `rest_poses`; InputError without mpmath if the oracle is asked.
    """
    hull = _hull(body)
    center = resolve_center_of_mass(body, hull.centroid)[0]
    sides = find_basins(hull, center)
    exact: Sequence[Any] | None = None
    if len(hull.normals) <= oracle_facets:
        with suppress(OracleError):
            exact = hull_probabilities(hull, [s.equilibria.center_of_mass for s in sides])
    oracle = exact is not None
    if exact is None:
        exact = evaluated_probabilities(hull, sides, np.float64).tolist()
    return Subject(name, body, center, hull, exact, oracle, len(sides) > 1)


def built_in_bodies() -> Iterator[tuple[str, Body]]:
    """Bodies that need no files, with names: a die on which every facet, edge and corner carries an
    equilibrium, one with facets that it rolls off, and a dense hull."""
    bodies: tuple[tuple[str, ArrayLike], ...] = (
        ("hendecahedron", hendecahedron("bisymmetric").points),
        ("20 random points", random_body(0, 20).points),
        ("ellipsoid of 1000 points", large(1000).points),
    )
    for name, points in bodies:
        yield name, make_body(points, name=name)


def _hull(body: Body) -> ConvexHull:
    return convex_hull(body.points, single_precision=body.single_precision)
