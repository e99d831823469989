"""Priors: how likely each orientation is at first, where not all are equally likely.

Of an orientation only the direction counts that is down at first, so that a prior is a distribution
of directions in the body's frame, on the Gauss sphere.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import InputError
from dicedesign.runtime.registry import Extension, Registry

if TYPE_CHECKING:
    from dicedesign.rest.basins import Basins
    from dicedesign.rest.border_arcs import Arcs
    from dicedesign.runtime.arrays import Floats


@dataclass(frozen=True, eq=False)
class PriorOdds:
    """Odds of the rests of one body.

    Attributes
    ----------
    odds: (k,) summing to 1, in the order of `Basins.paths.rests`.
    errors: (k,) by how much each may be off.
    """

    odds: Floats
    errors: Floats


class Prior(ABC):
    """A distribution of the direction that is down at first, in the body's frame."""

    @abstractmethod
    def odds(self, basins: Basins) -> PriorOdds:
        """Odds of the rests of a body with these basins. Raises InputError where the prior is none
        after all, such as a density that is negative somewhere."""


class DensityPrior(Prior):
    """A prior with a density, whose odds are differentiable in the shape of the body."""

    @abstractmethod
    def density(self, directions: Floats) -> Floats:
        """(n,) density per steradian in unit directions (n, 3)."""

    @abstractmethod
    def fluxes(self, arcs: Arcs) -> Floats:
        """(n, 2) what flows over great arcs per unit of speed across, as one end of each moves and
        the other stays: the integral along the arc of the density times a speed that falls from 1
        at the moving end to 0, as the sine of the distance from the end that stays. The first
        column is for a moving start, the second for a moving end."""


@dataclass(frozen=True, kw_only=True)
class PriorKind(Extension):
    """A kind of prior that recipes and commands know.

    Attributes
    ----------
    form: how it is written, such as "half:x,y,z".
    read: makes the prior of what is written after the name and the first colon; it raises
        ValueError, without a text, where that is not of the form, or InputError.
    """

    form: str
    read: Callable[[str], Prior]


PRIORS: Final = Registry(
    "prior",
    PriorKind,
    (
        "dicedesign.rest.axial_priors:VON_MISES_FISHER",
        "dicedesign.rest.axial_priors:HALF",
        "dicedesign.rest.axial_priors:CAP",
        "dicedesign.rest.sampled_directions:SAMPLES",
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
        raise InputError(f"prior: expected {forms}, got {text!r}; write one of them")
    kind = PRIORS[name]
    try:
        return kind.read(rest)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"prior: expected {kind.form}, got {text!r}; correct it") from error


def prior_of(given: Prior | str) -> Prior:
    """A prior, or the one that a text names. Raises InputError for anything else."""
    if isinstance(given, str):
        return read_prior(given)
    if not isinstance(given, Prior):
        raise InputError(
            f"prior: expected a prior or a text that names one, got {given!r}; write one such as "
            '"half:0,0,-1"'
        )
    return given


def axis_of(given: ArrayLike) -> Floats:
    """(3,) a given axis at length 1. Raises InputError unless it is three finite numbers, not all
    zero."""
    try:
        axis = np.asarray(given, dtype=np.float64)
    except (ValueError, TypeError):
        axis = np.zeros(0)
    if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
        raise InputError(
            f"prior: expected an axis of three finite numbers, not all zero, got {given!r}; give "
            "the direction that points down, in the body's frame"
        )
    # Scaled first, so that no square of a tiny or huge number is taken.
    axis = axis / np.abs(axis).max()
    unit: Floats = axis / np.linalg.norm(axis)
    return unit
