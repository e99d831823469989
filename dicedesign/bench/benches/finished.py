"""Odds of finished dice, with labels and edges: as they come out, and after the shape was moved."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Amount, recipes
from dicedesign.bench.rows import Row, column

if TYPE_CHECKING:
    from dicedesign.bench.measures.recipes import Work
    from dicedesign.recipe.schema.recipe import Recipe

__all__ = ["Extent", "FinishedRow"]

WAYS: Final[dict[str, dict[str, Any]]] = {
    "engraved": {},
    "engraved, fillet of 1 mm": {"edges": {"radius_mm": 1.0}},
    "engraved, chamfer of 2 mm": {"edges": {"radius_mm": 2.0, "shape": "chamfer"}},
    "raised": {"engrave": {"style": "raised"}},
    "engraved, opposite ball": {"engrave": {"balance": "opposite"}},
    "engraved, labels filled": {"engrave": {"balance": "fill"}},
}
"""How dice are finished, by name: entries of their recipes; the first ones in the short bench."""

IN_FILE: Final = 1e-6
"""Largest |p - q| of a finished die's file in single precision."""

BY_MODEL: Final = 1e-3
"""The same of the odds of a thrown die by the momentum model."""

LARGER: Final = 1.5
"""Size of these dice over that of their recipes, so that labels fit within edges and borders."""


@dataclass(frozen=True)
class Extent:
    """How many of the ways dice are finished in."""

    ways: int


@dataclass(frozen=True)
class FinishedRow(Row):
    """One die, finished in one way.

    Attributes
    ----------
    unbalanced: largest |p - q| if the plain shape is finished as it is.
    double: the same after the last round, in double precision; file: of die.stl, read back, without
        momentum.
    rounds: shapes that were tried. moved: in mm, see `Balance`. seconds: of the stage on the wall.
    """

    recipe: str = column("recipe", -26)
    way: str = column("finished", -26)
    status: str = column("status", -10)
    unbalanced: float | None = column("as it is", 9, ".1e")
    double: float | None = column("balanced", 9, ".1e")
    file: float | None = column("in file", 9, ".1e")
    rounds: int | None = column("rounds", 7)
    moved: float | None = column("moved mm", 9, ".3f")
    seconds: float = column("s", 6, ".2f")


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.recipes import begun, checked, designed
    from dicedesign.recipe.schema.reading import read_recipe

    extent: Extent = run.extent
    is_good, is_first = True, True
    for path in run.options.recipes:
        recipe = read_recipe(path)
        recipe = recipe.model_copy(update={"size_mm": LARGER * recipe.size_mm})
        run.begin(recipe.name)
        work = begun(recipe)
        designed(work)
        checked(work)
        if is_first:
            # Not counted: libraries that are loaded at their first use in a process.
            _finished(work, recipe, "engraved")
            is_first = False
        for way in list(WAYS)[: extent.ways]:
            row = _finished(work, recipe, way)
            run.advance()
            if row is not None:
                yield row
                error = row.double if recipe.method.thrown else row.file
                most = BY_MODEL if recipe.method.thrown else IN_FILE
                is_good &= error is None or (row.status == "converged" and error <= most)
    return is_good


def _finished(work: Work, recipe: Recipe, way: str) -> FinishedRow | None:
    """The row of a checked die; None where it has no such edges or labels."""
    from dicedesign.bench.measures.recipes import engraved
    from dicedesign.recipe.schema.reading import checked_recipe

    entries = recipe.resolved()
    if recipe.method.concave is not None and WAYS[way]:
        return None
    engrave = {**(entries["engrave"] or {}), **WAYS[way].get("engrave", {})}
    wanted = {**entries, **WAYS[way], "engrave": engrave}
    finished = work.copy()
    finished.recipe = checked_recipe(wanted)
    started = time.perf_counter()
    done = engraved(finished)
    seconds = time.perf_counter() - started
    balance, result = finished.balance, finished.result()
    if not done or balance is None:
        return FinishedRow(recipe.name, way, "no room", None, None, None, None, None, seconds)
    return FinishedRow(
        recipe=recipe.name,
        way=way,
        status=result.status,
        unbalanced=balance.errors[0],
        double=min(balance.errors),
        file=None if result.engraved is None else result.engraved.max_abs_error,
        rounds=len(balance.errors) - 1,
        moved=balance.moved_mm,
        seconds=seconds,
    )


BENCHES.register(
    Bench(
        name="finished",
        line="odds of dice with labels and edges, before and after their shapes were moved",
        description="Finish the dice of recipes in several ways: labels cut in or raised, edges "
        "rounded or chamfered, balanced by shape, by a hidden ball or by filled labels. Each row "
        "has the largest |p - q| of the plain shape finished as it is, of the balanced one, and of "
        "its file read back; for thrown dice the first two are by the momentum model. Dice are "
        "1.5 times as large as their recipes say, so that their labels fit. Exits 1 where a file "
        "is off by more than 1e-6, or a thrown die by 1e-3.",
        rows=_rows,
        full=Extent(ways=len(WAYS)),
        quick=Extent(ways=2),
        amounts=(Amount("ways", "N", "ways to finish a die, from the first on"),),
        options=(recipes("YAML file"),),
        packages=("numpy", "scipy", "torch", "manifold3d"),
        unit="dice",
    )
)
