"""What a measurement was made on, without names of users or folders."""

from __future__ import annotations

import os
import platform
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

__all__ = ["machine_description"]


def machine_description(*packages: str) -> dict[str, str]:
    """The date (UTC), the machine, and the versions of Python, of this package and of others.

    packages: distribution names of the others; what is not installed is left out.
    """
    cores = os.cpu_count() or 1
    described = {
        "date": datetime.now(UTC).date().isoformat(),
        "machine": f"{platform.system()} {platform.machine()}, {cores} cores",
        "python": platform.python_version(),
    }
    for package in ("dicedesign", *packages):
        try:
            described[package] = version(package)
        except PackageNotFoundError:
            continue
    return described
