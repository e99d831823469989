"""`faces: auto`: dice with different numbers of faces for one target, and the best by a rule.

In this order: dice of equal faces, which are right in every hand; dice of nearly equal faces in
opposite pairs, solved to be right set down and thrown; one face an outcome. The first that lacks
nothing is made, so the others are only designed if more candidates are wanted, or if each lacks
something: then the one that lacks least.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from dicedesign.errors import EngravingError, InputError, NoStartError
from dicedesign.fabricate.die import Design, make_solid
from dicedesign.fabricate.label_reading import die_readings
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull, polyhedron_corners
from dicedesign.gradient.probability_model import ThrowProbabilities
from dicedesign.optimize.looks import rate_looks
from dicedesign.optimize.solvers.outcome_sums import (
    OutcomeSumsDie,
    arrange_outcomes,
    solve_outcome_sums,
)
from dicedesign.optimize.starts.face_bodies import (
    FaceShares,
    equal_faces_body,
    even_codes,
    numbers_of_equal_faces,
    share_faces,
    weighted_code,
)
from dicedesign.optimize.targets import Target
from dicedesign.recipe.handsome import design_handsome
from dicedesign.recipe.pipeline import Work
from dicedesign.recipe.recipe import AUTO
from dicedesign.recipe.solid import enlarge
from dicedesign.recipe.thrown import forecast_throws
from dicedesign.results.parts import MAX_THROWN_OFF, Candidate, Status
from dicedesign.results.result import HullCounts, Step
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.workers import one_thread

NUMBERS = (24, 30, 34, 36, 38, 42, 46, 48)
"""Numbers of nearly equal faces that are tried, those of `even_codes`."""

EVEN_SHARES = 0.015
"""Cost of the shares of faces up to which the smallest number of faces comes first."""

ODD_SHARES = 0.12
"""Cost of shares from which the starting faces have different sizes."""

MAX_NEAR = 2
"""Numbers of nearly equal faces that are tried before one face an outcome, unless more dice are
wanted."""

RARE = 0.002
"""Probability below which a die of one face an outcome is designed too."""

CODES = 2
"""Starting shapes for each number of nearly equal faces."""

MAX_STRAIN = 1.5
"""Strain up to which no further starting shape is tried."""

SOLVED = 1e-9
"""Error of the sums at which a die of nearly equal faces counts as solved."""

MAX_HANDS = 0.05
"""Total variation from the target when thrown, for nine in ten hands."""

MIN_LABEL = 0.1
"""Diameter of the circle in the smallest labeled face over that of the die: 3 mm of 30 mm."""

MIN_COMPACT = 0.5
"""Isoperimetric quotient; a cube has 0.52."""


@dataclass(frozen=True, eq=False)
class _Die:
    """A designed candidate. name: of its shape; target: with the faces of the design; is_equal:
    whether it is right in every hand, by symmetry."""

    name: str
    target: Target
    design: Design
    is_equal: bool = False


@one_thread()
def design_candidates(work: Work) -> Design:
    """Design dice with different numbers of faces, record what distinguishes them, and return the
    one that the recipe picks, the first by default. Sets the work's target to its faces.

    Raises NoStartError if none is found, InputError if fewer are than the recipe picks from.
    """
    recipe = work.recipe
    wanted = max(recipe.candidates, recipe.pick)
    found, measured = list[_Die](), list[Candidate]()
    for die in _design_dice(work, wanted):
        found.append(die)
        measured.append(_measure(work, die, full=wanted > 1))
        work.callbacks.on_candidate(measured[-1], die.target, die.design)
        work.callbacks.on_part(len(found), len(found) + 1, "dice")
        if sum(not one.lacks for one in measured) == wanted:
            break
    if not found:
        raise NoStartError(
            f"faces: expected a number with which a die has the target, got {recipe.faces}, to "
            "which no starting shape led; take more faces, or write auto or one"
        )
    # Dice that lack nothing stay in the order of the rule.
    order = sorted(range(len(found)), key=lambda number: measured[number].shortfall)[:wanted]
    if len(order) < recipe.pick:
        raise InputError(
            f"pick: expected 1 to {len(order)}, as so many dice were found, got {recipe.pick}; "
            "take one of these"
        )
    work.candidates = tuple(measured[number] for number in order)
    dice = (found[number] for number in order)
    work.candidate_designs = tuple((die.target, die.design) for die in dice)
    chosen = pick_candidate(work, recipe.pick, len(found))
    work.callbacks.on_shape(chosen.hull, chosen.directions)
    work.callbacks.on_step(chosen.steps[-1])
    return chosen


def pick_candidate(work: Work, pick: int, compared: int) -> Design:
    """Return number `pick`, from 1, of the work's candidates; set the target to its faces and add a
    note. compared: number of dice compared."""
    facts = work.candidates[pick - 1]
    rank = f", {f'number {pick}' if pick > 1 else 'the best'} of {compared} dice compared"
    lacks = f"; it lacks {', '.join(facts.lacks)}" if facts.lacks else ""
    work.notes.append(f"faces: {facts.name}{rank if compared > 1 else ''}{lacks}")
    work.target, design = work.candidate_designs[pick - 1]
    return design


def _design_dice(work: Work, wanted: int) -> Iterator[_Die]:
    """Yield dice in the order of the rule."""
    recipe, plain = work.recipe, work.target
    equal, left = numbers_of_equal_faces(plain.probabilities), wanted
    if recipe.faces == AUTO:
        for number in equal[: max(MAX_NEAR, wanted // 2)]:
            left -= 1
            yield _of_equal_faces(plain, number)
        least = max(len(plain.labels), 6)
        near = [number for number in NUMBERS if number >= least and number not in equal]
    else:
        assert isinstance(recipe.faces, int)
        if recipe.faces in equal:
            yield _of_equal_faces(plain, recipe.faces)
        near = [recipe.faces]
    is_found = left < wanted
    table = recipe.method.options.table_with_hand
    thrown = None if recipe.purpose == "setting-down" else ThrowProbabilities.on(table)
    shares = [share_faces(plain.probabilities, number) for number in near]
    shares.sort(key=lambda one: (max(one.cost, EVEN_SHARES), len(one.outcome)))
    # One of the dice has one face an outcome.
    for one in shares[: max(MAX_NEAR, left - 1)]:
        die = _of_near_faces(work, one, thrown)
        if die is not None:
            is_found = True
            yield die
    # When thrown it is worse than others, but a rare outcome has more room there.
    is_needed = wanted > 1 or not is_found or plain.probabilities.min() < RARE
    if recipe.faces == AUTO and is_needed:
        notes = len(work.notes)
        try:
            design, name = design_handsome(work), "one face an outcome"
        except NoStartError:
            if is_found:
                return
            raise
        # They would speak of a die that may not be made.
        del work.notes[notes:]
        if design.symmetry is not None:
            name += f", symmetry {design.symmetry}"
        yield _Die(name, plain, design)


def _of_equal_faces(plain: Target, faces: int) -> _Die:
    """Die of equal faces, which each outcome has a whole number of."""
    body = equal_faces_body(faces)
    assert body is not None
    counts = np.round(plain.probabilities * faces).astype(np.int64)
    outcome = np.repeat(np.arange(len(counts)), counts)
    target = _target(plain, outcome, np.full(faces, 1.0 / faces), keeps_shares=True)
    hull = convex_hull(polyhedron_corners(body.normals, np.ones(faces)))
    design = _design(target, hull, body.normals, Step(0, 0.0, 0.0, 0.0), 1, body.group)
    return _Die(f"{body.name} of {faces} equal faces", target, design, is_equal=True)


def _of_near_faces(
    work: Work, shares: FaceShares, thrown: ThrowProbabilities | None
) -> _Die | None:
    """Die of nearly equal faces; None if no starting shape leads to one."""
    recipe, plain, started = work.recipe, work.target, time.perf_counter()
    best: OutcomeSumsDie | None = None
    wanted, outcome = plain.probabilities, shares.outcome
    even = even_codes().get(len(outcome)) if shares.cost < ODD_SHARES else None
    for number in range(CODES):
        code, own = even, outcome
        if code is None:
            code = weighted_code(shares.shares, CODES * recipe.seed + number)
        else:
            own = arrange_outcomes(wanted, shares, code, thrown)
        die = solve_outcome_sums(wanted, own, code, thrown, recipe.purpose != "throwing")
        even = None
        if die is None or die.error > SOLVED:
            continue
        if best is None or die.strain < best.strain:
            best, outcome_of, bias = die, own, code.bias
        if best.strain < MAX_STRAIN:
            break
    if best is None:
        return None
    order = np.argsort(outcome_of, kind="stable")
    faces = np.bincount(outcome_of)
    target = _target(plain, outcome_of[order], (wanted / faces)[outcome_of[order]])
    step = Step(0, time.perf_counter() - started, best.strain, best.error)
    design = _design(target, best.hull, best.normals[order], step, best.evaluations)
    if bias.any():
        design = replace(design, throw_bias=bias[order])
    return _Die(f"{len(order)} nearly equal faces", target, design)


def _target(plain: Target, outcome: Integers, shares: Floats, keeps_shares: bool = False) -> Target:
    """Target with faces (f,) of the outcomes, in their order."""
    return Target(tuple(plain.labels[k] for k in outcome.tolist()), shares, keeps_shares)


def _design(
    target: Target,
    hull: ConvexHull,
    directions: Floats,
    step: Step,
    evaluations: int,
    symmetry: str | None = None,
) -> Design:
    assert step.max_abs_error is not None
    return Design(
        status=Status.CONVERGED,
        hull=hull,
        directions=directions,
        error=step.max_abs_error,
        steps=(step,),
        starts=1,
        evaluations=evaluations,
        hulls=HullCounts(evaluations, 0),
        outcome_of=target.outcome_of_face,
        symmetry=symmetry,
    )


def _measure(work: Work, die: _Die, full: bool) -> Candidate:
    """What distinguishes a die from others. full: also its weight, at the size that its labels
    need."""
    recipe, design = work.recipe, die.design
    solid = make_solid(design, recipe.size_mm)
    hull, facets = solid.poses.hull, solid.poses.facets[solid.outcomes.main]
    forecast = forecast_throws(work, solid, design, die.target)
    thrown = (0.0, 0.0) if forecast is None else (forecast.total_variation, forecast.nine_in_ten)
    looks = rate_looks(hull, hull.normals[facets], design.outcome_of)
    read = "auto" if recipe.engrave is None else recipe.engrave.read
    try:
        is_down = die_readings(hull, facets, die.target.face_labels, read)[0].way == "down"
    except EngravingError:
        is_down = True
    # Each is 1 at the limit.
    flaws = {
        "labels on top": 2.0 * (is_down and read != "down"),
        "room for labels": MIN_LABEL / looks.circle,
        "a compact shape": MIN_COMPACT / looks.quotient,
    }
    if recipe.purpose != "setting-down":
        flaws["a small error when thrown"] = thrown[0] / MAX_THROWN_OFF
        flaws["a small error in nine of ten hands"] = thrown[1] / MAX_HANDS
    lacks = {} if die.is_equal else {name: flaw for name, flaw in flaws.items() if flaw > 1.0}
    size_mm, weight = recipe.size_mm, None
    if full:
        probe = work.copy()
        probe.die, probe.target = design, die.target
        if work.enlarge and recipe.engrave is not None:
            enlarge(probe)
            size_mm = probe.recipe.size_mm
        if recipe.print is not None:
            volume = hull.surface.volume * (size_mm / hull.diameter) ** 3
            weight = volume * recipe.print.density / 1000.0
    return Candidate(
        name=die.name,
        faces=len(facets),
        thrown=thrown[0],
        nine_in_ten=thrown[1],
        looks=looks.measure,
        quotient=looks.quotient,
        is_read_on_top=not is_down,
        label_mm=looks.circle * size_mm,
        size_mm=size_mm,
        weight_g=weight,
        prints=looks.print_variation,
        lacks=tuple(lacks),
        shortfall=sum(flaw - 1.0 for flaw in lacks.values()),
    )
