"""Coarse grids, which take less time."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def coarse_grids(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dicedesign.balance.cavity.STEPS", 26)
    monkeypatch.setattr("dicedesign.balance.cavity.REACH_STEPS", 18)
