"""Progress on a terminal and in a pipe, with a clock of the test."""

from __future__ import annotations

import sys
import time

import pytest

from dicedesign.runtime import workers
from dicedesign.runtime.workers import progress_bar, show_part


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Seconds that the bar believes."""
    now = [1000.0]
    monkeypatch.setattr("tqdm.std.time", lambda: now[0])
    return now


def wait_for(text: str, capsys: pytest.CaptureFixture[str]) -> str:
    """What is on stderr once a text is."""
    shown, deadline = "", time.monotonic() + 20.0
    while text not in shown:
        assert time.monotonic() < deadline, shown
        time.sleep(0.01)
        shown += capsys.readouterr().err
    return shown


def test_a_pipe_gets_lines_with_percent_count_and_time_left(
    clock: list[float], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(workers, "PIPE_INTERVAL", 0.02)
    with progress_bar("stage") as bar:
        clock[0] += 65.0
        wait_for("stage: 01:05\n", capsys)
        show_part(bar, 10, 110, "throws")
        clock[0] += 20.0
        # What was done before does not count for the speed.
        show_part(bar, 35, 110, "throws")
        shown = wait_for("stage:  32% 35/110 [00:20<01:00,  1.25 throws/s]\n", capsys)
        assert "\r" not in shown
        show_part(bar, 0, 110, "throws")
        wait_for("stage:   0% 0/110 [00:00<?", capsys)
        show_part(bar, 0, None, "next")
        clock[0] += 3.0
        bar.set_postfix_str("step 4")
        wait_for("next: 00:03, step 4\n", capsys)


def test_a_terminal_gets_one_line_that_goes_on_without_progress(
    clock: list[float], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(workers, "TERMINAL_INTERVAL", 0.02)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with progress_bar("files", 4) as bar:
        clock[0] += 30.0
        bar.update()
        clock[0] += 1.0
        shown = wait_for("1/4 [00:31<01:30", capsys)
        assert "25%" in shown
        assert "\n" not in shown


def test_short_work_leaves_a_pipe_empty(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar("files", 2) as bar:
        bar.update(2)
        bar.set_description_str("all")
    assert capsys.readouterr() == ("", "")
