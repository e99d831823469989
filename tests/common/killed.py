"""Commands that are killed as they are about to write."""

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

def replaced(*arguments):
    global left
    left -= 1
    if left == 0:
        os.write(1, b"about to write\\n")
        signal.pause()
    replace(*arguments)

os.replace = replaced
sys.exit(main(sys.argv[2:]))
"""
"""A command in one process, whose states of work are all written."""


def kill_at_write(arguments: list[str], count: int) -> None:
    """Run a command, and kill it when it has written all of a file for the time of that number, but
    not yet given the file its name. Whoever is killed anywhere leaves what is left here, with the
    count of the next file to come."""
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
