"""Checkpoints save interrupted work, and refuse other files."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from dicedesign.errors import InputError, OutputError
from dicedesign.runtime import checkpoint
from dicedesign.runtime.checkpoint import INTERVAL, Checkpoint, checkpoint_bytes

WORK = {"seed": "3", "table": "felt"}

ROWS = [np.array([1, 2]), np.array([], dtype=np.int64), np.array([-(2**62), 4, 5])]

REAL = [np.array([np.pi, -0.0]), np.array([1e-300])]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "c.npz"


def bits(rows: Sequence[np.ndarray]) -> list[tuple[str, bytes]]:
    """Types and bits of rows."""
    return [(row.dtype.str, row.tobytes()) for row in rows]


def test_rows_are_restored_bit_for_bit(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    stored = Checkpoint(path, WORK)
    assert not stored.rows("whole")
    assert not path.exists()
    stored.add("whole", ROWS[:1])
    now[0] += INTERVAL / 2.0
    stored.add("whole", ROWS[1:])
    # Not yet due.
    assert bits(Checkpoint(path, WORK).rows("whole")) == bits(ROWS[:1])
    now[0] += INTERVAL
    stored.add("real", REAL)
    again = Checkpoint(path, WORK)
    assert bits(again.rows("whole")) == bits(ROWS)
    assert bits(again.rows("real")) == bits(REAL)


@pytest.mark.parametrize("end", [KeyboardInterrupt, ZeroDivisionError])
def test_a_file_is_saved_on_errors_and_removed_on_success(
    tmp_path: Path, path: Path, end: type[BaseException]
) -> None:

    def interrupt_work() -> None:
        with Checkpoint(path, WORK) as stored:
            for row in ROWS:
                stored.add("whole", [row])
            raise end

    with pytest.raises(end):
        interrupt_work()
    with Checkpoint(path, WORK) as stored:
        assert bits(stored.rows("whole")) == bits(ROWS)
    assert not path.exists()
    # Without results there is no file.
    with pytest.raises(end) as caught, Checkpoint(path, WORK):
        raise end
    assert not caught.value.args
    assert list(tmp_path.iterdir()) == []


def test_without_a_file_nothing_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with Checkpoint() as stored:
        stored.add("whole", ROWS)
        assert bits(stored.rows("whole")) == bits(ROWS)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", sorted(WORK))
def test_a_checkpoint_of_other_work_is_refused(path: Path, kind: str) -> None:
    Checkpoint(path, WORK).add("whole", ROWS)
    before = path.read_bytes()
    with pytest.raises(InputError, match=f"expected a checkpoint of this {kind}, got one of anoth"):
        Checkpoint(path, {**WORK, kind: "other"})
    assert path.read_bytes() == before


def test_a_damaged_checkpoint_is_refused(path: Path) -> None:
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
    # Zeros that take a thousandth of their size.
    about = np.array(json.dumps({"work": WORK, "rows": {"whole": [1 << 20]}}))
    np.savez_compressed(path, about=about, whole=np.zeros(1 << 20))
    others.append(path.read_bytes())
    for damaged in (b"", b"PK", whole[:100], whole[:-40], *others):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match="got a file that cannot be read as one; remove it"):
            Checkpoint(path, WORK)


def test_two_processes_with_one_checkpoint_are_refused(path: Path) -> None:
    first, other = Checkpoint(path, WORK), Checkpoint(path, WORK)
    first.add("whole", ROWS[:1])
    with pytest.raises(OutputError, match="expected a checkpoint that only this run writes"):
        other.add("whole", ROWS[:2])


def test_an_interrupt_just_after_a_write_does_not_look_like_a_second_run(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:

    def write_and_be_interrupted(at: Path, data: bytes) -> None:
        at.write_bytes(data)
        monkeypatch.undo()
        os.kill(os.getpid(), signal.SIGINT)

    def run() -> None:
        with Checkpoint(path, WORK) as stored:
            monkeypatch.setattr(checkpoint, "atomic_write", write_and_be_interrupted)
            stored.add("whole", ROWS)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    with pytest.raises(KeyboardInterrupt, match="the results so far are in"):
        run()
    signal.signal(signal.SIGINT, before)
    assert bits(Checkpoint(path, WORK).rows("whole")) == bits(ROWS)


def test_partial_files_of_a_killed_process_are_removed(tmp_path: Path, path: Path) -> None:
    path, other = tmp_path / "c.npz", tmp_path / f".d.npz.{16 * 'a'}.part"
    partial = tmp_path / f".c.npz.{16 * '0'}.part"
    partial.write_bytes(b"half")
    other.write_bytes(b"of another file")
    Checkpoint(path, WORK)
    assert list(tmp_path.iterdir()) == [other]


def test_finished_tasks_are_not_run_again(path: Path) -> None:
    begun = []

    def run(stop: int) -> list[list[int]]:
        def task(number: int) -> np.ndarray:
            begun.append(number)
            if number == stop:
                raise ZeroDivisionError
            return np.arange(number)

        tasks = [partial(task, number) for number in range(5)]
        with Checkpoint(path, WORK) as stored:
            return [row.tolist() for row in stored.results("tasks", tasks)]

    with pytest.raises(ZeroDivisionError):
        run(3)
    assert run(9) == [list(range(number)) for number in range(5)]
    assert begun == [0, 1, 2, 3, 3, 4]


def test_an_option_decides_whether_a_file_is_read(path: Path) -> None:
    with pytest.raises(InputError, match="got none; run without --resume to start again"):
        Checkpoint(path, WORK, resume=True)
    Checkpoint(path, WORK).add("whole", ROWS)
    assert bits(Checkpoint(path, WORK, resume=True).rows("whole")) == bits(ROWS)
    assert not Checkpoint(path, {"seed": "4"}, resume=False).rows("whole")
    message = r"c\.npz; run it again with --resume to go on"
    with pytest.raises(KeyboardInterrupt, match=message), Checkpoint(path, WORK, resume=True):
        raise KeyboardInterrupt
