"""What all tests share."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from common.paths import DATA, MISSING_DATA, ROOT
from common.programs import MISSING_SLICER, SLICER

from benchmarks.browser import headless_browser, missing_browser
from dicedesign.runtime import workers

if TYPE_CHECKING:
    from playwright.sync_api import Browser

MISSING_BROWSER = "no browser: "
"""Prefix of the reasons for skipped tests."""

pytest_plugins = ["common.session"]

# Small tensors and matrices: threads only get into each other's way.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")


@pytest.fixture(autouse=True)
def without_ticks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Print no lines of progress between those that tests expect, however slow the machine is."""
    monkeypatch.setattr(workers, "PIPE_INTERVAL", 3600.0)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--without-kernels",
        action="store_true",
        help="as on a machine where the compiled kernels could not be built",
    )
    parser.addoption(
        "--require-public-data",
        action="store_true",
        help="tests fail that are otherwise skipped where public data are missing",
    )
    parser.addoption(
        "--require-slicer",
        action="store_true",
        help=f"tests fail that are otherwise skipped where {SLICER} is not installed",
    )
    parser.addoption(
        "--require-browser",
        action="store_true",
        help="tests fail that are otherwise skipped where Chromium or playwright is not installed",
    )


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--without-kernels"):
        sys.modules["dicedesign_kernels"] = None  # type: ignore[assignment]


def lacks(report: pytest.TestReport, reason: str) -> bool:
    """True if a test was skipped for a reason, by how the reason begins."""
    return (
        report.skipped
        and isinstance(report.longrepr, tuple | list)
        and (reason in report.longrepr[2])
    )


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport]:
    report = yield
    for option, reason in (
        ("--require-public-data", MISSING_DATA),
        ("--require-slicer", MISSING_SLICER),
        ("--require-browser", MISSING_BROWSER),
    ):
        if item.config.getoption(option) and lacks(report, reason):
            report.outcome = "failed"
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Count and name the tests that public data, the slicer or a browser were missing for."""
    for reason, title in (
        (MISSING_DATA, f"no public data in {DATA}"),
        (MISSING_SLICER, f"{SLICER} is not installed"),
        (MISSING_BROWSER, "no Chromium, or no playwright"),
    ):
        skipped = terminalreporter.stats.get("skipped", [])
        names = sorted(r.nodeid for r in skipped if lacks(r, reason))
        if names:
            terminalreporter.section(f"{len(names)} skipped: {title}")
            for name in names:
                terminalreporter.line(name)


@pytest.fixture(scope="session")
def repository() -> Path:
    """The folder with recipes and README."""
    return ROOT


@pytest.fixture
def random_points() -> Callable[..., np.ndarray]:
    """Points (n, 3) near an ellipsoid: most of them are corners of their hull. A round one has
    many rests, a long one has few and paths that cross up to four edges."""

    def make(seed: int, count: int, stretch: tuple[float, ...] = (1.0, 0.5, 2.0)) -> np.ndarray:
        rng = np.random.default_rng(seed)
        points = rng.normal(size=(count, 3))
        points /= np.linalg.norm(points, axis=1)[:, None]
        return points * rng.uniform(0.8, 1.2, size=(count, 1)) * stretch

    return make


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Chromium without windows; where it is missing the test is skipped."""
    missing = missing_browser()
    if missing is not None:
        pytest.skip(f"{MISSING_BROWSER}{missing}")
    with headless_browser() as started:
        yield started
