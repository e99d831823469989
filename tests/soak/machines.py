"""State machines: results folders, sweeps and the page's bodies against simple models."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import trimesh
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from dicedesign.cli.main import main
from dicedesign.errors import InputError
from dicedesign.rest.poses import rest_poses
from dicedesign.results.folder import RESULT, open_results_folder, read_result, write_results
from dicedesign.runtime import workers
from dicedesign.sweep import dice as sweep_dice
from dicedesign.sweep import ranking
from dicedesign.sweep.ranking import LIST, PAGE, TABLE
from dicedesign.view.bodies import Bodies
from dicedesign.view.dice import Shop
from dicedesign.view.sources import open_source
from tests.common.finished import finished_result
from tests.common.inline_executor import Inline

NAMES = ("die.stl", "die_plain.stl", "recipe.yaml", "report.html", "faces.png")

names = st.sampled_from(NAMES)

of_runs = st.sampled_from((b"one", b"two", b"three"))

of_the_user = st.sampled_from((b"", b"mine", b'{"sha256": {}}'))


def files_in(folder: Path) -> dict[str, bytes]:
    """Contents of the files directly in a folder, without those that a kill left."""
    return {
        path.name: path.read_bytes()
        for path in folder.iterdir()
        if path.is_file() and path.suffix != ".part"
    }


class ResultsFolder(RuleBasedStateMachine):
    """Runs write into a folder, also killed ones, while the user changes files there."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.mine: dict[str, bytes] = {}
        """Files of the user."""
        self.runs: dict[str, list[bytes]] = {}
        """Contents that runs have written or may have written, by name."""

    def teardown(self) -> None:
        shutil.rmtree(self.folder)

    def write(self, files: dict[str, bytes]) -> None:
        with open_results_folder(self.folder):
            write_results(self.folder, files, finished_result(["a"], [1.0]))

    @rule(name=st.sampled_from((*NAMES, "notes.txt")), data=of_the_user)
    def put(self, name: str, data: bytes) -> None:
        """The user writes a file."""
        (self.folder / name).write_bytes(data)
        self.mine[name] = data

    @rule(name=names)
    def remove(self, name: str) -> None:
        (self.folder / name).unlink(missing_ok=True)
        self.mine.pop(name, None)

    @rule(files=st.dictionaries(names, of_runs, min_size=1))
    def run(self, files: dict[str, bytes]) -> None:
        files = {"die_plain.stl": b"plain"} | files
        before = files_in(self.folder)
        taken = files.keys() & self.mine.keys()
        try:
            self.write(files)
        except InputError:
            assert taken
            assert files_in(self.folder) == before
            return
        assert not taken
        self.runs = {name: [data] for name, data in files.items()}
        assert files_in(self.folder).keys() == {*files, RESULT, *self.mine}
        assert not read_result(self.folder).changes()

    @rule(files=st.dictionaries(names, of_runs, min_size=1), steps=st.integers(0, 9))
    def run_and_kill(self, files: dict[str, bytes], steps: int) -> None:
        """The process ends before one of its changes of names."""
        files = {"die_plain.stl": b"plain"} | files
        if files.keys() & self.mine.keys():
            return
        child = os.fork()
        if child == 0:
            left, replace, unlink = [steps], os.replace, os.unlink

            def count(change: Any) -> Any:
                def counted(*arguments: Any, **options: Any) -> None:
                    if left[0] == 0:
                        os._exit(0)
                    left[0] -= 1
                    change(*arguments, **options)

                return counted

            os.replace, os.unlink = count(replace), count(unlink)
            try:
                self.write(files)
            finally:
                os._exit(0)
        os.waitpid(child, 0)
        for name, data in files.items():
            self.runs.setdefault(name, []).append(data)

    @invariant()
    def files_of_the_user_stay(self) -> None:
        found = files_in(self.folder)
        assert {name: found.get(name) for name in self.mine} == self.mine
        for name in NAMES:
            if name in found and name not in self.mine:
                assert found[name] in self.runs[name]


class SweptFolder(RuleBasedStateMachine):
    """A sweep is repeated, while the user removes and changes dice."""

    source: Path
    """Folder of a finished sweep, and its recipe."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.state: dict[str, str] = {}
        """What became of each die: missing, made or damaged."""
        for name in self.dice():
            self.state[name] = "missing"

    def dice(self) -> list[str]:
        return sorted(path.parent.name for path in (self.source / "swept").glob("*/result.json"))

    def teardown(self) -> None:
        shutil.rmtree(self.folder)

    @rule()
    def sweep(self) -> None:
        made: list[str] = []

        def copy(folder: Path, recipes: Mapping[str, Any], inputs: Any) -> dict[str, str]:
            faults = {}
            for name in recipes:
                made.append(name)
                if self.state[name] == "damaged":
                    faults[name] = "it has files of the user"
                    continue
                shutil.rmtree(folder / name, ignore_errors=True)
                shutil.copytree(self.source / "swept" / name, folder / name)
            return faults

        line = ["sweep", str(self.source / "cube.yaml"), "--seeds", "3", "--out", str(self.folder)]
        with (
            patch.object(workers, "local_workers", lambda jobs: nullcontext(Inline())),
            patch.object(sweep_dice, "_make", copy),
            patch.object(ranking, "sweep_page", lambda *_: "page"),
        ):
            code = main(line)
        damaged = [name for name, state in self.state.items() if state == "damaged"]
        assert sorted(made) == sorted(n for n, state in self.state.items() if state != "made")
        assert code == (1 if damaged else 0)
        for name in self.dice():
            if self.state[name] == "missing":
                self.state[name] = "made"
        assert {PAGE, TABLE, LIST} <= files_in(self.folder).keys()
        assert (self.folder / TABLE).read_text().count(",converged,") == 3 - len(damaged)

    @rule(number=st.integers(0, 2))
    def remove(self, number: int) -> None:
        name = self.dice()[number]
        shutil.rmtree(self.folder / name, ignore_errors=True)
        self.state[name] = "missing"

    @precondition(lambda self: "made" in self.state.values())
    @rule(name=st.sampled_from(["die_plain.stl", "recipe.yaml", RESULT]), data=of_the_user)
    def damage(self, name: str, data: bytes) -> None:
        made = next(die for die, state in self.state.items() if state == "made")
        (self.folder / made / name).write_bytes(data)
        self.state[made] = "damaged"

    @precondition(lambda self: "made" in self.state.values())
    @rule(name=st.sampled_from(["die_plain.stl", RESULT]))
    def lose(self, name: str) -> None:
        made = next(die for die, state in self.state.items() if state == "made")
        (self.folder / made / name).unlink()
        self.state[made] = "missing"


class PageBodies(RuleBasedStateMachine):
    """A body of the page is changed, with wrong requests in between."""

    source: Path
    """Mesh file."""

    def __init__(self) -> None:
        super().__init__()
        self.bodies = Bodies(Shop(), open_source(self.source))
        opened = self.bodies.open({"name": self.source.name})
        self.states = {opened["state"]: opened}
        self.latest = opened

    def keep(self, answer: dict[str, Any]) -> None:
        shares = np.array([row["probability"] for row in answer["rows"]])
        assert abs(shares.sum() - 1.0) < 1e-9
        corners, center = np.array(answer["hull"]["vertices"]), np.array(answer["center"])
        expected = np.sort(rest_poses(corners, center).probabilities)
        np.testing.assert_allclose(np.sort(shares), expected, atol=1e-9)
        self.latest = self.states[answer["state"]] = answer

    @rule(by=st.tuples(*[st.floats(-3.0, 3.0)] * 3))
    def move_center(self, by: tuple[float, ...]) -> None:
        self.keep(self.bodies.change({"state": self.latest["state"], "center": list(by)}))

    @rule(corner=st.integers(0, 7), by=st.tuples(*[st.floats(-0.5, 0.5)] * 3))
    def move_corner(self, corner: int, by: tuple[float, ...]) -> None:
        query = {"state": self.latest["state"], "vertices": [corner], "by": list(by)}
        try:
            self.keep(self.bodies.change(query))
        except InputError:
            # The corner is gone, or the hull became flat.
            return

    @rule()
    def go_back(self) -> None:
        """The first state is kept for ever."""
        first = self.states[min(self.states)]
        again = self.bodies.change({"state": first["state"], "uniform": True})
        assert [row["probability"] for row in again["rows"]] == [
            row["probability"] for row in first["rows"]
        ]
        self.keep(again)

    @rule()
    def draw(self) -> None:
        assert "<svg" in self.bodies.gauss_map({"state": self.latest["state"]})["svg"]

    @rule(number=st.integers(-5, 10**9), center=st.lists(st.floats(), max_size=4))
    def ask_wrongly(self, number: int, center: list[float]) -> None:
        state = number if number not in self.states else -1
        for query in ({"state": state, "center": [0, 0, 0]}, {"state": state, "uniform": True}):
            try:
                self.bodies.change(query)
            except InputError:
                continue
            raise AssertionError(f"{query} was answered")
        if len(center) == 3 and not np.isfinite(center).all():
            try:
                self.bodies.change({"state": self.latest["state"], "center": center})
            except InputError:
                return
            raise AssertionError(f"{center} was answered")


def prepare_sweep(folder: Path) -> Path:
    """Make the sweep that `SweptFolder` copies."""
    (folder / "cube.yaml").write_text(
        "name: die\ntarget: {fair: 6}\nfaces: one\nengrave: false\nfigures: false\nreport: false\n"
    )
    line = ["sweep", str(folder / "cube.yaml"), "--seeds", "3", "--out", str(folder / "swept")]
    with patch.object(workers, "local_workers", lambda jobs: nullcontext(Inline())):
        assert main(line) == 0
    return folder


def prepare_body(folder: Path) -> Path:
    """Make the mesh that `PageBodies` opens."""
    trimesh.creation.box((1.0, 2.0, 3.0)).export(folder / "box.obj")
    return folder / "box.obj"
