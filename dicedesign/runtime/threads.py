"""Thread limits of numerics."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module

__all__ = ["one_tensor_thread", "one_thread"]


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


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch and the BLAS of NumPy and SciPy use one thread meanwhile: sums are then taken in
    one order, and the same numbers come of them however many cores there are."""
    # Imported late: only long searches need it.
    from threadpoolctl import threadpool_limits

    with one_tensor_thread(), threadpool_limits(1):
        yield
