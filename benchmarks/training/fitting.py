"""Fits the momentum model to simulated throws; tables it is learned on, and how it is written."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor

from dicedesign.runtime.arrays import Floats, Integers
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
    MomentumModel,
    Network,
    TableRange,
    dimensionless,
    moved,
    scaled,
)
from dicedesign.throws.momentum_odds import landing_odds
from dicedesign.throws.tables import Table
from dicedesign.throws.transition_features import Features, Transitions

WIDEST: Final = TableRange(
    np.array([0.0, 0.02, 1.0, 0.0, 0.0]), np.array([0.95, 10.0, 4e3, 200.0, 50.0])
)
"""What can be thrown at all."""

GENERAL: Final = TableRange(
    np.array([0.0, 0.05, 1.2, 0.0, 0.0]), np.array([0.85, 1.5, 32.0, 6.0, 9.0])
)
"""What the model of all tables is learned on."""

NEAR: Final = 0.3
"""How far the range around a table reaches, in scaled numbers: restitutions 0.12 higher and lower,
frictions and heights half as large again and smaller by a third."""

DIGITS: Final = 6
"""Significant digits of a model in a file."""

TRANSITION_HIDDEN: Final = 64

CARRY_HIDDEN: Final = 32
"""Hidden units of the networks."""

FIRST_TEMPERATURE: Final = 0.17
"""In radii, to begin with; it falls by `FIRST_COOLING` natural logarithms."""

FIRST_COOLING: Final = 2.5

FIRST_RATE: Final = 4.0
"""Transitions over no barrier in all impacts together, to begin with."""

FIRST_CARRY: Final = -3.0
"""Logarithm of the rate of carries, to begin with."""

BATCH: Final = 64
"""Dice, each on one table, that a step goes by."""

STEP: Final = 5e-3
"""Length of the first steps; it falls as a cosine."""

FINE_STEP: Final = 1.5e-3
"""The same from a model that is known."""

MEMORY: Final = (0.9, 0.99)
"""Parts of the means of gradients and of their squares that last from step to step (Adam)."""

WARMING: Final = 50.0
"""Steps in which their length rises at first."""

MOST_GRADIENT: Final = 1.0
"""Length to which a gradient is shortened."""

WEIGHT_DECAY: Final = 1e-5
"""Weight of the squared parameters of the networks in the loss."""

SMALLEST_SHARE: Final = 1e-6
"""Below what any rest has in throws of a training die, if it has some; keeps logarithms finite."""


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


class _Union:
    """Dice as one body whose parts know nothing of each other, in torch."""

    def __init__(self, dice: Sequence[TrainingDie]) -> None:
        rests = np.cumsum([0, *(die.transitions.rests for die in dice)])
        ways = [len(die.transitions.source) for die in dice]
        first_ways = np.cumsum([0, *ways])

        def joined(name: str, offsets: Integers) -> Integers:
            parts = [getattr(die.transitions, name) for die in dice]
            return np.concatenate(
                [part + start for part, start in zip(parts, offsets, strict=False)]
            )

        unused = np.zeros((int(rests[-1]), 0), dtype=np.int64)
        self.transitions = Transitions(
            corners=unused,
            real=unused.astype(bool),
            tail=unused,
            head=unused,
            source=joined("source", rests),
            target=joined("target", rests),
            first=joined("first", first_ways),
            second=joined("second", first_ways),
        )
        columns = {
            field.name: torch.as_tensor(
                np.concatenate([getattr(die.features, field.name) for die in dice])
            )
            for field in fields(Features)
        }
        self.features = Features(**columns)
        self.frequencies = torch.as_tensor(np.concatenate([die.frequencies for die in dice]))
        self.terms = torch.as_tensor(np.stack([die.terms for die in dice]))
        of = np.arange(len(dice))
        self.of_transition = torch.as_tensor(np.repeat(of, ways))
        self.of_carry = torch.as_tensor(np.repeat(of, [len(die.transitions.first) for die in dice]))

    def model(self, general: GeneralModel) -> MomentumModel:
        """The model of each transition's and carry's table."""
        hot, cooling, carry_barrier = (self.terms @ general.numbers)[self.of_transition].T
        transitions, carries = (
            replace(
                network,
                bias=(self.terms @ network.bias)[of],
                shift=(self.terms @ network.shift)[of],
            )
            for network, of in (
                (general.transitions, self.of_transition),
                (general.carries, self.of_carry),
            )
        )
        return MomentumModel(hot, cooling, carry_barrier, transitions, carries, general)

    def divergence(self, general: GeneralModel) -> Tensor:
        """Mean Kullback-Leibler divergence of the model's odds from the frequencies."""
        odds = landing_odds(self.features, self.transitions, self.model(general), torch)
        odds, frequencies = odds.clamp(min=SMALLEST_SHARE), self.frequencies
        logarithm = (frequencies.clamp(min=SMALLEST_SHARE) / odds).log()
        divergence: Tensor = (frequencies * logarithm).sum() / len(self.terms)
        return divergence


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
    parts, weights = _parameters(start)
    flat = torch.cat([part.reshape(-1) for part in parts])
    mean, square = torch.zeros_like(flat), torch.zeros_like(flat)
    batches = -(-len(dice) // BATCH)
    for epoch in range(epochs):
        order = np.random.default_rng([seed, epoch]).permutation(len(dice))
        for number, batch in enumerate(np.array_split(order, batches)):
            union = _Union([dice[place] for place in batch])
            leaf = flat.clone().requires_grad_()
            loss = union.divergence(_with_parameters(start, leaf))
            loss = loss + WEIGHT_DECAY * (leaf[weights] ** 2).sum()
            (gradient,) = torch.autograd.grad(loss, leaf)
            gradient = gradient * min(1.0, MOST_GRADIENT / (float(gradient.norm()) + 1e-12))
            count = epoch * batches + number + 1
            mean = MEMORY[0] * mean + (1.0 - MEMORY[0]) * gradient
            square = MEMORY[1] * square + (1.0 - MEMORY[1]) * gradient**2
            length = step * min(1.0, count / WARMING)
            length *= 0.5 + 0.5 * math.cos(math.pi * (count - 1) / (epochs * batches))
            size = (square / (1.0 - MEMORY[1] ** count)).sqrt() + 1e-8
            flat = flat - length * (mean / (1.0 - MEMORY[0] ** count)) / size
    return _with_parameters(start, flat, Tensor.numpy)


def new_model(dice: Sequence[TrainingDie], tables: TableRange, seed: int) -> GeneralModel:
    """A model that knows nothing yet but the usual size of features, with random hidden layers."""
    generator = np.random.default_rng(seed)
    first_rate = math.log(FIRST_RATE / IMPACTS)
    numbers = np.zeros((TABLE_TERMS, 3))
    numbers[0] = math.log(FIRST_TEMPERATURE), FIRST_COOLING, 0.5
    transitions, carries = (
        np.concatenate([getattr(die.features, name) for die in dice])
        for name in ("transitions", "carries")
    )
    return GeneralModel(
        tables,
        numbers,
        _network(transitions, TRANSITION_HIDDEN, TRANSITION_OUTPUTS, first_rate, generator),
        _network(carries, CARRY_HIDDEN, CARRY_OUTPUTS, FIRST_CARRY, generator),
    )


def _network(
    table: Floats, hidden: int, outputs: int, first: float, generator: np.random.Generator
) -> Network:
    columns = table.shape[1]
    bias, shift = np.zeros((TABLE_TERMS, outputs)), np.zeros((TABLE_TERMS, hidden))
    bias[0, 0] = first
    shift[: 1 + len(TABLE_NUMBERS)] = generator.uniform(-0.5, 0.5, (1 + len(TABLE_NUMBERS), hidden))
    deviation = table.std(axis=0)
    return Network(
        table.mean(axis=0),
        # What few dice all have in common tells nothing.
        np.where(deviation > LEAST_DEVIATION, deviation, 1.0),
        np.zeros((columns, outputs)),
        bias,
        generator.uniform(-1.0, 1.0, (columns, hidden)) / math.sqrt(columns),
        shift,
        generator.uniform(-0.1, 0.1, (hidden, outputs)) / math.sqrt(hidden),
    )


TRAINED: Final = ("linear", "bias", "inward", "shift", "outward")
"""Parts of a network that training changes,"""

PUNISHED: Final = ("linear", "inward", "outward")
"""and those of which it wants small ones."""


def _parameters(model: GeneralModel) -> tuple[list[Tensor], Tensor]:
    """What training changes, in torch, and which of all these numbers it wants small."""
    parts, small = [torch.tensor(model.numbers)], [False]
    for network in (model.transitions, model.carries):
        for name in TRAINED:
            parts.append(torch.tensor(getattr(network, name)))
            small.append(name in PUNISHED)
    wanted = [torch.full((part.numel(),), of) for part, of in zip(parts, small, strict=True)]
    return parts, torch.cat(wanted)


def _with_parameters(
    model: GeneralModel, flat: Tensor, convert: Callable[[Tensor], Any] = torch.as_tensor
) -> GeneralModel:
    """A model with the numbers of `_parameters` in one row."""
    shapes = [part.shape for part in _parameters(model)[0]]
    rows = flat.split([math.prod(shape) for shape in shapes])
    numbers, *parts = (convert(row.reshape(shape)) for row, shape in zip(rows, shapes, strict=True))
    networks = []
    for place, network in enumerate((model.transitions, model.carries)):
        own = parts[place * len(TRAINED) : (place + 1) * len(TRAINED)]
        networks.append(
            replace(
                network,
                mean=convert(torch.as_tensor(network.mean)),
                deviation=convert(torch.as_tensor(network.deviation)),
                **dict(zip(TRAINED, own, strict=True)),
            )
        )
    return GeneralModel(model.range, numbers, *networks)


def near_tables(tables: Sequence[Table]) -> TableRange:
    """The range of some tables and what is near them, within `WIDEST`."""
    inside = [np.clip(dimensionless(table), WIDEST.least, WIDEST.most) for table in tables]
    numbers = scaled(np.array(inside))
    least, most = unscaled(numbers.min(axis=0) - NEAR), unscaled(numbers.max(axis=0) + NEAR)
    return TableRange(np.maximum(least, WIDEST.least), np.minimum(most, WIDEST.most))


def drawn_table(within: TableRange, table: Table, rng: np.random.Generator) -> Table:
    """A table of a range, for dice of the same size as another, all alike where `scaled`."""
    ends = scaled(np.stack([within.least, within.most]))
    return moved(table, unscaled(rng.uniform(ends[0], ends[1])))


def unscaled(numbers: Floats) -> Floats:
    """The inverse of `scaled`."""
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
