"""A die with its report, as a run leaves them."""

from __future__ import annotations

from pathlib import Path

import pytest
from common.paths import ROOT

from dicedesign.cli.main import main


@pytest.fixture(scope="session")
def fair_d3(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a fair die of three outcomes."""
    folder = tmp_path_factory.mktemp("fair_d3")
    recipe = str(ROOT / "recipes" / "fair_d3.yaml")
    assert main(["run", recipe, "--no-clock", "--out", str(folder)]) == 0
    return folder
