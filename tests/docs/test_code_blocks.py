"""Commands, Python code and recipes of all pages and the examples run, in a folder with the results
of the README's first command."""

from __future__ import annotations

import argparse
import json
import re
import shlex
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest
from common.doc_pages import PAGES, blocks, commands, run_parts
from common.paths import ROOT

from benchmarks.frame import RECORDED, parser_of
from dicedesign.cli.main import make_parser
from dicedesign.recipe.reading import read_recipe

LONG = (
    "search ",
    "view",
    "run recipes/fair_d3_duck.yaml",
    "run recipes/fair_d7_table.yaml",
    "run outputs/binomial_5_search/best.yaml",
)
"""Beginnings of commands that are only parsed here; `.ci/run` and other tests run them."""

SHORTER = {"design ": " --no-figures", "run ": " --no-figures", "throw ": " --drops 500"}
"""Options added to commands."""

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))

TYPED = list(dict.fromkeys(line for page in PAGES for line in commands(page)))
"""All lines of all pages, each once."""

PROGRAMS = ("dicedesign ", "python -m benchmarks ")

INSTALLS = ("python3 -m venv .venv && ", "pip install 'dicedesign[")


def arguments(line: str) -> str:
    """A line without the name of the program."""
    return line.removeprefix("dicedesign ")


def python_call(line: str, codes: Sequence[int] = (0,)) -> str:
    """Python code of a command, which must end with one of these exit codes."""
    added = "".join(text for start, text in SHORTER.items() if line.startswith(start))
    given = shlex.split(line + added)
    return f"from dicedesign.cli.main import main\nassert main({given!r}) in {tuple(codes)}"


def ordered_parts() -> dict[str, str]:
    """All parts as Python code by name, those first whose files others read."""
    first = next(line for line in TYPED if "dicedesign run" in line).split("dicedesign ")[1]
    lines = [arguments(line) for line in TYPED if line.startswith("dicedesign ")]
    parts = {line: python_call(line) for line in [first, *lines] if not line.startswith(LONG)}
    for page in PAGES:
        for number, code in enumerate(blocks(page, "python"), start=1):
            parts[f"{page.name}, Python {number}"] = code
        for number, text in enumerate(blocks(page, "yaml"), start=1):
            if "thrown" not in text:
                name = f"{page.stem}-{number}.yaml"
                written = f"open({name!r}, 'w').write({text!r})\n"
                # Without its finish the paper's method may miss, as it did in print.
                codes = (0, 1) if "finish: none" in text else (0,)
                parts[f"{page.name}, recipe {number}"] = written + python_call(f"run {name}", codes)
    # Last, as they register extensions.
    return parts | {path.name: path.read_text(encoding="utf-8") for path in EXAMPLES}


def test_commands_examples_and_code_run(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "recipes", tmp_path / "recipes")
    (tmp_path / "rolls.csv").write_text(blocks(ROOT / "docs" / "tables.md", "csv")[0])
    parts = ordered_parts()
    printed = run_parts(parts, tmp_path)
    assert list(printed) == list(parts)
    assert {name for name, text in printed.items() if not text} == set()


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_examples_import_public_modules(path: Path) -> None:
    modules = set(re.findall(r"^\s*(?:from|import) (dicedesign[\w.]*)", path.read_text(), re.M))
    names = ("compat", "energies", "extensions", "methods", "starts")
    assert modules <= {"dicedesign", *(f"dicedesign.{name}" for name in names)}


@pytest.mark.parametrize("line", [line for line in TYPED if line.startswith(PROGRAMS)])
def test_commands_are_valid(line: str) -> None:
    command, *given = shlex.split(arguments(line))
    parser = argparse.ArgumentParser()
    if command == "python":
        _, _, *given = given
        parser = parser_of(given[0])
    else:
        parser = make_parser(command)
        given = [command, *given]
    parser.parse_args(given)
    for word in shlex.split(line):
        if word.startswith("recipes/"):
            assert list(ROOT.glob(word)), word


def test_commands_of_measured_tables_are_valid() -> None:
    for table in json.loads(RECORDED.read_text(encoding="utf-8")).values():
        name, *given = shlex.split(table["command"].removeprefix("python -m benchmarks "))
        parser_of(name).parse_args([name, *given])


def test_other_commands_are_known() -> None:
    others = {line for line in TYPED if not line.startswith((*PROGRAMS, *INSTALLS))}
    assert others == {
        "pytest tests/fuzz --hypothesis-profile=nightly",
        "pytest tests/soak -m soak",
    }


@pytest.mark.parametrize(
    "page", [page for page in PAGES if blocks(page, "yaml")], ids=lambda page: page.stem
)
def test_recipes_can_be_read(page: Path, tmp_path: Path) -> None:
    for block in blocks(page, "yaml"):
        (tmp_path / "recipe.yaml").write_text(block)
        read_recipe(tmp_path / "recipe.yaml")
