"""Functions of torch whose values and derivatives come from compiled kernels.

The kernels hold hand-derived adjoints. Where a derivative is itself to be differentiated, the same
function made of torch's operations takes their place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor

from dicedesign.runtime.arrays import Floats

__all__ = ["adjoint_function"]

Adjoint = Callable[[Floats], tuple[Floats, ...]]
"""From the gradient of the output to those of the inputs."""

Plain = Callable[..., Tensor]
"""From the inputs to the output, differentiable as often as one likes."""


def adjoint_function(value: Floats, adjoint: Adjoint, plain: Plain, *inputs: Tensor) -> Tensor:
    """A tensor of known value, with an adjoint that gives the gradients of the inputs."""
    output: Tensor = _AdjointFunction.apply(value, adjoint, plain, *inputs)
    return output


class _AdjointFunction(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, value: Floats, adjoint: Adjoint, plain: Plain, *inputs: Tensor) -> Tensor:
        ctx.save_for_backward(*inputs)
        ctx.adjoint, ctx.plain = adjoint, plain
        # A copy: the value may be that of a cached property.
        return torch.from_numpy(value.copy())

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        if torch.is_grad_enabled():
            return None, None, None, *_differentiable(ctx.plain, ctx.saved_tensors, gradient)
        return None, None, None, *map(torch.from_numpy, ctx.adjoint(gradient.numpy()))


def _differentiable(
    plain: Plain, inputs: Sequence[Tensor], gradient: Tensor
) -> list[Tensor | None]:
    """Gradients of the inputs that can be differentiated again."""
    # Copies, as one input may be a function of another.
    copies = [given.clone() for given in inputs]
    wanted = [place for place, given in enumerate(copies) if given.requires_grad]
    output = plain(*copies)
    found: list[Tensor | None] = [None] * len(copies)
    if wanted and output.requires_grad:
        given = [copies[place] for place in wanted]
        slopes = torch.autograd.grad(output, given, gradient, create_graph=True, allow_unused=True)
        for place, slope in zip(wanted, slopes, strict=True):
            found[place] = slope
    return found
