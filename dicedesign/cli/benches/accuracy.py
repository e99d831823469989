"""`dicedesign bench accuracy`: error of the probabilities over run time, by several methods."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.benches.reporting import (
    add_folder_option,
    add_json_option,
    print_row,
    progress_bar,
    require_positive_seconds,
    write_results,
)
from dicedesign.errors import InputError
from dicedesign.runtime.files import make_writable_folder

if TYPE_CHECKING:
    from dicedesign.bench.measures.answers import Answer
    from dicedesign.bench.reference.bodies_with_answers import Subject
    from dicedesign.geometry.meshes.body import Body

__all__ = ["add_parser"]

METHOD_WIDTH = 27


def add_parser(benches: Any) -> None:
    """Add the bench to argparse's `benches`."""
    parser = benches.add_parser(
        "accuracy",
        help="error against run time, by this model and others",
        description="Compare the errors of resting probabilities and the times they take: this "
        "model in float64 and float32, traced directions, trimesh's stable poses, and solid angles "
        "of facets. Errors are largest differences of a facet's probability from 60-digit "
        "arithmetic, or for large hulls from this model in float64.",
    )
    parser.add_argument(
        "meshes", nargs="*", type=Path, metavar="MESH", help="STL, OBJ, PLY, OFF, GLB, XYZ, ..."
    )
    parser.add_argument(
        "--samples",
        type=int,
        default=10**6,
        metavar="N",
        help="trace at most N directions (default: 1000000)",
    )
    parser.add_argument(
        "--seconds",
        type=float,
        default=20.0,
        metavar="S",
        help="leave out answers that take more than S seconds, or are expected to (default: 20)",
    )
    add_folder_option(parser, "accuracy")
    add_json_option(parser)
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    from dicedesign.bench.accuracy import Result, accuracy_figure, accuracy_record
    from dicedesign.bench.measures.answers import answers
    from dicedesign.bench.reference.bodies_with_answers import make_subject

    _check(options)
    bodies = _bodies(options.meshes)
    make_writable_folder(options.out)
    subjects = [make_subject(name, body) for name, body in bodies]
    results = []
    with progress_bar("answers") as bar:

        def show(line: str) -> None:
            if not options.json:
                print_row(line)

        for subject in subjects:
            bar.set_description_str(subject.name)
            show(_heading(subject))
            found = []
            for answer in answers(
                subject, most_directions=options.samples, seconds=options.seconds
            ):
                bar.update()
                found.append(answer)
                show(_row(answer))
            show("")
            results.append(Result(subject, found))
    write_results(
        options.out,
        "accuracy",
        accuracy_figure(results),
        accuracy_record(results),
        as_json=options.json,
    )
    return 0


def _check(options: argparse.Namespace) -> None:
    from dicedesign.bench.measures.answers import DIRECTIONS

    if options.samples < DIRECTIONS[0]:
        raise InputError(
            f"--samples: expected at least {DIRECTIONS[0]}, got {options.samples}; give more"
        )
    require_positive_seconds(options.seconds)


def _bodies(meshes: list[Path]) -> list[tuple[str, Body]]:
    """The bodies in the files, named without their folders, or the built-in ones."""
    from dicedesign.bench.reference.bodies_with_answers import built_in_bodies
    from dicedesign.geometry.meshes.reading import read_body

    if not meshes:
        return list(built_in_bodies())
    return [(mesh.name, read_body(mesh)) for mesh in meshes]


def _heading(subject: Subject) -> str:
    reference = "60-digit arithmetic" if subject.oracle else "this model in float64"
    lines = [
        f"{subject.name}: {len(subject.hull.normals)} facets, {subject.rests} rests; errors "
        f"against {reference}"
    ]
    if subject.tied:
        lines.append(
            "the body balances somewhere: this model takes the mean to both sides, the other "
            "methods none"
        )
    return "\n".join([*lines, f"{'method':<{METHOD_WIDTH}}{'samples':>9}{'s':>12}{'error':>10}"])


def _row(answer: Answer) -> str:
    samples = "" if answer.samples is None else str(answer.samples)
    seconds = "-" if answer.seconds is None else f"{answer.seconds:.5f}"
    error = "-" if answer.error is None else f"{answer.error:.1e}"
    row = f"{answer.method:<{METHOD_WIDTH}}{samples:>9}{seconds:>12}{error:>10}  {answer.note}"
    return row.rstrip()
