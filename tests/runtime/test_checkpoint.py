"""What is kept of work that is cut off, and what is not taken for it."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from dicedesign.errors import InputError, OutputError
from dicedesign.runtime import checkpoint
from dicedesign.runtime.checkpoint import INTERVAL, Checkpoint, checkpoint_bytes

WORK = {"seed": "3", "table": "felt"}

ROWS = [np.array([1, 2]), np.array([], dtype=np.int64), np.array([-(2**62), 4, 5])]

REAL = [np.array([np.pi, -0.0]), np.array([1e-300])]


def same(found: object, expected: list[np.ndarray]) -> bool:
    assert isinstance(found, list)
    return len(found) == len(expected) and all(
        a.dtype == b.dtype and a.tobytes() == b.tobytes()
        for a, b in zip(found, expected, strict=True)
    )


def test_rows_come_back_to_the_last_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    path = tmp_path / "c.npz"
    kept = Checkpoint(path, WORK)
    assert not kept.rows("whole")
    assert not path.exists()
    kept.add("whole", ROWS[:1])
    now[0] += INTERVAL / 2.0
    kept.add("whole", ROWS[1:])
    # Not yet due.
    assert same(Checkpoint(path, WORK).rows("whole"), ROWS[:1])
    now[0] += INTERVAL
    kept.add("real", REAL)
    again = Checkpoint(path, WORK)
    assert same(again.rows("whole"), ROWS)
    assert same(again.rows("real"), REAL)


@pytest.mark.parametrize("end", [KeyboardInterrupt, ZeroDivisionError])
def test_it_is_written_where_work_is_cut_off_and_removed_where_it_is_done(
    tmp_path: Path, end: type[BaseException]
) -> None:
    path = tmp_path / "c.npz"

    def cut_off() -> None:
        with Checkpoint(path, WORK) as kept:
            for row in ROWS:
                kept.add("whole", [row])
            raise end

    with pytest.raises(end):
        cut_off()
    with Checkpoint(path, WORK) as kept:
        assert same(kept.rows("whole"), ROWS)
    assert not path.exists()
    with Checkpoint(path, WORK):
        pass


def test_without_a_file_nothing_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with Checkpoint() as kept:
        kept.add("whole", ROWS)
        assert same(kept.rows("whole"), ROWS)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", sorted(WORK))
def test_that_of_other_work_is_refused(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "c.npz"
    Checkpoint(path, WORK).add("whole", ROWS)
    before = path.read_bytes()
    with pytest.raises(InputError, match=f"expected a checkpoint of this {kind}, got one of anoth"):
        Checkpoint(path, {**WORK, kind: "other"})
    assert path.read_bytes() == before


def test_a_damaged_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "c.npz"
    Checkpoint(path, WORK).add("whole", ROWS)
    whole, five = path.read_bytes(), {"whole": np.arange(5)}
    others = [
        checkpoint_bytes(WORK, {"rows": state}, arrays)
        for state, arrays in (
            ({"whole": [2, 0, 3]}, {}),
            ({"whole": [2, 1, 3]}, five),
            ({"whole": [6, -1]}, five),
            ({"whole": ["two", 3]}, five),
            ({"whole": 5}, five),
            ([], five),
            ({"whole": [5]}, {"whole": np.zeros((5, 2))}),
            ({"whole": [5]}, {"whole": np.array(list("words"))}),
        )
    ]
    np.savez_compressed(path, about=np.zeros(4000))
    compressed = path.read_bytes()
    others.append(compressed[:60] + b"\xff" * 10 + compressed[70:])
    for damaged in (b"", b"PK", whole[:100], whole[:-40], *others):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match="got a file that cannot be read as one; remove it"):
            Checkpoint(path, WORK)


def test_two_that_go_on_at_once_are_noticed(tmp_path: Path) -> None:
    path = tmp_path / "c.npz"
    one, other = Checkpoint(path, WORK), Checkpoint(path, WORK)
    one.add("whole", ROWS[:1])
    with pytest.raises(OutputError, match="expected a checkpoint that only this run writes"):
        other.add("whole", ROWS[:2])


def test_an_interrupt_just_after_a_write_does_not_look_like_a_second_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "c.npz"

    def write_and_be_interrupted(at: Path, data: bytes) -> None:
        at.write_bytes(data)
        monkeypatch.undo()
        os.kill(os.getpid(), signal.SIGINT)

    def run() -> None:
        with Checkpoint(path, WORK) as kept:
            monkeypatch.setattr(checkpoint, "atomic_write", write_and_be_interrupted)
            kept.add("whole", ROWS)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    with pytest.raises(KeyboardInterrupt, match="the results so far are in"):
        run()
    signal.signal(signal.SIGINT, before)
    assert same(Checkpoint(path, WORK).rows("whole"), ROWS)


def test_an_interrupt_before_the_first_result_leaves_nothing_and_says_nothing_of_it(
    tmp_path: Path,
) -> None:
    path = tmp_path / "c.npz"
    with pytest.raises(KeyboardInterrupt) as told, Checkpoint(path, WORK):
        raise KeyboardInterrupt
    assert not told.value.args
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_process_left_half_written_goes(tmp_path: Path) -> None:
    path, other = tmp_path / "c.npz", tmp_path / f".d.npz.{16 * 'a'}.part"
    left = tmp_path / f".c.npz.{16 * '0'}.part"
    left.write_bytes(b"half")
    other.write_bytes(b"of another file")
    Checkpoint(path, WORK)
    assert list(tmp_path.iterdir()) == [other]
