"""Stage files: the die in the formats that the recipe asks for, each read back."""

from __future__ import annotations

import hashlib
import json
import tempfile
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from dicedesign.errors import InputError
from dicedesign.fabricate.file_formats import (
    BODY_COLOR,
    FILE_FORMATS,
    LABEL_COLOR,
    Contents,
    FileFormat,
    Part,
    file_bytes,
    joined,
)
from dicedesign.fabricate.label_triangles import labels_below_hull, labels_off_surface
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.recipe.reading import recipe_text
from dicedesign.recipe.work import Work
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats, Integers


def write_files(work: Work) -> None:
    """Make the die's files beside the STL, and read each back. One that would not have the odds of
    the die, or whose format cannot hold it, is left out, and the die has not converged."""
    contents = die_contents(work)
    odds = _odds(work, *joined(contents.parts))
    for kind in (FILE_FORMATS[name] for name in work.recipe.files if name != "stl"):
        name = f"{_stem(work)}.{kind.name}"
        try:
            work.files[name] = file_bytes(contents, kind, name)
            _check(work, name, kind, odds)
        except InputError as error:
            work.files.pop(name, None)
            work.fail(Status.FILE_LEFT_OUT)
            work.remarks.append(str(error))


def die_contents(work: Work) -> Contents:
    """The printed die with all that files tell of it."""
    verdict = work.plain if work.engraved is None else work.engraved.assessment
    labels, target = work.target.labels, work.target.probabilities
    stl = f"{_stem(work)}.stl"
    facts = {
        "Application": f"dicedesign {version('dicedesign')}",
        "Description": f"A die of {len(labels)} outcomes. {work.status.value.capitalize()}.",
        "Target": json.dumps(dict(zip(labels, target.tolist(), strict=True))),
        "Recipe": recipe_text(work.recipe),
        "Checksum": f"sha256 of {stl}: {hashlib.sha256(work.files[stl]).hexdigest()}",
    }
    if verdict is not None:
        odds = verdict.outcomes.odds.tolist()
        facts["Odds"] = json.dumps(dict(zip(labels, odds, strict=True)))
    return Contents(work.recipe.name, _parts(work), facts)


def _stem(work: Work) -> str:
    """Name of the files of the printed die, without the ending."""
    return "die_plain" if work.engraved is None else "die"


def _parts(work: Work) -> list[Part]:
    """The bodies of the printed die."""
    solid, engraved, options = work.solid, work.engraved, work.recipe.engrave
    if engraved is None:
        return [Part("die", BODY_COLOR, solid.points, solid.triangles)]
    body = Part("die", BODY_COLOR, engraved.points, engraved.triangles)
    if options is None:
        return [body]
    if engraved.inlay is not None:
        inlay = engraved.inlay
        return [body, Part("labels", LABEL_COLOR, inlay.points, inlay.triangles)]
    marked = Surface(body.points, body.triangles)
    if work.die.reshaped is None:
        labels = labels_below_hull(marked, options.depth_mm)
    else:
        plain = Surface(solid.points, solid.triangles)
        labels = labels_off_surface(marked, plain, options.depth_mm)
    return [replace(body, labels=labels)]


def _odds(work: Work, points: Floats, triangles: Integers) -> Floats:
    """(k,) odds of the outcomes of a solid in the coordinates of the die."""
    poses = rest_poses(make_body(points, triangles), work.solid.center_of_mass)
    return outcome_odds(poses, work.die.directions).odds


def _check(work: Work, name: str, kind: FileFormat, odds: Floats) -> None:
    """Raise InputError unless a file, as it is read back, has the odds (k,) of the die."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, name)
        path.write_bytes(work.files[name])
        found = _odds(work, *kind.read_back(path))
    error = float(np.abs(found - odds).max())
    if not error <= kind.same_odds:
        raise InputError(
            f"{name}: expected the odds of the die to within {kind.same_odds:g} as it is read "
            f"back, got a difference of {error:.2g}; take another format"
        )
