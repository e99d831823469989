"""Files of counts of several dice, each with the die that was thrown."""

from __future__ import annotations

import dataclasses
import hashlib
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import InputError, OutsideHullError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.outcomes import OutcomeGroups, match_by_normals, match_by_odds, sums_by_outcome
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.results.folder import read_result
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.rigid_body import RigidBody, rigid_body
from dicedesign.throws.roll_log import csv_rows, read_counts, require_equal_lengths, whole_count
from dicedesign.throws.tables import LEAST_SIZE, MOST_SIZE

NEEDED: Final = ("die", "mesh", "outcome", "throws")

GEOMETRIC: Final = "geometric"

CENTER: Final = "com"

SIZE: Final = "size_mm"
"""Columns: those that every file has, and those that it may have."""

Rows = list[tuple[int, dict[str, str]]]


@dataclass(frozen=True)
class CountedDie:
    """A real die and what came up.

    Attributes
    ----------
    name: as in the file.
    body: the die.
    size: twice the largest distance of a point from its center of mass, in m; None if unknown.
    labels: of the g outcomes; those that cannot be told apart are one, such as "2 or 12".
    counts: (g,) how often each came up.
    geometric: (g,) their odds without momentum, summing to 1.
    group_of_rest: (k,) the outcome that each rest shows; -1 for none.
    poses: its rests.
    """

    name: str
    body: RigidBody
    size: float | None
    labels: tuple[str, ...]
    counts: Integers
    geometric: Floats
    group_of_rest: Integers
    poses: RestPoses

    def by_outcome(self, rests: Integers) -> Integers:
        """Sums (g,) of counts (k,) over the rests of each outcome; those that show none are left
        out."""
        return sums_by_outcome(rests, self.group_of_rest, len(self.labels))


def read_throw_counts(path: Path, dice: Sequence[str] | None = None) -> tuple[CountedDie, ...]:
    """The dice of a CSV file with a line for each outcome.

    Needed columns: `die`, a name; `mesh`, the path of a mesh file or of the folder of a finished
    run, relative to the CSV file; `outcome`; and `throws`, how often it came up. With a mesh file
    also `geometric`, the outcome's odds without momentum, by which outcomes are found on the mesh
    (see `match_by_odds`); perhaps `com`, its center of mass "x y z" where it is not the centroid;
    and perhaps `size_mm`, the die's largest extent across it. A run's folder tells all three.
    Other columns are ignored.

    Parameters
    ----------
    dice: names of those wanted; None takes all.

    Raises
    ------
    InputError: the file cannot be read, lacks a column or a die, has a die twice or an outcome
        twice, a count that is no whole number, a size or a center of mass that no die has, a die
        without throws, or outcomes that cannot be found on its mesh.
    """
    rows = _rows(path)
    of_die: dict[str, Rows] = {}
    for line, row in rows:
        of_die.setdefault(row["die"], []).append((line, row))
    wanted = list(of_die) if dice is None else list(dict.fromkeys(dice))
    for name in wanted:
        if name not in of_die:
            raise InputError(
                f"{path}: expected a die {name!r}, got {', '.join(of_die)}; take one of them"
            )
    return tuple(_die(path, name, of_die[name]) for name in wanted)


def uncounted_die(folder: Path) -> tuple[CountedDie, Floats]:
    """The die of a finished run's folder, without throws, and the target (g,) of its outcomes.

    Raises InputError: no run left that folder, or one of its labels is on no stable facet.
    """
    result = read_result(folder)
    body, poses, groups = _designed(folder, result.labels)
    odds = sums_by_outcome(poses.probabilities, groups.group_of_rest, len(result.labels))
    die = CountedDie(
        name=result.name,
        body=body,
        size=2e-3 * body.radius,
        labels=tuple(result.labels),
        counts=np.zeros(len(result.labels), dtype=np.int64),
        geometric=odds / odds.sum(),
        group_of_rest=groups.group_of_rest,
        poses=poses,
    )
    return die, np.array(result.target)


def rolled_die(folder: Path, rolls: Path) -> CountedDie:
    """The die of a finished run's folder, with the throws of a file as of `read_counts`.

    Raises InputError: as that, no run left that folder, or one of its labels is on no stable facet.
    """
    die, _ = uncounted_die(folder)
    return dataclasses.replace(die, counts=read_counts(rolls, die.labels))


def throws_digest(dice: Sequence[CountedDie]) -> str:
    """SHA-256 of dice and of what came up."""
    digest = hashlib.sha256()
    for die in dice:
        digest.update(repr((die.name, die.size, die.labels)).encode())
        of_body = [getattr(die.body, field.name) for field in dataclasses.fields(die.body)]
        for array in (die.counts, die.geometric, die.group_of_rest, *of_body):
            if isinstance(array, np.ndarray):
                digest.update(repr((array.dtype.str, array.shape)).encode())
                digest.update(array.tobytes())
    return digest.hexdigest()


def _rows(path: Path) -> Rows:
    """The lines that are not empty as entries by column, with their numbers."""
    columns, rows = csv_rows(path)
    missing = [name for name in NEEDED if name not in columns]
    if missing or len(set(columns)) < len(columns):
        raise InputError(
            f"{path}: expected the columns {', '.join(NEEDED)}, each once, got "
            f"{', '.join(columns) or 'none'}; write them on the first line"
        )
    require_equal_lengths(path, columns, rows)
    if not rows:
        raise InputError(f"{path}: expected a line for each outcome, got none; write some")
    return [(line, dict(zip(columns, row, strict=True))) for line, row in rows]


def _die(path: Path, name: str, rows: Rows) -> CountedDie:
    first = rows[0][1]
    for line, row in rows:
        for column in ("mesh", CENTER, SIZE):
            if row.get(column) != first.get(column):
                raise InputError(
                    f"{path}, line {line}: expected the {column} of the other lines of {name!r}, "
                    f"{first[column]!r}, got {row[column]!r}; give the die another name"
                )
    outcomes = [row["outcome"] for _, row in rows]
    for i, (line, _) in enumerate(rows):
        if outcomes[i] in outcomes[:i]:
            raise InputError(
                f"{path}, line {line}: expected each outcome of {name!r} once, got "
                f"{outcomes[i]!r} again; add the two up"
            )
    throws = np.array(
        [whole_count(path, line, row["throws"]) for line, row in rows], dtype=np.int64
    )
    if not throws.any():
        raise InputError(f"{path}: expected throws of {name!r}, got none; leave the die out")
    mesh = path.parent / first["mesh"]
    size = _size(path, rows[0][0], first[SIZE]) if first.get(SIZE) else None
    if os.path.isdir(mesh):
        body, poses, groups = _designed(mesh, outcomes)
        size = 2e-3 * body.radius if size is None else size
    else:
        body, poses, groups = _measured(path, name, mesh, rows)
    labels = tuple(" or ".join(outcomes[i] for i in members) for members in groups.members)
    if len(labels) < 2:
        raise InputError(
            f"{path}: expected two outcomes or more of {name!r}, got {', '.join(labels)}; leave "
            "the die out"
        )
    geometric = sums_by_outcome(poses.probabilities, groups.group_of_rest, len(labels))
    return CountedDie(
        name=name,
        body=body,
        size=size,
        labels=labels,
        counts=np.array([throws[list(members)].sum() for members in groups.members]),
        geometric=geometric / geometric.sum(),
        group_of_rest=groups.group_of_rest,
        poses=poses,
    )


def _measured(
    path: Path, name: str, mesh: Path, rows: Rows
) -> tuple[RigidBody, RestPoses, OutcomeGroups]:
    """The die of a mesh file, whose outcomes are found by their odds."""
    line, first = rows[0]
    if GEOMETRIC not in first:
        raise InputError(
            f"{path}: expected a column {GEOMETRIC} with the odds of each outcome without "
            f"momentum, as {name!r} is a mesh; add it, or name the folder of the die's run"
        )
    wanted = [_number(path, number, GEOMETRIC, row[GEOMETRIC]) for number, row in rows]
    center = None
    if first.get(CENTER):
        center = [_number(path, line, CENTER, text) for text in first[CENTER].split()]
        if len(center) != 3:
            raise InputError(
                f"{path}, line {line}: expected three numbers x y z as {CENTER}, got "
                f"{first[CENTER]!r}; correct it"
            )
    body = read_body(mesh)
    poses = _poses(f"{path}, line {line}", body, center)
    groups = match_by_odds(f"{path}, die {name}", poses.normals, poses.probabilities, wanted)
    return rigid_body(body, poses), poses, groups


def _designed(folder: Path, outcomes: Sequence[str]) -> tuple[RigidBody, RestPoses, OutcomeGroups]:
    """The die that a run left, whose facets have labels."""
    die = read_result(folder)
    for outcome in outcomes:
        if outcome not in die.labels:
            raise InputError(
                f"{folder}: expected a label of the die ({', '.join(die.labels)}), got "
                f"{outcome!r}; correct the outcome"
            )
    body = read_body(die.plain_file)
    poses = _poses(str(folder), body, np.array(die.center_of_mass))
    counted = [(outcomes.index(label), normal) for label, normal in die.shown if label in outcomes]
    for i, outcome in enumerate(outcomes):
        if i not in dict(counted):
            raise InputError(
                f"{folder}: expected a stable facet with the label {outcome!r}, got none; the die "
                "cannot have shown it"
            )
    normals = np.array([normal for _, normal in counted])
    groups = match_by_normals(poses.normals, normals, [outcome for outcome, _ in counted])
    return rigid_body(body, poses), poses, groups


def _poses(name: str, body: Body, center: ArrayLike | None) -> RestPoses:
    """The rests of a body; name: of where its center of mass is written, for messages."""
    try:
        return rest_poses(body, center)
    except OutsideHullError as error:
        raise OutsideHullError(f"{name}: {error}") from error


def _size(path: Path, line: int, text: str) -> float:
    """In m."""
    size = _number(path, line, SIZE, text) / 1e3
    if not LEAST_SIZE <= size <= MOST_SIZE:
        raise InputError(
            f"{path}, line {line}: expected a {SIZE} of {1e3 * LEAST_SIZE:g} to "
            f"{1e3 * MOST_SIZE:g}, got {text!r}; correct it"
        )
    return size


def _number(path: Path, line: int, column: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(
            f"{path}, line {line}: expected a finite number as {column}, got {text!r}; correct it"
        )
    return number
