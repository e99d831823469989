"""Parameters near those of the die that is made better."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.optimize.preferences.preference import PREFERENCES, Preference, Preferences

__all__ = ["nearness_pull"]

FAR: Final = 0.1
"""Root of the mean square change of parameters that counts as 1."""


def nearness_pull(preferences: Preferences, parameters: int) -> float:
    """Derivative of each residual in its parameter, of so many: residuals are the changes times
    this."""
    return float(np.sqrt(preferences.nearness / parameters)) / FAR


PREFERENCES.register(
    Preference(
        name="nearness",
        line="parameters near those of the die that is made better",
        rank=7,
        # They are of the parameters, which the solver has.
        residuals=lambda die: None,
    )
)
