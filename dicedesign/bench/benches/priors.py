"""Odds under priors against cubature and complements, and dice that are designed under them."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Amount
from dicedesign.bench.rows import Row, column

if TYPE_CHECKING:
    from dicedesign.rest.poses import RestPoses
    from dicedesign.runtime.arrays import Floats

__all__ = ["DesignRow", "Extent", "OddsRow"]

CONCENTRATIONS: Final = (0.1, 5.0, 100.0, 1e4)

ANGLES: Final = (5.0, 60.0, 90.0, 150.0)
"""Of caps, in degrees."""

CORNERS: Final = 60
"""Of random bodies."""

PRIORS: Final = ("half:0,0,-1", "vmf:0,0,-1:1", "vmf:1,2,3:5", "cap:1,0,0:120")

TARGETS: Final[tuple[dict[str, Any], ...]] = (
    {"fair": 6},
    {"probabilities": [0.5, 0.3, 0.2]},
    {"binomial": 4},
    {"fair": 4},
    {"sum_of_dice": [6, 6]},
)
"""Those of the short bench first."""

CLOSE: Final = 1e-12
"""Difference of odds by two ways that counts as none."""

ENOUGH: Final = 0.75
"""Part of the dice that have to be as wanted."""


@dataclass(frozen=True)
class Extent:
    """How much is measured.

    Attributes
    ----------
    bodies: random ones, for each prior; targets: of the list, from its beginning; seeds: dice for
        each target and prior.
    """

    bodies: int
    targets: int
    seeds: int


@dataclass(frozen=True)
class OddsRow(Row):
    """One prior, about random axes.

    Attributes
    ----------
    off: largest difference of any odds from those by the other way.
    told: largest error that came with the odds.
    multiple: median time over that of the rests without a prior.
    """

    prior: str = column("prior", -22)
    against: str = column("against", -12)
    bodies: int = column("bodies", 7)
    off: float = column("off by", 10, ".1e")
    told: float = column("error told", 12, ".1e")
    multiple: float = column("times rests", 13, ".2f")


@dataclass(frozen=True)
class DesignRow(Row):
    """Dice of several targets under one prior.

    Attributes
    ----------
    good: dice that are as wanted in their files; designed, in_file: the largest error of these;
    seconds: median of all.
    """

    table = "designs"

    prior: str = column("prior", -18)
    dice: int = column("dice", 7)
    good: int = column("as wanted", 11)
    designed: float = column("designed", 10, ".1e")
    in_file: float = column("in file", 10, ".1e")
    seconds: float = column("seconds", 9, ".2f")


def _rows(run: Run) -> Items:
    extent: Extent = run.extent
    is_good = True
    for row in (*_axial(run), *_caps(run)):
        is_good &= row.off <= CLOSE
        yield row
    dice = good = 0
    for prior in PRIORS:
        run.begin(prior)
        designs = _designs(prior, extent, run)
        dice, good = dice + designs.dice, good + designs.good
        yield designs
    return is_good and good >= ENOUGH * dice


def _bodies(count: int) -> Iterator[tuple[RestPoses, Floats]]:
    """Rests of random bodies, and an axis for each."""
    import numpy as np

    from dicedesign.rest.poses import rest_poses

    rng = np.random.default_rng(0)
    for _ in range(count):
        points = rng.normal(size=(CORNERS, 3)) * rng.uniform(0.5, 2.0, 3)
        yield rest_poses(points), rng.normal(size=3)


def _axial(run: Run) -> Iterator[OddsRow]:
    from dicedesign.rest.priors.density_function import DensityFunction
    from dicedesign.rest.priors.von_mises_fisher import VonMisesFisher

    for concentration in CONCENTRATIONS:
        run.begin(f"concentration {concentration:g}")
        measured = []
        for poses, axis in _bodies(run.extent.bodies):
            prior = VonMisesFisher(axis.tolist(), concentration)
            started = time.perf_counter()
            under = poses.under(prior)
            seconds = time.perf_counter() - started
            other = _by_facet(poses.under(DensityFunction(prior.density)))
            measured.append(_measured(poses, under, _by_facet(under), other, seconds))
            run.advance()
        yield _odds_row(f"concentration {concentration:g}", "cubature", measured)


def _caps(run: Run) -> Iterator[OddsRow]:
    import numpy as np

    from dicedesign.rest.priors.cap import SphericalCap

    for angle in ANGLES:
        run.begin(f"cap of {angle:g}")
        measured = []
        for poses, axis in _bodies(run.extent.bodies):
            started = time.perf_counter()
            under = poses.under(SphericalCap(axis.tolist(), angle))
            seconds = time.perf_counter() - started
            rest = poses.under(SphericalCap((-axis).tolist(), 180.0 - angle))
            part = np.sin(np.radians(angle) / 2.0) ** 2
            whole = part * _by_facet(under) + (1.0 - part) * _by_facet(rest)
            measured.append(_measured(poses, under, whole, _by_facet(poses), seconds))
            run.advance()
        yield _odds_row(f"cap of {angle:g} degrees", "complement", measured)


def _measured(
    poses: RestPoses, under: RestPoses, odds: Floats, other: Floats, seconds: float
) -> tuple[float, float, float]:
    """Difference, told error and multiple of the time of a query, see `OddsRow`."""
    import numpy as np

    assert under.errors is not None
    query = sum(poses.seconds.values())
    return float(np.abs(odds - other).max()), float(under.errors.max()), seconds / query


def _odds_row(prior: str, against: str, measured: list[tuple[float, float, float]]) -> OddsRow:
    off, told, multiples = zip(*measured, strict=True)
    return OddsRow(prior, against, len(off), max(off), max(told), statistics.median(multiples))


def _by_facet(poses: RestPoses) -> Floats:
    """(m,) odds of the facets."""
    import numpy as np

    odds = np.zeros(len(poses.hull.normals))
    odds[poses.facets] = poses.probabilities
    return odds


def _designs(prior: str, extent: Extent, run: Run) -> DesignRow:
    from dicedesign.errors import NoStartError
    from dicedesign.recipe.design_die import design_recipe
    from dicedesign.recipe.schema.reading import checked_recipe
    from dicedesign.results.status import Status

    errors, seconds, dice = [], [], 0
    for target in TARGETS[: extent.targets]:
        for seed in range(extent.seeds):
            entries = {"name": "die", "target": target, "prior": prior, "seed": seed}
            started = time.perf_counter()
            dice += 1
            try:
                work = design_recipe(checked_recipe({**entries, "engrave": False}), last="check")
            except NoStartError:
                continue
            finally:
                seconds.append(time.perf_counter() - started)
                run.advance()
            if work.status is Status.CONVERGED:
                error = work.solid.outcomes.max_abs_error(work.target.probabilities)
                errors.append((error, work.plain.max_abs_error))
    designed = max((error for error, _ in errors), default=float("nan"))
    in_file = max((error for _, error in errors), default=float("nan"))
    return DesignRow(prior, dice, len(errors), designed, in_file, statistics.median(seconds))


BENCHES.register(
    Bench(
        name="priors",
        line="odds under priors by two ways, and dice designed under them",
        description="Ask for the odds of random bodies under priors about an axis, and hold them "
        "against cubature of the same density, and under caps, against those under the rest of "
        "the sphere. Then design dice of several targets under priors. Exits 1 where two ways "
        "differ by more than 1e-12, or fewer than three quarters of the dice are as wanted.",
        rows=_rows,
        full=Extent(bodies=100, targets=len(TARGETS), seeds=4),
        quick=Extent(bodies=4, targets=2, seeds=1),
        amounts=(
            Amount("bodies", "N", "random bodies for each prior"),
            Amount("seeds", "N", "dice for each target and prior"),
        ),
        packages=("numpy", "scipy", "torch"),
    )
)
