"""The published table of distances."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from common.paths import public_data

from dicedesign.bench.reference.published_distances import (
    PRINTED_CORRELATIONS,
    read_published_distances,
)
from dicedesign.errors import InputError
from dicedesign.throws.statistics.correlation import correlation

HEAD = "id,weight_ratio,OT_us_IPC,OT_us_Bullet,OT_IPC_Bullet\n"


def test_the_published_correlations_come_out_again() -> None:
    table = public_data("published/fracture_transport_distances.csv")
    published = read_published_distances(table)
    assert published.asymmetry.shape == (672,)
    assert published.distances.keys() == PRINTED_CORRELATIONS.keys()
    found = {
        name: correlation(published.asymmetry, distances)
        for name, distances in published.distances.items()
    }
    for name, (coefficient, _) in PRINTED_CORRELATIONS.items():
        assert round(found[name].coefficient, 2) == coefficient
    assert found["geometric model vs Bullet"].p_value == pytest.approx(5e-4, rel=0.1)
    assert found["Bullet vs Rigid IPC"].p_value == pytest.approx(0.06, rel=0.1)
    # The paper prints 1e-20; the rows give less.
    assert found["geometric model vs Rigid IPC"].p_value == pytest.approx(1.56e-38, rel=0.01)


def test_columns_are_found_by_their_names(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(
        "OT_IPC_Bullet,weight_ratio,more,OT_us_IPC,OT_us_Bullet\n0.3,0.5,x,0.1,0.2\n3,0,,1,2\n"
    )
    read = read_published_distances(path)
    np.testing.assert_array_equal(read.asymmetry, [0.5, 0.0])
    np.testing.assert_array_equal(read.distances["geometric model vs Rigid IPC"], [0.1, 1.0])
    np.testing.assert_array_equal(read.distances["geometric model vs Bullet"], [0.2, 2.0])
    np.testing.assert_array_equal(read.distances["Bullet vs Rigid IPC"], [0.3, 3.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "got 0 lines without weight_ratio, OT_us_IPC, OT_us_Bullet, OT_IPC_Bullet; pass"),
        (HEAD, "a line for each shape, got 0 lines; pass"),
        ("id,weight_ratio,OT_us_IPC\na,1,1\n", "got 1 lines without OT_us_Bullet, OT_IPC_Bullet"),
        (HEAD + "a,1,1,1,1\nb,1,much,1,1\n", "column OT_us_IPC of line 3, got 'much'"),
        (HEAD + "a,1,1,1\n", "column OT_IPC_Bullet of line 2, got None"),
        (HEAD + "a,1,1,nan,1\n", "expected a number from 0 to pi in column OT_us_Bullet of line 2"),
        (HEAD + "a,1,1,3.2,1\n", "expected a number from 0 to pi in column OT_us_Bullet of line 2"),
        (HEAD + "a,-1,1,1,1\n", "a number of at least 0 in column weight_ratio of line 2"),
        (HEAD + "a,inf,1,1,1\n", "a number of at least 0 in column weight_ratio of line 2"),
    ],
)
def test_another_table_is_refused(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as error:
        read_published_distances(path)
    assert str(error.value).startswith(str(path))


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    with pytest.raises(InputError, match=r"got 'No such file or directory'; check the path"):
        read_published_distances(path)
    path.write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(InputError, match="expected comma-separated text"):
        read_published_distances(path)
