"""Thread limits of numerics."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module

__all__ = ["one_tensor_thread"]


@contextmanager
def one_tensor_thread() -> Iterator[None]:
    """Let torch use one thread meanwhile: tensors here are far too small to share among threads,
    and processes often run side by side, one on each core."""
    torch = import_module("torch")
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
