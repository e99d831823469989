"""Stages printing, tolerances, files, figures and report."""

from __future__ import annotations

import hashlib
import json
import tempfile
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from dicedesign.errors import InputError
from dicedesign.fabricate.die import MARKED_PROBABILITY, FinishedDie
from dicedesign.fabricate.file_formats import (
    FILE_FORMATS,
    Contents,
    Part,
    file_bytes,
)
from dicedesign.fabricate.infill import infill_probabilities, inside_walls, pocket_walls
from dicedesign.fabricate.print_copies import PrintedCopies, print_tolerances
from dicedesign.fabricate.printability import PrintedSolid, printability
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import body_of
from dicedesign.geometry.meshes.reading import read_stl, stl_bytes
from dicedesign.geometry.triangles import Surface, join_surfaces
from dicedesign.palette import BLANK, INK
from dicedesign.recipe.pipeline import Work
from dicedesign.recipe.reading import recipe_text
from dicedesign.report.figures import FIGURES, figure_files
from dicedesign.report.raster import upward_of
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import analyze, rest_poses
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.momentum_model import momentum_model


def prepare_print(work: Work) -> None:
    """Check printability, and make die_oriented.stl if the recipe has `oriented`."""
    options, engraving, engraved = work.recipe.print, work.recipe.engrave, work.engraved
    assert options is not None
    plain, body, poses, solid = work.plain, work.plain.body, work.plain.poses, work.finished
    if engraved is not None:
        body = read_stl(work.files["die.stl"])
        # A given center of mass holds for the rounded body too.
        given = work.solid.center_of_mass
        poses = (
            rest_poses(body, given) if engraved.assessment is None else engraved.assessment.poses
        )
    labels = tuple(placement.text for placement in solid.placements)
    normals = np.array([placement.frame[:3, 2] for placement in solid.placements]).reshape(-1, 3)
    designed = shape = None
    if work.die.reshaped is None:
        designed = convex_hull(work.solid.hull_points)
    else:
        if engraved is not None:
            # Marks are on top.
            shown = plain.shown_faces(MARKED_PROBABILITY)
            labels = tuple(work.target.face_labels[face] for face in shown)
            normals = -plain.poses.normals[plain.outcomes.main[shown]]
        if work.solid.is_printable:
            shape = plain.body.surface
    surface = body.surface
    hull = None if designed is None else poses.hull
    work.printability = printability(
        PrintedSolid(surface.points, surface.triangles, hull, labels, normals),
        rests=poses,
        designed=designed,
        shape=shape,
        placements=solid.placements,
        options=options,
        engraving=engraving,
        filling_mm3=0.0 if solid.inlay is None else solid.inlay.volume,
    )
    work.notes += work.printability.warnings
    if options.oriented:
        placement = np.array(work.printability.placement)
        points = surface.points @ placement[:3, :3].T + placement[:3, 3]
        work.files["die_oriented.stl"] = stl_bytes(surface.with_points(points))


def find_tolerances(work: Work) -> None:
    """Compute how printing errors, and infill below 100 %, change the probabilities."""
    verdict, target, options = work.final, work.target.probabilities, work.recipe.print
    table, is_flat = work.recipe.method.table, work.die.reshaped is None
    assert options is not None
    assert work.printability is not None
    body, poses, core = verdict.body, verdict.poses, work.finished.core
    if work.recipe.edges is not None and core is not None:
        # Rounded edges move with the facets beside them, so the core stands for the die, with the
        # center of mass of the finished die.
        body = body_of(core.surface)
        poses = analyze(core, poses.center_of_mass, poses.center_of_mass_source)
        poses = poses.under(work.die.prior)
    errors = options.expected_errors
    copies = PrintedCopies.of(
        body,
        poses,
        work.die.directions,
        # Axes of the printer, for the best orientation.
        np.array(work.printability.placement)[:3, :3],
        errors.correlation_mm,
        is_flat=is_flat,
        outcome_of=work.die.outcome_of,
        within=work.die.within,
        mixture=None if table is None else momentum_model(table),
    )
    # Thrown probabilities of an exact print are known from counts only.
    expected = verdict.outcomes.probabilities if table is None else target
    work.tolerances = print_tolerances(copies, target, expected, errors, options.selected_printer)
    if not is_flat:
        off, within = work.tolerances.total_variation, work.recipe.method.options.prints_within
        if off > within:
            work.fail(Status.FRAGILE)
            work.remarks.append(f"prints are off by {off:.2g}, wanted are at most {within:g}")
    if options.infill == 1.0:
        return
    engrave, marked = work.recipe.engrave, None if verdict is work.plain else work.engraved
    unknown = None
    if work.die.reshaped is not None:
        unknown = "by the concave method"
    elif work.solid.center_of_mass is not None:
        unknown = "whose center of mass is given"
    elif marked is not None and engrave is not None and engrave.balance == "opposite":
        unknown = "whose hidden hollow has walls of its own"
    if unknown is not None:
        work.notes.append(
            f"the effect of infill on a die {unknown} is not computed: its probabilities are for "
            "100 % infill"
        )
        return
    hull, pockets = verdict.poses.hull, []
    if marked is not None and engrave is not None:
        # It imports manifold3d.
        from dicedesign.fabricate.engraving import cut_sections

        # Stretched labels may overlap their borders more.
        cut = cut_sections(hull, marked.placements, engrave, joined=1.0)
        pockets = pocket_walls(cut, engrave.depth_mm, options.walls_mm)
    work.infill = infill_probabilities(
        verdict,
        work.die.directions,
        verdict.body.surface.volume,
        inside_walls(hull, options.walls_mm, pockets),
        options.infill,
        options.walls_mm,
    )
    work.notes.append(work.infill.advice)


def write_files(work: Work) -> None:
    """Make the die's files in other formats, and read each back. A file with other probabilities,
    or a format that cannot hold the die, is skipped, and the die fails."""
    contents = die_contents(work)
    probabilities = _compute_probabilities(work, join_surfaces(*contents.parts))
    for kind in (FILE_FORMATS[name] for name in work.recipe.files if name != "stl"):
        name = f"{work.stem}.{kind.name}"
        try:
            data = file_bytes(contents, kind, name)
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder, name)
                path.write_bytes(data)
                changes = (
                    _compute_probabilities(work, Surface(*kind.read_back(path))) - probabilities
                )
            off = float(np.abs(changes).max())
            if not off <= kind.same_probabilities:
                raise InputError(
                    f"{name}: expected the probabilities of the die to within "
                    f"{kind.same_probabilities:g} as it is read back, got a difference of "
                    f"{off:.2g}; take another format"
                )
            work.files[name] = data
        except InputError as error:
            work.fail(Status.FILE_LEFT_OUT)
            work.remarks.append(str(error))


def die_contents(work: Work) -> Contents:
    """Solids and metadata of the finished die."""
    verdict = work.plain if work.engraved is None else work.engraved.assessment
    labels, target = work.target.labels, work.target.probabilities
    stl = f"{work.stem}.stl"
    facts = {
        "Application": f"dicedesign {version('dicedesign')}",
        "Description": f"A die of {len(labels)} outcomes. {work.status.value.capitalize()}.",
        "Target": json.dumps(dict(zip(labels, target.tolist(), strict=True))),
        "Recipe": recipe_text(work.recipe),
        "Checksum": f"sha256 of {stl}: {hashlib.sha256(work.files[stl]).hexdigest()}",
    }
    if verdict is not None:
        probabilities = verdict.outcomes.probabilities.tolist()
        facts["Probabilities"] = json.dumps(dict(zip(labels, probabilities, strict=True)))
    solid, options = work.finished, work.recipe.engrave
    parts = [Part(solid.points, solid.triangles, "die", BLANK)]
    if solid.inlay is not None:
        parts.append(Part(solid.inlay.points, solid.inlay.triangles, "labels", INK))
    elif work.engraved is not None and options is not None:
        # It imports manifold3d.
        from dicedesign.fabricate.engraving import labels_below_hull

        marks = solid.marks
        labeled = labels_below_hull(solid, options.depth_mm) if marks is None else marks
        parts = [replace(parts[0], labels=labeled)]
    return Contents(work.recipe.name, parts, facts)


def _compute_probabilities(work: Work, solid: Surface) -> Floats:
    """(k,) probabilities of the outcomes of a solid in the die's coordinates."""
    poses = rest_poses(solid, work.solid.center_of_mass)
    die = work.die
    outcomes = outcome_probabilities(poses, die.directions, die.outcome_of, die.within)
    return outcomes.probabilities


def draw_figures(work: Work) -> None:
    """Draw the figures that apply to the die."""
    work.images = figure_files(make_finished_die(work), work.callbacks.on_part)
    work.files |= {f"{name}{FIGURES[name].suffix}": data for name, data in work.images.items()}


def write_page(work: Work) -> None:
    """Make report.html from the result, the finished die and the figures."""
    from dicedesign.report.pages import die_page

    page = die_page(make_finished_die(work), work.images, die_contents(work).parts)
    work.files["report.html"] = page.encode("utf-8")


def make_finished_die(work: Work) -> FinishedDie:
    """Data of the finished die for figures."""
    mesh = work.recipe.start.mesh
    return FinishedDie(
        result=work.result(),
        plain=work.plain,
        engraved=work.engraved,
        tolerance=work.recipe.method.tolerance,
        upward=upward_of(mesh and mesh.path),
        reshaped=work.die.reshaped,
        quality=work.quality,
        repaired=work.repaired,
        thrown=work.thrown,
        reading=work.reading,
        candidates=tuple(design.hull for _, design in work.candidate_designs),
    )
