"""Run random recipes, some of them invalid, end them by signals, and run them again."""

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
"""Every tenth recipe is invalid."""

FRESH_EVERY = 10
"""Every tenth recipe runs in new interpreters; the others are forked."""

SIGNALS = (None, "SIGINT", "SIGTERM", "SIGKILL")
"""Names of signals, because Windows does not have all of them."""

MAX_SIGNAL_PART = 1.05
"""Latest time of a signal, over the duration of the undisturbed run."""

SAME_FACET = 1.0 - 1e-9
"""Least cosine between the normal of a rest and the normal of its facet in the result."""

FILE_LIMIT = 1e-6
"""Tolerance on the probabilities of a converged die in a single-precision file."""

FLAWS = """
name: ../die
seed: 1180591620717411303424
size_mm: .nan
target: {fair: 1000000000000}
target: {probabilities: [0.5, 0.6]}
target: null
method: {exact: {table: nowhere, probabilities: thrown}}
start: {mesh: {path: nowhere.stl}}
start: {prism: {sides: 1000000000}}
engrave: {style: carved}
edges: {radius_mm: 1000000000.0}
files: [stl, dxf]
center: uniform
"""
"""Invalid entries, one on each line."""


def random_recipe(rng: np.random.Generator) -> dict[str, Any]:
    """Small recipe that runs for at most about a second, as plain data."""
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
    """Content of an invalid recipe file."""
    recipe = random_recipe(rng)
    text = yaml.safe_dump(recipe).encode()
    flaw = yaml.safe_load(str(rng.choice(FLAWS.split("\n")[1:-1])))
    with_flaw = yaml.safe_dump(recipe | flaw).encode()
    variants = [b"", text[: rng.integers(1, 20)], text + b"\0", text + b"\xff", text + b"a: ["]
    variants += [text + b"more: !!python/object/apply:os.getpid []\n", text + b"x: *gone\n"]
    return with_flaw if rng.random() < 0.6 else variants[rng.integers(len(variants))]


def try_recipe(parent: Path, seed: int, number: int) -> list[str]:
    """Run a recipe undisturbed, end a second run by a signal, run it again, and list the faults.

    Some cases send no signal. parent: existing folder.
    """
    rng, folder = np.random.default_rng([seed, number]), parent / str(number)
    folder.mkdir()
    is_broken = number % BROKEN_EVERY == 0
    text = broken_recipe(rng) if is_broken else yaml.safe_dump(random_recipe(rng)).encode()
    (folder / "recipe.yaml").write_bytes(text)
    is_fresh = number // BROKEN_EVERY % FRESH_EVERY == number % FRESH_EVERY
    run = partial(run_command, folder=folder, program=None if is_fresh else dicedesign)
    alone = run(["run", "recipe.yaml", "--out", "alone"])
    # Labels that do not fit are refused only after the design.
    is_refused = is_broken or (alone.code == 2 and "size_mm" in alone.err)
    faults = faults_of(alone, *((2,) if is_refused else (0, 1)))
    if is_refused and (folder / "alone").exists():
        faults.append("a broken recipe left a folder")
    elif not is_refused and not faults:
        faults += result_faults(folder / "alone", alone.code)
    name = SIGNALS[rng.integers(len(SIGNALS))]
    after = float(rng.uniform(0.0, MAX_SIGNAL_PART)) * alone.seconds
    if name is not None and not faults:
        sent, out = signal.Signals[name], folder / "ended"
        ended = run(["run", "recipe.yaml", "--out", "ended"], sent=sent, after=after)
        # The signal may come before the program can handle it.
        signal_codes = (-sent,) if sent == signal.SIGKILL else (128 + sent, -sent)
        if not before_main(ended.err):
            faults += faults_of(ended, alone.code, *signal_codes)
        if (out / RESULT).exists():
            faults += read_faults(out)
        elif out.exists() and ended.code == 128 + sent:
            faults.append(f"an interrupted run left {sorted(path.name for path in out.iterdir())}")
        again = run(["run", "recipe.yaml", "--out", "ended"])
        faults += faults_of(again, alone.code)
        if not is_refused and not faults:
            faults += result_faults(out, again.code)
            faults += [
                f"{path.name} differs from the undisturbed run"
                for path in sorted((folder / "alone").iterdir())
                if path.read_bytes() != (out / path.name).read_bytes()
            ]
        faults = [
            f"{name} after {after:.2f} s of {alone.seconds:.2f} s: {fault}" for fault in faults
        ]
    shutil.rmtree(folder)
    return faults


def read_faults(out: Path) -> list[str]:
    """List files of a run that cannot be read or differ from result.json."""
    try:
        result = read_result(out)
        read_recipe(out / "recipe.yaml")
    except DiceError as error:
        return [str(error)]
    return [
        f"{name} is missing, or differs from its checksum in result.json"
        for name, checksum in result.sha256.items()
        if not (out / name).is_file() or sha256((out / name).read_bytes()).hexdigest() != checksum
    ]


def result_faults(out: Path, code: int) -> list[str]:
    """List faults in the results of a finished run; its file is read back."""
    if faults := read_faults(out):
        return faults
    result = read_result(out)
    extra = {path.name for path in out.iterdir()} - {RESULT, *result.sha256}
    if extra:
        faults.append(f"{sorted(extra)} left in the folder")
    if result.converged != (code == 0):
        faults.append(f"exit code {code} of a die that is {result.status}")
    poses = rest_poses(read_body(out / result.files["die_plain"]))
    cosines = poses.normals @ np.transpose([facet.normal for facet in result.facets])
    if cosines.max(axis=1).min() < SAME_FACET:
        faults.append("a rest is missing in the result")
    outcomes = [result.facets[facet].outcome for facet in cosines.argmax(axis=1)]
    got = np.array(
        [
            poses.probabilities[[outcome == label for outcome in outcomes]].sum()
            for label in result.labels
        ]
    )
    if np.abs(got - result.probabilities).max() > 1e-9:
        faults.append(f"probabilities {got} by the file, {result.probabilities} by the result")
    limit = max(read_recipe(out / "recipe.yaml").method.tolerance, FILE_LIMIT)
    if result.converged and result.thrown is None and np.abs(got - result.target).max() > limit:
        faults.append(f"probabilities {got} of a die that converged to {result.target}")
    return faults
