"""Functions of torch whose values and derivatives come from compiled kernels.

The kernels hold hand-derived adjoints. Where there are none, or where a derivative is itself to be
differentiated, the same function made of torch's operations takes their place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor

from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats

__all__ = ["Adjoint", "Formula", "adjoint_function"]

Adjoint = Callable[[Floats], tuple[Floats, ...] | None]
"""From the gradient of the output to those of the inputs; None where the kernels leave it open."""

Formula = Callable[..., Tensor]
"""From the inputs to the output, differentiable as often as one likes."""


def adjoint_function(
    value: Callable[[], Floats], adjoint: Adjoint, formula: Formula, *inputs: Tensor
) -> Tensor:
    """A function of tensors, by kernels where there are any and by operations of torch elsewhere.

    value: computes the function's value; adjoint: the gradients of the inputs; formula: the same
    function by operations of torch.
    """
    if not kernels.available():
        return formula(*inputs)
    output: Tensor = _AdjointFunction.apply(value(), adjoint, formula, *inputs)
    return output


class _AdjointFunction(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, value: Floats, adjoint: Adjoint, formula: Formula, *inputs: Tensor
    ) -> Tensor:
        ctx.save_for_backward(*inputs)
        ctx.adjoint, ctx.formula = adjoint, formula
        # A copy: the value may be that of a cached property.
        return torch.from_numpy(value.copy())

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        if not torch.is_grad_enabled():
            slopes = ctx.adjoint(gradient.numpy())
            if slopes is not None:
                return None, None, None, *map(torch.from_numpy, slopes)
        return None, None, None, *_differentiable(ctx.formula, ctx.saved_tensors, gradient)


def _differentiable(
    formula: Formula, inputs: Sequence[Tensor], gradient: Tensor
) -> list[Tensor | None]:
    """Gradients of the inputs that can be differentiated again."""
    # Copies, as one input may be a function of another.
    copies = [given.clone() for given in inputs]
    wanted = [place for place, given in enumerate(copies) if given.requires_grad]
    output = formula(*copies)
    slopes: list[Tensor | None] = [None] * len(copies)
    if wanted and output.requires_grad:
        given = [copies[place] for place in wanted]
        by_given = torch.autograd.grad(
            output, given, gradient, create_graph=True, allow_unused=True
        )
        for place, slope in zip(wanted, by_given, strict=True):
            slopes[place] = slope
    return slopes
