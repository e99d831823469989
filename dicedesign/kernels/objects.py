"""What goes to kernels and comes from them that is no array."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from dicedesign.runtime.arrays import Floats, Integers


class Handled:
    """Base of a hull, of its separatrices and of a momentum model: what kernels take by a `handle`,
    which borrows its arrays, is made at first use by a kernel and is left out of pickles."""

    handle: Any

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "handle"}


class Tie(Exception):
    """The body balances: a hair's move of the center of mass would change what it does."""


class Bodies(Protocol):
    """Bodies that were put to rest together."""

    def rests(self) -> tuple[Integers, Integers, Floats, Floats]:
        """How many rests each has (b,), 0 where rounding leaves anything open; then, the most
        probable first, their facets (b, k), normals (b, k, 3) and odds (b, k), 0 in rows that one
        has too many."""

    def pull_back(
        self, which: Integers, by_normals: Floats, by_odds: Floats, points: int, threads: int
    ) -> tuple[Floats, Floats, Integers]:
        """For gradients (r, k, 3) and (r, k) in normals and odds of bodies (r,) those in their
        points (r, points, 3) and in given centers (r, 3); and (r,) 0 where these are left open."""


class Energies(Protocol):
    """Terms of the energy of eq. 16: dice, coplanar, barycenter, neighbor."""

    def values(self) -> list[float]:
        """The four, 0 where they are not wanted."""

    def gradient(self, slopes: Sequence[float]) -> tuple[Floats, Floats]:
        """That of the sum of terms times slopes (4,): (n, 3) and (3,)."""
