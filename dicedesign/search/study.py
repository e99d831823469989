"""Optuna study of a search in a folder, and the numbers that the search varies."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.errors import DiceError, InputError, OutputError, missing_extra
from dicedesign.recipe.reading import parse_recipe, read_recipe, recipe_text
from dicedesign.recipe.recipe import Recipe
from dicedesign.runtime.files import (
    atomic_write,
    lock_folder,
    make_writable_folder,
    remove_partial_files,
)

if TYPE_CHECKING:
    import optuna


WEIGHTS = (1e-5, 10.0)
"""Range of proposed weights of preferences, uniform in the logarithm."""

OFF_BELOW = 0.01
"""Proposed weights below this become 0, unless they are the recipe's own, so that half of the range
leaves a preference out."""


@dataclass(frozen=True)
class Range:
    """Range of a number that a search varies.

    Attributes
    ----------
    low, high: least and largest proposed value.
    logarithmic: proposals are uniform in the logarithm.
    own: value that leaves the recipe unchanged.
    """

    low: float
    high: float
    logarithmic: bool
    own: float


def varies_assignment(recipe: Recipe) -> bool:
    """Whether a search varies the assignment of labels: with a given start and outcomes of
    different probabilities, but not with a symmetry, which allows few assignments."""
    probabilities = recipe.target.target().face_probabilities
    given = recipe.start.kind.search is None and recipe.symmetry is None
    return given and bool(np.ptp(probabilities) > 0.0)


def search_space(recipe: Recipe) -> dict[str, Range]:
    """Numbers that a search of a recipe varies, by name.

    "assignment.LABEL", or "assignment.LABEL 2" and so on for its further faces: labels are assigned
    to the start's directions in the order of these numbers, if `varies_assignment`. "prefer.NAME":
    weights of preferences of the exact method. Each trial also has its own seed.
    """
    space: dict[str, Range] = {}
    if varies_assignment(recipe):
        order = _assigned_labels(recipe)
        space |= {
            name: Range(0.0, 1.0, False, (place + 0.5) / len(order))
            for place, name in enumerate(order)
        }
    for name, weight in _own_weights(recipe).items():
        low, high = WEIGHTS
        own = max(weight, low)
        space[f"prefer.{name}"] = Range(low, max(high, own), True, own)
    return space


def _assigned_labels(recipe: Recipe) -> dict[str, str]:
    """Label of each number of an assignment, by name."""
    names: dict[str, str] = {}
    for label in recipe.assignment or recipe.target.target().face_labels:
        number = 1 + sum(other == label for other in names.values())
        names[f"assignment.{label}" if number == 1 else f"assignment.{label} {number}"] = label
    return names


def vary_recipe(recipe: Recipe, place: int, values: Mapping[str, float]) -> Recipe:
    """Recipe of a trial, with its place in the search added to the seed, and given values of
    `search_space`. With place 0 and `Range.own` for all, it is the original recipe."""
    entries, space = recipe.as_dict(), search_space(recipe)
    if place > 0 and recipe.is_chosen_by_looks:
        # Trials are the many shapes.
        entries["symmetry"] = "none"
    entries["seed"] += place
    order = sorted(values, key=values.__getitem__)
    assigned = _assigned_labels(recipe)
    labels = [assigned[name] for name in order if name in assigned]
    if labels:
        entries["assignment"] = labels
    for name in _own_weights(recipe):
        weight = values[f"prefer.{name}"]
        if weight != space[f"prefer.{name}"].own:
            entries["method"]["exact"]["prefer"][name] = weight if weight >= OFF_BELOW else 0.0
    return parse_recipe(entries)


def _own_weights(recipe: Recipe) -> dict[str, float]:
    exact = recipe.method.exact
    return {} if exact is None else exact.prefer.as_dict()


RECIPE = "search.yaml"
"""File of the original recipe, with every default."""

JOURNAL = "trials.journal"
"""File of Optuna's log."""

PLACE = "place"
"""Attribute of Optuna's trials: number in the search, which a retry shares with the unfinished
trial."""

GIVEN_UP = "given_up"
"""Attribute of an abandoned trial, which is not retried."""


class SearchStudy:
    """Proposed trials and their results, saved in a folder.

    A trial with a result is COMPLETE in Optuna. If its design missed the tolerance, it has a
    constraint above 0 that grows with its error, so that the sampler avoids its neighborhood. The
    objectives, inradius and margin, are maximized.
    """

    def __init__(self, study: optuna.Study, recipe: Recipe) -> None:
        self._study = study
        self._recipe = recipe
        self._space = search_space(recipe)
        self._proposed: dict[int, optuna.Trial] = {}

    def finished(self) -> list[dict[str, Any]]:
        """Trials with a result, in order: "number", "recipe" as plain data, and the output of
        `run_trial`."""
        finished = [
            {
                "number": trial.user_attrs[PLACE],
                "recipe": trial.user_attrs["recipe"],
                **trial.user_attrs["result"],
            }
            for trial in self._study.get_trials(deepcopy=False)
            if trial.state.name == "COMPLETE"
        ]
        return sorted(finished, key=lambda trial: trial["number"])

    def propose(self) -> tuple[int, dict[str, Any]]:
        """Number, from 0, and recipe of the next trial.

        The first is the original recipe. Unfinished trials are proposed again, unchanged. Other
        proposals depend on the recipe, the number, and the finished and running trials, but not on
        interrupts.
        """
        from optuna.distributions import FloatDistribution
        from optuna.samplers import TPESampler

        trials = self._study.get_trials(deepcopy=False)
        # The first number without a trial, except for unfinished ones.
        taken = {
            trial.user_attrs.get(PLACE)
            for trial in trials
            if trial.state.name != "FAIL" or GIVEN_UP in trial.user_attrs
        }
        number = next(number for number in count() if number not in taken)
        # Without a known recipe, the sampler proposes one again.
        known = [
            trial.params
            for trial in trials
            if trial.user_attrs.get(PLACE) == number and "recipe" in trial.user_attrs
        ]
        if number == 0:
            known.append({name: entry.own for name, entry in self._space.items()})
        if known:
            self._study.enqueue_trial(known[0])
        # Each trial has its own seed, as a new sampler of a resumed search would repeat itself.
        seed = np.random.SeedSequence([self._recipe.seed, number]).generate_state(1)[0]
        self._study.sampler = TPESampler(seed=int(seed))
        trial = self._study.ask(
            {
                name: FloatDistribution(entry.low, entry.high, log=entry.logarithmic)
                for name, entry in self._space.items()
            }
        )
        entries = vary_recipe(self._recipe, number, trial.params).as_dict()
        trial.set_user_attr(PLACE, number)
        trial.set_user_attr("recipe", entries)
        self._proposed[number] = trial
        return number, entries

    def tell(self, number: int, result: Mapping[str, Any]) -> None:
        """Record the result of a proposed trial."""
        trial = self._proposed.pop(number)
        trial.set_user_attr("result", dict(result))
        violation = 0.0
        if result["status"] != "converged":
            error = 1.0 if result["max_abs_error"] is None else result["max_abs_error"]
            violation = max(error, float(np.finfo(np.float64).tiny))
        trial.set_constraint("error", violation)
        self._study.tell(trial, [result["inradius_mm"] or 0.0, result["margin_deg"] or 0.0])

    def abandon(self, number: int) -> None:
        """Record that a proposed trial has no result and is not retried."""
        from optuna.trial import TrialState

        trial = self._proposed.pop(number)
        trial.set_user_attr(GIVEN_UP, True)
        self._study.tell(trial, state=TrialState.FAIL)


@contextmanager
def open_study(folder: Path, recipe: Recipe) -> Iterator[SearchStudy]:
    """Open the study of a folder, or create it.

    Trials that an earlier search left running are marked as failed, and will be retried.

    Raises
    ------
    InputError: Optuna is not installed, the folder belongs to another recipe, its journal cannot be
        read, or another search uses it.
    OutputError: the folder cannot be written, also by the study's `propose` and `tell`.
    """
    try:
        import optuna
    except ImportError as error:
        raise missing_extra("search", "search", error) from error
    make_writable_folder(folder)
    with lock_folder(folder):
        remove_partial_files(folder)
        _check_recipe(folder, recipe)
        level = optuna.logging.get_verbosity()
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
                study = _load(optuna, folder / JOURNAL)
                # Trials that were running, or enqueued.
                for trial in study.get_trials(deepcopy=False):
                    if trial.state.name == "RUNNING":
                        study.tell(trial.number, state=optuna.trial.TrialState.FAIL)
                    elif trial.state.name == "WAITING":
                        study.tell(study.ask(), state=optuna.trial.TrialState.FAIL)
                yield SearchStudy(study, recipe)
        finally:
            optuna.logging.set_verbosity(level)


class _Journal:
    """Journal file of Optuna that raises errors of this package."""

    def __init__(self, optuna: Any, path: Path) -> None:
        backend = optuna.storages.journal.JournalFileBackend
        # The folder is locked; Optuna's own lock would outlive a killed process.
        self._backend = backend(str(path), threading.Lock())
        self._path = path

    def read_logs(self, log_number_from: int) -> Iterator[dict[str, Any]]:
        try:
            yield from self._backend.read_logs(log_number_from)
        except OSError as error:
            raise _no_journal(self._path, error.strerror) from error

    def append_logs(self, logs: Sequence[dict[str, Any]]) -> None:
        try:
            self._backend.append_logs(logs)
        except OSError as error:
            raise OutputError(
                f"{self._path}: expected a file that can be written, got {error.strerror!r}; make "
                "room or permit writing, and repeat the command to resume"
            ) from error


def _no_journal(path: Path, fault: object) -> InputError:
    return InputError(
        f"{path}: expected the journal of a search, but {fault}; choose another folder with --out"
    )


def _load(optuna: Any, journal: Path) -> optuna.Study:
    """Load the study of a journal, or create it."""
    try:
        # Remove the incomplete last line of a killed process.
        with journal.open("ab+") as file:
            file.seek(0)
            file.truncate(file.read().rfind(b"\n") + 1)
        return optuna.create_study(
            storage=optuna.storages.JournalStorage(_Journal(optuna, journal)),
            study_name="search",
            directions=["maximize", "maximize"],
            load_if_exists=True,
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError, AssertionError) as error:
        if isinstance(error, DiceError):
            raise
        raise _no_journal(journal, getattr(error, "strerror", None) or error) from error


def _check_recipe(folder: Path, recipe: Recipe) -> None:
    path = folder / RECIPE
    if not os.path.exists(path):
        if os.path.exists(folder / JOURNAL):
            raise InputError(
                f"{folder}: expected {RECIPE} beside {JOURNAL}, got none; choose another folder "
                "with --out"
            )
        atomic_write(path, recipe_text(recipe).encode("utf-8"))
        return
    earlier, wanted = read_recipe(path).as_dict(), recipe.as_dict()
    if earlier != wanted:
        key = next(key for key in wanted if earlier.get(key) != wanted[key])
        raise InputError(
            f"{folder}: expected a search of this recipe, got one of another, whose {key} is "
            f"{earlier.get(key)!r} instead of {wanted[key]!r}; choose another folder with --out"
        )
