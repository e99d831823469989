"""Where the repository is, and public data beside it."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
"""The folder with recipes and README."""

DATA = ROOT.parent / "shared" / "data"
"""Public models and published results, where they lie beside the checkout."""
