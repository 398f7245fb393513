"""Plan: every order visits every pixel; rows obey what must hold of any cone; the committed rows are computed again.

- Visits are permutations; Hilbert's steps go to a neighbour.
- The incremental half-angle is never below the tightest; pairs kept are at most all pairs.
- The tightest cone's columns do not depend on the order.
- One committed case comes out again.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from refsim.experiments import tightest_cone
from refsim.experiments.files import read_csv
from tests.experiments.tiny import rows_of

FIGURES = Path(__file__).resolve().parents[2] / "figures"


@pytest.mark.parametrize("size", [1, 2, 8, 32])
def test_orders_visit_every_pixel(size: int) -> None:
    for order in tightest_cone.ORDERS:
        assert sorted(tightest_cone.visits(order, size)) == list(range(size * size))
    y, x = np.divmod(tightest_cone.visits("Hilbert", size), size)
    assert np.all(np.abs(np.diff(x)) + np.abs(np.diff(y)) == 1)


def test_tightest_is_tightest_and_knows_no_order() -> None:
    rows = rows_of("tightest-cone")
    assert len(rows) == 2 * 2 * 3
    for row in rows:
        ratios = [row[f"{name}_half_angle_ratio"] for name in ("median", "p90", "largest")]
        if row["unbounded_incremental_tiles"] == row["tiles"]:
            assert ratios == [""] * 3
        else:
            assert 1.0 <= ratios[0] <= ratios[1] <= ratios[2]
        assert 0 < row["pairs_kept_tightest"] <= row["cone_tests"] >= row["pairs_kept_incremental"] > 0
        assert row["unbounded_tightest_tiles"] <= row["unbounded_incremental_tiles"]
    for first in rows[::3]:
        same = [r for r in rows if (r["tile_px"], r["generation"]) == (first["tile_px"], first["generation"])]
        assert len({(r["pairs_kept_tightest"], r["unbounded_tightest_tiles"], r["cone_tests"]) for r in same}) == 1


def test_committed_rows_are_computed_again() -> None:
    (case,) = [c for c in tightest_cone.cases(False) if (c["scene"], c["tile_px"]) == ("sphere_896", 8)]
    rows = read_csv(FIGURES / "tightest-cone.csv")
    assert [row for row in rows if (row["scene"], row["tile_px"]) == ("sphere_896", 8)] == tightest_cone.measure(**case)
