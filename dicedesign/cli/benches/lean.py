"""`dicedesign bench lean`: what each feature costs, and what leaving it out saves."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from dicedesign.cli.benches.reporting import add_json_option, json_text, print_row, progress_bar

if TYPE_CHECKING:
    from dicedesign.bench.measures.feature_costs import Row

__all__ = ["add_parser"]

FEATURE_WIDTH = 48

QUANTITY_WIDTH = 48


def add_parser(benches: Any) -> None:
    """Add the bench to argparse's `benches`."""
    parser = benches.add_parser(
        "lean",
        help="what each feature costs, and what leaving it out saves",
        description="Measure what each feature costs that a query or a design can do without, in "
        "about half a minute. Seconds are processor time, medians of several repetitions; memory "
        "is the peak of a new process, libraries included.",
    )
    add_json_option(parser)
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    import torch

    from dicedesign.bench.lean import run_lean
    from dicedesign.bench.machine import machine_description

    # As `dicedesign run` does.
    torch.set_num_threads(1)
    rows = []
    with progress_bar("rows") as bar:
        if not options.json:
            print_row(_line("feature", "measured", "without", "with", "", "ratio"))
        for row in run_lean(on_group=bar.set_description_str):
            bar.update()
            rows.append(row.plain())
            if not options.json:
                print_row(_table_row(row))
    if options.json:
        print(json_text({**machine_description("numpy", "scipy", "torch"), "rows": rows}))
    return 0


def _table_row(row: Row) -> str:
    without, included = (f"{value:.4g}" for value in (row.without, row.included))
    ratio = "-" if row.ratio is None else f"{row.ratio:.2f}"
    return _line(row.feature, row.quantity, without, included, row.unit, ratio)


def _line(feature: str, quantity: str, *cells: str) -> str:
    without, included, unit, ratio = cells
    return (
        f"{feature:<{FEATURE_WIDTH}}{quantity:<{QUANTITY_WIDTH}}"
        f"{without:>9}{included:>9} {unit:<6}{ratio:>7}"
    )
