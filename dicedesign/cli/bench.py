"""`dicedesign bench`: measurements of the product itself."""

from __future__ import annotations

from typing import Any

from dicedesign.cli.benches import (
    accuracy,
    concave,
    design,
    exact,
    gradients,
    lean,
    momentum,
    speed,
    stability,
    table,
    thrown,
)

__all__ = ["add_parser"]


def add_parser(commands: Any) -> None:
    """Add the subcommand and its own subcommands to argparse's `commands`."""
    parser = commands.add_parser(
        "bench",
        help="measure the product itself",
        description="Measure the product itself.",
    )
    benches = parser.add_subparsers(title="benches", required=True, metavar="BENCH")
    for module in (
        accuracy,
        concave,
        design,
        exact,
        gradients,
        lean,
        momentum,
        speed,
        stability,
        table,
        thrown,
    ):
        module.add_parser(benches)
