"""What each feature costs, and what is saved where it is not asked for or not needed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from dicedesign.bench.measures.feature_costs import (
    Row,
    energy_rows,
    exact_rows,
    hull_rows,
    sobolev_rows,
)
from dicedesign.bench.measures.processes import in_new_process
from dicedesign.design.starts.kinds.hendecahedron import hendecahedron
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.stl import stl_bytes

__all__ = ["run_lean"]

PROCESSES: Final = 3
"""How often each work is done in a process of its own."""

SECONDS: Final = 2.0
"""How long each group of works is repeated in this process."""

_RECIPE: Final = """
name: die
target: {sum_of_dice: [6, 6]}
start: {hendecahedron: bisymmetric}
method: {descent: {stopping: {steps: 0}}}
"""

_QUERY: Final = "from dicedesign.cli.main import main\nmain(['rest', 'die.stl'{more}])"

_RECIPE_READ: Final = """
from pathlib import Path
import torch
from dicedesign.recipe.design_stage import design_die, make_start
from dicedesign.recipe.run import engrave_die
from dicedesign.recipe.schema.reading import read_recipe
recipe = read_recipe(Path("die.yaml"))
"""

_DESIGN: Final = "die = design_die(recipe, make_start(recipe))\n"

_WORKS: Final = {
    "query": ("", _QUERY.format(more="")),
    "query and torch": ("", "import torch\n" + _QUERY.format(more="")),
    "query and figure": ("", _QUERY.format(more=", '--figure', 'map.png'")),
    "design": (_RECIPE_READ, _DESIGN),
    "design and labels": (
        _RECIPE_READ,
        _DESIGN + "engrave_die(die, recipe.engrave, recipe.size_mm)",
    ),
}
"""What is done in new processes: what comes before, and what is measured."""


def run_lean(
    *,
    processes: int = PROCESSES,
    seconds: float = SECONDS,
    on_group: Callable[[str], None] = lambda name: None,
) -> Iterator[Row]:
    """Rows of the table, group by group.

    processes: how often each work in a new process is done.
    seconds: for how long each group in this process is repeated.
    on_group: is told the name of each group before it is measured.
    """
    on_group("new processes")
    yield from _programs(processes)
    for name, group in (
        ("energies", energy_rows),
        ("Sobolev", sobolev_rows),
        ("hulls", hull_rows),
        ("exact arithmetic", exact_rows),
    ):
        on_group(name)
        yield from group(seconds)


def _programs(processes: int) -> Iterator[Row]:
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "die.yaml").write_text(_RECIPE)
        hull = convex_hull(hendecahedron("bisymmetric").points)
        (folder / "die.stl").write_bytes(stl_bytes(hull.vertices, hull.triangles))
        costs = dict(
            zip(_WORKS, in_new_process(list(_WORKS.values()), folder, processes), strict=True)
        )
    for feature, quantity, base, more in (
        ("torch, which a query never loads", "query of an STL file", "query", "query and torch"),
        ("figure of a query", "query of an STL file", "query", "query and figure"),
        ("engraving", "shape of 11 facets and its odds", "design", "design and labels"),
    ):
        (without, least), (included, most) = costs[base], costs[more]
        yield Row(feature, quantity, "s", without, included)
        if least is not None and most is not None:
            yield Row(feature, "peak memory", "MB", least, most)
