"""A slicer of Debian, if it is installed."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

SLICER = "prusa-slicer"

MISSING_SLICER = "no slicer: "
"""Prefix of the reasons for skipped tests."""


@dataclass(frozen=True)
class Sliced:
    """Summary of a G-code file.

    Attributes
    ----------
    layers: heights of the layers in mm.
    supports: number of support sections.
    volume_mm3: volume of the filament.
    """

    layers: list[float]
    supports: int
    volume_mm3: float


def _run_slicer(folder: Path, *arguments: str) -> str:
    if shutil.which(SLICER) is None:
        pytest.skip(f"{MISSING_SLICER}{SLICER}")
    settings = folder / "settings"
    settings.mkdir(exist_ok=True)
    command = [SLICER, "--datadir", str(settings), *arguments]
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def slicer_info(file: Path) -> dict[str, str]:
    """Properties and defects of a mesh file, as the slicer reports them."""
    text = _run_slicer(file.parent, "--info", file.name)
    return dict(re.findall(r"^(\w+) = +(\S+)$", text, re.MULTILINE))


def slice_file(file: Path, layer_mm: float, supports: bool = False) -> Sliced:
    """Slice a mesh file in its given orientation, with full infill."""
    code = file.with_suffix(".gcode")
    code.unlink(missing_ok=True)
    options = ["--layer-height", f"{layer_mm:g}", "--first-layer-height", f"{layer_mm:g}"]
    options += ["--fill-density", "100%", "--fill-pattern", "rectilinear", "--skirts", "0"]
    if supports:
        options += ["--support-material", "--support-material-threshold", "45"]
    _run_slicer(file.parent, "--export-gcode", *options, "--output", code.name, file.name)
    text = code.read_text()
    (filament,) = re.findall(r"^; filament used \[mm\] = ([\d.]+)$", text, re.MULTILINE)
    (diameter,) = re.findall(r"^; filament_diameter = ([\d.]+)$", text, re.MULTILINE)
    return Sliced(
        [float(height) for height in re.findall(r"^;Z:([\d.]+)$", text, re.MULTILINE)],
        len(re.findall(r"^;TYPE:Support", text, re.MULTILINE)),
        float(filament) * math.pi / 4.0 * float(diameter) ** 2,
    )
