"""`dicedesign bench exact`: the exact method on random targets."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from dicedesign.commands.benches.reporting import (
    add_json_option,
    json_text,
    print_row,
    progress_bar,
    require_positive_seconds,
)
from dicedesign.errors import InputError

if TYPE_CHECKING:
    from dicedesign.bench.exact_targets import Attempt, Summary

__all__ = ["add_parser"]

WIDTHS = (8, 9, 8, 11, 16, 17, 16)


def add_parser(benches: Any) -> None:
    """Add the bench to argparse's `benches`."""
    parser = benches.add_parser(
        "exact",
        help="the exact method on random targets, beside descent in the same time",
        description="Design dice for random targets of 4 to 12 outcomes, the smallest at least "
        "0.01, by the exact method from searched shapes, and by descent in the same time. A target "
        "is solved when the forward model finds one rest for each outcome and no other, and odds "
        "within 1e-12. Seconds are wall-clock time; a first target is solved uncounted, since "
        "torch's batched backward pass takes longer at its first use in a process.",
    )
    parser.add_argument(
        "--targets", type=int, default=200, metavar="N", help="how many targets (default: 200)"
    )
    parser.add_argument(
        "--seconds",
        type=float,
        default=10.0,
        metavar="S",
        help="limit of the exact method for each target (default: 10)",
    )
    add_json_option(parser)
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    if options.targets < 1:
        raise InputError(f"--targets: expected at least 1, got {options.targets}; give more")
    require_positive_seconds(options.seconds)

    import torch

    from dicedesign.bench.exact_targets import STARTS, run_targets, summaries
    from dicedesign.bench.machine import machine_description

    # As `dicedesign run` does.
    torch.set_num_threads(1)
    attempts = []
    with progress_bar("targets") as bar:
        bar.reset(total=options.targets)
        for attempt in run_targets(options.targets, options.seconds, bar.set_description_str):
            bar.update()
            attempts.append(attempt)
    rows = summaries(attempts)
    if options.json:
        record = {
            **machine_description("numpy", "scipy", "torch"),
            "limit_seconds": options.seconds,
            "limit_starts": STARTS,
            "rows": [asdict(row) for row in rows],
            "targets": [attempt.plain() for attempt in attempts],
        }
        print(json_text(record))
        return 0
    print_row(
        _line(
            "outcomes", "targets", "solved", "median s", "worst solved s", "median descent", "worst"
        )
    )
    for row in rows:
        print_row(_table_row(row))
    for attempt in attempts:
        if not attempt.solved:
            print_row(_unsolved(attempt))
    return 0


def _table_row(row: Summary) -> str:
    return _line(
        "all" if row.outcomes is None else str(row.outcomes),
        str(row.targets),
        str(row.solved),
        f"{row.median_seconds:.3f}",
        f"{row.worst_seconds:.3f}" if row.solved else "-",
        f"{row.median_descent_error:.1e}",
        f"{row.worst_descent_error:.1e}",
    )


def _unsolved(attempt: Attempt) -> str:
    wanted = ", ".join(f"{probability:.4f}" for probability in attempt.target)
    return (
        f"not solved: target {attempt.number} ({wanted}), error {attempt.error:.1e} with "
        f"{attempt.rests} rests after {attempt.seconds:.1f} s, {attempt.status}"
    )


def _line(*cells: str) -> str:
    return "".join(f"{cell:>{width}}" for cell, width in zip(cells, WIDTHS, strict=True))
