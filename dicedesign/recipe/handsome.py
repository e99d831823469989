"""`symmetry: auto` for dice that are set down: the most handsome of many shapes with the
probabilities."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count, islice

from dicedesign.errors import EngravingError, NoStartError
from dicedesign.fabricate.die import Design
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.looks import rate_looks
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.solvers.candidate import DesignResult
from dicedesign.optimize.starts.orbit_layouts import fitting_groups
from dicedesign.optimize.starts.start import Start
from dicedesign.recipe.convex import (
    find_starts,
    make_design,
    make_solver,
    wanted_of_directions,
)
from dicedesign.recipe.pipeline import Callbacks, Work
from dicedesign.recipe.solid import place_at_size
from dicedesign.results.parts import Status

GROUPS = 4
"""Point groups that are tried, the most helpful first."""

SHAPES = (9, 2)
"""Shapes without symmetry, and of each group, that have the probabilities."""

MANY_FACES = 20
"""Number of faces above which there are fewer groups and shapes, as each takes longer."""

TURNS = 2
"""Turns of the search for each of them, at most."""

IMPROVED = 2
"""Shapes that are improved by preferences."""

SAME_LOOKS = 3
"""Decimal digits of the logarithm of the measure, to which equal shapes count as one."""

MOST_SYMMETRIC = 40
"""Most faces of dice with symmetry. Many planes that meet in one corner part when facets are moved
to correct for labels; with rounded edges those of few faces do too."""

SYMMETRIC = 1.05
"""Factor on the measure of a die with a symmetry, which makes equal probabilities equal on every
table."""

MOST_DICE = 1500
"""Dice that may be tried before no further shape is begun."""


@dataclass(frozen=True)
class _Shape:
    """A die with the probabilities, and how handsome it is. group: name, or None."""

    group: str | None
    result: DesignResult
    measure: float

    @classmethod
    def of(cls, group: str | None, result: DesignResult) -> _Shape:
        return cls(group, result, rate_looks(result.hull, result.directions).measure)


def design_handsome(work: Work) -> Design:
    """Design a die without symmetry; then others from shapes with and without, improve the most
    handsome by the recipe's preferences, and keep the most handsome of all. With a limit on seconds
    or evaluations there are no others.

    Raises InputError if no start suits the target.
    """
    recipe, callbacks, shapes, first = work.recipe, work.callbacks, list[_Shape](), None
    refusal: NoStartError | None = None
    options = recipe.method.options
    has_limits = options.seconds is not None or options.evaluations is not None
    try:
        groups = list[str]()
        if recipe.edges is None and len(work.target.face_labels) <= MOST_SYMMETRIC:
            groups = fitting_groups(work.target.face_probabilities)[: _fewer(work, GROUPS)]
        least, most = _fewer(work, SHAPES[0]), _fewer(work, SHAPES[1])
        whole = 1 + least + len(groups) * most + IMPROVED
        callbacks.on_part(0, whole, "dice")
        work.recipe = recipe.model_copy(update={"symmetry": None})
        starts, (wanted, _) = find_starts(work), wanted_of_directions(recipe)
        try:
            first = make_solver(work)(starts, wanted)
            if first.status is Status.CONVERGED:
                shapes.append(_Shape.of(None, first))
        except NoStartError as error:
            refusal = error
        if first is not None and has_limits:
            # No more than was allowed.
            return make_design(work, first)
        numbers = count(0 if first is None else first.starts)
        # A callback may end the run.
        work.callbacks = Callbacks(on_start=lambda _: callbacks.on_start(next(numbers)))
        others = list(_reach_target(work, starts))
        for name in groups:
            callbacks.on_part(1 + len(others), whole, "dice")
            work.recipe = recipe.model_copy(update={"symmetry": name})
            others += _reach_target(work, find_starts(work))
        apart: dict[float, _Shape] = {}
        for shape in others:
            apart.setdefault(_grade(shape.measure), shape)
        for _, shape in sorted(apart.items())[: -IMPROVED - 1 : -1]:
            callbacks.on_part(1 + len(others), whole, "dice")
            work.recipe = recipe.model_copy(update={"symmetry": shape.group})
            others += _improve(work, shape)
        shapes += others
        if not shapes:
            work.recipe = recipe.model_copy(update={"symmetry": None})
            if refusal is not None:
                raise refusal
            assert first is not None
            return make_design(work, first)
        shapes.sort(key=_rank)
        best = next((shape for shape in shapes if _has_room(work, shape)), shapes[0])
        work.recipe = recipe.model_copy(update={"symmetry": best.group})
        tried = [shape.result for shape in shapes]
        total = replace(
            best.result,
            starts=len(tried),
            evaluations=sum(result.evaluations for result in tried),
            hulls_built=sum(result.hulls_built for result in tried),
            hulls_reused=sum(result.hulls_reused for result in tried),
        )
        work.notes.append(
            f"symmetry: {best.group or 'none'}; the most handsome of {len(tried)} dice with these "
            f"probabilities, by a measure of {best.measure:.2g} out of 1"
        )
        design = make_design(work, total)
        if best.result is not first:
            callbacks.on_shape(design.hull, design.directions)
            callbacks.on_step(design.steps[-1])
        return design
    finally:
        work.recipe, work.callbacks = recipe, callbacks


def _rank(shape: _Shape) -> tuple[float, int]:
    """The lower, the better; of equal looks the one with the most symmetries."""
    order = 1 if shape.group is None else len(point_group(shape.group))
    return -_grade(shape.measure * (SYMMETRIC if order > 1 else 1.0)), -order


def _grade(measure: float) -> float:
    """Rounded logarithm, equal for shapes that are equal up to rounding."""
    return round(math.log(max(measure, sys.float_info.min)), SAME_LOOKS)


def _fewer(work: Work, number: int) -> int:
    """Number, or less for a die of more than `MANY_FACES`; at least 1."""
    faces = len(work.target.face_labels)
    return max(number * MANY_FACES // max(faces, MANY_FACES), 1)


def _reach_target(work: Work, starts: Iterator[Start | None]) -> Iterator[_Shape]:
    """Yield dice that have the probabilities, without preferences, from some of the starts."""
    options, (wanted, _) = work.recipe.method.options, wanted_of_directions(work.recipe)
    quick = replace(options, prefer=Preferences(), starts=1)
    solve, group, tried, left = make_solver(work), work.recipe.symmetry, 0, 0
    most = _fewer(work, SHAPES[group is not None])
    for start in islice(starts, TURNS * most):
        if tried > MOST_DICE or left == most:
            break
        if start is None:
            continue
        try:
            result = solve([start], wanted, options=quick)
        except NoStartError:
            continue
        tried += result.evaluations
        if result.status is Status.CONVERGED:
            left += 1
            yield _Shape.of(group, result)


def _has_room(work: Work, shape: _Shape) -> bool:
    """Whether the labels fit at the recipe's size, or the die will be enlarged."""
    recipe = work.recipe
    if recipe.engrave is None or work.enlarge:
        return True
    try:
        place_at_size(work, make_design(work, shape.result), recipe.size_mm)
    except EngravingError:
        return False
    return True


def _improve(work: Work, shape: _Shape) -> Iterator[_Shape]:
    """Yield a die after steps by the recipe's preferences, if they lead anywhere."""
    start = Start(shape.result.hull.vertices, shape.result.directions)
    wanted, _ = wanted_of_directions(work.recipe)
    result = make_solver(work)([start], wanted)
    if result.status is Status.CONVERGED:
        before = shape.result.history
        later = (
            replace(step, step=step.step + len(before), seconds=step.seconds + before[-1].seconds)
            for step in result.history[1:]
        )
        yield _Shape.of(shape.group, replace(result, history=(*before, *later)))
