"""`write_poses` returns one result per file, in order, even when workers are lost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from common.inline_executor import Inline, Lossy
from trimesh.visual.material import PBRMaterial

from dicedesign.geometry.meshes.body import body_of
from dicedesign.scenes import posing
from dicedesign.scenes.posing import (
    PoseChoice,
    PoseJob,
    PoseResult,
    load_scene,
    write_each,
    write_poses,
)


def succeed(jobs: list[PoseJob], choice: PoseChoice) -> list[PoseResult]:
    """Report success without writing files."""
    return [PoseResult(job, 0, 0, 1, 1.0) for job in jobs]


def list_jobs(count: int) -> list[PoseJob]:
    return [PoseJob(Path(f"{k}.stl"), f"{k}.stl", Path("out", f"{k}.stl")) for k in range(count)]


def run(jobs: list[PoseJob], executor: Any, workers: int = 2) -> tuple[list[PoseResult], int]:
    counts: list[int] = []
    results = write_poses(jobs, PoseChoice(), executor, workers, on_done=counts.append)
    return results, sum(counts)


def test_only_the_file_that_kills_workers_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(posing, "write_each", succeed)
    jobs = list_jobs(100)
    executor = Lossy(lambda count, task, *_: jobs[42] in task)
    results, ended = run(jobs, executor)
    assert [result.job for result in results] == jobs
    assert [k for k, result in enumerate(results) if result.error] == [42]
    assert "42.stl: expected workers" in results[42].error
    assert ended == 99


def test_each_file_is_written_or_has_an_error(tmp_path: Path) -> None:
    good, bad = tmp_path / "good.stl", tmp_path / "bad.stl"
    trimesh.creation.box((1, 2, 3)).export(good)
    bad.write_text("rubbish")
    jobs = [PoseJob(path, path.name, tmp_path / f"{path.stem}.obj") for path in (bad, good)]
    results, ended = run(jobs, Inline())
    assert results == write_each(jobs, PoseChoice())
    assert ended == 2
    assert "bad.stl: expected a .stl file" in results[0].error
    assert results[1].rests == 6
    assert [path.name for path in tmp_path.glob("*.obj")] == ["good.obj"]


def test_a_scene_has_the_shape_that_was_read(tmp_path: Path) -> None:
    """It has the materials of a file only where trimesh reads that shape, too."""
    path, box = tmp_path / "red.glb", trimesh.creation.box((1e-3, 2e-3, 3e-3))
    material = PBRMaterial(name="red", baseColorFactor=[255, 0, 0, 255])
    box.visual = trimesh.visual.TextureVisuals(material=material)
    box.export(path)
    for factor in (1.0, 1.1):
        body = body_of(trimesh.Trimesh(factor * box.vertices, box.faces))
        scene = load_scene(path, body)
        np.testing.assert_allclose(scene.extents, factor * box.extents, rtol=1e-6)
        (mesh,) = scene.geometry.values()
        assert (getattr(mesh.visual, "material", None) is not None) == (factor == 1.0)
