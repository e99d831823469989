"""`dicedesign table`: tables of throw parameters."""

from __future__ import annotations

from typing import Any

from dicedesign.cli.tables import table_fit, table_probe

__all__ = ["add_parser"]


def add_parser(commands: Any) -> None:
    """Add the subcommand and its own subcommands to argparse's `commands`."""
    parser = commands.add_parser(
        "table",
        help="fit a table's throw parameters or its momentum model",
        description="Tables of throw parameters.",
    )
    actions = parser.add_subparsers(title="actions", required=True, metavar="ACTION")
    table_fit.add_action(actions)
    table_probe.add_action(actions)
