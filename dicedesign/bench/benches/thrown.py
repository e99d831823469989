"""Dice designed for throws: total variation before and after, and on other tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Amount, recipes
from dicedesign.bench.rows import Row, column
from dicedesign.errors import InputError

if TYPE_CHECKING:
    from dicedesign.bench.measures.throws.thrown_dice import DieThrows, ThrownRow
    from dicedesign.recipe.schema.recipe import Recipe
    from dicedesign.report.charts.chart import Chart
    from dicedesign.report.charts.paper import Paper
    from dicedesign.report.charts.series import Series

__all__ = ["DieLine", "Extent", "TablesLine", "thrown_chart", "thrown_figure"]

LOOSER: Final = 2.0
"""Total variation that nine in ten of the other tables may have, over what a recipe asks for."""

MANY_TABLES: Final = 32
"""Tables of a posterior, as a rule."""

HALF_MARK: Final = 0.28
"""Of a noise floor in the figure, over the distance of two rows."""

TABLES_BELOW: Final = 0.2
"""Of the dots of other tables, over the same."""

KEY: Final = """
before: total variation from the target of the die designed for odds without momentum; after: of the
recipe's own, with its 95 % interval; floor: the mean of a perfect die. geometric, momentum: total
variation between that model's odds of the recipe's die and its throws. s: of its design, of its
file with labels, of the throws of the finished die, on the wall; rounds, drops: of its refinement.
*: thrown without labels. 90 %, worst: total variation that nine in ten of the other tables do not
exceed, and the largest; chance: the mean of a perfect die, which has the same odds on all of them.
"""


@dataclass(frozen=True)
class Extent:
    """How much is thrown.

    Attributes
    ----------
    drops: of each die, before and after. table_drops: on each of the other tables.
    seeds: dice of each recipe, with its own seed and those after it.
    most: drops of the first round and rounds that a design may take; None for what its recipe says.
    recipes: how many are designed; None for all.
    """

    drops: int
    table_drops: int
    seeds: int = 1
    most: tuple[int, int] | None = None
    recipes: int | None = None


def _mark(engraved: bool) -> str:
    return "" if engraved else "*"


def _value(throws: DieThrows) -> str:
    return f"{throws.to_target.value:.4f}{_mark(throws.engraved)}"


@dataclass(frozen=True)
class DieLine(Row):
    """A recipe's dice in the table; see `ThrownRow`."""

    table: ClassVar[str | None] = None

    name: str = column("recipe", -18)
    seed: int = column("seed", 5)
    before: DieThrows | None = column("before", 8, _value)
    after: DieThrows | None = column("after", 8, _value)
    interval: tuple[float, float] | None = column(
        "", 17, lambda ends: f"{ends[0]:.4f}-{ends[1]:.4f}", default=None
    )
    noise_floor: float | None = column("floor", 8, ".4f", default=None)
    geometric: float | None = column("geometric", 11, ".4f", default=None)
    momentum: float | None = column("momentum", 10, ".4f", default=None)
    seconds: str | None = column("s", 12, default=None)
    rounds: int | None = column("rounds", 8, default=None)
    drops: int | None = column("drops", 9, default=None)
    note: str = column("", 0, default="")

    @classmethod
    def of(cls, row: ThrownRow) -> DieLine:
        """The line of a row."""
        after = row.after
        if after is None:
            return cls(row.name, row.seed, row.before, None, note=row.note)
        return cls(
            name=row.name,
            seed=row.seed,
            before=row.before,
            after=after,
            interval=after.to_target.interval,
            noise_floor=after.to_target.noise_floor,
            geometric=after.geometric,
            momentum=after.momentum,
            seconds="+".join(f"{part:.0f}" for part in after.seconds.values()),
            rounds=after.rounds,
            drops=after.round_drops,
            note=row.note,
        )


@dataclass(frozen=True)
class TablesLine(Row):
    """What a recipe's die does on other tables."""

    table: ClassVar[str | None] = None

    name: str = column("recipe", -18)
    seed: int = column("seed", 5)
    often: float = column("90 %", 9, ".4f")
    chance_often: float = column("chance", 9, ".4f")
    worst: float = column("worst", 9, ".4f")
    chance_worst: float = column("chance", 9, ".4f")
    tables: int = column("tables", 8)
    symmetry: str = column("symmetry", 10)


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.throws.thrown_dice import Thrower, throw_recipe
    from dicedesign.throws.simulation import check_throws

    extent, engine = run.extent, run.options.engine
    check_throws(extent.drops, 0, engine, "uniform")
    recipes = _recipes(run.options.recipes[: extent.recipes])
    yield {"engine": engine}
    yield "total variation from the target"
    rows: list[ThrownRow] = []
    drops = (1 + extent.seeds) * extent.drops + extent.seeds * MANY_TABLES * extent.table_drops
    with run.workers("drops", len(recipes) * drops) as workers:
        thrower = Thrower(engine, workers, run.advance, run.on_quiet)
        for number, recipe in enumerate(recipes, start=1):
            for further in range(extent.seeds):
                seed = recipe.seed + further
                where = f"{number} of {len(recipes)}: {recipe.name}, seed {seed}"
                row = throw_recipe(
                    recipe.model_copy(update={"seed": seed}),
                    extent.drops,
                    extent.table_drops,
                    thrower,
                    extent.most,
                    is_compared=further == 0,
                    on_stage=lambda stage, where=where: run.begin(f"{where}, {stage}"),  # type: ignore[misc]
                )
                yield row
                yield DieLine.of(row)
                rows.append(row)
    yield from _elsewhere(rows, extent)
    yield "\n".join([KEY, *_verdict(rows)])
    return not any(row.missed for row in rows)


def _recipes(paths: Sequence[Path]) -> list[Recipe]:
    """All recipes; what is wrong with one is said before anything is designed."""
    from dicedesign.bench.measures.throws.thrown_dice import refinement_of
    from dicedesign.recipe.schema.reading import read_recipe

    recipes = []
    for path in paths:
        recipe = read_recipe(path)
        try:
            refinement_of(recipe)
        except InputError as error:
            raise InputError(f"{path}: {error}") from error
        recipes.append(recipe)
    return recipes


def _elsewhere(rows: Sequence[ThrownRow], extent: Extent) -> Items:
    """What each die does on other tables."""
    yield f"\non what the table may be instead, {extent.table_drops} drops at each"
    for row in rows:
        if row.chance is not None and row.after is not None:
            assert row.often is not None
            assert row.worst is not None
            yield TablesLine(
                row.name,
                row.seed,
                row.often,
                row.chance[0],
                row.worst,
                row.chance[1],
                len(row.elsewhere),
                row.after.symmetry or "none",
            )
    return True


def _verdict(rows: Sequence[ThrownRow]) -> list[str]:
    """How many dice are where they are meant to be, and which are not."""
    counted = [
        _named(row) for row in rows if row.after is None or row.after.to_target.value > row.within
    ]
    moved = [_named(row) for row in rows if row.often is None or row.often > LOOSER * row.within]
    lines = []
    for others, what in (
        (counted, "within what their recipes ask for, as counted"),
        (moved, f"within {LOOSER:g} times that on nine in ten of the other tables"),
    ):
        text = f"{len(rows) - len(others)} of {len(rows)} dice {what}"
        lines.append(f"{text}; not {', '.join(others)}" if others else text)
    return lines


def _named(row: ThrownRow) -> str:
    return f"{row.name} ({row.seed})"


def thrown_chart(rows: Sequence[Row], run: Run) -> Chart:
    """Total variation from the target of each die, on one line.

    Raises InputError: no die was thrown.
    """
    from dicedesign.bench.measures.throws.thrown_dice import ThrownRow
    from dicedesign.report.charts.axes import Axis
    from dicedesign.report.charts.chart import Chart
    from dicedesign.report.charts.palette import ACCENT, DARK, FAINT, PALE
    from dicedesign.report.charts.series import Curve, Style

    extent: Extent = run.extent
    dice = [row for row in rows if isinstance(row, ThrownRow)]
    thrown = [row for row in dice if row.after is not None]
    if not thrown:
        raise InputError("dice: expected at least one that was thrown, got none; see the notes")
    before, after = (Style(color, "", marker="o", size=7.5) for color in (PALE, ACCENT))
    elsewhere_label = f"for throws, on other tables ({extent.table_drops:,} drops)"
    series: list[Series] = []
    largest = 0.0
    for line, row in zip(range(len(thrown) - 1, -1, -1), thrown, strict=True):
        assert row.after is not None
        reached = row.after.to_target
        level = [line, line]
        if row.before is not None:
            start = row.before.to_target.value
            series.append(Curve([start, reached.value], level, Style(PALE)))
            series.append(Curve([start], [line], before, "without momentum"))
            largest = max(largest, start)
        elsewhere = [one.to_target.value for one in row.elsewhere]
        heights = [line - TABLES_BELOW] * len(elsewhere)
        series += [
            Curve(elsewhere, heights, Style(FAINT, "", marker="o", size=3.0), elsewhere_label),
            Curve(reached.interval, level, Style("#e0ab8c", width=5.5)),
            Curve([reached.value], [line], after, "for throws, 95 % interval"),
            Curve(
                [reached.noise_floor] * 2,
                [line - HALF_MARK, line + HALF_MARK],
                Style(DARK, width=2.5),
                "mean of a perfect die",
            ),
        ]
        largest = max(largest, reached.value, reached.interval[1], reached.noise_floor, *elsewhere)
    several = len({row.name for row in thrown}) < len(thrown)
    names = [
        (float(k), _named(row) if several else row.name) for k, row in enumerate(reversed(thrown))
    ]
    return Chart(
        (250.0, 60.0, 1230.0, 60.0 + 82.0 * len(thrown)),
        Axis(0.0, 1.05 * largest, "total variation from the target"),
        Axis(-0.6, len(thrown) - 0.4, ticks=names),
        series,
        f"{extent.drops:,} throws of each die, before and after",
        grid="x",
    )


def thrown_figure(rows: Sequence[Row], run: Run) -> Paper:
    """`thrown_chart` with its legend below. Raises InputError: as that."""
    from dicedesign.report.charts.chart import draw_legend, sheet

    chart = thrown_chart(rows, run)
    paper = sheet([chart], below=180.0)
    draw_legend(paper, chart.series, (paper.width / 2.0, paper.height - 90.0), columns=2)
    return paper


BENCHES.register(
    Bench(
        name="thrown",
        line="dice designed for throws: total variation before and after, and on other tables",
        description="Design the die of each recipe twice, for odds without momentum and by the "
        "recipe's own method, for throws with refinement. Throw both, as they are printed, with "
        "random numbers that no design has used, and the latter also onto what its table may be "
        "instead: those of the table's posterior, or a livelier and a duller one; --engine judges, "
        "designs keep to their own. With --seeds further dice of each recipe. With --quick the "
        "first two recipes, and one round of refinement. Exit code 1 if a design does not "
        "converge, or its throws are further from the target than the recipe's refine.within and "
        "chance is not the reason.",
        rows=_rows,
        full=Extent(100_000, 20_000),
        quick=Extent(4_000, 200, most=(2_000, 1), recipes=2),
        amounts=(
            Amount("drops", "N", "of each die"),
            Amount("table_drops", "N", "on each of the other tables"),
            Amount("seeds", "N", "dice of each recipe, each with a seed of its own"),
        ),
        options=(recipes("YAML file of method: {exact: {odds: thrown, refine: {...}}}"),),
        packages=("numpy", "scipy", "torch", "mujoco"),
        workers="how many tasks of throws at a time (default: one for each core); does not change "
        "the results",
        engine=True,
        figure=thrown_figure,
    )
)
