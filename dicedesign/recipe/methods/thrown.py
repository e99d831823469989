"""`method: exact` with thrown odds: the exact method by a momentum model, corrected by throws."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from typing import Final

import numpy as np

from dicedesign.errors import NoStartError, named
from dicedesign.fabricate.designed_die import DesignedDie
from dicedesign.geometry.meshes.body import make_body
from dicedesign.gradient.table_sensitivity import TableSensitivity
from dicedesign.gradient.thrown_odds import ThrownOdds
from dicedesign.optimize.coordinates.symmetric import orbits_of_directions
from dicedesign.optimize.options import MOST_ROUNDS, ExactOptions
from dicedesign.optimize.preferences.preference import Preferences
from dicedesign.optimize.refinement import Refinement, Round
from dicedesign.optimize.result import DesignResult
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.starts.variations import shapes_like
from dicedesign.recipe.methods.convex import designed_die, normalised_center, wanted_odds
from dicedesign.recipe.methods.exact import exact_options, solver, starts_of
from dicedesign.recipe.planning.work import Work
from dicedesign.results.status import Status
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.engines.engine import require_engine
from dicedesign.throws.momentum.momentum_model import momentum_model
from dicedesign.throws.momentum.other_tables import other_tables
from dicedesign.throws.simulation.die_on_table import DieOnTable, throwing_threads
from dicedesign.throws.tables import Table, table_named

__all__ = ["SEEDS", "check_table", "design"]

SEEDS: Final = 1000
"""Seeds of throws between those of one recipe's seed and the next."""

CLOSE_STARTS: Final = 12
"""Variations of a die that are led to corrected odds, until one gets there: the momentum model has
kinks, at which some get stuck."""


def check_table(options: ExactOptions, size_mm: float) -> None:
    """Raise InputError where a die cannot be thrown as the options say: there is no such table, it
    has no momentum model, the die is too large for it, or the engine is missing.

    size_mm: largest distance between two vertices of the die.
    """
    with named("method.exact.table"):
        table = table_named(options.thrown_onto)
        momentum_model(options.thrown_onto)
    # The radius is at least half of that distance.
    replace(table, size=1e-3 * size_mm)
    if options.refine is not None:
        require_engine(options.refine.engine)


def design(work: Work) -> DesignedDie:
    """The die of a recipe by the momentum model of its table, corrected by rounds of throws where
    the recipe asks for them. Raises InputError as `exact.design`, or as `check_table`."""
    wanted, options = wanted_odds(work.recipe), exact_options(work.recipe)
    thrown = ThrownOdds.on(options.thrown_onto)
    sensitivity = TableSensitivity(thrown, other_tables(table_named(options.thrown_onto)), wanted)
    result = solver(work)(starts_of(work, wanted), wanted, sensitivity=sensitivity)
    rounds: tuple[Round, ...] = ()
    if options.refine is not None and result.status is Status.CONVERGED:
        result, rounds = _Corrections(work, wanted, sensitivity).refined(result)
    return designed_die(work, result, rounds)


class _Corrections:
    """Rounds of throws of a recipe's dice at their printed size, and new designs."""

    def __init__(self, work: Work, wanted: Floats, sensitivity: TableSensitivity) -> None:
        self._work, self._wanted, self._sensitivity = work, wanted, sensitivity
        self._options, self._solve = exact_options(work.recipe), solver(work)
        self._center = normalised_center(work.recipe, work.start)
        # The table itself, and the others.
        self._tables = [table_named(self._options.thrown_onto), *sensitivity.tables]
        self._models = [sensitivity.thrown, *sensitivity.others]

    def refined(self, die: DesignResult) -> tuple[DesignResult, tuple[Round, ...]]:
        """The die that the rounds lead to, and the rounds."""
        refine, group = self._options.refine, self._work.recipe.group()
        assert refine is not None
        orbits = np.arange(len(self._wanted))
        if group is not None:
            orbits = orbits_of_directions(die.directions, group)
        is_robust = self._options.prefer.robustness > 0.0 and self._sensitivity.is_known
        with throwing_threads() as workers:

            def throw(
                tried: DesignResult, drops: int, number: int, other: int
            ) -> tuple[Integers, Floats]:
                table = self._tables[other]
                on_table = self._on_table(tried, table)
                # Each table has a series of its own.
                series = number + MOST_ROUNDS * other
                seed = SEEDS * self._work.recipe.seed + series
                throws = on_table.simulated(drops, seed, refine.engine, workers)
                model = self._models[other].model
                return on_table.counts(throws), on_table.momentum(model and model[0])

            return Refinement(
                self._wanted,
                orbits,
                refine.drops,
                refine.rounds,
                # Symmetry keeps equal odds equal on every table.
                len(self._tables) - 1 if is_robust and len(np.unique(orbits)) > 1 else 0,
                throw,
                self._again,
                self._work.listeners.on_round,
            ).refine(die)

    def _on_table(self, die: DesignResult, table: Table) -> DieOnTable:
        """A die at its printed size, on a table."""
        scale = self._work.recipe.size_mm / die.hull.diameter
        center = None if self._center is None else scale * self._center
        solid = make_body(scale * die.hull.vertices, name="die")
        return DieOnTable.of(solid, center, die.directions, table)

    def _again(self, die: DesignResult, odds: Floats, bias: Floats | None) -> DesignResult | None:
        """A die near one, with other odds (k,) by the model; see `Refinement.design`."""
        recipe = self._work.recipe
        near = shapes_like(Start(die.hull.vertices, die.directions), recipe.seed, recipe.group())
        close = islice(near, CLOSE_STARTS)
        try:
            if bias is None:
                nearest = replace(self._options, prefer=Preferences())
                result = self._solve(close, odds, sensitivity=self._sensitivity, options=nearest)
            else:
                known = replace(self._sensitivity, bias=bias if len(bias) else None)
                result = self._solve(close, odds, sensitivity=known)
        except NoStartError:
            return None
        return result if result.status is Status.CONVERGED else None
