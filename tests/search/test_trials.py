"""Trials against closed forms; lost workers and interrupts."""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from common.inline_executor import Inline, Lossy
from common.processes import heed_interrupts

from dicedesign.cli.main import main
from dicedesign.errors import DiceError, InputError, MeshFileError
from dicedesign.recipe.recipe import Recipe
from dicedesign.search.study import JOURNAL, open_study
from dicedesign.search.trials import run_search, run_trial

EXACT = {"start": {"search": {}}, "method": {"exact": {}}}


def test_a_tetrahedron_is_measured() -> None:
    entries = {"name": "four", "target": {"fair": 4}, "size_mm": 40, **EXACT}
    result = pickle.loads(pickle.dumps(run_trial)).__call__(entries)
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    assert result["status"] == "converged"
    assert result["max_abs_error"] < 1e-12
    vertices = np.array(result["vertices"])
    edges = np.linalg.norm(vertices[:, None] - vertices[None], axis=-1)
    assert edges.max() == pytest.approx(40.0)
    # Triangle of side 40; normals are acos(-1/3) apart, and borders lie half way between.
    assert result["inradius_mm"] == pytest.approx(40.0 / (2.0 * np.sqrt(3.0)), rel=1e-6)
    assert result["margin_deg"] == pytest.approx(np.degrees(np.arccos(-1.0 / 3.0)) / 2.0, rel=1e-6)
    assert result["asymmetry"] == pytest.approx(0.0, abs=1e-6)
    below = vertices @ np.array(result["down"])
    assert np.sort(below)[-3:] == pytest.approx(below.max())
    assert result["seconds"] > 0.0


def test_a_start_without_a_die_is_a_result() -> None:
    entries = {
        "name": "flat",
        "target": {"fair": 3},
        "start": {"prism": {"cap": 0.0}},
        "method": {"exact": {"starts": 2}},
    }
    result = run_trial(entries)
    assert result["status"] == "no_die"
    assert "expected" in result["message"]
    assert result["max_abs_error"] is None
    assert result["vertices"] is None


def test_a_missing_file_is_an_error() -> None:
    entries = {
        "name": "lost",
        "target": {"fair": 4},
        "start": {"mesh": {"path": "/nowhere.stl"}},
        "method": {"exact": {}},
    }
    with pytest.raises(MeshFileError, match="nowhere"):
        run_trial(entries)


@pytest.mark.usefixtures("made_up")
def test_a_trial_of_a_lost_worker_is_retried(tmp_path: Path, recipe: Recipe) -> None:
    lossy = Lossy(lambda count, recipe: count in (2, 3, 5))
    with open_study(tmp_path / "a", recipe) as study:
        run_search(study, 4, lossy, 1)
        finished = study.finished()
    assert len(lossy.submitted) == 7
    with open_study(tmp_path / "b", recipe) as study:
        run_search(study, 4, Inline(), 1)
        expected = study.finished()
    assert finished == expected


@pytest.mark.usefixtures("made_up")
def test_a_trial_that_loses_every_worker_ends_the_search(tmp_path: Path, recipe: Recipe) -> None:
    lossy = Lossy(lambda count, recipe: count > 2)
    message = "trial 2: expected workers .* it was running when workers were lost 5 times"
    with open_study(tmp_path, recipe) as study, pytest.raises(DiceError, match=message):
        run_search(study, 4, lossy, 1)
    with open_study(tmp_path, recipe) as study:
        assert [trial["number"] for trial in study.finished()] == [0, 1]
        run_search(study, 4, Inline(), 1)
        assert [trial["number"] for trial in study.finished()] == [0, 1, 3, 4]


@pytest.mark.usefixtures("made_up")
def test_a_trial_with_an_unreadable_file_is_retried(tmp_path: Path, recipe: Recipe) -> None:
    """Its mesh may be readable later."""
    lossy = Lossy(
        lambda count, recipe: InputError("gone.stl: no such file") if count == 2 else False
    )
    with open_study(tmp_path, recipe) as study, pytest.raises(InputError, match="no such file"):
        run_search(study, 3, lossy, 1)
    with open_study(tmp_path, recipe) as study:
        run_search(study, 3, Inline(), 1)
        assert [trial["number"] for trial in study.finished()] == [0, 1, 2]


def start_search(command: list[str], folder: Path, trials: int) -> subprocess.Popen[str]:
    """Start a search, and wait until it has `trials` trials."""
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, process_group=0, preexec_fn=heed_interrupts
    )
    deadline = time.monotonic() + 60.0
    while journal_size(folder) < trials:
        assert time.monotonic() < deadline
        assert process.poll() is None, process.stderr and process.stderr.read()
        time.sleep(0.05)
    return process


def journal_size(folder: Path) -> int:
    journal = folder / JOURNAL
    return journal.read_bytes().count(b'"values":[') if journal.exists() else 0


def running_processes(group: int) -> list[int]:
    """Running processes of a group."""
    listed = subprocess.run(
        ["ps", "-e", "-o", "pgid=,pid=,stat="], capture_output=True, text=True, check=True
    )
    rows = [line.split() for line in listed.stdout.splitlines()]
    return [int(pid) for pgid, pid, state in rows if int(pgid) == group and state[0] != "Z"]


def test_an_interrupted_search_can_be_resumed(
    tmp_path: Path, recipe_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C interrupts every process of the terminal's group."""
    folder = tmp_path / "out"
    search = ["search", str(recipe_path), "--jobs", "1", "--out", str(folder), "--trials"]
    process = start_search([sys.executable, "-m", "dicedesign", *search, "100000"], folder, 2)
    os.killpg(process.pid, signal.SIGINT)
    _, error = process.communicate(timeout=30.0)
    assert process.returncode == 130
    # A slow machine prints lines of progress before it.
    assert error.splitlines()[-1] == "dicedesign: interrupted; nothing half-written was left"
    deadline = time.monotonic() + 30.0
    while running_processes(process.pid):
        assert time.monotonic() < deadline, "workers live on"
        time.sleep(0.05)
    assert not list(folder.glob("*.part"))

    finished = journal_size(folder)
    assert main([*search, "1"]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith(f"four: {finished} of {finished} trials converged\n")
    assert captured.err == f"note: {finished} trials were already in {folder}\n"
