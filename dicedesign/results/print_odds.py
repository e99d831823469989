"""How far the odds of prints are from those of the file: parts of `Result`."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["InfillOdds", "PrintTolerances"]


@dataclass(frozen=True)
class PrintTolerances:
    """How far the odds of prints are from those of the file, to first order.

    Attributes
    ----------
    answer: how well the die must be printed for a test of so many rolls not to notice, in a
        sentence.
    rolls: of that test.
    allowed_mm: standard deviation of the place of each facet at which it notices one print in ten,
        by derivatives, or where these promise too much by prints that are made one by one; 0 where
        it notices more of perfect ones, None where it never does.
    noticed: part of the prints with all errors that are assumed that it notices; a perfect die is
        noticed by the level of the test, 0.05.
    assumed: standard deviations of the errors, see `PrintErrors`.
    deviations: (k,) standard deviations of the odds of the outcomes among such prints.
    by_error: the same from each error alone, by the names in `assumed`.
    total_variation: of the odds of such prints from those of the file, on the mean.
    """

    answer: str
    rolls: int
    allowed_mm: float | None
    noticed: float
    assumed: dict[str, float]
    deviations: tuple[float, ...]
    by_error: dict[str, tuple[float, ...]]
    total_variation: float


@dataclass(frozen=True)
class InfillOdds:
    """The die with solid walls and less material inside.

    Attributes
    ----------
    infill, walls_mm: part of the inside that is material, and thickness of the walls.
    advice: what that does to the odds, and what to print instead, in a sentence.
    probabilities, elsewhere, max_abs_error: odds without momentum of such a print.
    mass: over that of the solid die.
    shift_mm: (3,) move of the center of mass.
    least_infill: least one at which a test of 1,000 rolls notices no more than one print in ten for
        its infill, with these walls; 1 where only a solid one will do.
    """

    infill: float
    walls_mm: float
    advice: str
    probabilities: tuple[float, ...]
    elsewhere: float
    max_abs_error: float
    mass: float
    shift_mm: tuple[float, ...]
    least_infill: float
