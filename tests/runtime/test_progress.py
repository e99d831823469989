"""Progress on a terminal and in a pipe, with a clock of the test."""

from __future__ import annotations

import io
import sys
import threading

import pytest

from dicedesign.runtime import workers
from dicedesign.runtime.workers import progress_bar, show_part


class Screen(io.StringIO):
    """Standard error that reports what is written."""

    def __init__(self, is_terminal: bool) -> None:
        super().__init__()
        self.isatty = lambda: is_terminal  # type: ignore[method-assign]
        self.written = threading.Condition()

    def write(self, text: str) -> int:
        with self.written:
            self.written.notify()
            return super().write(text)

    def wait_for(self, text: str) -> None:
        """Wait for the event that a text was written; forget what is before it."""
        with self.written:
            assert self.written.wait_for(lambda: text in self.getvalue(), 60.0), self.getvalue()
            self.truncate(self.seek(0))


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Seconds that the bar believes, whose lines come at once."""
    now = [1000.0]
    monkeypatch.setattr("tqdm.std.time", lambda: now[0])
    monkeypatch.setattr(workers, "PIPE_INTERVAL", 0.01)
    monkeypatch.setattr(workers, "TERMINAL_INTERVAL", 0.01)
    return now


def test_a_pipe_gets_lines_with_percent_count_and_time_left(
    clock: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = Screen(is_terminal=False)
    monkeypatch.setattr(sys, "stderr", screen)
    with progress_bar("stage") as bar:
        clock[0] += 65.0
        screen.wait_for("stage: 01:05\n")
        show_part(bar, 10, 110, "throws")
        clock[0] += 20.0
        # What was done before does not count for the speed.
        show_part(bar, 35, 110, "throws")
        screen.wait_for("stage:  32% 35/110 [00:20<01:00,  1.25 throws/s]\n")
        show_part(bar, 0, 110, "throws")
        screen.wait_for("stage:   0% 0/110 [00:00<?")
        show_part(bar, 0, None, "next")
        clock[0] += 3.0
        bar.set_postfix_str("step 4")
        screen.wait_for("next: 00:03, step 4\n")
    assert "\r" not in screen.getvalue()


def test_a_terminal_gets_one_line_that_goes_on_without_progress(
    clock: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = Screen(is_terminal=True)
    monkeypatch.setattr(sys, "stderr", screen)
    with progress_bar("files", 4) as bar:
        clock[0] += 30.0
        bar.update()
        clock[0] += 1.0
        screen.wait_for("1/4 [00:31<01:30")
        assert "\n" not in screen.getvalue()


def test_short_work_leaves_a_pipe_empty(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar("files", 2) as bar:
        bar.update(2)
        bar.set_description_str("all")
    assert capsys.readouterr() == ("", "")
