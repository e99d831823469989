"""Dice designed for throws: total variation before and after, and on changed tables."""

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

__all__ = ["ChangeLine", "DieLine", "Extent", "thrown_chart", "thrown_figure"]

ROBUST: Final = 0.02
"""Wanted of the total variation on a table with one parameter changed, chance aside."""

HALF_MARK: Final = 0.28
"""Of a noise floor in the figure, over the distance of two rows."""

CHANGES_BELOW: Final = 0.2
"""Of the dots of changed tables, over the same."""

KEY: Final = """
before: total variation from the target of the die designed for odds without momentum; after: of the
recipe's own, with its 95 % interval; floor: the mean of a perfect die. geometric, momentum: total
variation between that model's odds of the recipe's die and its throws. s: of its design, on the
wall; rounds, drops: of its refinement. *: thrown without labels. worst: the largest total variation
of the same die with one parameter of the table changed; as the largest of many it has more of
chance in it than one alone. less noise: sqrt(max(worst^2 - floor^2, 0)). Density cancels on a table
that does not move.
"""


@dataclass(frozen=True)
class Extent:
    """How much is thrown.

    Attributes
    ----------
    drops: of each die, before and after. variation_drops: on each changed table.
    variation: part of each parameter that is taken away or added, in (0, 1).
    most: drops of a round and rounds that a design may take; None for what its recipe says.
    recipes: how many are designed; None for all.
    """

    drops: int
    variation_drops: int
    variation: float = 0.2
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
    before: DieThrows | None = column("before", 8, _value)
    after: DieThrows | None = column("after", 8, _value)
    interval: tuple[float, float] | None = column(
        "", 17, lambda ends: f"{ends[0]:.4f}-{ends[1]:.4f}", default=None
    )
    noise_floor: float | None = column("floor", 8, ".4f", default=None)
    geometric: float | None = column("geometric", 11, ".4f", default=None)
    momentum: float | None = column("momentum", 10, ".4f", default=None)
    seconds: float | None = column("s", 7, ".0f", default=None)
    rounds: int | None = column("rounds", 8, default=None)
    drops: int | None = column("drops", 9, default=None)
    note: str = column("", 0, default="")

    @classmethod
    def of(cls, row: ThrownRow) -> DieLine:
        """The line of a row."""
        after = row.after
        if after is None:
            return cls(row.name, row.before, None, note=row.note)
        return cls(
            name=row.name,
            before=row.before,
            after=after,
            interval=after.to_target.interval,
            noise_floor=after.to_target.noise_floor,
            geometric=after.geometric,
            momentum=after.momentum,
            seconds=after.seconds,
            rounds=after.rounds,
            drops=after.round_drops,
            note=row.note,
        )


@dataclass(frozen=True)
class ChangeLine(Row):
    """The worst of the changed tables for a recipe's die."""

    table: ClassVar[str | None] = None

    name: str = column("recipe", -18)
    worst: float = column("worst", 9, ".4f")
    above_noise: float = column("less noise", 13, ".4f")
    noise_floor: float = column("floor", 8, ".4f")
    place: str = column("at", 0)


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.throws.thrown_dice import PARAMETERS, Thrower, throw_recipe
    from dicedesign.throws.simulation.simulation import check_throws

    extent, engine = run.extent, run.options.engine
    check_throws(extent.drops, 0, engine, "uniform")
    recipes = _recipes(run.options.recipes[: extent.recipes])
    yield {"engine": engine}
    yield "total variation from the target"
    rows: list[ThrownRow] = []
    drops = 2 * extent.drops + 2 * len(PARAMETERS) * extent.variation_drops
    with run.workers("drops", len(recipes) * drops) as workers:
        thrower = Thrower(engine, workers, run.advance, run.on_quiet)
        for number, recipe in enumerate(recipes, start=1):
            where = f"{number} of {len(recipes)}: {recipe.name}"
            row = throw_recipe(
                recipe,
                extent.drops,
                extent.variation_drops,
                extent.variation,
                thrower,
                extent.most,
                lambda stage, where=where: run.begin(f"{where}, {stage}"),  # type: ignore[misc]
            )
            yield row
            yield DieLine.of(row)
            rows.append(row)
    yield from _changes(rows, extent)
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


def _changes(rows: Sequence[ThrownRow], extent: Extent) -> Items:
    """The worst of each die, and what was left out."""
    part = f"{100.0 * extent.variation:g} %"
    yield (
        f"\nwith one parameter of the table changed by -{part} or +{part}, {extent.variation_drops}"
        " drops at each"
    )
    for row in rows:
        worst = row.worst
        if worst is not None:
            place = f"{worst.parameter} {100.0 * (worst.factor - 1.0):+.0f} %"
            found = worst.to_target
            yield ChangeLine(row.name, found.value, worst.above_noise, found.noise_floor, place)
    for row in rows:
        for reason in row.left_out:
            yield f"{row.name:<18}  left out: {reason}"
    return True


def _verdict(rows: Sequence[ThrownRow]) -> list[str]:
    """How many dice are where they are meant to be, and which are not."""
    counted = [
        row.name for row in rows if row.after is None or row.after.to_target.value > row.within
    ]
    moved = [row.name for row in rows if row.worst is None or row.worst.above_noise > ROBUST]
    lines = []
    for others, what in (
        (counted, "within what their recipes ask for, as counted"),
        (moved, f"within {ROBUST:g} on every changed table, less noise"),
    ):
        text = f"{len(rows) - len(others)} of {len(rows)} dice {what}"
        lines.append(f"{text}; not {', '.join(others)}" if others else text)
    return lines


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
    changed_label = (
        f"for throws, a parameter ±{100.0 * extent.variation:g} % "
        f"({extent.variation_drops:,} drops)"
    )
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
        changed = [change.to_target.value for change in row.changes]
        heights = [line - CHANGES_BELOW] * len(changed)
        series += [
            Curve(changed, heights, Style(FAINT, "", marker="o", size=3.0), changed_label),
            Curve(reached.interval, level, Style("#e0ab8c", width=5.5)),
            Curve([reached.value], [line], after, "for throws, 95 % interval"),
            Curve(
                [reached.noise_floor] * 2,
                [line - HALF_MARK, line + HALF_MARK],
                Style(DARK, width=2.5),
                "mean of a perfect die",
            ),
        ]
        largest = max(largest, reached.value, reached.interval[1], reached.noise_floor, *changed)
    names = [(float(k), row.name) for k, row in enumerate(reversed(thrown))]
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
        line="dice designed for throws: total variation before and after, and on changed tables",
        description="Design the die of each recipe twice, for odds without momentum and by the "
        "recipe's own method, for throws with refinement. Throw both, as they are printed, with "
        "random numbers that no design has used, and the latter also on tables with restitution, "
        "friction, height, speed, spin or size lowered or raised; --engine judges, designs keep to "
        "their own. With --quick the first two recipes, and one round of refinement. Exit code 1 "
        "if a design does not converge, or its throws are further from the target than the "
        "recipe's refine.within and chance is not the reason.",
        rows=_rows,
        full=Extent(100_000, 20_000),
        quick=Extent(4_000, 1_000, most=(2_000, 1), recipes=2),
        amounts=(
            Amount("drops", "N", "of each die"),
            Amount(
                "variation",
                "PART",
                "of each parameter that is taken away and added",
                kind=float,
                below=1.0,
            ),
            Amount("variation_drops", "N", "on each changed table"),
        ),
        options=(recipes("YAML file of method: {exact: {odds: thrown, refine: {...}}}"),),
        packages=("numpy", "scipy", "torch", "mujoco"),
        workers="how many tasks of throws at a time (default: one for each core); does not change "
        "the results",
        engine=True,
        figure=thrown_figure,
    )
)
