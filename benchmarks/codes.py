"""bodies of nearly equal faces, and how far the momentum model is off on each of their faces

For each number of faces, take the code of the most even probabilities among thirty starts, without
short edges if there is one, and throw it onto the tables and hands of board-game. Faces with the
same probabilities by both models are images of each other, so that they count together. Off is the
total variation of the faces' thrown probabilities from the momentum model, and corrected from the
model with its bias, on fresh throws; chance is its mean for exact probabilities.

--to writes the codes with their bias, which starting shapes of dice take from
dicedesign/optimize/starts/codes.json.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import torch

from benchmarks.frame import Report
from dicedesign.geometry.hulls.hull import ConvexHull, polyhedron_corners
from dicedesign.geometry.meshes.body import make_body
from dicedesign.gradient.probability_model import ThrowProbabilities
from dicedesign.gradient.rest_probabilities import evaluate_rests
from dicedesign.optimize.starts.face_bodies import weighted_code
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.distances import measure_variation
from dicedesign.throws.simulation import DieOnTable, throwing_threads

FACES = (24, 30, 34, 36, 38, 42, 46, 48)

STARTS = 30

THROWN_WEIGHT = 0.5
"""Weight of the spread of thrown probabilities beside that of probabilities without momentum."""

FRESH = 4
"""One in so many throws is a fresh one."""

SHORT_EDGE, SHORT_COST = 0.1, 0.5
"""Length of a short edge over the distance of the planes, and the spread that it counts as."""

SAME = 3
"""Decimals of probabilities times the number of faces, to which faces are alike."""

TABLE, SIZE_MM = "board-game", 30.0


def add_options(parser: argparse.ArgumentParser) -> None:
    """What is thrown and written."""
    parser.add_argument("--drops", type=int, metavar="N", help="throws of a body (default: 100000)")
    parser.add_argument("--to", type=Path, metavar="FILE", help="write the codes to this JSON file")


def run(options: argparse.Namespace, report: Report) -> bool:
    """A row for each number of faces; whether the bias brings every model nearer to the throws."""
    drops = options.drops or (2000 if options.quick else 100_000)
    row = report.table(
        "codes",
        "faces 5d | kinds 5d | spread set down 6.3f | spread thrown 6.3f | off 6.4f | "
        "corrected 6.4f | chance 6.4f",
    )
    written, is_nearer = dict[str, dict[str, list[object]]](), True
    for faces in FACES[:: 4 if options.quick else 1]:
        normals, hull, resting, thrown = most_even_code(faces)
        kinds = np.round(np.stack([resting, thrown]) * faces, SAME)
        _, kind = np.unique(kinds, axis=1, return_inverse=True)
        counts = throw(hull, normals, drops, 1)
        members = np.bincount(kind)
        means = np.bincount(kind, counts / counts.sum()) / members
        bias = np.log(means / (np.bincount(kind, thrown) / members))[kind]
        again = throw(hull, normals, drops // FRESH, 2)
        corrected = thrown * np.exp(bias)
        before = measure_variation(again, thrown, 0.95)
        after = measure_variation(again, corrected / corrected.sum(), 0.95)
        row(
            *(faces, len(members), np.log(resting).std(), np.log(thrown).std()),
            *(before.value, after.value, before.noise_floor),
        )
        is_nearer &= after.value < before.value or options.quick
        half = normals[: faces // 2].round(9).tolist()
        written[str(faces)] = {"normals": half, "bias": bias.round(4).tolist()}
    if options.to is not None:
        lines = (
            f' "{faces}": {{\n  "normals": {json.dumps(code["normals"])},\n'
            f'  "bias": {json.dumps(code["bias"])}\n }}'
            for faces, code in written.items()
        )
        options.to.write_text("{\n" + ",\n".join(lines) + "\n}\n")
    return is_nearer


def most_even_code(faces: int) -> tuple[Floats, ConvexHull, Floats, Floats]:
    """Normals (f, 3) of a code, its hull, and probabilities (f,) of its faces, set down and thrown,
    of which the logarithms vary least."""
    model, found = ThrowProbabilities.on(TABLE), []
    for seed in range(STARTS):
        normals = weighted_code(np.full(faces, 1.0 / faces), seed).normals
        corners = polyhedron_corners(normals, np.ones(faces))
        rests = evaluate_rests(torch.from_numpy(corners))
        face = np.argmax(rests.hull.normals[rests.facets] @ normals.T, axis=1)
        if len(face) == faces:
            resting, thrown = np.zeros(faces), np.zeros(faces)
            resting[face] = rests.probability_values
            thrown[face] = model.probabilities(rests)
            hull = rests.hull
            edges = hull.vertices[hull.head] - hull.vertices[hull.tail]
            spread = np.log(resting).std() + THROWN_WEIGHT * np.log(thrown).std()
            spread += SHORT_COST * (np.linalg.norm(edges, axis=1).min() < SHORT_EDGE)
            found.append((round(float(spread), 6), seed, normals, hull, resting, thrown))
    return min(found, key=lambda one: one[:2])[2:]


def throw(hull: ConvexHull, normals: Floats, drops: int, seed: int) -> Floats:
    """Counts (f,) of the faces with normals (f, 3)."""
    body = make_body(hull.vertices * SIZE_MM / hull.diameter)
    die = DieOnTable.of(body, None, normals, TABLE, None)
    with throwing_threads() as workers:
        throws = die.simulate(drops, seed, workers=workers)
    return die.counts(throws)[:, :-1].sum(axis=0).astype(np.float64)
