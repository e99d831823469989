"""Files, equations, floors and options in the pages exist."""

from __future__ import annotations

import inspect
import json
import re
import shlex
from pathlib import Path

import generated_tables
import pytest
from common.paths import PAGES, ROOT, commands
from test_architecture import FLOORS

import dicedesign
from benchmarks.frame import RECORDED, parser_of
from dicedesign.cli.main import make_parser
from dicedesign.recipe.recipe import Recipe

MADE_UP = {"recipes/NAME.yaml"}
"""A placeholder for any recipe."""


def anchors(page: Path) -> set[str]:
    """Anchors of the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def links(page: Path) -> list[str]:
    """Targets of links and pictures of a page within the repository."""
    targets = re.findall(r"\]\(([^)]+)\)", page.read_text(encoding="utf-8"))
    return [target for target in targets if "://" not in target]


def first_column(text: str) -> list[str]:
    """First cells of the rows of all tables in a text, without their headings."""
    rows = re.findall(r"(?:^\|.*\n\|---.*\n)((?:^\|.*\n)+)", text, re.MULTILINE)
    return [line.split("|")[1].strip() for table in rows for line in table.splitlines()]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    for target in links(page):
        path, _, anchor = target.partition("#")
        place = (page.parent / path).resolve() if path else page
        assert place.exists(), target
        assert not anchor or anchor in anchors(place), target


IN_BACKTICKS = re.compile(r"`([^`\n]+)`")


def named_files(page: Path) -> set[str]:
    """Files and folders of the repository that a page names as code."""
    text = page.read_text(encoding="utf-8")
    code = IN_BACKTICKS.findall(re.sub(r"^```.*?^```", "", text, flags=re.S | re.M))
    folders = "|".join(path.name for path in (ROOT / "dicedesign").iterdir() if path.is_dir())
    within = re.compile(rf"(dicedesign|benchmarks|tests|examples|docs|recipes|{folders})/[\w./]*")
    return {word for span in code for word in span.split() if within.fullmatch(word)}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_named_files_exist(page: Path) -> None:
    for name in named_files(page) - MADE_UP:
        assert (ROOT / name).exists() or (ROOT / "dicedesign" / name).exists(), name


def test_every_page_is_linked_from_the_readme() -> None:
    linked = {(ROOT / target.partition("#")[0]).resolve() for target in links(ROOT / "README.md")}
    assert linked >= set(PAGES) - {ROOT / "README.md"}


def expand_ranges(text: str) -> set[int]:
    """Whole numbers in a text such as "7, 8", "9 and 10" or "26 to 30"."""
    text = re.sub(r"\d+\.\d+", "", text)
    numbers = set()
    for first, last in re.findall(r"(\d+)(?: to (\d+))?", text):
        numbers |= set(range(int(first), int(last or first) + 1))
    return numbers


CITED = re.compile(r"\b(?:eqs?\.|equations?)\s+(\d[\d.]*(?:(?:, | and | to )\d[\d.]*)*)")


def find_citations(text: str) -> set[str]:
    """Equations, algorithms and appendices of the paper in a text."""
    names = {f"eq. {number}" for part in CITED.findall(text) for number in expand_ranges(part)}
    names |= {f"algorithm {number}" for number in re.findall(r"\balgorithm\s+(\d+)", text)}
    return names | {f"appendix {name}" for name in re.findall(r"\bappendix\s+([A-Z]\.\d)", text)}


def test_the_method_page_lists_every_equation_of_the_code() -> None:
    text = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
    table = {name for cell in first_column(text) for name in find_citations(cell)}
    for path in sorted((ROOT / "dicedesign").rglob("*")):
        if path.suffix in (".py", ".cpp", ".hpp"):
            unknown = find_citations(path.read_text(encoding="utf-8")) - table
            assert not unknown, f"{path}: {unknown}"


def test_signatures_are_those_of_the_code(repository: Path) -> None:
    """Signatures with keywords in a page."""
    count = 0
    for page in generated_tables.pages():
        text = " ".join(page.read_text(encoding="utf-8").split())
        for name, arguments in re.findall(r"`dd\.(\w+)\(([^`]*\*, [^`]*)\)`", text):
            parameters = inspect.signature(getattr(dicedesign, name)).parameters.values()
            bare = [p.replace(annotation=inspect.Parameter.empty) for p in parameters]
            expected = str(inspect.Signature(bare))[1:-1]
            assert arguments.replace('"', "'") == expected, page.name
            count += 1
    assert count


def test_every_public_name_is_in_the_api_reference() -> None:
    listed = (ROOT / "docs" / "api" / "index.md").read_text(encoding="utf-8")
    names = set(re.findall(r"^::: dicedesign\.(\w+)$", listed, re.MULTILINE))
    modules = {"energies", "methods", "starts", "figures", "extensions"}
    assert names == set(dicedesign.__all__) - modules - {"__version__"}


def test_the_floors_are_those_of_the_architecture_test() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    names = re.findall(r"^\| \[([\w\\]+)\]\(", text, re.MULTILINE)
    assert tuple(name.replace("\\", "") for name in names) == FLOORS


def test_the_designers_page_has_every_key() -> None:
    text = (ROOT / "docs" / "designers.md").read_text(encoding="utf-8")
    start, end = text.index("\n## Write a recipe"), text.index("\n## Sizes and labels")
    cells = first_column(text[start:end])
    assert {cell.strip("`") for cell in cells} == set(Recipe.model_fields)


@pytest.mark.parametrize("page", generated_tables.pages(), ids=lambda page: page.stem)
def test_tables_agree_with_the_code(page: Path) -> None:
    makers = generated_tables.tables()
    for name, text in generated_tables.blocks(page).items():
        assert text == makers[name](), f"{name}: run python tests/docs/generated_tables.py"


def test_every_table_has_a_page() -> None:
    shown = {name for page in generated_tables.pages() for name in generated_tables.blocks(page)}
    assert shown >= set(generated_tables.tables())


# Commands.


def check_command(line: str) -> None:
    """Parse a command, and look for the recipes that it names."""
    program, *given = shlex.split(line.removeprefix("python -m "))
    command = given[0]
    parser = make_parser(command) if program == "dicedesign" else parser_of(command)
    parser.parse_args(given)
    for word in given:
        assert not word.startswith("recipes/") or list(ROOT.glob(word)), word


def test_commands_are_valid() -> None:
    others = set()
    for line in {line for page in PAGES for line in commands(page)}:
        if line.startswith(("dicedesign ", "python -m benchmarks ")):
            check_command(line)
        elif not line.startswith(("python3 -m venv .venv && ", "pip install 'dicedesign[")):
            others.add(line)
    assert others == {
        "pytest tests/fuzz --hypothesis-profile=nightly",
        "pytest tests/soak -m soak",
    }
    for table in json.loads(RECORDED.read_text(encoding="utf-8")).values():
        check_command(table["command"])
