"""The geometric model against simulated throws: distances and what chance makes of them, shapes,
throughput, the summary and the command."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.benches import run_bench
from common.inline_executor import Inline
from common.kernels import compiled_only
from scipy.stats import binom, pearsonr

from dicedesign.bench.benches.table import Extent, table_figure, table_shapes
from dicedesign.bench.frame import BENCHES
from dicedesign.bench.measures.throws.engine_speed import die_of_11, halve_step, speeds
from dicedesign.bench.measures.throws.simulator_odds import (
    GEOMETRIC,
    TABLES,
    EngineThrows,
    ShapeOdds,
    TableOdds,
    compare_shape,
    compare_shapes,
    installed_engines,
)
from dicedesign.bench.measures.throws.simulator_summary import (
    engine_totals,
    published_correlations,
    summaries,
)
from dicedesign.bench.reference.published_distances import PublishedDistances
from dicedesign.cli.main import main
from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.runtime import executors
from dicedesign.throws.release import PAPER_DIRECTIONS
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.simulation.simulation import Throws, drop_weights
from dicedesign.throws.statistics.odds_comparison import (
    Distance,
    OddsComparison,
    Prediction,
    compare_odds,
)
from dicedesign.throws.tables import Table

UP_AND_DOWN = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
QUICK = BENCHES["table"].quick
TINY = Extent(45, 30, 2, 0.01, 100, models=False, engines=("native",))
CUBE = make_body(np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]))


class MadeUpThrows:
    """Takes the place of the simulators: MuJoCo is as the geometric model of a cube says but for
    one drop without a rest, Bullet never finds a rest but on carpets."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, str, int, int, str]] = []

    def __call__(
        self,
        body: RigidBody,
        table: Table,
        drops: int,
        seed: int,
        *,
        engine: str,
        orientations: str,
    ) -> Throws:
        self.asked.append((table.name, engine, drops, seed, orientations))
        rests = len(body.rest_heights)
        outcomes = np.arange(drops) % rests
        if engine == "mujoco":
            outcomes[0] = -1
        if engine == "bullet" and table.name != "carpet":
            outcomes[:] = -1
        weights = drop_weights(drops, "uniform")
        return Throws(table, engine, seed, outcomes, weights, rests)


def test_distances_between_two_poles_in_closed_form() -> None:
    """W is pi times the total variation, which is the difference of the first odds."""
    first, second = Prediction(np.array([0.7, 0.3])), Prediction(np.array([0.4, 0.6]))
    found = compare_odds(UP_AND_DOWN, first, second, 2, np.random.default_rng(0))
    assert found.total_variation.value == pytest.approx(0.3)
    assert found.wasserstein.value == pytest.approx(0.3 * np.pi)
    assert found.wasserstein.error == found.total_variation.error == 0.0


def test_the_error_and_the_noise_floor_are_those_of_binomial_counts() -> None:
    drops, p = 50, 0.3
    exact, counted = Prediction(np.array([p, 1.0 - p])), Prediction(np.array([0.4, 0.6]), drops)
    found = compare_odds(UP_AND_DOWN, exact, counted, 300, np.random.default_rng(1))
    law = binom(drops, p)
    floor = sum(law.pmf(k) * abs(k / drops - p) for k in range(drops + 1))
    assert found.total_variation.noise_floor == pytest.approx(floor, rel=0.12)
    assert found.wasserstein.noise_floor == pytest.approx(np.pi * floor, rel=0.12)
    # The counts are far from the odds for their number, so that hardly any draw changes the sign.
    resampled = np.abs(np.arange(drops + 1) / drops - p)
    weights = binom(drops, 0.4).pmf(np.arange(drops + 1))
    spread = np.sqrt(weights @ resampled**2 - (weights @ resampled) ** 2)
    assert found.total_variation.error == pytest.approx(spread, rel=0.12)


def test_two_counts_share_the_odds_of_the_noise_floor() -> None:
    one, other = Prediction(np.array([1.0, 0.0]), 30), Prediction(np.array([0.0, 1.0]), 10)
    found = compare_odds(UP_AND_DOWN, one, other, 200, np.random.default_rng(2))
    assert found.total_variation.error == 0.0
    ones, others = binom(30, 0.75), binom(10, 0.75)
    floor = sum(
        ones.pmf(i) * others.pmf(j) * abs(i / 30 - j / 10) for i in range(31) for j in range(11)
    )
    assert found.total_variation.noise_floor == pytest.approx(floor, rel=0.12)


def test_shapes_are_thrown_as_it_is_said() -> None:
    throw, engines = MadeUpThrows(), ("native", "mujoco", "bullet")
    found = [compare_shape(CUBE, number, engines, 60, 3, throw) for number in (0, 1)]
    assert [(t, e, n, o) for t, e, n, _, o in throw.asked] == 2 * [
        (table, engine, drops, orientations)
        for table in TABLES
        for engine, drops, orientations in (
            ("native", PAPER_DIRECTIONS, "icosahedron"),
            ("mujoco", 60, "uniform"),
            ("bullet", 60, "uniform"),
        )
    ]
    # No two sets of drops on one table begin alike.
    for table in TABLES:
        seeds = [seed for name, _, _, seed, _ in throw.asked if name == table]
        assert len(set(seeds)) == 6
    (carpet, board) = found[0].tables.values()
    assert (found[0].vertices, found[0].facets, found[0].rests) == (8, 6, 6)
    assert found[0].asymmetry == pytest.approx(0.0, abs=1e-12)
    assert {e: (t.drops, t.unresolved) for e, t in board.throws.items()} == {
        "native": (1212, 0),
        "mujoco": (60, 1),
        "bullet": (60, 60),
    }
    names = (GEOMETRIC, "native", "MuJoCo", "Bullet")
    pairs = [(a, b) for i, a in enumerate(names) for b in names[i + 1 :]]
    assert list(carpet.comparisons) == pairs
    assert list(board.comparisons) == [pair for pair in pairs if "Bullet" not in pair]
    # 9 of 59 in place of a sixth, and 10 of 59 five times: turned by a quarter.
    measured = board.comparisons[GEOMETRIC, "MuJoCo"]
    assert measured.total_variation.value == pytest.approx(1.0 / 6.0 - 9.0 / 59.0)
    assert np.pi / 2.0 <= measured.wasserstein.value / measured.total_variation.value <= np.pi
    assert board.comparisons[GEOMETRIC, "native"].wasserstein.value == pytest.approx(0.0, abs=1e-12)


def test_multiples_of_the_papers_directions_are_its_directions() -> None:
    throw = MadeUpThrows()
    compare_shape(CUBE, 0, ("mujoco",), 2 * PAPER_DIRECTIONS, 2, throw)
    assert {(n, o) for _, _, n, _, o in throw.asked} == {(2424, "icosahedron")}


def test_the_packages_own_simulator_agrees_with_the_geometric_model_without_momentum() -> None:
    body = make_body(np.random.default_rng(4).normal(size=(8, 3)))
    found = compare_shape(body, 0, ("native",), 1, 4)
    carpet, board = (found.tables[t].comparisons[GEOMETRIC, "native"] for t in TABLES)
    for gentle, thrown in (
        (carpet.wasserstein, board.wasserstein),
        (carpet.total_variation, board.total_variation),
    ):
        assert gentle.value < gentle.noise_floor
        assert thrown.value > 2.0 * thrown.noise_floor
    assert all(table.throws["native"].unresolved == 0 for table in found.tables.values())


def test_shapes_are_the_cut_ones(tmp_path: Path) -> None:
    trimesh.creation.icosphere(subdivisions=1).export(tmp_path / "mine.stl")
    quick = [body.name for body in table_shapes([], QUICK)]
    every = table_shapes([tmp_path / "mine.stl"], replace(QUICK, every=1))
    mine = [body.name for body in every if body.name.startswith("mine.stl, ")]
    assert len(mine) >= 4
    assert quick == [body.name for body in every[: -len(mine)]][:: QUICK.every]
    assert len(quick) == 7
    assert {name.split()[0] for name in quick} == {"box", "sphere"}


def test_simulators_that_are_missing_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    engines, (note,) = installed_engines(("native", "mujoco"))
    assert engines == ("native",)
    assert note.startswith("engine mujoco: expected the optional extra 'throws'")
    with pytest.raises(InputError, match=r"^engines: expected a simulator, got none; engine"):
        installed_engines(("mujoco",))


def test_throughput_and_half_a_step() -> None:
    die = die_of_11()
    (row,) = speeds([die], ("native",), 0.05)
    assert (row.body, row.vertices, row.facets) == ("hendecahedron", 11, 11)
    assert row.seconds > 0.0
    assert row.drops_per_second == row.drops / row.seconds
    halved = halve_step(die, 600, Inline())
    assert (halved.drops, halved.unresolved) == (600, 0)
    assert halved.p_value > 1e-4
    changed = halved.comparison.total_variation
    assert 0.0 < changed.value < changed.noise_floor + 5.0 * changed.error


def made_up_shapes(count: int = 12) -> list[ShapeOdds]:
    """Shapes of growing asymmetry; the third is one that Bullet knows nothing about."""
    rng = np.random.default_rng(7)
    pairs = [(GEOMETRIC, "native"), (GEOMETRIC, "Bullet"), ("native", "Bullet")]
    shapes = []
    for k in range(count):
        tables = {}
        for name in TABLES:
            comparisons = {}
            for pair in pairs:
                w = Distance(0.01 * k + 0.05 * rng.random(), 0.01, 0.02)
                if k != 2 or "Bullet" not in pair:
                    comparisons[pair] = OddsComparison(w, Distance(w.value / 2.0, 0.005, 0.01))
            throws: dict[str, EngineThrows] = {
                "native": EngineThrows(1212, 0, 1.5),
                "bullet": EngineThrows(40, 40 if k == 2 else 1, 0.5),
            }
            tables[name] = TableOdds(throws, comparisons)
        shapes.append(ShapeOdds(f"shape {k}", 8, 6, 5, 0.02 * k, tables))
    return shapes


def test_the_summary_is_the_mean_and_pearsons_correlation() -> None:
    shapes = made_up_shapes()
    rows = {(row.on, row.models): row for row in summaries(shapes)}
    assert len(rows) == 6
    for (table, models), row in rows.items():
        having = [s for k, s in enumerate(shapes) if k != 2 or "Bullet" not in models]
        values = [s.tables[table].comparisons[models].wasserstein.value for s in having]
        expected = pearsonr([s.asymmetry for s in having], values)
        assert row.shapes == len(having) == (11 if "Bullet" in models else 12)
        assert row.wasserstein.value == pytest.approx(np.mean(values))
        assert (row.wasserstein.error, row.wasserstein.noise_floor) == (
            pytest.approx(0.01),
            pytest.approx(0.02),
        )
        assert row.total_variation.value == pytest.approx(np.mean(values) / 2.0)
        assert row.correlation.coefficient == pytest.approx(expected.statistic)
        assert row.correlation.p_value == pytest.approx(expected.pvalue)
    totals = {(total.on, total.engine): total for total in engine_totals(shapes)}
    assert len(totals) == 4
    bullet = totals["carpet", "bullet"]
    assert (bullet.drops, bullet.unresolved, bullet.largest_share) == (480, 51, 1.0)
    assert bullet.seconds == pytest.approx(6.0)


def test_the_papers_figures_stand_beside_its_rows() -> None:
    printed = published_correlations(None)
    assert [(row.printed, row.printed_p_value) for row in printed] == [
        (0.47, 1e-20),
        (0.13, 5e-4),
        (0.07, 0.06),
    ]
    assert all(row.recomputed is None for row in printed)
    rho = np.linspace(0.0, 1.0, 9)
    rows = published_correlations(
        PublishedDistances(rho, {row.models: rho**k for k, row in enumerate(printed, 1)})
    )
    assert rows[0].recomputed is not None
    assert rows[0].recomputed.coefficient == pytest.approx(1.0)
    assert rows[2].recomputed is not None
    assert rows[2].recomputed.coefficient < 0.95


def test_the_figure_has_a_panel_for_each_table_and_one_for_the_paper() -> None:
    shapes = made_up_shapes()
    rho = np.linspace(0.1, 1.0, 9)
    published = PublishedDistances(rho, {"a vs b": rho**2})
    assert len(table_figure(shapes, None).pictures) == 2
    figure = table_figure(shapes, published)
    assert len(figure.pictures) == 3
    assert all((picture < 128).any() for picture in figure.pictures)


@compiled_only
def test_the_command_prints_tables_and_draws(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, picture = tmp_path / "distances.csv", tmp_path / "table.png"
    path.write_text(
        "weight_ratio,OT_us_IPC,OT_us_Bullet,OT_IPC_Bullet\n"
        + "".join(f"{k / 10},{k / 9},{k % 3},{k % 4}\n" for k in range(9))
    )
    arguments = ["table", "--distances", path, "--figure", picture, "--out", tmp_path]
    extent = replace(TINY, every=20)
    assert run_bench(*arguments, extent=extent) == 0
    text = capsys.readouterr().out
    assert "hendecahedron" in text
    assert "half the time step, 100 drops" in text
    said = "geometric model vs Rigid IPC: printed r = 0.47, p = 1e-20; its 9 shapes give r = 1.00"
    assert said in text
    assert picture.read_bytes().startswith(b"\x89PNG")
    record = json.loads((tmp_path / "table.json").read_text())
    assert len(record["shapes"]) == len(table_shapes([], extent))
    (pair,) = record["shapes"][0]["tables"]["carpet"]["comparisons"]
    assert pair["models"] == [GEOMETRIC, "native"]
    assert set(pair["wasserstein"]) == {"value", "error", "noise_floor"}
    assert [row["engine"] for row in record["throughput"]] == 2 * ["native"]
    assert record["half_step"]["drops"] == 100
    assert {(row["on"], tuple(row["models"])) for row in record["summaries"]} == {
        (table, (GEOMETRIC, "native")) for table in TABLES
    }
    assert [row["printed"] for row in record["paper"]] == [0.47, 0.13, 0.07]
    assert (record["drops"], record["left_out"]) == (extent.drops, [])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--jobs", "0"], "--jobs: expected a whole number above 0, got 0"),
        (["--distances", "no_such.csv"], "no_such.csv: expected the published table of distances"),
        (["no_such.stl"], "no_such.stl: no such file"),
    ],
)
def test_bad_input_is_said_plainly(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "table", "--quick", *options]) == 2
    assert message in capsys.readouterr().err


def test_drops_do_not_depend_on_who_runs_them() -> None:
    body: Body = make_body(np.random.default_rng(4).normal(size=(8, 3)))
    with executors.local_workers(2) as workers:
        (there,) = compare_shapes([body], ("native",), TINY.drops, TINY.draws, workers)
    own = compare_shape(body, 0, ("native",), TINY.drops, TINY.draws)
    for name in TABLES:
        assert there.tables[name].comparisons == own.tables[name].comparisons
