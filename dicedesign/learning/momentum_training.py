"""Fits the momentum model to simulated throws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dicedesign.runtime.arrays import Floats
from dicedesign.throws.momentum.momentum_model import (
    CARRY_OUTPUTS,
    PASS_OUTPUTS,
    MomentumModel,
    Network,
    Slopes,
)
from dicedesign.throws.momentum.momentum_odds import IMPACTS, landing_odds
from dicedesign.throws.momentum.transition_features import Features
from dicedesign.throws.momentum.transitions import Passes

__all__ = ["TrainingDie", "plain_model", "train"]

PASS_HIDDEN: Final = 24

CARRY_HIDDEN: Final = 12
"""Hidden units of the networks."""

FIRST_TEMPERATURE: Final = 0.17
"""In radii, to begin with; it falls by `FIRST_COOLING` natural logarithms."""

FIRST_COOLING: Final = 2.5

FIRST_RATE: Final = 4.0
"""Passes over no barrier in all impacts together, to begin with."""

FIRST_CARRY: Final = -3.0
"""Logarithm of the rate of carries, to begin with."""

WEIGHT_DECAY: Final = 1e-4
"""Weight of the squared parameters of the networks in the loss."""

DIGITS: Final = 6
"""Significant digits of parameters that are kept."""


@dataclass(frozen=True)
class TrainingDie:
    """A die that was thrown.

    Attributes
    ----------
    passes, seen: what the model knows of it. frequencies: (k,) of its rests in the order of them.
    change: part by which the table's restitution was higher.
    """

    passes: Passes
    seen: Features
    frequencies: Floats
    change: float = 0.0


@dataclass(frozen=True)
class _Union:
    """Dice as one body whose parts know nothing of each other, on tables of one restitution."""

    passes: Passes
    seen: Features
    frequencies: Tensor
    change: float

    @classmethod
    def of(cls, dice: Sequence[TrainingDie]) -> _Union:
        rests = np.cumsum([0, *(die.passes.rests for die in dice)])
        ways = np.cumsum([0, *(len(die.passes.source) for die in dice)])

        def joined(name: str, offsets: Floats | None) -> NDArray[np.int64]:
            parts = [getattr(die.passes, name) for die in dice]
            if offsets is not None:
                parts = [part + start for part, start in zip(parts, offsets, strict=False)]
            return np.concatenate(parts)

        unused = np.zeros((int(rests[-1]), 0), dtype=np.int64)
        passes = Passes(
            unused,
            unused.astype(bool),
            joined("tail", None),
            joined("head", None),
            joined("source", rests),
            joined("target", rests),
            joined("first", ways),
            joined("second", ways),
        )
        columns = {
            name: torch.as_tensor(np.concatenate([getattr(die.seen, name) for die in dice]))
            for name in ("odds", "barriers", "passes", "exits", "carries")
        }
        frequencies = torch.as_tensor(np.concatenate([die.frequencies for die in dice]))
        return cls(passes, Features(**columns), frequencies, dice[0].change)

    def loss(self, model: MomentumModel) -> Tensor:
        """Sum of the Kullback-Leibler divergences of the model's odds from the frequencies."""
        model = model.at(self.change)
        odds = landing_odds(self.seen, self.passes, model, torch).clamp(min=1e-6)
        seen = self.frequencies
        return (seen * (seen.clamp(min=1e-9) / odds).log()).sum()


def train(
    dice: Sequence[TrainingDie],
    *,
    steps: int,
    seed: int = 0,
    on_step: Callable[[float], None] | None = None,
) -> MomentumModel:
    """The model, in torch, that fits dice best by its mean Kullback-Leibler divergence.

    steps: most iterations of L-BFGS; seed: of the hidden layers at first; on_step: called with the
    loss of each evaluation.
    """
    unions = [
        _Union.of([die for die in dice if die.change == change])
        for change in sorted({die.change for die in dice})
    ]
    pass_table, carry_table = (
        torch.cat([getattr(union.seen, name) for union in unions]) for name in ("passes", "carries")
    )
    generator = torch.Generator().manual_seed(seed)
    hot, cooling, carry = (
        torch.tensor(value, dtype=torch.float64)
        for value in (np.log(FIRST_TEMPERATURE), FIRST_COOLING, 0.5)
    )
    slopes = Slopes(
        *(
            torch.zeros(shape, dtype=torch.float64)
            for shape in (
                (3,),
                (1 + pass_table.shape[1], PASS_OUTPUTS),
                (1 + carry_table.shape[1], CARRY_OUTPUTS),
            )
        )
    )
    model = MomentumModel(
        hot,
        cooling,
        carry,
        _network(
            pass_table,
            PASS_HIDDEN,
            PASS_OUTPUTS,
            float(np.log(FIRST_RATE / IMPACTS)),
            generator,
        ),
        _network(carry_table, CARRY_HIDDEN, CARRY_OUTPUTS, FIRST_CARRY, generator),
        slopes,
    )
    weights = [*_trained(model.passes), *_trained(model.carries), *vars(slopes).values()]
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

    def closure() -> Tensor:
        optimizer.zero_grad()
        loss = torch.stack([union.loss(model) for union in unions]).sum() / len(dice)
        loss = loss + WEIGHT_DECAY * sum((weight**2).sum() for weight in weights if weight.ndim > 1)
        loss.backward()
        if on_step is not None:
            on_step(float(loss.detach()))
        return loss

    optimizer.step(closure)
    for parameter in parameters:
        parameter.requires_grad_(False)
    return model


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
        torch.where(deviation > 0.0, deviation, 1.0),
        torch.zeros((columns, outputs), dtype=torch.float64),
        first,
        spread(columns, hidden, 1.0),
        spread(1, hidden, 1.0)[0],
        spread(hidden, outputs, 0.1),
    )


def _trained(network: Network) -> list[Tensor]:
    return [network.linear, network.bias, network.inward, network.shift, network.outward]


def plain_model(model: MomentumModel) -> dict[str, Any]:
    """A model as plain data for a table's file, with `DIGITS` digits."""

    def rounded(value: Any) -> Any:
        if isinstance(value, list):
            return [rounded(part) for part in value]
        return float(f"{value:.{DIGITS}g}")

    plain: dict[str, Any] = {
        name: rounded(getattr(model, name).tolist()) for name in ("hot", "cooling", "carry_barrier")
    }
    for name in ("passes", "carries", "slopes"):
        part = getattr(model, name)
        plain[name] = {key: rounded(value.tolist()) for key, value in vars(part).items()}
    return plain
