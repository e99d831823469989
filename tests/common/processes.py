"""Processes of commands that are ended early."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from dicedesign.batch.rest_table import RestTable


def heed_interrupts() -> None:
    """Restore interrupts in a child process; background processes of a shell ignore them."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


KILLED = """
import os, signal, sys
from contextlib import nullcontext
from common.inline_executor import Inline
from dicedesign.cli.main import main
from dicedesign.runtime import checkpoint, workers

workers.local_workers = lambda jobs: nullcontext(Inline())
checkpoint.AutosavedFile.is_due = True
replace, left = os.replace, int(sys.argv[1])

def replace_or_wait(*arguments):
    global left
    left -= 1
    if left == 0:
        os.write(1, b"about to write\\n")
        signal.pause()
    replace(*arguments)

os.replace = replace_or_wait
sys.exit(main(sys.argv[2:]))
"""
"""Program that runs a command in one process and writes every checkpoint."""


def kill_at_write(arguments: list[str], count: int) -> None:
    """Run a command and kill it before it renames its temporary file number `count`.

    A command killed at any moment leaves the same files as for some count.
    """
    with subprocess.Popen(
        [sys.executable, "-c", KILLED, str(count), *arguments],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        try:
            assert b"about to write\n" in process.stdout
        finally:
            process.kill()


# A long run over many files.

FILES = 3000
"""Number of additional files, named by four digits."""

LONG = """
import sys
from dicedesign.runtime import checkpoint
checkpoint.INTERVAL = 0.1
checkpoint.SHARE = 1.0
from dicedesign.cli.main import main
sys.exit(main(sys.argv[1:]))
"""
"""Program that runs a command and writes its table often."""


def start_run(meshes: Path, out: Path, **options: Any) -> tuple[subprocess.Popen[str], list[str]]:
    """Start a run and wait for the first rows of its table.

    options: options of `Popen`. Returns the process, and its arguments without the program.
    """
    box = (meshes / "b" / "box.obj").read_bytes()
    for i in range(FILES):
        (meshes / f"{i:04d}.obj").write_bytes(box)
    rest = ["rest", str(meshes), "--jobs", "1", "--out", str(out)]
    command = [sys.executable, "-c", LONG, *rest]
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
