"""Functions of bodies for autograd and `torch.func`, to any order, forward and backward.

The combinatorics of a body, its facets and paths, are computed from numbers, which torch does not
record. The functions of coordinates that result are given to torch here: values and gradients by
compiled kernels if there are any, other derivatives by operations of torch.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats, Integers

Formula = Callable[..., tuple[Tensor, ...]]
"""Function from the number of a body and its inputs to its outputs, by operations of torch."""

AtOnce = Callable[..., tuple[Floats, ...] | None]
"""Function from numbers of bodies (r,) and inputs (r, ...) to outputs (r, ...), or None to use the
formula."""

ONLY = torch.zeros((), dtype=torch.int64)
"""Number of a single body."""


P = ParamSpec("P")
T = TypeVar("T")


def uncompiled(function: Callable[P, T]) -> Callable[P, T]:
    """Make `torch.compile` call a function as it is, between two compiled parts: its integers are
    found from numbers, which a compiled graph does not have."""

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        # The compiler is loaded only by programs that compile: it takes as long as all of torch.
        if torch.compiler.is_compiling():
            return torch.compiler.disable(function)(*args, **kwargs)
        return function(*args, **kwargs)

    return call


@dataclass(frozen=True)
class BodyFunction:
    """A function of tensors that differs from body to body.

    Attributes
    ----------
    inputs, outputs: numbers of tensors.
    formula: the function of one body, differentiable to any order.
    value: faster function of many bodies, if there is one.
    adjoint: faster function from inputs and gradients in the outputs to gradients in the inputs.
    """

    inputs: int
    outputs: int
    formula: Formula
    value: AtOnce | None = None
    adjoint: AtOnce | None = None

    def __call__(self, which: Tensor, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Outputs (*l, ...) of bodies with numbers `which` (*l) and inputs (*l, ...)."""
        applied = _Transformed if torch._C._are_functorch_transforms_active() else _Applied
        outputs: tuple[Tensor, ...] = applied.apply(self, which, *inputs)
        return outputs

    @property
    def pullback(self) -> BodyFunction:
        """Function from inputs and gradients in the outputs to gradients in the inputs."""

        def formula(body: int, *given: Tensor) -> tuple[Tensor, ...]:
            with torch.enable_grad():
                leaves = [_leaf(tensor) for tensor in given[: self.inputs]]
                return _slopes(self.formula(body, *leaves), leaves, given[self.inputs :])

        return BodyFunction(self.inputs + self.outputs, self.inputs, formula, self.adjoint)

    @property
    def pushforward(self) -> BodyFunction:
        """Function from inputs and their tangents to tangents of the outputs, the transpose of the
        linear map `pullback`."""

        def formula(body: int, *given: Tensor) -> tuple[Tensor, ...]:
            with torch.enable_grad():
                leaves = [_leaf(tensor) for tensor in given[: self.inputs]]
                outputs = self.formula(body, *leaves)
                weights = [torch.zeros_like(output).requires_grad_() for output in outputs]
                slopes = _slopes(outputs, leaves, weights)
                return _slopes(slopes, weights, given[self.inputs :])

        return BodyFunction(2 * self.inputs, self.outputs, formula)

    def evaluate(self, which: Integers, *inputs: Floats) -> tuple[Floats, ...]:
        """Outputs (r, ...) of bodies (r,) as numbers."""
        outputs = None if self.value is None else self.value(which, *inputs)
        if outputs is not None:
            return outputs
        rows = [
            self.formula(int(body), *(torch.from_numpy(column[row]) for column in inputs))
            for row, body in enumerate(which)
        ]
        return tuple(
            np.stack([tensor.detach().numpy() for tensor in column])
            for column in zip(*rows, strict=True)
        )


def adjoint_function(
    value: Floats | None,
    adjoint: Callable[[Floats], tuple[Floats, ...] | None],
    formula: Callable[..., Tensor],
    *inputs: Tensor,
) -> Tensor:
    """Function of one body with one output, as a tensor.

    value: its value, or None to use the formula; adjoint: from the gradient in the output to the
    gradients in the inputs, or None to use the formula; formula: the function by operations of
    torch.
    """

    def adjoints(which: Integers, *given: Floats) -> tuple[Floats, ...] | None:
        rows = [adjoint(gradient) for gradient in given[-1]]
        if any(row is None for row in rows):
            return None
        return tuple(np.stack(column) for column in zip(*rows, strict=True))

    function = BodyFunction(
        len(inputs),
        1,
        lambda body, *given: (formula(*given),),
        None if value is None else lambda which, *given: (np.stack([value] * len(which)),),
        adjoints,
    )
    return function(ONLY, *inputs)[0]


def take_constant(action: Callable[..., Integers], *inputs: Tensor) -> Tensor:
    """Integers (*l) that an action computes from the values of tensors, without a derivative.

    If transforms of `torch.func` map over tensors, it is called once, and its arguments and its
    result have the mapped dimensions first.
    """
    numbers = _numbers(inputs)
    integers: Tensor = (
        _Constant.apply(action, *inputs) if numbers is None else torch.from_numpy(action(*numbers))
    )
    return integers


def _numbers(tensors: Sequence[Tensor]) -> list[NDArray[Any]] | None:
    """Numbers of tensors; None under transforms of `torch.func`, which hide them."""
    try:
        return [tensor.detach().numpy() for tensor in tensors]
    except RuntimeError:
        return None


def _evaluate(function: BodyFunction, which: Integers, *inputs: Floats) -> tuple[Tensor, ...]:
    """Outputs (*l, ...) for bodies (*l) with inputs (*l, ...)."""
    lead = which.shape
    rows = [
        np.ascontiguousarray(array).reshape(which.size, *array.shape[len(lead) :])
        for array in inputs
    ]
    outputs = function.evaluate(which.reshape(which.size), *rows)
    return tuple(torch.from_numpy(output.reshape(*lead, *output.shape[1:])) for output in outputs)


def _with_signature(forward: Callable[..., Any]) -> Callable[..., Any]:
    """Store the signature of a function as its attribute: torch reads it in every call, and
    computing it takes longer than a hull."""
    forward.__signature__ = inspect.signature(forward)  # type: ignore[attr-defined]
    return forward


class _Applied(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, *given: Any) -> tuple[Tensor, ...]:
        _Transformed.setup_context(ctx, given, ())
        return _Transformed.forward(*given)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        given = (*ctx.saved_tensors, *gradients)
        if not torch.is_grad_enabled():
            numbers = _numbers(given)
            if numbers is not None:
                return None, None, *_evaluate(ctx.function.pullback, *numbers)
        return None, None, *ctx.function.pullback(*given)

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> tuple[Tensor, ...]:
        which, *inputs = ctx.saved_tensors
        along = [
            torch.zeros_like(tensor) if tangent is None else tangent
            for tensor, tangent in zip(inputs, tangents[2:], strict=True)
        ]
        pushed: tuple[Tensor, ...] = ctx.function.pushforward(which, *inputs, *along)
        return pushed


class _Transformed(_Applied):
    """The same for transforms of `torch.func`, which take longer."""

    @staticmethod
    @_with_signature
    def forward(*given: Any) -> tuple[Tensor, ...]:
        function, *tensors = given
        return _evaluate(function, *(tensor.detach().numpy() for tensor in tensors))

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[Tensor, ...]) -> None:
        ctx.function, *tensors = inputs
        ctx.save_for_backward(*tensors)
        ctx.save_for_forward(*tensors)

    @staticmethod
    def vmap(
        info: Any, in_dims: tuple[Any, ...], function: BodyFunction, *tensors: Tensor
    ) -> tuple[tuple[Tensor, ...], tuple[int, ...]]:
        outputs = function(*_leading(tensors, in_dims[1:], info.batch_size))
        return outputs, (0,) * len(outputs)


class _Constant(torch.autograd.Function):
    @staticmethod
    def forward(action: Callable[..., Integers], *inputs: Tensor) -> Tensor:
        return torch.as_tensor(action(*(tensor.detach().numpy() for tensor in inputs)))

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: Tensor) -> None:
        ctx.mark_non_differentiable(output)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[None, ...]:
        return (None,) * len(ctx.needs_input_grad)

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> None:
        return None

    @staticmethod
    def vmap(
        info: Any, in_dims: tuple[Any, ...], action: Callable[..., Integers], *inputs: Tensor
    ) -> tuple[Tensor, int]:
        return _Constant.apply(action, *_leading(inputs, in_dims[1:], info.batch_size)), 0


def _leading(
    tensors: Sequence[Tensor], dimensions: Sequence[int | None], size: int
) -> list[Tensor]:
    """Move the mapped dimension of tensors first, or expand tensors without one."""
    return [
        tensor.expand(size, *tensor.shape) if place is None else tensor.movedim(place, 0)
        for tensor, place in zip(tensors, dimensions, strict=True)
    ]


def _leaf(tensor: Tensor) -> Tensor:
    return tensor if tensor.requires_grad else tensor.detach().requires_grad_()


def _slopes(
    outputs: Sequence[Tensor], inputs: Sequence[Tensor], gradients: Sequence[Tensor]
) -> tuple[Tensor, ...]:
    """Gradients in the inputs from gradients in the outputs, differentiable again."""
    varying = [
        (output, gradient)
        for output, gradient in zip(outputs, gradients, strict=True)
        if output.requires_grad
    ]
    if not varying:
        return tuple(torch.zeros_like(tensor) for tensor in inputs)
    return torch.autograd.grad(
        [output for output, _ in varying],
        list(inputs),
        [gradient for _, gradient in varying],
        create_graph=True,
        allow_unused=True,
        materialize_grads=True,
    )


def double_tensor(given: object, name: str, *shape: int | str) -> Tensor:
    """Convert a tensor to float64 on the CPU, with gradients in its own type and device.

    Parameters
    ----------
    name: beginning of messages.
    shape: expected shape, with a text for a dimension of any size.

    Raises
    ------
    InputError: the input is no tensor of float32 or float64 numbers, or has another shape or no
        values.
    """
    if not isinstance(given, Tensor):
        fault = f"{type(given).__name__}; make a tensor with torch.tensor"
    elif given.dtype not in (torch.float64, torch.float32):
        fault = f"{given.dtype}; convert it with .double()"
    elif given.ndim != len(shape) or any(
        isinstance(expected, int) and expected != size
        for expected, size in zip(shape, given.shape, strict=True)
    ):
        fault = f"shape {tuple(given.shape)}; reshape it"
    elif given.is_meta:
        fault = "a meta tensor; pass one with values"
    elif given.layout != torch.strided:
        fault = f"one of layout {given.layout}; pass a dense one"
    else:
        return given.to("cpu", torch.float64)
    wanted = f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"
    raise InputError(f"{name}: expected a float32 or float64 tensor of shape {wanted}, got {fault}")
