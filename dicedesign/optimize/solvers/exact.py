"""Probabilities exact to rounding: one start after the other is led to the target, and the first
that gets there is made better by preference.

The unknowns are half-spaces of a die, those of symmetric ones, or vertices."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Final

from dicedesign.errors import DegenerateBodyError, DiceError, InputError, NoStartError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.gradient.probability_model import ProbabilitiesUnderPrior, TableSensitivity
from dicedesign.optimize.coordinates import Coordinates, VertexCoordinates, coordinates_of
from dicedesign.optimize.options import MOST_WORK, ExactOptions
from dicedesign.optimize.solvers.candidate import (
    Candidate,
    CandidateMaker,
    DesignResult,
    DesignStep,
    LevenbergMarquardt,
    largest_jump,
)
from dicedesign.optimize.solvers.null_space_descent import improve
from dicedesign.optimize.starts.start import Start
from dicedesign.rest.poses import rest_poses
from dicedesign.rest.prior import Prior
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import FILE_PROBABILITIES

MOST_IMPROVEMENTS: Final = 100
"""Steps by preference, once the probabilities are met."""

MOST_TOO_SMALL: Final = 12
"""Starts that lead to the probabilities, but to a circle that is too small, after which no more are
tried: a circle that large hardly fits any die of these probabilities."""

MOST_EMPTY_TURNS: Final = 600
"""Turns of a search for starts that may find nothing: about a minute."""


def solve_exact(
    starts: Iterable[Start | None],
    target: Floats,
    options: ExactOptions,
    *,
    center_of_mass: Floats | None = None,
    group: Floats | None = None,
    least_circle: float = 0.0,
    least_angle: float = 0.0,
    sensitivity: TableSensitivity | None = None,
    prior: Prior | str | None = None,
    on_step: Callable[[DesignStep], None] | None = None,
    on_candidate: Callable[[Candidate], None] | None = None,
) -> DesignResult:
    """Move the first of some starting shapes that leads there until its probabilities are the
    target.

    Every result has exactly one rest for each outcome and no other. Starts that do not have that
    are passed over.

    Parameters
    ----------
    starts: shapes with (k, 3) outcome directions, made one after the other as they are needed; None
        where a turn found nothing, of which `MOST_EMPTY_TURNS` end the search. Pinned facets stay
        in their planes, with `coordinates` "facets" and no group.
    target: (k,) wanted probability of each direction.
    options: see `ExactOptions`.
    center_of_mass: (3,) fixed, in the coordinates of `Start.points`, or None for the uniform solid.
    group: (g, 3, 3) a point group that the starts and the die have as symmetry, about the origin,
        or None. Outcomes whose facets are images of each other are equally probable.
    least_circle: radius, over the largest distance of two vertices, that a circle in the facet of
        each outcome has; starts that do not lead there are passed over. In [0, 0.5).
    least_angle: between the facets of two outcomes, in radians, that the way to the probabilities
        tries to keep; 0 for none.
    sensitivity: has the model of thrown dice by which the target is met, and is what
        `prefer.robustness` lowers; None for probabilities without momentum.
    prior: how likely each direction is to be down at first, in the coordinates of `Start.points`,
        see `RestPoses.under`; None for uniform directions. Not with a sensitivity or a group.
    on_step: called after every accepted step.
    on_candidate: called with the die that every accepted step was recorded from, to look at more of
        it.

    Raises
    ------
    NoStartError: none of the starts has one rest for each outcome and no other.
    InputError: a start without the symmetry; a symmetry with `coordinates` "vertices"; least_circle
        out of range; a prior without a density, or with a symmetry or thrown probabilities.
    """
    if prior is not None and (group is not None or sensitivity is not None):
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
    under_prior = None if prior is None else ProbabilitiesUnderPrior.of(prior)
    thrown = None if sensitivity is None else sensitivity.thrown
    search = _Search(
        target,
        options,
        CandidateMaker(center_of_mass, thrown or under_prior),
        group,
        least_circle,
        least_angle,
        sensitivity,
        under_prior,
        on_step,
        on_candidate,
    )
    empty_turns = 0
    for start in starts:
        if start is None:
            empty_turns += 1
            done = empty_turns == MOST_EMPTY_TURNS or search.is_spent()
        else:
            done = search.solve(start) or search.starts == options.starts
            done = done or search.too_small == MOST_TOO_SMALL
            done = done or (search.is_spent() and search.best is not None)
        if done:
            break
    return search.result()


@dataclass(frozen=True)
class _Best:
    """A die, what is wrong with it (`_Search.shortfall`), and the terms of its energy."""

    candidate: Candidate
    shortfall: tuple[float, float]
    terms: dict[str, float]


@dataclass
class _Search:
    """The best die so far, over all starts; see `solve_exact`."""

    target: Floats
    options: ExactOptions
    maker: CandidateMaker
    group: Floats | None
    least_circle: float
    least_angle: float
    sensitivity: TableSensitivity | None
    under_prior: ProbabilitiesUnderPrior | None
    on_step: Callable[[DesignStep], None] | None
    on_candidate: Callable[[Candidate], None] | None
    first: Start | None = None
    best: _Best | None = None
    history: list[DesignStep] = field(default_factory=list)
    starts: int = 0
    too_small: int = 0

    def __post_init__(self) -> None:
        self.started = time.perf_counter()
        # Largest |p - q| to end with: the die may yet be scaled, and its probabilities rounded
        # anew.
        self.aim = self.options.tolerance / 2.0

    def is_out_of_time(self) -> bool:
        limit = self.options.seconds
        return limit is not None and time.perf_counter() - self.started >= limit

    def is_spent(self) -> bool:
        """Whether nothing more is to be tried."""
        most = self.options.evaluations or MOST_WORK // len(self.target)
        return self.maker.evaluations >= most or self.is_out_of_time()

    def solve(self, start: Start) -> bool:
        """Go from one start to the target, and on by preference; whether nothing is left to do."""
        self.starts += 1
        self.first = self.first or start
        prefer = self.options.prefer
        if self.sensitivity is None or not self.sensitivity.is_known:
            prefer = prefer.replace(robustness=0.0)
        try:
            coordinates, parameters = self._coordinates(start)
        except DegenerateBodyError:
            # A variation that has left a fixed center of mass outside.
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
        on_the_way = [reached]

        def note(candidate: Candidate, value: float) -> None:
            on_the_way.append(candidate)
            self._record(candidate, value)

        reached = improve(
            reached,
            self.target,
            self.maker,
            prefer,
            sensitivity=self.sensitivity,
            least_circle=self.least_circle,
            tolerance=self.aim,
            steps=MOST_IMPROVEMENTS,
            out_of_time=self.is_spent,
            on_step=note,
        )
        if self.under_prior is not None and not self._is_firm(on_the_way, self.under_prior.prior):
            return False
        fits = self.shortfall(reached) == (0.0, 0.0)
        self.too_small += not fits
        return fits

    def _coordinates(self, start: Start) -> tuple[Coordinates, Floats]:
        center = self.maker.center_of_mass
        origin = convex_hull(start.points).centroid if center is None else center
        if self.options.coordinates == "vertices":
            return VertexCoordinates.of(start.points, origin)
        pinned = start.directions[list(start.pinned)]
        return coordinates_of(start.points, origin, self.group, pinned)

    def _is_firm(self, dice: list[Candidate], prior: Prior) -> bool:
        """Whether one of some dice that meet the target keeps its probabilities in a file: the last
        of those is then the best; else the last of all is, with that as a fault."""
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
        """Faults of a candidate: first its error beyond the tolerance, then what its
        smallest circle lacks."""
        error = candidate.error(self.target)
        if error > self.aim:
            return error, 0.0
        if self.least_circle == 0.0:
            return 0.0, 0.0
        return 0.0, max(self.least_circle - candidate.least_circle, 0.0)

    def _record(self, candidate: Candidate, value: float | None = None) -> None:
        """Take note of a candidate: on the way to the target, or one that is better by preference
        than the last, with the value that its step has lowered."""
        terms, shortfall = {"dice": candidate.dice_energy(self.target)}, self.shortfall(candidate)
        if value is not None:
            terms["preferences"] = value
        if (
            self.best is None
            or shortfall < self.best.shortfall
            or (value is not None and shortfall == self.best.shortfall)
        ):
            self.best = _Best(candidate, shortfall, terms)
        seconds, error = time.perf_counter() - self.started, candidate.error(self.target)
        step = DesignStep(len(self.history), seconds, sum(terms.values()), terms, error)
        self.history.append(step)
        if self.on_candidate is not None:
            self.on_candidate(candidate)
        if self.on_step is not None:
            self.on_step(step)

    def result(self) -> DesignResult:
        """The best die of all starts."""
        if self.best is None:
            raise self._no_start()
        best, (error, small) = self.best.candidate, self.best.shortfall
        status = Status.NO_START
        if error == 0.0:
            status = Status.CONVERGED if small == 0.0 else Status.TOO_SMALL
        elif self.is_spent():
            status = Status.TIME_LIMIT if self.is_out_of_time() else Status.STEP_LIMIT
        polars, shapes = self.maker.polars, self.maker.shapes
        return DesignResult(
            status,
            best.rests.hull,
            best.directions,
            best.error(self.target),
            self.best.terms,
            tuple(self.history),
            self.maker.evaluations,
            polars.built + shapes.built,
            polars.reused + shapes.reused,
            self.starts,
        )

    def _no_start(self) -> NoStartError:
        first = "none"
        if self.first is not None:
            center = self.maker.center_of_mass
            with suppress(DiceError):
                poses = rest_poses(self.first.points, "hull" if center is None else center)
                first = f"{len(poses.normals)} rests at first"
        remedy = "take another start"
        if self.is_spent():
            limit = "seconds" if self.is_out_of_time() else "evaluations"
            remedy = f"allow more with method.exact.{limit}"
        if self.group is not None:
            remedy += ", or take a smaller symmetry or none"
        return NoStartError(
            f"start: expected a shape with one rest for each of {len(self.target)} outcomes "
            f"and no other, got {first}; {remedy}"
        )
