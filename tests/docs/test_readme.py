"""The README's code runs, its links lead somewhere, and its table keeps what the recipes promise.
That the recipes keep it too is tested in `test_recipes`."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dicedesign.recipe.schema.reading import read_recipe

BENCHES = (
    "stability",
    "gradients",
    "accuracy",
    "design",
    "exact",
    "lean",
    "speed",
    "concave",
    "table",
    "momentum",
    "thrown",
)

NIGHTLY = "pytest tests/fuzz --hypothesis-profile=nightly"
"""Takes a quarter of an hour, and is started by hand."""


def blocks(repository: Path, language: str) -> list[str]:
    text = (repository / "README.md").read_text()
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def workplace(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the first command of the README has been run."""
    folder = tmp_path_factory.mktemp("readme")
    shutil.copytree(repository / "recipes", folder / "recipes")
    (folder / "rolls.csv").write_text(blocks(repository, "csv")[0])
    command = next(block for block in blocks(repository, "sh") if "dicedesign run" in block)
    run_dicedesign(command.split("dicedesign", 1)[1], folder)
    return folder


def run_dicedesign(arguments: str, folder: Path) -> str:
    command = [sys.executable, "-m", "dicedesign", *shlex.split(arguments)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_shell_commands_run(repository: Path, workplace: Path) -> None:
    lines = [line for block in blocks(repository, "sh") for line in block.splitlines()]
    benches = [line for line in lines if line.startswith("dicedesign bench ")]
    plain = [line for line in lines if line.startswith("dicedesign ") and line not in benches]
    assert len(plain) == 13
    for line in plain:
        assert run_dicedesign(line.removeprefix("dicedesign "), workplace)
    assert (workplace / "map.png").exists()
    # The script that checks a change runs the benches and the two that install as they stand.
    assert {line.split()[2] for line in benches} == set(BENCHES)
    others = [line for line in lines if line not in plain + benches]
    install = [line for line in others if line.startswith("python3 -m venv .venv && ")]
    assert len(install) == 2
    assert [line for line in others if line not in install] == [NIGHTLY]


def test_python_blocks_run(repository: Path, workplace: Path) -> None:
    found = blocks(repository, "python")
    assert len(found) == 3
    environment = {**os.environ, "PYTHONPATH": str(repository)}
    for block in found:
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", block],
            cwd=workplace,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout


def test_yaml_blocks_are_recipes(repository: Path, tmp_path: Path) -> None:
    found = blocks(repository, "yaml")
    assert found
    for block in found:
        (tmp_path / "recipe.yaml").write_text(block)
        assert ": converged" in run_dicedesign("run recipe.yaml", tmp_path)


def test_links_and_pictures_exist(repository: Path) -> None:
    text = (repository / "README.md").read_text()
    targets = re.findall(r"\]\(([^)]+)\)", text)
    assert len(targets) > 15
    for target in targets:
        assert (repository / target).exists(), target


def test_every_recipe_is_in_the_table_within_its_tolerance(repository: Path) -> None:
    text = (repository / "README.md").read_text()
    rows = re.findall(r"^\| `(\w+)` \| (\d+) \| (\d+) \+ (\d+) \| (\S+) \|", text, re.MULTILINE)
    shipped = [
        path
        for path in sorted((repository / "recipes").glob("*.yaml"))
        if read_recipe(path).method.concave is None and not read_recipe(path).method.thrown
    ]
    assert [row[0] for row in rows] == [path.stem for path in shipped]
    for path, (_, outcomes, labelled, stray, error) in zip(shipped, rows, strict=True):
        recipe = read_recipe(path)
        assert int(outcomes) == int(labelled) == len(recipe.target.target().labels)
        assert int(stray) == 0
        assert float(error) <= recipe.method.tolerance


def test_every_concave_recipe_is_in_its_table_within_its_tolerance(repository: Path) -> None:
    text = (repository / "README.md").read_text()
    rows = re.findall(
        r"^\| `(\w+)` \| (\d+) \| (\S+e\S+) \| (\S+e\S+) \| (\S+) \|", text, re.MULTILINE
    )
    recipes = [read_recipe(path) for path in sorted((repository / "recipes").glob("*.yaml"))]
    concave = [recipe for recipe in recipes if recipe.method.concave is not None]
    assert [row[0] for row in rows] == [recipe.name for recipe in concave]
    for recipe, (_, outcomes, error, elsewhere, displacement) in zip(concave, rows, strict=True):
        assert int(outcomes) == len(recipe.target.target().labels)
        assert max(float(error), float(elsewhere)) <= recipe.method.tolerance
        assert float(displacement) <= 5.0


def test_every_recipe_for_a_table_is_in_its_table_within_what_it_asks_for(
    repository: Path,
) -> None:
    text = (repository / "README.md").read_text()
    rows = re.findall(
        r"^\| `(\w+)` \| (\d+) \| [\d. →]+ \| (0\.\d+) \| [\d.]+ to [\d.]+ \|", text, re.MULTILINE
    )
    recipes = [read_recipe(path) for path in sorted((repository / "recipes").glob("*.yaml"))]
    thrown = [recipe for recipe in recipes if recipe.method.thrown]
    assert [row[0] for row in rows] == [recipe.name for recipe in thrown]
    for recipe, (_, outcomes, deviation) in zip(thrown, rows, strict=True):
        exact = recipe.method.exact
        assert exact is not None
        assert exact.refine is not None
        assert int(outcomes) == len(recipe.target.target().labels)
        assert float(deviation) <= exact.refine.within
