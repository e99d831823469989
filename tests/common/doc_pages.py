"""The pages of the documentation, and the code in them."""

from __future__ import annotations

import ast
import inspect
import os
import re
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import dicedesign
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


def run_python(code: str, folder: Path) -> str:
    """What code prints that runs in a process of its own, warnings being errors."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return done.stdout


def not_there_yet(code: str) -> list[str]:
    """Names of the package that code uses and that are not there."""
    missing = []
    if ".save(" in code and find_spec("dicedesign.fabricate.files") is None:
        missing.append("Die.save")
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.value.id == "dd" and not is_public(node.attr):
                missing.append(f"dd.{node.attr}")
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("dicedesign."):
            try:
                module = import_module(node.module or "")
            except ModuleNotFoundError:
                missing.append(node.module or "")
            else:
                missing += [
                    entry.name
                    for entry in node.names
                    if not hasattr(module, entry.name)
                    or (entry.name == "ENGINES" and not hasattr(module.ENGINES, "register"))
                ]
    return sorted(set(missing))


def is_public(name: str) -> bool:
    """Whether the package has a name, as these pages tell of it."""
    if name == "roll":
        return next(iter(inspect.signature(dicedesign.roll).parameters)) != "equilibria"
    if name == "design":
        # Also the name of a folder of the package.
        import_module("dicedesign.optimize.targets")
        return callable(dicedesign.design)
    return name in dicedesign.__all__
