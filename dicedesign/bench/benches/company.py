"""What a second die and a wall do to the odds of dice."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Amount, Option
from dicedesign.bench.rows import Row, column, hidden, percent
from dicedesign.errors import InputError

if TYPE_CHECKING:
    from dicedesign.throws.counts.throw_counts import CountedDie

__all__ = ["CompanyRow", "Extent"]

KEY: Final = """
met: throws in which the die touched the other, or the wall. lost: those that ended on no facet, as
a die that leans on something. floor: total variation that chance alone shows, on the mean; above:
what there is beyond it. p: of changes as large by chance. error: standard error of the outcome
that changes most."""


@dataclass(frozen=True)
class Extent:
    """Drops of each die in each company, to be a multiple of `THROWS_PER_TASK`."""

    drops: int


@dataclass(frozen=True)
class CompanyRow(Row):
    """One die in one company: total variation from its odds alone, with what chance shows; the
    outcome that changes most, by how much, and its standard error."""

    die: str = column("die", -20)
    company: str = column("with", -8)
    throws: int = column("throws", 8)
    touched: float = column("met %", 8, percent(1))
    lost: float = column("lost %", 8, percent(2))
    lost_alone: float = column("alone %", 9, percent(2))
    total_variation: float = column("variation", 11, ".4f")
    noise_floor: float = column("floor", 8, ".4f")
    above_noise: float = column("above", 8, ".4f")
    p_value: float = column("p", 8, ".2g")
    change: float = column("most", 9, "+.4f")
    error: float = column("error", 8, ".4f")
    outcome: str = column("of", 0)
    changes: tuple[float, ...] = hidden(default=())
    errors: tuple[float, ...] = hidden(default=())


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.throws.company_odds import THROWS_PER_TASK, odds_in_company
    from dicedesign.throws.counts.throw_counts import read_throw_counts
    from dicedesign.throws.engines.engine import require_engine
    from dicedesign.throws.tables import table_named

    options = run.options
    require_engine("mujoco")
    table = table_named(options.table)
    names = options.printed and [name.strip() for name in options.printed.split(",")]
    dice = (_box(),) if options.throws is None else read_throw_counts(options.throws, names)
    drops = run.extent.drops
    if drops % THROWS_PER_TASK:
        raise InputError(
            f"--drops: expected a multiple of {THROWS_PER_TASK}, got {drops}; round it up"
        )
    yield {"table": table.as_dict()}
    yield f"thrown onto {table.name} with company and alone, in MuJoCo"
    with run.workers("drops", 2 * drops * len(dice)) as workers:
        for die in dice:
            found = odds_in_company(die, table, drops, 0, workers, run.advance)
            for company, odds in found.items():
                most = int(abs(odds.changes).argmax())
                yield CompanyRow(
                    die=die.name,
                    company=company,
                    throws=odds.throws,
                    touched=odds.touched,
                    lost=odds.lost,
                    lost_alone=odds.lost_alone,
                    total_variation=odds.total_variation,
                    noise_floor=odds.noise_floor,
                    above_noise=odds.above_noise,
                    p_value=odds.p_value,
                    change=float(odds.changes[most]),
                    error=float(odds.errors[most]),
                    outcome=die.labels[most],
                    changes=tuple(odds.changes.tolist()),
                    errors=tuple(odds.errors.tolist()),
                )
    yield KEY
    return True


def _box() -> CountedDie:
    """A box with an outcome for each side, of 25 mm."""
    import numpy as np

    from dicedesign.geometry.meshes.body import make_body
    from dicedesign.rest.poses import rest_poses
    from dicedesign.throws.counts.throw_counts import CountedDie
    from dicedesign.throws.rigid_body import rigid_body

    corners = np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.2], [0.0, 1.5]), axis=-1).reshape(-1, 3)
    body = make_body(corners, name="box")
    poses = rest_poses(body)
    sides = np.arange(len(poses.facets))
    labels = tuple(str(side + 1) for side in sides)
    never = np.zeros(len(sides), dtype=np.int64)
    odds = poses.probabilities
    return CountedDie("box", rigid_body(body, poses), None, labels, never, odds, sides, poses)


BENCHES.register(
    Bench(
        name="company",
        line="what a second die beside it, or a wall across its way, does to a die's odds",
        description="Throw dice in MuJoCo two at a time, let go side by side, and towards a wall "
        "across their way, and compare their odds with those of the same throws alone. Of two "
        "dice, those that touched are thrown again alone, and the others count as they ended.",
        rows=_rows,
        full=Extent(40_000),
        quick=Extent(200),
        amounts=(Amount("drops", "N", "of each die in each company"),),
        options=(
            Option(
                "--throws",
                "the dice: a file as of `dicedesign table fit` (default: a box of 1 : 1.2 : 1.5)",
                {"type": Path, "metavar": "CSV"},
            ),
            Option(
                "--printed", "these dice of the file only (default: all)", {"metavar": "NAME,..."}
            ),
            Option(
                "--table",
                "that they are thrown onto (default: board-game)",
                {"default": "board-game", "metavar": "NAME|FILE.json"},
            ),
        ),
        packages=("numpy", "mujoco"),
        workers="tasks at a time (default: one for each core)",
        torch=False,
    )
)
