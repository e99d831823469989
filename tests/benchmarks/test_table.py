"""Fits of tables to counts, against known probabilities and refits, and the files they read and
write."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from common.finished import box_file, finished_run
from common.kernels import compiled_only
from common.paths import public_data
from common.thrown import box, rigid_body_with_rests
from scipy import stats
from scipy.special import expit, logit, xlogy

from benchmarks import table_posterior
from benchmarks.frame import main
from benchmarks.table import read_throws
from benchmarks.table_posterior import (
    CountedDie,
    Posterior,
    Surrogate,
    Throw,
    p_value,
    throw_die,
)
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.distances import jeffreys_means
from dicedesign.throws.goodness_of_fit import chi_square
from dicedesign.throws.momentum_model import momentum_model
from dicedesign.throws.tables import least_of, load_table, mixture_tables

pytest.importorskip("sklearn")


def coin(name: str, *counts: int, session: str | None = None, material: str = "") -> CountedDie:
    """Box with two outcomes or more."""
    body, poses = rigid_body_with_rests(box(1.0, 1.2, 1.4))
    of_rest = np.arange(len(poses.normals)) % len(counts)
    labels, came = tuple("abc"[: len(counts)]), np.array(counts)
    return CountedDie(name, body, poses, of_rest, labels, came, session or name, material)


def probability(height: float, restitution: float) -> float:
    return float(expit(5.0 * (restitution - 0.55) + 1.5 * np.log(height / 0.15)))


def throw_known(throws: Sequence[Throw]) -> list[np.ndarray]:
    """Counts from known probabilities of restitution and height instead of simulated ones."""
    counts = []
    for die, table, drops, seed in throws:
        height = 0.15 if die.name.startswith("flat") else np.mean(table.height)
        came = np.random.default_rng(seed).binomial(drops, probability(height, table.restitution))
        counts.append(np.array([came, drops - came]))
    return counts


def test_the_surrogate_is_within_its_errors() -> None:
    """Of known smooth probabilities, from noisy counts; the likelihood is the mean of the
    Dirichlet-multinomial over draws of the surrogate."""
    rng = np.random.default_rng(4)

    def true(points: np.ndarray) -> np.ndarray:
        first = expit(2.0 * points[:, 0] - 2.0 + np.sin(3.0 * points[:, 1]))
        return np.stack([first, 0.3 * (1.0 - first), 0.7 * (1.0 - first)], axis=1)

    sets, new = rng.random((80, 2)), rng.random((400, 2))
    surrogate = Surrogate(coin("x", 30, 0, 50), sets, rng.multinomial(500, true(sets)))
    means, deviations = surrogate.predict(new)
    p = true(new)
    errors = means - logit(np.stack([p[:, 0], p[:, 1] / (1.0 - p[:, 0])], axis=1))
    # A single count of 500 has a deviation of 0.09 or more.
    assert errors.std() < 0.05
    assert 0.3 < (errors / deviations).std() < 2.0
    counts = surrogate.die.counts
    drawn = surrogate.draw_probabilities(np.tile(new[:1], (40_000, 1)), rng)
    mean = np.exp(stats.dirichlet_multinomial.logpmf(counts, 300.0 * drawn, 80)).mean()
    likelihood = surrogate.log_likelihood(new[:1], np.array([300.0]))
    orders = stats.multinomial.logpmf(counts, 80, counts / 80) - xlogy(counts, counts / 80).sum()
    assert likelihood[0] == pytest.approx(np.log(mean) - orders, abs=0.02)


def test_throws_that_gave_the_counts_are_recovered(monkeypatch: pytest.MonkeyPatch) -> None:
    """The restitution of each of two materials, by dice that do not feel the height."""
    monkeypatch.setattr(table_posterior, "FINAL", (2**9, 2))
    rng, true, dice = np.random.default_rng(8), {"steel": 0.4, "plastic": 0.7}, []
    for (material, restitution), i in product(true.items(), range(3)):
        came = rng.binomial(1000, probability(0.15, restitution))
        dice.append(coin(f"flat {material} {i}", came, 1000 - came, material=material))
    posterior = Posterior(dice, [], 32, 2000, 3, throw_known)
    for material, restitution in true.items():
        name = f"restitution of {material}"
        fitted, mean, deviation, low, high, before = posterior.parameters()[name]
        assert low < restitution < high
        assert abs(fitted - mean) < deviation < 0.4 * before


def test_leaving_a_die_out_is_a_fit_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """And dice of one session share its hand, which one of them tells."""
    monkeypatch.setattr(table_posterior, "FINAL", (2**10, 2**4))
    spreads = []
    for session in (None, "evening"):
        first = coin("one", 160, 240, session=session)
        other = coin("two", 60, 40, session=session)
        posterior = Posterior([first, other], [], 32, 2000, 3, throw_known)
        refit = Posterior([first], [other], 32, 2000, 5, throw_known)
        left_out = posterior.predict(1, without_own=True)
        again = refit.predict(1, without_own=False)
        assert left_out.mean(axis=0) == pytest.approx(again.mean(axis=0), abs=0.03)
        assert left_out.std(axis=0) == pytest.approx(again.std(axis=0), rel=0.2)
        spreads.append(left_out.std())
    assert spreads[1] < 0.8 * spreads[0]


@compiled_only
def test_the_table_of_a_file_of_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a mesh, whose outcomes have several faces and may be equal, and the folder of a run. The
    table is one for --table."""
    for name, value in (("PILOT", (2**8, 4)), ("FINAL", (2**8, 4)), ("DRAWS", 2**8)):
        monkeypatch.setattr(table_posterior, name, value)
    poses = rest_poses(read_body(box_file(tmp_path, (1.0, 1.0, 1.6))))
    is_square = np.abs(poses.normals[:, 2]) > 0.5
    square = poses.probabilities[is_square].sum()
    facets = [("xyz"[i], sign * np.eye(3)[i]) for i in range(3) for sign in (-1.0, 1.0)]
    box_file(finished_run(tmp_path / "run", "xyz", [1 / 3] * 3, facets), name="die_plain.stl")
    rows = [f"b,box.obj,{k},9,{(1.0 - square) / 2.0}" for k in "st"]
    rows += [f"b,box.obj,square,4,{square}", "c,run,z,5,", "c,run,x,70,", "c,run,y,30,"]
    throws = tmp_path / "throws.csv"
    throws.write_text("\n".join(["die,mesh,outcome,throws,geometric", *rows]))
    mesh, run = read_throws(throws)
    assert (mesh.labels, mesh.counts.tolist()) == (["s or t", "square"], [18, 4])
    assert ((mesh.outcome_of_rest == 1) == is_square).all()
    assert (run.labels, run.counts.tolist()) == (["z", "x", "y"], [5, 70, 30])
    axes = np.abs(run.poses.normals).argmax(axis=1)
    assert run.outcome_of_rest.tolist() == [(1, 2, 0)[axis] for axis in axes]
    written = tmp_path / "mine.json"
    given = ["table", "--throws", str(throws), "--check", "b", "--jobs", "1"]
    assert main([*given, "--quick", "--drops", "5", "--to", str(written)]) == 0
    table = load_table(str(written))
    assert (table.name, table.source) == ("mine", "fitted to 105 throws of c")
    assert least_of(table.height) >= 0.025
    assert len(mixture_tables(str(written))) == 32
    assert momentum_model(str(written)) is not None
    assert main([*given, "--dice", "b"]) == main([*given, "--evaluations", "5"]) == 2


@compiled_only
@pytest.mark.full
def test_published_dice_are_consistent_with_board_game() -> None:
    """And two of them not with the probabilities without momentum."""
    tables, is_known = mixture_tables("board-game"), []
    for die in read_throws(public_data("published/throws.csv"))[:4]:
        # Each session has one table of the mixture.
        counts = [throw_die((die, table, 300, (12, k))) for k, table in enumerate(tables)]
        probabilities = np.array([jeffreys_means(one) for one in counts])
        assert p_value(die.counts, probabilities, np.random.default_rng(0)) > 0.01
        resting = die.by_outcome(die.poses.probabilities)
        is_known.append(chi_square(die.counts, resting / resting.sum()).p_value > 0.01)
    assert is_known == [True, True, False, False]
