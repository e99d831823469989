"""Old names of keys in recipes and in result.json."""

from __future__ import annotations

from typing import Final

RENAMED_KEYS: Final = {
    "method.exact.odds": "method.exact.probabilities",
    "odds": "probabilities",
    "inside.made": "inside.details",
    "thrown.rounds.asked": "thrown.rounds.requested",
}
"""New dotted key by old dotted key, without numbers of list items."""
