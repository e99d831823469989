"""A box in a file, and the folder that a run leaves of a die."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import trimesh

from dicedesign.results.record import RESULT, FacetOfDie, Result

EXTENTS = (1.0, 1.2, 1.5)


def box_file(folder: Path, extents: Sequence[float] = EXTENTS, name: str = "box.obj") -> Path:
    """A box about the origin, as a mesh file."""
    path = folder / name
    trimesh.creation.box(extents).export(path)
    return path


def finished_run(
    folder: Path,
    labels: Sequence[str],
    target: Sequence[float],
    facets: Iterable[tuple[str | None, Sequence[float]]] = (),
    *,
    center: Sequence[float] = (0.0, 0.0, 0.0),
    status: str = "converged",
) -> Path:
    """A folder with a result whose file without marks is die_plain.stl, which is not made.

    facets: label and normal of each; that of a label counts for it.
    """
    folder.mkdir(exist_ok=True)
    result = Result(
        name="box",
        status=status,
        message="reached the tolerance",
        labels=tuple(labels),
        target=tuple(target),
        probabilities=tuple(target),
        elsewhere=0.0,
        max_abs_error=0.0,
        design_max_abs_error=0.0,
        center_of_mass=tuple(center),
        facets=tuple(
            FacetOfDie(label, label, tuple(normal), 0.1, 100.0, 5.0, 20.0, 20.0)
            for label, normal in facets
        ),
        unstable_facets=0,
        rest_counts=(1,) * len(labels),
        least_angle_deg=90.0,
        asymmetry=0.0,
        history=(),
        files={"die_plain": "die_plain.stl"},
    )
    (folder / RESULT).write_text(result.json_text())
    return folder
