"""Runs of random recipes, some of them broken, ended by signals and begun again."""

from __future__ import annotations

import shutil
import signal
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from dicedesign.errors import DiceError
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.recipe.reading import read_recipe
from dicedesign.rest.poses import rest_poses
from dicedesign.results.folder import read_result
from dicedesign.results.result import RESULT
from tests.soak.frame import before_main, dicedesign, faults_of, run_command

BROKEN_EVERY = 10
"""One recipe in so many is broken."""

FRESH_EVERY = 10
"""One recipe in so many is run by new interpreters; the others are forked."""

SIGNALS = (None, "SIGINT", "SIGTERM", "SIGKILL")
"""By name, as Windows has not all of them."""

LATEST = 1.05
"""A signal comes after a part of the seconds that the run took before, up to this."""

SAME_FACET = 1.0 - 1e-9
"""Cosine of the angle between the normals of a rest and of the facet that the result tells."""

FILE_LIMIT = 1e-6
"""By how much the probabilities of a file in single precision may miss those of a target that was
met."""

FLAWS = """
name: ../die
seed: -1
seed: 1180591620717411303424
size_mm: 0
size_mm: .nan
target: {fair: 1}
target: {fair: 1000000000000}
target: {probabilities: [0.5, 0.6]}
target: {fair: 3, binomial: 2}
target: null
method: {exact: {tolerance: -1.0}}
method: {exact: {table: nowhere, probabilities: thrown}}
start: {mesh: {path: nowhere.stl}}
start: {prism: {sides: 1000000000}}
engrave: {depth_mm: deep}
engrave: {style: carved}
engrave: {upright: [0, 0, 0]}
edges: {radius_mm: 1000000000.0}
numbering: odd
print: {printer: laser}
print: {infill: 20}
files: [stl, dxf]
center: uniform
"""
"""Entries that no recipe may have, one on each line."""


def random_recipe(rng: np.random.Generator) -> dict[str, Any]:
    """A small recipe that takes about a second at most, as plain data."""
    outcomes = int(rng.integers(3, 7))
    shares = rng.dirichlet(np.full(outcomes, 8.0)) + 0.02
    listed = {"probabilities": (shares / shares.sum()).tolist()}
    labels = {"labels": [f"{letter}{outcomes}" for letter in "ABCDEFG"[:outcomes]]}
    targets = [{"fair": outcomes}, {"fair": outcomes}, listed, listed | labels]
    if outcomes < 5:
        targets.append({"binomial": outcomes - 1})
    prism = {"prism": {"sides": outcomes}}
    paper = {
        "step": str(rng.choice(["momentum", "line_search"])),
        "steps": int(rng.integers(0, 300)),
        "finish": str(rng.choice(["exact", "none"])),
    }
    exact = {"starts": int(rng.integers(1, 5))}
    refine = {"drops": 200, "rounds": 1, "verdict": 300, "within": 0.2}
    thrown = exact | {"probabilities": "thrown", "table": "board-game", "refine": refine}
    methods = [
        *[{"method": {"paper": paper}, "start": prism}] * 3,
        *[{"method": {"exact": exact}, "start": prism}] * 3,
        *[{"method": {"exact": exact}}] * 3,
        {"method": {"exact": thrown}, "size_mm": 20.0},
    ]
    return {
        "name": "die",
        "seed": int(rng.integers(2**32)),
        "target": targets[rng.integers(len(targets))],
        "size_mm": float(rng.uniform(15.0, 60.0)),
        **methods[rng.integers(len(methods))],
        "engrave": bool(rng.random() < 0.6),
        **dict.fromkeys(("figures", "report", "clock"), False),
    }


def broken_recipe(rng: np.random.Generator) -> bytes:
    """The content of a file that is no recipe."""
    recipe = random_recipe(rng)
    text = yaml.safe_dump(recipe).encode()
    flaw = yaml.safe_load(str(rng.choice(FLAWS.split("\n")[1:-1])))
    flawed = yaml.safe_dump(recipe | flaw).encode()
    ways = [b"", text[: rng.integers(1, 20)], text + b"\0", text + b"\xff", text + b"a: ["]
    ways += [text + b"more: !!python/object/apply:os.getpid []\n", text + b"x: *gone\n"]
    return flawed if rng.random() < 0.6 else ways[rng.integers(len(ways))]


def try_recipe(parent: Path, seed: int, number: int) -> list[str]:
    """What went wrong with a recipe that is run to its end, then, or not, run again, ended by a
    signal and in that case run once more. parent: an existing folder."""
    rng, folder = np.random.default_rng([seed, number]), parent / str(number)
    folder.mkdir()
    is_broken = number % BROKEN_EVERY == 0
    text = broken_recipe(rng) if is_broken else yaml.safe_dump(random_recipe(rng)).encode()
    (folder / "recipe.yaml").write_bytes(text)
    is_fresh = number // BROKEN_EVERY % FRESH_EVERY == number % FRESH_EVERY
    run = partial(run_command, folder=folder, program=None if is_fresh else dicedesign)
    alone = run(["run", "recipe.yaml", "--out", "alone"])
    # Labels that do not fit are known only once there is a die.
    is_refused = is_broken or (alone.code == 2 and "size_mm" in alone.err)
    faults = faults_of(alone, *((2,) if is_refused else (0, 1)))
    if is_refused and (folder / "alone").exists():
        faults.append("a broken recipe left a folder")
    elif not is_refused and not faults:
        faults += result_faults(folder / "alone", alone.code)
    name = SIGNALS[rng.integers(len(SIGNALS))]
    after = float(rng.uniform(0.0, LATEST)) * alone.seconds
    if name is not None and not faults:
        sent, out = signal.Signals[name], folder / "ended"
        ended = run(["run", "recipe.yaml", "--out", "ended"], sent=sent, after=after)
        # Where an interrupt goes through `exec`, as of a dataclass, Python ends itself by SIGINT.
        signalled = (130, -sent) if sent == signal.SIGINT else (-sent,)
        if not before_main(ended.err):
            faults += faults_of(ended, alone.code, *signalled)
        if (out / RESULT).exists():
            faults += unreadable(out)
        elif out.exists() and sent == signal.SIGINT and ended.code in signalled:
            faults.append(f"an interrupted run left {sorted(path.name for path in out.iterdir())}")
        again = run(["run", "recipe.yaml", "--out", "ended"])
        faults += faults_of(again, alone.code)
        if not is_refused and not faults:
            faults += result_faults(out, again.code)
            faults += [
                f"{path.name} is not that of the run left alone"
                for path in sorted((folder / "alone").iterdir())
                if path.read_bytes() != (out / path.name).read_bytes()
            ]
        faults = [f"{name} after {after:.2f} s of {alone.seconds:.2f} s: {one}" for one in faults]
    shutil.rmtree(folder)
    return faults


def unreadable(out: Path) -> list[str]:
    """Which results of a run cannot be read, or are not as result.json says."""
    try:
        result = read_result(out)
        read_recipe(out / "recipe.yaml")
    except DiceError as error:
        return [str(error)]
    return [
        f"{name} is missing or not as result.json says"
        for name, checksum in result.sha256.items()
        if not (out / name).is_file() or sha256((out / name).read_bytes()).hexdigest() != checksum
    ]


def result_faults(out: Path, code: int) -> list[str]:
    """What is wrong with the results of a run that came to its end: the probabilities of a die are
    those of its file, read back."""
    if faults := unreadable(out):
        return faults
    result = read_result(out)
    odd = {path.name for path in out.iterdir()} - {RESULT, *result.sha256}
    if odd:
        faults.append(f"{sorted(odd)} left in the folder")
    if result.converged != (code == 0):
        faults.append(f"exit code {code} of a die that is {result.status}")
    poses = rest_poses(read_body(out / result.files["die_plain"]))
    nearness = poses.normals @ np.transpose([facet.normal for facet in result.facets])
    if nearness.max(axis=1).min() < SAME_FACET:
        faults.append("a rest of which the result tells nothing")
    told = [result.facets[facet].outcome for facet in nearness.argmax(axis=1)]
    got = np.array(
        [poses.probabilities[[one == label for one in told]].sum() for label in result.labels]
    )
    if np.abs(got - result.probabilities).max() > 1e-9:
        faults.append(f"probabilities {got} by the file, {result.probabilities} by the result")
    most = max(read_recipe(out / "recipe.yaml").method.tolerance, FILE_LIMIT)
    if result.converged and result.thrown is None and np.abs(got - result.target).max() > most:
        faults.append(f"probabilities {got} of a die that converged to {result.target}")
    return faults
