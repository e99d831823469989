"""What a report says about throws, in words."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from dicedesign.results.parts import OtherTables, SimulatedThrows, ThrownOdds
from dicedesign.throws.engines import ENGINES
from dicedesign.throws.tables import Spread, Table, most_of, scaled

_ROLLING: Final = (
    "Set it down gently, each time in another orientation: the odds are those of rolling without "
    "momentum. Thrown it has others; the command dicedesign throw shows by how much."
)
"""How to roll a die that was designed for no table."""


def throws_told(thrown: ThrownOdds) -> list[str]:
    """Paragraphs: how the die is thrown, and what it does then, there and on other tables."""
    verdict = (
        "No throws of it were simulated: what it does on the table is what the momentum model "
        "expects."
    )
    if thrown.simulated is not None:
        verdict = " ".join(_verdict(thrown.simulated))
    told = [_manner(Table(**thrown.table)), verdict]
    if thrown.elsewhere is not None:
        told.append(_elsewhere(thrown.elsewhere))
    return told


def throwing_advice(thrown: ThrownOdds | None, prior: str | None = None) -> str:
    """How to throw a die by hand, perhaps one that was designed for a table, or under a prior."""
    if prior is not None:
        return (
            f"Let it go gently, turned as the prior {prior} says, whose directions point down in "
            "the coordinates of die.stl: the odds are those under it, without momentum. With any "
            "side down alike, or thrown, it has others."
        )
    if thrown is None:
        return _ROLLING
    table = Table(**thrown.table)
    if most_of(table.height) == 0.0:
        return "Set it down on the table and let it tip over, from a random orientation."
    moving = max(most_of(table.speed), most_of(table.spin)) > 0.0
    push = " with a little push and spin," if moving else ""
    way = "" if table.hand is None else f" {table.hand.phrase}"
    return (
        f"Throw it{way}: let it fall from {_about(table.height)} above the table,{push} "
        "each time from another orientation. Set down gently it has other odds."
    )


def _about(height: Spread) -> str:
    return _lengths(height) if isinstance(height, tuple) else f"about {_lengths(height)}"


def _lengths(metres: Spread) -> str:
    if most_of(metres) < 1.0:
        return f"{_numbers(scaled(metres, 100.0), 3)} cm"
    return f"{_numbers(metres, 3)} m"


def _numbers(spread: Spread, digits: int) -> str:
    ends = spread if isinstance(spread, tuple) else (spread,)
    return " to ".join(f"{end:.{digits}g}" for end in ends)


def _manner(table: Table) -> str:
    """What throws the odds are for."""
    fall = (
        f"falls from {_lengths(table.height)} above the table, turned at random"
        if most_of(table.height) > 0.0
        else "is set down on the table, turned at random"
    )
    motion = []
    if most_of(table.speed) > 0.0:
        motion.append(f"moves sideways at {_lengths(table.speed)} a second")
    if most_of(table.spin) > 0.0:
        turns = scaled(table.spin, 0.5 / math.pi)
        motion.append(f"spins {_numbers(turns, 2)} times a second")
    when = f"; when it is let go it {' and '.join(motion)}" if motion else ""
    way = "" if table.hand is None else f"{table.hand.phrase}, "
    ranges = (table.height, table.speed, table.spin)
    differ = any(isinstance(value, tuple) for value in ranges)
    each = "; of a range, each throw has a value of its own" if differ else ""
    bounce = (
        f"A corner that hits the table bounces off with {100.0 * table.restitution:.3g} % of "
        "its speed"
        if table.restitution > 0.0
        else "It does not bounce"
    )
    drag = ", and it turns as slowly as in honey" if table.drag > 0.0 else ""
    return (
        f"The odds of this die are for throws {way}in which it {fall}{when}{each}. {bounce}; the "
        f"coefficient of friction is {table.friction:.3g}{drag}. The die is "
        f'{1000.0 * table.size:.3g} mm across. This is the table "{table.name}": '
        f"{table.source}."
    )


def _verdict(simulated: SimulatedThrows) -> Iterator[str]:
    low, high = simulated.interval
    engine = ENGINES[simulated.engine]
    yield (
        f"In {simulated.drops:,} throws that the design had not seen, simulated by "
        f"{engine.phrase or engine.title}, the outcomes' frequencies differ from the target by a "
        f"total variation of {simulated.total_variation:.4f}: no bet on these throws was won "
        "more or less often than it should be by more than that. A perfect die would show "
        f"{simulated.noise_floor:.4f} on the mean in as many throws, by chance alone."
    )
    if low > 0.0:
        yield f"So its odds are off by {low:.4f} to {high:.4f}, with a confidence of 95 %."
    else:
        yield (
            "So the throws do not tell it from a perfect one; with a confidence of 95 % its odds "
            f"are off by at most {high:.4f}."
        )
    if simulated.unresolved:
        yield f"{simulated.unresolved:,} throws did not come to rest on a facet in time."
    elsewhere = simulated.drops - simulated.unresolved - sum(simulated.counts)
    if elsewhere > 0:
        yield f"{elsewhere:,} came to rest on a facet without a label."


def _elsewhere(others: OtherTables) -> str:
    """What the die does on what the table may be instead."""
    return (
        f"Tables are known from throws of real dice, so not for certain: {len(others.values)} "
        "others explain them as well. On nine in ten of these the total variation is at most "
        f"{others.often:.4f}, on the worst {others.worst:.4f}, by {others.drops:,} throws onto all "
        "together, from which the odds on each are fitted. Of a perfect die, which has the same "
        f"odds on all of them, so many throws would show {others.chance_often:.4f} and "
        f"{others.chance_worst:.4f}."
    )
