"""Sizes on paper, without what draws on it: figures in inches, what is on them in points."""

from __future__ import annotations

COLUMN_WIDTH = 3.3
"""Width of one column of a paper, in inches."""

PAGE_WIDTH = 7.0
"""Width of the figures of the report, and of two columns of a paper, in inches."""

POINTS = 72.0
"""Points per inch."""

DPI = 300
"""Pixels per inch of PNG files, and of pictures within PDF and SVG files."""

REPORT_DPI = 200
"""Pixels per inch of the figures of the report."""

GAP = 6.0
"""Space between pictures, and at the edges of a sheet, in points."""
