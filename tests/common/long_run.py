"""Long run over many files, for tests that end it early."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from dicedesign.batch.rest_table import RestTable

FILES = 3000
"""Number of additional files, named by four digits."""

SCRIPT = (
    "import sys; from dicedesign.runtime import checkpoint;"
    "checkpoint.INTERVAL = 0.1; checkpoint.SHARE = 1.0;"
    "from dicedesign.cli.main import main; sys.exit(main(sys.argv[1:]))"
)
"""Program that runs a command and writes its table often."""


def start_run(meshes: Path, out: Path, **options: Any) -> tuple[subprocess.Popen[str], list[str]]:
    """Start a run and wait for the first rows of its table.

    options: options of `Popen`. Returns the process, and its arguments without the program.
    """
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
    """Delete all but 100 of the additional files."""
    for path in sorted(meshes.glob("[0-9]*.obj"))[100:]:
        path.unlink()
