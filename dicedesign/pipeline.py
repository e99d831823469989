"""From a recipe to a folder of results: plan the stages it needs, run only those."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dicedesign.design.descent import DescentResult, DescentStep, descend_to_target
from dicedesign.design.starts import Start, hendecahedron, mesh_start, prism, repulsion
from dicedesign.design.stopping import Status
from dicedesign.design.verdict import Verdict, judge
from dicedesign.errors import OutputError
from dicedesign.fabricate.files import atomic_write
from dicedesign.geometry.hull import ConvexHull
from dicedesign.geometry.mesh_file import read_body
from dicedesign.recipe import Recipe
from dicedesign.summary import design_summary, odds_summary, target_summary

if TYPE_CHECKING:
    from dicedesign.fabricate.engrave import EngravedDie
    from dicedesign.fabricate.layout import Placement

__all__ = ["RunResult", "run_recipe"]

Floats = NDArray[np.float64]

RESULT = "result.json"
OWNED = (
    "die.stl",
    "die_plain.stl",
    "recipe.yaml",
    "report.html",
    "bars.png",
    "convergence.png",
    "gauss_map.png",
    "views.png",
    "labels.png",
)
"""Files that a run may write besides `RESULT`; those that it does not write are removed."""


@dataclass(frozen=True)
class RunResult:
    """What a run produced.

    Attributes
    ----------
    status: why the design stopped; converged only if the finished die is within the tolerance.
    message: the same in a sentence.
    folder: where the files are.
    summary: the content of result.json.
    """

    status: str
    message: str
    folder: Path
    summary: dict[str, Any]

    @property
    def converged(self) -> bool:
        """Whether the die meets the recipe's tolerance."""
        return self.status == Status.CONVERGED.name.lower()


@dataclass
class _Clock:
    """Names and seconds of the stages that ran."""

    stages: list[dict[str, Any]] = field(default_factory=list)
    on_stage: Callable[[str], None] | None = None

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        if self.on_stage is not None:
            self.on_stage(name)
        started = time.perf_counter()
        yield
        self.stages.append({"name": name, "seconds": round(time.perf_counter() - started, 4)})


def run_recipe(
    recipe: Recipe,
    folder: Path,
    *,
    on_stage: Callable[[str], None] | None = None,
    on_step: Callable[[DescentStep], None] | None = None,
) -> RunResult:
    """Design, check, engrave and report one die.

    Nothing is written before the die is finished. Each file then appears whole or not at all, and
    result.json last: a folder that has it is complete.

    Parameters
    ----------
    recipe: the checked recipe.
    folder: where to write; made if missing.
    on_stage, on_step: called when a stage begins and after every accepted step.

    Raises
    ------
    InputError: the start does not suit the target, or a label does not fit its facet.
    OutputError: the folder cannot be written.
    """
    _prepare(folder)
    clock = _Clock(on_stage=on_stage)
    target = recipe.target.target()
    with clock.stage("start"):
        start = _start(recipe, len(target.labels))
    order = recipe.outcome_of_direction()
    fixed = None if recipe.center_of_mass is None else np.array(recipe.center_of_mass)
    with clock.stage("design"):
        wanted = target.probabilities[order] if len(order) == len(start.directions) else None
        design = descend_to_target(
            start,
            target.probabilities if wanted is None else wanted,
            recipe.method.descent,
            center_of_mass=fixed,
            seed=recipe.seed,
            on_step=on_step,
        )
    with clock.stage("check"):
        directions = design.directions[np.argsort(order)]
        verdict = judge(design.hull, directions, target, recipe.size_mm, fixed)
        status, message = _outcome(design, verdict, recipe)
    files: dict[str, bytes] = {}
    with clock.stage("export"):
        from dicedesign.fabricate.files import stl_bytes

        files["die_plain.stl"] = stl_bytes(verdict.hull.vertices, verdict.hull.triangles)
    engraved = None
    placements: list[Placement] = []
    if recipe.engrave is not None:
        with clock.stage("engrave"):
            engraved, placements = _engrave(recipe, verdict, target.labels)
            files["die.stl"] = stl_bytes(engraved.vertices, engraved.triangles)
    summary = {
        "name": recipe.name,
        "status": status,
        "message": message,
        **target_summary(target),
        **odds_summary(verdict, target, engraved),
        **design_summary(design),
    }
    with clock.stage("figures"):
        images = _figures(recipe, summary, verdict, engraved, placements)
    files.update({f"{name}.png": data for name, data in images.items()})
    files["recipe.yaml"] = _yaml(recipe.resolved())
    written = [name for name in OWNED if name in files or name == "report.html"]
    summary["files"] = {Path(name).stem: name for name in [*written, RESULT]}
    summary["stages"] = clock.stages
    with clock.stage("report"):
        from dicedesign.show.report import report_html

        files["report.html"] = report_html(summary, images).encode("utf-8")
    _write(folder, files, summary)
    return RunResult(status, message, folder, summary)


def _prepare(folder: Path) -> None:
    probe = folder / ".writable"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OutputError(
            f"{folder}: expected a folder that can be written, but {error.strerror}; choose "
            "another with --out"
        ) from error


def _start(recipe: Recipe, outcomes: int) -> Start:
    choice = recipe.start
    if choice.prism is not None:
        sides = outcomes if choice.prism.sides is None else choice.prism.sides
        return prism(sides, choice.prism.height, choice.prism.cap)
    if choice.hendecahedron is not None:
        return hendecahedron(choice.hendecahedron)
    if choice.mesh is not None:
        return mesh_start(read_body(Path(choice.mesh.path)), outcomes)
    return repulsion(outcomes, recipe.seed)


def _engrave(
    recipe: Recipe, verdict: Verdict, labels: tuple[str, ...]
) -> tuple[EngravedDie, list[Placement]]:
    from dicedesign.fabricate.engrave import engrave
    from dicedesign.fabricate.layout import place_labels

    hull: ConvexHull = verdict.hull
    facets = [int(f) for f in verdict.facet_of_outcome if f >= 0]
    texts = [text for text, f in zip(labels, verdict.facet_of_outcome, strict=True) if f >= 0]
    assert recipe.engrave is not None
    placements = place_labels(
        texts,
        [hull.polygon(f) for f in facets],
        [hull.normals[f] for f in facets],
        facets,
        recipe.engrave,
        recipe.size_mm,
    )
    return engrave(hull.vertices, hull.triangles, placements, recipe.engrave), placements


def _outcome(design: DescentResult, verdict: Verdict, recipe: Recipe) -> tuple[str, str]:
    """Status and message: the design's, unless the finished die says otherwise."""
    tolerance = recipe.method.descent.stopping.tolerance
    missing = int((verdict.facet_of_outcome < 0).sum())
    stray = 1.0 - float(verdict.probabilities.sum())
    status = design.status
    if status is Status.CONVERGED and verdict.max_abs_error > tolerance:
        status = Status.NO_PROGRESS
    remarks = [f"{status.value}; max |p - q| is {verdict.max_abs_error:.3g}"]
    if missing:
        remarks.append(f"{missing} outcomes have no facet to rest on")
    if stray > tolerance:
        remarks.append(f"{stray:.3g} of the probability lies on rests without a label")
    return status.name.lower(), "; ".join(remarks)


def _figures(
    recipe: Recipe,
    summary: dict[str, Any],
    verdict: Verdict,
    engraved: EngravedDie | None,
    placements: list[Placement],
) -> dict[str, bytes]:
    from dicedesign.show.bars import bars_figure
    from dicedesign.show.convergence import convergence_figure
    from dicedesign.show.gauss_map import gauss_map_figure
    from dicedesign.show.png import png_bytes
    from dicedesign.show.views import die_views_figure, facet_views_figure

    labels = summary["labels"]
    tolerance = recipe.method.descent.stopping.tolerance
    written = [facet["label"] or "" for facet in summary["facets"]]
    solid = verdict.hull if engraved is None else engraved
    images = {
        "bars": bars_figure(labels, np.array(summary["target"]), verdict.probabilities),
        "convergence": convergence_figure(summary["history"], tolerance),
        "gauss_map": gauss_map_figure(verdict.poses, written),
        "views": die_views_figure(solid.vertices, solid.triangles),
    }
    if engraved is not None and placements:
        images["labels"] = facet_views_figure(
            engraved.vertices,
            engraved.triangles,
            np.array([placement.frame[:3, 2] for placement in placements]),
            np.array([placement.frame[:3, 1] for placement in placements]),
            [placement.text for placement in placements],
        )
    return {name: png_bytes(figure) for name, figure in images.items()}


def _yaml(plain: dict[str, Any]) -> bytes:
    import yaml

    return yaml.safe_dump(plain, sort_keys=False, allow_unicode=True).encode("utf-8")


def _write(folder: Path, files: dict[str, bytes], summary: dict[str, Any]) -> None:
    try:
        (folder / RESULT).unlink(missing_ok=True)
        for name in OWNED:
            if name not in files:
                (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: old results cannot be removed: {error.strerror}") from error
    for name, data in files.items():
        atomic_write(folder / name, data)
    atomic_write(folder / RESULT, (json.dumps(summary, indent=1) + "\n").encode("utf-8"))
