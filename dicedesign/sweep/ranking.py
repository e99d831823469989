"""Page and table of a sweep, the best dice first."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dicedesign.fabricate.engraving import labels_below_hull, labels_off_surface
from dicedesign.fabricate.file_formats import Part
from dicedesign.geometry.meshes.reading import read_stl
from dicedesign.palette import BLANK, INK
from dicedesign.report.pages import sweep_page
from dicedesign.results.result import Result
from dicedesign.runtime.arrays import Booleans, Floats
from dicedesign.runtime.csv_cells import guard_cell
from dicedesign.runtime.files import json_text
from dicedesign.runtime.outputs import checksums, replace_files
from dicedesign.sweep.dice import Combination, made_die

PAGE = "index.html"

TABLE, LIST = "sweep.csv", "sweep.json"

COLUMNS = (
    "rank",
    "folder",
    "status",
    "max_abs_error",
    "inradius_mm",
    "margin_deg",
    "asymmetry",
    "on_front",
    "seconds",
    "message",
)
"""Columns of sweep.csv, before the columns of the varied keys."""

Row = dict[str, Any]
"""Row of sweep.csv by column, or entry of set.json."""


def pareto_front(points: Floats) -> Booleans:
    """Pareto-optimal points (n, d), as (n,): no other is at least as large in all coordinates, and
    larger in one."""
    at_least = np.all(points[None] >= points[:, None], axis=-1)
    larger = np.any(points[None] > points[:, None], axis=-1)
    dominated: Booleans = np.any(at_least & larger, axis=1)
    return ~dominated


def rank_rows(rows: Sequence[Row]) -> list[Row]:
    """Sort rows, the best first, and fill in "rank" and "on_front" of the converged ones.

    Converged dice are ranked by the product of inradius and margin, then by error and order. No
    die comes after one that is worse in both.
    """

    def order(row: Row) -> tuple[bool, float, float]:
        if row["status"] != "converged":
            return True, 0.0, math.inf
        return (
            False,
            -(row["inradius_mm"] or 0.0) * (row["margin_deg"] or 0.0),
            row["max_abs_error"],
        )

    ranked = sorted(rows, key=order)
    solved = [row for row in ranked if row["status"] == "converged"]
    measures = [[row["inradius_mm"] or 0.0, row["margin_deg"] or 0.0] for row in solved]
    front = pareto_front(np.reshape(measures, (-1, 2)))
    for rank, (row, on_front) in enumerate(zip(solved, front.tolist(), strict=True), start=1):
        row |= {"rank": rank, "on_front": on_front}
    return ranked


def measure_die(result: Result, faces: int) -> Row:
    """Columns of a finished die that has labels for a number of faces.

    "inradius_mm": smallest inradius of its labeled facets; "margin_deg": smallest angle from the
    normal of a labeled facet to the border of its basin; both None if a label has no facet.
    """
    errors = np.abs(np.subtract(result.printed_probabilities, result.target))
    shown = [facet for facet in result.facets if facet.label is not None]
    if len(shown) != faces:
        shown = []
    return {
        "status": result.status,
        "max_abs_error": float(errors.max()),
        "inradius_mm": min((facet.inradius_mm for facet in shown), default=None),
        "margin_deg": min((facet.border_deg for facet in shown), default=None),
        "asymmetry": result.asymmetry,
        "seconds": sum(stage.seconds for stage in result.stages) if result.stages else None,
        "message": result.message.splitlines()[0],
    }


def _read_parts(result: Result, depth_mm: float | None) -> list[Part]:
    """Parts of the printed die of a result, from its files, with their labels.

    depth_mm: of labels, None without labels.
    """
    plain = read_stl(result.plain_file.read_bytes()).surface
    folder, names = result.plain_file.parent, result.files
    if "die" not in names:
        return [Part(plain.points, plain.triangles, "die", BLANK)]
    solid = read_stl((folder / names["die"]).read_bytes()).surface
    labels = None
    if "die_inlay" in names:
        inlay = read_stl((folder / names["die_inlay"]).read_bytes()).surface
        filling = [Part(inlay.points, inlay.triangles, "labels", INK)]
        return [Part(solid.points, solid.triangles, "die", BLANK), *filling]
    if depth_mm is not None:
        is_flat = result.concave is None
        labels = (
            labels_below_hull(solid, depth_mm)
            if is_flat
            else labels_off_surface(solid, plain, depth_mm)
        )
    return [Part(solid.points, solid.triangles, "die", BLANK, labels)]


def write_sweep(
    folder: Path,
    title: str,
    combinations: Mapping[str, Combination],
    faults: Mapping[str, str],
) -> list[Row]:
    """Write the page and the tables of a sweep; returns the rows of the tables.

    faults: messages of the combinations that cannot be made. Raises OutputError.
    """
    rows, dice = [], {}
    for name, die in combinations.items():
        row: Row = dict.fromkeys(COLUMNS) | {"folder": name, "status": "not made", **die.varied}
        if name in faults:
            row |= {"status": "failed", "message": faults[name]}
        elif (result := made_die(folder / name, die.recipe)) is not None:
            engrave = die.recipe.engrave
            depth_mm = None if engrave is None else engrave.depth_mm
            dice[name] = _read_parts(result, depth_mm), result
            row |= measure_die(result, len(die.recipe.target.target().face_labels))
        rows.append(row)
    ranked = rank_rows(rows)
    keys = list(next(iter(combinations.values())).varied)
    texts = {
        TABLE: _csv_text([*COLUMNS, *keys], ranked),
        PAGE: sweep_page(title, ranked, keys, dice),
    }
    files = {name: text.encode("utf-8") for name, text in texts.items()}
    sums = checksums(files)
    listed = json_text({"name": title, "dice": ranked, "sha256": sums}).encode("utf-8")
    with replace_files(folder, files, sums, LIST, listed):
        pass
    return ranked


def _csv_text(columns: Sequence[str], rows: Sequence[Row]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: guard_cell(value) for key, value in row.items()} for row in rows)
    return text.getvalue()
