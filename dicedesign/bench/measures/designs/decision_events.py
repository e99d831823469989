"""What probabilities and gradients do where a body's decisions change.

The center of mass of random bodies moves along a line; where a decision changes on the way, the
place is found by bisection, and probabilities and derivatives are compared just before and after.
Four kinds of events there are:

- a facet becomes a rest or ceases to be one: a saddle reaches the facet's normal. Its basin has a
  finite area at that moment, which goes to a neighbour: the probabilities jump;
- a path passes through the normal of a facet onto which the body rolls over an edge. From that
  facet it now goes to another rest, and all that rolls over the edge goes along: they jump;
- a corner becomes a maximum or ceases to be one (r_p . v = 0). Paths that ended at the corner now
  pass it at a distance in proportion to r_p . v: the probabilities are continuous and their
  gradient jumps; both are smooth if no path that divides basins ended there;
- a path passes through the normal of a facet onto which the body rolls over no edge, and crosses
  other arcs than before: again only the gradient jumps.

On each side all derivatives have finite limits.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
import torch

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.rest.equilibria import classify
from dicedesign.rest.morse import separatrices
from dicedesign.rest.tracing import destined_facets
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from tests.reference.oracle_derivatives import oracle_derivative
from tests.reference.random_hulls import random_hull

__all__ = ["BODIES", "DISCONTINUOUS", "EVENTS", "Event", "find_events"]

RESTS, DESTINATION, MAXIMUM, PATH = EVENTS = (
    "a facet becomes a rest",
    "a path meets a facet rolled onto",
    "a corner becomes a maximum",
    "a path meets another facet",
)
"""In each, the other way round is meant too."""

DISCONTINUOUS: Final = (RESTS, DESTINATION)
"""Those at which the probabilities jump."""

JUMP: Final = 1e-6
"""Probabilities that differ by more before and after an event have jumped."""

KINK: Final = 1e-7
"""Derivatives that differ by more, over the largest of them, have jumped."""

BODIES: Final = range(20, 50)
"""Random hulls that meet each kind of event several times."""

BESIDE: Final = 1e-10
"""Distance from the event, over the body's radius, at which both sides are looked at."""

ERROR_LIMIT: Final = 1e-8
"""Of the derivatives beside an event."""

PLACES: Final = 100
"""At which decisions are compared, on the way from the centroid half the way out."""

HALVINGS: Final = 30


@dataclass(frozen=True)
class _Decisions:
    """What a hull does with a center of mass.

    Attributes
    ----------
    stable: (m,) which facets are rests; maximum: (n,) which corners are maxima.
    destined: (m,) the rest to which the body goes from a facet onto which it rolls over an edge,
        -1 for other facets.
    crossed: (2 s, depth, 2) as in `Separatrices`, padded with -1.
    """

    stable: Booleans
    destined: Integers
    maximum: Booleans
    crossed: Integers


@dataclass(frozen=True)
class Event:
    """A change of decisions that the moving center of mass of a random body met.

    Attributes
    ----------
    kind: one of `EVENTS`.
    body: number of the random body.
    jump: largest difference of a probability between `BESIDE` before and after.
    slopes: largest derivative of a probability on either side, for a move by the body's radius.
    kink: largest difference of derivatives over the larger slope.
    error: largest difference of the derivatives from the oracle's, over the larger slope.
    """

    computed: ClassVar[tuple[str, ...]] = ("ok",)

    kind: str
    body: int
    jump: float
    slopes: tuple[float, float]
    kink: float
    error: float

    @property
    def jumps(self) -> bool:
        """Whether the probabilities do."""
        return self.jump > JUMP

    @property
    def kinks(self) -> bool:
        """Whether the probabilities do not jump, but their gradient does."""
        return not self.jumps and self.kink > KINK

    @property
    def ok(self) -> bool:
        """Whether it is as its kind, and both derivatives are right."""
        return self.jumps == (self.kind in DISCONTINUOUS) and self.error <= ERROR_LIMIT


def find_events(bodies: Iterable[int]) -> Iterator[Event]:
    """Events met by the random hulls of these numbers, as they come."""
    for number in bodies:
        yield from _Walk(number).events()


class _Walk:
    """The center of mass of a random hull on its way from the centroid in a random direction."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.hull = convex_hull(random_hull(number)[1].points)
        direction = np.random.default_rng(number).normal(size=3)
        self.direction = unit_vectors(direction)
        self.radius = float(norms(self.hull.vertices - self.hull.centroid).max())
        self.reach = 0.5 * self._way_out()

    def _way_out(self) -> float:
        """How far the direction stays inside, over the radius and at most 1."""
        hull = self.hull
        heights = hull.heights(hull.centroid)
        along = hull.normals @ self.direction * self.radius
        return min(1.0, float((heights[along > 0.0] / along[along > 0.0]).min()))

    def center(self, time: float) -> Floats:
        return self.hull.centroid + time * self.radius * self.direction

    def decisions(self, time: float) -> _Decisions:
        hull = self.hull
        equilibria = classify(hull, self.center(time))
        paths = separatrices(equilibria)
        rolling = equilibria.roll_edge[equilibria.roll_edge >= 0]
        rolled_onto = np.concatenate(
            [hull.facet[np.flatnonzero(equilibria.saddle)], hull.facet[hull.twin[rolling]]]
        )
        destined = np.full(len(hull.normals), -1)
        destined[rolled_onto] = destined_facets(equilibria, rolled_onto)
        steps = np.arange(paths.crossed.shape[1])
        crossed = np.where((steps < paths.lengths[:, None])[..., None], paths.crossed, -1)
        return _Decisions(equilibria.stable, destined, equilibria.maximum, crossed)

    def events(self) -> Iterator[Event]:
        times = np.linspace(0.0, self.reach, PLACES)
        decisions = [self.decisions(time) for time in times]
        for index in range(PLACES - 1):
            low, high = times[index : index + 2]
            before, after = decisions[index : index + 2]
            if _kind(before, after) is None:
                continue
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                between = self.decisions(middle)
                if _kind(before, between) is None:
                    low = middle
                else:
                    high, after = middle, between
            kind = _kind(before, after)
            sides = low - BESIDE, high + BESIDE
            # Else another event is so near that it would be seen along with this one.
            alone = [
                _kind(decided, self.decisions(side)) is None
                for decided, side in zip((before, after), sides, strict=True)
            ]
            if kind is not None and all(alone):
                yield self._event(kind, sides)

    def _event(self, kind: str, sides: tuple[float, float]) -> Event:
        (p, dp), (q, dq) = (self._slopes(side) for side in sides)
        slopes = float(np.abs(dp).max()), float(np.abs(dq).max())
        still = np.zeros_like(self.hull.vertices)
        errors = [
            np.abs(
                found
                - oracle_derivative(
                    self.hull, self.center(side), still, self.radius * self.direction
                )
            ).max()
            for side, found in zip(sides, (dp, dq), strict=True)
        ]
        return Event(
            kind=kind,
            body=self.number,
            jump=float(np.abs(p - q).max()),
            slopes=slopes,
            kink=float(np.abs(dp - dq).max()) / max(slopes),
            error=float(max(errors)) / max(slopes),
        )

    def _slopes(self, time: float) -> tuple[Floats, Floats]:
        """Probabilities (m,) of all facets, and their derivatives (m,)."""
        center = torch.tensor(self.center(time), requires_grad=True)
        vertices = torch.tensor(self.hull.vertices)
        rests = RestEvaluation(classify(self.hull, self.center(time)), vertices, center)
        values, slopes = np.zeros((2, len(self.hull.normals)))
        for facet, probability in zip(rests.paths.rests, rests.probabilities, strict=True):
            values[facet] = probability.item()
            gradient = torch.autograd.grad(probability, center, retain_graph=True)[0]
            slopes[facet] = gradient.numpy() @ self.direction * self.radius
        return values, slopes


def _kind(before: _Decisions, after: _Decisions) -> str | None:
    """Which of `EVENTS` lies between, if any."""
    if (before.stable != after.stable).any():
        return RESTS
    if (before.maximum != after.maximum).any():
        return MAXIMUM
    both = (before.destined >= 0) & (after.destined >= 0)
    if (before.destined != after.destined)[both].any():
        return DESTINATION
    return None if np.array_equal(before.crossed, after.crossed) else PATH
