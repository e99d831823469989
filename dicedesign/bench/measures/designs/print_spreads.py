"""Spread of the odds of a die's prints, predicted and print by print."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Final

import numpy as np

from dicedesign.bench.measures.recipes import Work
from dicedesign.fabricate.print_options import PrintErrors
from dicedesign.fabricate.print_tolerances import (
    ROLLS,
    OddsSlopes,
    OddsSpread,
    OffPrints,
    allowed_offset,
    print_tolerances,
)
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.goodness_of_fit import LEVEL, chance_noticed, chi_square
from tests.reference.perturbed_dice import PrintedDie, only

__all__ = ["answer", "by_error", "of_facets"]

FACETS: Final = "dimensional_mm"
"""The error of the places of facets."""

ROUNDS: Final = 20
"""Tests of each print."""


def by_error(work: Work, prints: int, seed: int) -> Iterator[tuple[str, float, float, int]]:
    """For each error alone, and for all together, of a checked die: its name, the root mean square
    deviation of the odds as predicted and of so many prints, and how many prints were no dice."""
    errors = PrintErrors()
    spread = _spread(work, errors)
    for name in asdict(errors):
        predicted = spread.by_error[name]
        yield name, *_compared(predicted, _printed(work, only(errors, name), prints, seed))
    yield "all", *_compared(spread.covariance, _printed(work, errors, prints, seed))


def answer(work: Work, prints: int, seed: int) -> tuple[float, float, float]:
    """How well a die must be printed in mm, the part of such prints that the test notices by the
    prediction, and the part that it notices when such prints are rolled."""
    target, spread = work.target.probabilities, _spread(work, PrintErrors())
    still = np.zeros(len(target))
    made = OffPrints(work.plain.poses, work.die.directions)
    allowed = print_tolerances(spread, target, still, made).allowed_mm or 0.0
    predicted = chance_noticed(target, ROLLS, allowed**2 * spread.by_unit_offset, still)
    random = np.random.default_rng(seed)
    noticed = []
    for odds in _printed(work, PrintErrors(allowed, 0.0, 0.0, 0.0), prints, seed):
        if np.isfinite(odds).all():
            counts = random.multinomial(ROLLS, odds / odds.sum(), size=ROUNDS)
            noticed += [chi_square(row, target).p_value < LEVEL for row in counts]
    return allowed, predicted, float(np.mean(noticed))


def of_facets(work: Work, prints: int, seed: int) -> tuple[float, float, float, float]:
    """Deviation of the odds by the places of facets, predicted and of prints, what is allowed in
    mm, and the radius of the smallest circle in the facet of an outcome in mm."""
    errors = only(PrintErrors(), FACETS)
    spread, target = _spread(work, errors), work.target.probabilities
    predicted, printed, _ = _compared(spread.covariance, _printed(work, errors, prints, seed))
    allowed = allowed_offset(spread, target, np.zeros(len(target))) or 0.0
    return predicted, printed, allowed, min(facet.inradius_mm for facet in work.plain.facets)


def _spread(work: Work, errors: PrintErrors) -> OddsSpread:
    slopes = OddsSlopes.of(work.plain.body, work.plain.poses, work.plain.outcomes)
    return OddsSpread(slopes, errors)


def _printed(work: Work, errors: PrintErrors, prints: int, seed: int) -> Floats:
    return PrintedDie(work.solid.poses.hull, work.die.directions).odds(errors, prints, seed)


def _compared(covariance: Floats, printed: Floats) -> tuple[float, float, int]:
    """Root mean square deviations, predicted and of prints, and prints that were lost."""
    good = np.isfinite(printed).all(axis=1)
    predicted = float(np.sqrt(np.diag(covariance).mean()))
    return predicted, float(np.sqrt(printed[good].var(axis=0).mean())), int((~good).sum())
