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
    fault = _fault(given, shape)
    if fault is not None:
        wanted = f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"
        raise InputError(
            f"{name}: expected a float32 or float64 tensor of shape {wanted}, got {fault}"
        )
    assert isinstance(given, Tensor)
    return given.to("cpu", torch.float64)


def _fault(given: object, shape: tuple[int | str, ...]) -> str | None:
    """What is wrong with a tensor and what to do about it, None if nothing is."""
    if not isinstance(given, Tensor):
        return f"{type(given).__name__}; make a tensor with torch.tensor"
    if given.dtype not in (torch.float64, torch.float32):
        return f"{given.dtype}; convert it with .double()"
    if given.ndim != len(shape) or any(
        isinstance(asked, int) and asked != size
        for asked, size in zip(shape, given.shape, strict=True)
    ):
        return f"shape {tuple(given.shape)}; reshape it"
    if given.is_meta:
        return "a meta tensor; pass one with values"
    if given.layout != torch.strided:
        return f"one of layout {given.layout}; pass a dense one"
    return None
