"""Tests of odds, against SciPy, brute force and published throws."""

from __future__ import annotations

import csv
import math
from itertools import product

import numpy as np
import pytest
from common.paths import public_data
from scipy import stats

from dicedesign.throws import goodness_of_fit as module
from dicedesign.throws.goodness_of_fit import chi_square, exact_multinomial, two_sample_chi_square


def published(die: str, column: str) -> np.ndarray:
    """(k,) of a printed die, summed over outcomes that its symmetry cannot tell apart."""
    with public_data("published/throws.csv").open() as file:
        values = np.array([float(row[column]) for row in csv.DictReader(file) if row["die"] == die])
    half = len(values) // 2
    pairs = values[:half] + values[::-1][:half]
    return pairs if len(values) % 2 == 0 else np.append(pairs, values[half])


@pytest.mark.parametrize(
    ("die", "model", "statistic", "degrees"),
    [
        ("2d6_hendecahedron", "geometric", 36.7, 5),
        ("2d6_hendecahedron", "bullet", 13.4, 5),
        ("2d6_hendecahedron", "ipc", 12.4, 5),
        ("binomial3", "geometric", 1.3, 1),
        ("binomial2", "geometric", 0.04, 1),
    ],
)
def test_published_throws(die: str, model: str, statistic: float, degrees: int) -> None:
    """The figures that were found of them before this package was written."""
    counts, odds = published(die, "throws"), published(die, model)
    found = chi_square(counts, odds / odds.sum())
    assert found.statistic == pytest.approx(statistic, abs=0.06)
    assert found.degrees == degrees
    assert found.p_value == pytest.approx(stats.chi2.sf(found.statistic, degrees), rel=1e-12)


def test_chi_square_as_in_scipy() -> None:
    counts, odds = np.array([18, 25, 9, 48]), np.array([0.2, 0.2, 0.1, 0.5])
    found, expected = chi_square(counts, odds), stats.chisquare(counts, 100 * odds)
    assert found.statistic == pytest.approx(expected.statistic, rel=1e-14)
    assert found.p_value == pytest.approx(expected.pvalue, rel=1e-12)


def test_outcomes_that_cannot_come_up() -> None:
    assert chi_square([4, 6, 0], [0.5, 0.5, 0.0]) == chi_square([4, 6], [0.5, 0.5])
    impossible = chi_square([4, 6, 1], [0.5, 0.5, 0.0])
    assert (impossible.statistic, impossible.p_value) == (math.inf, 0.0)
    assert chi_square([3], [1.0]).p_value == 1.0


def test_two_samples_as_in_scipy() -> None:
    first, second = np.array([30, 0, 12, 7]), np.array([55, 0, 40, 2])
    found = two_sample_chi_square(first, second)
    expected = stats.chi2_contingency(np.stack([first, second])[:, [0, 2, 3]], correction=False)
    assert found.statistic == pytest.approx(expected.statistic, rel=1e-13)
    assert (found.degrees, found.p_value) == (2, pytest.approx(expected.pvalue, rel=1e-12))


def test_what_one_of_two_samples_never_showed_counts() -> None:
    table = np.array([[30, 0, 12], [55, 4, 40]])
    found, expected = two_sample_chi_square(*table), stats.chi2_contingency(table, correction=False)
    assert (found.statistic, found.degrees) == (pytest.approx(expected.statistic, rel=1e-13), 2)


def test_two_samples_of_the_throws_of_a_pig() -> None:
    """Do a black and a pink pig land alike, by the margins of Kern's table of pairs?"""
    with public_data("published/kern2006_pass_the_pigs.csv").open() as file:
        rows = list(csv.reader(file))[1:]
    table = np.array([[float(entry) for entry in row[1:]] for row in rows])
    black, pink = table.sum(axis=0), table.sum(axis=1)
    found = two_sample_chi_square(black, pink)
    expected = stats.chi2_contingency(np.stack([black, pink]), correction=False)
    assert found.statistic == pytest.approx(expected.statistic, rel=1e-12)
    assert found.p_value == pytest.approx(expected.pvalue, rel=1e-10)


def brute_force(counts: np.ndarray, odds: np.ndarray) -> float:
    throws = int(counts.sum())
    law = stats.multinomial(throws, odds)
    tables = [t for t in product(range(throws + 1), repeat=len(odds)) if sum(t) == throws]
    chances = law.pmf(np.array(tables))
    return float(chances[chances <= law.pmf(counts) * (1 + 1e-9)].sum())


@pytest.mark.parametrize(
    ("counts", "odds"),
    [
        ([3, 0, 1], [0.2, 0.3, 0.5]),
        ([5, 0, 0, 0], [0.25, 0.25, 0.25, 0.25]),
        ([1, 1, 1, 1], [0.25, 0.25, 0.25, 0.25]),
        ([0, 2, 7], [1 / 6, 1 / 3, 1 / 2]),
        ([0, 0, 9], [1 / 3, 1 / 3, 1 / 3]),
        ([4, 3], [0.01, 0.99]),
    ],
)
def test_the_exact_test_by_brute_force(counts: list[int], odds: list[float]) -> None:
    found = exact_multinomial(counts, odds)
    assert found.p_value == pytest.approx(brute_force(np.array(counts), np.array(odds)), rel=1e-9)
    kinds = len(odds)
    assert found.tables == math.comb(sum(counts) + kinds - 1, kinds - 1)
    assert found.standard_error == 0.0


@pytest.mark.parametrize("count", [0, 3, 9, 20])
def test_of_two_outcomes_it_is_the_binomial_test(count: int) -> None:
    found = exact_multinomial([count, 20 - count], [0.3, 0.7])
    assert found.p_value == pytest.approx(stats.binomtest(count, 20, 0.3).pvalue, rel=1e-9)


def test_no_p_value_is_above_one() -> None:
    """Of the likeliest counts all others are taken together, and rounding with them."""
    for half in range(1, 60):
        assert 1.0 - 1e-12 < exact_multinomial([half, half], [0.5, 0.5]).p_value <= 1.0


def test_drawn_tables_agree_with_all(monkeypatch: pytest.MonkeyPatch) -> None:
    counts, odds = [9, 4, 6, 1], [0.25, 0.25, 0.25, 0.25]
    every = exact_multinomial(counts, odds)
    monkeypatch.setattr(module, "MOST_TABLES", 0)
    drawn = exact_multinomial(counts, odds)
    assert abs(drawn.p_value - every.p_value) < 4 * drawn.standard_error
    assert drawn.standard_error == pytest.approx(
        math.sqrt(every.p_value * (1 - every.p_value) / 1e5), rel=0.02
    )
    assert drawn == exact_multinomial(counts, odds)


def test_a_drawn_p_value_is_never_zero() -> None:
    found = exact_multinomial([0] * 19 + [600], np.full(20, 0.05))
    assert found.tables == 100_001
    assert found.p_value == 1 / 100_001


def test_with_many_throws_it_agrees_with_the_chi_square_test() -> None:
    counts, odds = np.array([520, 330, 150]), np.array([0.5, 0.35, 0.15])
    assert exact_multinomial(counts, odds).p_value == pytest.approx(
        chi_square(counts, odds).p_value, abs=0.01
    )


@pytest.mark.parametrize("off", [0, 3, 100, 700])
def test_tables_that_are_equally_likely_are_told_of_many_throws_too(off: int) -> None:
    """The one seen, and that with its two counts exchanged: logarithms near 1e7 are rounded."""
    few, many = 499_999 - off, 499_999 + off
    found = exact_multinomial([few, many], [0.5, 0.5])
    assert found.p_value == pytest.approx(stats.binomtest(few, 999_998, 0.5).pvalue, rel=1e-7)
