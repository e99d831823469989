"""Tensors that come from outside, of which all is computed in float64 on the CPU."""

from __future__ import annotations

import torch
from torch import Tensor

from dicedesign.errors import InputError

__all__ = ["double_tensor"]


def double_tensor(given: object, name: str, *shape: int | str) -> Tensor:
    """A tensor as float64 on the CPU, through which gradients go back to its own type and device.

    Parameters
    ----------
    name: what messages begin with.
    shape: wanted, with a letter for a dimension of any size.

    Raises
    ------
    InputError: it is no tensor of float32 or float64 numbers, has another shape, or no values.
    """
    wanted = f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"
    expected = f"{name}: expected a float32 or float64 tensor of shape {wanted}, got"
    if not isinstance(given, Tensor):
        raise InputError(f"{expected} {type(given).__name__}; make a tensor with torch.tensor")
    if given.dtype not in (torch.float32, torch.float64):
        raise InputError(f"{expected} {given.dtype}; convert it with .double()")
    if given.ndim != len(shape) or any(
        isinstance(asked, int) and asked != size
        for asked, size in zip(shape, given.shape, strict=True)
    ):
        raise InputError(f"{expected} shape {tuple(given.shape)}; reshape it")
    if given.is_meta or given.layout != torch.strided:
        kind = "a meta tensor" if given.is_meta else f"one of layout {given.layout}"
        raise InputError(f"{expected} {kind}; pass a dense one with values")
    return given.to("cpu", torch.float64)
