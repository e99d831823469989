"""PNG bytes and imports."""

from __future__ import annotations

import pkgutil
import subprocess
import sys

import dicedesign.report
from dicedesign.report.charts.png import PIXELS_PER_INCH, agg_figure, png_bytes


def test_png_is_deterministic_and_has_no_metadata():
    pictures = []
    for _ in range(2):
        figure = agg_figure(2.0, 1.0)
        figure.text(0.5, 0.5, "text")
        pictures += [png_bytes(figure), png_bytes(figure)]
    assert len(set(pictures)) == 1
    assert b"tEXt" not in pictures[0]
    assert b"tIME" not in pictures[0]
    width, height = (int.from_bytes(pictures[0][k : k + 4], "big") for k in (16, 20))
    assert (width, height) == (2 * PIXELS_PER_INCH, PIXELS_PER_INCH)


def test_pyplot_is_never_imported():
    names = [
        f"dicedesign.report.{module.name}"
        for module in pkgutil.iter_modules(dicedesign.report.__path__)
    ]
    assert "dicedesign.report.figures.gauss_map" in names
    code = (
        f"import sys, {', '.join(names)}\n"
        "from dicedesign.report.charts.png import agg_figure, png_bytes\n"
        "png_bytes(agg_figure(1, 1))\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
