"""`dicedesign figure`: the paper's kinds of figures, of any body."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Final

from dicedesign.cli.bodies.body import add_rest_options, center_of_mass
from dicedesign.cli.options import vector
from dicedesign.errors import InputError
from dicedesign.runtime.checks import check_whole
from dicedesign.runtime.files import atomic_write
from dicedesign.runtime.text import printable
from dicedesign.runtime.workers import progress_bar

__all__ = ["add_parser"]

ENDING: Final = ".png"


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
    parser = commands.add_parser(
        "figure",
        help="draw one of the paper's kinds of figures of a mesh, a finished die or a recipe",
        description="Draw one of the paper's kinds of figures of any body. Kinds: " + _kinds(),
    )
    parser.add_argument("kind", metavar="KIND", help="one of these")
    parser.add_argument(
        "subject",
        type=Path,
        metavar="INPUT",
        help="a mesh file, a folder that `dicedesign run` left, or a recipe, whose die is designed",
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE.png", help="the picture (default: INPUT_KIND.png, here)"
    )
    parser.add_argument(
        "--down",
        metavar="x,y,z",
        help="of paths and drop: direction in the body's frame that points down at first",
    )
    parser.add_argument(
        "--before", type=Path, metavar="MESH", help="of before_after: what the body was made from"
    )
    parser.add_argument("--steps", type=int, metavar="N", help="of ablation: most of each descent")
    add_rest_options(parser)
    parser.set_defaults(command=_figure)


def _kinds() -> str:
    # Imported where the help is made, which a command that is run does not need otherwise.
    from dicedesign.report.body_figures.body_figure import BODY_FIGURES

    return "; ".join(f"{figure.name}: {figure.line}" for figure in BODY_FIGURES) + "."


def _figure(options: argparse.Namespace) -> int:
    from dicedesign.recipe.subjects import subject_of
    from dicedesign.report.body_figures.body_figure import BODY_FIGURES

    figure = BODY_FIGURES[options.kind]
    for name, kinds in (
        ("down", ("paths", "drop")),
        ("before", ("before_after",)),
        ("steps", ("ablation",)),
    ):
        if getattr(options, name) is not None and options.kind not in kinds:
            raise InputError(
                f"--{name}: expected with {' or '.join(kinds)}, got {options.kind}; leave it out"
            )
    if options.steps is not None:
        check_whole("--steps", options.steps)
    out = options.out
    if out is None:
        out = Path(f"{options.subject.resolve().stem}_{options.kind}{ENDING}")
    if out.suffix.lower() != ENDING:
        raise InputError(f"--out: expected a path that ends in {ENDING}, got {out}; rename it")
    down = None if options.down is None else vector("--down", options.down)
    with progress_bar("steps") as bar:
        subject = subject_of(
            options.subject,
            center_of_mass=center_of_mass(options.com),
            coplanar_tolerance=options.coplanar_tolerance,
            down=down,
            before=options.before,
            steps=options.steps,
            on_step=lambda: bar.update(1),
        )
        data = figure.draw(subject).png()
    atomic_write(out, data)
    print(f"files: {printable(out)}")
    return 0
