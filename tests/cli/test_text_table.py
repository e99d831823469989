"""Tables of aligned columns."""

from __future__ import annotations

import numpy as np

from dicedesign.cli.options import text_table


def test_texts_begin_at_the_left_and_numbers_end_at_the_right() -> None:
    table = text_table(
        ("name", "", ["one", "fifteen"]),
        ("count", "d", [np.int64(7), 12345678]),
        ("left out", "d", None),
        ("part", ".2f", [0.5, np.float64(10)]),
        ("limits", ">", ["1 to 2", "-"]),
        ("", "", ["x", ""]),
    )
    assert table.splitlines() == [
        "name        count   part  limits",
        "one             7   0.50  1 to 2  x",
        "fifteen  12345678  10.00       -",
    ]
