"""Probabilities exact to rounding: one start after the other is led to the target, and the first
that gets there is made better by preference.

The unknowns are half-spaces of a die, those of symmetric ones, or vertices.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from dicedesign.errors import InputError
from dicedesign.gradient.odds_model import OddsUnderPrior
from dicedesign.gradient.thrown_odds import TableSensitivity
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.result import DesignResult, DesignStep
from dicedesign.optimize.solvers.candidate import Candidate
from dicedesign.optimize.solvers.exact_search import ExactSearch
from dicedesign.optimize.starts.start import Start
from dicedesign.rest.prior import Prior
from dicedesign.runtime.arrays import Floats

__all__ = ["solve_exactly"]

MOST_TOO_SMALL: Final = 12
"""Starts that lead to the odds, but to a circle that is too small, after which no more are tried: a
circle that large hardly fits any die of these odds."""

MOST_EMPTY_TURNS: Final = 600
"""Turns of a search for starts that may find nothing: about a minute."""


def solve_exactly(
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
    """Move the first of some starting shapes that leads there until its odds are the target.

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
    least_angle: between the facets of two outcomes, in radians, that the way to the odds tries to
        keep; 0 for none.
    sensitivity: has the model of thrown dice by which the target is met, and is what
        `prefer.robustness` lowers; None for odds without momentum.
    prior: how likely each direction is to be down at first, in the coordinates of `Start.points`,
        see `RestPoses.under`; None for all alike. Not with a sensitivity or a group.
    on_step: called after every accepted step.
    on_candidate: called with the die that every accepted step was recorded from, to look at more of
        it.

    Raises
    ------
    NoStartError: none of the starts has one rest for each outcome and no other.
    InputError: a start without the symmetry; a symmetry with `coordinates` "vertices"; least_circle
        out of range; a prior without a density, or with a symmetry or thrown odds.
    """
    if prior is not None and (group is not None or sensitivity is not None):
        raise InputError(
            "prior: expected no symmetry and no thrown odds with it, got one of them; leave it out"
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
    search = ExactSearch(
        target,
        options,
        center_of_mass,
        group,
        least_circle,
        least_angle,
        sensitivity,
        None if prior is None else OddsUnderPrior.of(prior),
        on_step,
        on_candidate,
    )
    empty_turns = 0
    for start in starts:
        if start is None:
            empty_turns += 1
            done = empty_turns == MOST_EMPTY_TURNS or search.is_spent
        else:
            done = search.solve(start) or search.starts == options.starts
            done = done or search.too_small == MOST_TOO_SMALL
            done = done or (search.is_spent and search.best is not None)
        if done:
            break
    return search.result()
