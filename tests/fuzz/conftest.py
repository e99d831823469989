"""Profiles of the fuzzing tests.

`pytest tests/fuzz` tries the same few hundred bodies every time,
`pytest tests/fuzz --hypothesis-profile=nightly` 20,000 new ones in one process.
"""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, settings

KINDS = 5
"""Tests among which a profile's bodies are divided."""

settings.register_profile(
    "quick", max_examples=200 // KINDS, deadline=None, derandomize=True, database=None
)
settings.register_profile(
    "nightly",
    max_examples=20_000 // KINDS,
    deadline=None,
    print_blob=True,
    derandomize=False,
    suppress_health_check=[HealthCheck.too_slow],
)


def pytest_configure(config: pytest.Config) -> None:
    """Register the profile "fuzz" of the fuzzing tests: nightly if requested, else quick."""
    nightly = config.getoption("--hypothesis-profile") == "nightly"
    settings.register_profile("fuzz", settings.get_profile("nightly" if nightly else "quick"))
