"""What `dicedesign table fit` prints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.text import text_table
from dicedesign.throws.distances import MeasuredDistance, jeffreys_means, measure_variation
from dicedesign.throws.table_fit import BELIEF, MORE, DieCheck, DieFit, Prediction, TableFit

UNITS: Final = {"height": "m", "speed": "m/s", "spin": "rad/s"}
"""Of the parameters that have one."""

LEVEL: Final = 0.05
"""p-value up to which a die rejects a table."""

IMPOSSIBLE: Final = 0.001
"""p-value by the posterior of all counts, its own among them, up to which no table explains a
die's."""

VAGUE: Final = 0.75
"""Part of the search's range from which on an interval says that the counts do not tell."""

SHARED: Final = ("restitution", "friction")
"""Parameters that more throws are to tell."""

CONFIDENCE: Final = 0.95
"""Of intervals of total variation."""


@dataclass(frozen=True)
class DieAtHand:
    """A die that was not thrown yet.

    Attributes
    ----------
    fit: what the posterior says of it.
    simulated: (g,) what came up in fresh drops on the fitted table.
    target: (g,) odds that it was designed for.
    """

    fit: DieFit
    simulated: Integers
    target: Floats

    @property
    def on_fitted(self) -> MeasuredDistance:
        """Total variation from the target on the fitted table."""
        return measure_variation(self.simulated, self.target, CONFIDENCE)

    @property
    def by_posterior(self) -> tuple[float, float]:
        """Total variations below which it is on half of all tables, and on `BELIEF` of them."""
        each = np.abs(self.fit.drawn - self.target).sum(axis=1) / 2.0
        half, most = np.quantile(each, [0.5, BELIEF]).tolist()
        return half, most


def unexplained(fit: TableFit) -> list[DieFit]:
    """The dice whose counts no table explains."""
    return [die for die in fit.dice if die.whole and die.whole.p_value <= IMPOSSIBLE]


def fit_lines(fit: TableFit, checks: Sequence[DieCheck], at_hand: DieAtHand | None) -> list[str]:
    """The answer for people; checks: of the dice with counts, in the order of the fit."""
    counted = list(zip(fit.dice, checks, strict=False))
    lines = [*_parameters(fit), "", *_dice(counted)]
    for die, check in counted:
        lines += ["", die.die.name, *_outcomes(die, check)]
    if at_hand is not None:
        lines += ["", *_at_hand(at_hand)]
    return [*lines, "", *_sentences(fit, checks)]


def _parameters(fit: TableFit) -> list[str]:
    columns = [("parameter", ""), ("fitted", ".3g"), ("", ""), ("mean", ".3g"), ("+-", ".2g")]
    rows = [
        [
            name,
            entry.fitted,
            UNITS.get(name, ""),
            entry.mean,
            entry.standard_deviation,
            *(f"{low:.3g} to {high:.3g}" for low, high in (entry.interval, entry.searched)),
        ]
        for name, entry in fit.parameters.items()
    ]
    correlations = [
        [name, *(row + 0.0)] for name, row in zip(fit.parameters, fit.correlations, strict=True)
    ]
    return [
        *text_table([*columns, (f"{100 * BELIEF:g} % within", ">"), ("searched", ">")], rows),
        "",
        *text_table(
            [("correlations", ""), *((name, ".2f") for name in fit.parameters)], correlations
        ),
    ]


def _dice(counted: Sequence[tuple[DieFit, DieCheck]]) -> list[str]:
    columns = [("die", ""), ("throws", "d"), ("degrees", "d"), ("chi2 fitted", ".2f"), ("p", ".2g")]
    columns += [("exact p", ".2g"), ("all dice", ">"), ("other dice", ">")]
    rows = [
        [
            die.die.name,
            die.die.counts.sum(),
            check.chi_square.degrees,
            check.chi_square.statistic,
            check.chi_square.p_value,
            check.exact.p_value,
            _p_value(die.whole),
            _p_value(die.left_out),
            check.geometric.statistic,
            check.geometric.p_value,
        ]
        for die, check in counted
    ]
    return text_table([*columns, ("chi2 geometric", ".2f"), ("p", ".2g")], rows)


def _p_value(prediction: Prediction | None) -> str:
    if prediction is None:
        return "not fitted"
    return f"{prediction.p_value:.2g} +- {prediction.standard_error:.1g}"


def _outcomes(die: DieFit, check: DieCheck) -> list[str]:
    columns = [("outcome", ""), ("throws", "d"), ("fitted", ".1f"), ("other dice", ">")]
    throws, counted = die.die.counts.sum(), die.die
    assert die.left_out is not None
    expected = zip(throws * die.left_out.odds, throws * die.left_out.deviation, strict=True)
    rows = zip(
        counted.labels,
        counted.counts,
        throws * check.odds,
        [f"{mean:.1f} +- {deviation:.1f}" for mean, deviation in expected],
        throws * counted.geometric,
        strict=True,
    )
    return text_table([*columns, ("geometric", ".1f")], rows)


def _at_hand(die: DieAtHand) -> list[str]:
    columns = [("outcome", ""), ("target", ".4f"), ("fitted", ".4f"), ("+-", ".4f")]
    odds, drops = jeffreys_means(die.simulated), die.simulated.sum()
    chance = np.sqrt(odds * (1.0 - odds) / drops)
    fit = die.fit
    rows = zip(fit.die.labels, die.target, odds, chance, fit.odds, fit.deviation, strict=True)
    found, (half, most) = die.on_fitted, die.by_posterior
    low, high = found.interval
    told = [[count, *row] for count, row in zip(MORE, fit.after, strict=True)]
    return [
        fit.die.name,
        *text_table([*columns, ("posterior", ".4f"), ("+-", ".4f")], rows),
        f"total variation from the target {found.value:.4f} on the fitted table (95 % within "
        f"{low:.4f} to {high:.4f}; chance alone {found.noise_floor:.4f}), below {half:.4f} on half "
        f"of the posterior's and below {most:.4f} on {100 * BELIEF:g} %",
        "",
        "what more throws of it, in one session, would leave open",
        *text_table([("throws", "d"), *((f"+- {name}", ".3f") for name in SHARED)], told),
    ]


def _sentences(fit: TableFit, checks: Sequence[DieCheck]) -> list[str]:
    drops = int(checks[0].simulated.sum()) + checks[0].unresolved
    fitted = [check for die, check in zip(fit.dice, checks, strict=False) if die.whole]
    rejecting = [c.die.name for c in fitted if c.chi_square.p_value <= LEVEL]
    verdict = "no die rejects" if not rejecting else ", ".join(rejecting) + " rejects"
    lines = [
        f"{fit.evaluations} sets of parameters, {fit.drops} drops of each die for each; "
        f"log likelihood {fit.log_likelihood:.2f}, of odds equal to all frequencies 0",
        f"the surrogate's predictions were {fit.surprise:.2f} of its standard deviations off",
        f"with {drops} fresh drops {verdict} the fitted set at the level {LEVEL:g}",
    ]
    for die in fit.dice:
        if (
            die.left_out is not None
            and die.left_out.p_value <= LEVEL
            and die not in unexplained(fit)
        ):
            lines.append(f"the other dice's counts hardly go with {_worst(die, die.left_out)}")
    vague = [
        name
        for name, entry in fit.parameters.items()
        if entry.interval[1] - entry.interval[0] >= VAGUE * (entry.searched[1] - entry.searched[0])
    ]
    if vague:
        lines.append(f"these throws hardly tell: {', '.join(vague)}")
    unresolved = {c.die.name: c.unresolved for c in checks if c.unresolved}
    lines += [f"{name}: {count} fresh drops came to no rest" for name, count in unresolved.items()]
    for die in unexplained(fit):
        assert die.whole is not None
        lines.append(
            f"no table within the limits explains {_worst(die, die.whole)}; see whether that is "
            "written down right, and whether the die is the one of the mesh"
        )
    return lines


def _worst(die: DieFit, prediction: Prediction) -> str:
    """What is least like a prediction, in words."""
    counts, worst, (low, high) = die.die.counts, prediction.worst, prediction.interval
    return (
        f"{die.die.name} (p = {prediction.p_value:.2g}), above all {die.die.labels[worst]}: "
        f"{counts[worst]} of {counts.sum()} throws, where 95 % of predictions are {low} to {high}"
    )


def plain_fit(
    fit: TableFit, checks: Sequence[DieCheck], at_hand: DieAtHand | None
) -> dict[str, Any]:
    """The answer as plain data; checks: of the dice with counts, in the order of the fit."""
    answer: dict[str, Any] = {
        "table": fit.table.as_dict(),
        "posterior": [table.as_dict() for table in fit.posterior],
        "parameters": {name: asdict(entry) for name, entry in fit.parameters.items()},
        "correlations": fit.correlations.tolist(),
        "evaluations": fit.evaluations,
        "drops": fit.drops,
        "log_likelihood": fit.log_likelihood,
        "surprise": fit.surprise,
        "effective_points": fit.effective_points,
        "unexplained": [die.die.name for die in unexplained(fit)],
        "dice": [
            {
                "die": die.die.name,
                "outcomes": die.die.labels,
                "throws": die.die.counts.tolist(),
                "geometric_odds": die.die.geometric.tolist(),
                "simulated": check.simulated.tolist(),
                "unresolved": check.unresolved,
                "degrees": check.chi_square.degrees,
                "chi_square": check.chi_square.statistic,
                "p_value": check.chi_square.p_value,
                "exact_p_value": check.exact.p_value,
                "by_all_dice": _plain_prediction(die, die.whole),
                "by_other_dice": _plain_prediction(die, die.left_out),
                "geometric_chi_square": check.geometric.statistic,
                "geometric_p_value": check.geometric.p_value,
            }
            for die, check in zip(fit.dice, checks, strict=False)
        ],
    }
    if at_hand is not None:
        die, variation, (half, most) = at_hand.fit, at_hand.on_fitted, at_hand.by_posterior
        answer["die_at_hand"] = {
            "die": die.die.name,
            "outcomes": die.die.labels,
            "target": at_hand.target.tolist(),
            "simulated": at_hand.simulated.tolist(),
            "total_variation": variation.value,
            "interval": variation.interval,
            "noise_floor": variation.noise_floor,
            "posterior_odds": die.odds.tolist(),
            "posterior_standard_deviations": die.deviation.tolist(),
            "posterior_total_variation": {"median": half, f"quantile_{BELIEF:g}": most},
            "after_more_throws": {
                str(count): dict(zip(SHARED, row, strict=True))
                for count, row in zip(MORE, die.after.tolist(), strict=True)
            },
        }
    return answer


def _plain_prediction(die: DieFit, prediction: Prediction | None) -> dict[str, Any] | None:
    if prediction is None:
        return None
    return {
        "odds": prediction.odds.tolist(),
        "standard_deviations": prediction.deviation.tolist(),
        "p_value": prediction.p_value,
        "standard_error": prediction.standard_error,
        "worst_outcome": die.die.labels[prediction.worst],
        "interval": prediction.interval,
    }
