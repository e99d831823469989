"""Kill commands just before they write a file."""

from __future__ import annotations

import os
import subprocess
import sys

SCRIPT = """
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
        [sys.executable, "-c", SCRIPT, str(count), *arguments],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        try:
            assert b"about to write\n" in process.stdout
        finally:
            process.kill()
