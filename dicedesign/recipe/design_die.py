"""Design a die in Python."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.errors import EngravingError, InputError
from dicedesign.optimize.targets import Target
from dicedesign.recipe.pipeline import Callbacks, Work, finish, run_stages
from dicedesign.recipe.reading import parse_recipe, parse_target
from dicedesign.recipe.recipe import NAME, Recipe
from dicedesign.recipe.recipe_files import output_names
from dicedesign.results.parts import Status

if TYPE_CHECKING:
    from dicedesign.fabricate.die import Assessment, FinishedDie
    from dicedesign.results.result import Result, Step
    from dicedesign.runtime.arrays import Floats, Integers


class Die:
    """Designed die, and the assessment of its file.

    Lengths are in millimeters, with the center of mass at the origin. Probabilities are without
    momentum, in the order of the labels: `probabilities` describes the plain solid in double
    precision, `file.probabilities` its STL file, and `result.engraved.probabilities` the STL file
    with labels. `result.facets` has the outcome, normal and area of each resting facet.
    """

    def __init__(self, plain: Work) -> None:
        self._plain = plain
        self._work = self._finish(plain.recipe)
        self._finished: FinishedDie | None = None

    def _finish(self, recipe: Recipe) -> Work:
        """Run the stages from the check to the throws with another recipe."""
        work = self._plain.copy()
        work.recipe = recipe
        run_stages(work, after="check", last="throws")
        return work

    def __repr__(self) -> str:
        return f"<Die of {len(self.labels)} outcomes, {self.status}: {self.message}>"

    @property
    def result(self) -> Result:
        """Content of result.json, with printability and tolerances."""
        return self.finished.result

    @property
    def finished(self) -> FinishedDie:
        """Data of the die for figures."""
        from dicedesign.recipe.output import make_finished_die

        if self._finished is None:
            work = self._work.copy()
            run_stages(work, after="throws", last="tolerances")
            self._finished = make_finished_die(work)
        return self._finished

    @property
    def recipe(self) -> Recipe:
        """Recipe of the die, with every default."""
        return self._work.recipe

    def _repr_html_(self) -> str:
        """The die to turn, and its table, in a notebook."""
        return self.result.html_of((self.vertices, self.triangles))

    @property
    def status(self) -> str:
        """ "converged", or the name of another `Status` in small letters."""
        return self._work.status.name.lower()

    @property
    def converged(self) -> bool:
        """Whether the die meets its target to within the tolerance."""
        return self._work.status is Status.CONVERGED

    @property
    def message(self) -> str:
        """Verdict in one sentence, followed by status and remarks."""
        return self._work.message

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the k outcomes."""
        return self._work.target.labels

    @property
    def target(self) -> Floats:
        """(k,) target probabilities, summing to 1."""
        return self._work.target.probabilities

    @property
    def probabilities(self) -> Floats:
        """(k,) probabilities of the outcomes as designed; the rest to 1 is on rests of no
        outcome."""
        return self._work.solid.outcomes.probabilities

    @property
    def max_abs_error(self) -> float:
        """Largest difference of a probability from its target, as designed."""
        return self._work.solid.outcomes.max_abs_error(self.target)

    @property
    def file(self) -> Assessment:
        """Assessment of the file of the plain solid, in single precision."""
        return self._work.plain

    @property
    def history(self) -> tuple[Step, ...]:
        """Accepted steps of the design, beginning with the start."""
        return self._work.die.steps

    @property
    def is_engraved(self) -> bool:
        """Whether the die has its labels."""
        return self.recipe.engrave is not None and self._work.engraved is not None

    @property
    def vertices(self) -> Floats:
        """(n, 3) vertices of the solid, with labels and rounded edges if it has them."""
        return self._work.finished.points

    @property
    def triangles(self) -> Integers:
        """(m, 3) triangles between the vertices, counter-clockwise seen from outside."""
        return self._work.finished.triangles

    def engrave(self, **options: Any) -> Die:
        """Cut or replace the labels, keeping rounded edges, and return the die.

        options: `depth_mm`, `font`, `content` and so on, as in a recipe's `engrave`.

        Raises InputError for invalid options, and EngravingError if a label does not fit.
        """
        work = self._finish(parse_recipe({**self.recipe.as_dict(), "engrave": options or True}))
        if work.engraved is None:
            raise EngravingError(work.remarks[-1])
        self._work, self._finished = work, None
        return self

    def save(self, path: Path | str) -> None:
        """Write the solid to a file in the format of its ending, one of `FILE_FORMATS`: .stl, .3mf,
        .obj or .glb.

        Raises InputError for another ending, and OutputError if the file cannot be written.
        """
        from dicedesign.fabricate.file_formats import save_contents
        from dicedesign.recipe.output import die_contents

        save_contents(Path(path), die_contents(self._work))

    def report(self, folder: Path | str) -> Result:
        """Write the files of `run`: solids, result.json, recipe, figures and report.html.

        folder: made if missing; names the die. Raises InputError if it has other files of these
        names, and OutputError if it cannot be written.
        """
        from dicedesign.results.folder import open_results_folder

        work, folder = self._work.copy(), Path(folder)
        work.folder = folder
        if re.fullmatch(NAME, folder.name):
            work.recipe = self.recipe.model_copy(update={"name": folder.name})
        with open_results_folder(folder, output_names(work.recipe, folder)):
            run_stages(work, after="throws")
            return finish(work)


def design(
    target: str | Target | Mapping[str, Any] | Sequence[float | str],
    *,
    labels: Sequence[str] | None = None,
    start: str | Mapping[str, Any] | None = None,
    method: str | Mapping[str, Any] | None = None,
    faces: int | str | None = None,
    purpose: str = "both",
    candidates: int = 1,
    pick: int = 1,
    table: str | None = None,
    center_of_mass: Sequence[float] | None = None,
    prior: str | None = None,
    symmetry: str | None = None,
    numbering: str = "auto",
    seed: int = 0,
    size_mm: float = 30.0,
    engrave: bool | Mapping[str, Any] | None = None,
    edges: bool | Mapping[str, Any] | None = None,
    printing: bool | str | Mapping[str, Any] | None = None,
    on_step: Callable[[Step], None] | None = None,
) -> Die:
    """Design a die, without writing files.

    Parameters
    ----------
    target: dice such as "d7" or "2d6"; probabilities above 0 that sum to 1, numbers or fractions
        such as "1/36"; a mapping such as `{"binomial": 4}` or `{"fair": 7}`; or a `Target`.
    labels: labels of at most 24 characters, one for each probability; by default those of the
        target. Faces with the same label are one outcome.
    start: starting shape of a recipe, a name or a mapping such as `{"prism": {"sides": 5}}`;
        by default dice with different numbers of faces are compared.
    method: "exact", the default, "paper" or "concave", or a mapping with its options such as
        `{"exact": {"prefer": {"margin": 1.0}}}`.
    faces: "auto", "one" for one face an outcome, or an even number, as in a recipe; by default
        "auto" unless another argument rules it out.
    purpose: "both", right set down and thrown; "setting-down" or "throwing" for one of these.
    candidates: number of dice to compare, 1 to 12; `result.candidates` describes them. pick: number
        of the one to make, 1 for the best.
    table: name or file of the table that the die is thrown onto, instead of a method; by default
        "board-game".
    center_of_mass: (3,) in the start's own coordinates; by default that of the uniform solid.
    prior: distribution of the direction that points down at release, a recipe's `prior`, such as
        "half:0,0,-1"; by default uniform.
    symmetry: point group of the die, such as "C2" or "D3h"; "auto", the default without a start,
        for the most handsome of many shapes; or "none".
    numbering: assignment of equally probable outcomes with numbers as labels: "given", "standard"
        for opposite facets with a constant sum, "balanced" for even sums around corners too, or
        "auto", see `Recipe`.
    seed: random seed, at least 0.
    size_mm: largest distance between two corners, above 0 and at most 1000.
    engrave: whether to cut the labels, or options for that; by default not.
    edges: whether to round the edges, or options for that; by default not.
    printing: printer, a recipe's `print`: "fdm", "sla", "sls", or a mapping such as
        `{"printer": "sla", "infill": 0.2}`; by default "fdm".
    on_step: called after every accepted step.

    Raises
    ------
    InputError: an argument is invalid, the start does not suit the target, or a label does not fit
        a die that converged. A die that did not converge is returned, see `Die.status`.
    NoStartError: the start has rests that are no outcome, or lacks one; or a search finds no shape
        with one rest for each outcome and no other. Not with the methods "paper" and "concave".
    """
    if method is not None and table is not None:
        raise InputError(
            'table: expected no method with it, got both; write method={"exact": {"table": ...}}'
        )
    given: dict[str, Any] = {
        "name": "die",
        "target": _make_target_entries(target, labels),
        "start": {start: {}} if isinstance(start, str) else start,
        "method": method if table is None else {"exact": {"table": table}},
        "faces": faces,
        "purpose": purpose,
        "candidates": candidates,
        "pick": pick,
        "center_of_mass": None if center_of_mass is None else [float(x) for x in center_of_mass],
        "prior": prior,
        "symmetry": symmetry,
        "numbering": numbering,
        "seed": seed,
        "size_mm": size_mm,
        "engrave": False if engrave is None else engrave,
        "edges": edges,
        "print": printing,
    }
    entries = {key: entry for key, entry in given.items() if entry is not None}
    callbacks = None if on_step is None else Callbacks(on_step=on_step)
    return Die(design_recipe(parse_recipe(entries), callbacks, last="check"))


def design_recipe(recipe: Recipe, callbacks: Callbacks | None = None, last: str = "throws") -> Work:
    """Run a recipe up to and including a stage, without writing files. Raises as `design`."""
    work = Work(recipe, None, callbacks or Callbacks())
    run_stages(work, last=last)
    return work


def _make_target_entries(
    target: str | Target | Mapping[str, Any] | Sequence[float | str], labels: Sequence[str] | None
) -> dict[str, Any]:
    """Entries of a recipe's `target`."""
    if isinstance(target, Target):
        entries: dict[str, Any] = {
            "probabilities": target.face_probabilities.tolist(),
            "labels": list(target.face_labels),
            "share": "equal" if target.keeps_shares else "free",
        }
    elif isinstance(target, Mapping):
        entries = dict(target)
    elif isinstance(target, str):
        entries = parse_target(target)
    else:
        entries = {"probabilities": [p if isinstance(p, str) else float(p) for p in target]}
    if labels is not None:
        entries["labels"] = [str(label) for label in labels]
    return entries
