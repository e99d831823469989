"""Endings of mesh files, and trimesh without what it takes along."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Final

from dicedesign.geometry.meshes.text_formats import TEXT_READERS

__all__ = ["OWN_ENDINGS", "mesh_endings", "without_solids"]

OWN_ENDINGS: Final = frozenset({".stl", *TEXT_READERS})
"""Endings, in lower case, of files that are read without trimesh."""


@cache
def mesh_endings() -> frozenset[str]:
    """Endings such as ".stl", in lower case, that `read_body` knows here. Imports trimesh."""
    with without_solids():
        from trimesh.exchange.load import mesh_formats

        return frozenset(f".{name}" for name in mesh_formats()) | OWN_ENDINGS


@contextmanager
def without_solids() -> Iterator[None]:
    """Keep manifold3d from being loaded: trimesh takes it along if it can, and a query needs it
    for nothing."""
    hidden = "manifold3d" not in sys.modules
    if hidden:
        sys.modules["manifold3d"] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        # Another thread may have ended first.
        if hidden and sys.modules.get("manifold3d", hidden) is None:
            sys.modules.pop("manifold3d", None)
