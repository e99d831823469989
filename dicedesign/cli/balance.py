"""`dicedesign balance`: the center of mass that serves a goal best, made so that it can be
printed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dicedesign.cli.options import add_json_option, add_value, direction, print_json, vector
from dicedesign.errors import InputError
from dicedesign.runtime.files import atomic_write, json_text, make_writable_folder
from dicedesign.runtime.text import printable, text_table

if TYPE_CHECKING:
    from dicedesign.balance.balanced import Balanced
    from dicedesign.balance.goals import Goal

__all__ = ["add_parser"]

NAME: Final = "balanced.stl"
"""Of the body in a folder."""


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
    parser = commands.add_parser(
        "balance",
        help="move the center of mass of a mesh until it rests as is wanted",
        description="Find the center of mass with which a mesh rests as is wanted, and put it "
        "there: by a cavity, or by two densities of infill. The outside stays as it is. The files "
        "are read back and judged; 0 where the goal is reached, 1 where it is not and the best is "
        "written.",
    )
    add_value(parser, "mesh", "MESH", "closed surface of one solid: STL, OBJ, ...", Path)
    goals = parser.add_mutually_exclusive_group(required=True)
    add_value(goals, "--equal", "N", "equal odds of the N most probable poses", int)
    add_value(
        goals,
        "--stand",
        "K",
        "the largest odds of pose K, numbered from 1 as `dicedesign rest` lists them",
        int,
    )
    add_value(
        goals,
        "--stand-down",
        "x,y,z",
        "the same of the pose in which this direction of the mesh points down",
    )
    goals.add_argument("--fewest", action="store_true", help="as few resting poses as can be")
    add_value(
        goals,
        "--target",
        "p,q,...",
        "these odds, fractions or decimals, for the most probable poses, or for --poses",
    )
    add_value(parser, "--poses", "K,L,...", "numbers of the poses that --target is for")
    add_value(
        parser,
        "--region",
        "hull|hollow|x,y,z,x,y,z",
        "where the center of mass may be: anywhere, where cavities can bring it, or in a box "
        "of a least and a largest corner in mm (default: hull)",
        default="hull",
    )
    add_value(
        parser, "--by", "cavity|infill", "how it gets there (default: by the first that does it)"
    )
    add_value(
        parser,
        "--size-mm",
        "X",
        "largest distance between two points (default: coordinates are in mm)",
        float,
    )
    add_value(parser, "--wall-mm", "W", "least thickness of walls (default: 1.2)", float)
    add_value(parser, "--drain-mm", "D", "drain the cavity by a hole of this diameter", float)
    add_value(parser, "--infill", "p,q", "two infills from 0 to 1 (default: 0.1,0.6)")
    add_value(parser, "--tolerance", "T", "largest difference of odds (default: 0.005)", float)
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="FILE.stl|FOLDER",
        help="where the body goes, with what belongs to it beside it",
    )
    add_json_option(parser)
    parser.set_defaults(command=_balance)


def _balance(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.balance.balanced import balanced
    from dicedesign.balance.options import BalanceOptions
    from dicedesign.geometry.meshes.reading import read_body

    goal = _goal(options)
    given: dict[str, Any] = {
        "by": options.by,
        "size_mm": options.size_mm,
        "wall_mm": options.wall_mm,
        "drain_mm": options.drain_mm,
        "infill": None if options.infill is None else _numbers("infill", options.infill),
        "tolerance": options.tolerance,
    }
    region = options.region
    wanted = BalanceOptions(
        region=_numbers("region", region) if "," in region else region,
        **{name: value for name, value in given.items() if value is not None},
    )
    file = _file(options.out)
    if file.exists() and options.mesh.exists() and file.samefile(options.mesh):
        raise InputError(
            f"--out: expected another file than the mesh, got {file}; the mesh is left as it is"
        )
    body = read_body(options.mesh)
    found = balanced(
        body, goal, wanted, on_way=lambda way: print(f"note: by {way} ...", file=sys.stderr)
    )
    files = list(_written(found, file))
    for note in found.notes:
        print(f"note: {printable(note)}", file=sys.stderr)
    if options.json:
        print_json({**found.data(), "files": [str(path) for path in files]})
    else:
        print("\n".join(_table(options.mesh, found)))
        print(f"files: {', '.join(printable(str(path)) for path in files)}")
    return 0 if found.reached else 1


def _goal(options: argparse.Namespace) -> Goal:
    from dicedesign.balance.goals import EqualOdds, FewestRests, GivenOdds, Standing

    if options.poses is not None and options.target is None:
        raise InputError("--poses: expected --target p,q,... with it, got none; add it")
    if options.equal is not None:
        return EqualOdds(options.equal)
    if options.stand is not None:
        return Standing(pose=options.stand)
    if options.stand_down is not None:
        return Standing(down=vector("--stand-down", options.stand_down))
    if options.fewest:
        return FewestRests()
    poses = None
    if options.poses is not None:
        poses = tuple(_whole(part) for part in options.poses.split(","))
    return GivenOdds(_numbers("target", options.target), poses)


def _numbers(option: str, text: str) -> tuple[float, ...]:
    """The numbers of a text, fractions or decimals."""
    from fractions import Fraction

    try:
        return tuple(float(Fraction(part.strip())) for part in text.split(","))
    except (ValueError, ZeroDivisionError, OverflowError) as error:
        raise InputError(
            f"--{option.replace('_', '-')}: expected numbers such as 0.5,1/4, got {text!r}; "
            "separate them by commas"
        ) from error


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError as error:
        raise InputError(
            f"--poses: expected numbers of poses such as 1,2, got {text!r}; dicedesign rest lists "
            "them"
        ) from error


def _file(out: Path) -> Path:
    """The file of the body."""
    if out.suffix.lower() == ".stl":
        return out
    if out.suffix and not out.is_dir():
        raise InputError(
            f"--out: expected a folder or a file that ends in .stl, got {out}; rename it"
        )
    make_writable_folder(out)
    return out / NAME


def _written(found: Balanced, file: Path) -> Iterator[Path]:
    from dicedesign.report.balance_figure import balance_figure

    contents = {
        file.with_name(file.stem + rest) if rest else file: data
        for rest, data in found.made.files.items()
    }
    contents[file.with_name(f"{file.stem}_balance.png")] = balance_figure(found).png()
    contents[file.with_name(f"{file.stem}_balance.json")] = json_text(found.data()).encode()
    for path, data in contents.items():
        atomic_write(path, data)
        yield path


def _table(mesh: Path, found: Balanced) -> Iterator[str]:
    """What was wanted, and what the files do."""
    wanted: list[float] | list[None] = [None] * len(found.odds)
    if found.wanted is not None:
        wanted = found.wanted.tolist()
    columns = [("pose", ">"), ("facet normal (down)", ""), ("before", ">"), ("goal", ">")]
    rows = []
    for number, normal, before, goal, odds in zip(
        found.numbers, found.directions, found.before, wanted, found.odds, strict=True
    ):
        rows.append(
            [
                "new" if number is None else str(number),
                direction(normal),
                _percent(before),
                "" if goal is None else _percent(goal),
                _percent(odds),
            ]
        )
    yield (
        f"{printable(mesh)}: {'reached' if found.reached else 'not reached'}, by {found.by}; "
        f"{found.rests_before} resting poses before, {found.rests} now"
    )
    places = [
        ("before", found.center_before),
        ("wanted", found.center_wanted),
        ("now", found.center),
    ]
    for name, place in places:
        yield f"center of mass {name:6}  {'  '.join(f'{x + 0.0:10.5f}' for x in place)} mm"
    if found.made.wall_mm is not None:
        yield f"walls of at least {found.made.wall_mm:.4g} mm"
    yield ""
    yield from text_table([*columns, ("now", ">")], rows)


def _percent(part: float) -> str:
    return f"{100.0 * part:.4f} %"
