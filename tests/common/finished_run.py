"""Mesh file of a box, and the folder of a finished die."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import trimesh

from dicedesign.results.result import RESULT, Designed, FacetOfDie, Result

EXTENTS = (1.0, 1.2, 1.5)


def box_file(folder: Path, extents: Sequence[float] = EXTENTS, name: str = "box.obj") -> Path:
    """Write the mesh file of a box around the origin."""
    path = folder / name
    trimesh.creation.box(extents).export(path)
    return path


def finished_result(
    labels: Sequence[str],
    target: Sequence[float],
    facets: Iterable[tuple[str | None, Sequence[float]]] = (),
    *,
    center: Sequence[float] = (0.0, 0.0, 0.0),
    status: str = "converged",
) -> Result:
    """Result of a die with its target probabilities.

    facets: label and normal of each facet; a facet with a label counts for that outcome.
    """
    return Result(
        name="box",
        status=status,
        message="reached the tolerance",
        labels=tuple(labels),
        target=tuple(target),
        probabilities=tuple(target),
        elsewhere=0.0,
        max_abs_error=0.0,
        center_of_mass=tuple(center),
        facets=tuple(
            FacetOfDie(label, label, tuple(normal), 0.1, 100.0, 5.0, 20.0, 20.0)
            for label, normal in facets
        ),
        unstable_facets=0,
        rest_counts=(1,) * len(labels),
        least_angle_deg=90.0,
        least_margin_deg=20.0,
        asymmetry=0.0,
        history=(),
        design=Designed(0.0),
        files={"die_plain": "die_plain.stl"},
    )


def finished_run(folder: Path, *result: Any, **more: Any) -> Path:
    """Write a folder with a `finished_result`, but without its mesh files."""
    folder.mkdir(exist_ok=True)
    (folder / RESULT).write_text(finished_result(*result, **more).json_text())
    return folder
