"""The accuracy bench's answers as plain data and as a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dicedesign.bench.machine import machine_description
from dicedesign.bench.measures.answers import (
    FLOAT32,
    FLOAT64,
    LATTICE,
    MONTE_CARLO,
    SEED,
    SOLID_ANGLES,
    SPREAD,
    TRIMESH,
    TRIMESH_SPREAD,
    Answer,
)
from dicedesign.bench.reference.bodies_with_answers import Subject

if TYPE_CHECKING:
    from dicedesign.report.charts.paper import Paper

__all__ = ["Result", "accuracy_figure", "accuracy_record"]

EXPECTED: Final = "random directions, expected"

LEVELS: Final = {
    "float32 rounding": float(np.finfo(np.float32).eps) / 2.0,
    "float64 rounding": float(np.finfo(np.float64).eps) / 2.0,
}
"""Half the distance from 1 to the next number of each type."""

STYLES: Final[Mapping[str, Mapping[str, Any]]] = {
    FLOAT64: {"color": "#d55e00", "marker": "*", "line": ""},
    FLOAT32: {"color": "#d55e00", "marker": "*", "line": "", "filled": False},
    MONTE_CARLO: {"color": "#0072b2", "marker": "o"},
    EXPECTED: {"color": "#0072b2", "marker": "", "line": "--"},
    LATTICE: {"color": "#009e73", "marker": "s"},
    TRIMESH: {"color": "#cc79a7", "marker": "D", "line": ""},
    TRIMESH_SPREAD: {"color": "#cc79a7", "marker": "D", "filled": False},
    SOLID_ANGLES: {"color": "#000000", "marker": "^", "line": "", "filled": False},
}


@dataclass(frozen=True)
class Result:
    """A body and the answers of all methods to it."""

    subject: Subject
    answers: Sequence[Answer]


def accuracy_record(results: Sequence[Result]) -> dict[str, Any]:
    """Everything measured, with date, machine and versions, for JSON."""
    bodies = [
        {
            "name": result.subject.name,
            "points": len(result.subject.body.points),
            "facets": len(result.subject.hull.normals),
            "rests": result.subject.rests,
            "reference": "60-digit oracle" if result.subject.oracle else FLOAT64,
            "tied": result.subject.tied,
            "answers": [asdict(answer) for answer in result.answers],
        }
        for result in results
    ]
    return {
        **machine_description("numpy", "scipy", "trimesh", "mpmath"),
        "seed": SEED,
        "spread_of_centers": SPREAD,
        "bodies": bodies,
    }


def accuracy_figure(results: Sequence[Result]) -> Paper:
    """Error over seconds, a panel for each body."""
    from dicedesign.report.charts.series import Curve, Style
    from dicedesign.report.charts.time_curves import Panel, panels_figure

    curves: list[list[Curve]] = [[] for _ in results]
    for method, style in STYLES.items():
        points = [_points(result, method) for result in results]
        if any(points):
            for row, values in zip(curves, points, strict=True):
                seconds, errors = zip(*values, strict=True) if values else ((), ())
                row.append(Curve(seconds, errors, Style(**style), method))
    panels = [
        Panel(result.subject.name, row, LEVELS) for result, row in zip(results, curves, strict=True)
    ]
    return panels_figure(panels, 3)


def _points(result: Result, method: str) -> list[tuple[float, float]]:
    """Seconds and errors of a method."""
    if method == EXPECTED:
        return _expected(result)
    return [
        (answer.seconds, answer.error)
        for answer in result.answers
        if answer.method == method and answer.seconds is not None and answer.error is not None
    ]


def _expected(result: Result) -> list[tuple[float, float]]:
    """Standard error of the share of the facet where it is largest, at each number of directions
    that was traced and in the time it took; nothing for a body with one rest."""
    deviation = result.subject.largest_deviation
    return [
        (answer.seconds, deviation / answer.samples**0.5)
        for answer in result.answers
        if answer.method == MONTE_CARLO
        and answer.seconds is not None
        and answer.samples is not None
        and deviation > 0.0
    ]
