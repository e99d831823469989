"""From a recipe to a designed and judged die; nothing is written here."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.design.coordinates.symmetric import orbits_of_directions
from dicedesign.design.preferences.weights import Preferences
from dicedesign.design.refinement import Round
from dicedesign.design.result import DesignResult, DesignStep
from dicedesign.design.solvers.descent import descend_to_target
from dicedesign.design.solvers.exact import solve_exactly
from dicedesign.design.starts.hendecahedron import hendecahedron
from dicedesign.design.starts.mesh import mesh_start
from dicedesign.design.starts.prism import prism
from dicedesign.design.starts.repulsion import repulsion
from dicedesign.design.starts.search import shapes_near
from dicedesign.design.starts.start import Start
from dicedesign.design.starts.symmetric_search import symmetric_shapes_near
from dicedesign.design.starts.variations import shapes_like
from dicedesign.design.targets import Target
from dicedesign.errors import InputError, NoStartError
from dicedesign.fabricate.verdict import Verdict, judge
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.hulls.polygons import facet_inradius
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.recipe.on_table import (
    TableVerdict,
    check_throws_of,
    first_swing,
    judge_on_table,
    refined,
)
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.rest.equilibria import classify
from dicedesign.results.status import Status
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import EQUAL_ODDS

if TYPE_CHECKING:
    from dicedesign.fabricate.engraving import EngravedDie

__all__ = ["DesignedDie", "design_die", "make_start", "resized", "thrown_die"]

RARE: Final = 1e-5
"""Outcomes below are seldom met exactly: of the shapes that lead there most lose their facets."""

CLOSE_STARTS: Final = 12
"""Variations of a die that are led to corrected odds, until one gets there: the momentum model has
kinks, at which some get stuck."""


@dataclass(frozen=True)
class DesignedDie:
    """A design and what the finished die does.

    Attributes
    ----------
    target: what was wanted.
    design: what the method found, and its history.
    verdict: the die in mm and its odds.
    status: why the design stopped; CONVERGED only if the finished die is within the tolerance.
    message: the same in a sentence, with the error and what is wrong.
    rounds: of throws and new designs, for a die that was refined.
    """

    target: Target
    design: DesignResult
    verdict: Verdict
    status: Status
    message: str
    rounds: tuple[Round, ...] = ()


def make_start(recipe: Recipe) -> Start | None:
    """The starting shape of a recipe, or None where shapes are to be searched.

    Raises InputError if a mesh cannot be read or has too few rests, the center of mass is not
    inside the shape, a symmetry does not permute its facets or carries labels to less probable
    ones, the method is concave, or the die cannot be thrown as it says.
    """
    if recipe.method.concave is not None:
        raise InputError(
            "method: expected exact or descent, got concave; such a recipe is for dicedesign run "
            "alone"
        )
    if recipe.method.exact is not None and recipe.method.thrown:
        check_throws_of(recipe.method.exact, recipe.size_mm)
    start = _chosen_start(recipe)
    if start is None or recipe.symmetry is None:
        return start
    # Every symmetry of a body keeps its centroid where it is.
    start = start.about_centroid()
    _check_orbits(recipe, start)
    return start


def _chosen_start(recipe: Recipe) -> Start | None:
    choice, outcomes = recipe.start, len(recipe.target.target().labels)
    center = _given_center(recipe)
    if choice.search is not None:
        return None
    if choice.mesh is not None:
        return mesh_start(read_body(Path(choice.mesh.path)), outcomes, center)
    if choice.prism is not None:
        sides = choice.prism.sides_for(outcomes)
        start = prism(sides, choice.prism.height, choice.prism.cap)
    elif choice.hendecahedron is not None:
        start = hendecahedron(choice.hendecahedron)
    else:
        start = repulsion(outcomes, recipe.seed)
    if center is not None:
        # Here an error still speaks of the coordinates that the recipe uses.
        classify(convex_hull(start.origin + start.scale * start.points), center)
    return start


def _check_orbits(recipe: Recipe, start: Start) -> None:
    """Raise InputError unless labels on facets that are images of each other are as probable."""
    group, target = recipe.group(), recipe.target.target()
    assert group is not None
    outcome = np.array(recipe.outcome_of_direction())
    first: dict[int, int] = {}
    for orbit, number in zip(orbits_of_directions(start.directions, group), outcome, strict=True):
        other = first.setdefault(int(orbit), int(number))
        odds = target.probabilities[[number, other]]
        if abs(odds[0] - odds[1]) > EQUAL_ODDS * odds[1]:
            raise InputError(
                f"symmetry: expected labels {target.labels[other]} and {target.labels[number]} to "
                f"be equally probable, as {recipe.symmetry} carries their facets to each other, "
                f"got {odds[1]:.6g} and {odds[0]:.6g}; change the assignment, or take a smaller "
                "group"
            )


def design_die(
    recipe: Recipe,
    start: Start | None,
    *,
    on_step: Callable[[DesignStep], None] | None = None,
    on_round: Callable[[Round], None] | None = None,
) -> DesignedDie:
    """Move the start to the recipe's target and judge the finished die; nothing is written.

    Raises InputError if the start does not suit the target, or the table has no momentum model.
    """
    center, method = _normalised_center(recipe, start), recipe.method
    wanted = recipe.target.target().probabilities[recipe.outcome_of_direction()]
    rounds: tuple[Round, ...] = ()
    if method.descent is not None:
        # Only the exact method searches.
        assert start is not None
        design = descend_to_target(
            start,
            wanted,
            method.descent,
            center_of_mass=center,
            seed=recipe.seed,
            on_step=on_step,
        )
    else:
        assert method.exact is not None
        solve = partial(
            solve_exactly,
            options=method.exact,
            center_of_mass=center,
            group=recipe.group(),
            least_circle=recipe.min_inradius_mm / recipe.size_mm,
            on_step=on_step,
        )
        swing = first_swing(method.exact, wanted)
        design = solve(_starts(recipe, start, wanted), wanted, swing=swing)
        if method.exact.refine is not None and design.status is Status.CONVERGED:
            exact, known = method.exact, swing
            assert known is not None

            def again(die: DesignResult, odds: Floats, bias: Floats | None) -> DesignResult | None:
                near = shapes_like(
                    Start(die.hull.vertices, die.directions), recipe.seed, recipe.group()
                )
                close = islice(near, CLOSE_STARTS)
                try:
                    if bias is None:
                        nearest = replace(exact, prefer=Preferences())
                        found = solve(close, odds, swing=known, options=nearest)
                    else:
                        found = solve(close, odds, swing=replace(known, bias=bias))
                except NoStartError:
                    return None
                return found if found.status is Status.CONVERGED else None

            design, rounds = refined(
                design,
                wanted,
                method.exact.refine,
                method.exact.table,
                size_mm=recipe.size_mm,
                seed=recipe.seed,
                group=recipe.group(),
                center_of_mass=center,
                robust=exact.prefer.robustness > 0.0 and known.is_known,
                design=again,
                on_round=on_round,
            )
    return _judged(recipe, start, design, rounds)


def _starts(recipe: Recipe, start: Start | None, wanted: Floats) -> Iterator[Start | None]:
    """What the exact method begins with, one after the other; None where nothing was found for a
    while."""
    group = recipe.group()
    if start is not None:
        return shapes_like(start, recipe.seed, group, any_order=recipe.any_order)
    if group is not None:
        return symmetric_shapes_near(wanted, group, recipe.seed)
    return shapes_near(wanted, recipe.seed)


def thrown_die(
    recipe: Recipe, die: DesignedDie, start: Start | None, engraved: EngravedDie | None
) -> TableVerdict:
    """What a die does on the table of its recipe. One with labels is thrown as it is printed, but
    where the center of mass was given nobody knows how they move it."""
    assert recipe.method.exact is not None
    verdict = die.verdict
    solid = make_body(verdict.hull.vertices, verdict.hull.triangles, name="die")
    if engraved is not None and verdict.uniform:
        solid = make_body(engraved.vertices, engraved.triangles, name="die")
    return judge_on_table(
        solid,
        None if verdict.uniform else verdict.poses.center_of_mass,
        _outcome_directions(recipe, die.design),
        recipe.method.exact,
        die.rounds,
        recipe.seed,
    )


def resized(die: DesignedDie, recipe: Recipe, start: Start | None) -> DesignedDie:
    """A die designed from `start`, as it is at the size of a recipe that differs in that alone."""
    return _judged(recipe, start, die.design, die.rounds)


def _judged(
    recipe: Recipe, start: Start | None, design: DesignResult, rounds: tuple[Round, ...]
) -> DesignedDie:
    target, center = recipe.target.target(), _normalised_center(recipe, start)
    directions = _outcome_directions(recipe, design)
    verdict = judge(design.hull, directions, target, recipe.size_mm, center)
    status, message = _outcome(design, verdict, recipe)
    return DesignedDie(target, design, verdict, status, message, rounds)


def _outcome_directions(recipe: Recipe, design: DesignResult) -> Floats:
    """(k, 3) where the outcomes are, in the order of the target."""
    return design.directions[np.argsort(recipe.outcome_of_direction())]


def _normalised_center(recipe: Recipe, start: Start | None) -> Floats | None:
    """The given center of mass in the coordinates of `Start.points`."""
    given = _given_center(recipe)
    return None if given is None or start is None else start.normalised(given)


def _given_center(recipe: Recipe) -> Floats | None:
    return None if recipe.center_of_mass is None else np.array(recipe.center_of_mass)


def _outcome(design: DesignResult, verdict: Verdict, recipe: Recipe) -> tuple[Status, str]:
    """Status and message: the design's, unless the finished die says otherwise."""
    status, tolerance = design.status, recipe.method.tolerance
    if recipe.method.thrown:
        # Its odds without momentum are not meant to be the target.
        remarks = [
            f"{status.value} by the momentum model; max |p - q| is {design.error:.3g} of the odds "
            "that it was asked for"
        ]
    else:
        if status is Status.CONVERGED and verdict.max_abs_error > tolerance:
            status = Status.OFF_TARGET
        remarks = [f"{status.value}; max |p - q| is {verdict.max_abs_error:.3g}"]
    if status is not Status.CONVERGED:
        remarks += _what_to_change(status, design, verdict, recipe)
    missing = int((verdict.facet_of_outcome < 0).sum())
    if missing:
        remarks.append(f"{missing} outcomes have no facet to rest on")
    stray = 1.0 - float(verdict.probabilities.sum())
    if stray > tolerance:
        remarks.append(f"{stray:.3g} of the probability lies on rests without a label")
    remarks += recipe.doubts()
    return status, "; ".join(remarks)


def _what_to_change(
    status: Status, design: DesignResult, verdict: Verdict, recipe: Recipe
) -> Iterator[str]:
    """What else there is to say about a design that did not converge."""
    if design.starts > 1:
        yield f"this is the best of {design.starts} starting shapes"
    if status is Status.TIME_LIMIT:
        yield f"allow more with {recipe.method.limits_key}.seconds"
    if recipe.method.exact is not None and recipe.method.exact.coordinates == "vertices":
        yield "facets of more than three sides break under coordinates: vertices; facets keeps them"
    if status is Status.TOO_SMALL:
        facets = verdict.facet_of_outcome[verdict.facet_of_outcome >= 0].tolist()
        radius = min(facet_inradius(verdict.hull, facet) for facet in facets)
        yield f"the smallest circle has a radius of {radius:.3g} mm"
    smallest = float(recipe.target.target().probabilities.min())
    if recipe.method.exact is not None and smallest < RARE:
        yield (
            f"an outcome of {smallest:.2g} is hard to give a facet of its own: leave out or join "
            "what is so rare"
        )
