"""Work beside other work in this process, and in a process of its own."""

from __future__ import annotations

import os
import time

import pytest

from dicedesign.bench.measures import processes
from dicedesign.bench.measures.processes import CrashError, HangError, Watchdog, in_turn


def test_times_are_medians_of_works_done_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    order: list[str] = []
    clock = [0.0]
    monkeypatch.setattr(processes.time, "process_time", lambda: clock[0])

    def busy(name: str, seconds: float) -> None:
        order.append(name)
        # The first, which is not counted, and one other take much longer.
        clock[0] += seconds if len(order) not in (1, 5) else 0.02

    short, long = in_turn([lambda: busy("a", 1e-3), lambda: busy("b", 4e-3)], 0.06)
    rounds = ["".join(order[i : i + 2]) for i in range(0, len(order), 2)]
    assert len(rounds) >= 6
    assert set(rounds) == {"ab", "ba"}
    assert (short, long) == (pytest.approx(1e-3), pytest.approx(4e-3))


def test_all_calls_of_a_turn_count_but_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    order, clock = [], [0.0]
    monkeypatch.setattr(processes.time, "process_time", lambda: clock[0])

    def busy(name: str, seconds: float) -> None:
        # Caches that the other one filled cost the first call a tenth of a second.
        clock[0] += seconds if order and order[-1] == name else 0.1
        order.append(name)

    actions = [lambda: busy("a", 1e-3), lambda: busy("b", 4e-3)]
    short, long = in_turn(actions, 0.0, rounds=3, row=2.5e-3)
    assert (short, long) == (pytest.approx(1e-3), pytest.approx(4e-3))
    # A first round of one call each; then three of an uncounted one and what fills the row.
    assert (order.count("a"), order.count("b")) == (1 + 3 * 4, 1 + 3 * 2)
    order.clear()
    assert in_turn(actions, 0.0, rounds=20)[0] >= 1e-3
    assert len(order) == 2 * (1 + 20)


def misbehave(how: str) -> int:
    if how == "hang":
        time.sleep(100.0)
    if how == "raise":
        raise ValueError("on purpose")
    if how == "die":
        os._exit(3)
    return len(how)


def test_the_watchdog_reports_and_goes_on() -> None:
    with Watchdog(misbehave) as dog:
        assert dog.call("fine", 30.0) == 4
        with pytest.raises(HangError, match=r"no answer in 0\.2 s"):
            dog.call("hang", 0.2)
        with pytest.raises(CrashError, match="ValueError: on purpose"):
            dog.call("raise", 30.0)
        with pytest.raises(CrashError, match="the process ended with code 3"):
            dog.call("die", 30.0)
        assert dog.call("again", 30.0) == 5
