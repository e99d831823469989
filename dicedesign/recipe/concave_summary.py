"""The parts of a concave die's result.json, as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from dicedesign.concave.result import ConcaveDie
from dicedesign.design.targets import Target
from dicedesign.geometry.sphere import norms
from dicedesign.recipe.concave_judging import JudgedSurface
from dicedesign.rest.outcomes import ClusterOdds

__all__ = ["engraved_summary", "search_summary", "surface_summary"]


def surface_summary(judged: JudgedSurface, die: ConcaveDie, target: Target) -> dict[str, Any]:
    """What the die does, by its file, and how far it is from the surface that it was made from."""
    outcomes, poses, before = judged.outcomes, judged.poses, judged.before
    moved = norms(die.after.points - die.before.points) / die.before.diagonal
    return {
        "probabilities_before": before.odds.tolist(),
        "elsewhere_before": before.elsewhere,
        "probabilities": outcomes.odds.tolist(),
        "elsewhere": outcomes.elsewhere,
        "rest_counts": outcomes.rest_counts.tolist(),
        "max_abs_error": outcomes.max_abs_error(target.probabilities),
        "center_of_mass": poses.center_of_mass.tolist(),
        "facets": _facets(judged, target.labels),
        "unstable_facets": len(poses.hull.normals) - len(poses.facets),
        "displacement": {"mean": float(moved.mean()), "largest": float(moved.max())},
        "hull": {
            "vertices_before": die.hull_corners[0],
            "vertices_after": die.hull_corners[1],
            "gap": judged.gap,
        },
        "surface": {
            "vertices": len(judged.surface.points),
            "triangles": len(judged.surface.triangles),
        },
        "quality": _quality(judged),
        "surface_quality": judged.quality.data(),
        "file_self_intersections": judged.intersections,
    }


def engraved_summary(outcomes: ClusterOdds, target: Target) -> dict[str, Any]:
    """The odds of the die with its marks cut in, by its file."""
    return {
        "engraved_probabilities": outcomes.odds.tolist(),
        "engraved_elsewhere": outcomes.elsewhere,
        "engraved_max_abs_error": outcomes.max_abs_error(target.probabilities),
    }


def search_summary(die: ConcaveDie) -> dict[str, Any]:
    """How the search went: attempts, seconds over all sessions, the one that the die is of, and its
    steps."""
    progress = die.progress
    return {
        "attempts": progress.attempts,
        "search_seconds": progress.seconds,
        "attempt": None if progress.best is None else progress.best.attempt,
        "history": [asdict(step) for step in progress.history],
    }


def _facets(judged: JudgedSurface, labels: Sequence[str]) -> list[dict[str, Any]]:
    """Each stable facet, the most probable first. The main one of an outcome has its "label"; all
    that count for it have it as "outcome"."""
    poses, outcomes = judged.poses, judged.outcomes
    counted = np.flatnonzero(outcomes.rest_counts).tolist()
    main = {int(outcomes.main[k]): labels[k] for k in counted}
    return [
        {
            "label": main.get(rest),
            "outcome": None if outcome < 0 else labels[outcome],
            "normal": poses.normals[rest].tolist(),
            "probability": float(poses.probabilities[rest]),
            "polygon_area_mm2": float(poses.areas[rest]),
            "margin_deg": float(np.degrees(poses.margins[rest])),
        }
        for rest, outcome in enumerate(outcomes.outcome_of_rest.tolist())
    ]


def _quality(judged: JudgedSurface) -> list[str]:
    """Defects of the deformed surface and of the file, and how far triangles are distorted."""
    found = list(judged.quality.sentences()) or [
        "no triangle meets another, is folded onto its neighbor, turned over or a sliver"
    ]
    count = judged.intersections or "no"
    found.append(f"{count} pairs of triangles of the printable file meet that should not")
    stretched = judged.quality.distortion
    if stretched is not None:
        found.append(
            "95 % of the surface is distorted in shape by a factor of at most "
            f"{stretched.shape_most:.3g}, and in size by {stretched.size_most:.3g}"
        )
    return found
