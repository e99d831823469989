"""`dicedesign view`: a page in the browser on which bodies are dragged and dice designed."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

__all__ = ["add_parser"]


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
    parser = commands.add_parser(
        "view",
        help="look at a body or a die in the browser, drag it, design one",
        description="Open a page in the browser: the body, its hull, where it comes to rest and "
        "how often. Drag the center of mass, a corner or a facet, and all of it follows. Needs the "
        "extra 'view'. Ends with Ctrl-C.",
    )
    parser.add_argument(
        "path",
        type=Path,
        nargs="?",
        metavar="MESH|RECIPE|FOLDER",
        help="a mesh; a recipe, which is designed; the folder of a finished die, or one of meshes "
        "(default: a page on which to design a die)",
    )
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="who can open the page: 127.0.0.1, this machine alone; 0.0.0.0, every machine that "
        "reaches it and knows the address, which then has a secret word (default: 127.0.0.1)",
    )
    parser.add_argument(
        "--port",
        type=int,
        default=8080,
        metavar="N",
        help="port of the page, 0 for any that is free (default: 8080)",
    )
    parser.add_argument(
        "--no-browser", action="store_true", help="print the address and open no browser"
    )
    parser.set_defaults(command=_view)


def _view(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.view.application import serve_view

    def told(address: str) -> None:
        print(address, flush=True)

    serve_view(options.path, options.host, options.port, browser=not options.no_browser, told=told)
    return 0
