"""What a piece of work costs: beside others in this process, or alone in a new one.

Seconds are those of the processor, so that other programs on the machine do not count.
"""

from __future__ import annotations

import gc
import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any, Final

import numpy as np

__all__ = ["in_new_process", "in_turn"]

FEWEST_ROUNDS: Final = 5
"""A median is taken of at least so many rounds in this process, unless others are asked for."""

_FRAME: Final = """
import json, time
{setting}
begun = time.process_time()
{work}
seconds = time.process_time() - begun
from dicedesign.peak_memory import peak_megabytes
print(json.dumps([seconds, peak_megabytes()]))
"""


def in_turn(
    actions: Sequence[Callable[[], Any]],
    seconds: float,
    *,
    rounds: int = FEWEST_ROUNDS,
    row: float = 0.0,
) -> list[float]:
    """Median seconds of each action. They are called in rounds for about the given seconds, so that
    what slows the machine falls on all of them alike; a first round is not counted.

    rounds: how many there are at least.
    row: seconds for which an action is called again and again when its turn comes; all its calls
        count but the first. At 0 it is called once, and pays for caches that the action before it
        filled: with works of some microseconds, most of their time.
    """
    taken: list[list[float]] = [[] for _ in actions]
    for action in actions:
        action()
    # An order that changes, and no garbage collector whose turn comes in a rhythm of its own.
    order = np.random.default_rng(0)
    collecting = gc.isenabled()
    gc.disable()
    ended = time.process_time() + seconds
    try:
        while rounds > 0 or time.process_time() < ended:
            rounds -= 1
            for index in order.permutation(len(actions)):
                taken[index] += _turn(actions[index], row)
    finally:
        if collecting:
            gc.enable()
    return [median(times) for times in taken]


def _turn(action: Callable[[], Any], row: float) -> list[float]:
    """Seconds of an action's calls in a row, see `in_turn`."""
    if row > 0.0:
        action()
    times, ended = [], time.process_time() + row
    while True:
        begun = time.process_time()
        action()
        now = time.process_time()
        times.append(now - begun)
        if now >= ended:
            return times


def in_new_process(
    works: Sequence[tuple[str, str]], folder: Path, rounds: int
) -> list[tuple[float, float | None]]:
    """Median seconds and peak memory in MB (see `dicedesign.peak_memory`) of each work, each
    time in a new process that runs in a folder, in turn. A work is two pieces of Python code; the
    seconds of the first are not counted. Raises RuntimeError where a work fails."""
    seconds: list[list[float]] = [[] for _ in works]
    peaks: list[list[float]] = [[] for _ in works]
    for _ in range(rounds):
        for index, (setting, work) in enumerate(works):
            command = [sys.executable, "-c", _FRAME.format(setting=setting, work=work)]
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                code = f"{setting}\n{work}"
                raise RuntimeError(f"what was to be measured failed:\n{code}\n{done.stderr}")
            taken, peak = json.loads(done.stdout.splitlines()[-1])
            seconds[index].append(taken)
            if peak is not None:
                peaks[index].append(peak)
    return [
        (median(times), median(most) if most else None)
        for times, most in zip(seconds, peaks, strict=True)
    ]
