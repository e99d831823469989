"""What a run leaves of a folder that it did not finish."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from dicedesign.errors import InputError
from dicedesign.recipe.run import run
from dicedesign.results.folder import folder_of_results


def broken_off(folder: Path, fault: BaseException, *names: str) -> None:
    with folder_of_results(folder):
        for name in names:
            (folder / name).touch()
        raise fault


@pytest.mark.parametrize("fault", [InputError("no"), KeyboardInterrupt()])
def test_folders_in_which_nothing_was_written_go_again(
    tmp_path: Path, fault: BaseException
) -> None:
    folder = tmp_path / "new" / "die"
    with pytest.raises(type(fault)):
        broken_off(folder, fault)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(type(fault)):
        broken_off(folder, fault, "checkpoint.npz")
    assert (folder / "checkpoint.npz").exists()


HOLDER = """
import sys, time
from pathlib import Path
from dicedesign.results.folder import folder_of_results
with folder_of_results(Path(sys.argv[1])):
    print("in", flush=True)
    time.sleep(60)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such locks")
def test_two_do_not_write_into_one_folder(tmp_path: Path) -> None:
    folder, recipe = tmp_path / "die", tmp_path / "r.yaml"
    recipe.write_text("name: r\ntarget: {fair: 2}\nengrave: false\nfigures: false\n")
    command = [sys.executable, "-c", HOLDER, str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "in\n"
        expected = rf"die: expected a folder that nobody else .* process {holder.pid} on .* does; "
        with pytest.raises(InputError, match=expected):
            run(recipe, folder)
        assert [path.name for path in folder.iterdir()] == [".lock"]
        holder.kill()
    # What it left locks nothing.
    assert (folder / ".lock").exists()
    assert run(recipe, folder).converged
    assert not (folder / ".lock").exists()
