"""Commands in processes of their own: how they end, and what counts as a fault."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from dicedesign.bench.endurance import commands
from dicedesign.bench.endurance.commands import (
    Case,
    Command,
    Ended,
    Tried,
    before_main,
    drive,
    faults_of,
)

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no signals")


@pytest.fixture(autouse=True)
def _light(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is imported that these programs do without."""
    monkeypatch.setattr(commands, "PRELOADED", "dicedesign.errors")


def talking(arguments: list[str]) -> int:
    print(os.getcwd())
    print(*arguments, file=sys.stderr)
    return len(arguments)


def waiting(arguments: list[str]) -> int:
    time.sleep(600.0)
    return 0


def failing(arguments: list[str]) -> int:
    raise ValueError("no answer")


def greedy(arguments: list[str]) -> int:
    try:
        bytearray(1 << 30)
    except MemoryError:
        return 2
    return 0


def _ended(command: Command, scratch: Path) -> Ended:
    got = []

    def case() -> Case:
        got.append((yield command))
        return Tried(0, 0, [])

    assert list(drive([case()], scratch, 1)) == [Tried(0, 0, [])]
    return got[0]


def test_a_command_tells_its_code_and_what_it_printed(tmp_path: Path) -> None:
    folder = tmp_path / "here"
    folder.mkdir()
    ended = _ended(Command(("a", "b"), folder, talking), tmp_path)
    assert (ended.code, ended.out, ended.err) == (2, f"{folder}\n", "a b\n")
    assert not ended.hung
    assert list(tmp_path.iterdir()) == [folder]
    assert faults_of(ended, 0, 2) == []
    assert [fault.kind for fault in faults_of(ended, 0)] == ["traceback"]


def test_a_fresh_command_is_the_program(tmp_path: Path) -> None:
    for fresh in (False, True):
        ended = _ended(Command(("rest", "gone.stl"), tmp_path, fresh=fresh), tmp_path)
        assert ended.code == 2
        assert ended.err == "dicedesign: gone.stl: no such file; check the path\n"


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGKILL"])
def test_signals_reach_a_command(tmp_path: Path, name: str) -> None:
    sent = signal.Signals[name]
    ended = _ended(Command((), tmp_path, waiting, sent=sent), tmp_path)
    assert not ended.hung
    if sent == signal.SIGINT:
        assert [fault.kind for fault in faults_of(ended, 130)] == ["traceback"]
        assert "KeyboardInterrupt" in ended.err
    else:
        assert ended.code == -sent
        assert faults_of(ended, -sent) == []


def test_what_does_not_end_is_killed_and_hangs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commands, "LIMIT", 0.5)
    ended = _ended(Command((), tmp_path, waiting), tmp_path)
    assert ended.hung
    assert [fault.kind for fault in faults_of(ended, 0, -9)] == ["hang"]


def test_an_error_that_nobody_foresaw_is_a_traceback(tmp_path: Path) -> None:
    ended = _ended(Command((), tmp_path, failing), tmp_path)
    assert [fault.kind for fault in faults_of(ended, 0, 1, 2)] == ["traceback"]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of Linux")
def test_memory_has_a_limit(tmp_path: Path) -> None:
    assert _ended(Command((), tmp_path, greedy, memory=1 << 28), tmp_path).code == 2
    assert _ended(Command((), tmp_path, greedy), tmp_path).code == 0


def test_cases_run_side_by_side_and_go_on_with_what_came(tmp_path: Path) -> None:
    def case(number: int) -> Case:
        codes = []
        for words in range(3):
            ended = yield Command(("word",) * words, tmp_path, talking)
            codes.append(ended.code)
        assert codes == [0, 1, 2]
        return Tried(number, 0, [])

    tried = list(drive(map(case, range(5)), tmp_path, 2))
    assert sorted(one.number for one in tried) == [0, 1, 2, 3, 4]


def test_processes_end_with_the_loop(tmp_path: Path) -> None:
    def cases() -> Iterator[Case]:
        yield quick()
        yield slow()

    def quick() -> Case:
        yield Command((), tmp_path, talking)
        return Tried(0, 0, [])

    def slow() -> Case:
        yield Command(("slow",), tmp_path, _noting)
        return Tried(1, 0, [])

    loop = drive(cases(), tmp_path, 2)
    assert next(loop).number == 0
    deadline = time.monotonic() + 60.0
    while not (tmp_path / "pid").exists():
        assert time.monotonic() < deadline
        time.sleep(0.01)
    loop.close()
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def _noting(arguments: list[str]) -> int:
    Path("part").write_text(str(os.getpid()))
    Path("part").rename("pid")
    return waiting(arguments)


def test_an_interrupt_before_the_program_is_told_from_one_in_it() -> None:
    start = (
        'Traceback (most recent call last):\n  File "<frozen site>", line 9\nKeyboardInterrupt\n'
    )
    inside = start.replace("<frozen site>", "main.py").replace("line 9", "line 9, in main")
    assert before_main(start)
    assert not before_main(inside)
    assert not before_main("dicedesign: interrupted; nothing half-written was left\n")
