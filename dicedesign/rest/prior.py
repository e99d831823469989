"""Priors: distributions of the initial orientation, where not all are equally likely.

Only the direction that is down at first matters, so a prior is a distribution of directions in the
body's frame, on the Gauss sphere.
"""

from __future__ import annotations

import reprlib
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import InputError
from dicedesign.rest.basins import Basins
from dicedesign.rest.border_arcs import Arcs
from dicedesign.rest.tracing import slide, trace_to_rests
from dicedesign.runtime.arrays import Floats, exact_intervals
from dicedesign.runtime.files import read_text
from dicedesign.runtime.registry import Extension, Registry
from dicedesign.tolerances import ROUNDING


@dataclass(frozen=True, eq=False)
class PriorProbabilities:
    """Probabilities of the rests of one body.

    Attributes
    ----------
    probabilities: (k,) summing to 1, in the order of `Basins.paths.rests`.
    errors: (k,) estimated errors.
    """

    probabilities: Floats
    errors: Floats


class Prior(ABC):
    """A distribution of the direction that is down at first, in the body's frame."""

    @abstractmethod
    def probabilities(self, basins: Basins) -> PriorProbabilities:
        """Probabilities of the rests of a body with these basins. Raises InputError where the prior
        is invalid, such as a density that is negative somewhere."""


class DensityPrior(Prior):
    """A prior with a density, whose probabilities are differentiable in the shape of the body."""

    @abstractmethod
    def density(self, directions: Floats) -> Floats:
        """(n,) density per steradian in unit directions (n, 3)."""

    @abstractmethod
    def fluxes(self, arcs: Arcs) -> Floats:
        """(n, 2) flux of the density across great arcs when one end moves at unit speed across the
        arc and the other is fixed: the integral along the arc of the density times a speed that
        falls from 1 at the moving end to 0, as the sine of the distance from the fixed end. The
        first column is for a moving start, the second for a moving end."""


@dataclass(frozen=True, kw_only=True)
class PriorKind(Extension):
    """A kind of prior that recipes and commands know.

    Attributes
    ----------
    form: written form, such as "half:x,y,z".
    read: makes the prior from the text after the name and the first colon; raises ValueError
        without a message where the text is not of the form, or InputError.
    """

    form: str
    read: Callable[[str], Prior]


PRIORS = Registry(
    "prior",
    PriorKind,
    (
        "dicedesign.rest.density_priors:VON_MISES_FISHER",
        "dicedesign.rest.density_priors:HALF",
        "dicedesign.rest.density_priors:CAP",
        "dicedesign.rest.prior:SAMPLES",
    ),
    "dicedesign.priors",
)


def read_prior(text: str) -> Prior:
    """The prior that a text such as "vmf:0,0,-1:5" names, see `PRIORS`.

    Raises
    ------
    InputError: no such prior, or numbers that cannot be used; the message begins with "prior".
    """
    name, _, rest = text.partition(":")
    forms = " or ".join(kind.form for kind in PRIORS)
    if name not in PRIORS:
        raise InputError(f"prior: expected {forms}, got {reprlib.repr(text)}; write one of them")
    kind = PRIORS[name]
    try:
        return kind.read(rest)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(
            f"prior: expected {kind.form}, got {reprlib.repr(text)}; correct it"
        ) from error


def prior_of(given: Prior | str) -> Prior:
    """Prior as given, or as named by a text. Raises InputError for anything else."""
    if isinstance(given, str):
        return read_prior(given)
    if not isinstance(given, Prior):
        raise InputError(
            f"prior: expected a prior or a text that names one, got {given!r}; write one such as "
            '"half:0,0,-1"'
        )
    return given


def axis_of(given: Any) -> Floats:
    """(3,) unit vector along an axis. Raises InputError unless that is three finite numbers, not
    all zero."""
    try:
        return unit_directions([given])[0]
    except InputError as error:
        raise InputError(
            f"prior: expected an axis of three finite numbers, not all zero, got {given!r}; give "
            "the direction that points down, in the body's frame"
        ) from error


CONFIDENCE = 0.95
"""Confidence of the intervals of probabilities from samples."""

AT_ONCE = 1 << 22
"""Products of samples and corners that are held in memory at once."""


@dataclass(frozen=True, eq=False)
class SampledDirections(Prior):
    """Sample of initial directions.

    The probabilities are the shares of directions that end on each rest. The errors reach to the
    farther end of the exact confidence interval, at `CONFIDENCE`, of the sampled distribution's
    probabilities. Both jump as the body changes, so a design cannot use them;
    `VonMisesFisher.fitted` makes a density from the directions.

    Attributes
    ----------
    directions: (n, 3), down in the body's frame, of any length but zero; stored at length 1.

    Raises InputError for no such array.
    """

    directions: ArrayLike

    def __post_init__(self) -> None:
        object.__setattr__(self, "directions", unit_directions(self.directions))

    @classmethod
    def read(cls, path: Path) -> SampledDirections:
        """Samples from a CSV file with three numbers a line, with or without a header.

        Raises InputError where there is no such file, or a line has anything else.
        """
        rows = []
        for number, line in enumerate(read_text(path, "a CSV file of directions").splitlines()):
            row = [_number(cell) for cell in line.split(",")]
            if not line.strip() or (number == 0 and set(row) == {None}):
                continue
            if len(row) != 3 or None in row:
                raise InputError(
                    f"{path}: expected three numbers x,y,z in each line, got {line[:40]!r} in line "
                    f"{number + 1}; correct it"
                )
            rows.append(row)
        try:
            return cls(np.array(rows).reshape(-1, 3))
        except InputError as error:
            raise InputError(f"{path}: {error}") from error

    def probabilities(self, basins: Basins) -> PriorProbabilities:
        """Shares of the directions that end on each rest, by rolling the body from each."""
        directions = np.asarray(self.directions)
        # A balance that no basin depends on must not stop bodies from rolling.
        equilibria = replace(basins.equilibria, tie_distance=0.0)
        count = max(1, AT_ONCE // len(equilibria.radii))
        lowest = [
            (directions[first : first + count] @ equilibria.radii.T).argmax(axis=1)
            for first in range(0, len(directions), count)
        ]
        errors = np.full(len(directions), ROUNDING)
        facets, _ = slide(equilibria, np.concatenate(lowest), directions, errors)
        touched, place = np.unique(facets, return_inverse=True)
        places = np.searchsorted(basins.paths.rests, trace_to_rests(equilibria, touched)[place])
        probabilities = np.bincount(places, minlength=len(basins.paths.rests)) / len(directions)
        intervals = exact_intervals(probabilities * len(directions), len(directions), CONFIDENCE)
        return PriorProbabilities(
            probabilities, np.abs(intervals - probabilities[:, None]).max(axis=1)
        )


def unit_directions(given: ArrayLike) -> Floats:
    """Directions (n, 3), n >= 1, at length 1. Raises InputError for anything else."""
    try:
        directions = np.asarray(given, dtype=np.float64)
    except (ValueError, TypeError):
        directions = np.zeros(0)
    if directions.ndim != 2 or directions.shape[1] != 3 or len(directions) == 0:
        raise InputError(
            f"prior: expected directions as an (n, 3) array of numbers, got shape "
            f"{directions.shape}; give one row of three for each"
        )
    usable = np.isfinite(directions).all(axis=1) & directions.any(axis=1)
    if not usable.all():
        row = int(np.argmin(usable))
        raise InputError(
            f"prior: expected directions of finite numbers, not all zero, got "
            f"{directions[row].tolist()} in row {row}; leave it out"
        )
    # Scaled first, so that no square of a tiny or huge number is taken.
    directions = directions / np.abs(directions).max(axis=1, keepdims=True)
    unit: Floats = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return unit


def _number(cell: str) -> float | None:
    """Number in a cell, or None."""
    try:
        return float(cell)
    except ValueError:
        return None


def _read_samples(text: str) -> SampledDirections:
    if not text:
        raise ValueError
    return SampledDirections.read(Path(text))


SAMPLES = PriorKind(
    name="samples",
    line="the directions of a CSV file, three numbers a line, each as likely as any other",
    form="samples:FILE.csv",
    read=_read_samples,
)
