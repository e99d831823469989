"""Prints that are made one by one where derivatives promise too much."""

from __future__ import annotations

import numpy as np
import pytest
from common.made_up_die import SIDES, box
from scipy import stats

from dicedesign.fabricate.print_options import PrintErrors
from dicedesign.fabricate.print_tolerances import (
    ROLLS,
    OddsSlopes,
    OddsSpread,
    OffPrints,
    print_tolerances,
)
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import rest_poses
from tests.reference.perturbed_dice import PrintedDie

HOUSE = np.concatenate([box(20.0, 20.0, 20.0), [[0.0, 0.0, 21.0]]])
"""A cube with a roof, on whose sides it only just rests."""


def chance(points: np.ndarray, directions: np.ndarray, offset: float, prints: int) -> float:
    """Part of prints that the test notices, by the noncentral chi-square of each."""
    right = outcome_odds(rest_poses(points), directions).odds
    die = PrintedDie(convex_hull(points), directions)
    odds = die.odds(PrintErrors(offset, 0.0, 0.0, 0.0), prints, 11)
    noncentral = ROLLS * ((odds - right) ** 2 / right).sum(axis=1)
    critical = stats.chi2.isf(0.05, len(right) - 1)
    return float(stats.ncx2.sf(critical, len(right) - 1, noncentral + 1e-12).mean())


@pytest.mark.parametrize("offset", [0.02, 0.3])
def test_as_many_are_noticed_as_by_other_prints(offset: float) -> None:
    points = box(20.0, 22.0, 25.0)
    poses = rest_poses(points)
    odds = outcome_odds(poses, SIDES).odds
    found = OffPrints(poses, SIDES).noticed(offset, odds, np.zeros(6), ROLLS)
    assert found == pytest.approx(chance(points, SIDES, offset, 500), abs=0.06)
    # Prints of a body that does not move are as right as it is.
    still = OffPrints(poses, SIDES).noticed(0.0, odds, np.zeros(6), ROLLS)
    assert still == pytest.approx(0.05, abs=1e-9)


def test_a_die_on_the_verge_of_losing_a_rest_must_be_printed_better_than_slopes_say() -> None:
    poses = rest_poses(HOUSE)
    sides = poses.normals
    outcomes = outcome_odds(poses, sides)
    spread = OddsSpread(OddsSlopes.of(make_body(HOUSE), poses, outcomes), PrintErrors())
    still = np.zeros(len(sides))
    trusting = print_tolerances(spread, outcomes.odds, still)
    careful = print_tolerances(spread, outcomes.odds, still, OffPrints(poses, sides))
    assert trusting.allowed_mm is not None
    assert careful.allowed_mm is not None
    assert chance(HOUSE, sides, trusting.allowed_mm, 200) > 0.2
    assert careful.allowed_mm < 0.8 * trusting.allowed_mm
    assert chance(HOUSE, sides, careful.allowed_mm, 200) < 0.16
    assert careful.deviations == trusting.deviations
