"""Commands, Python code and recipes of all pages and the examples run, each in a folder with the
results of the README's first command."""

from __future__ import annotations

import io
import re
import runpy
import shlex
import shutil
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
from common.paths import PAGES, ROOT, blocks, commands

from dicedesign import extensions
from dicedesign.cli.main import main
from dicedesign.recipe.reading import read_recipe

LONG = (
    "search ",
    "view",
    "run recipes/fair_d3_duck.yaml",
    "run recipes/fair_d7_table.yaml",
    "run outputs/binomial_5_search/best.yaml",
)
"""Beginnings of commands that are only parsed here; `.ci/run` and other tests run them."""

FULL = (
    "set ",
    "sweep ",
    "balance ",
    "run ",
    "throw ",
    "README-python-1",
    "designers-yaml",
    "meshes-python-5",
    "researchers-python-3",
    "researchers-yaml-1",
    "tables-python-1",
    "tables-yaml-2",
    "add_figure",
    "design --target 1/2,1/3,1/6 --labels heads,tails,edge --name coin --printer",
    "mujoco_engine",
    "own_energy",
    "sweep",
)
"""Beginnings of names of slow parts whose subject other everyday tests judge."""

SHORTER = {"design ": " --no-figures", "run ": " --no-figures", "throw ": " --drops 500"}
"""Options added to commands."""

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))

LINES = [
    line.removeprefix("dicedesign ")
    for line in dict.fromkeys(line for page in PAGES for line in commands(page))
    if line.startswith("dicedesign ")
]
"""Commands of all pages, each once."""

# Torch warns about its own code at the first forward derivative.
pytestmark = pytest.mark.filterwarnings("ignore:`torch.jit.script` is deprecated")


def parts(names_and_texts: Iterable[tuple[str, Any]]) -> list[Any]:
    """Parameters with their names as ids; the slow ones run in `.ci/run` alone."""
    return [
        pytest.param(text, id=name, marks=[pytest.mark.full] if name.startswith(FULL) else [])
        for name, text in names_and_texts
    ]


def blocks_of(language: str) -> list[Any]:
    """Code blocks of all pages by page and number."""
    return parts(
        (f"{page.stem}-{language}-{number}", text)
        for page in PAGES
        for number, text in enumerate(blocks(page, language), start=1)
    )


@pytest.fixture(autouse=True)
def folder(
    convex_die: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> Iterator[Path]:
    """Working directory with the results of the README's first command; something is printed. One
    roll of 7 is typed."""
    shutil.copytree(ROOT / "recipes", tmp_path / "recipes")
    shutil.copytree(convex_die, tmp_path / "outputs" / "2d6_hendecahedron")
    (tmp_path / "rolls.csv").write_text(blocks(ROOT / "docs" / "tables.md", "csv")[0])
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.StringIO("7\n\n"))
    yield tmp_path
    assert capsys.readouterr().out


def run_command(line: str) -> int:
    added = "".join(text for start, text in SHORTER.items() if line.startswith(start))
    return main(shlex.split(line + added))


@pytest.mark.parametrize("line", parts((line, line) for line in LINES if not line.startswith(LONG)))
def test_commands_run(line: str) -> None:
    assert run_command(line) == 0


@pytest.mark.parametrize("code", blocks_of("python"))
def test_python_code_runs(code: str) -> None:
    exec(compile(code, "page", "exec"), {"__name__": "__main__"})


@pytest.mark.parametrize("text", blocks_of("yaml"))
def test_recipes_run(text: str, folder: Path) -> None:
    path = folder / "recipe.yaml"
    path.write_text(text)
    if "thrown" in read_recipe(path).as_dict()["method"].get("exact", {}).values():
        # `test_recipes` makes the shipped ones.
        print("not run")
    else:
        # Without its finish the paper's method may miss, as it did in print.
        assert run_command("run recipe.yaml") <= ("finish: none" in text)


@pytest.fixture
def registries() -> Iterator[None]:
    """Remove the extensions that a test registers."""
    known = {
        name: [entry.name for entry in registry]
        for name, registry in vars(extensions).items()
        if name.isupper() and hasattr(registry, "unregister")
    }
    yield
    for name, before in known.items():
        registry = getattr(extensions, name)
        for entry in list(registry):
            if entry.name not in before:
                registry.unregister(entry.name)


@pytest.mark.parametrize("path", parts((path.stem, path) for path in EXAMPLES))
def test_examples_run(path: Path, registries: None, monkeypatch: pytest.MonkeyPatch) -> None:
    modules = set(re.findall(r"^\s*(?:from|import) (dicedesign[\w.]*)", path.read_text(), re.M))
    names = ("compat", "energies", "extensions", "figures", "methods", "starts")
    assert modules <= {"dicedesign", *(f"dicedesign.{name}" for name in names)}
    monkeypatch.setattr(sys, "argv", [str(path)])
    runpy.run_path(str(path), run_name="__main__")
