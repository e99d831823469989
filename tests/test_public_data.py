"""Tests that need public data, a slicer or a browser: what a run says where these are missing."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = """
import pytest
from common.paths import public_data
from common.programs import slicer_info

@pytest.mark.parametrize("name", ["here.obj", "missing.obj"])
def test_of_data(name):
    assert public_data(f"models/{name}").read_text() == "v 0 0 0"

def test_of_slices(tmp_path):
    slicer_info(tmp_path / "die.stl")

def test_of_a_page(browser):
    browser.new_page()

def test_of_another_kind():
    pytest.skip("no compiler")
"""


@pytest.fixture
def checkout(repository: Path, tmp_path: Path) -> Path:
    """Checkout with only these tests, next to one file of public data."""
    folder = tmp_path / "checkout"
    (folder / "tests" / "common").mkdir(parents=True)
    for name in ("conftest", "common/paths", "common/programs", "common/session"):
        shutil.copy(repository / "tests" / f"{name}.py", folder / "tests" / f"{name}.py")
    # What `conftest` imports from beside the tests.
    (folder / "tests" / "benchmarks").mkdir()
    shutil.copy(repository / "benchmarks" / "browser.py", folder / "tests" / "benchmarks")
    (folder / "tests" / "test_data.py").write_text(TESTS)
    models = tmp_path / "shared" / "data" / "models"
    models.mkdir(parents=True)
    (models / "here.obj").write_text("v 0 0 0")
    return folder


DATA = ("no public data in ", "tests/test_data.py::test_of_data[missing.obj]")

BROWSER = ("no Chromium, or no playwright", "tests/test_data.py::test_of_a_page")

SLICER = ("prusa-slicer is not installed", "tests/test_data.py::test_of_slices")


@pytest.mark.parametrize(
    ("workers", "option", "required"),
    [
        ("1", [], ()),
        (
            "0",
            ["--require-public-data", "--require-slicer", "--require-browser"],
            (DATA, SLICER, BROWSER),
        ),
    ],
)
def test_missing_public_data_is_named(
    checkout: Path, workers: str, option: list[str], required: tuple[tuple[str, str], ...]
) -> None:
    """Listed and counted at the end of a run, also with several processes; or a failure, if
    required."""
    command = [sys.executable, "-m", "pytest", "-n", workers, *option]
    # The started run does not inherit options of the run that this test is part of.
    own = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    # A path without programs.
    own["PATH"] = str(checkout)
    done = subprocess.run(
        command, cwd=checkout, env=own, capture_output=True, text=True, check=False
    )
    assert done.returncode == (1 if required else 0), done.stdout + done.stderr
    for missing in (DATA, SLICER, BROWSER):
        title, name = missing
        _, _, listed = done.stdout.partition(f"1 skipped: {title}")
        assert (name in listed.splitlines()) is (missing not in required)
        # What a fixture misses is an error.
        failed = {f"FAILED {name}", f"ERROR {name}"} & set(done.stdout.splitlines())
        assert bool(failed) is (missing in required)
    assert "test_of_another_kind" not in done.stdout
