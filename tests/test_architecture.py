"""Data flows one way: no module imports from a floor above its own, and none in a circle."""

from __future__ import annotations

import ast
from pathlib import Path

FLOORS = (
    (
        "clock",
        "errors",
        "extras",
        "executors",
        "files",
        "kernels",
        "peak_memory",
        "tolerances",
        "options",
    ),
    ("geometry",),
    ("rest",),
    ("throws",),
    ("batch",),
    ("design",),
    ("concave",),
    ("fabricate",),
    ("show",),
    (
        "recipe_parts",
        "recipe",
        "recipe_file",
        "table_stage",
        "table_summary",
        "table_figures",
        "design_stage",
        "concave_stage",
        "summary",
        "concave_summary",
        "concave_figures",
        "results",
    ),
    ("pipeline", "concave_pipeline"),
    ("search",),
    ("bench",),
    ("commands",),
    ("cli",),
    ("__init__", "__main__"),
)
KNOW_TORCH = (
    "dicedesign.design",
    "dicedesign.concave",
    "dicedesign.search.trial",
    "dicedesign.bench",
    "dicedesign.commands.running",
    "dicedesign.commands.benches",
)
HEIGHT = {name: height for height, names in enumerate(FLOORS) for name in names}


def imports(path: Path) -> set[str]:
    """Modules of the package that a file imports, at its top or anywhere else."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            found.add(node.module)
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {name for name in found if name.split(".")[0] == "dicedesign"}


def modules(repository: Path) -> dict[str, Path]:
    root = repository / "dicedesign"
    return {
        ".".join(path.relative_to(repository).with_suffix("").parts): path
        for path in root.rglob("*.py")
    }


def floor(module: str) -> int:
    parts = module.split(".")
    return HEIGHT[parts[1] if len(parts) > 1 else "__init__"]


def test_no_import_goes_up(repository: Path) -> None:
    known = modules(repository)
    assert len(known) > 40
    for name, path in known.items():
        for imported in imports(path) & set(known):
            if name != "dicedesign.__init__":
                assert floor(imported) <= floor(name), f"{name} imports {imported}"


def test_no_circles(repository: Path) -> None:
    known = modules(repository)
    graph = {name: imports(path) & set(known) - {name} for name, path in known.items()}
    while graph:
        leaves = {name for name, targets in graph.items() if not targets & set(graph)}
        assert leaves, f"import cycle among {sorted(graph)}"
        graph = {name: targets for name, targets in graph.items() if name not in leaves}


def test_only_the_design_floor_and_its_benches_know_torch(repository: Path) -> None:
    for name, path in modules(repository).items():
        text = path.read_text()
        if not name.startswith(KNOW_TORCH):
            assert "import torch" not in text, name
            assert "from torch" not in text, name
        assert "pyplot" not in text, name


def test_modules_are_small_enough_to_read_in_one_go(repository: Path) -> None:
    for name, path in modules(repository).items():
        assert len(path.read_text().splitlines()) <= 340, name
