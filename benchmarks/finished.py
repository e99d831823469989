"""dice with labels and edges, before and after correction, and printing errors

Finish the dice of recipes in several ways: labels cut in or raised, edges rounded or chamfered,
balanced by shape, by a hidden ball or by filled labels. Each row has the largest |p - q| of the
plain shape finished as it is, of the balanced one, and of its file read back; of thrown dice the
first two are by the momentum model. Dice are 1.5 times as large as their recipes say, so that their
labels fit. Then predict the standard deviations of the probabilities of prints from the 64 copies
of a run, and compare them with prints that are made one by one: facets moved, axes stretched,
density graded, a bubble put in; roll prints that are as bad as is allowed; and make dice better by
the preference `tolerance`. Exits 1 where a file is off by more than 1e-6, a thrown die by 1e-3, or
a prediction by more than 5 % and chance.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.frame import Report, Work, add_recipes, make_die, read_recipes
from dicedesign import EngravingError, Recipe, parse_recipe
from dicedesign.fabricate.print_copies import (
    NOTICED,
    ROLLS,
    PrintedCopies,
    print_tolerances,
)
from dicedesign.fabricate.printers import FDM, PrintErrors
from dicedesign.recipe.pipeline import run_stages
from dicedesign.results.result import PrintTolerances
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.goodness_of_fit import LEVEL, chi_square
from tests.reference.perturbed_dice import PrintedDie, only

WAYS = {
    "engraved": {},
    "engraved, fillet of 1 mm": {"edges": {"radius_mm": 1.0}},
    "engraved, chamfer of 2 mm": {"edges": {"radius_mm": 2.0, "shape": "chamfer"}},
    "raised": {"engrave": {"style": "raised"}},
    "engraved, opposite ball": {"engrave": {"balance": "opposite"}},
    "engraved, labels filled": {"engrave": {"balance": "fill"}},
}
"""How dice are finished: entries of their recipes by name."""

IN_FILE, BY_MODEL = 1e-6, 1e-3
"""Largest |p - q| of a finished die's file, and of a thrown die by the momentum model."""

LARGER = 1.5

DICE = {
    "2d6, eleven facets": {
        "target": {"sum_of_dice": [6, 6]},
        "start": {"hendecahedron": "bisymmetric"},
        "assignment": ["2", "3", "4", "5", "6", "7", "8", "10", "9", "11", "12"],
        "symmetry": "C2",
    },
    "binomial of 4": {"target": {"binomial": 4}},
    "fair d7": {"target": {"fair": 7}},
    "loaded d6": {"target": {"probabilities": ["1/3", *["2/15"] * 5]}},
    "2d4": {"target": {"sum_of_dice": [4, 4]}},
}
"""Dice that are printed: recipes' entries by name."""

LEGIBLE = {"circles": 1.0, "margin": 0.1, "asymmetry": 0.1, "roundness": 0.2}

PREFERENCES = {
    "nothing": {"circles": 0.0},
    "legible": LEGIBLE,
    "legible, tolerance: 1": {**LEGIBLE, "tolerance": 1.0},
    "tolerance": {"tolerance": 1.0},
}
"""What dice are made better by, by name."""

SLACK, SIGMAS = 0.05, 4.0
"""Relative error of a predicted deviation that counts as right, beside so many standard errors of
sampling."""

TESTS = 20
"""Of each print, when prints are rolled."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What is finished and printed."""
    add_recipes(parser, "*")
    parser.add_argument(
        "--prints", type=int, metavar="N", help="of each die (default: 2000; quick: 150)"
    )


def run(options: argparse.Namespace, report: Report) -> bool:
    """Finished dice of the recipes and printed ones."""
    row = report.table(
        "finished",
        "recipe 26s | finished 26s | status 10s | as it is 9.1e | balanced 9.1e | "
        "in file 9.1e | rounds 6d | moved mm 8.3f | s 6.2f",
    )
    is_good = True
    by_way: dict[str, list[tuple[Any, ...]]] = {}
    for recipe in read_recipes(options):
        larger = recipe.model_copy(update={"size_mm": LARGER * recipe.size_mm})
        plain = make_die(larger)
        for way in list(WAYS)[: 2 if options.quick else None]:
            if recipe.method.concave is None or not WAYS[way]:
                cells = finish(plain, larger, way)
                row(recipe.name, way, *cells)
                error = cells[2] if recipe.method.is_thrown else cells[3]
                most = BY_MODEL if recipe.method.is_thrown else IN_FILE
                is_good &= error is None or (cells[0] == "converged" and error <= most)
                if error is not None and recipe.method.concave is None and most == IN_FILE:
                    by_way.setdefault(way, []).append(cells)
    row = report.table(
        "ways",
        "finished 26s | dice 5d | as it is, median 9.1e | worst 9.1e | balanced 9.1e | "
        "in file 9.1e | rounds 8s | moved mm 16s | s 12s",
    )
    for way, found in by_way.items():
        _, uncorrected, balanced, in_file, *spans = zip(*found, strict=True)
        rounds, moved, seconds = map(sorted, spans)
        row(
            *(
                way,
                len(found),
                float(np.median(uncorrected)),
                max(uncorrected),
                max(balanced),
                max(in_file),
            ),
            f"{rounds[0]} to {rounds[-1]}",
            f"{moved[0]:.3f} to {moved[-1]:.3f}",
            f"{seconds[0]:.2f} to {seconds[-1]:.2f}",
        )
    prints = options.prints or (150 if options.quick else 2000)
    dice = dict(list(DICE.items())[: 2 if options.quick else None])
    return compare_prints(dice, prints, report) and is_good


def finish(plain: Work, recipe: Recipe, way: str) -> tuple[Any, ...]:
    """Status, errors, rounds, way moved and seconds of a checked die that is finished in a way."""
    entries, changes = recipe.as_dict(), WAYS[way]
    engrave = {**(entries["engrave"] or {}), **changes.get("engrave", {})}
    work = plain.copy()
    work.recipe = parse_recipe({**entries, **changes, "engrave": engrave})
    start = time.perf_counter()
    try:
        run_stages(work, after="check", last="engrave")
    except EngravingError:
        return ("no room", None, None, None, None, None, time.perf_counter() - start)
    seconds = time.perf_counter() - start
    result = work.result()
    engraved = result.engraved
    if engraved is None or engraved.balance is None:
        return ("no room", None, None, None, None, None, seconds)
    errors, moved = engraved.balance.errors, engraved.balance.moved_mm
    in_file = engraved.max_abs_error
    return (result.status, errors[0], min(errors), in_file, len(errors) - 1, moved, seconds)


def compare_prints(dice: dict[str, dict[str, Any]], prints: int, report: Report) -> bool:
    """Three tables: each error alone and together; what may be allowed; preferences."""
    row = report.table(
        "prints", "die 20s | error 18s | predicted 9.4% | printed 9.4% | ratio 6.3f | lost 5d"
    )
    works = {name: make_print(entries, {}) for name, entries in dice.items()}
    is_good = True
    for name, work in works.items():
        known = tolerances_of(work, PrintErrors())
        for error, predicted in ({**known.by_error, "all": known.deviations}).items():
            errors = PrintErrors() if error == "all" else only(PrintErrors(), error)
            printed, lost = deviations(print_one_by_one(work, errors, prints))
            size = root_mean_square(predicted)
            row(name, error, size, printed, printed / size, lost)
            chance = SIGMAS / (2.0 * prints) ** 0.5
            is_good &= abs(printed / size - 1.0) <= SLACK + chance
    row = report.table("allowed", "die 20s | allowed mm 8.3f | noticed 8.1% | of prints 8.1%")
    for name, work in works.items():
        row(name, *roll_allowed(work, prints))
    row = report.table(
        "preferences",
        "die 20s | made better by 22s | predicted 9.4% | printed 9.4% | allowed mm 8.3f | "
        "circle mm 8.2f",
    )
    errors = only(PrintErrors(), "dimensional_mm")
    for name, entries in dice.items():
        for prefer, weights in PREFERENCES.items():
            work = make_print(entries, weights)
            known = tolerances_of(work, errors)
            printed, _ = deviations(print_one_by_one(work, errors, prints))
            circle = min(facet.inradius_mm for facet in work.result().facets)
            predicted = root_mean_square(known.deviations)
            row(name, prefer, predicted, printed, known.allowed_mm, circle)
    return is_good


def make_print(entries: dict[str, Any], prefer: dict[str, float]) -> Work:
    """A die without labels, better by preferences."""
    method = {"exact": {"prefer": prefer} if prefer else {}}
    given = {"name": "die", "engrave": False, "symmetry": "none", "method": method}
    return make_die(parse_recipe({**given, **entries}))


def tolerances_of(work: Work, errors: PrintErrors) -> PrintTolerances:
    """Prediction of what errors do to the probabilities, as of a die that lies like its file."""
    plain, die, target = work.plain, work.die, work.target.probabilities
    copies = PrintedCopies.of(
        plain.body,
        plain.poses,
        die.directions,
        np.eye(3),
        errors.correlation_mm,
        is_flat=True,
        outcome_of=die.outcome_of,
    )
    return print_tolerances(copies, target, target, errors, FDM)


def print_one_by_one(work: Work, errors: PrintErrors, prints: int) -> Floats:
    """(prints, k) probabilities, NaN where a print has become no die."""
    return PrintedDie(work.solid.poses.hull, work.die.directions).probabilities(errors, prints, 0)


def deviations(printed: Floats) -> tuple[float, int]:
    """Root mean square deviation of prints, and prints that were lost."""
    good = np.isfinite(printed).all(axis=1)
    return root_mean_square(printed[good].std(axis=0)), int((~good).sum())


def root_mean_square(values: ArrayLike) -> float:
    """Of deviations (k,)."""
    return float(np.sqrt(np.square(values).mean()))


def roll_allowed(work: Work, prints: int) -> tuple[float, float, float]:
    """How well a die must be printed in mm, and the part of such prints that Pearson's test notices
    in 1,000 rolls: as predicted, and when they are rolled."""
    target = work.target.probabilities
    allowed = tolerances_of(work, PrintErrors()).allowed_mm or 0.0
    random = np.random.default_rng(0)
    noticed = []
    for probabilities in print_one_by_one(work, PrintErrors(allowed, 0.0, 0.0, 0.0), prints):
        if np.isfinite(probabilities).all():
            counts = random.multinomial(ROLLS, probabilities / probabilities.sum(), size=TESTS)
            noticed += [chi_square(row, target).p_value < LEVEL for row in counts]
    return allowed, NOTICED, float(np.mean(noticed))
