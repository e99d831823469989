"""`dicedesign table fit`: a table's throw parameters from counts of real dice."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from itertools import repeat
from typing import Any, Final

import numpy as np

from dicedesign.cli.commands import TableArguments
from dicedesign.cli.options import (
    check_worker_options,
    print_json,
    print_note,
    text_table,
    workers_of,
)
from dicedesign.errors import InputError, printable
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.runtime.files import atomic_write, json_text, make_writable_folder
from dicedesign.throws.distances import MeasuredDistance, jeffreys_means, measure_variation
from dicedesign.throws.engines import require_engine
from dicedesign.throws.simulation import simulate
from dicedesign.throws.table_fit import (
    CREDIBLE_LEVEL,
    DieCheck,
    DieFit,
    Prediction,
    TableFit,
    check_effort,
    check_table,
    fit_table,
)
from dicedesign.throws.tables import Table, posterior_entries
from dicedesign.throws.throw_counts import (
    CountedDie,
    read_die_without_counts,
    read_rolled_die,
    read_throw_counts,
    throws_digest,
)

CHECKED: Final = 1 / 12
"""Fresh drops of each die at the fitted table, as a part of those of all evaluations."""

UNITS: Final = {"height": "m", "speed": "m/s", "spin": "rad/s"}
"""Of the parameters that have one."""

LEVEL: Final = 0.05
"""p-value up to which a die rejects a table."""

IMPOSSIBLE: Final = 0.001
"""p-value by the posterior of all counts, its own among them, up to which no table explains a
die's."""

VAGUE: Final = 0.75
"""Part of the search's range from which on an interval says that the counts do not tell."""

CONFIDENCE: Final = 0.95
"""Of intervals of total variation."""


@dataclass(frozen=True)
class DieAtHand:
    """A die that was not thrown yet.

    Attributes
    ----------
    fit: what the posterior says of it.
    simulated: (g,) what came up in fresh drops on the fitted table.
    target: (g,) probabilities that it was designed for.
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
        """Total variations below which it is on half of all tables, and on `CREDIBLE_LEVEL` of
        them."""
        each = np.abs(self.fit.drawn - self.target).sum(axis=1) / 2.0
        half, most = np.quantile(each, [0.5, CREDIBLE_LEVEL]).tolist()
        return half, most


def fit(options: TableArguments) -> int:
    """Print the fitted table, and write it."""
    check_worker_options(options)
    require_engine("native")
    check_effort(options.evaluations, options.drops, options.seed)
    out = options.out
    if out is not None and out.suffix != ".json":
        raise InputError(f"--out: expected a path that ends in .json, got {out}; rename it")
    dice, others = _read_dice(options)
    designed = None if options.die is None else read_die_without_counts(options.die)
    counted = (*dice, *others)
    if designed is not None:
        others = (*others, designed[0])
    checkpoint_file, name = None, "fitted"
    if out is not None:
        # Better known before the simulations than after.
        make_writable_folder(out.parent)
        checkpoint_file, name = out.with_suffix(".checkpoint.npz"), printable(out.stem)
    source = "fitted to " + ", ".join(f"{die.counts.sum()} throws of {die.name}" for die in dice)
    start = Table(name, 0.0, 0.0, 0.0, 0.0, 0.0, source=source)
    fresh = max(1, round(CHECKED * options.evaluations * options.drops))
    total = (options.evaluations * options.drops + fresh) * (len(dice) + len(others))
    work = {
        "set of throws": throws_digest(dice),
        "set of other dice": throws_digest(others),
        "number of evaluations": str(options.evaluations),
        "number of drops": str(options.drops),
        "seed": str(options.seed),
        "version of dicedesign": version("dicedesign"),
    }
    with (
        Checkpoint(checkpoint_file, work) as checkpoint,
        workers_of(options, "drops", total) as workers,
    ):
        if checkpoint_file is not None and os.path.exists(checkpoint_file):
            print_note(f"goes on from {printable(checkpoint_file)}")
        share: dict[str, Any] = {"workers": workers.executor, "progress": workers.advance}
        fit = fit_table(
            dice,
            start,
            options.evaluations,
            options.drops,
            options.seed,
            others=others,
            checkpoint=checkpoint,
            **share,
        )
        # A seed that no evaluation had.
        checks = check_table(counted, fit.table, fresh, options.seed, **share)
        at_hand = None
        if designed is not None:
            die, target = designed
            throws = simulate(
                die.body, fit.table.for_size_above(die.size), fresh, options.seed, **share
            )
            at_hand = DieAtHand(fit.dice[-1], die.by_outcome(throws.counts), target)
        if out is not None:
            entries = fit.table.as_dict() | {"posterior": posterior_entries(fit.posterior)}
            atomic_write(out, json_text(entries).encode())
            print_note(f"wrote {printable(out)}")
    if options.json:
        print_json(_plain(fit, checks, at_hand))
    else:
        print(_describe(fit, checks, at_hand))
    return 1 if _unexplained(fit) else 0


def _read_dice(
    options: TableArguments,
) -> tuple[tuple[CountedDie, ...], tuple[CountedDie, ...]]:
    """The dice that are fitted to, and those that are predicted."""
    wanted, checked = (
        None if text is None else [name.strip() for name in text.split(",")]
        for text in (options.dice, options.check)
    )
    dice: tuple[CountedDie, ...] = ()
    others: tuple[CountedDie, ...] = ()
    if options.throws is not None:
        dice = tuple(read_throw_counts(options.throws, wanted))
        if checked:
            others = tuple(read_throw_counts(options.throws, checked))
            if wanted is None:
                dice = tuple(die for die in dice if die.name not in checked)
    elif not options.rolls:
        raise InputError("table fit: expected --throws or --rolls, got neither; add one of them")
    elif wanted is not None or checked:
        raise InputError(
            "--dice, --check: expected a file that has these dice, got none; add --throws"
        )
    dice = (*dice, *(read_rolled_die(folder, rolls) for folder, rolls in options.rolls))
    if not dice or {die.name for die in dice} & set(checked or ()):
        raise InputError(
            "--check: expected dice that are not fitted to, and some that are, got "
            f"{', '.join(checked or ())}; name other dice"
        )
    return dice, others


def _unexplained(fit: TableFit) -> list[DieFit]:
    """The dice whose counts no table explains."""
    return [die for die in fit.dice if die.whole and die.whole.p_value <= IMPOSSIBLE]


def _describe(fit: TableFit, checks: Sequence[DieCheck], at_hand: DieAtHand | None) -> str:
    """The answer for people; checks: of the dice with counts, in the order of the fit."""
    entries, dice = fit.parameters.values(), fit.dice[: len(checks)]
    ranges = [
        [f"{low:.3g} to {high:.3g}" for low, high in limits]
        for limits in ([e.interval for e in entries], [e.searched for e in entries])
    ]
    parts = [
        text_table(
            ("parameter", "", fit.parameters),
            ("fitted", ".3g", [entry.fitted for entry in entries]),
            ("", "", [UNITS.get(name, "") for name in fit.parameters]),
            ("mean", ".3g", [entry.mean for entry in entries]),
            ("+-", ".2g", [entry.standard_deviation for entry in entries]),
            (f"{100 * CREDIBLE_LEVEL:g} % within", ">", ranges[0]),
            ("searched", ">", ranges[1]),
        ),
        text_table(
            ("correlations", "", fit.parameters),
            *zip(fit.parameters, repeat(".2f"), fit.correlations.T + 0.0),
        ),
        text_table(
            ("die", "", [die.die.name for die in dice]),
            ("throws", "d", [die.die.counts.sum() for die in dice]),
            ("degrees", "d", [check.chi_square.degrees for check in checks]),
            ("chi2 fitted", ".2f", [check.chi_square.statistic for check in checks]),
            ("p", ".2g", [check.chi_square.p_value for check in checks]),
            ("exact p", ".2g", [check.exact.p_value for check in checks]),
            ("all dice", ">", [_p_value(die.whole) for die in dice]),
            ("other dice", ">", [_p_value(die.left_out) for die in dice]),
            ("chi2 geometric", ".2f", [check.geometric.statistic for check in checks]),
            ("p", ".2g", [check.geometric.p_value for check in checks]),
        ),
    ]
    for die, check in zip(dice, checks, strict=True):
        counted, others = die.die, die.left_out
        throws = counted.counts.sum()
        assert others is not None
        expected = zip(throws * others.probabilities, throws * others.deviation, strict=True)
        table = text_table(
            ("outcome", "", counted.labels),
            ("throws", "d", counted.counts),
            ("fitted", ".1f", throws * check.probabilities),
            ("other dice", ">", [f"{mean:.1f} +- {off:.1f}" for mean, off in expected]),
            ("geometric", ".1f", throws * counted.geometric),
        )
        parts.append(f"{counted.name}\n{table}")
    if at_hand is not None:
        parts += _describe_at_hand(at_hand)
    return "\n\n".join([*parts, "\n".join(_sentences(fit, checks))])


def _p_value(prediction: Prediction | None) -> str:
    if prediction is None:
        return "not fitted"
    return f"{prediction.p_value:.2g} +- {prediction.standard_error:.1g}"


def _describe_at_hand(die: DieAtHand) -> list[str]:
    fit, probabilities = die.fit, jeffreys_means(die.simulated)
    on_fitted, (half, most) = die.on_fitted, die.by_posterior
    low, high = on_fitted.interval
    table = text_table(
        ("outcome", "", fit.die.labels),
        ("target", ".4f", die.target),
        ("fitted", ".4f", probabilities),
        ("+-", ".4f", np.sqrt(probabilities * (1.0 - probabilities) / die.simulated.sum())),
        ("posterior", ".4f", fit.probabilities),
        ("+-", ".4f", fit.deviation),
    )
    return [
        f"{fit.die.name}\n{table}\n"
        f"total variation from the target {on_fitted.value:.4f} on the fitted table (95 % within "
        f"{low:.4f} to {high:.4f}; chance alone {on_fitted.noise_floor:.4f}), below {half:.4f} on "
        f"half of the posterior's and below {most:.4f} on {100 * CREDIBLE_LEVEL:g} %",
    ]


def _sentences(fit: TableFit, checks: Sequence[DieCheck]) -> list[str]:
    drops = int(checks[0].simulated.sum()) + checks[0].unresolved
    fitted = [check for die, check in zip(fit.dice, checks, strict=False) if die.whole]
    rejecting = [c.die.name for c in fitted if c.chi_square.p_value <= LEVEL]
    verdict = "no die rejects" if not rejecting else ", ".join(rejecting) + " rejects"
    lines = [
        f"{fit.evaluations} sets of parameters, {fit.drops} drops of each die for each; "
        f"log likelihood {fit.log_likelihood:.2f}, of probabilities equal to all frequencies 0",
        f"the surrogate's predictions were {fit.surprise:.2f} of its standard deviations off",
        f"with {drops} fresh drops {verdict} the fitted set at the level {LEVEL:g}",
    ]
    for die in fit.dice:
        if (
            die.left_out is not None
            and die.left_out.p_value <= LEVEL
            and die not in _unexplained(fit)
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
    for die in _unexplained(fit):
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


def _plain(fit: TableFit, checks: Sequence[DieCheck], at_hand: DieAtHand | None) -> dict[str, Any]:
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
        "unexplained": [die.die.name for die in _unexplained(fit)],
        "dice": [
            {
                "die": die.die.name,
                "outcomes": die.die.labels,
                "throws": die.die.counts.tolist(),
                "geometric_probabilities": die.die.geometric.tolist(),
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
            "posterior_probabilities": die.probabilities.tolist(),
            "posterior_standard_deviations": die.deviation.tolist(),
            "posterior_total_variation": {"median": half, f"quantile_{CREDIBLE_LEVEL:g}": most},
        }
    return answer


def _plain_prediction(die: DieFit, prediction: Prediction | None) -> dict[str, Any] | None:
    if prediction is None:
        return None
    return {
        "probabilities": prediction.probabilities.tolist(),
        "standard_deviations": prediction.deviation.tolist(),
        "p_value": prediction.p_value,
        "standard_error": prediction.standard_error,
        "worst_outcome": die.die.labels[prediction.worst],
        "interval": prediction.interval,
    }
