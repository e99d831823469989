"""What a run of the fuzzing tests met, for its last lines."""

from __future__ import annotations

from dataclasses import dataclass, field

from tests.reference.measurement import Measurement


@dataclass
class Tally:
    """Counts and extremes.

    Attributes
    ----------
    hulls: bodies that were asked for, by kind; those that Hypothesis shrinks count too.
    tied: bodies that balance somewhere; refused: bodies that were refused, rightly.
    uneven: bodies whose facets are as narrow as they are uneven, compared with their exact hull.
    variants: changed bodies that were compared with the first; borderline: those of which one was
        tied and one was not, or that have different facets.
    error: largest error of a probability over its limit, and what that was.
    excess: largest difference of the probabilities' sum from 1.
    change: largest difference of a probability between a body and a changed one.
    facets: of the largest hull.
    """

    hulls: dict[str, int] = field(default_factory=dict)
    tied: int = 0
    refused: int = 0
    uneven: int = 0
    variants: int = 0
    borderline: int = 0
    error: tuple[float, float] = (0.0, 0.0)
    excess: float = 0.0
    change: float = 0.0
    facets: int = 0

    def asked(self, kind: str) -> None:
        """A body is about to be asked for."""
        self.hulls[kind] = self.hulls.get(kind, 0) + 1

    def measured(self, found: Measurement) -> None:
        """A body has been measured."""
        error = max(found.errors.values())
        self.tied += found.tied
        self.error = max(self.error, (error / found.limit(error), error))
        self.excess = max(self.excess, abs(found.excess))
        self.facets = max(self.facets, found.facets)

    def compared(self, change: float) -> None:
        """A changed body has been compared."""
        self.variants += 1
        self.change = max(self.change, change)

    def lines(self) -> list[str]:
        """The figures in words."""
        kinds = ", ".join(f"{count} {kind}" for kind, count in self.hulls.items())
        ratio, error = self.error
        return [
            f"{sum(self.hulls.values())} hulls ({kinds}) of up to {self.facets} facets: "
            f"{self.tied} tied, {self.uneven} compared with their exact hulls, "
            f"{self.refused} refused as too flat or with the center of mass outside",
            f"error over its limit: at most {ratio:.2g} ({error:.1e}); "
            f"sum of probabilities - 1: at most {self.excess:.1e}",
            f"{self.variants} bodies permuted, scaled, filled or mirrored: probabilities changed "
            f"by at most {self.change:.1e}; {self.borderline} more on both sides of a tolerance",
        ]


TALLY = Tally()
