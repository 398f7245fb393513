"""Plan: the tightest cone holds all rays, and no smaller one does.

- Smallest cap: equals the best of all pairs and triples; turns with its directions; copies and order change nothing.
- 90 degrees and more is no cone: opposite directions, and directions around the sphere.
- Apex: holds every origin; no random apex that holds them is nearer; the bound proves it to `GAP`.
- The incremental cone is never narrower.
- Boundaries: one ray, one origin, parallel rays (opened to HRE-E5's angle), a right angle by hand.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.reference import cone
from refsim.reference.tightest_cone import GAP, nearest_apex, retreat, smallest_cap, tightest_cone
from tests.geometry.cone_bundles import unit

SEEDS = st.integers(0, 2**32 - 1)
SPREADS = st.sampled_from([1e-3, 0.1, 0.4])
QUICK = settings(max_examples=30, deadline=None)


def rays(seed: int, spread: float, n: int = 9) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, 3)), unit(unit(rng.normal(size=3)) + spread * rng.uniform(-1, 1, (n, 3)))


def best_of_all(r: np.ndarray) -> float:
    """The smallest chord of any cap through a pair or a triple that holds all directions."""
    axes = [unit(r[i] + r[j]) for i, j in combinations(range(len(r)), 2)]
    for i, j, k in combinations(range(len(r)), 3):
        normal = unit(np.cross(r[j] - r[i], r[k] - r[i]))
        axes += [normal, -normal]
    return min(float(np.linalg.norm(r - axis, axis=1).max()) for axis in axes)


@QUICK
@given(SEEDS, SPREADS)
def test_cap_is_the_best_of_all_pairs_and_triples(seed: int, spread: float) -> None:
    _, r = rays(seed, spread)
    cap = smallest_cap(r)
    assert cap is not None
    # Chords of unit vectors round to a few 2^-53
    assert np.linalg.norm(r - cap.axis, axis=1).max() <= 2 * np.sin(cap.half_angle / 2) + 2**-48
    # A triple's axis is right to the roundings of its sides, relative to their lengths
    assert 2 * np.sin(cap.half_angle / 2) == pytest.approx(best_of_all(r), abs=2**-46 / spread)


@QUICK
@given(SEEDS, SPREADS)
def test_cap_turns_with_its_directions_whatever_their_order(seed: int, spread: float) -> None:
    _, r = rays(seed, spread)
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    one, other = smallest_cap(r), smallest_cap(rng.permutation(np.concatenate([r, r[:3]])) @ turn.T)
    assert one is not None and other is not None
    assert other.half_angle == pytest.approx(one.half_angle, abs=2**-46 / spread)
    # The axis is the less certain the flatter the minimum: its square is what the angle sees
    assert other.axis == pytest.approx(turn @ one.axis, abs=1e-6)


@QUICK
@given(SEEDS, st.sampled_from([0.05, 0.4]))
def test_no_apex_is_nearer(seed: int, spread: float) -> None:
    p, r = rays(seed, spread)
    found = tightest_cone(p, r)
    assert found is not None
    # A millionth of the bundle's size, as the search ends
    slack = GAP * max(float(np.linalg.norm(p - p[0], axis=1).max()), found.translation) * 1.01
    assert retreat(p, found.apex, found.axis, found.half_angle) <= 1e-9 * (1 + found.translation)
    assert found.bound <= found.translation + 1e-12 and found.translation - found.bound <= slack
    rng = np.random.default_rng(seed)
    near = found.apex + rng.normal(size=(200, 3)) * 10.0 ** rng.uniform(-6, 0, (200, 1)) * found.translation
    for at in near:
        at = at - retreat(p, at, found.axis, found.half_angle) * found.axis
        assert np.linalg.norm(at - p[0]) >= found.bound - 1e-9 * found.translation


@QUICK
@given(SEEDS, SPREADS)
def test_incremental_cone_is_never_narrower(seed: int, spread: float) -> None:
    p, r = rays(seed, spread)
    found, (cones, _) = tightest_cone(p, r), cone.build(p[None], r[None], np.ones((1, len(r)), bool))
    assert found is not None
    if cones.state[0] == cone.BOUNDED:
        assert np.arctan2(cones.sin[0], cones.cos[0]) >= found.half_angle - 2**-46 / spread


AROUND = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]


@pytest.mark.parametrize("r", [[[1, 0, 0], [-1, 0, 0]], AROUND, [[1, 0, 0], [0, 1, 0], [-1, -1, 0]]])
def test_ninety_degrees_and_more_is_no_cone(r: list) -> None:
    assert smallest_cap(np.array(r)) is None
    assert tightest_cone(np.zeros((len(r), 3)), np.array(r)) is None


def test_few_rays() -> None:
    x, y = np.eye(3)[0], np.eye(3)[1]
    alone = tightest_cone(y[None], x[None])
    assert alone is not None and alone.half_angle == 0.0 and np.array_equal(alone.apex, y)
    fan = tightest_cone(np.zeros((2, 3)), np.array([x, y]))
    assert fan is not None and fan.translation == 0.0
    assert fan.half_angle == pytest.approx(np.pi / 4) and fan.axis == pytest.approx((x + y) / np.sqrt(2))
    beam = tightest_cone(np.array([0 * y, y]), np.array([x, x]))
    assert beam is not None and np.sin(beam.half_angle) == pytest.approx(cone.NARROWEST_SIN)
    # Half-angle 45 degrees, origins 0 and 2 y: from 0 to the plane at 45 degrees through 2 y
    apex, bound = nearest_apex(np.array([0 * y, 2 * y]), 0 * y, x, np.pi / 4)
    assert apex == pytest.approx(y - x, abs=1e-6) and bound == pytest.approx(np.sqrt(2), abs=1e-6)
