"""`dicedesign bench momentum`: the momentum model against simulated throws of unseen dice."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.benches.reporting import (
    add_json_option,
    json_text,
    print_row,
    require_figure_folder,
)
from dicedesign.cli.options import (
    add_engine_option,
    add_worker_options,
    check_worker_options,
    workers_of,
)
from dicedesign.errors import InputError

if TYPE_CHECKING:
    from dicedesign.bench.momentum import Extent, ModelTimes, PrintedDie
    from dicedesign.learning.random_throws import Deviation, Deviations
    from dicedesign.throws.counts.throw_counts import CountedDie
    from dicedesign.throws.momentum.momentum_model import MomentumModel
    from dicedesign.throws.tables import Table

__all__ = ["add_parser"]

KEY = """\
floor: what right odds would show at these numbers of drops or throws, on the mean. Seconds are
processor time; those of the Jacobian include the Jacobian of the odds without momentum."""


def add_parser(benches: Any) -> None:
    """Add the bench to argparse's `benches`."""
    parser = benches.add_parser(
        "momentum",
        help="the momentum model against simulated throws of dice that it was not fitted to",
        description="Throw random dice with 7 to 13 rests onto a table, and compare how often each "
        "rest comes up with its odds without momentum and by the table's momentum model. Dice are "
        "drawn as `dicedesign table learn` draws them, but from another seed: three quarters are "
        "random polyhedra (half-spaces facing all ways, such ones stretched, hulls of points, and "
        "prisms, bipyramids, boxes and Platonic solids with their facets or corners moved), every "
        "eighth of them with its center of mass beside the centroid; a quarter are designed "
        "exactly for random odds, some with a symmetry.",
    )
    parser.add_argument(
        "--table",
        default="board-game",
        metavar="NAME|FILE.json",
        help="with a momentum model (default: board-game)",
    )
    parser.add_argument(
        "--dice", type=int, metavar="N", help="how many (default: 50, or 12 with --quick)"
    )
    parser.add_argument(
        "--drops",
        type=int,
        metavar="N",
        help="of each random and each printed die (default: 20000, or 1000 with --quick)",
    )
    add_engine_option(parser)
    parser.add_argument(
        "--throws",
        type=Path,
        metavar="CSV",
        help="also compare with throws of printed dice, a file as of `dicedesign table fit`",
    )
    parser.add_argument(
        "--printed", metavar="NAME,...", help="these dice of the file only (default: all)"
    )
    parser.add_argument(
        "--quick", action="store_true", help="few dice and few drops, in less than a minute"
    )
    parser.add_argument("--figure", type=Path, metavar="FILE.png", help="draw bars for each die")
    add_worker_options(parser, "dice at a time (default: one for each core)")
    add_json_option(parser)
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    import torch

    from dicedesign.bench.machine import machine_description
    from dicedesign.bench.momentum import (
        by_kind,
        deviation_figure,
        judge_printed_die,
        model_times,
        throw_unseen_dice,
    )
    from dicedesign.gradient.thrown_odds import ThrownOdds
    from dicedesign.learning.random_throws import deviation
    from dicedesign.throws.tables import table_named

    check_worker_options(options)
    require_figure_folder(options.figure)
    extent = _extent(options)
    table, model = table_named(options.table), _model(options.table)
    printed = _printed(options)
    # As `dicedesign run` does.
    torch.set_num_threads(1)
    with workers_of(options, "dice", extent.dice + len(printed)) as workers:
        thrown = []
        for one in throw_unseen_dice(extent, table, options.engine, workers.executor):
            thrown.append(one)
            workers.advance(1)
        judged = []
        for die in printed:
            judged.append(
                judge_printed_die(die, table, model, extent.drops, options.engine, workers.executor)
            )
            workers.advance(1)
    found = [deviation(one, model) for one in thrown]
    kinds = dict(by_kind(found))
    unresolved = sum(one.unresolved for one in thrown)
    times = model_times([one.die for one in thrown], model, ThrownOdds.on(options.table))
    if options.json:
        record = {
            **machine_description("numpy", "torch", "mujoco", "pybullet"),
            "table": table.as_dict(),
            "engine": options.engine,
            **asdict(extent),
            "unresolved": unresolved,
            "kinds": {kind: asdict(part) for kind, part in kinds.items()},
            "seconds": asdict(times),
            "random_dice": [asdict(one) for one in found],
            "printed_dice": [_plain(die) for die in judged],
        }
        print(json_text(record))
    else:
        _print_kinds(kinds, extent, table, options.engine)
        _print_times(times, found)
        if unresolved:
            print_row(f"{unresolved} drops came to no rest")
        _print_printed(judged)
        print_row(f"\n{KEY}")
    if options.figure is not None:
        from dicedesign.report.charts.png import png_bytes
        from dicedesign.runtime.files import atomic_write

        figure = deviation_figure(found, table.name, extent.drops)
        atomic_write(options.figure, png_bytes(figure))
        print(f"wrote {options.figure}", file=sys.stderr if options.json else sys.stdout)
    return 0


def _extent(options: argparse.Namespace) -> Extent:
    from dicedesign.bench.momentum import FULL, QUICK, Extent
    from dicedesign.throws.simulation.simulation import check_throws

    usual = QUICK if options.quick else FULL
    dice = usual.dice if options.dice is None else options.dice
    drops = usual.drops if options.drops is None else options.drops
    if dice < 1:
        raise InputError(f"--dice: expected a whole number above 0, got {dice}; raise it")
    check_throws(drops, 0, options.engine, "uniform")
    return Extent(dice, drops)


def _printed(options: argparse.Namespace) -> tuple[CountedDie, ...]:
    from dicedesign.throws.counts.throw_counts import read_throw_counts

    if options.throws is None:
        if options.printed is not None:
            raise InputError(
                f"--printed {options.printed}: expected the file of their throws beside it, got "
                "none; add --throws"
            )
        return ()
    wanted = options.printed and [name.strip() for name in options.printed.split(",")]
    return read_throw_counts(options.throws, wanted)


def _model(table: str) -> MomentumModel:
    from dicedesign.throws.momentum.momentum_model import momentum_model

    model = momentum_model(table)
    if model is None:
        raise InputError(
            f"--table {table}: expected a table on which dice have momentum, got one with drag; "
            "take another, such as board-game"
        )
    return model


def _print_kinds(kinds: dict[str, Deviations], extent: Extent, table: Table, engine: str) -> None:
    from dicedesign.bench.momentum import GOAL

    print_row(
        f"total variation to {extent.drops} drops of each die in the simulator {engine} onto "
        f"{table.name} (goal: {GOAL:g} on the mean)\n"
        f"{'':<23}  dice  {'geometric':>9}  {'worst':>6}  {'momentum':>8}  {'worst':>6}   floor"
    )
    for kind, part in kinds.items():
        print_row(
            f"{kind:<23}  {part.dice:>4}  {part.geometric:>9.4f}  {part.worst_geometric:>6.3f}  "
            f"{part.momentum:>8.4f}  {part.worst_momentum:>6.3f}  {part.noise_floor:>6.4f}"
        )


def _print_times(times: ModelTimes, found: Sequence[Deviation]) -> None:
    rests = sorted(one.rests for one in found)[len(found) // 2]
    print_row(
        f"medians for a die whose Morse complex is known, of {rests} rests: odds "
        f"{1e3 * times.odds:.3f} ms, Jacobian {1e3 * times.jacobian:.3f} ms"
    )


def _print_printed(judged: Sequence[PrintedDie]) -> None:
    for number, die in enumerate(judged):
        if number == 0:
            print_row(
                f"\n{'printed die':<23}  throws  {'odds':<9}  {'chi-square':>10}  degrees  "
                f"{'p':<7}  total variation   floor"
            )
        for model in die.models:
            first = model is die.models[0]
            print_row(
                f"{die.name if first else '':<23}  {die.throws if first else '':>6}  "
                f"{model.model:<9}  {model.test.statistic:>10.2f}  {model.test.degrees:>7}  "
                f"{model.test.p_value:<7.2g}  {model.total_variation:>15.4f}  "
                f"{model.noise_floor:>6.4f}"
            )
        if die.unresolved:
            print_row(f"{'':<33}{die.unresolved} of {die.drops} drops came to no rest")


def _plain(die: PrintedDie) -> dict[str, Any]:
    models = [model.plain() for model in die.models]
    return {**vars(die), "models": models}
