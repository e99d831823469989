"""Files with counts of several dice and their meshes."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.errors import InputError, named
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.outcomes import (
    OutcomeGroups,
    match_by_normals,
    match_by_probability,
    sums_by_outcome,
)
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.results.folder import read_result
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.rigid_body import RigidBody, rigid_body
from dicedesign.throws.roll_log import check_lengths, csv_rows, read_counts, whole_count
from dicedesign.throws.tables import LEAST_SIZE, MOST_SIZE

NEEDED: Final = ("die", "mesh", "outcome", "throws")

GEOMETRIC: Final = "geometric"

CENTER: Final = "com"

SIZE: Final = "size_mm"

SESSION: Final = "session"

MATERIAL: Final = "material"
"""Columns of a file of several dice: required and optional ones."""


@dataclass(frozen=True)
class CountedDie:
    """Real die with its counts.

    Attributes
    ----------
    name: name of the die in the file.
    body: the die as a rigid body.
    size: twice the largest distance of a point from the center of mass, in m; None if unknown.
    labels: of the g outcomes; indistinguishable outcomes are merged, as in "2 or 12".
    counts: (g,) of the outcomes.
    geometric: (g,) probabilities of the outcomes without momentum, summing to 1.
    group_of_rest: (k,) outcome of each rest; -1 for none.
    poses: rests of the die.
    session: name of the session in which it was thrown; None for one of its own.
    material: name of the materials of die and table; "" if there is only one.
    """

    name: str
    body: RigidBody
    size: float | None
    labels: tuple[str, ...]
    counts: Integers
    geometric: Floats
    group_of_rest: Integers
    poses: RestPoses
    session: str | None = None
    material: str = ""

    @property
    def session_key(self) -> tuple[str | None, str]:
        """Equal for dice of one session."""
        return self.session, self.name if self.session is None else ""

    def by_outcome(self, rests: Integers) -> Integers:
        """Sums (g,) of counts (k,) over the rests of each outcome."""
        return sums_by_outcome(rests, self.group_of_rest, len(self.labels))


MatchedDie = tuple[RigidBody, RestPoses, OutcomeGroups]
"""Die with the outcomes of its rests."""


def read_throw_counts(path: Path, dice: Sequence[str] | None = None) -> tuple[CountedDie, ...]:
    """Read dice with their counts from a CSV file with a line for each outcome.

    Required columns: `die`, a name; `mesh`, the path of a mesh file or of the folder of a finished
    run, relative to the CSV file; `outcome`; and `throws`, its count. A mesh file also needs
    `geometric`, the outcome's probability without momentum, by which outcomes are matched with
    rests (see `match_by_probability`). Optional with a mesh file: `com`, the center of mass "x y z"
    if it is not the centroid, and `size_mm`, twice the largest distance of a point from it.
    Optional for all dice: `session`, the name of the session in which they were thrown, one for
    each die without this column; and `material`, the name of the materials of die and table, one
    for all dice without it. Other columns are ignored.

    Parameters
    ----------
    dice: names of the dice to read; None reads all.

    Raises
    ------
    InputError: the file cannot be read, lacks a column or a die, repeats an outcome, has an invalid
        count, size or center of mass, an empty session or material, a die without throws, or
        outcomes that do not match its mesh.
    """
    columns, rows = csv_rows(path)
    if not set(NEEDED) <= set(columns) or len(set(columns)) < len(columns):
        raise InputError(
            f"{path}: expected the columns {', '.join(NEEDED)}, each once, got "
            f"{', '.join(columns) or 'none'}; write them on the first line"
        )
    check_lengths(path, columns, rows)
    if not rows:
        raise InputError(f"{path}: expected a line for each outcome, got none; write some")
    of_die: dict[str, list[_Line]] = {}
    for line, entries in rows:
        row = dict(zip(columns, entries, strict=True))
        of_die.setdefault(row["die"], []).append(_Line(f"{path}, line {line}", row))
    wanted = of_die if dice is None else dict.fromkeys(dice)
    for name in wanted:
        if name not in of_die:
            raise InputError(
                f"{path}: expected a die {name!r}, got {', '.join(of_die)}; take one of them"
            )
    return tuple(_die(path, name, of_die[name]) for name in wanted)


def read_die_without_counts(folder: Path) -> tuple[CountedDie, Floats]:
    """Die of a finished run's folder, with counts of 0, and the target (g,) of its outcomes.

    Raises InputError if the folder is not of a run, or a label is on no stable facet.
    """
    result = read_result(folder)
    labels, die = result.labels, _read_designed_die(folder, result.labels)
    size, counts = 2e-3 * die[0].radius, np.zeros(len(labels), dtype=np.int64)
    return _make_counted_die(result.name, size, labels, counts, die), np.array(result.target)


def read_rolled_die(folder: Path, rolls: Path) -> CountedDie:
    """Die of a finished run's folder, with counts from a file; see `read_counts`.

    Raises InputError as `read_counts` and `read_die_without_counts`.
    """
    die, _ = read_die_without_counts(folder)
    return replace(die, counts=read_counts(rolls, die.labels))


def throws_digest(dice: Sequence[CountedDie]) -> str:
    """SHA-256 of dice and their counts."""
    names = {field.name for field in fields(CountedDie)} - {"body", "poses"}
    return " ".join(
        die.body.digest([np.asarray(getattr(die, name)).tolist() for name in sorted(names)])
        for die in dice
    )


def _make_counted_die(
    name: str, size: float | None, labels: Sequence[str], counts: Integers, die: MatchedDie
) -> CountedDie:
    body, poses, groups = die
    probabilities = sums_by_outcome(poses.probabilities, groups.group_of_rest, len(labels))
    geometric = probabilities / probabilities.sum()
    return CountedDie(
        name, body, size, tuple(labels), counts, geometric, groups.group_of_rest, poses
    )


@dataclass(frozen=True)
class _Line:
    """Entries of a line by column. where: file and line number, for messages."""

    where: str
    row: dict[str, str]

    def number(self, column: str, text: str | None = None) -> float:
        """Number in a column, or in a part of its text. Raises InputError if it is not finite."""
        text = self.row[column] if text is None else text
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise InputError(
                f"{self.where}: expected a finite number as {column}, got {text!r}; correct it"
            )
        return number


def _die(path: Path, name: str, lines: list[_Line]) -> CountedDie:
    first, outcomes = lines[0], list[str]()
    for line in lines:
        for column in ("mesh", CENTER, SIZE, SESSION, MATERIAL):
            if line.row.get(column) != first.row.get(column):
                raise InputError(
                    f"{line.where}: expected the {column} of the other lines of {name!r}, "
                    f"{first.row[column]!r}, got {line.row[column]!r}; give the die another name"
                )
        if line.row["outcome"] in outcomes:
            raise InputError(
                f"{line.where}: expected each outcome of {name!r} once, got "
                f"{line.row['outcome']!r} again; add the two up"
            )
        outcomes.append(line.row["outcome"])
    for column in (SESSION, MATERIAL):
        if first.row.get(column) == "":
            raise InputError(
                f"{first.where}: expected the name of a {column}, got none; write one for each "
                "die, or leave the column out"
            )
    throws = np.array([whole_count(line.where, line.row["throws"]) for line in lines])
    if not throws.any():
        raise InputError(f"{path}: expected throws of {name!r}, got none; leave the die out")
    size, mesh = None, path.parent / first.row["mesh"]
    if first.row.get(SIZE):
        size = first.number(SIZE) / 1e3
        if not LEAST_SIZE <= size <= MOST_SIZE:
            raise InputError(
                f"{first.where}: expected a {SIZE} of {1e3 * LEAST_SIZE:g} to "
                f"{1e3 * MOST_SIZE:g}, got {first.row[SIZE]!r}; correct it"
            )
    if os.path.isdir(mesh):
        die = _read_designed_die(mesh, outcomes)
        size = 2e-3 * die[0].radius if size is None else size
    else:
        die = _measure_mesh(path, name, mesh, lines)
    members = die[2].members
    labels = [" or ".join(outcomes[i] for i in group) for group in members]
    if len(labels) < 2:
        raise InputError(
            f"{path}: expected two outcomes or more of {name!r}, got {', '.join(labels)}; leave "
            "the die out"
        )
    counts = np.array([throws[list(group)].sum() for group in members])
    counted = _make_counted_die(name, size, labels, counts, die)
    return replace(counted, session=first.row.get(SESSION), material=first.row.get(MATERIAL, ""))


def _measure_mesh(path: Path, name: str, mesh: Path, lines: list[_Line]) -> MatchedDie:
    """Die of a mesh file, with outcomes matched by their probabilities."""
    first, center = lines[0], None
    if GEOMETRIC not in first.row:
        raise InputError(
            f"{path}: expected a column {GEOMETRIC} with the probabilities of each outcome without "
            f"momentum, as {name!r} is a mesh; add it, or name the folder of the die's run"
        )
    wanted = [line.number(GEOMETRIC) for line in lines]
    if first.row.get(CENTER):
        center = [first.number(CENTER, text) for text in first.row[CENTER].split()]
        if len(center) != 3:
            raise InputError(
                f"{first.where}: expected three numbers x y z as {CENTER}, got "
                f"{first.row[CENTER]!r}; correct it"
            )
    body = read_body(mesh)
    with named(first.where):
        poses = rest_poses(body, center)
    groups = match_by_probability(f"{path}, die {name}", poses.normals, poses.probabilities, wanted)
    return rigid_body(body, poses), poses, groups


def _read_designed_die(folder: Path, outcomes: Sequence[str]) -> MatchedDie:
    """Die of a run's folder, with outcomes matched by the labels of its facets."""
    die = read_result(folder)
    shown = [
        (outcomes.index(label), normal)
        for label, normal in die.outcome_normals
        if label in outcomes
    ]
    for i, outcome in enumerate(outcomes):
        if outcome not in die.labels:
            raise InputError(
                f"{folder}: expected a label of the die ({', '.join(die.labels)}), got "
                f"{outcome!r}; correct the outcome"
            )
        if i not in dict(shown):
            raise InputError(
                f"{folder}: expected a stable facet with the label {outcome!r}, got none; the die "
                "cannot have shown it"
            )
    body = read_body(die.plain_file)
    with named(str(folder)):
        poses = rest_poses(body, np.array(die.center_of_mass))
    of_facets, normals = zip(*shown, strict=True)
    groups = match_by_normals(poses.normals, np.array(normals), of_facets)
    return rigid_body(body, poses), poses, groups
