"""`dicedesign bench stability`: stiff and extreme bodies against exact answers."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from dicedesign.cli.benches.reporting import add_json_option, json_text, print_row, progress_bar
from dicedesign.errors import InputError

if TYPE_CHECKING:
    from dicedesign.bench.stability import Row

__all__ = ["add_parser"]

NAME_WIDTH = 44


def add_parser(benches: Any) -> None:
    """Add the bench to argparse's `benches`."""
    parser = benches.add_parser(
        "stability",
        help="stiff and extreme bodies against exact answers",
        description="Ask for the rests of stiff and extreme bodies and compare with 60-digit "
        "arithmetic, closed forms and symmetries. Exit code 0 if every verdict is ok, else 1.",
    )
    parser.add_argument("--quick", action="store_true", help="only a part, in about 30 seconds")
    parser.add_argument(
        "--largest", type=int, metavar="N", help="leave out bodies of more than N points"
    )
    add_json_option(parser)
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    from dicedesign.bench.machine import machine_description
    from dicedesign.bench.stability import OK, run_stability

    if options.largest is not None and options.largest < 0:
        raise InputError(f"--largest: expected at least 0, got {options.largest}; give more")
    rows = []
    with progress_bar("cases") as bar:
        if not options.json:
            print_row(
                _line("case", "facets", "rests", "sum - 1", "error", "condition", "s", "verdict")
            )
        for row in run_stability(
            quick=options.quick, largest=options.largest, on_case=bar.set_description_str
        ):
            bar.update()
            rows.append(row)
            if not options.json:
                print_row(_table_row(row))
    failed = sum(row.verdict != OK for row in rows)
    if options.json:
        described = machine_description("numpy", "scipy", "torch", "mpmath")
        print(json_text({**described, "rows": [asdict(row) for row in rows]}))
    else:
        print(f"{len(rows)} cases, {len(rows) - failed} ok, {failed} not")
    return 0 if failed == 0 else 1


def _table_row(row: Row) -> str:
    return _line(
        row.name,
        str(row.size),
        str(row.rests),
        f"{row.excess:.1e}",
        "-" if row.error is None else f"{row.error:.1e}",
        f"{row.condition:.1e}",
        f"{row.seconds:.4f}",
        row.verdict + "".join(f" ({note})" for note in ("tied" * row.tied, row.ending) if note),
    )


def _line(name: str, *values: str) -> str:
    widths = (7, 7, 9, 9, 10, 9)
    cells = "".join(f"{value:>{width}}" for value, width in zip(values[:-1], widths, strict=True))
    return f"{name:<{NAME_WIDTH}}{cells}  {values[-1]}"
