"""Dice designed for throws: what is thrown how often onto which table, what is counted, and the
command."""

from __future__ import annotations

import json
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.benches import run_bench
from common.inline_executor import Inline
from scipy.stats import binom

from dicedesign.bench.benches.thrown import DieLine, Extent, TablesLine, thrown_figure
from dicedesign.bench.frame import BENCHES, Run
from dicedesign.bench.measures.throws.thrown_dice import (
    FRESH,
    Thrower,
    ThrownRow,
    refinement_of,
    throw_recipe,
)
from dicedesign.cli.main import main
from dicedesign.errors import InputError
from dicedesign.recipe.schema.reading import checked_recipe
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.results.status import Status
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.simulation.simulation import Throws
from dicedesign.throws.statistics.total_variation import MeasuredDistance
from dicedesign.throws.tables import Table, table_named

LOST = 30
TINY = Extent(300 + LOST, 90 + LOST)
POSTERIOR = [
    {"restitution": e, "friction": 0.2, "height": [0.08, 0.12], "speed": 0.3, "spin": 15.0}
    for e in (0.65, 0.7, 0.6)
]
ALL_DROPS = 2 * TINY.drops + len(POSTERIOR) * TINY.table_drops
FAIR = {
    "name": "three",
    "target": {"fair": 3},
    "symmetry": "D3h",
    "seed": 4,
    "method": {"exact": {"odds": "thrown", "refine": {"drops": 200, "rounds": 2}}},
}


def recipe(**changes: Any) -> Recipe:
    return checked_recipe({**FAIR, **changes})


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The path of a table that may be one of three others."""
    path = tmp_path_factory.mktemp("tables") / "fitted.json"
    numbers = {"restitution": 0.65, "friction": 0.2, "height": 0.1, "speed": 0.3, "spin": 15.0}
    path.write_text(json.dumps({"name": "fitted", **numbers, "posterior": POSTERIOR}))
    return str(path)


def onto(table: str) -> dict[str, Any]:
    """The recipe's method, for another table."""
    return {"exact": {**FAIR["method"]["exact"], "table": table}}


@dataclass
class MadeUpThrows:
    """Takes the place of the simulator of the fresh throws: each rest as often as any, but always
    the same where restitution is lowered; and always `LOST` drops without a rest."""

    asked: list[tuple[RigidBody, Table, int, int, str]] = field(default_factory=list)
    lost: int = LOST

    def __call__(
        self,
        body: RigidBody,
        table: Table,
        drops: int,
        seed: int,
        *,
        engine: str,
        workers: Executor,
        progress: Callable[[int], None],
        on_quiet: None,
    ) -> Throws:
        self.asked.append((body, table, drops, seed, engine))
        rests = len(body.rest_heights)
        outcomes = np.arange(drops) % rests
        if table.restitution < 0.64:
            outcomes[:] = 0
        outcomes[drops - self.lost :] = -1
        progress(drops)
        return Throws(table, engine, seed, outcomes, np.ones(drops), rests)  # type: ignore[arg-type]


@dataclass(frozen=True)
class MadeUpRun:
    """A row, what was thrown for it, and what was said meanwhile."""

    row: ThrownRow
    throws: MadeUpThrows
    stages: list[str]
    drops: int


def made_up_run(lost: int = LOST, **changes: Any) -> MadeUpRun:
    throws, stages, counted = MadeUpThrows(lost=lost), [], []
    thrower = Thrower("native", Inline(), counted.append, throw=throws)
    amounts = TINY.drops, TINY.table_drops
    row = throw_recipe(recipe(**changes), *amounts, thrower, on_stage=stages.append)
    return MadeUpRun(row, throws, stages, sum(counted))


@pytest.fixture(scope="module")
def run(fitted: str) -> MadeUpRun:
    """Of the recipe on that table."""
    return made_up_run(method=onto(fitted))


def test_both_dice_are_thrown_and_the_refined_one_on_other_tables(
    run: MadeUpRun, fitted: str
) -> None:
    row, throws = run.row, run.throws
    assert run.stages == ["design without momentum", "design for throws", "other tables"]
    assert run.drops == ALL_DROPS
    assert [drops for _, _, drops, _, _ in throws.asked] == [330] * 2 + [120] * 3
    seeds = [seed for _, _, _, seed, _ in throws.asked]
    assert len(set(seeds)) == len(seeds)
    assert min(seeds) >= FRESH
    bodies = [id(body) for body, *_ in throws.asked]
    assert len(set(bodies[1:])) == 1
    assert bodies[0] != bodies[1]
    as_is = throws.asked[1][1]
    # Of the recipe, for a die of 30 mm from vertex to vertex.
    assert replace(as_is, size=0.025) == table_named(fitted)
    assert 0.0299 < as_is.size < 0.036
    assert [table.restitution for _, table, *_ in throws.asked[2:]] == [0.65, 0.7, 0.6]
    assert {table.height for _, table, *_ in throws.asked[2:]} == {(0.08, 0.12)}
    assert {table.size for _, table, *_ in throws.asked[1:]} == {as_is.size}
    assert [one.table["restitution"] for one in row.elsewhere] == [0.65, 0.7, 0.6]


def floor_of(drops: int) -> float:
    """Mean absolute deviation of three binomial counts."""
    chances = binom.pmf(np.arange(drops + 1), drops, 1 / 3)
    return float(1.5 * (chances * np.abs(np.arange(drops + 1) / drops - 1 / 3)).sum())


def test_total_variations_are_those_of_the_counts(run: MadeUpRun, fitted: str) -> None:
    row = run.row
    before, after = row.before, row.after
    assert before is not None
    assert after is not None
    for judged in (before, after):
        assert judged.status is Status.CONVERGED
        assert (judged.drops, judged.lost) == (330, LOST)
        assert judged.to_target.value == pytest.approx(0.0, abs=1e-12)
        assert judged.to_target.noise_floor == pytest.approx(floor_of(300), rel=1e-9)
        assert judged.engraved
    assert (before.rounds, before.round_drops) == (0, 0)
    # Symmetry alone makes it right.
    assert (after.rounds, after.round_drops, after.symmetry) == (0, 0, "D3h")
    assert set(after.seconds) == {"design", "file", "throws"}
    # Odds without momentum are what the first die was designed for; labels move them a little.
    assert before.geometric < 0.002
    assert [one.to_target.value for one in row.elsewhere] == pytest.approx([0, 0, 2 / 3], abs=1e-9)
    assert [one.lost for one in row.elsewhere] == [LOST] * 3
    assert row.worst == pytest.approx(2 / 3)
    assert row.often == pytest.approx(0.8 * 2 / 3)
    assert row.chance is not None
    # The largest of three series of a perfect die.
    assert floor_of(90) < row.chance[0] < row.chance[1] < 3.0 * floor_of(90)
    assert (row.name, row.table_name, row.engine, row.within) == (
        "three",
        fitted,
        "native",
        0.01,
    )
    assert not row.missed
    assert row.note == ""


def test_a_die_is_thrown_as_it_is_printed(run: MadeUpRun) -> None:
    plain = made_up_run(engrave=False)
    assert plain.row.before is not None
    assert not plain.row.before.engraved
    engraved, whole = (made.throws.asked[0][0] for made in (run, plain))
    assert engraved.radius == pytest.approx(whole.radius, rel=5e-3)
    # Hollows move the center of mass, and the rests of one orbit are no longer alike.
    assert np.ptp(whole.rest_heights) < 1e-7
    assert 1e-6 < np.ptp(engraved.rest_heights) < 1e-2
    # Labels that do not fit are left out.
    small = made_up_run(size_mm=3.0).row
    assert small.before is not None
    assert not small.before.engraved
    assert small.note == ""


def test_a_table_without_others_is_varied_by_its_restitution(fitted: str, tmp_path: Path) -> None:
    entries = json.loads(Path(fitted).read_text())
    del entries["posterior"]
    alone = tmp_path / "alone.json"
    alone.write_text(json.dumps(entries))
    row = made_up_run(method=onto(str(alone))).row
    others = [one.table["restitution"] for one in row.elsewhere]
    assert others == pytest.approx([1.2 * 0.65, 0.8 * 0.65])


def test_a_further_die_need_not_be_compared(fitted: str) -> None:
    throws, stages = MadeUpThrows(), []
    thrower = Thrower("native", Inline(), throw=throws)
    row = throw_recipe(
        recipe(method=onto(fitted)),
        60 + LOST,
        30 + LOST,
        thrower,
        is_compared=False,
        on_stage=stages.append,
    )
    assert stages == ["design for throws", "other tables"]
    assert row.before is None
    assert row.after is not None
    assert not row.missed


def test_a_design_that_fails_is_a_row_with_the_reason() -> None:
    row = made_up_run(lost=TINY.drops).row
    assert row.before is None
    assert row.after is None
    assert row.worst is None
    assert row.missed
    assert row.note.startswith("throws: expected drops that end on a facet with a label, got none")
    line = DieLine.of(row).line()
    assert line.split()[:11] == ["three", "4", *["-"] * 9]
    assert line.endswith(f"  {row.note}")


def test_a_die_is_missed_only_where_chance_is_not_the_reason(run: MadeUpRun) -> None:
    row = run.row
    assert row.after is not None
    for low, status, missed in (
        (0.009, Status.CONVERGED, False),
        (0.011, Status.CONVERGED, True),
        (0.0, Status.TIME_LIMIT, True),
    ):
        variation = MeasuredDistance(0.02, (low, 0.03), 0.01)
        other = replace(row, after=replace(row.after, to_target=variation, status=status))
        assert other.missed is missed


def test_the_figure_has_every_die_that_was_thrown(run: MadeUpRun) -> None:
    row = run.row
    nothing = replace(row, name="nothing", before=None, after=None, elsewhere=())
    figure = thrown_figure([row, nothing, replace(row, name="again")], Run(TINY))
    assert {"three", "again"} <= set(figure.texts)
    assert "nothing" not in figure.texts
    with pytest.raises(InputError, match="expected at least one that was thrown"):
        thrown_figure([nothing], Run(TINY))


@pytest.fixture
def recipe_file(tmp_path: Path) -> Path:
    path = tmp_path / "three.yaml"
    path.write_text(json.dumps(FAIR))
    return path


def test_the_command_prints_tables_and_draws(
    recipe_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn, extent = tmp_path / "thrown.png", Extent(600, 200, 2, most=(500, 1))
    arguments = ["thrown", recipe_file, "--figure", drawn, "--out", tmp_path]
    assert run_bench(*arguments, extent=extent) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split()[:5] == ["recipe", "seed", "before", "after", "floor"]
    assert [line.split()[:2] for line in lines[2:4]] == [["three", "4"], ["three", "5"]]
    assert any("what the table may be instead, 200 drops at each" in line for line in lines)
    assert any("of 2 dice within 2 times that on nine in ten" in line for line in lines)
    assert drawn.read_bytes().startswith(b"\x89PNG")
    record = json.loads((tmp_path / "thrown.json").read_text())
    first, second = record["rows"]
    assert (first["after"]["drops"], first["after"]["status"]) == (600, "converged")
    assert first["before"] is not None
    assert second["before"] is None
    assert (first["seed"], second["seed"]) == (4, 5)
    for row in (first, second):
        assert row["after"]["to_target"]["value"] < 0.1
        assert {made["drops"] for made in row["elsewhere"]} == {200}


def test_the_line_of_other_tables() -> None:
    line = TablesLine("three", 4, 0.0123, 0.01, 0.02, 0.015, 32, "D3h").line()
    assert line.split() == ["three", "4", "0.0123", "0.0100", "0.0200", "0.0150", "32", "D3h"]


def test_the_verdict_can_be_mujocos(recipe_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mujoco")
    few = ["--drops", "100", "--table-drops", "2", "--quick", "--jobs", "1", "--json"]
    main(["bench", "thrown", str(recipe_file), *few, "--engine", "mujoco"])
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["engine"] == "mujoco"
    assert row["after"]["to_target"]["value"] < 0.2


def test_quick_takes_two_recipes_and_a_round() -> None:
    quick = BENCHES["thrown"].quick
    assert (quick.recipes, quick.most) == (2, (2_000, 1))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--seeds", "0"], "--seeds: expected at least 1, got 0"),
        (["--engine", "dice"], "engine: expected native, mujoco, bullet, got 'dice'"),
        (["--jobs", "0"], "--jobs: expected a whole number above 0, got 0"),
        (["nothing.yaml"], "nothing.yaml: no such file"),
    ],
)
def test_bad_input_is_said_plainly(
    recipe_file: Path, arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "thrown", str(recipe_file), *arguments]) == 2
    printed = capsys.readouterr()
    assert said in printed.err
    assert printed.out == ""


@pytest.mark.parametrize(
    ("method", "said"),
    [
        ("exact", "got exact with odds: resting"),
        ({"exact": {"odds": "thrown"}}, "got exact with odds: thrown, without refine"),
        ("paper", "got paper"),
    ],
)
def test_recipes_of_another_method_are_refused(
    method: Any, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "other.yaml"
    start = {"prism": {}} if method == "paper" else {"search": {}}
    content = {"name": "other", "target": {"fair": 6}, "start": start, "method": method}
    path.write_text(json.dumps(content))
    assert main(["bench", "thrown", str(path)]) == 2
    error = capsys.readouterr().err
    assert f"{path}: other: expected method: {{exact: {{odds: thrown, refine: {{}}}}}}" in error
    assert said in error
    with pytest.raises(InputError, match="leave the recipe out"):
        refinement_of(checked_recipe(content))
