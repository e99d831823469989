"""Kill commands that resume at random moments, and compare the end with an undisturbed run."""

from __future__ import annotations

import csv
import shutil
import signal
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from tests.soak.frame import CommandEnd, before_main, dicedesign, faults_of, run_command

KILLS = 10
"""Kills of a case."""

MAX_KILL_PART = 0.9
"""Latest time of a kill, over the duration of the undisturbed run."""

DIE = """name: die
engrave: false
figures: false
report: false
clock: false
"""

INPUTS = {
    "search.yaml": DIE
    + "target: {fair: 3}\n"
    + "start: {mesh: {path: ball.off}}\n"
    + "method: {concave: {attempts: 3, displacement: 1.0e-9}}\n",
    "table.yaml": DIE
    + "target: {fair: 6}\nfaces: one\n"
    + "method: {exact: {table: board-game, probabilities: thrown, "
    + "refine: {drops: 200, rounds: 2, verdict: 300, within: 0.2}}}\n",
    "cube.yaml": DIE + "target: {fair: 6}\nfaces: one\n",
}


@dataclass(frozen=True)
class Resumed:
    """Command that resumes.

    Attributes
    ----------
    words: command line; again: words that a repeated one has more, if a checkpoint is there.
    out: file or folder that it writes.
    """

    words: str
    out: str
    again: str = ""


COMMANDS = (
    Resumed("run search.yaml --out die", "die", "--resume"),
    Resumed("run table.yaml --out die", "die", "--resume"),
    Resumed("run cube.yaml --out die", "die"),
    Resumed("sweep cube.yaml --seeds 2 --out swept", "swept"),
    Resumed("rest meshes --out rests.csv", "rests.csv"),
)
"""Commands that resume, or may be repeated."""


def without_processes(arguments: list[str]) -> int:
    """Run a command that works in this process, and saves its table often."""
    from dicedesign.runtime import checkpoint, workers
    from tests.common.inline_executor import Inline

    workers.local_workers = lambda jobs: nullcontext(Inline())
    checkpoint.INTERVAL = 0.05
    return dicedesign(arguments)


def fill(folder: Path) -> None:
    """Write the inputs of all commands."""
    for name, text in INPUTS.items():
        (folder / name).write_text(text)
    ball = trimesh.creation.icosphere(1)
    x, y, z = ball.vertices.T
    dents = 1.0 - 0.3 * np.exp(-4.0 * ((x - 0.7) ** 2 + y**2 + (z - 0.7) ** 2))
    trimesh.Trimesh(ball.vertices * dents[:, None], ball.faces, process=False).export(
        folder / "ball.off"
    )
    (folder / "meshes").mkdir()
    for number in range(40):
        sizes = (1.0, 1.0 + 0.01 * number, 1.7)
        trimesh.creation.box(sizes).export(folder / "meshes" / f"{number:02}.stl")


def content(path: Path) -> dict[str, bytes]:
    """Files below a path, without run times in tables of rests."""
    if path.is_file():
        with path.open(newline="") as file:
            rows = [{**row, "seconds": ""} for row in csv.DictReader(file)]
        return {"": repr(rows).encode()}
    return {
        str(one.relative_to(path)): one.read_bytes() for one in path.rglob("*") if one.is_file()
    }


def try_kills(parent: Path, seed: int, number: int) -> list[str]:
    """Run a command undisturbed, and again with kills until it ends; list the faults.

    parent: existing folder.
    """
    rng, command = np.random.default_rng([seed, number]), COMMANDS[number % len(COMMANDS)]
    folder = parent / str(number)
    folder.mkdir()
    fill(folder)

    def run(sent: signal.Signals | None = None, after: float = 0.0) -> CommandEnd:
        words = command.words.split()
        if command.again and (folder / command.out / "checkpoint.npz").exists():
            words.append(command.again)
        return run_command(words, folder, program=without_processes, sent=sent, after=after)

    alone, out = run(), folder / command.out
    # A search that meets no goal ends with 1.
    faults = faults_of(alone, 0, 1)
    whole = content(out)
    shutil.rmtree(out) if out.is_dir() else out.unlink()
    sent = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
    for _ in range(KILLS):
        kind = sent[rng.integers(len(sent))]
        ended = run(kind, float(rng.uniform(0.0, MAX_KILL_PART)) * alone.seconds)
        if not before_main(ended.err):
            faults += [f"{kind.name}: {fault}" for fault in faults_of(ended, 0, 1, *codes_of(kind))]
    again = run()
    faults += faults_of(again, alone.code if alone.code is not None else 0)
    if not faults and content(out) != whole:
        other = content(out)
        names = sorted(name for name in {*whole, *other} if whole.get(name) != other.get(name))
        faults.append(f"{names} differ from the undisturbed run")
    shutil.rmtree(folder)
    return [f"{command.words}: {fault}" for fault in faults]


def codes_of(sent: signal.Signals) -> tuple[int, ...]:
    """Exit codes of a command after a signal."""
    return (-sent,) if sent == signal.SIGKILL else (128 + sent, -sent)
