"""Spread of the odds of prints: the linear prediction against prints that are made one by one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Amount
from dicedesign.bench.rows import Row, column, percent

if TYPE_CHECKING:
    from dicedesign.bench.measures.recipes import Work

__all__ = ["AnswerRow", "Extent", "PreferenceRow", "SpreadRow"]

DICE: Final[dict[str, dict[str, Any]]] = {
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
"""Recipes' entries by name; those of the short bench first."""

PREFERENCES: Final[dict[str, dict[str, float]]] = {
    "nothing": {"circles": 0.0},
    "legible": {"circles": 1.0, "margin": 0.1, "asymmetry": 0.1, "roundness": 0.2},
    "legible, tolerance: 1": {
        "circles": 1.0,
        "margin": 0.1,
        "asymmetry": 0.1,
        "roundness": 0.2,
        "tolerance": 1.0,
    },
    "tolerance": {"tolerance": 1.0},
}
"""What dice are made better by, by name."""

SLACK: Final = 0.05
"""Relative error of a predicted deviation, beside that of sampling, that counts as right."""

SIGMAS: Final = 4.0
"""Standard errors of sampling that are allowed."""


@dataclass(frozen=True)
class Extent:
    """How much is printed.

    Attributes
    ----------
    dice: of the list, from its beginning. prints: of each, for each error. seed: of the prints.
    """

    dice: int
    prints: int
    seed: int = 0


@dataclass(frozen=True)
class SpreadRow(Row):
    """One error of one die.

    Attributes
    ----------
    predicted, measured: root mean square over the outcomes of the standard deviation of the odds.
    ratio: of the two; lost: prints that have become no die.
    """

    die: str = column("die", -20)
    error: str = column("error", -18)
    predicted: float = column("predicted %", 12, percent(4))
    measured: float = column("printed %", 11, percent(4))
    ratio: float = column("ratio", 7, ".3f")
    lost: int = column("lost", 6)


@dataclass(frozen=True)
class AnswerRow(Row):
    """How well a die must be printed, and what the test said of prints that were as bad."""

    table = "answers"

    die: str = column("die", -20)
    allowed: float = column("allowed mm", 11, ".3f")
    predicted: float = column("noticed %", 11, percent(1))
    noticed: float = column("of prints %", 12, percent(1))


@dataclass(frozen=True)
class PreferenceRow(Row):
    """A die made better by one set of preferences, with facets that are off as usual.

    Attributes
    ----------
    predicted, measured: as of `SpreadRow`; circle: radius of the smallest circle in mm.
    """

    table = "preferences"

    die: str = column("die", -20)
    prefer: str = column("made better by", -24)
    predicted: float = column("predicted %", 12, percent(4))
    measured: float = column("printed %", 11, percent(4))
    allowed: float = column("allowed mm", 11, ".3f")
    circle: float = column("circle mm", 10, ".2f")


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.designs import print_spreads

    extent: Extent = run.extent
    dice = dict(list(DICE.items())[: extent.dice])
    made, is_good = {}, True
    for name, entries in dice.items():
        run.begin(name)
        made[name] = _made(entries, {})
        for error, predicted, printed, lost in print_spreads.by_error(
            made[name], extent.prints, extent.seed
        ):
            run.advance()
            ratio = printed / predicted
            is_good &= abs(ratio - 1.0) <= SLACK + SIGMAS / (2.0 * extent.prints) ** 0.5
            yield SpreadRow(name, error, predicted, printed, ratio, lost)
    for name, work in made.items():
        run.begin(f"test of {name}")
        yield AnswerRow(name, *print_spreads.answer(work, extent.prints, extent.seed))
        run.advance()
    for name, entries in dice.items():
        for prefer, weights in PREFERENCES.items():
            run.begin(f"{name}, {prefer}")
            work = _made(entries, weights)
            found = print_spreads.of_facets(work, extent.prints, extent.seed)
            yield PreferenceRow(name, prefer, *found)
            run.advance()
    return is_good


def _made(entries: dict[str, Any], prefer: dict[str, float]) -> Work:
    """The die, checked."""
    from dicedesign.bench.measures.recipes import begun, checked, designed
    from dicedesign.recipe.schema.reading import checked_recipe

    method = {"exact": {"prefer": prefer} if prefer else {}}
    work = begun(checked_recipe({"name": "die", "engrave": False, "method": method, **entries}))
    designed(work)
    checked(work)
    return work


BENCHES.register(
    Bench(
        name="tolerance",
        line="spread of the odds of prints, predicted and print by print",
        description="Predict the standard deviations of the odds of prints from the derivatives of "
        "the odds, and compare them with those of prints that are made one by one: facets moved, "
        "axes stretched, density graded, a bubble put in. Then say how well each die must be "
        "printed, roll prints that are just as bad, and make dice better by the preference "
        "`tolerance`. Exits 1 where a prediction is off by more than 5 % and chance.",
        rows=_rows,
        full=Extent(dice=len(DICE), prints=2000),
        quick=Extent(dice=2, prints=150),
        amounts=(
            Amount("prints", "N", "prints of each die for each error"),
            Amount("seed", "N", "of the prints", least=0),
        ),
        packages=("numpy", "scipy", "torch"),
    )
)
