"""The parts of result.json, as plain data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dicedesign.design.result import DesignResult
from dicedesign.design.targets import Target
from dicedesign.fabricate.verdict import Verdict
from dicedesign.geometry.hulls.polygons import facet_inradius
from dicedesign.geometry.solid import solid_properties
from dicedesign.rest.asymmetry import asymmetry, border_margins
from dicedesign.rest.poses import analyse

if TYPE_CHECKING:
    from dicedesign.fabricate.engraving import EngravedDie

__all__ = ["design_summary", "engraved_notes", "odds_summary", "size_note", "target_summary"]

LARGE_MM: Final = 100.0
"""Beyond this size a die takes long to print, and is hard to throw."""

CHANGED: Final = 0.05
"""Relative change of an outcome's odds by engraving that is told."""


def target_summary(target: Target) -> dict[str, Any]:
    """What was wanted: "target" and "labels"."""
    return {"target": target.probabilities.tolist(), "labels": list(target.labels)}


def odds_summary(verdict: Verdict, target: Target, engraved: EngravedDie | None) -> dict[str, Any]:
    """What the die does: probabilities by label, its error, center of mass and facets. For an
    engraved uniform die also the same odds with the pockets' effect on the center of mass, which
    nobody knows where the center was given: then the density is unknown."""
    hull, poses = verdict.hull, verdict.poses
    label = {
        int(facet): target.labels[outcome]
        for outcome, facet in enumerate(verdict.facet_of_outcome)
        if facet >= 0
    }
    borders = border_margins(poses)
    facets = [
        {
            "label": label.get(int(facet)),
            "normal": poses.normals[i].tolist(),
            "probability": float(poses.probabilities[i]),
            "polygon_area_mm2": float(poses.areas[i]),
            "inradius_mm": facet_inradius(hull, int(facet)),
            "margin_deg": float(np.degrees(poses.margins[i])),
            "border_deg": float(np.degrees(borders[i])),
        }
        for i, facet in enumerate(poses.facets)
    ]
    summary = {
        "probabilities": verdict.probabilities.tolist(),
        "max_abs_error": verdict.max_abs_error,
        "center_of_mass": poses.center_of_mass.tolist(),
        "facets": facets,
        "asymmetry": asymmetry(poses),
        "unstable_facets": len(hull.normals) - len(poses.facets),
    }
    if engraved is not None and verdict.uniform:
        odds = _engraved_odds(verdict, target, engraved)
        summary["engraved_probabilities"] = odds.tolist()
        summary["engraved_max_abs_error"] = float(np.abs(odds - target.probabilities).max())
    return summary


def _engraved_odds(verdict: Verdict, target: Target, engraved: EngravedDie) -> np.ndarray:
    """The pockets leave the hull as it is and move the center of mass."""
    center = solid_properties(engraved.vertices, engraved.triangles)[1]
    poses = analyse(verdict.hull, center)
    outcome = dict(zip(verdict.poses.facets.tolist(), verdict.outcome_of_rest, strict=True))
    odds = np.zeros(len(target.labels))
    for facet, probability in zip(poses.facets.tolist(), poses.probabilities, strict=True):
        if outcome.get(facet, -1) >= 0:
            odds[outcome[facet]] += probability
    return odds


def design_summary(design: DesignResult) -> dict[str, Any]:
    """How the design went: energy terms at the end, what was computed, the history of steps."""
    return {
        "energy": design.terms,
        "starts": design.starts,
        "evaluations": design.evaluations,
        "hulls": {"built": design.hulls_built, "reused": design.hulls_reused},
        "history": [
            {
                "step": step.step,
                "seconds": step.seconds,
                "energy": step.energy,
                "terms": step.terms,
                "max_abs_error": step.error,
            }
            for step in design.history
        ],
    }


def size_note(size_mm: float) -> str:
    """What is said of a size that labels asked for."""
    note = f"size_mm: {size_mm:g}, so that the labels fit"
    if size_mm > LARGE_MM:
        note += "; for a smaller die join rare outcomes, shorten labels or try another seed"
    return note


def engraved_notes(summary: Mapping[str, Any]) -> Iterator[str]:
    """What the pockets of the labels change by more than `CHANGED`, from `odds_summary` and
    `target_summary`."""
    engraved = summary.get("engraved_probabilities", summary["probabilities"])
    rows = zip(summary["labels"], summary["probabilities"], engraved, strict=True)
    changes = [(abs(after - before) / before, label) for label, before, after in rows if before]
    most, label = max(changes, default=(0.0, ""))
    if most > CHANGED:
        yield (
            f"engraving changes the odds of {label} by {most:.0%}; take a smaller depth_mm or a "
            "larger size_mm"
        )
