"""Folders of unfinished runs."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.finished import finished_result

from dicedesign.errors import InputError, OutputError
from dicedesign.recipe.pipeline import run
from dicedesign.results.folder import open_results_folder, write_results
from dicedesign.runtime.checkpoint import Checkpoint


def fail_in_folder(folder: Path, fault: BaseException, *names: str) -> None:
    with open_results_folder(folder):
        for name in names:
            (folder / name).touch()
        raise fault


@pytest.mark.parametrize("fault", [InputError("no"), KeyboardInterrupt(), ValueError("wrapped")])
def test_empty_folders_are_removed_after_errors(tmp_path: Path, fault: BaseException) -> None:
    folder = tmp_path / "new" / "die"
    with pytest.raises(type(fault)):
        fail_in_folder(folder, fault)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(type(fault)):
        fail_in_folder(folder, fault, "checkpoint.npz")
    assert (folder / "checkpoint.npz").exists()


def test_a_checkpoint_of_a_run_may_be_there_and_a_file_of_its_name_may_not(tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.npz"
    checkpoint = Checkpoint(path)
    checkpoint.add("throws", [np.zeros(3)])
    checkpoint.save()
    with open_results_folder(tmp_path, ["checkpoint.npz"]):
        pass
    path.write_bytes(b"mine")
    with (
        pytest.raises(InputError, match=r"checkpoint\.npz"),
        open_results_folder(tmp_path, ["checkpoint.npz"]),
    ):
        pass
    assert path.read_bytes() == b"mine"


class Interrupting(dict[str, bytes]):
    """Files that send an interrupt with the second one."""

    def items(self) -> Any:
        for number, item in enumerate(super().items()):
            if number == 1:
                os.kill(os.getpid(), signal.SIGINT)
            yield item


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no signals to oneself")
def test_an_interrupt_waits_until_results_are_complete(tmp_path: Path) -> None:
    files = Interrupting({"die_plain.stl": b"solid", "recipe.yaml": b"name: box"})
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt, match="complete"):
            write_results(tmp_path, files, finished_result(["a"], [1.0]))
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert {path.name for path in tmp_path.iterdir()} == {*files, "result.json"}


def test_a_full_disk_keeps_the_earlier_run(tmp_path: Path) -> None:
    result = finished_result(["a"], [1.0])
    write_results(tmp_path, {"die_plain.stl": b"old", "recipe.yaml": b"old"}, result)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, limits[1]))
    try:
        with pytest.raises(OutputError, match=r"die\.stl"):
            write_results(tmp_path, {"die_plain.stl": b"new", "die.stl": bytes(10_001)}, result)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    names = ["die_plain.stl", "recipe.yaml", "result.json"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    assert (tmp_path / "die_plain.stl").read_bytes() == b"old"


HOLDER = """
import sys, time
from pathlib import Path
from dicedesign.results.folder import open_results_folder
with open_results_folder(Path(sys.argv[1])):
    print("in", flush=True)
    time.sleep(60)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such locks")
def test_a_folder_is_locked(tmp_path: Path) -> None:
    folder, recipe = tmp_path / "die", tmp_path / "r.yaml"
    recipe.write_text("name: r\ntarget: {fair: 2}\nengrave: false\nfigures: false\n")
    command = [sys.executable, "-c", HOLDER, str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "in\n"
        with pytest.raises(InputError, match="that no other process uses, but one does; "):
            run(recipe, folder)
        assert list(folder.iterdir()) == []
        holder.kill()
    # A killed process locks nothing.
    assert run(recipe, folder).converged


KILLED = """
import os, signal, sys
from pathlib import Path
from dicedesign.results.folder import open_results_folder
from dicedesign.runtime.files import atomic_write
os.replace = lambda *paths: os.kill(os.getpid(), signal.SIGKILL)
folder = Path(sys.argv[1])
with open_results_folder(folder):
    atomic_write(folder / "die.stl", b"whole")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such locks")
def test_partial_files_of_a_killed_process_are_removed(tmp_path: Path) -> None:
    mine = tmp_path / ".mine.part"
    mine.touch()
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)], check=False)
    assert done.returncode < 0
    (partial,) = set(tmp_path.glob(".*.part")) - {mine}
    assert partial.read_bytes() == b"whole"
    with open_results_folder(tmp_path):
        assert list(tmp_path.glob(".*.part")) == [mine]
