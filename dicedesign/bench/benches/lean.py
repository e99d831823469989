"""Costs of features, and what is saved where one is not asked for or not needed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from dicedesign.bench.frame import BENCHES, Bench, Items, Run

__all__ = ["Extent"]


@dataclass(frozen=True)
class Extent:
    """How often each work is done in a process of its own, and for how many seconds each group of
    works is repeated in this one."""

    processes: int
    seconds: float


_RECIPE: Final = """
name: die
target: {sum_of_dice: [6, 6]}
start: {hendecahedron: bisymmetric}
method: {paper: {step: line_search, steps: 0, finish: none}}
"""

_QUERY: Final = "from dicedesign.cli.main import main\nmain(['rest', 'die.stl'{more}])"

_READ: Final = """
from pathlib import Path
import torch
from dicedesign.bench.measures.recipes import begun, checked, designed, engraved
from dicedesign.recipe.schema.reading import read_recipe
recipe = read_recipe(Path("die.yaml"))
"""

_DESIGN: Final = "work = begun(recipe)\ndesigned(work)\nchecked(work)\n"

_WORKS: Final = {
    "query": ("", _QUERY.format(more="")),
    "query and torch": ("", "import torch\n" + _QUERY.format(more="")),
    "query and figure": ("", _QUERY.format(more=", '--figure', 'map.png'")),
    "design": (_READ, _DESIGN),
    "design and labels": (_READ, _DESIGN + "engraved(work)"),
}
"""What is done in new processes: what comes before, and what is measured."""


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.designs.feature_costs import (
        energy_rows,
        exact_rows,
        hull_rows,
        sobolev_rows,
        torch_rows,
    )

    extent: Extent = run.extent
    run.begin("new processes")
    yield from _programs(extent.processes)
    for name, group in (
        ("energies", energy_rows),
        ("Sobolev", sobolev_rows),
        ("hulls", hull_rows),
        ("torch", torch_rows),
        ("exact arithmetic", exact_rows),
    ):
        run.begin(name)
        for row in group(extent.seconds):
            run.advance()
            yield row
    return True


def _programs(processes: int) -> Items:
    from dicedesign.bench.measures.designs.feature_costs import CostRow
    from dicedesign.bench.measures.processes import in_new_process
    from dicedesign.geometry.hulls.hull import convex_hull
    from dicedesign.geometry.meshes.stl import stl_bytes
    from dicedesign.optimize.starts.kinds.hendecahedron import hendecahedron

    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "die.yaml").write_text(_RECIPE)
        hull = convex_hull(hendecahedron("bisymmetric").points)
        (folder / "die.stl").write_bytes(stl_bytes(hull.vertices, hull.triangles))
        measured = in_new_process(list(_WORKS.values()), folder, processes)
    costs = dict(zip(_WORKS, measured, strict=True))
    for feature, quantity, base, more in (
        ("torch, which a query never loads", "query of an STL file", "query", "query and torch"),
        ("figure of a query", "query of an STL file", "query", "query and figure"),
        ("engraving", "shape of 11 facets and its odds", "design", "design and labels"),
    ):
        (without, least), (included, most) = costs[base], costs[more]
        yield CostRow(feature, quantity, without, included, "s")
        if least is not None and most is not None:
            yield CostRow(feature, "peak memory", least, most, "MB")
    return True


BENCHES.register(
    Bench(
        name="lean",
        line="what each feature costs, and what leaving it out saves",
        description="Measure what each feature costs that a query or a design can do without, in "
        "about half a minute. Seconds are processor time, medians of several repetitions; memory "
        "is the peak of a new process, libraries included.",
        rows=_rows,
        full=Extent(processes=3, seconds=2.0),
        quick=Extent(processes=1, seconds=0.0),
        packages=("numpy", "scipy", "torch"),
    )
)
