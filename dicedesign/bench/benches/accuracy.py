"""Errors of resting probabilities over the time they take, by this model and by other methods."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np

from dicedesign.bench.frame import BENCHES, RESULTS, Bench, Items, Run
from dicedesign.bench.options import Amount, meshes
from dicedesign.bench.rows import Row

if TYPE_CHECKING:
    from dicedesign.bench.measures.queries.answers import Answer
    from dicedesign.bench.reference.bodies_with_answers import Subject
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.report.charts.paper import Paper

__all__ = ["BodyAnswers", "Extent", "accuracy_figure"]

EXPECTED: Final = "random directions, expected"

LEVELS: Final = {
    "float32 rounding": float(np.finfo(np.float32).eps) / 2.0,
    "float64 rounding": float(np.finfo(np.float64).eps) / 2.0,
}
"""Half the distance from 1 to the next number of each type."""

STYLES: Final[Mapping[str, Mapping[str, Any]]] = {
    "this model, float64": {"color": "#d55e00", "marker": "*", "line": ""},
    "this model, float32": {"color": "#d55e00", "marker": "*", "line": "", "filled": False},
    "traced random directions": {"color": "#0072b2", "marker": "o"},
    EXPECTED: {"color": "#0072b2", "marker": "", "line": "--"},
    "traced lattice directions": {"color": "#009e73", "marker": "s"},
    "trimesh, exact center": {"color": "#cc79a7", "marker": "D", "line": ""},
    "trimesh, spread centers": {"color": "#cc79a7", "marker": "D", "filled": False},
    "solid angles of facets": {"color": "#000000", "marker": "^", "line": "", "filled": False},
}
"""Of methods in the figure."""


@dataclass(frozen=True)
class Extent:
    """Most directions that are traced, and longest time of an answer."""

    samples: int
    seconds: float


@dataclass(frozen=True)
class BodyAnswers(Row):
    """A body and all answers to it.

    Attributes
    ----------
    name, points, facets, rests: its name and how many of these it has.
    reference: what the answers are compared with; tied: as in `Subject`.
    largest_deviation: of one random direction, see `Subject`.
    answers: of all methods.
    """

    table: ClassVar[str | None] = "bodies"
    printed: ClassVar[bool] = False

    name: str
    points: int
    facets: int
    rests: int
    reference: str
    tied: bool
    largest_deviation: float
    answers: tuple[Answer, ...]

    @classmethod
    def of(cls, subject: Subject, answers: Sequence[Answer]) -> BodyAnswers:
        """The answers to a body of which the truth is known."""
        return cls(
            name=subject.name,
            points=len(subject.body.points),
            facets=len(subject.hull.normals),
            rests=subject.rests,
            reference="60-digit oracle" if subject.oracle else "this model, float64",
            tied=subject.tied,
            largest_deviation=subject.largest_deviation,
            answers=tuple(answers),
        )

    def points_of(self, method: str) -> list[tuple[float, float]]:
        """Seconds and errors of a method. Of `EXPECTED`, the standard error of the share of the
        facet where it is largest, at each number of directions that was traced and in the time it
        took; nothing for a body with one rest."""
        expected = method == EXPECTED
        chosen = "traced random directions" if expected else method
        points = []
        for answer in self.answers:
            error = answer.error
            if expected and answer.samples is not None:
                error = self.largest_deviation / answer.samples**0.5 or None
            if answer.method == chosen and answer.seconds is not None and error is not None:
                points.append((answer.seconds, error))
        return points


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.queries.answers import SEED, SPREAD, answers
    from dicedesign.bench.reference.bodies_with_answers import make_subject

    extent: Extent = run.extent
    subjects = [make_subject(name, body) for name, body in _bodies(run.options.meshes)]
    yield {"seed": SEED, "spread_of_centers": SPREAD}
    for subject in subjects:
        run.begin(subject.name)
        yield _heading(subject)
        given = []
        for answer in answers(subject, most_directions=extent.samples, seconds=extent.seconds):
            run.advance()
            given.append(answer)
            yield answer
        yield BodyAnswers.of(subject, given)
    return True


def _bodies(meshes: Sequence[Path]) -> Iterator[tuple[str, Body]]:
    """The bodies in the files, named without their folders, or the built-in ones."""
    from dicedesign.bench.reference.bodies_with_answers import built_in_bodies
    from dicedesign.geometry.meshes.reading import read_body

    if meshes:
        return ((mesh.name, read_body(mesh)) for mesh in meshes)
    return built_in_bodies()


def _heading(subject: Subject) -> str:
    reference = "60-digit arithmetic" if subject.oracle else "this model in float64"
    heading = (
        f"\n{subject.name}: {len(subject.hull.normals)} facets, {subject.rests} rests; errors "
        f"against {reference}"
    )
    if subject.tied:
        heading += (
            "\nthe body balances somewhere: this model takes the mean to both sides, the other "
            "methods none"
        )
    return heading


def accuracy_figure(rows: Sequence[Row], run: Run | None = None) -> Paper:
    """Error over seconds, a panel for each body."""
    from dicedesign.report.charts.series import Curve, Style
    from dicedesign.report.charts.time_curves import Panel, panels_figure

    bodies = [row for row in rows if isinstance(row, BodyAnswers)]
    curves: list[list[Curve]] = [[] for _ in bodies]
    for method, style in STYLES.items():
        points = [body.points_of(method) for body in bodies]
        if any(points):
            for row, values in zip(curves, points, strict=True):
                seconds, errors = zip(*values, strict=True) if values else ((), ())
                row.append(Curve(seconds, errors, Style(**style), method))
    panels = [Panel(body.name, row, LEVELS) for body, row in zip(bodies, curves, strict=True)]
    return panels_figure(panels, 3)


BENCHES.register(
    Bench(
        name="accuracy",
        line="error against run time, by this model and others",
        description="Compare the errors of resting probabilities and the times they take: this "
        "model in float64 and float32, traced directions, trimesh's stable poses, and solid angles "
        "of facets. Errors are largest differences of a facet's probability from 60-digit "
        "arithmetic, or for large hulls from this model in float64.",
        rows=_rows,
        full=Extent(samples=1_000_000, seconds=20.0),
        quick=Extent(samples=10_000, seconds=2.0),
        amounts=(
            Amount("samples", "N", "trace at most N directions", least=100),
            Amount(
                "seconds",
                "S",
                "leave out answers that take more than S seconds, or are expected to",
                kind=float,
            ),
        ),
        options=(meshes(),),
        packages=("numpy", "scipy", "trimesh", "mpmath"),
        torch=False,
        unit="answers",
        figure=accuracy_figure,
        results=RESULTS,
    )
)
