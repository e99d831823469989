"""Fits the momentum model to simulated throws."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.throws.momentum.momentum_model import (
    CARRY_OUTPUTS,
    IMPACTS,
    LEAST_DEVIATION,
    TRANSITION_OUTPUTS,
    MomentumModel,
    Network,
    Slopes,
)
from dicedesign.throws.momentum.momentum_odds import landing_odds
from dicedesign.throws.momentum.transition_features import Features
from dicedesign.throws.momentum.transitions import Transitions

__all__ = ["TrainingDie", "train"]

TRANSITION_HIDDEN: Final = 24

CARRY_HIDDEN: Final = 12
"""Hidden units of the networks."""

FIRST_TEMPERATURE: Final = 0.17
"""In radii, to begin with; it falls by `FIRST_COOLING` natural logarithms."""

FIRST_COOLING: Final = 2.5

FIRST_RATE: Final = 4.0
"""Transitions over no barrier in all impacts together, to begin with."""

FIRST_CARRY: Final = -3.0
"""Logarithm of the rate of carries, to begin with."""

WEIGHT_DECAY: Final = 1e-4
"""Weight of the squared parameters of the networks in the loss."""

SMALLEST_SHARE: Final = 1e-6
"""Below what any rest has in throws of a training die, if it has some; keeps logarithms finite."""

EVALUATIONS: Final = "evaluations"
"""Rows of a checkpoint: losses with their gradients."""


@dataclass(frozen=True)
class TrainingDie:
    """A die that was thrown, or several as one body whose parts know nothing of each other.

    Attributes
    ----------
    transitions, features: what the model knows of it.
    frequencies: (k,) of its rests in the order of those, NumPy or torch.
    change: part by which the table's restitution was higher.
    """

    transitions: Transitions
    features: Features
    frequencies: Any
    change: float = 0.0


def _joined(dice: Sequence[TrainingDie]) -> TrainingDie:
    """Dice that were thrown onto tables of one restitution as one body, in torch."""
    rests = np.cumsum([0, *(die.transitions.rests for die in dice)])
    ways = np.cumsum([0, *(len(die.transitions.source) for die in dice)])

    def joined(name: str, offsets: Integers | None = None) -> Integers:
        parts = [getattr(die.transitions, name) for die in dice]
        if offsets is not None:
            parts = [part + start for part, start in zip(parts, offsets, strict=False)]
        return np.concatenate(parts)

    unused = np.zeros((int(rests[-1]), 0), dtype=np.int64)
    transitions = Transitions(
        corners=unused,
        real=unused.astype(bool),
        tail=joined("tail"),
        head=joined("head"),
        source=joined("source", rests),
        target=joined("target", rests),
        first=joined("first", ways),
        second=joined("second", ways),
    )
    columns = {
        field.name: torch.as_tensor(
            np.concatenate([getattr(die.features, field.name) for die in dice])
        )
        for field in fields(Features)
    }
    frequencies = torch.as_tensor(np.concatenate([die.frequencies for die in dice]))
    return TrainingDie(transitions, Features(**columns), frequencies, dice[0].change)


def _divergence(die: TrainingDie, model: MomentumModel) -> Tensor:
    """Sum of the Kullback-Leibler divergences of the model's odds from the frequencies."""
    odds = landing_odds(die.features, die.transitions, model.at(die.change), torch)
    odds, frequencies = odds.clamp(min=SMALLEST_SHARE), die.frequencies
    divergence: Tensor = (frequencies * (frequencies.clamp(min=SMALLEST_SHARE) / odds).log()).sum()
    return divergence


def train(
    dice: Sequence[TrainingDie],
    checkpoint: Checkpoint | None = None,
    *,
    steps: int,
    seed: int = 0,
    on_step: Callable[[float], None] | None = None,
) -> MomentumModel:
    """The model, in torch, that fits dice best by its mean Kullback-Leibler divergence.

    checkpoint: of the same dice and seed; evaluations that were made before are taken from it, and
    others are added. steps: most iterations of L-BFGS; seed: of the hidden layers at first;
    on_step: called with the loss of each evaluation.
    """
    unions = [
        _joined([die for die in dice if die.change == change])
        for change in sorted({die.change for die in dice})
    ]
    transition_table = torch.cat([union.features.transitions for union in unions])
    carry_table = torch.cat([union.features.carries for union in unions])
    generator = torch.Generator().manual_seed(seed)
    hot, cooling, carry = (
        torch.tensor(value, dtype=torch.float64)
        for value in (np.log(FIRST_TEMPERATURE), FIRST_COOLING, 0.5)
    )
    first_rate = float(np.log(FIRST_RATE / IMPACTS))
    transitions = _network(
        transition_table, TRANSITION_HIDDEN, TRANSITION_OUTPUTS, first_rate, generator
    )
    carries = _network(carry_table, CARRY_HIDDEN, CARRY_OUTPUTS, FIRST_CARRY, generator)
    slopes = Slopes(
        torch.zeros(3, dtype=torch.float64),
        *(
            torch.zeros((1 + len(network.linear), len(network.bias)), dtype=torch.float64)
            for network in (transitions, carries)
        ),
    )
    model = MomentumModel(hot, cooling, carry, transitions, carries, slopes)
    weights = [*_trained(model.transitions), *_trained(model.carries), *vars(slopes).values()]
    parameters = [hot, cooling, carry, *weights]
    for parameter in parameters:
        parameter.requires_grad_()
    optimizer = torch.optim.LBFGS(
        parameters,
        max_iter=steps,
        history_size=30,
        tolerance_change=1e-8,
        line_search_fn="strong_wolfe",
    )

    kept = checkpoint or Checkpoint()
    known = deque(kept.rows(EVALUATIONS))
    size = 1 + sum(parameter.numel() for parameter in parameters)
    kept.require(all(len(row) == size for row in known))

    def loss_with_gradient() -> Tensor:
        optimizer.zero_grad()
        loss = torch.stack([_divergence(union, model) for union in unions]).sum() / len(dice)
        loss = loss + WEIGHT_DECAY * sum((weight**2).sum() for weight in weights if weight.ndim > 1)
        loss.backward()
        return loss

    def closure() -> Tensor:
        # The optimizer goes the same way again where it is told the same.
        if known:
            loss = _recall(known.popleft(), parameters)
        else:
            loss = loss_with_gradient()
            kept.add(EVALUATIONS, [_flat(loss, parameters)])
        if on_step is not None:
            on_step(float(loss.detach()))
        return loss

    optimizer.step(closure)
    for parameter in parameters:
        parameter.requires_grad_(False)
    return model


def _flat(loss: Tensor, parameters: Sequence[Tensor]) -> Floats:
    """(1 + n,) a loss and its gradient by n numbers."""
    gradients = [torch.zeros_like(p) if p.grad is None else p.grad for p in parameters]
    flat: Floats = torch.cat([loss.detach().view(1), *(g.reshape(-1) for g in gradients)]).numpy()
    return flat


def _recall(row: Floats, parameters: Sequence[Tensor]) -> Tensor:
    """The loss of which `_flat` made a row; the parameters get their gradient."""
    numbers = torch.tensor(row, dtype=torch.float64)
    parts = numbers[1:].split([parameter.numel() for parameter in parameters])
    for parameter, part in zip(parameters, parts, strict=True):
        parameter.grad = part.reshape(parameter.shape).clone()
    return numbers[0]


def _network(
    table: Tensor, hidden: int, outputs: int, bias: float, generator: torch.Generator
) -> Network:
    columns = table.shape[1]

    def spread(rows: int, width: int, size: float) -> Tensor:
        values = torch.rand((rows, width), generator=generator, dtype=torch.float64)
        return size * (2.0 * values - 1.0) / np.sqrt(rows)

    first = torch.zeros(outputs, dtype=torch.float64)
    first[0] = bias
    deviation = table.std(0)
    return Network(
        table.mean(0),
        # What few dice all have in common tells nothing.
        torch.where(deviation > LEAST_DEVIATION, deviation, 1.0),
        torch.zeros((columns, outputs), dtype=torch.float64),
        first,
        spread(columns, hidden, 1.0),
        spread(1, hidden, 1.0)[0],
        spread(hidden, outputs, 0.1),
    )


def _trained(network: Network) -> list[Tensor]:
    return [network.linear, network.bias, network.inward, network.shift, network.outward]
