"""What a run leaves of a folder that it did not finish."""

from __future__ import annotations

from pathlib import Path

import pytest

from dicedesign.errors import InputError
from dicedesign.results.folder import kept_folder


def broken_off(folder: Path, fault: BaseException, *names: str) -> None:
    with kept_folder(folder):
        folder.mkdir(parents=True)
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
