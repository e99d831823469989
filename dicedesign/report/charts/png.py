"""PNG bytes of drawings."""

from __future__ import annotations

from dicedesign.report.charts.paper import Paper

__all__ = ["png_bytes"]


def png_bytes(figure: Paper) -> bytes:
    """A drawing as PNG; the same one gives the same bytes."""
    return figure.png()
