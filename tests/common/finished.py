"""Finished dice with given results."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from dicedesign.fabricate.die import FinishedDie, Solid, assess_file
from dicedesign.fabricate.file_formats import Part
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.optimize.targets import Target
from dicedesign.palette import BLANK
from dicedesign.report.pages import die_page
from dicedesign.results.parts import Concave, Displacement, HullOfSurface, SurfaceSize
from dicedesign.results.result import RESULT, Designed, FacetOfDie, Result, StageTime, Step

LABELS = ("1", "2", "3", "4", "5", "<6>")

HISTORY = tuple(Step(k, 0.1 * k, 2.0 * 0.5**k, 0.2 * 0.4**k, {"dice": 1.0}) for k in range(8))


CONCAVE = Concave(
    probabilities_before=(0.125,) * 6,
    elsewhere_before=0.25,
    displacement=Displacement(0.0312, 0.115),
    hull=HullOfSurface(430, 363, 3.2e-6),
    surface=SurfaceSize(3301, 6598),
    quality=("No two triangles <cross>.", "No triangle is inverted."),
    surface_quality={},
    self_intersections=0,
)
"""Section of the result of a concave die."""


def finished_box(**changes: Any) -> FinishedDie:
    """Finished box. changes: other keys of its result."""
    corners = [(x, y, z) for x in (-7, 7) for y in (-8, 8) for z in (-10, 10)]
    hull = convex_hull(np.array(corners, dtype=np.float64))
    directions = np.concatenate([np.eye(3), -np.eye(3)])
    target = Target(LABELS, np.full(6, 1.0 / 6.0))
    verdict = assess_file(stl_bytes(hull.surface), directions, target)
    result = Result(
        name="a < box",
        status="off_target",
        message="max |p - q| is 0.1 & more",
        labels=LABELS,
        target=tuple(target.probabilities.tolist()),
        center_of_mass=(-1e-17, 1.5, -2.0),
        facets=verdict.facets,
        unstable_facets=0,
        rest_counts=(1,) * 6,
        least_angle_deg=90.0,
        least_margin_deg=45.0,
        asymmetry=0.1,
        history=HISTORY,
        design=Designed(0.1, {"dice": 1e-9, "smoothness & size": 0.25}),
        stages=(StageTime("start", 0.5), StageTime("design", 2.25)),
        files={"die_plain": "die_plain.stl"},
        **verdict.as_fields(),
    )
    engraved = Solid(
        points=hull.vertices,
        triangles=hull.triangles,
        poses=verdict.poses,
        outcomes=verdict.outcomes,
        center_of_mass=None,
        hull_points=hull.vertices,
        assessment=verdict,
    )
    upward = np.array([0.0, 0.0, 1.0])
    return FinishedDie(replace(result, **changes), verdict, engraved, 1e-6, upward)


def page_text(die: FinishedDie, images: dict[str, bytes] | None = None) -> str:
    """HTML of the report of a die whose printed solid is the plain one."""
    body = die.plain.body
    assert body.triangles is not None
    return die_page(die, images or {}, [Part(body.points, body.triangles, "die", BLANK)])


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
