"""Functions of torch whose values and derivatives come from compiled kernels.

The kernels hold hand-derived adjoints. Where a derivative is itself to be differentiated, the same
function made of torch's operations takes their place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

__all__ = ["adjoint_function"]

Floats = NDArray[np.float64]

Adjoint = Callable[..., tuple[Floats, ...]]
"""From the gradient of each output, an array or None for 0, to those of the inputs."""

Plain = Callable[..., tuple[Tensor, ...]]
"""From the inputs to the outputs, differentiable as often as one likes."""


def adjoint_function(
    values: tuple[Floats, ...], adjoint: Adjoint, plain: Plain, *inputs: Tensor
) -> tuple[Tensor, ...]:
    """Tensors of known values, with an adjoint that gives the gradients of the inputs."""
    outputs: tuple[Tensor, ...] = _AdjointFunction.apply(values, adjoint, plain, *inputs)
    return outputs


class _AdjointFunction(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, values: tuple[Floats, ...], adjoint: Adjoint, plain: Plain, *inputs: Tensor
    ) -> tuple[Tensor, ...]:
        ctx.set_materialize_grads(False)
        ctx.save_for_backward(*inputs)
        ctx.adjoint, ctx.plain = adjoint, plain
        return tuple(map(torch.from_numpy, values))

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor | None) -> tuple[Tensor | None, ...]:
        if all(gradient is None for gradient in gradients):
            return (None,) * (3 + len(ctx.saved_tensors))
        if torch.is_grad_enabled():
            return None, None, None, *_differentiable(ctx.plain, ctx.saved_tensors, gradients)
        arrays = (None if gradient is None else gradient.numpy() for gradient in gradients)
        return None, None, None, *map(torch.from_numpy, ctx.adjoint(*arrays))


def _differentiable(
    plain: Plain, inputs: Sequence[Tensor], gradients: Sequence[Tensor | None]
) -> list[Tensor | None]:
    """Gradients of the inputs that can be differentiated again."""
    # Copies, as one input may be a function of another.
    copies = [given.clone() for given in inputs]
    wanted = [place for place, given in enumerate(copies) if given.requires_grad]
    pairs = [
        (output, gradient)
        for output, gradient in zip(plain(*copies), gradients, strict=True)
        if gradient is not None and output.requires_grad
    ]
    found: list[Tensor | None] = [None] * len(copies)
    if pairs and wanted:
        outputs, weights = zip(*pairs, strict=True)
        given = [copies[place] for place in wanted]
        slopes = torch.autograd.grad(outputs, given, weights, create_graph=True, allow_unused=True)
        for place, slope in zip(wanted, slopes, strict=True):
            found[place] = slope
    return found
