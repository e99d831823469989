"""The damaged files of the soak."""

from __future__ import annotations

import numpy as np

from dicedesign.bench.endurance.commands import Ended
from dicedesign.bench.endurance.files import READERS, _faults, damaged

DATA = b"v 1.5 2 3\nv 4 5 6\nf 1 2 3\n"


def test_damage_depends_on_the_seed_alone_and_is_of_many_kinds() -> None:
    files = [damaged(np.random.default_rng(seed), DATA, b"other\n") for seed in range(200)]
    again = [damaged(np.random.default_rng(seed), DATA, b"other\n") for seed in range(200)]
    assert files == again
    assert len(set(files)) > 150
    assert any(len(data) > 20 * len(DATA) for data in files)
    assert any(len(data) < len(DATA) / 2 for data in files)
    assert any(b"1e308" in data for data in files)
    for data in (b"", b"\xff"):
        for seed in range(50):
            damaged(np.random.default_rng(seed), data, data)


def test_answers_and_refusals_are_checked() -> None:
    reader = READERS["obj mesh"]

    def kinds(code: int, out: str = "", err: str = "", *, sound: bool = False) -> list[str]:
        return [fault.kind for fault in _faults(Ended(code, out, err, 0.1, False), reader, sound)]

    half = '{"rests": [{"probability": 0.5}]}'
    assert kinds(0, half.replace("0.5", "1.0")) == []
    assert kinds(0, half) == ["wrong"]
    assert kinds(0, half.replace("0.5", "1.0"), "warning\n") == ["wrong"]
    assert kinds(2, err="dicedesign: no\n") == []
    assert kinds(2, err="dicedesign: no\n", sound=True) == ["traceback"]
    assert kinds(2, err="dicedesign: no\nand more\n") == ["wrong"]
    assert kinds(3, err="dicedesign: an error that nobody foresaw\n") == ["traceback"]
    assert kinds(1) == ["traceback"]
