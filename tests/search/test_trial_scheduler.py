"""Trials side by side, workers that are lost, and interrupts."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from common.inline_executor import Inline, Lossy
from common.signals import heed_interrupts

from dicedesign.cli.main import main
from dicedesign.errors import DiceError, InputError
from dicedesign.recipe.schema.reading import read_recipe
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.search.leaderboard import write_results
from dicedesign.search.study import JOURNAL, open_study
from dicedesign.search.trial_scheduler import run_search


@pytest.mark.usefixtures("made_up")
def test_a_trial_whose_worker_is_lost_runs_again(tmp_path: Path, recipe: Recipe) -> None:
    lossy = Lossy(lambda count, recipe: count in (2, 3, 5))
    with open_study(tmp_path / "a", recipe) as study:
        run_search(study, 4, lossy, 1)
        found = study.finished()
    assert len(lossy.submitted) == 7
    with open_study(tmp_path / "b", recipe) as study:
        run_search(study, 4, Inline(), 1)
        expected = study.finished()
    assert found == expected


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
def test_an_error_of_a_trial_is_none_of_the_worker(tmp_path: Path, recipe: Recipe) -> None:
    lossy = Lossy(lambda count, recipe: ZeroDivisionError("a bug") if count == 2 else False)
    with open_study(tmp_path, recipe) as study:
        with pytest.raises(ZeroDivisionError, match="a bug"):
            run_search(study, 4, lossy, 1)
        assert len(study.finished()) == 1
    with open_study(tmp_path, recipe) as study:
        run_search(study, 3, Inline(), 1)
        assert [trial["number"] for trial in study.finished()] == [0, 2, 3]


@pytest.mark.usefixtures("made_up")
def test_a_trial_that_cannot_be_run_here_comes_again(tmp_path: Path, recipe: Recipe) -> None:
    """A mesh may have been out of reach."""
    lossy = Lossy(
        lambda count, recipe: InputError("gone.stl: no such file") if count == 2 else False
    )
    with open_study(tmp_path, recipe) as study, pytest.raises(InputError, match="no such file"):
        run_search(study, 3, lossy, 1)
    with open_study(tmp_path, recipe) as study:
        run_search(study, 3, Inline(), 1)
        assert [trial["number"] for trial in study.finished()] == [0, 1, 2]


def begun(command: list[str], folder: Path, trials: int) -> subprocess.Popen[str]:
    """A search that has so many trials."""
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


def members(group: int) -> list[int]:
    """Processes of a group that still run."""
    listed = subprocess.run(
        ["ps", "-e", "-o", "pgid=,pid=,stat="], capture_output=True, text=True, check=True
    )
    rows = [line.split() for line in listed.stdout.splitlines()]
    return [int(pid) for pgid, pid, state in rows if int(pgid) == group and state[0] != "Z"]


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_search_can_go_on(
    tmp_path: Path, recipe_path: Path, capsys: pytest.CaptureFixture[str], end: signal.Signals
) -> None:
    """As by Ctrl-C, which every process of the terminal's group gets, or by force."""
    folder = tmp_path / "out"
    search = ["search", str(recipe_path), "--jobs", "1", "--out", str(folder), "--trials"]
    process = begun([sys.executable, "-m", "dicedesign", *search, "100000"], folder, 2)
    if end is signal.SIGINT:
        os.killpg(process.pid, end)
    else:
        process.kill()
    _, said = process.communicate(timeout=30.0)
    if end is signal.SIGINT:
        assert process.returncode == 130
        assert said == "dicedesign: interrupted; nothing half-written was left\n"
    deadline = time.monotonic() + 30.0
    while members(process.pid):
        assert time.monotonic() < deadline, "workers live on"
        time.sleep(0.05)
    assert not list(folder.glob("*.part"))

    found = journal_size(folder)
    assert main([*search, "1"]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith(f"four: {found} of {found} trials converged\n")
    assert captured.err == f"note: {found} trials were already in {folder}\n"


KILLED = """
import signal, sys
from pathlib import Path
from common.inline_executor import Inline
from common.made_up_trial import made_up_trial
from dicedesign.recipe.schema.reading import read_recipe
from dicedesign.search import study, trial_scheduler

path, folder, begins = sys.argv[1:]
left = int(begins)

def trial(entries):
    global left
    if left == 0:
        print("in a trial", flush=True)
        signal.pause()
    left -= 1
    return made_up_trial(entries)

trial_scheduler.run_trial = trial
with study.open_study(Path(folder), read_recipe(Path(path))) as search:
    trial_scheduler.run_search(search, 14, Inline(), 1)
"""


@pytest.mark.usefixtures("made_up")
def test_a_search_killed_in_its_trials_is_the_search_that_was_not(tmp_path: Path) -> None:
    path = tmp_path / "total.yaml"
    path.write_text("name: total\ntarget: {sum_of_dice: [2, 3]}\nstart: {repulsion: {}}\n")
    recipe, killed = read_recipe(path), tmp_path / "killed"
    for trials in (0, 3, 9):
        with subprocess.Popen(
            [sys.executable, "-c", KILLED, str(path), str(killed), str(trials)],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            stdout=subprocess.PIPE,
        ) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == b"in a trial\n"
            process.kill()
    with open_study(killed, recipe) as study:
        assert len(study.finished()) == 12
    found = []
    for folder in (killed, tmp_path / "whole"):
        with open_study(folder, recipe) as study:
            run_search(study, 14, Inline(), 1)
            found.append(study.finished())
            write_results(folder, recipe, found[-1])
    assert found[0] == found[1]
    for name in ("best.yaml", "leaderboard.json"):
        assert (killed / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
