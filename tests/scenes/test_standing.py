"""Many files in poses: in order, each on its own, and what happens when workers are lost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import trimesh
from common.inline_executor import Inline, Lossy

from dicedesign.errors import DiceError
from dicedesign.scenes import standing
from dicedesign.scenes.standing import Job, PoseChoice, Stood, stand_all, stand_many


def made_up(jobs: list[Job], choice: PoseChoice) -> list[Stood]:
    """All done, without a file."""
    return [Stood(job, 0, 1, 1.0) for job in jobs]


def named(count: int) -> list[Job]:
    return [Job(Path(f"{k}.stl"), f"{k}.stl", Path("out", f"{k}.stl")) for k in range(count)]


def run(jobs: list[Job], executor: Any, workers: int = 2) -> tuple[list[Stood], int]:
    counts: list[int] = []
    stood = stand_many(jobs, PoseChoice(), executor, workers, on_done=counts.append)
    return stood, sum(counts)


@pytest.mark.parametrize("count", [1, 7, 300])
def test_all_are_done_in_their_order(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    monkeypatch.setattr(standing, "stand_all", made_up)
    executor = Lossy(lambda *_: False)
    stood, ended = run(named(count), executor)
    assert [one.job for one in stood] == named(count)
    assert ended == count
    sizes = [len(jobs) for jobs, _ in executor.submitted]
    assert max(sizes) <= standing.FILES_PER_TASK
    assert len(sizes) >= min(count, 8)


def test_only_the_file_that_takes_workers_down_is_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(standing, "stand_all", made_up)
    jobs = named(100)
    executor = Lossy(lambda count, task, *_: jobs[42] in task)
    stood, ended = run(jobs, executor)
    assert [k for k, one in enumerate(stood) if one.error] == [42]
    assert "42.stl: expected workers that stay" in stood[42].error
    assert ended == 99


def test_an_executor_that_cannot_go_on_is_told() -> None:
    with pytest.raises(DiceError, match="scheduler"):
        run(named(3), Lossy(lambda *_: DiceError("the scheduler has gone")))


def test_each_file_is_written_or_says_why_not(tmp_path: Path) -> None:
    good, bad = tmp_path / "good.stl", tmp_path / "bad.stl"
    trimesh.creation.box((1, 2, 3)).export(good)
    bad.write_text("rubbish")
    jobs = [Job(path, path.name, tmp_path / f"{path.stem}.obj") for path in (bad, good)]
    told, (stood, ended) = stand_all(jobs, PoseChoice()), run(jobs, Inline())
    assert told == stood
    assert ended == 2
    assert "bad.stl: expected a .stl file" in stood[0].error
    assert stood[1].rests == 6
    assert [path.name for path in tmp_path.glob("*.obj")] == ["good.obj"]
