"""Runs of random recipes, some of them broken, ended by signals and begun again."""

from __future__ import annotations

import shutil
import signal
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from dicedesign.errors import DiceError
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.recipe.reading import read_recipe
from dicedesign.rest.poses import rest_poses
from dicedesign.results.folder import read_result
from dicedesign.results.result import RESULT, Result
from tests.soak.commands import (
    Case,
    Command,
    Ended,
    Fault,
    Tried,
    before_main,
    faults_of,
)

BROKEN_EVERY: Final = 10
"""One recipe in so many is broken."""

FRESH_EVERY: Final = 10
"""One recipe in so many is run by new interpreters; the others are forked."""

SIGNALS: Final = (None, "SIGINT", "SIGTERM", "SIGKILL")
"""By name, as Windows has not all of them."""

LATEST: Final = 1.05
"""A signal comes after a part of the seconds that the run took before, up to this."""

SAME_FACET: Final = 1.0 - 1e-9
"""Cosine of the angle between the normals of a rest and of the facet that the result tells."""

FILE_LIMIT: Final = 1e-6
"""By how much the odds of a file in single precision may miss those of a target that was met."""


def random_recipe(rng: np.random.Generator) -> dict[str, Any]:
    """A small recipe that takes about a second at most, as plain data."""
    recipe: dict[str, Any] = {"name": "die", "seed": int(rng.integers(2**32))}
    outcomes = int(rng.integers(3, 7))
    target: dict[str, Any] = {"fair": outcomes}
    which = rng.random()
    if which < 0.4:
        shares = rng.dirichlet(np.full(outcomes, 8.0)) + 0.02
        target = {"probabilities": [float(share) for share in shares / shares.sum()]}
        if rng.random() < 0.5:
            target["labels"] = [f"{letter}{outcomes}" for letter in "ABCDEFG"[:outcomes]]
    elif which < 0.6:
        outcomes = int(rng.integers(2, 4)) + 1
        target = {"binomial": outcomes - 1}
    recipe["target"] = target
    recipe["method"] = _method(rng, recipe, outcomes)
    recipe["size_mm"] = float(rng.uniform(15.0, 60.0))
    recipe["engrave"] = bool(rng.random() < 0.6)
    return recipe | {"figures": False, "report": False, "clock": False}


def _method(rng: np.random.Generator, recipe: dict[str, Any], outcomes: int) -> dict[str, Any]:
    """The recipe's method; with some it gets a start."""
    which = rng.random()
    if which < 0.35:
        recipe["start"] = {"prism": {"sides": outcomes}}
        step = ["momentum", "line_search"][int(rng.integers(2))]
        finish = ["exact", "none"][int(rng.integers(2))]
        return {"paper": {"step": step, "steps": int(rng.integers(0, 300)), "finish": finish}}
    exact: dict[str, Any] = {"starts": int(rng.integers(1, 5))}
    if which < 0.6:
        recipe["start"] = {"prism": {"sides": outcomes}}
    elif which < 0.7:
        refine = {"drops": 200, "rounds": 1, "verdict": 300, "within": 0.2}
        exact |= {"odds": "thrown", "table": "board-game", "refine": refine}
    return {"exact": exact}


def broken_recipe(rng: np.random.Generator) -> bytes:
    """The content of a file that is no recipe."""
    recipe = random_recipe(rng)
    text = yaml.safe_dump(recipe).encode()
    name, value = _FLAWS[int(rng.integers(len(_FLAWS)))]
    flawed = yaml.safe_dump(recipe | {name: value}).encode()
    ways = [b"", text[: int(rng.integers(1, 20))], text + b"\0", text + b"\xff", text + b"a: ["]
    ways += [text + b"more: !!python/object/apply:os.getpid []\n", text + b"x: *gone\n"]
    return flawed if rng.random() < 0.6 else ways[int(rng.integers(len(ways)))]


_FLAWS: Final[tuple[tuple[str, Any], ...]] = (
    ("name", "../die"),
    ("seed", -1),
    ("seed", 2**70),
    ("size_mm", 0),
    ("size_mm", float("nan")),
    ("target", {"fair": 1}),
    ("target", {"fair": 10**12}),
    ("target", {"probabilities": [0.5, 0.6]}),
    ("target", {"fair": 3, "binomial": 2}),
    ("target", None),
    ("method", {"exact": {"tolerance": -1.0}}),
    ("method", {"exact": {"table": "nowhere", "odds": "thrown"}}),
    ("start", {"mesh": {"path": "nowhere.stl"}}),
    ("start", {"prism": {"sides": 10**9}}),
    ("engrave", {"depth_mm": "deep"}),
    ("engrave", {"style": "carved"}),
    ("engrave", {"upright": [0, 0, 0]}),
    ("edges", {"radius_mm": 1e9}),
    ("numbering", "odd"),
    ("print", {"printer": "laser"}),
    ("print", {"infill": 20}),
    ("files", ["stl", "dxf"]),
    ("centre", "uniform"),
)
"""Entries that no recipe may have."""


def run_cases(folder: Path, numbers: range, seed: int) -> Iterator[Case]:
    """The cases of these numbers, each a recipe that is run to its end, run again and ended by a
    signal, or not, and in that case run once more.

    folder: an existing one.
    """
    for number in numbers:
        rng = np.random.default_rng([seed, number])
        broken = number % BROKEN_EVERY == 0
        fresh = number // BROKEN_EVERY % FRESH_EVERY == number % FRESH_EVERY
        text = broken_recipe(rng) if broken else yaml.safe_dump(random_recipe(rng)).encode()
        name = SIGNALS[int(rng.integers(len(SIGNALS)))]
        sent = None if name is None else signal.Signals[name]
        part = float(rng.uniform(0.0, LATEST))
        yield _case(folder, number, text, broken, fresh, sent, part)


def _case(
    parent: Path,
    number: int,
    text: bytes,
    broken: bool,
    fresh: bool,
    sent: signal.Signals | None,
    part: float,
) -> Case:
    folder = parent / str(number)
    folder.mkdir()
    (folder / "recipe.yaml").write_bytes(text)

    def command(out: str, **settings: Any) -> Command:
        arguments = ("run", "recipe.yaml", "--out", out)
        return Command(arguments, folder, fresh=fresh, **settings)

    alone = yield command("alone")
    # Labels that do not fit are known only once there is a die.
    refused = broken or (alone.code == 2 and "size_mm" in alone.err)
    faults = faults_of(alone, *((2,) if refused else (0, 1)))
    faults += _no_results(folder / "alone") if refused else _results(folder / "alone", alone)
    if sent is not None and not faults:
        after = part * alone.seconds
        ended = yield command("ended", sent=sent, after=after)
        # Where an interrupt goes through `exec`, as of a dataclass, Python ends itself by SIGINT.
        signalled = (130, -sent) if sent == signal.SIGINT else (-sent,)
        if not before_main(ended.err):
            faults += faults_of(ended, alone.code, *signalled)
        faults += _left(folder, sent, ended)
        again = yield command("ended")
        faults += faults_of(again, alone.code)
        if not refused:
            faults += _results(folder / "ended", again)
            faults += [] if faults else _differences(folder / "alone", folder / "ended")
        faults = [
            Fault(one.kind, f"{sent.name} after {after:.2f} s of {alone.seconds:.2f} s: {one.what}")
            for one in faults
        ]
    shutil.rmtree(folder)
    return Tried(number, faults)


def _no_results(folder: Path) -> list[Fault]:
    return [Fault("lost", "a broken recipe left a folder")] if folder.exists() else []


def _left(folder: Path, sent: signal.Signals, ended: Ended) -> list[Fault]:
    """What is wrong with what a run left that got a signal: files are whole, and an interrupted
    run leaves nothing half done."""
    out = folder / "ended"
    if not out.exists():
        return []
    faults = []
    if (out / RESULT).exists():
        faults += _readable(out)
    elif sent == signal.SIGINT and ended.code in (130, -sent):
        names = sorted(path.name for path in out.iterdir())
        faults += [Fault("lost", f"an interrupted run left {', '.join(names) or 'a folder'}")]
    return faults


def _readable(out: Path) -> list[Fault]:
    try:
        result = read_result(out)
        read_recipe(out / "recipe.yaml")
    except DiceError as error:
        return [Fault("lost", str(error))]
    return [
        Fault("lost", f"{name} is missing or not as result.json says")
        for name, checksum in result.sha256.items()
        if not (out / name).is_file() or sha256((out / name).read_bytes()).hexdigest() != checksum
    ]


def _results(out: Path, ended: Ended) -> list[Fault]:
    """What is wrong with the results of a run that came to its end."""
    if ended.code not in (0, 1):
        return []
    faults = _readable(out)
    if faults:
        return faults
    result = read_result(out)
    expected = {RESULT, *result.sha256}
    odd = sorted({path.name for path in out.iterdir()} - expected)
    faults += [Fault("lost", f"{name} was left in the folder") for name in odd]
    if result.converged != (ended.code == 0):
        faults.append(Fault("wrong", f"exit code {ended.code} of a die that is {result.status}"))
    return faults + _wrong_odds(out, result)


def _wrong_odds(out: Path, result: Result) -> list[Fault]:
    """What is wrong with the odds of a die by its file, read back, beside those that are told."""
    body = read_body(out / result.files["die_plain"])
    poses = rest_poses(body)
    normals = np.array([facet.normal for facet in result.facets])
    odds = dict.fromkeys(result.labels, 0.0)
    for normal, probability in zip(poses.normals, poses.probabilities.tolist(), strict=True):
        nearness = normals @ normal
        outcome = result.facets[int(nearness.argmax())].outcome
        if nearness.max() < SAME_FACET:
            return [Fault("wrong", f"a rest at {normal} of which the result tells nothing")]
        if outcome is not None:
            odds[outcome] += probability
    got = np.array(list(odds.values()))
    if np.abs(got - result.probabilities).max() > 1e-9:
        return [Fault("wrong", f"odds {got} by the file, {result.probabilities} by the result")]
    if result.converged and result.thrown is None:
        most = max(_tolerance(out), FILE_LIMIT)
        if np.abs(got - result.target).max() > most:
            return [Fault("wrong", f"odds {got} of a die that converged to {result.target}")]
    return []


def _tolerance(out: Path) -> float:
    return read_recipe(out / "recipe.yaml").method.tolerance


def _differences(alone: Path, other: Path) -> list[Fault]:
    """Which results of two runs of one recipe differ."""
    return [
        Fault("wrong", f"{path.name} is not that of the run left alone")
        for path in sorted(alone.iterdir())
        if path.read_bytes() != (other / path.name).read_bytes()
    ]
