"""The batch of the soak: meshes whose odds are known, and what its check of the table sees."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from dicedesign.batch.analyse import analyse_files
from dicedesign.batch.rest_table import RestTable
from dicedesign.batch.rows import Stamp
from dicedesign.bench.endurance import batch
from dicedesign.bench.endurance.batch import Batch, batch_faults, make_meshes
from dicedesign.runtime.arrays import Floats

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pipes in folders")

pytest.importorskip("mpmath")

COUNT = 120


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Floats | None]]:
    """A folder of meshes, every third of them broken, and their answers."""
    folder = tmp_path_factory.mktemp("meshes")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batch, "BROKEN_EVERY", 3)
        patch.setattr(batch, "RANDOM_BODIES", 2)
        return folder, make_meshes(folder, COUNT, 7, lambda: None)


@pytest.fixture
def table(made: tuple[Path, dict[str, Floats | None]], tmp_path: Path) -> Path:
    folder, answers = made
    path = tmp_path / "rests.csv"
    RestTable(path, analyse_files(str(folder), dict.fromkeys(answers, Stamp(1, 1))))
    return path


def test_answers_are_those_of_the_program(
    made: tuple[Path, dict[str, Floats | None]], table: Path
) -> None:
    _, answers = made
    assert len(answers) == COUNT
    assert sum(shares is None for shares in answers.values()) == COUNT // 3
    assert list(batch_faults(table, answers)) == []


def test_the_same_seed_makes_the_same_meshes(
    made: tuple[Path, dict[str, Floats | None]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(batch, "BROKEN_EVERY", 3)
    monkeypatch.setattr(batch, "RANDOM_BODIES", 2)
    folder, answers = made
    again = make_meshes(tmp_path, 20, 7, lambda: None)
    assert list(again) == list(answers)[:20]
    for name in again:
        if (folder / name).is_file():
            assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


def test_what_is_wrong_with_a_table_is_seen(
    made: tuple[Path, dict[str, Floats | None]], table: Path
) -> None:
    _, answers = made
    broken = next(name for name, shares in answers.items() if shares is None)
    sound = next(name for name, shares in answers.items() if shares is not None)
    lines = table.read_text().splitlines(keepends=True)

    def kinds(text: str, **more: Floats | None) -> Counter[str]:
        table.write_text(text)
        return Counter(fault.kind for fault in batch_faults(table, answers | more))

    assert kinds("".join(line for line in lines if not line.startswith(sound))) == {"lost": 1}
    assert kinds("".join(lines), other=np.ones(1)) == {"lost": 1}
    assert kinds("".join(lines)[:-20]) == {"lost": 1}
    assert kinds("".join(lines), **{sound: np.array([0.5, 0.5])}) == {"wrong": 1}
    assert kinds("".join(lines), **{sound: None}) == {"wrong": 1}
    assert kinds("".join(lines), **{broken: np.ones(1)}) == {"wrong": 1}
    (table.parent / ".0123456789abcdef.part").touch()
    assert kinds("".join(lines)) == {"lost": 1}


def test_growth_is_that_of_the_longest_life() -> None:
    steady, leak = [50.0] * 50 + [100.0] * 150, [50.0] * 50 + [100.0 + k for k in range(150)]
    assert Batch(workers={1: steady, 2: [1.0, 9.0]}).growth == 0.0
    assert Batch(workers={1: steady[:190], 2: leak}).growth == pytest.approx(100 / 124.5, abs=0.01)
    assert Batch(workers={1: steady[:9]}).growth is None
