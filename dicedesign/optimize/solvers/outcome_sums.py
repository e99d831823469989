"""Dice of many faces that have the target both set down and thrown.

Each outcome has several faces, in opposite parallel pairs. Only the sums over an outcome's faces
are wanted, so that the same die can meet them by two models at once: to move a plane along its
normal changes thrown probabilities two to five times as much as those without momentum, to turn it
changes both about alike.

The solver is a sequential quadratic method: the sums are constraints, for rolling without momentum
and for the mean of the throws of a table. It minimizes, in squares, what is wanted besides: each
face near its share, the sums right in each hand that the table stands for, a small change of the
shape. Short edges are pushed apart, and so are the foot points of the center of mass on edges from
the ends of these: where a foot passes an end, a saddle appears and thrown probabilities jump.

Source: Nocedal and Wright, Numerical Optimization, 2006, section 18.3 (Gauss-Newton Hessian, exact
penalty).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np
import torch

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import ConvexHull, polyhedron_corners
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.gradient.probability_model import ThrowProbabilities
from dicedesign.gradient.rest_probabilities import RestEvaluation, evaluate_rests
from dicedesign.optimize.coordinates import FacetCoordinates
from dicedesign.optimize.starts.face_bodies import FaceCode, FaceShares
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.momentum_model import MomentumMixture

SHORT_EDGE = 0.12
"""Length of an edge, over the mean distance of the planes, below which it is pushed apart."""

NEAR_END = 0.04
"""The same for the distance of a foot point from the end of its edge."""

EDGE_WEIGHT = 2.0
"""Weight of the shortfall of an edge or a foot point, over its limit."""

SHARE_WEIGHT = 0.3
"""Weight of the logarithm of a face's probability over its share, for shares as large as the mean;
smaller faces count more, in proportion, up to `MOST_STRENGTH` times."""

MOST_STRENGTH = 6.0

HAND_WEIGHT = 20.0
"""Weight of an outcome's error in one hand, over the root of its probability plus `RARE`."""

RARE = 0.02

STAY_WEIGHT = 5.0
"""Weight of the change of normals and of the logarithms of distances."""

MAX_MOVE = 0.08
"""Largest change of a parameter in one step."""

MAX_STEPS = 25

REACHED = 1e-11
"""Error of the sums at which they are met."""

NEARLY_MET = 1e-3
"""Error of the sums from which only these are still improved."""

ORDERS = 200
"""Random orders of outcomes on faces."""

TINY_GAIN = 1e-12
"""Decrease of the cost of an order that counts."""

PENALTY = 60.0
"""Initial weight of the error of the sums in the merit function."""

MAX_PENALTY = 1e4

SHRINK = 0.35
"""Factor of a step that does not lower the merit function."""

MAX_TRIALS = 5
"""Lengths of a step that are tried."""

LITTLE = 2e-3
"""Relative decrease of the merit function below which only the sums are still improved."""

POLISH_STEPS = 10
"""Steps of least change that meet the sums."""

DAMPING = (1e-2, 1e-4, 1e3)
"""Initial, least and largest damping of the Gauss-Newton Hessian."""

LEAST_PROBABILITY = 1e-7
"""Probability below which a face counts as lost."""


@dataclass(frozen=True, eq=False)
class PlanesInPairs:
    """Planes about the origin, of which i and i + m are parallel.

    Attributes
    ----------
    half: (m, 3) outward unit normals of the first half; those of the others are opposite.
    logarithms: (2 m,) of the distances from the origin.
    """

    half: Floats
    logarithms: Floats

    @property
    def normals(self) -> Floats:
        """(2 m, 3) outward unit normals."""
        return np.concatenate([self.half, -self.half])

    @cached_property
    def directions(self) -> Floats:
        """(8 m, 4 m) derivatives of the parameters of `FacetCoordinates` in the movable directions:
        two turns of each pair, then the distances."""
        pairs = len(self.half)
        tangents = np.linalg.svd(self.half[:, None])[2][:, 1:]
        columns = np.zeros((8 * pairs, 4 * pairs))
        for pair in range(pairs):
            turns = slice(2 * pair, 2 * pair + 2)
            columns[3 * pair : 3 * pair + 3, turns] = tangents[pair].T
            columns[3 * (pair + pairs) : 3 * (pair + pairs) + 3, turns] = -tangents[pair].T
        columns[6 * pairs :, 2 * pairs :] = np.eye(2 * pairs)
        return columns

    def move(self, step: Floats) -> PlanesInPairs:
        """Planes after a step (4 m,) in the movable directions."""
        change, pairs = self.directions @ step, len(self.half)
        turned = self.half + change[: 3 * pairs].reshape(-1, 3)
        return PlanesInPairs(unit_vectors(turned), self.logarithms + change[6 * pairs :])


@dataclass(frozen=True, eq=False)
class OutcomeSumsDie:
    """Result of `solve_outcome_sums`.

    Attributes
    ----------
    hull: of the die. normals: (2 m, 3) of its faces.
    error: largest error of a sum, set down or thrown, by the models.
    strain: half the sum of the squares that were minimized; dice of less are better shaped.
    evaluations: number of dice that were evaluated.
    """

    hull: ConvexHull
    normals: Floats
    error: float
    strain: float
    evaluations: int


@dataclass(frozen=True, eq=False)
class _Terms:
    """Residuals to minimize (s,) and errors of the sums (c,), the derivatives of both in the
    movable directions, (s, d) and (c, d) or (0,), and the hull of the die."""

    soft: Floats
    hard: Floats
    soft_slopes: Floats
    hard_slopes: Floats
    hull: ConvexHull

    @property
    def error(self) -> float:
        return float(np.abs(self.hard).max())

    def merit(self, penalty: float) -> float:
        return float(self.soft @ self.soft) / 2.0 + penalty * float(np.abs(self.hard).sum())


class _Problem:
    """Terms of a die as functions of its planes; see `solve_outcome_sums`."""

    def __init__(
        self,
        target: Floats,
        outcome: Integers,
        start: PlanesInPairs,
        thrown: ThrowProbabilities | None,
        set_down: bool,
        bias: Floats,
    ) -> None:
        self.target, self.start, self.set_down, self.evaluations = target, start, set_down, 0
        self.bias = bias
        self.sums = np.eye(len(target))[outcome].T
        self.shares = (target / self.sums.sum(axis=1))[outcome]
        strength = np.clip(self.shares.mean() / self.shares, 1.0, MOST_STRENGTH)
        self.share_weights = SHARE_WEIGHT * strength
        mixture = None if thrown is None else thrown.mixture
        self.hand_weights = np.zeros(0) if mixture is None else mixture.weights
        models = () if mixture is None else mixture.models
        self.hands = [ThrowProbabilities(MomentumMixture.alone(one)) for one in models]

    def terms(self, planes: PlanesInPairs, slopes: bool = True) -> _Terms | None:
        """None unless the die rests on each plane."""
        self.evaluations += 1
        normals, coordinates = planes.normals, FacetCoordinates(np.zeros(3))
        try:
            shape = coordinates.shape(np.concatenate([normals.ravel(), planes.logarithms]))
            rests = evaluate_rests(torch.from_numpy(shape.points))
            resting = rests.probability_values
        except (DiceError, np.linalg.LinAlgError):
            return None
        face = np.argmax(rests.hull.normals[rests.facets] @ normals.T, axis=1)
        if len(face) != len(normals) or len(np.unique(face)) != len(face):
            return None
        if resting.min() < LEAST_PROBABILITY:
            return None
        sums, hull, shares = self.sums[:, face], rests.hull, self.shares[face]
        # Corrected by the bias, with the sum 1.
        scale = np.exp(self.bias[face])
        scaled = [scale * hand.probabilities(rests) for hand in self.hands]
        wholes = np.sum(scaled, axis=-1)
        by_hand = np.reshape(scaled, (-1, len(face))) / wholes[..., None]
        off = by_hand @ sums.T - self.target
        mean = self.hand_weights @ by_hand
        weights = HAND_WEIGHT * np.sqrt(self.hand_weights)[:, None] / np.sqrt(self.target + RARE)
        short, short_rows = _short_edges(rests)
        change = np.concatenate(
            [(planes.half - self.start.half).ravel(), planes.logarithms - self.start.logarithms]
        )
        share_weights = self.share_weights[face]
        soft = [share_weights * np.log(resting / shares), (weights * off).ravel()]
        soft += [share_weights * np.log(mean / shares)] if self.hands else []
        soft += [EDGE_WEIGHT * short, STAY_WEIGHT * change]
        # The last outcome has what is left.
        errors = [(sums @ resting - self.target)[:-1]] if self.set_down else []
        errors += [(sums @ mean - self.target)[:-1]] if self.hands else []
        hard = np.concatenate(errors)
        if not slopes:
            return _Terms(np.concatenate(soft), hard, np.zeros(0), np.zeros(0), hull)
        rows = [rests.jacobian, *(hand.jacobian(rests) for hand in self.hands), short_rows]
        moved = shape.in_parameters(np.concatenate(rows), hull.source) @ planes.directions
        of_faces, of_hands, of_edges = np.split(moved, [len(face), len(moved) - len(short)])
        of_hands = of_hands.reshape(len(self.hands), len(face), -1) if self.hands else of_hands
        error_slopes = [(sums @ of_faces)[:-1]] if self.set_down else []
        soft_slopes = [(share_weights / resting)[:, None] * of_faces]
        if self.hands:
            of_hands = of_hands * scale[:, None]
            of_hands = of_hands - by_hand[..., None] * of_hands.sum(axis=1, keepdims=True)
            of_hands = of_hands / wholes[:, None, None]
            of_mean = np.tensordot(self.hand_weights, of_hands, axes=1)
            of_sums = weights[..., None] * (sums @ of_hands)
            soft_slopes.append(of_sums.reshape(-1, moved.shape[1]))
            soft_slopes.append((share_weights / mean)[:, None] * of_mean)
            error_slopes.append((sums @ of_mean)[:-1])
        pairs = len(planes.half)
        stays = np.concatenate([planes.directions[: 3 * pairs], planes.directions[6 * pairs :]])
        soft_slopes += [EDGE_WEIGHT * of_edges, STAY_WEIGHT * stays]
        return _Terms(
            np.concatenate(soft),
            hard,
            np.concatenate(soft_slopes),
            np.concatenate(error_slopes),
            hull,
        )


def _short_edges(rests: RestEvaluation) -> tuple[Floats, Floats]:
    """(s,) shortfall of edges and of foot points from the ends of edges over their limits, and the
    derivatives (s, 3 n) in the vertices."""
    hull, center = rests.hull, rests.equilibria.center_of_mass
    tails, heads = hull.vertices[hull.tail], hull.vertices[hull.head]
    lengths = np.linalg.norm(heads - tails, axis=1)
    along = (heads - tails) / np.maximum(lengths, np.finfo(np.float64).tiny)[:, None]
    short = np.flatnonzero((lengths < SHORT_EDGE) & (hull.tail < hull.head))
    # Foot of the center from the head of each half-edge.
    places = ((heads - center) * along).sum(axis=1)
    near = np.flatnonzero(np.abs(places) < NEAR_END)
    across = (heads - center - places[:, None] * along)[near] / lengths[near, None]
    sign = np.where(places[near] < 0.0, -1.0, 1.0)[:, None]
    rows = np.zeros((len(short) + len(near), len(hull.vertices), 3))
    first, second = np.arange(len(short)), len(short) + np.arange(len(near))
    rows[first, hull.head[short]] = -along[short] / SHORT_EDGE
    rows[first, hull.tail[short]] = along[short] / SHORT_EDGE
    rows[second, hull.head[near]] = -sign * (along[near] + across) / NEAR_END
    rows[second, hull.tail[near]] = sign * across / NEAR_END
    by_center = np.zeros((len(rows), 3))
    by_center[second] = sign * along[near] / NEAR_END
    shortfall = [1.0 - lengths[short] / SHORT_EDGE, 1.0 - np.abs(places[near]) / NEAR_END]
    flat = rows.reshape(len(rows), hull.vertices.size)
    return np.concatenate(shortfall), rests.rows_with_center(flat, by_center)


def solve_outcome_sums(
    target: Floats,
    outcome: Integers,
    code: FaceCode,
    thrown: ThrowProbabilities | None,
    set_down: bool = True,
) -> OutcomeSumsDie | None:
    """Move planes as little as possible until the sums over the faces of each outcome are the
    target, set down and thrown. None if the faces of the start are not the rests of a solid, or no
    step leads to the sums.

    Parameters
    ----------
    target: (k,) probabilities of the outcomes.
    outcome: (2 m,) of each face.
    code: the starting planes.
    thrown: model of throws onto a table, or None to look at dice that are set down only. set_down:
        whether the sums are also to be right when set down; they are without `thrown`.
    """
    pairs = len(code.normals) // 2
    planes = PlanesInPairs(code.normals[:pairs], np.log(code.distances))
    is_thrown = thrown is not None and thrown.mixture is not None
    problem = _Problem(target, outcome, planes, thrown, set_down or not is_thrown, code.bias)
    terms = problem.terms(planes)
    if terms is None:
        return None
    damping, penalty, failures = DAMPING[0], PENALTY, 0
    for _ in range(MAX_STEPS):
        step, multipliers = _sequential_step(terms, damping)
        largest = float(np.abs(multipliers).max())
        if largest < MAX_PENALTY:
            penalty = max(penalty, 1.5 * largest)
        before, size = terms.merit(penalty), float(np.abs(step).max())
        length = min(1.0, MAX_MOVE / size)
        for _ in range(MAX_TRIALS):
            moved = planes.move(length * step)
            trial = problem.terms(moved, slopes=False)
            if trial is not None and trial.merit(penalty) < before:
                break
            length *= SHRINK
        else:
            damping, failures = min(20.0 * damping, DAMPING[2]), failures + 1
            if failures > 2:
                break
            continue
        after = trial.merit(penalty)
        planes, failures = moved, 0
        terms = problem.terms(planes)
        assert terms is not None
        if before - after < LITTLE * before and terms.error < NEARLY_MET:
            break
        damping = max(damping / 4.0, DAMPING[1]) if length == 1.0 else 2.0 * damping
    for _ in range(POLISH_STEPS):
        if terms.error < REACHED:
            break
        step = _restoring_step(terms)
        length = min(1.0, MAX_MOVE / float(np.abs(step).max()))
        for _ in range(MAX_TRIALS):
            moved = planes.move(length * step)
            trial = problem.terms(moved)
            if trial is not None and trial.error < terms.error:
                break
            length *= SHRINK
        else:
            break
        planes, terms = moved, trial
    strain = float(terms.soft @ terms.soft) / 2.0
    return OutcomeSumsDie(terms.hull, planes.normals, terms.error, strain, problem.evaluations)


def arrange_outcomes(
    target: Floats, shares: FaceShares, code: FaceCode, thrown: ThrowProbabilities | None
) -> Integers:
    """(2 m,) outcome of each face of a code, so that the sums are near the target (k,) from the
    start, set down and thrown: pairs of `shares` in the best of many random orders, improved by
    swaps and turns of pairs as long as these help."""
    corners = polyhedron_corners(code.normals, code.distances)
    rests = evaluate_rests(torch.from_numpy(corners))
    face = np.argmax(rests.hull.normals[rests.facets] @ code.normals.T, axis=1)
    models = [rests.probability_values]
    if thrown is not None:
        models.append(thrown.probabilities(rests) * np.exp(code.bias[face]))
    faces, pairs = len(code.normals), len(code.normals) // 2
    probabilities = np.zeros((len(models), faces))
    probabilities[:, face] = models / np.sum(models, axis=1, keepdims=True)

    def outcomes(order: Integers) -> Integers:
        return np.asarray(shares.outcome[np.concatenate([order, (order + pairs) % faces])])

    def cost(order: Integers) -> float:
        own = outcomes(order)
        sums = np.array([np.bincount(own, row, len(target)) for row in probabilities])
        return float(((sums - target) ** 2 / (target + RARE)).sum())

    rng = np.random.default_rng(0)
    drawn = (rng.permutation(pairs) + pairs * rng.integers(0, 2, pairs) for _ in range(ORDERS))
    best = min(drawn, key=cost)
    least, is_better = cost(best), True
    while is_better:
        is_better = False
        for one, other in combinations_with_replacement(range(pairs), 2):
            for turn in (0, pairs):
                order = best.copy()
                order[[one, other]] = (order[[other, one]] + turn) % faces
                if (trial := cost(order)) < least - TINY_GAIN:
                    best, least, is_better = order, trial, True
    return outcomes(best)


def _sequential_step(terms: _Terms, damping: float) -> tuple[Floats, Floats]:
    """Step that minimizes the squares where the linearized sums are met, and the multipliers."""
    slopes, rows = terms.soft_slopes, terms.hard_slopes
    hessian = slopes.T @ slopes + damping * np.eye(slopes.shape[1])
    solved = np.linalg.solve(hessian, np.column_stack([slopes.T @ terms.soft, rows.T]))
    missing = terms.hard - rows @ solved[:, 0]
    multipliers = np.linalg.lstsq(rows @ solved[:, 1:], missing, rcond=1e-12)[0]
    return np.asarray(-solved[:, 0] - solved[:, 1:] @ multipliers), np.asarray(multipliers)


def _restoring_step(terms: _Terms) -> Floats:
    """Step that meets the linearized sums with the least change of the squares."""
    slopes, rows = terms.soft_slopes, terms.hard_slopes
    hessian = slopes.T @ slopes + DAMPING[0] * np.eye(slopes.shape[1])
    solved = np.linalg.solve(hessian, rows.T)
    return np.asarray(-solved @ np.linalg.lstsq(rows @ solved, terms.hard, rcond=1e-12)[0])
