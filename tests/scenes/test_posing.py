"""Many files in poses: in order, each on its own, and what happens when workers are lost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import trimesh
from common.inline_executor import Inline, Lossy

from dicedesign.scenes import posing
from dicedesign.scenes.posing import PoseChoice, PoseJob, PoseResult, write_each, write_poses


def made_up(jobs: list[PoseJob], choice: PoseChoice) -> list[PoseResult]:
    """All done, without a file."""
    return [PoseResult(job, 0, 1, 1.0) for job in jobs]


def named(count: int) -> list[PoseJob]:
    return [PoseJob(Path(f"{k}.stl"), f"{k}.stl", Path("out", f"{k}.stl")) for k in range(count)]


def run(jobs: list[PoseJob], executor: Any, workers: int = 2) -> tuple[list[PoseResult], int]:
    counts: list[int] = []
    stood = write_poses(jobs, PoseChoice(), executor, workers, on_done=counts.append)
    return stood, sum(counts)


def test_only_the_file_that_takes_workers_down_is_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(posing, "write_each", made_up)
    jobs = named(100)
    executor = Lossy(lambda count, task, *_: jobs[42] in task)
    stood, ended = run(jobs, executor)
    assert [one.job for one in stood] == jobs
    assert [k for k, one in enumerate(stood) if one.error] == [42]
    assert "42.stl: expected workers that stay" in stood[42].error
    assert ended == 99


def test_each_file_is_written_or_says_why_not(tmp_path: Path) -> None:
    good, bad = tmp_path / "good.stl", tmp_path / "bad.stl"
    trimesh.creation.box((1, 2, 3)).export(good)
    bad.write_text("rubbish")
    jobs = [PoseJob(path, path.name, tmp_path / f"{path.stem}.obj") for path in (bad, good)]
    told, (stood, ended) = write_each(jobs, PoseChoice()), run(jobs, Inline())
    assert told == stood
    assert ended == 2
    assert "bad.stl: expected a .stl file" in stood[0].error
    assert stood[1].rests == 6
    assert [path.name for path in tmp_path.glob("*.obj")] == ["good.obj"]
