"""Pages of the documentation and their code blocks."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from common.paths import ROOT

PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "CHANGELOG.md",
    *sorted((ROOT / "docs").glob("*.md")),
]


def blocks(page: Path, language: str) -> list[str]:
    """Fenced code blocks of a language in a page."""
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def commands(page: Path) -> list[str]:
    """Shell commands in a page."""
    return [line for block in blocks(page, "sh") for line in block.splitlines()]


RUN_PARTS = """
import contextlib, io, json, sys, traceback

outputs = {}
for name, code in json.load(sys.stdin).items():
    output = io.StringIO()
    try:
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(io.StringIO()):
            exec(compile(code, name, "exec"), {"__name__": "__main__"})
        outputs[name] = output.getvalue()
    except BaseException:
        outputs[name] = None
        sys.stderr.write(f"\\n{name}:\\n{traceback.format_exc()}")
json.dump(outputs, sys.stdout)
"""


OF_TORCH = "ignore:`torch.jit.script` is deprecated:DeprecationWarning"
"""Torch warns about its own code at the first forward derivative."""


def run_parts(parts: Mapping[str, str], folder: Path) -> dict[str, str]:
    """Run pieces of Python in one new process, and return what each prints.

    One process imports torch only once. Warnings are errors.
    """
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    done = subprocess.run(
        [sys.executable, "-W", "error", "-W", OF_TORCH, "-c", RUN_PARTS],
        input=json.dumps(dict(parts)),
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    outputs: dict[str, str] = json.loads(done.stdout)
    return outputs
