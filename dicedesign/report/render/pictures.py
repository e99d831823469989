"""Pictures of pixels."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Picture: TypeAlias = NDArray[np.uint8]
"""(h, w, 3) red, green and blue."""


def encoded(picture: Picture) -> bytes:
    """A picture as a PNG."""
    buffer = BytesIO()
    Image.fromarray(picture).save(buffer, "PNG", compress_level=1)
    return buffer.getvalue()


def decoded(png: bytes) -> Picture:
    """A PNG as a picture."""
    return np.asarray(Image.open(BytesIO(png)).convert("RGB"))


def trim(pictures: Sequence[Picture]) -> list[Picture]:
    """Pictures (h, w, 3) of one size without the rows above and below that are white in all of
    them, but for a margin of 8."""
    used = np.flatnonzero((np.stack(pictures) < 255).any(axis=(0, 2, 3)))
    if len(used) == 0:
        return list(pictures)
    rows = slice(max(int(used[0]) - 8, 0), int(used[-1]) + 9)
    return [picture[rows] for picture in pictures]
