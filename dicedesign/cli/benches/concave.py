"""`dicedesign bench concave`: concave dice by both fills, with their odds, time and distortion."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.benches.reporting import add_json_option, json_text, print_row, progress_bar
from dicedesign.errors import InputError, RecipeError

if TYPE_CHECKING:
    from dicedesign.bench.concave import ConcaveCase, ConcaveRow
    from dicedesign.concave.result import ConcaveStep

__all__ = ["add_parser"]

NAME_WIDTH = 16

TARGET_WIDTH = 14

FILL_WIDTH = 15

WIDTHS = (7, 8, 7, 10, 11, 10, 6, 8, 8, 7, 7, 11, 7)

KEY = """\
|p - q|: the largest over clusters of rests within 5 degrees; elsewhere: odds of all other rests.
Both, the gap and the pairs of triangles that meet are those of the STL file as it is read back, its
center of mass that of the solid. s: of the search, on the wall. MB: peak of the process. gap: from
its hull to the designed one, over the diagonal. mean, most: displacement of the points, over the
diagonal. shape, size: mean distortion of the triangles, 1 for none. corners: of the hull, before/
after. tried: attempts at a die."""


def add_parser(benches: Any) -> None:
    """Add the bench to argparse's `benches`."""
    parser = benches.add_parser(
        "concave",
        help="concave dice by both fills: odds, time, memory and distortion",
        description="Make each surface into a die for each target, its hull filled by "
        "correspondence and by quadratic programs, and measure what the STL file of the die holds. "
        "Surfaces of more than 5,000 points (250 with --quick) are decimated to that for the "
        "quadratic programs. What fails is a row with the reason. Exit code 1 if a die by "
        "correspondence misses the tolerance or meets itself.",
    )
    parser.add_argument(
        "meshes",
        nargs="*",
        type=Path,
        metavar="MESH",
        help="STL, OBJ, PLY, OFF, GLB, ... (default: shapes that the package builds itself)",
    )
    parser.add_argument(
        "--target",
        dest="targets",
        action="append",
        metavar="TARGET",
        help="fair:K, or probabilities such as 1/2,1/3,1/6; may be repeated (default: fair:3)",
    )
    parser.add_argument(
        "--fill", choices=("correspondence", "quadratic"), help="only this one (default: both)"
    )
    parser.add_argument(
        "--quick", action="store_true", help="one shape and short searches, in less than a minute"
    )
    add_json_option(parser)
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    import torch

    from dicedesign.bench.concave import attempt_concave
    from dicedesign.bench.machine import machine_description

    # As `dicedesign run` does.
    torch.set_num_threads(1)
    cases = _cases(options)
    rows = []
    if not options.json:
        print_row(_heading())
    with progress_bar("steps") as bar:

        def on_step(step: ConcaveStep) -> None:
            bar.update()
            bar.set_postfix_str(f"attempt {step.attempt}, {step.stage}")

        for number, case in enumerate(cases, start=1):
            bar.set_description_str(
                f"{number} of {len(cases)}: {case.model}, {case.target}, {case.fill}"
            )
            rows.append(attempt_concave(case, on_step))
            if not options.json:
                print_row(_row(rows[-1]))
    if options.json:
        described = machine_description(
            "numpy", "scipy", "torch", "clarabel", "fast-simplification"
        )
        print(json_text({**described, "rows": [row.plain() for row in rows]}))
    else:
        print_row("\n".join(["", KEY, *_verdict(rows)]))
    return 0 if all(row.met for row in rows if row.fill == "correspondence") else 1


def _cases(options: argparse.Namespace) -> list[ConcaveCase]:
    """All cases; a file that is not there, or a target that is none, is said at once."""
    from dicedesign.bench.concave import FILLS, FULL, QUICK, concave_cases

    for path in options.meshes:
        if not path.is_file():
            raise InputError(f"{path}: expected a mesh file, got none; check the path")
    targets = {text: _target(text) for text in options.targets or ["fair:3"]}
    fills = FILLS if options.fill is None else (options.fill,)
    try:
        return concave_cases(options.meshes, targets, QUICK if options.quick else FULL, fills)
    except RecipeError as error:
        raise RecipeError(f"--target {error}") from error


def _target(text: str) -> dict[str, Any]:
    """`target` of a recipe, out of an argument of `--target`."""
    kind, colon, count = text.partition(":")
    if colon == "":
        return {"probabilities": [part.strip() for part in text.split(",")]}
    if kind != "fair" or not count.isdecimal():
        raise InputError(
            f"--target: expected fair:K or probabilities, got {text!r}; write it such as fair:3 or "
            "1/2,1/3,1/6"
        )
    return {"fair": int(count)}


def _verdict(rows: Sequence[ConcaveRow]) -> Iterator[str]:
    """A line for each fill: how many dice have the wanted odds and do not meet themselves, and
    which have not."""
    for fill in dict.fromkeys(row.fill for row in rows):
        mine = [row for row in rows if row.fill == fill]
        others = [f"{row.model}, {row.target}" for row in mine if not row.met]
        text = f"by {fill}: {len(mine) - len(others)} of {len(mine)} as wanted"
        if others:
            text += f"; beyond {mine[0].tolerance:g}, or meeting itself: {'; '.join(others)}"
        yield text


def _heading() -> str:
    return _line(
        "model",
        "target",
        "fill",
        "points",
        "s",
        "MB",
        "|p - q|",
        "elsewhere",
        "gap",
        "meet",
        "mean %",
        "most %",
        "shape",
        "size",
        "corners",
        "tried",
    )


def _row(row: ConcaveRow) -> str:
    found = row.figures
    measured = ("-",) * 10
    if found is not None:
        measured = (
            f"{found.error:.1e}",
            f"{found.elsewhere:.1e}",
            f"{found.gap:.1e}",
            str(found.intersections),
            f"{100.0 * found.mean_displacement:.2f}",
            f"{100.0 * found.largest_displacement:.1f}",
            f"{found.shape_distortion:.2f}",
            f"{found.size_distortion:.2f}",
            f"{found.corners_before}/{found.corners_after}",
            str(found.attempts),
        )
    line = _line(
        row.model,
        row.target,
        row.fill,
        "-" if row.points is None else str(row.points),
        f"{row.seconds:.1f}",
        "-" if row.peak_mb is None else f"{row.peak_mb:.0f}",
        *measured,
    )
    return f"{line}  {row.note}".rstrip()


def _line(model: str, target: str, fill: str, *cells: str) -> str:
    values = "".join(f"{cell:>{width}}" for cell, width in zip(cells, WIDTHS, strict=True))
    return f"{model:<{NAME_WIDTH}} {target:<{TARGET_WIDTH}} {fill:<{FILL_WIDTH}}{values}"
