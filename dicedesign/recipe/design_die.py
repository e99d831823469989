"""From probabilities to a die in Python."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.errors import EngravingError, InputError
from dicedesign.optimize.targets import Target
from dicedesign.recipe.pipeline import Callbacks, Work, finish, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.recipe.recipe import NAME, Recipe
from dicedesign.results.parts import Status

if TYPE_CHECKING:
    from dicedesign.fabricate.die import Assessment, Solid
    from dicedesign.results.result import Result, Step
    from dicedesign.runtime.arrays import Floats, Integers


class Die:
    """A designed die, and what the file does that it makes.

    Lengths are in millimeters, with the center of mass at the origin. Probabilities are those
    without momentum, in the order of the labels: of the solid without its labels in double
    precision here, of the same as a file holds it in `file`, and with the labels cut in in
    `result.engraved`.
    """

    def __init__(self, checked: Work) -> None:
        self._checked = checked
        self._work = self._finished(checked.recipe)
        self._result: Result | None = None

    def _finished(self, recipe: Recipe) -> Work:
        """The work up to the throws, of a recipe that differs in what comes after the check."""
        work = self._checked.copy()
        work.recipe = recipe
        run_stages(work, after="check", last="throws")
        return work

    def __repr__(self) -> str:
        return f"<Die of {len(self.labels)} outcomes, {self.status}: {self.message}>"

    @property
    def result(self) -> Result:
        """All that is known of the die, as in result.json, with what a printer makes of it."""
        if self._result is None:
            work = self._work.copy()
            run_stages(work, after="throws", last="tolerances")
            self._result = work.result()
        return self._result

    @property
    def recipe(self) -> Recipe:
        """What was asked for, with every default."""
        return self._work.recipe

    def _repr_html_(self) -> str:
        """The die to turn, and its table, in a notebook."""
        from dicedesign.report.notebook import result_html

        return result_html(self.result, (self.vertices, self.triangles))

    @property
    def status(self) -> str:
        """ "converged", or in one word why the die does not meet its target."""
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
        """Of the k outcomes."""
        return self._work.target.labels

    @property
    def target(self) -> Floats:
        """(k,) wanted probabilities, summing to 1."""
        return self._work.target.probabilities

    @property
    def probabilities(self) -> Floats:
        """(k,) of the outcomes, as designed; what is missing to 1 lies on rests of no outcome."""
        return self._work.solid.outcomes.probabilities

    @property
    def max_abs_error(self) -> float:
        """Largest difference of a probability from its target, as designed."""
        return self._work.solid.outcomes.max_abs_error(self.target)

    @property
    def file(self) -> Assessment:
        """What the file of the solid without its labels does, in single precision."""
        return self._work.plain

    @property
    def history(self) -> tuple[Step, ...]:
        """Every accepted step of the design, the first being the start."""
        return self._work.die.steps

    @property
    def is_engraved(self) -> bool:
        """Whether the labels are cut in."""
        return self.recipe.engrave is not None and self._work.engraved is not None

    @property
    def vertices(self) -> Floats:
        """(n, 3) corners of the solid, with its labels and rounded edges where it has them."""
        return self._solid.points

    @property
    def triangles(self) -> Integers:
        """(m, 3) triangles between the vertices, counter-clockwise seen from outside."""
        return self._solid.triangles

    @property
    def _solid(self) -> Solid:
        return self._work.engraved or self._work.solid

    def engrave(self, **options: Any) -> Die:
        """Cut the labels in, anew if they were; edges stay rounded. The die itself is returned.

        options: such as `depth_mm`, `font` or `content`, as in a recipe's `engrave`.

        Raises InputError for options that cannot be used, and EngravingError where a label does not
        fit.
        """
        work = self._finished(parse_recipe({**self.recipe.resolved(), "engrave": options or True}))
        if work.engraved is None:
            raise EngravingError(work.remarks[-1])
        self._work, self._result = work, None
        return self

    def save(self, path: Path | str) -> None:
        """Write the solid to a file in the format of its ending, one of `FILE_FORMATS`: .stl, .3mf,
        .obj, .glb, .ply, .off or .step.

        Raises InputError for another ending, or where a library that the format needs is missing,
        and OutputError where the file cannot be written.
        """
        from dicedesign.fabricate.file_formats import save_contents
        from dicedesign.recipe.output import die_contents

        save_contents(Path(path), die_contents(self._work))

    def report(self, folder: Path | str) -> Result:
        """Write what `run` leaves: the solids, result.json, recipe, figures and report.html.

        folder: made if missing; the die is called like it. Raises OutputError where it cannot be
        written.
        """
        from dicedesign.results.folder import open_results_folder

        work, folder = self._work.copy(), Path(folder)
        work.folder = folder
        if re.fullmatch(NAME, folder.name):
            work.recipe = self.recipe.model_copy(update={"name": folder.name})
        with open_results_folder(folder):
            run_stages(work, after="throws")
            return finish(work)


def design(
    target: Target | Mapping[str, Any] | Sequence[float | str],
    *,
    labels: Sequence[str] | None = None,
    start: str | Mapping[str, Any] | None = None,
    method: str | Mapping[str, Any] | None = None,
    center_of_mass: Sequence[float] | None = None,
    prior: str | None = None,
    symmetry: str | None = None,
    numbering: str = "given",
    seed: int = 0,
    size_mm: float = 30.0,
    engrave: bool | Mapping[str, Any] | None = None,
    edges: bool | Mapping[str, Any] | None = None,
    printing: bool | str | Mapping[str, Any] | None = None,
    on_step: Callable[[Step], None] | None = None,
) -> Die:
    """Design a die. Nothing is written.

    Parameters
    ----------
    target: k probabilities above 0 that sum to 1, numbers or fractions such as "1/36"; a mapping
        such as `{"sum_of_dice": [6, 6]}`, `{"binomial": 4}` or `{"fair": 7}`; or a `Target`.
    labels: of the outcomes, at most 24 characters each; the target's own by default.
    start: of the recipe's starting shapes, a name or a mapping such as `{"prism": {"sides": 5}}`;
        by default shapes are searched.
    method: "exact", the default, "paper" or "concave", or a mapping with its options such as
        `{"exact": {"prefer": {"margin": 1.0}}}`.
    center_of_mass: (3,) in the start's own coordinates; by default that of the uniform solid.
    prior: how likely each direction is to be down at first, a recipe's `prior`, such as
        "half:0,0,-1"; by default all alike.
    symmetry: name of a point group that the die shall have, such as "C2" or "D3h".
    numbering: of equally probable outcomes whose labels are numbers: "given", "standard" for
        opposite facets that sum to a constant, or "balanced" for even sums around corners too.
    seed: of everything random, at least 0.
    size_mm: largest distance between two corners, above 0 and at most 1000.
    engrave: whether the labels are cut in, or the options of that; by default not.
    edges: whether edges are rounded, or the options of that; by default not.
    printing: what it is printed with, a recipe's `print`: "fdm", "sla", "sls", or a mapping such as
        `{"printer": "sla", "infill": 0.2}`; by default "fdm".
    on_step: called after every accepted step.

    Raises
    ------
    InputError: something cannot be used, the start does not suit the target, or a label does not
        fit on a die that converged. A die that is not as wanted is returned all the same: see
        `Die.status`.
    NoStartError: no shape has a rest for each outcome, so that there is no die.
    """
    given: dict[str, Any] = {
        "name": "die",
        "target": _target_entries(target, labels),
        "start": {start: {}} if isinstance(start, str) else start,
        "method": method,
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
    """The work of a recipe up to and with a stage; nothing is written. Raises as `design`."""
    work = Work(recipe, None, callbacks or Callbacks())
    run_stages(work, last=last)
    return work


def _target_entries(
    target: Target | Mapping[str, Any] | Sequence[float | str], labels: Sequence[str] | None
) -> dict[str, Any]:
    """The entries of a recipe's `target`."""
    if isinstance(target, Target):
        entries: dict[str, Any] = {
            "probabilities": target.probabilities.tolist(),
            "labels": list(target.labels),
        }
    elif isinstance(target, Mapping):
        entries = dict(target)
    elif isinstance(target, str):
        raise InputError(
            f"target: expected a list of probabilities or a mapping, got {target!r}; write such as "
            '[1/2, 1/3, 1/6], or {"fair": 6}'
        )
    else:
        entries = {"probabilities": [p if isinstance(p, str) else float(p) for p in target]}
    if labels is not None:
        entries["labels"] = [str(label) for label in labels]
    return entries
