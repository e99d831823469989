"""A run of many files that is there to be ended early."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from dicedesign.batch.rest_table import RestTable

FILES = 3000
"""How many the run has beside those of the folder, named by four digits."""

SCRIPT = (
    "import sys; from dicedesign.runtime import checkpoint;"
    "checkpoint.INTERVAL = 0.1; checkpoint.SHARE = 1.0;"
    "from dicedesign.cli.main import main; sys.exit(main(sys.argv[1:]))"
)
"""The command line, with tables that are written often."""


def begun(meshes: Path, out: Path, **options: Any) -> tuple[subprocess.Popen[str], list[str]]:
    """A process that has written some rows of the table, and its arguments after the program's
    name; options are those of `Popen`."""
    box = (meshes / "b" / "box.obj").read_bytes()
    for i in range(FILES):
        (meshes / f"{i:04d}.obj").write_bytes(box)
    rest = ["rest", str(meshes), "--jobs", "1", "--out", str(out)]
    command = [sys.executable, "-c", SCRIPT, *rest]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, **options)
    deadline = time.monotonic() + 60.0
    while not (out.exists() and RestTable.read(out)):
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.02)
    return process, rest


def shorten(meshes: Path) -> None:
    """Leave 100 of the files that the run has beside those of the folder."""
    for path in sorted(meshes.glob("[0-9]*.obj"))[100:]:
        path.unlink()
