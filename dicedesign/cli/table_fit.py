"""`dicedesign table fit`: a table's throw parameters from counts of real dice."""

from __future__ import annotations

import os
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import asdict, replace
from importlib.metadata import version
from itertools import repeat
from pathlib import Path
from typing import Any, Final

import numpy as np

from dicedesign.cli.commands import TableArguments
from dicedesign.cli.options import (
    columns_of,
    print_json,
    print_notes,
    require_ending,
    text_table,
    workers_of,
)
from dicedesign.errors import InputError, printable
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.runtime.files import json_text, make_writable_folder, write_files
from dicedesign.throws.distances import jeffreys_means, measure_variation
from dicedesign.throws.engines import CONTACT_LAW, require_engine
from dicedesign.throws.goodness_of_fit import Prediction
from dicedesign.throws.sessions import MODEL
from dicedesign.throws.simulation import simulate
from dicedesign.throws.table_fit import (
    CREDIBLE_LEVEL,
    DieCheck,
    DieFit,
    TableFit,
    check_die,
    check_effort,
    fit_table,
)
from dicedesign.throws.tables import Table, mixture_entries
from dicedesign.throws.throw_counts import (
    CountedDie,
    read_die_without_counts,
    read_rolled_die,
    read_throw_counts,
    throws_digest,
)

CHECKED: Final = 1 / 12
"""New drops of each die at the fitted table, as a part of the drops of all evaluations."""

UNITS: Final = {"height": "a", "speed": "sqrt(g a)", "spin": "sqrt(g / a)"}
"""Units of the parameters that have one, for dice of the size a."""

LEVEL: Final = 0.05
"""p-value up to which the counts of a die are inconsistent with a table."""

IMPOSSIBLE: Final = 0.001
"""p-value under the posterior of all counts up to which no table explains the counts of a die."""

VAGUE: Final = 0.8
"""Part of the prior's standard deviation from which on a posterior's is uninformative."""

MOST_BYTES: Final = 200
"""Length of the name of a session's file."""

CONFIDENCE: Final = 0.95
"""Confidence of intervals of total variation."""


def fit(options: TableArguments) -> int:
    """Print the fitted table, and write it."""
    require_engine("native")
    check_effort(options.evaluations, options.drops, options.seed)
    out = options.out
    if out is not None:
        require_ending("--out", out, ".json")
    dice, others = _read_dice(options)
    counted = (*dice, *others)
    designed = None if options.die is None else read_die_without_counts(options.die)
    if designed is not None:
        others = (*others, replace(designed[0], material=dice[0].material))
    checkpoint_file, name, session_files = None, "fitted", {}
    if out is not None:
        session_files = _name_files(out, [die.session for die in dice if die.session is not None])
        # A folder that cannot be written fails before the simulations.
        make_writable_folder(out.parent)
        checkpoint_file, name = out.with_suffix(".checkpoint.npz"), printable(out.stem)
    source = "fitted to " + ", ".join(f"{die.counts.sum()} throws of {die.name}" for die in dice)
    start = Table(name, 0.0, 0.0, 0.0, 0.0, 0.0, source=source)
    new_drops = max(1, round(CHECKED * options.evaluations * options.drops))
    total = (options.evaluations * options.drops + new_drops) * (len(dice) + len(others))
    work = {
        "set of throws": throws_digest(dice),
        "set of other dice": throws_digest(others),
        "number of evaluations": str(options.evaluations),
        "number of drops": str(options.drops),
        "seed": str(options.seed),
        "contact law": CONTACT_LAW,
        "model": MODEL,
        "version of dicedesign": version("dicedesign"),
    }
    with (
        Checkpoint(checkpoint_file, work) as checkpoint,
        workers_of(options, "drops", total) as workers,
    ):
        if checkpoint_file is not None and os.path.exists(checkpoint_file):
            print_notes(f"resumes from {checkpoint_file}")
        share: dict[str, Any] = {"workers": workers.executor, "progress": workers.bar.update}
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
        # No evaluation has this seed.
        checks = [
            check_die(die, fit.tables[die.material], new_drops, options.seed, **share)
            for die in counted
        ]
        answer = _plain(fit, checks)
        table = fit.tables[dice[0].material]
        if designed is not None:
            die, target = designed
            throws = simulate(die.body, table, new_drops, options.seed, **share)
            answer["die_at_hand"] = _predict(fit.dice[-1], die.by_outcome(throws.counts), target)
        if out is not None:
            files = {out: _table_file(table, fit.posterior)}
            materials = {out: dice[0].material}
            for one in fit.sessions:
                if one.is_named and len(fit.sessions) > 1:
                    file = session_files[one.name]
                    files[file] = _table_file(one.table, one.tables)
                    materials[file] = one.material
            write_files(files)
            for file, material in materials.items():
                on = f", with the materials {material}" if len(fit.tables) > 1 else ""
                print_notes(f"wrote {file}{on}")
    if options.json:
        print_json(answer)
    else:
        print(_describe(answer))
    return 1 if answer["unexplained"] else 0


def _name_files(out: Path, sessions: Sequence[str]) -> dict[str, Path]:
    """File of each named session, beside that of the fit. Raises InputError unless names make
    different ones."""
    files = {
        name: out.with_stem(
            "_".join([out.stem, re.sub(r"[^\w.]+", "-", unicodedata.normalize("NFC", name))])
        )
        for name in dict.fromkeys(sessions)
    }
    names = [os.fsencode(file.name.casefold()) for file in files.values()]
    if len(set(names)) < len(names) or any(len(name) > MOST_BYTES for name in names):
        raise InputError(
            f"session: expected short names that differ in letters or digits, got "
            f"{', '.join(map(repr, files))}; rename some"
        )
    return files


def _table_file(table: Table, mixture: Sequence[Table]) -> bytes:
    return json_text(table.as_dict() | {"mixture": mixture_entries(mixture)}).encode()


def _read_dice(
    options: TableArguments,
) -> tuple[tuple[CountedDie, ...], tuple[CountedDie, ...]]:
    """Read the dice that are fitted to, and those that are predicted."""
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


def _plain(fit: TableFit, checks: Sequence[DieCheck]) -> dict[str, Any]:
    """The fit as plain data; checks: of the dice with counts, in the order of the fit."""
    tables = {material: table.as_dict() for material, table in fit.tables.items()}
    return {
        "table": next(iter(tables.values())),
        "tables": tables,
        "posterior": [table.as_dict() for table in fit.posterior],
        "parameters": {name: asdict(entry) for name, entry in fit.parameters.items()},
        "correlations": fit.correlations.tolist(),
        "sessions": [
            {
                "session": session.name,
                "size": session.size,
                "quantiles": session.quantiles.tolist(),
                "typical": session.typical.tolist(),
            }
            for session in fit.sessions
        ],
        "evaluations": fit.evaluations,
        "drops": fit.drops,
        "log_likelihood": fit.log_likelihood,
        "effective_points": fit.effective_points,
        "unexplained": [
            die.die.name for die in fit.dice if die.whole and die.whole.p_value <= IMPOSSIBLE
        ],
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


def _predict(die: DieFit, simulated: Integers, target: Floats) -> dict[str, Any]:
    """Prediction of a die that was not thrown yet, as plain data.

    simulated: (g,) counts of new drops on the fitted table; target: (g,) probabilities of its
    design.
    """
    variation = measure_variation(simulated, target, CONFIDENCE)
    each = np.abs(die.drawn - target).sum(axis=1) / 2.0
    half, most = np.quantile(each, [0.5, CREDIBLE_LEVEL]).tolist()
    return {
        "die": die.die.name,
        "outcomes": die.die.labels,
        "target": target.tolist(),
        "simulated": simulated.tolist(),
        "total_variation": variation.value,
        "interval": variation.interval,
        "noise_floor": variation.noise_floor,
        "posterior_probabilities": die.probabilities.tolist(),
        "posterior_standard_deviations": die.deviation.tolist(),
        "posterior_total_variation": {"median": half, f"quantile_{CREDIBLE_LEVEL:g}": most},
    }


def _describe(answer: dict[str, Any]) -> str:
    """Text of the answer."""
    parameters, dice = answer["parameters"], answer["dice"]
    entries = [
        {
            **entry,
            "name": name,
            "unit": UNITS.get(name, ""),
            **{key: "{:.3g} to {:.3g}".format(*entry[key]) for key in ("interval", "searched")},
        }
        for name, entry in parameters.items()
    ]
    rows = [
        {
            **die,
            "throws": sum(die["throws"]),
            "all": _p_value(die["by_all_dice"]),
            "others": _p_value(die["by_other_dice"]),
        }
        for die in dice
    ]
    correlations = np.transpose(answer["correlations"]) + 0.0
    parts = [
        text_table(
            *columns_of(
                entries,
                ("parameter", "", "name"),
                ("fitted", ".3g", "fitted"),
                ("", "", "unit"),
                ("mean", ".3g", "mean"),
                ("+-", ".2g", "standard_deviation"),
                (f"{100 * CREDIBLE_LEVEL:g} % within", ">", "interval"),
                ("prior +-", ".2g", "prior_deviation"),
                ("prior within", ">", "searched"),
            )
        ),
        text_table(("correlations", "", parameters), *zip(parameters, repeat(".2f"), correlations)),
        text_table(
            *columns_of(
                rows,
                ("die", "", "die"),
                ("throws", "d", "throws"),
                ("degrees", "d", "degrees"),
                ("chi2 fitted", ".2f", "chi_square"),
                ("p", ".2g", "p_value"),
                ("exact p", ".2g", "exact_p_value"),
                ("all dice", ">", "all"),
                ("other dice", ">", "others"),
                ("chi2 geometric", ".2f", "geometric_chi_square"),
                ("p", ".2g", "geometric_p_value"),
            )
        ),
    ]
    for die in dice:
        throws, others = sum(die["throws"]), die["by_other_dice"]
        expected = zip(others["probabilities"], others["standard_deviations"], strict=True)
        table = text_table(
            ("outcome", "", die["outcomes"]),
            ("throws", "d", die["throws"]),
            ("fitted", ".1f", throws * jeffreys_means(die["simulated"])),
            ("other dice", ">", [f"{throws * p:.1f} +- {throws * off:.1f}" for p, off in expected]),
            ("geometric", ".1f", throws * np.array(die["geometric_probabilities"])),
        )
        parts.append(f"{die['die']}\n{table}")
    if "die_at_hand" in answer:
        parts += _describe_prediction(answer["die_at_hand"])
    return "\n\n".join([*parts, "\n".join(_sentences(answer))])


def _p_value(prediction: dict[str, Any] | None) -> str:
    if prediction is None:
        return "not fitted"
    return "{p_value:.2g} +- {standard_error:.1g}".format(**prediction)


def _describe_prediction(die: dict[str, Any]) -> list[str]:
    probabilities = jeffreys_means(die["simulated"])
    half, most = die["posterior_total_variation"].values()
    low, high = die["interval"]
    table = text_table(
        ("outcome", "", die["outcomes"]),
        ("target", ".4f", die["target"]),
        ("fitted", ".4f", probabilities),
        ("+-", ".4f", np.sqrt(probabilities * (1.0 - probabilities) / sum(die["simulated"]))),
        ("posterior", ".4f", die["posterior_probabilities"]),
        ("+-", ".4f", die["posterior_standard_deviations"]),
    )
    return [
        f"{die['die']}\n{table}\n"
        f"total variation from the target {die['total_variation']:.4f} on the fitted table (95 % "
        f"within {low:.4f} to {high:.4f}; chance alone {die['noise_floor']:.4f}), below {half:.4f} "
        f"on half of the posterior's and below {most:.4f} on {100 * CREDIBLE_LEVEL:g} %",
    ]


def _sentences(answer: dict[str, Any]) -> list[str]:
    dice, parameters = answer["dice"], answer["parameters"]
    drops = sum(dice[0]["simulated"]) + dice[0]["unresolved"]
    rejecting = [
        die["die"] for die in dice if die["by_all_dice"] is not None and die["p_value"] <= LEVEL
    ]
    verdict = ", ".join(rejecting) + " rejects" if rejecting else "no die rejects"
    lines = [
        f"{answer['evaluations']} sets of parameters, {answer['drops']} drops of each die for "
        f"each; log likelihood {answer['log_likelihood']:.2f}, of probabilities equal to all "
        "frequencies 0",
        f"with {drops} new drops {verdict} the fitted set at the level {LEVEL:g}",
    ]
    lines += map(_describe_session, answer["sessions"])
    unexplained = [die for die in dice if die["die"] in answer["unexplained"]]
    for die in dice:
        if die["by_other_dice"]["p_value"] <= LEVEL and die not in unexplained:
            worst = _describe_worst(die, die["by_other_dice"])
            lines.append(f"inconsistent with the counts of the other dice: {worst}")
    vague = [
        name
        for name, entry in parameters.items()
        if entry["standard_deviation"] >= VAGUE * entry["prior_deviation"]
    ]
    if vague:
        lines.append(f"these throws say little about: {', '.join(vague)}")
    lines += [
        f"{die['die']}: {die['unresolved']} new drops came to no rest"
        for die in dice
        if die["unresolved"]
    ]
    for die in unexplained:
        lines.append(
            f"no table within the limits explains {_describe_worst(die, die['by_all_dice'])}; "
            "check these counts, and whether the die is the one of the mesh"
        )
    return lines


def _describe_session(session: dict[str, Any]) -> str:
    """What the counts say of a session, in a sentence."""
    units = ("sizes", UNITS["speed"], UNITS["spin"])
    height, speed, spin = (
        f"{median:.2g} {unit} ({low:.2g} to {high:.2g})"
        for unit, low, median, high in zip(units, *session["quantiles"], strict=True)
    )
    drop, along, turning = session["typical"]
    return (
        f"session {session['session']}: a drop from about {height}, a speed of {speed} and a spin "
        f"of {spin}, {100 * CREDIBLE_LEVEL:g} % within the brackets; a die of the size a = "
        f"{1e3 * session['size']:g} mm falls from {100 * drop:.2g} cm at {along:.2g} m/s "
        f"and {turning:.2g} rad/s"
    )


def _describe_worst(die: dict[str, Any], prediction: dict[str, Any]) -> str:
    """Outcome that is least consistent with a prediction, in words."""
    worst, (low, high) = prediction["worst_outcome"], prediction["interval"]
    count = die["throws"][die["outcomes"].index(worst)]
    return (
        f"{die['die']} (p = {prediction['p_value']:.2g}), above all {worst}: {count} of "
        f"{sum(die['throws'])} throws, where 95 % of predictions are {low} to {high}"
    )
