"""The exact method: it leads one starting shape after the other to the target probabilities, to
rounding, and improves the first that gets there by preferences.

The unknowns are the half-spaces of a die, those of symmetric ones, or vertices.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from dicedesign.errors import DegenerateBodyError, DiceError, InputError, NoStartError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.gradient.probability_model import (
    RESTING,
    ProbabilitiesUnderPrior,
    ProbabilityModel,
    ThrowProbabilities,
)
from dicedesign.optimize.coordinates import Coordinates, VertexCoordinates, coordinates_of
from dicedesign.optimize.options import MOST_WORK, ExactOptions
from dicedesign.optimize.solvers.candidate import (
    Candidate,
    CandidateMaker,
    DesignResult,
    DesignStep,
    LevenbergMarquardt,
    StepLog,
)
from dicedesign.optimize.solvers.null_space_descent import NullSpaceDescent
from dicedesign.optimize.starts.start import Start
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import analyze, rest_poses
from dicedesign.rest.prior import Prior
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import FILE_PROBABILITIES

MOST_IMPROVEMENTS = 100
"""Limit on the steps by preferences."""

MOST_TOO_SMALL = 12
"""Limit on the starts that reach the probabilities, but have too small a circle: hardly any die of
these probabilities has larger ones then."""

MOST_EMPTY_TURNS = 600
"""Limit on the turns of a search that find no start: about a minute."""


def solve_exact(
    starts: Iterable[Start | None],
    target: Floats,
    options: ExactOptions,
    *,
    center_of_mass: Floats | None = None,
    group: Floats | None = None,
    least_circle: float = 0.0,
    thrown: ThrowProbabilities | None = None,
    prior: Prior | str | None = None,
    outcome_of: Integers | None = None,
    on_step: Callable[[DesignStep], None] | None = None,
    on_candidate: Callable[[Candidate], None] | None = None,
) -> DesignResult:
    """Lead the first possible starting shape to the target probabilities.

    The result has exactly one rest for each labeled face and no other. Starts that do not are
    skipped.

    Parameters
    ----------
    starts: shapes with (f, 3) directions of faces, made as they are needed; None for a turn of a
        search that found nothing, and `MOST_EMPTY_TURNS` of these end it. Pinned facets stay in
        their planes, with `coordinates` "facets" and no group.
    target: (k,) target probability of each outcome.
    options: see `ExactOptions`.
    center_of_mass: (3,) fixed, in the coordinates of `Start.points`, or None for the uniform solid.
    group: (g, 3, 3) point group about the origin that the starts and the die have as symmetry, or
        None. Outcomes whose facets are images of each other are equally probable.
    least_circle: least radius of a circle in the facet of each outcome, over the largest distance
        of two vertices, in [0, 0.5). Starts that do not lead there are skipped.
    thrown: model of thrown dice; None for probabilities without momentum.
    prior: distribution of the start orientations, in the coordinates of `Start.points`, see
        `RestPoses.under`; None is uniform. Not with `thrown` or a group.
    outcome_of: (f,) outcome that each face shows, whose probabilities sum to its own in any shares;
        None for one outcome each, f = k.
    on_step: called after every accepted step.
    on_candidate: called before that with the die of the step.

    Raises
    ------
    NoStartError: no start has one rest for each face and no other.
    InputError: a start without the symmetry; a symmetry with `coordinates` "vertices"; least_circle
        out of range; a prior without a density, or with a symmetry or thrown probabilities.
    """
    if prior is not None and (group is not None or thrown is not None):
        raise InputError(
            "prior: expected no symmetry and no thrown probabilities with it, got one of them; "
            "leave it out"
        )
    if group is not None and options.coordinates != "facets":
        raise InputError(
            f'symmetry: expected coordinates "facets", got {options.coordinates!r}; leave one of '
            "them out"
        )
    if not 0.0 <= least_circle < 0.5:
        raise InputError(
            "least circle: expected a radius from 0 on and below 0.5 of the largest distance of "
            f"two vertices, got {least_circle:g}; lower it"
        )
    model: ProbabilityModel = thrown or RESTING
    if prior is not None:
        model = ProbabilitiesUnderPrior.of(prior)
    maker = CandidateMaker(center_of_mass, model=model, outcome_of=outcome_of)
    log = StepLog(on_step, on_candidate)
    search = ExactSearch(target, options, maker, log, group, least_circle)
    return search.run(starts)


@dataclass(frozen=True)
class _Best:
    """A die, its shortfall (`ExactSearch.shortfall`) and the terms of its energy."""

    candidate: Candidate
    shortfall: tuple[float, float]
    terms: dict[str, float]


@dataclass
class ExactSearch:
    """The best die so far, over all starts; for the fields see `solve_exact`.

    Attributes
    ----------
    maker: makes the dice that are tried, with a model of their probabilities.
    log: accepted steps.
    least_angle: least angle between the facets of two outcomes, in radians, that the way to the
        probabilities tries to keep; 0 for none.
    first: first start.
    starts: number of starts tried; too_small: number of those with too small a circle.
    """

    target: Floats
    options: ExactOptions
    maker: CandidateMaker
    log: StepLog
    group: Floats | None = None
    least_circle: float = 0.0
    least_angle: float = 0.0
    first: Start | None = None
    best: _Best | None = None
    starts: int = 0
    too_small: int = 0

    @property
    def aim(self) -> float:
        """Largest |p - q| to end with, as rounding may change it when the die is scaled."""
        return self.options.tolerance / 2.0

    def run(self, starts: Iterable[Start | None]) -> DesignResult:
        """Try starts one after the other, and return the best die of all. Raises NoStartError."""
        empty_turns = 0
        for start in starts:
            if start is None:
                empty_turns += 1
                done = empty_turns == MOST_EMPTY_TURNS or self.is_spent()
            else:
                done = (
                    self.solve(start)
                    or self.starts == self.options.starts
                    or self.too_small == MOST_TOO_SMALL
                    or (self.is_spent() and self.best is not None)
                )
            if done:
                break
        if self.best is None:
            raise self._no_start()
        best, (error, small) = self.best.candidate, self.best.shortfall
        status = Status.NO_START
        if error == 0.0:
            status = Status.CONVERGED if small == 0.0 else Status.TOO_SMALL
        elif self.is_spent():
            status = Status.TIME_LIMIT if self.is_out_of_time() else Status.STEP_LIMIT
        return DesignResult(
            status,
            best.rests.hull,
            best.directions,
            best.error(self.target),
            self.best.terms,
            tuple(self.log.steps),
            self.maker.evaluations,
            self.maker.hulls_built,
            self.maker.hulls_reused,
            self.starts,
        )

    def is_out_of_time(self) -> bool:
        """Whether the time limit has passed."""
        limit = self.options.seconds
        return limit is not None and self.log.seconds >= limit

    def is_spent(self) -> bool:
        """Whether no more dice may be tried."""
        most = self.options.evaluations or MOST_WORK // len(self.target)
        return self.maker.evaluations >= most or self.is_out_of_time()

    def solve(self, start: Start) -> bool:
        """Lead a start to the target and improve it by preferences; return whether it is done."""
        self.starts += 1
        self.first = self.first or start
        try:
            coordinates, parameters = self._coordinates(start)
        except DegenerateBodyError:
            # A variation with a fixed center of mass outside.
            return False
        first = self.maker.attempt(coordinates, parameters, start.directions)
        if first is None:
            return False
        reached = LevenbergMarquardt(
            self.target,
            self.maker,
            self.aim,
            self.options.sobolev,
            self.least_angle,
            self.is_spent,
            self._record,
        ).solve(first)
        if reached.error(self.target) > self.aim:
            return False
        dice = [reached]

        def note(candidate: Candidate, value: float) -> None:
            dice.append(candidate)
            self._record(candidate, value)

        reached = NullSpaceDescent(
            self.target,
            self.maker,
            self.options.prefer,
            self.least_circle,
            self.aim,
            self.is_spent,
            note,
        ).improve(reached, MOST_IMPROVEMENTS)
        model = self.maker.model
        if isinstance(model, ProbabilitiesUnderPrior) and not self._is_firm(dice, model.prior):
            return False
        fits = self.shortfall(reached) == (0.0, 0.0)
        self.too_small += not fits
        return fits

    def _coordinates(self, start: Start) -> tuple[Coordinates, Floats]:
        center = self.maker.center_of_mass
        origin = convex_hull(start.points).centroid if center is None else center
        if self.options.coordinates == "vertices":
            return VertexCoordinates.of(start.points, origin)
        return coordinates_of(start.points, origin, self.group)

    def _is_firm(self, dice: list[Candidate], prior: Prior) -> bool:
        """Whether one of some dice that meet the target keeps its probabilities in a file. The last
        of those becomes the best; without any, the last of all has the jump as its shortfall."""
        most = max(self.options.tolerance, FILE_PROBABILITIES)
        for candidate in reversed(dice):
            jump = largest_jump(candidate, self.target, prior)
            if jump <= most:
                if candidate is not dice[-1]:
                    terms = {"dice": candidate.dice_energy(self.target)}
                    self.best = _Best(candidate, self.shortfall(candidate), terms)
                return True
        assert self.best is not None
        self.best = replace(self.best, shortfall=(jump, 0.0))
        return False

    def shortfall(self, candidate: Candidate) -> tuple[float, float]:
        """Error of a candidate if it exceeds the tolerance, and the part of the least circle that
        it lacks; 0 if they suffice."""
        error = candidate.error(self.target)
        if error > self.aim:
            return error, 0.0
        if self.least_circle == 0.0:
            return 0.0, 0.0
        return 0.0, max(self.least_circle - candidate.least_circle, 0.0)

    def _record(self, candidate: Candidate, value: float | None = None) -> None:
        """Log a candidate. value: objective of the preferences, for their steps; each of these is
        better than the last."""
        terms, shortfall = {"dice": candidate.dice_energy(self.target)}, self.shortfall(candidate)
        if value is not None:
            terms["preferences"] = value
        if (
            self.best is None
            or shortfall < self.best.shortfall
            or (value is not None and shortfall == self.best.shortfall)
        ):
            self.best = _Best(candidate, shortfall, terms)
        self.log.record(terms, candidate.error(self.target), candidate)

    def _no_start(self) -> NoStartError:
        first, remedy = "got none", "take another start"
        of_face = self.maker.outcome_of
        faces = len(self.target if of_face is None else of_face)
        if self.first is not None:
            center = self.maker.center_of_mass
            with suppress(DiceError):
                poses = rest_poses(self.first.points, "hull" if center is None else center)
                first = f"but the start has {len(poses.normals)} rests"
                if len(poses.normals) > faces:
                    remedy = "remove the extra rests, use method: paper, or take another start"
        if self.is_spent():
            limit = "seconds" if self.is_out_of_time() else "evaluations"
            remedy = f"allow more with method.exact.{limit}"
        if self.group is not None:
            remedy += ", or take a smaller symmetry or none"
        return NoStartError(
            f"start: expected a shape with one rest for each of {faces} labeled faces "
            f"and no other, {first}; {remedy}"
        )


TRIALS = 4

ROUNDED = float(np.finfo(np.float32).eps) / 2.0
"""Largest relative error of a coordinate in single precision."""


def largest_jump(candidate: Candidate, target: Floats, prior: Prior) -> float:
    """Largest |p - q| under a prior of copies of a die with corners rounded as in a file; 1 if a
    copy is no die.

    target: (k,) target probabilities.
    """
    corners, center = candidate.rests.hull.vertices, candidate.rests.given_center
    size, random = float(np.abs(corners).max()), np.random.default_rng(0)
    errors = []
    for _ in range(TRIALS):
        noise = ROUNDED * size * random.uniform(-1.0, 1.0, corners.shape)
        try:
            hull = convex_hull(corners + noise, single_precision=True)
            poses = analyze(hull, hull.centroid if center is None else center.numpy()).under(prior)
            faces = candidate.directions, candidate.outcome_of
            errors.append(outcome_probabilities(poses, *faces).error(target))
        except DiceError:
            errors.append(1.0)
    return max(errors)
