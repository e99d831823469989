"""Finished die with six outcomes: a box."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from dicedesign.fabricate.die import FinishedDie, Solid, assess_file
from dicedesign.fabricate.file_formats import BODY_COLOR, Part
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.optimize.targets import Target
from dicedesign.report.pages import die_page
from dicedesign.results.parts import Concave, Displacement, HullOfSurface, SurfaceSize
from dicedesign.results.result import Designed, Result, StageTime, Step

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
        stages=(StageTime("start", 0.5, 301.2), StageTime("design", 2.25, None)),
        peak_since="stage",
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
    return die_page(die, images or {}, [Part(body.points, body.triangles, "die", BODY_COLOR)])
