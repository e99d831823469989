"""Shapes whose finished object has wanted odds, though labels and edges take material away.

The facets of the plain shape are moved until the object that is made of it, measured as it will be
written, has the odds: labels shift the center of mass, and with it the odds, by some 1e-4. Lengths
are in millimetres."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, Generic, Protocol, TypeVar

import numpy as np
import torch

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.geometry.triangles import Surface
from dicedesign.gradient.odds_model import OddsModel
from dicedesign.gradient.rest_odds import evaluate_rests
from dicedesign.optimize.coordinates.facets import FacetCoordinates
from dicedesign.optimize.coordinates.linked import TiedCoordinates
from dicedesign.optimize.solvers.candidate import Candidate, CandidateMaker
from dicedesign.optimize.solvers.levenberg_marquardt import LevenbergMarquardt
from dicedesign.rest.outcomes import gathered
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import BALANCED_ODDS

MOST_ROUNDS: Final = 6
"""Objects that are made and measured after the first: labels alone need three."""

SLOW: Final = 0.3
"""Part of an error that two rounds may leave."""

NUDGES: Final = (0.0, 1e-7, 1e-5, 1e-3, 1e-2)
"""Random changes of the parameters of a shape, tried in turn until one leads to the odds: those of
a tied shape, as a symmetric one may be, have no derivatives, and those of a thrown one have kinks.
"""

FOLD: Final = float(np.radians(2.0))
"""Angle between two facets, in radians, below which they move as one. Where two planes almost
coincide the edge between them runs away, and a label with it, as one of them is turned."""

RANK: Final = 1e-8
"""Differences between guesses below this part of the largest tell nothing."""


Label = TypeVar("Label")


@dataclass(frozen=True)
class Measured:
    """What a solid does: its center of mass (3,) and the odds (k,) of its outcomes."""

    center_of_mass: Floats
    odds: Floats


class Labelled(Protocol[Label]):
    """How an object is made of a plain shape and labels on its facets."""

    def balanced(self, core: ConvexHull, placements: Sequence[Label]) -> Surface:
        """The solid by which the object is judged."""

    def carried(
        self,
        placements: Sequence[Label],
        before: ConvexHull,
        after: ConvexHull,
        moved_normals: Floats,
    ) -> tuple[Label, ...]:
        """Labels on the facets of one hull, moved onto those of another; moved_normals: (m, 3) that
        the facets of the first have in the second."""

    def bearing(self, placements: Sequence[Label]) -> Floats:
        """(l, 3) normals of the facets with labels."""


@dataclass(frozen=True, eq=False)
class Reshaped(Generic[Label]):
    """An object and the plain shape that it is made of.

    Attributes
    ----------
    surface: of the object, by which it was measured.
    core: the plain shape. placements: labels on its facets.
    directions: (k, 3) normals of the outcomes' facets.
    measured: what the object does; first: what that of the given shape does.
    errors: largest |p - q| of the objects of all rounds, the first being that of the given shape.
    """

    surface: Surface
    core: ConvexHull
    placements: tuple[Label, ...]
    directions: Floats
    measured: Measured
    first: Measured
    errors: tuple[float, ...]


def reshaped(
    core: ConvexHull,
    directions: Floats,
    placements: Sequence[Label],
    target: Floats,
    made: Labelled[Label],
    measure: Callable[[Surface, Floats], Measured],
    *,
    rounds: int = MOST_ROUNDS,
    model: OddsModel | None = None,
) -> Reshaped[Label]:
    """Lead the object made of a shape to wanted odds.

    In each round the object is made and measured. It differs from the plain shape in its center of
    mass and in what is left of its odds; the shape is then moved, by the shortest way in its
    half-spaces (`FacetCoordinates`), to where a plain shape with that offset and that difference
    has the odds. As labels go along with their facets, each round leaves a hundredth of the error.
    The best object of all rounds is returned.

    Parameters
    ----------
    core: the plain shape, with a rest for each outcome and no other.
    directions: (k, 3) normals of the outcomes' facets.
    placements: labels on facets of it.
    target: (k,) wanted odds of the object.
    made: how the object is made; measure: it, with the directions of its outcomes.
    rounds: objects that are made and measured after the first; 0 for only that.
    model: of the odds, where they are not those without momentum and with any side down alike.

    Raises
    ------
    DiceError: the object of the given shape cannot be made or measured.
    """
    labels = tuple(placements)
    surface = made.balanced(core, labels)
    first = measured = measure(surface, directions)
    best = Reshaped(surface, core, labels, directions, first, first, (_error(first, target),))
    errors, guesses = best.errors, _Guesses(core.diameter, len(target))
    for _ in range(rounds):
        if min(errors) <= BALANCED_ODDS or (len(errors) > 2 and errors[-1] > SLOW * errors[-3]):
            break
        try:
            bearing = np.concatenate([directions, made.bearing(labels)])
            shape = _solved(core, directions, bearing, measured, target, model, guesses)
            if shape is None:
                break
            labels = made.carried(labels, core, shape.rests.hull, _moved_normals(core, shape))
            core, directions = shape.rests.hull, shape.directions
            surface = made.balanced(core, labels)
            measured = measure(surface, directions)
        except DiceError:
            # A label that no longer fits, or an object without the rests: the best so far it is.
            break
        errors = (*errors, _error(measured, target))
        if errors[-1] == min(errors):
            best = Reshaped(surface, core, labels, directions, measured, first, errors)
    return replace(best, errors=errors)


def largest_move(before: ConvexHull, after: ConvexHull) -> float:
    """Largest distance from a corner of a shape to the planes of its facets as they were moved a
    little."""
    facets = np.argmax(before.normals @ after.normals.T, axis=1)
    planes = after.normals[facets]
    offsets = after.heights(np.zeros(3))[facets]
    distances = before.vertices[before.tail] @ planes.T - offsets
    own = distances[np.arange(len(before.tail)), before.facet]
    return float(np.abs(own).max())


def _moved_normals(core: ConvexHull, shape: Candidate) -> Floats:
    """(m, 3) unit normals that the facets of a shape have in another, made by moving them."""
    moved = shape.parameters
    if isinstance(shape.coordinates, TiedCoordinates):
        moved = shape.coordinates.half_spaces(moved)
    _, first = FacetCoordinates.of(core.vertices, core.centroid)
    first, moved = (whole[: 3 * len(whole) // 4].reshape(-1, 3) for whole in (first, moved))
    return unit_vectors(moved[np.argmax(core.normals @ first.T, axis=1)])


def _error(measured: Measured, target: Floats) -> float:
    return float(np.abs(measured.odds - target).max())


class _Guesses:
    """What the object of the next shape will differ by from a plain one: the offset of the center
    of mass and the rest of the odds, from what those of the shapes before did.

    A shape that is found for a guess changes what was guessed. The guesses are corrected by
    Anderson's method (J. ACM 12, 1965): by the mean of all before whose changes cancel best.
    """

    def __init__(self, size: float, outcomes: int) -> None:
        self._size = size
        # The plain shape has its odds with neither.
        self._guessed = [np.zeros(3 + outcomes)]
        self._came: list[Floats] = []

    def next(self, offset: Floats, rest: Floats) -> tuple[Floats, Floats]:
        """The guess (3,), (k,) after what came of the last."""
        self._came.append(np.concatenate([offset / self._size, rest]))
        guessed, came = np.stack(self._guessed), np.stack(self._came)
        changes = came - guessed
        guess = came[-1]
        if len(came) > 1:
            weights = np.linalg.lstsq(np.diff(changes, axis=0).T, changes[-1], rcond=RANK)[0]
            guess = guess - weights @ np.diff(came, axis=0)
        self._guessed.append(guess)
        return guess[:3] * self._size, guess[3:]


def _solved(
    core: ConvexHull,
    directions: Floats,
    bearing: Floats,
    measured: Measured,
    target: Floats,
    model: OddsModel | None,
    guesses: _Guesses,
) -> Candidate | None:
    """A shape nearby that has the odds if its object differs from a plain one as guessed; None
    where there is none."""
    offset = measured.center_of_mass - core.centroid
    plain = _plain_odds(core, directions, offset, model)
    offset, rest = guesses.next(offset, measured.odds - plain)
    wanted, maker = target - rest, CandidateMaker(None, model, offset)
    best = None
    for first in _candidates(core, directions, bearing, maker):
        approach = LevenbergMarquardt(
            wanted, maker, None, 0.1 * BALANCED_ODDS, lambda: False, lambda candidate: None
        )
        end = approach.solve(first)
        if best is None or end.error(wanted) < best.error(wanted):
            best = end
        if best.error(wanted) <= BALANCED_ODDS:
            break
    return best


def _plain_odds(
    core: ConvexHull, directions: Floats, offset: Floats, model: OddsModel | None
) -> Floats:
    """(k,) odds of a plain shape whose center of mass has an offset (3,)."""
    rests = evaluate_rests(torch.from_numpy(core.vertices), offset=offset)
    odds = rests.odds if model is None else model.odds(rests)
    return gathered(rests.hull.normals[rests.facets], odds, directions).odds


def _candidates(
    hull: ConvexHull, directions: Floats, bearing: Floats, maker: CandidateMaker
) -> Iterator[Candidate]:
    """The shape, and others beside it, of those that are no ties."""
    coordinates, parameters = TiedCoordinates.of(hull, bearing, FOLD)
    random = np.random.default_rng(0)
    for nudge in NUDGES:
        moved = parameters + nudge * random.standard_normal(len(parameters))
        candidate = maker.attempt(coordinates, moved, directions)
        if candidate is not None:
            yield candidate
