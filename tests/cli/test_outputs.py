"""Files of the user stay: whatever lies where a command would write, and whatever it reads."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.bodies import write_mesh

from dicedesign.cli.main import COMMANDS, main

RECIPE = """# my own notes
name: cube
target: {fair: 6}
faces: 6
engrave: false
print: false
figures: false
report: false
"""

WRITING = {
    "run": "run cube.yaml --out results --files stl,3mf",
    "design": "design d4 --out results --no-figures",
    "set": "set d4 --out results",
    "sweep": "sweep cube.yaml --seeds 1 --jobs 1 --out results",
    "rest": "rest brick.stl --figure map.svg",
    "rest table": "rest brick.stl --out table.csv --jobs 1",
    "pose": "pose brick.stl",
    "pose folder": "pose meshes --out posed --jobs 1",
    "scatter": "scatter meshes --count 2 --out room.glb --figure room.png",
    "figure": "figure complex brick.stl",
    "repair": "repair open.obj",
    "balance": "balance brick.stl --stand 2 --by infill --size-mm 60 --out balanced",
    "rolls": "rolls brick.stl counts.csv --figure rolls.pdf",
}
"""Commands that write files, by name and variant."""

SLOW = {"set", "sweep", "balance", "design"}
"""Those that take many seconds."""

READING = {"drop", "throw", "view"}
"""Commands that write none."""

MINE = b"mine\n"


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with what the commands read."""
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "cube.yaml").write_text(RECIPE)
    (folder / "counts.csv").write_text("label,count\n" + "".join(f"{k},9\n" for k in range(1, 7)))
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    (folder / "meshes").mkdir()
    for path in (folder / "brick.stl", folder / "meshes" / "box.stl"):
        box.export(path)
    write_mesh(folder / "open.obj", box.vertices, box.faces[1:])
    return folder


@pytest.fixture(scope="module")
def made(inputs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same folder after a run in the folder results."""
    folder = tmp_path_factory.mktemp("made") / "made"
    shutil.copytree(inputs, folder)
    assert main(["run", str(folder / "cube.yaml"), "--out", str(folder / "results")]) == 0
    return folder


def content(folder: Path) -> dict[str, bytes]:
    """Contents of all files in a folder, by path."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def run_in(folder: Path, line: str, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.chdir(folder)
    return main(line.split())


def test_all_commands_are_here() -> None:
    assert {name.split()[0] for name in WRITING} | READING == set(COMMANDS)


@pytest.mark.parametrize(
    "line",
    [
        pytest.param(line, id=name, marks=pytest.mark.full if name in SLOW else ())
        for name, line in WRITING.items()
    ],
)
def test_no_file_of_the_user_is_replaced(
    line: str, inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For each file that a command writes, one of the user's, or a link to one, has its name."""
    free = tmp_path / "free"
    shutil.copytree(inputs, free)
    assert run_in(free, line, monkeypatch) in (0, 1)
    written = sorted(content(free).keys() - content(inputs).keys())
    assert written
    elsewhere = tmp_path / "elsewhere"
    for number, name in enumerate(written):
        taken = tmp_path / f"taken{number}"
        shutil.copytree(inputs, taken)
        (taken / name).parent.mkdir(parents=True, exist_ok=True)
        if number % 2:
            (taken / name).write_bytes(MINE)
        else:
            elsewhere.write_bytes(MINE)
            (taken / name).symlink_to(elsewhere)
        before = content(taken)
        code = run_in(taken, line, monkeypatch)
        # The other dice of a sweep or a set are made.
        assert code == 2 or (line.startswith("sweep") and code == 1)
        after = content(taken)
        assert {path: after[path] for path in before} == before
        assert not [path for path in after if path.endswith(".part")]


@pytest.mark.parametrize(
    "line",
    [
        "rest brick.stl --figure brick.stl",
        "rest brick.stl --figure linked.png --overwrite",
        "rest meshes --out meshes/box.stl",
        "pose brick.stl --out linked.stl --overwrite",
        "pose brick.stl --out hard.stl --overwrite",
        "scatter meshes --out meshes/room.glb --overwrite",
        "figure complex brick.stl --out linked.png --overwrite",
        "figure complex results --out results/complex.png --overwrite",
        "repair brick.stl linked.stl --overwrite",
        "repair open.obj open.obj --overwrite",
        "balance brick.stl --fewest --out linked.stl --overwrite",
        "rolls brick.stl counts.csv --figure linked.png --overwrite",
        "rolls brick.stl --log counts.csv",
        "run results/recipe.yaml --out results --set size_mm=41",
        "run paper.yaml --out results",
    ],
)
def test_no_input_is_replaced(
    line: str, made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither by its own name, nor by a symbolic or a hard link, nor where a run has made it."""
    folder = tmp_path / "folder"
    shutil.copytree(made, folder)
    start = "method: {paper: {}}\nstart: {mesh: {path: results/die_plain.stl}}\n"
    (folder / "paper.yaml").write_text(RECIPE + start)
    shutil.copy(folder / "counts.csv", folder / "results" / "complex.png")
    (folder / "linked.stl").symlink_to("brick.stl")
    (folder / "linked.png").symlink_to("counts.csv" if "rolls" in line else "brick.stl")
    os.link(folder / "brick.stl", folder / "hard.stl")
    (folder / "meshes" / "room.glb").write_bytes((folder / "meshes" / "box.stl").read_bytes())
    before = content(folder)
    assert run_in(folder, line, monkeypatch) == 2
    after = content(folder)
    assert {path: after[path] for path in before} == before


def test_a_run_replaces_what_an_earlier_run_has_written(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing else: neither files beside it, nor one of its own that was edited since."""
    folder = tmp_path / "folder"
    shutil.copytree(made, folder)
    (folder / "results" / "notes.txt").write_bytes(MINE)
    assert run_in(folder, "run cube.yaml --out results --files 3mf", monkeypatch) == 0
    assert (folder / "results" / "die_plain.3mf").exists()
    assert run_in(folder, "run cube.yaml --out results", monkeypatch) == 0
    names = {path.name for path in (folder / "results").iterdir()}
    assert names == {"die_plain.stl", "recipe.yaml", "result.json", "notes.txt"}
    (folder / "results" / "die_plain.stl").write_bytes(MINE)
    before = content(folder)
    assert run_in(folder, "run cube.yaml --out results", monkeypatch) == 2
    assert content(folder) == before


def test_overwrite_replaces_a_file(
    inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "folder"
    shutil.copytree(inputs, folder)
    (folder / "map.svg").write_bytes(MINE)
    assert run_in(folder, "rest brick.stl --figure map.svg --overwrite", monkeypatch) == 0
    assert b"<svg" in (folder / "map.svg").read_bytes()


@pytest.mark.parametrize("killing", ["die_plain.stl", "recipe.yaml", "result.json"])
def test_a_run_that_is_killed_while_it_writes_can_be_repeated(
    killing: str, made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Over the files of another run; the bytes are then those of a run that was not killed."""
    folder, line = tmp_path / "folder", "run cube.yaml --out results --no-clock"
    shutil.copytree(made, folder)
    killer = f"""
import os, signal, sys
from dicedesign.cli.main import main
replace = os.replace
def replace_or_die(one, other):
    if os.path.basename(other) == {killing!r}:
        os.kill(os.getpid(), signal.SIGKILL)
    replace(one, other)
os.replace = replace_or_die
main(sys.argv[1:])
"""
    command = [sys.executable, "-c", killer, *line.split(), "--set", "size_mm=40"]
    assert subprocess.run(command, cwd=folder, check=False).returncode == -signal.SIGKILL
    assert not (folder / "results" / "result.json").exists()
    assert run_in(folder, line, monkeypatch) == 0
    again = content(folder / "results")
    shutil.rmtree(folder / "results")
    assert run_in(folder, line, monkeypatch) == 0
    assert content(folder / "results") == again


def test_files_of_a_result_stay_within_its_folder(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Names with a path in result.json are neither read, nor replaced, nor removed."""
    folder = tmp_path / "folder"
    shutil.copytree(made, folder)
    path = folder / "results" / "result.json"
    result = json.loads(path.read_text())
    for name in ("../brick.stl", str(folder / "brick.stl"), ".."):
        sums = {**result["sha256"], name: "0" * 64}
        path.write_text(json.dumps({**result, "sha256": sums}))
        assert run_in(folder, "throw results --drops 10 --jobs 1", monkeypatch) == 2
        files = {**result["files"], "die_plain": name}
        path.write_text(json.dumps({**result, "files": files}))
        assert run_in(folder, "throw results --drops 10 --jobs 1", monkeypatch) == 2


def test_a_changed_file_of_a_result_is_noted(
    made: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = tmp_path / "folder"
    shutil.copytree(made, folder)
    capsys.readouterr()
    line = "throw results --drops 10 --jobs 1"
    assert run_in(folder, line, monkeypatch) == 0
    assert "die_plain.stl" not in capsys.readouterr().err
    points = np.frombuffer((folder / "results" / "die_plain.stl").read_bytes(), np.uint8).copy()
    points[10] ^= 1
    (folder / "results" / "die_plain.stl").write_bytes(points.tobytes())
    assert run_in(folder, line, monkeypatch) == 0
    assert "die_plain.stl" in capsys.readouterr().err
