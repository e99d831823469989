"""Workers and their bar: what is said of a cluster that has none left, and to whom."""

from __future__ import annotations

import pytest
from common.inline_executor import Inline

from dicedesign.runtime import workers as workers_module
from dicedesign.runtime.workers import Workers, open_workers, progress_bar


def test_a_cluster_without_workers_is_told_of_once_for_each_time(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    empty = True
    monkeypatch.setattr(workers_module, "has_no_workers", lambda executor: empty)
    with progress_bar("trials", 9) as bar:
        workers = Workers(Inline(), 1, "trials", bar, "tcp://far:1")
        for _ in range(3):
            workers.on_quiet()
        workers.advance(1)
        empty = False
        workers.on_quiet()
        empty = True
        workers.on_quiet()
    note = "note: tcp://far:1 has no worker left; trials wait for one to join\n"
    assert capsys.readouterr() == ("", 2 * note)


def test_no_more_processes_than_pieces_of_work(capsys: pytest.CaptureFixture[str]) -> None:
    with open_workers("files", 12, 10, jobs=64) as workers:
        assert workers.jobs == 2
        assert workers.executor.submit(pow, 3, 2).result() == 9
        workers.on_quiet()
    assert capsys.readouterr() == ("", "")
