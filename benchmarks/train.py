"""fit a table's momentum model to simulated throws of random dice

Throw random dice onto a table in the package's own simulator, fit the momentum model to all but
every tenth of them, from that of all tables on, and write the table with it. A quarter of the
throws is onto the table, the others onto tables near it or of its mixture, so that the model
knows what changes of the table do. Dice held out are thrown onto the table only, four times as
often, and only show how good the model is. With the defaults it takes some minutes on two cores.
An interrupted run keeps the throws; the same command goes on.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.optim.lr_scheduler import LambdaLR

from benchmarks.frame import Report, processes
from benchmarks.random_dice import (
    DEVIATIONS,
    ThrownRandomDie,
    deviations,
    random_die,
    summary,
    throw_random_die,
)
from dicedesign import InputError, Table, load_table
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.runtime.files import json_text
from dicedesign.throws.engines import CONTACT_LAW
from dicedesign.throws.momentum_model import (
    CARRY_OUTPUTS,
    CENTERS,
    EXTENTS,
    IMPACTS,
    LEAST_DEVIATION,
    RANGES,
    TABLE_NUMBERS,
    TABLE_TERMS,
    TRANSITION_OUTPUTS,
    WEIGHTS,
    GeneralModel,
    MomentumMixture,
    MomentumModel,
    Network,
    TableRange,
    dimensionless,
    general_model,
    general_model_of,
    move_table,
    scale_numbers,
    table_terms,
)
from dicedesign.throws.momentum_probabilities import landing_probabilities
from dicedesign.throws.tables import mixture_tables, table_entries
from dicedesign.throws.transition_features import Features, Transitions, body_features

HELD_OUT = 10
"""One of so many dice is held out, and thrown `HELD_OUT_DROPS` times as often as others on all
tables: fewer would hide the model's own error behind that of sampling."""

HELD_OUT_DROPS = 4

TABLES = 4
"""Tables that a die is thrown onto which is not held out."""

WIDEST = TableRange(np.array([0.0, 0.02, 1.0, 0.0, 0.0]), np.array([0.95, 10.0, 4e3, 200.0, 50.0]))
"""What can be thrown at all."""

GENERAL = TableRange(np.array([0.0, 0.05, 1.2, 0.0, 0.0]), np.array([0.9, 1.5, 32.0, 6.0, 9.0]))
"""What the model of all tables is learned on; covers what the bench `table` searches."""

NEAR = 0.3
"""How far the range around a table reaches, in scaled numbers: restitutions 0.12 higher and lower,
frictions and heights half as large again and smaller by a third."""

DIGITS = 6
"""Significant digits of a model in a file."""

TRANSITION_HIDDEN, CARRY_HIDDEN = 64, 32
"""Hidden units of the networks."""

FIRST_TEMPERATURE, FIRST_COOLING = 0.17, 2.5
"""In radii, to begin with, and by how many natural logarithms it falls."""

FIRST_RATE, FIRST_CARRY = 4.0, -3.0
"""Transitions over no barrier in all impacts together, and the logarithm of the rate of carries, to
begin with."""

BATCH = 64
"""Dice, each on one table, that a step goes by."""

STEP, FINE_STEP = 5e-3, 1.5e-3
"""Length of the first steps from nothing, and from a model that is known; it falls as a cosine."""

WARMING = 50.0
"""Steps in which their length rises at first."""

MOST_GRADIENT = 1.0
"""Length to which a gradient is shortened."""

WEIGHT_DECAY = 1e-5
"""Weight of the squared parameters of the networks in the loss."""

SMALLEST_SHARE = 1e-6
"""Below what any rest has in throws of a training die, if it has some; keeps logarithms finite."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What is learned from how much."""
    parser.add_argument("table", metavar="TABLE", help="name of a table, or a .json file")
    parser.add_argument("--dice", type=int, metavar="N", help="random dice (600; quick: 20)")
    parser.add_argument("--drops", type=int, metavar="N", help="of each die (1000; quick: 100)")
    parser.add_argument("--epochs", type=int, metavar="N", help="of training (20; quick: 2)")
    parser.add_argument("--seed", type=int, default=0, metavar="S")
    parser.add_argument(
        "--all-tables",
        action="store_true",
        help="learn the model of all tables from nothing, a quarter of the throws at random ones; "
        "it alone is written",
    )
    parser.add_argument(
        "--known",
        action="store_true",
        help="with --all-tables: learn from the package's model on, such as after a change of the "
        "simulator",
    )
    parser.add_argument("--to", type=Path, metavar="TABLE.json", help="default: its name, here")


def run(options: argparse.Namespace, report: Report) -> bool:
    """Throw, fit, write, and say how good the model is."""
    table = load_table(options.table)
    if table.drag > 0.0:
        raise InputError(
            f"table {table.name}: expected one without drag, on which dice have momentum, got a "
            f"drag of {table.drag:g}; its probabilities are those of `dicedesign rest`"
        )
    WIDEST.require(table, "take another")
    dice = options.dice or (20 if options.quick else 600)
    drops = options.drops or (100 if options.quick else 1000)
    tables = (table, *mixture_tables(options.table))
    throws = [throws_of(tables, options, number, drops) for number in range(dice)]
    written = options.to or Path(f"{Path(options.table).stem}.json")
    numbers = [(number, options.seed) for number in range(dice)]
    tasks = [partial(throw_counts, *one, onto) for one, onto in zip(numbers, throws, strict=True)]
    settings = repr((options.seed, throws)).encode()
    work = {"contact law": CONTACT_LAW, "throws": hashlib.sha256(settings).hexdigest()}
    with (
        processes(options.jobs) as workers,
        Checkpoint(written.with_suffix(".checkpoint.npz"), work) as checkpoint,
    ):
        counts = checkpoint.results("counts", tasks, workers)
        bodies = list(workers.map(random_die, *zip(*numbers, strict=True)))
        thrown = [
            [
                ThrownRandomDie(body, onto, of_table)
                for (onto, _), of_table in zip(
                    tables_of, count.reshape(len(tables_of), -1), strict=True
                )
            ]
            for body, tables_of, count in zip(bodies, throws, counts, strict=True)
        ]
        fitted = [one for number, one in enumerate(thrown) if not is_held_out(number)]
        plain = plain_model(fit(fitted, tables, options))
        entries = {**table_entries(options.table), **table.as_dict(), "momentum": plain}
        written.write_text(json_text(plain if options.all_tables else entries))
    model = MomentumModel.of(general_model_of(json.loads(json.dumps(plain))), table)
    mixture = MomentumMixture.alone(model)
    row = report.table(
        "deviations",
        f"total variation to simulated throws 35s | {DEVIATIONS}",
    )
    for name, is_out in (("fitted to", False), ("held out", True)):
        chosen = [one[0] for k, one in enumerate(thrown) if is_held_out(k) == is_out]
        row(name, *summary(deviations(chosen, mixture)))
    report.line(f"wrote {written}")
    return True


def throw_counts(number: int, seed: int, throws: Sequence[tuple[Table, int]]) -> Integers:
    """(t k,) counts of each rest of a random die on each of t tables; see `throw_random_die`."""
    return np.concatenate([one.counts for one in throw_random_die(number, seed, throws)])


def is_held_out(number: int) -> bool:
    """Whether a die is only judged by."""
    return number % HELD_OUT == HELD_OUT - 1


def throws_of(
    tables: Sequence[Table], options: argparse.Namespace, number: int, drops: int
) -> list[tuple[Table, int]]:
    """Tables, and how often a die is thrown onto each: the first of those given and others near any
    of them, for a model of all tables the last one of all its range."""
    if is_held_out(number):
        return [(tables[0], drops * HELD_OUT_DROPS)]
    rng = np.random.default_rng([options.seed, number, 1])
    drawn = [tables[0]]
    for place in range(1, TABLES):
        one = tables[rng.integers(len(tables))]
        is_far = options.all_tables and place == TABLES - 1
        drawn.append(draw_table(GENERAL if is_far else near_tables([one]), one, rng))
    return [(table, math.ceil(drops / TABLES)) for table in drawn]


def fit(
    thrown: Sequence[tuple[ThrownRandomDie, ...]],
    tables: Sequence[Table],
    options: argparse.Namespace,
) -> GeneralModel:
    """The model of the dice, in one thread, so that the same numbers give the same model."""
    torch.set_num_threads(1)
    dice = [die for one in thrown for die in training_dice(one)]
    if options.all_tables and options.known:
        start, step = replace(general_model(), range=GENERAL), FINE_STEP
    elif options.all_tables:
        start, step = new_model(dice, GENERAL, options.seed), STEP
    else:
        start, step = replace(general_model(), range=near_tables(tables)), FINE_STEP
    epochs = options.epochs or (2 if options.quick else 20)
    return train(dice, start, epochs=epochs, step=step, seed=options.seed)


@dataclass(frozen=True)
class TrainingDie:
    """A die that was thrown onto a table.

    Attributes
    ----------
    transitions, features: what the model knows of it.
    frequencies: (k,) of its rests in the order of those.
    terms: (`TABLE_TERMS`,) of the table.
    """

    transitions: Transitions
    features: Features
    frequencies: Floats
    terms: Floats


def training_dice(thrown: Sequence[ThrownRandomDie]) -> list[TrainingDie]:
    """One die that was thrown onto some tables, for the momentum model to be fitted to."""
    poses, body = thrown[0].die.poses, thrown[0].die.body
    side = poses.basins[0]
    hull, center = side.equilibria.hull, side.equilibria.center_of_mass
    transitions = Transitions.of(hull, side.paths)
    probabilities = side.areas / (4.0 * math.pi)
    features = body_features(transitions, hull.vertices, center, body.inertia, probabilities, np)
    dice = []
    for one in thrown:
        of_facet = np.zeros(len(hull.normals))
        of_facet[poses.facets] = one.counts / one.counts.sum()
        frequencies = of_facet[side.paths.rests]
        dice.append(TrainingDie(transitions, features, frequencies, table_terms(one.table)))
    return dice


def divergence(dice: Sequence[TrainingDie], general: GeneralModel) -> Tensor:
    """Mean Kullback-Leibler divergence of the model's probabilities from the frequencies, of dice
    as one body whose parts know nothing of each other."""
    rests = [die.transitions.rests for die in dice]
    ways = [len(die.transitions.source) for die in dice]

    def join(name: str, sizes: Sequence[int]) -> Any:
        parts = [getattr(die.transitions, name) for die in dice]
        return np.concatenate(parts) + np.repeat(
            np.cumsum([0, *sizes[:-1]]), [len(part) for part in parts]
        )

    transitions = SimpleNamespace(
        rests=sum(rests),
        source=join("source", rests),
        target=join("target", rests),
        first=join("first", ways),
        second=join("second", ways),
    )
    features = Features(
        **{
            name: torch.as_tensor(np.concatenate([vars(die.features)[name] for die in dice]))
            for name in vars(dice[0].features)
        }
    )
    frequencies = torch.as_tensor(np.concatenate([die.frequencies for die in dice]))
    terms = torch.as_tensor(np.stack([die.terms for die in dice]))
    # Each transition and each carry has the numbers of its table.
    of_transition = np.repeat(np.arange(len(dice)), ways)
    of_carry = np.repeat(np.arange(len(dice)), [len(die.transitions.first) for die in dice])
    networks = [
        replace(network, bias=(terms @ network.bias)[of], shift=(terms @ network.shift)[of])
        for network, of in ((general.transitions, of_transition), (general.carries, of_carry))
    ]
    model = MomentumModel(*(terms @ general.numbers)[of_transition].T, *networks, general)
    probabilities = landing_probabilities(features, transitions, model, torch).clamp(
        min=SMALLEST_SHARE
    )
    logarithm = (frequencies.clamp(min=SMALLEST_SHARE) / probabilities).log()
    return (frequencies * logarithm).sum() / len(dice)


def train(
    dice: Sequence[TrainingDie],
    start: GeneralModel,
    *,
    epochs: int,
    step: float = FINE_STEP,
    seed: int = 0,
) -> GeneralModel:
    """The model that fits dice by its mean Kullback-Leibler divergence, in NumPy.

    start: to go on from. epochs: how often each die is seen; step: length of the first steps; seed:
    of the order of the dice.
    """
    model = _convert_model(start, torch.tensor)
    trained, small = [model.numbers], []
    for network in (model.transitions, model.carries):
        small += [network.linear, network.inward, network.outward]
        trained += [network.bias, network.shift]
    trained += small
    for part in trained:
        part.requires_grad_()
    batches = -(-len(dice) // BATCH)
    adam = torch.optim.Adam(trained, step, betas=(0.9, 0.99))
    lengths = LambdaLR(
        adam,
        lambda count: (
            min(1.0, (count + 1) / WARMING)
            * (0.5 + 0.5 * math.cos(math.pi * count / (epochs * batches)))
        ),
    )
    for epoch in range(epochs):
        order = np.random.default_rng([seed, epoch]).permutation(len(dice))
        for batch in np.array_split(order, batches):
            adam.zero_grad()
            loss = divergence([dice[place] for place in batch], model)
            (loss + WEIGHT_DECAY * sum((part**2).sum() for part in small)).backward()
            torch.nn.utils.clip_grad_norm_(trained, MOST_GRADIENT)
            adam.step()
            lengths.step()
    return _convert_model(model, lambda part: part.detach().numpy())


def _convert_model(model: GeneralModel, convert: Callable[[Any], Any]) -> GeneralModel:
    """A model with other arrays."""
    networks = [
        Network(**{name: convert(part) for name, part in vars(network).items()})
        for network in (model.transitions, model.carries)
    ]
    return GeneralModel(model.range, convert(model.numbers), *networks)


def new_model(dice: Sequence[TrainingDie], tables: TableRange, seed: int) -> GeneralModel:
    """A model that knows nothing yet but the usual size of features, with random hidden layers."""
    rng, networks = np.random.default_rng(seed), []
    numbers = np.zeros((TABLE_TERMS, 3))
    numbers[0] = math.log(FIRST_TEMPERATURE), FIRST_COOLING, 0.5
    linear_terms = 1 + len(TABLE_NUMBERS)
    for name, hidden, outputs, first in (
        ("transitions", TRANSITION_HIDDEN, TRANSITION_OUTPUTS, math.log(FIRST_RATE / IMPACTS)),
        ("carries", CARRY_HIDDEN, CARRY_OUTPUTS, FIRST_CARRY),
    ):
        features = np.concatenate([getattr(die.features, name) for die in dice])
        columns, deviation = features.shape[1], features.std(axis=0)
        bias, shift = np.zeros((TABLE_TERMS, outputs)), np.zeros((TABLE_TERMS, hidden))
        bias[0, 0] = first
        shift[:linear_terms] = rng.uniform(-0.5, 0.5, (linear_terms, hidden))
        networks.append(
            Network(
                mean=features.mean(axis=0),
                # What few dice all have in common tells nothing.
                deviation=np.where(deviation > LEAST_DEVIATION, deviation, 1.0),
                linear=np.zeros((columns, outputs)),
                bias=bias,
                inward=rng.uniform(-1.0, 1.0, (columns, hidden)) / math.sqrt(columns),
                shift=shift,
                outward=rng.uniform(-0.1, 0.1, (hidden, outputs)) / math.sqrt(hidden),
            )
        )
    return GeneralModel(tables, numbers, *networks)


def near_tables(tables: Sequence[Table]) -> TableRange:
    """The range of some tables and what is near them, within `WIDEST`."""
    inside = [np.clip(dimensionless(table), WIDEST.least, WIDEST.most) for table in tables]
    numbers = scale_numbers(np.array(inside))
    least, most = (
        unscale_numbers(numbers.min(axis=0) - NEAR),
        unscale_numbers(numbers.max(axis=0) + NEAR),
    )
    return TableRange(np.maximum(least, WIDEST.least), np.minimum(most, WIDEST.most))


def draw_table(within: TableRange, table: Table, rng: np.random.Generator) -> Table:
    """A table of a range, for dice of the same size as another, all alike where `scale_numbers`."""
    ends = scale_numbers(np.stack([within.least, within.most]))
    return move_table(table, unscale_numbers(rng.uniform(ends[0], ends[1])))


def unscale_numbers(numbers: Floats) -> Floats:
    """The inverse of `scale_numbers`."""
    restitution, friction, height, speed, spin = np.moveaxis(numbers * EXTENTS + CENTERS, -1, 0)
    free = restitution, np.exp(friction), np.exp(height), np.expm1(speed), np.expm1(spin)
    return np.stack(free, axis=-1)


def plain_model(model: GeneralModel) -> dict[str, Any]:
    """A model as plain data for a file, with `DIGITS` digits and every number in its range; the
    inverse of `general_model_of`."""

    def plain(part: Any, name: str) -> Any:
        if isinstance(part, list):
            return [plain(entry, name) for entry in part]
        least, most = RANGES.get(name, WEIGHTS)
        return float(f"{min(max(float(part), least), most):.{DIGITS}g}")

    limits = np.stack([model.range.least, model.range.most], axis=1).tolist()
    return {
        "range": {name: plain(of, name) for name, of in zip(TABLE_NUMBERS, limits, strict=True)},
        "numbers": plain(model.numbers.tolist(), "numbers"),
        **{
            key: {name: plain(array.tolist(), name) for name, array in vars(network).items()}
            for key, network in (("transitions", model.transitions), ("carries", model.carries))
        },
    }
