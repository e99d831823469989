"""Data flows one way: no module imports from a floor above its own, and none in a circle."""

from __future__ import annotations

import ast
from pathlib import Path

FLOORS = (
    "errors",
    "tolerances",
    "runtime",
    "palette",
    "notebook",
    "kernels",
    "results",
    "geometry",
    "rest",
    "throws",
    "gradient",
    "optimize",
    "balance",
    "concave",
    "fabricate",
    "report",
    "scenes",
    "recipe",
    "batch",
    "sweep",
    "view",
    "cli",
    "compat",
    "energies",
    "methods",
    "starts",
    "figures",
    "extensions",
    "__init__",
    "__main__",
)
"""Folders and files of the package, the lowest first."""

HEIGHT = {name: height for height, name in enumerate(FLOORS)}

TORCH_BEGINS = "gradient"
"""Below this floor nothing knows torch."""


def imports(path: Path) -> set[str]:
    """Modules of the package that a file imports, at its top or anywhere else."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names.add(node.module)
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return {name for name in names if name.split(".")[0] == "dicedesign"}


def modules(repository: Path) -> dict[str, Path]:
    """Files of the package by module name; a folder's own file has the folder's name."""
    root = repository / "dicedesign"
    return {
        ".".join(path.relative_to(repository).with_suffix("").parts).removesuffix(".__init__"): path
        for path in root.rglob("*.py")
    }


def floor(module: str) -> int:
    parts = module.split(".")
    return HEIGHT[parts[1] if len(parts) > 1 else "__init__"]


def leaves_last(graph: dict[str, set[str]]) -> None:
    """Assert that a graph has no circle."""
    while graph:
        leaves = {name for name, targets in graph.items() if not targets & set(graph)}
        circle = {name: sorted(targets & set(graph)) for name, targets in graph.items()}
        assert leaves, f"import cycle in {circle}"
        graph = {name: targets for name, targets in graph.items() if name not in leaves}


def test_no_import_goes_up(repository: Path) -> None:
    known = modules(repository)
    assert len(known) > 40
    for name, path in known.items():
        for imported in imports(path) & set(known):
            assert floor(imported) <= floor(name), f"{name} imports {imported}"


def test_no_circles_of_files(repository: Path) -> None:
    known = modules(repository)
    leaves_last({name: imports(path) & set(known) - {name} for name, path in known.items()})


def test_no_circles_of_folders(repository: Path) -> None:
    known = modules(repository)
    rooms: dict[str, set[str]] = {}
    for path in known.values():
        room = rooms.setdefault(str(path.parent), set())
        room |= {str(known[name].parent) for name in imports(path) & set(known)}
        room.discard(str(path.parent))
        room.discard(str(repository / "dicedesign"))
    del rooms[str(repository / "dicedesign")]
    leaves_last(rooms)


def test_torch_begins_at_its_floor(repository: Path) -> None:
    for name, path in modules(repository).items():
        text = path.read_text()
        if floor(name) < HEIGHT[TORCH_BEGINS]:
            assert "import torch" not in text, name
            assert "from torch" not in text, name
        assert "pyplot" not in text, name


def test_nothing_loose_at_the_top(repository: Path) -> None:
    loose = {path.name for path in (repository / "dicedesign").glob("*.py")}
    low, public = ("errors", "tolerances", "palette", "notebook"), ("compat", "energies", "methods")
    names = ("__init__", "__main__", *low, *public, "starts", "figures", "extensions")
    assert loose == {f"{name}.py" for name in names}


def test_modules_are_small_enough_to_read_in_one_go(repository: Path) -> None:
    for name, path in modules(repository).items():
        assert len(path.read_text().splitlines()) <= 500, name
