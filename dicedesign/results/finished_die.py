"""The die in the folder that a finished run left."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import PROBABILITY_SUM_TOLERANCE

__all__ = ["FinishedDie", "finished_die"]


@dataclass(frozen=True)
class FinishedDie:
    """What result.json tells of a die.

    Attributes
    ----------
    status: "converged", or why the die does not meet its target.
    labels: of the k outcomes, all different; target: (k,) odds that it should have, positive.
    mesh: file of the die without marks, in mm; center_of_mass: (3,) of its design, there.
    shown: (f,) labels of the facets that show an outcome; normals: (f, 3) of these facets.
    """

    status: str
    labels: tuple[str, ...]
    target: Floats
    mesh: Path
    center_of_mass: Floats
    shown: tuple[str, ...]
    normals: Floats


def finished_die(folder: Path) -> FinishedDie:
    """The die of a folder. Raises InputError: no run left that folder."""
    path = folder / "result.json"
    try:
        result = json.loads(path.read_text(encoding="utf-8"))
        status, labels = str(result["status"]), tuple(map(str, result["labels"]))
        target = _numbers(result["target"], len(labels))
        whole = abs(target.sum() - 1.0) <= PROBABILITY_SUM_TOLERANCE and (target > 0.0).all()
        if not whole or len(set(labels)) < len(labels):
            raise ValueError("labels and target do not fit")
        facets = [
            (str(label), _numbers(facet["normal"], 3))
            for facet in result["facets"]
            # Of a concave die, several facets show one outcome, the main one of which is labelled.
            if (label := facet.get("outcome", facet["label"])) is not None
        ]
        shown = tuple(label for label, _ in facets)
        if not set(shown) <= set(labels):
            raise ValueError("facets have labels that the die has not")
        mesh = folder / result["files"]["die_plain"]
        center = _numbers(result["center_of_mass"], 3)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{path}: expected status, labels, target, facets, files and center of mass of a "
            f"finished die, got {type(error).__name__}: {error}; name a folder that `dicedesign "
            "run` left, or a mesh"
        ) from error
    normals = np.array([normal for _, normal in facets]).reshape(-1, 3)
    return FinishedDie(status, labels, target, mesh, center, shown, normals)


def _numbers(values: Sequence[float], count: int) -> Floats:
    found = np.array([float(value) for value in values])
    if len(found) != count or not np.isfinite(found).all():
        raise ValueError(f"{count} finite numbers came as {values}")
    return found
