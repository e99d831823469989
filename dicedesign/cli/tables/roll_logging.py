"""Throws typed in, one line after the other, into a file that has each as soon as its line ends."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from typing import Final

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Integers
from dicedesign.runtime.files import interrupts_held
from dicedesign.runtime.text import printable
from dicedesign.throws.roll_log import RollLog
from dicedesign.throws.roll_verdict import RollVerdict

__all__ = ["log_rolls"]

DONE: Final = "done"

UNDO: Final = "undo"
"""Words that are no throws, unless the die has them as labels."""


def log_rolls(
    log: RollLog,
    judge: Callable[[Integers], RollVerdict],
    shown: Callable[[RollVerdict], str],
) -> None:
    """Write down throws from stdin until it says `DONE` or ends, or somebody interrupts it.

    judge: gives the verdict of counts (k,); shown: all of it in words. To somebody at a terminal
    each line is answered on stderr; one that is wrong is told of, and the next is waited for.

    Raises InputError: a line of another stdin is wrong; those before it are written down.
    """
    at_terminal = sys.stdin.isatty()
    if at_terminal:
        _say(_introduction(log))
    try:
        for number, line in enumerate(_lines(at_terminal), start=1):
            text = line.strip()
            if text == DONE and DONE not in log.labels:
                break
            try:
                with interrupts_held("rolls"):
                    done = _take(log, text)
            except InputError as error:
                if not at_terminal:
                    raise InputError(f"stdin, line {number}: {error}") from error
                _say(str(error))
                continue
            if at_terminal:
                verdict = judge(log.counts) if log.throws else None
                _say(_answer(done, verdict, shown))
    except KeyboardInterrupt:
        # The line that was begun ends.
        _say("")
    _say(f"{len(log.throws)} throws in {printable(log.path)}")


def _lines(at_terminal: bool) -> Iterator[str]:
    """Of stdin, each asked for."""
    while True:
        if at_terminal:
            print("> ", end="", file=sys.stderr, flush=True)
        line = sys.stdin.readline()
        if not line:
            return
        yield line


def _take(log: RollLog, text: str) -> str:
    """Do what a line says, and return what was done, "" for nothing."""
    if text != UNDO or UNDO in log.labels:
        return ", ".join(log.add(text))
    label = log.undo()
    return "no throw to take back" if label is None else f"took back {label}"


def _answer(done: str, verdict: RollVerdict | None, shown: Callable[[RollVerdict], str]) -> str:
    """What is known after a line."""
    if verdict is None:
        return done or "no throws yet"
    if not done:
        return shown(verdict)
    known = f"{done}: {verdict.throws} throws, p = {verdict.p_value:.2g}"
    more = max(0, verdict.to_confirm - verdict.throws)
    if verdict.rejected:
        return f"{known}, which rejects the odds"
    return f"{known}, {more} more to settle it" if more else f"{known}, enough to settle it"


def _introduction(log: RollLog) -> str:
    begun = f"{len(log.throws)} throws so far. " if log.throws else ""
    return (
        f"{begun}Type what comes up ({', '.join(map(printable, log.labels))}), one or several on a "
        f"line. {UNDO} takes the last back, an empty line shows all, {DONE} ends.\n"
        "Decide on a number before you begin: who stops as soon as p is small finds fault with "
        "good dice, too."
    )


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
