"""fit a table to counts of real dice, and predict each die from the others

Fits restitution and friction of each material, throws of each session, and their scatter; then
predicts the counts of each die from those of the others, and of dice that are not fitted. Without
--throws the counts are published ones: four printed dice and eight steel cuboids, with two printed
hulls that are not fitted. A file of your own has a line for each outcome and the columns die, mesh
(a file, or a folder written by `dicedesign run`, relative to the file), outcome and throws; for
mesh files also geometric (probability without momentum); optional com (x y z), session (default:
one a die) and material. The table of --to is of the first die's material and of a new session, or
of the only one. Exits 1 where no table explains the counts of a die.
"""

from __future__ import annotations

import argparse
import csv
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.stats import chi2_contingency, chisquare

from benchmarks.frame import Report, processes
from benchmarks.table_posterior import CountedDie, Posterior, p_value, throw_die
from dicedesign.errors import InputError, check_whole
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.results.folder import read_result
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.files import json_text, read_text
from dicedesign.throws.rigid_body import rigid_body
from dicedesign.throws.roll_log import whole_count
from dicedesign.throws.tables import mixture_entries
from dicedesign.tolerances import EQUAL_PROBABILITIES, SAME_REST_ANGLE

PUBLISHED = Path(__file__).parents[2] / "shared" / "data" / "published"
"""Public counts, beside the checkout."""

PUBLISHED_CHECKS = "armadillo_d3,dragon_d3"
"""Published dice that are not fitted: their inertia is not known."""

CUBE = np.array(list(product((-1.0, 1.0), repeat=3)))
"""Corners of a cube."""

MIN_EVALUATIONS = 32

FRESH_PART = 1 / 12
"""New drops of each die at the fitted table, as a part of the drops of all evaluations."""

IMPOSSIBLE = 0.001
"""p-value under the posterior of all counts up to which no table explains the counts of a die."""

MATCHED_PROBABILITIES = 0.02
"""Largest difference between the given geometric probabilities of outcomes and the probabilities of
the rests of a mesh that they are matched with: files of printed dice differ from publications."""

SUM_ERROR = 2e-3
"""Largest difference of an outcome's probability from the sum of those of its several faces."""

MAX_WAYS = 100_000
"""Limit on the ways to give rests to outcomes."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What is fitted and how thoroughly."""
    parser.add_argument("--throws", type=Path, metavar="CSV", help="counts (default: published)")
    parser.add_argument("--dice", metavar="NAME,...", help="fit to these (default: all)")
    parser.add_argument(
        "--check", metavar="NAME,...", help="predict these, without fitting to them"
    )
    parser.add_argument("--evaluations", type=int, metavar="N", help="sets (256; quick: 32)")
    parser.add_argument("--drops", type=int, metavar="N", help="of each die and set (2000; 50)")
    parser.add_argument("--seed", type=int, default=0, metavar="S")
    parser.add_argument("--to", type=Path, metavar="TABLE.json", help="table file to write")


def run(options: argparse.Namespace, report: Report) -> bool:
    """Fit, predict, and write the table."""
    if options.throws is None and not PUBLISHED.is_dir() and options.quick:
        report.line(f"skipped: no published counts in {PUBLISHED}; give --throws")
        return True
    evaluations = options.evaluations or (MIN_EVALUATIONS if options.quick else 256)
    drops = options.drops or (50 if options.quick else 2000)
    check_whole("evaluations", evaluations, MIN_EVALUATIONS)
    dice, others = read_dice(options)
    every = [*dice, *others]
    with processes(options.jobs) as workers:
        throw = partial(workers.map, throw_die)
        posterior = Posterior(dice, others, evaluations, drops, options.seed, throw)
        fresh, best = round(FRESH_PART * evaluations * drops), posterior.best_table
        # No evaluation has this seed.
        came = throw([(die, best(die.material), fresh, (options.seed,)) for die in every])
    if options.to is not None:
        counts = ", ".join(f"{die.counts.sum()} throws of {die.name}" for die in dice)
        about = {
            "name": options.to.stem,
            "source": f"fitted to {counts}",
            "mixture": mixture_entries(posterior.draw_tables()),
        }
        options.to.write_text(json_text(best(dice[0].material).as_dict() | about))
    row = report.table(
        "parameters",
        "parameter 30s | fitted 8.3g | mean 8.3g | +- 8.2g | 90 % from 8.3g | to 8.3g | "
        "prior +- 8.2g",
    )
    for parameter, values in posterior.parameters().items():
        row(parameter, *values)
    row = report.table(
        "dice",
        "die 18s | throws 6d | chi2 without momentum 6.2f | p 8.2g | chi2 fitted 6.2f | "
        "p fitted 8.2g | p by all dice 8.2g | p by other dice 8.2g",
    )
    is_good = True
    for i, (die, simulated) in enumerate(zip(every, came, strict=True)):
        resting = die.by_outcome(die.poses.probabilities)
        # An outcome that never came up has no place in a test of two samples.
        both = np.array([die.counts, simulated])
        tests = (
            *chisquare(die.counts, die.counts.sum() * resting / resting.sum()),
            *chi2_contingency(both[:, both.any(axis=0)], correction=False)[:2],
        )
        by_all, by_others = (
            p_value(die.counts, posterior.predict(i, without_own=without), posterior.rng)
            for without in (False, True)
        )
        by_all = by_all if i < len(dice) else None
        is_good &= by_all is None or by_all > IMPOSSIBLE
        row(die.name, int(die.counts.sum()), *tests, by_all, by_others)
    return is_good


def read_dice(options: argparse.Namespace) -> tuple[list[CountedDie], list[CountedDie]]:
    """The dice that are fitted to, and those that are only predicted."""
    path, check = options.throws or PUBLISHED / "throws.csv", options.check
    dice = {die.name: die for die in read_throws(path)}
    if options.throws is None and not options.quick:
        dice |= {die.name: die for die in read_cuboids(PUBLISHED / "square_cuboids.csv")}
    if options.throws is None and check is None:
        check = PUBLISHED_CHECKS
    others = check.split(",") if check else []
    fitted = options.dice.split(",") if options.dice else [one for one in dice if one not in others]
    if not fitted or set(fitted) & set(others) or not dice.keys() >= {*fitted, *others}:
        raise InputError(
            f"--dice, --check: expected names of different dice of {path} ({', '.join(dice)}), got "
            f"{', '.join(fitted)} and {', '.join(others)}; correct them"
        )
    return [dice[name] for name in fitted], [dice[name] for name in others]


def read_throws(path: Path) -> list[CountedDie]:
    """Dice of a file of counts; those in `PUBLISHED` have their materials and centers of mass."""
    of_die: dict[str, list[dict]] = {}
    for row in csv.DictReader(read_text(path, "a CSV file of throws").splitlines()):
        if not row.keys() >= {"die", "mesh", "outcome", "throws"} or None in row.values():
            raise InputError(
                f"{path}: expected die, mesh, outcome and throws in each line, got {row}; add them"
            )
        of_die.setdefault(row["die"], []).append(row)
    dice = []
    for name, rows in of_die.items():
        where, row = f"{path}, die {name}", rows[0]
        outcomes, mesh = [each["outcome"] for each in rows], path.parent / row["mesh"]
        if path.parent == PUBLISHED:
            row["material"], center = "plastic on wood", mesh.with_name(f"{name}_com.txt")
            row["com"] = center.read_text() if center.exists() else ""
        if mesh.is_dir():
            run = read_result(mesh)
            body = read_body(run.plain_file)
            poses, group = rest_poses(body, np.array(run.center_of_mass)), np.arange(len(rows))
            facets = [(outcomes.index(o), n) for o, n in run.outcome_normals if o in outcomes]
            shown, normals = map(np.array, zip(*facets, strict=True))
            of_rest = outcome_probabilities(poses, normals, shown).outcome_of_rest
        else:
            body, com = read_body(mesh), row.get("com")
            poses = rest_poses(body, np.array(com.split(), dtype=np.float64) if com else None)
            wanted = np.array([float(each["geometric"]) for each in rows])
            of_rest, group = match_outcomes(where, poses, wanted)
        labels = [" or ".join(np.array(outcomes)[group == one]) for one in range(max(group) + 1)]
        throws = [whole_count(where, each["throws"]) for each in rows]
        counts = np.bincount(group, throws).astype(np.int64)
        about = row.get("session", name), row.get("material", "")
        dice.append(
            CountedDie(name, rigid_body(body, poses), poses, of_rest, labels, counts, *about)
        )
    return dice


def read_cuboids(path: Path) -> list[CountedDie]:
    """Steel cuboids with two square faces, from the counts of these."""
    dice = []
    for row in csv.DictReader(read_text(path, "a CSV file of throws").splitlines()):
        name, squares = row["x_over_y"], int(row["square_faces"])
        body = make_body(CUBE * [1.0, 1.0, float(name)])
        poses, counts = rest_poses(body), np.array([squares, int(row["rolls"]) - squares])
        is_side = (np.abs(poses.normals[:, 2]) < 0.5).astype(np.int64)
        about = ["square", "side"], counts, name, "steel on floor"
        dice.append(CountedDie(f"cuboid {name}", rigid_body(body, poses), poses, is_side, *about))
    return dice


def match_outcomes(where: str, poses: RestPoses, wanted: Floats) -> tuple[Integers, Integers]:
    """Groups of rests (k,) and of outcomes (n,) that are known only by their probabilities without
    momentum, `wanted`.

    Rests with the closest normals are joined until there is one for each outcome: a facet that
    broke in two still looks like one. The most probable outcome is the most probable rest, and so
    on. If that does not fit, or joins rests far apart, an outcome may have several faces, whose
    probabilities have the sum of their outcome's. Outcomes whose probabilities differ by no more
    than the largest mismatch cannot be distinguished, and form one group.
    """
    p, size = poses.probabilities, len(wanted)
    joined = linkage(poses.normals, "single")
    part = fcluster(joined, size, "maxclust") - 1
    order = np.argsort(-wanted, kind="stable")
    of_part = np.empty(size, dtype=np.int64)
    of_part[np.argsort(-np.bincount(part, p, size), kind="stable")] = order
    of_rest = of_part[part]

    def mismatch(of_rest: Integers) -> float:
        return np.abs(np.bincount(of_rest, p, size) - wanted).max()

    is_far = joined[: len(p) - size, 2].max(initial=0.0) > SAME_REST_ANGLE
    off = mismatch(of_rest)
    if (is_far or off > MATCHED_PROBABILITIES) and size ** len(p) <= MAX_WAYS:
        ways = np.array(list(product(range(size), repeat=len(p))))
        ways = ways[[mismatch(way) <= SUM_ERROR for way in ways]]
        kinds = {tuple(sorted(zip(wanted[way], p.round(9), strict=True))) for way in ways}
        if kinds:
            of_rest, off = ways[0], mismatch(ways[0]) if len(kinds) == 1 else np.inf
    apart = -np.diff(wanted[order]) > max(off, EQUAL_PROBABILITIES)
    if off > MATCHED_PROBABILITIES or not apart.any():
        raise InputError(
            f"{where}: expected rests with the geometric probabilities of the outcomes in one way, "
            f"got {', '.join(f'{one:.4f}' for one in p)}; correct them, or name the folder of the "
            "die's run, which says which facet is which"
        )
    group = np.empty(size, dtype=np.int64)
    group[order] = np.insert(np.cumsum(apart), 0, 0)
    return group[of_rest], group
