"""Commands, Python and recipes of all pages run as they stand, in a folder where the first command
of the README has been run."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from common.doc_pages import PAGES, blocks, commands, not_there_yet, run_python

SLOW = {
    "dicedesign run recipes/fair_d3_duck.yaml",
    "dicedesign run recipes/fair_d7_table.yaml",
}
"""Shipped recipes that take long; `test_recipes` has them."""

WITHOUT_PICTURES = " --no-figures"

FEWER = {
    "--trials 20": "--trials 2",
    " throw ": " throw --drops 500 ",
    "best.yaml": "best.yaml" + WITHOUT_PICTURES,
}
"""What a command is shortened by."""

FEW_THROWS = "method.exact.refine={drops: 1000, rounds: 1, verdict: 2000, within: 0.06}"

EACH_ALONE = """
for code in {codes!r}:
    exec(compile(code, "<block>", "exec"), {{"__name__": "__main__"}})
    print("== done")
"""
"""Runs blocks in one process, which imports torch once."""


@pytest.fixture(scope="module")
def workplace(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the first command of the README has been run."""
    folder = tmp_path_factory.mktemp("pages")
    shutil.copytree(repository / "recipes", folder / "recipes")
    (folder / "rolls.csv").write_text(blocks(repository / "docs" / "table.md", "csv")[0])
    command = next(line for line in commands(repository / "README.md") if "venv" in line)
    run_dicedesign(command.split("dicedesign", 1)[1], folder)
    return folder


def run_dicedesign(arguments: str, folder: Path) -> str:
    command = [sys.executable, "-m", "dicedesign", *shlex.split(arguments)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def having(language: str) -> list[Path]:
    return [page for page in PAGES if blocks(page, language)]


def is_quick(line: str) -> bool:
    """Whether a line is a command of the package that takes seconds. Benches are run by the script
    that checks a change."""
    is_command = line.startswith("dicedesign ") and not line.startswith("dicedesign bench ")
    return is_command and line not in SLOW


TYPED = list(dict.fromkeys(line for page in PAGES for line in commands(page)))
"""All lines of all pages, each once."""


@pytest.mark.parametrize("line", list(filter(is_quick, TYPED)))
def test_a_command_runs(line: str, workplace: Path) -> None:
    for long, short in FEWER.items():
        line = line.replace(long, short)
    assert run_dicedesign(line.removeprefix("dicedesign "), workplace)


def test_what_is_typed_is_known(repository: Path) -> None:
    lines = set(TYPED)
    others = {line for line in lines if not line.startswith("dicedesign ")}
    assert {line for line in others if not line.startswith("python3 -m venv .venv && ")} == {
        "pytest tests/fuzz --hypothesis-profile=nightly"
    }
    assert lines >= SLOW
    assert all((repository / line.split()[-1]).exists() for line in SLOW)


@pytest.mark.parametrize("page", having("python"), ids=lambda page: page.stem)
def test_python_runs(page: Path, workplace: Path) -> None:
    codes = blocks(page, "python")
    ready = [code for code in codes if not not_there_yet(code)]
    if ready:
        shown = run_python(EACH_ALONE.format(codes=ready), workplace).split("== done\n")
        assert len(shown) == len(ready) + 1
        assert all(shown[:-1])
    if len(ready) < len(codes):
        pytest.skip(", ".join(sorted({name for code in codes for name in not_there_yet(code)})))


@pytest.mark.parametrize("page", having("yaml"), ids=lambda page: page.stem)
def test_recipes_converge(page: Path, tmp_path: Path) -> None:
    for block in blocks(page, "yaml"):
        (tmp_path / "recipe.yaml").write_text(block)
        changes = WITHOUT_PICTURES
        if "thrown" in block:
            changes += f" --set '{FEW_THROWS}'"
        assert ": converged" in run_dicedesign(f"run recipe.yaml{changes}", tmp_path)
