"""The pages of the documentation, and the code in them."""

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
    """The fenced blocks of a language in a page."""
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def commands(page: Path) -> list[str]:
    """The lines of a page that are typed into a shell."""
    return [line for block in blocks(page, "sh") for line in block.splitlines()]


RUN_PARTS = """
import contextlib, io, json, sys, traceback

told = {}
for name, code in json.load(sys.stdin).items():
    shown = io.StringIO()
    try:
        with contextlib.redirect_stdout(shown), contextlib.redirect_stderr(io.StringIO()):
            exec(compile(code, name, "exec"), {"__name__": "__main__"})
        told[name] = shown.getvalue()
    except BaseException:
        told[name] = None
        sys.stderr.write(f"\\n{name}:\\n{traceback.format_exc()}")
json.dump(told, sys.stdout)
"""


OF_TORCH = "ignore:`torch.jit.script` is deprecated:DeprecationWarning"
"""Torch warns of itself where derivatives are first taken forward."""


def run_parts(parts: Mapping[str, str], folder: Path) -> dict[str, str]:
    """What pieces of Python print that run one after the other in one new process, which imports
    torch once; warnings are errors."""
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
    told: dict[str, str] = json.loads(done.stdout)
    return told
