"""The ray-triangle test in plane form.

Plan
- Device and NumPy give the same bits, for packed records and for hits, on random and on degenerate triangles.
- A ray aimed at a point of known weights, well inside, hits with these weights and the distance it was aimed from;
  aimed well outside, it misses.
- An accepted hit lies on the triangle's plane to a few roundings of the distance, at grazing angles too.
- den tells the side: negative where the vertices run counter-clockwise.
- Tables: t at 0 and at t_max, weights at 0 and 1, ray parallel to the plane, dead ray; zero-area triangles are
  flagged and never hit; wrong
  shapes are refused.
- Golden numbers for one triangle.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from refsim.errors import InputError
from refsim.geometry.triangle import pack_triangles
from refsim.reference import triangle as reference
from tests.geometry.cone_bundles import unit
from tests.geometry.device_loops import hits

FAR = np.float32(np.inf)
number = st.floats(-1, 1, width=32)


def shoot(o, d, triangle, t_max=FAR):
    """One ray at one triangle: (hit, t, u, v, den)."""
    records = pack_triangles(np.array([triangle], np.float32))
    out = hits(np.array([o], np.float32), np.array([d], np.float32), np.array([t_max], np.float32), records)
    return tuple(x[0] for x in out)


def random_pairs(seed, n):
    """Rays and triangles of scales 1e-6 to 1e6, a third of the rays aimed at the triangle, some triangles without
    area."""
    rng = np.random.default_rng(seed)
    scale = 10.0 ** rng.uniform(-6, 6, (n, 1, 1))
    triangles = rng.normal(size=(n, 3, 3)) * scale
    triangles[:: n // 50, 2] = triangles[:: n // 50, 1]
    o = rng.normal(size=(n, 3)) * scale[:, 0] * 3
    inside = np.einsum("nk,nkc->nc", rng.dirichlet([1, 1, 1], n), triangles)
    d = np.where(rng.random((n, 1)) < 0.3, inside - o, rng.normal(size=(n, 3)))
    return o.astype(np.float32), unit(d).astype(np.float32), triangles.astype(np.float32)


def same_bits(a, b):
    """Equal bit for bit, NaN equal to NaN."""
    alike = (a == b) & (np.signbit(a) == np.signbit(b))
    return a.dtype == b.dtype and bool(np.all(alike | (np.isnan(a) & np.isnan(b))))


@pytest.mark.parametrize("seed", range(3))
def test_device_and_numpy_agree_bit_for_bit(seed):
    o, d, triangles = random_pairs(seed, 20000)
    records, packed = pack_triangles(triangles), reference.pack(triangles)
    for ours, theirs in zip(records, packed, strict=True):
        assert np.array_equal(ours, theirs) and ours.dtype == theirs.dtype
    t_max = np.where(np.arange(len(o)) % 3 == 0, np.float32(1), FAR)
    one = hits(o, d, t_max, records)
    two = reference.intersect(o, d, t_max, *(packed[i] for i in (0, 1, 3, 4)))
    assert np.array_equal(one[0], two[0]) and one[0].sum() > 3000
    for a, b in zip(one[1:], two[1:], strict=True):
        assert same_bits(a, b)


@settings(max_examples=200, deadline=None, derandomize=True, database=None)
@given(arrays(np.float32, (3, 3), elements=number), arrays(np.float32, 3, elements=number), st.data())
def test_known_weights_come_back(triangle, origin, data):
    t8, o8 = triangle.astype(np.float64), origin.astype(np.float64)
    normal = np.cross(t8[1] - t8[0], t8[2] - t8[0])
    edges = np.linalg.norm(np.roll(t8, 1, axis=0) - t8, axis=1)
    weights = [data.draw(st.floats(-0.5, 1.5)) for _ in range(2)]
    target = t8[0] + weights[0] * (t8[1] - t8[0]) + weights[1] * (t8[2] - t8[0])
    distance = np.linalg.norm(target - o8)
    if np.linalg.norm(normal) < 1e-2 * edges.max() ** 2 or edges.max() < 1e-2 or distance < 1e-2:
        return
    d = (target - o8) / distance
    if abs(d @ normal) < 0.1 * np.linalg.norm(normal):
        return
    hit, t, u, v, den = shoot(origin, d, triangle)
    smallest = min(weights[0], weights[1], 1 - sum(weights))
    tolerance = 1e-2 * max(1.0, distance / edges.max())
    if abs(smallest) > tolerance:
        assert hit == (smallest > 0)
    assert abs(t - distance) < 1e-4 * max(1.0, distance)
    assert abs(u - weights[0]) < tolerance and abs(v - weights[1]) < tolerance
    assert (den < 0) == (d @ normal < 0)


def test_an_accepted_hit_lies_in_the_plane_at_any_angle():
    rng = np.random.default_rng(9)
    n = 200000
    triangles = rng.normal(size=(n, 3, 3)).astype(np.float32)
    t8 = triangles.astype(np.float64)
    inside = np.einsum("nk,nkc->nc", rng.dirichlet([1, 1, 1], n), t8)
    normal = unit(np.cross(t8[:, 1] - t8[:, 0], t8[:, 2] - t8[:, 0]))
    along = unit(t8[:, 1] - t8[:, 0]) + normal * 10.0 ** rng.uniform(-7, 0, (n, 1))
    o = (inside - unit(along) * 10.0 ** rng.uniform(-1, 2, (n, 1))).astype(np.float32)
    d = unit(inside - o).astype(np.float32)
    hit, t, *_ = hits(o, d, np.full(n, FAR), pack_triangles(triangles))
    assert hit.sum() > n // 5
    point = o[hit].astype(np.float64) + d[hit].astype(np.float64) * t[hit, None].astype(np.float64)
    reach = np.linalg.norm(o[hit] - t8[hit, 0], axis=1) + t[hit]
    height = np.abs(np.sum((point - t8[hit, 0]) * normal[hit], axis=1))
    assert (height / reach).max() < 6 * 2.0**-24


# A right triangle in the plane z = 0; rays fall straight down on it.
RIGHT = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
DOWN = (0, 0, -1)


@pytest.mark.parametrize(
    ("name", "o", "d", "t_max", "expected"),
    [
        ("control: inside", (0.25, 0.25, 1), DOWN, FAR, True),
        ("from below", (0.25, 0.25, -1), (0, 0, 1), FAR, True),
        ("behind the origin", (0.25, 0.25, -1), DOWN, FAR, False),
        ("t = 0", (0.25, 0.25, 0), DOWN, FAR, False),
        ("t = t_max", (0.25, 0.25, 1), DOWN, 1.0, False),
        ("t just under t_max", (0.25, 0.25, 1), DOWN, 1.0000001, True),
        ("u = 0", (0, 0.5, 1), DOWN, FAR, True),
        ("u just under 0", (-1e-7, 0.5, 1), DOWN, FAR, False),
        ("v = 0", (0.5, 0, 1), DOWN, FAR, True),
        ("v just under 0", (0.5, -1e-7, 1), DOWN, FAR, False),
        ("u + v = 1", (0.5, 0.5, 1), DOWN, FAR, True),
        ("u + v just over 1", (0.5, 0.5000001, 1), DOWN, FAR, False),
        ("parallel, above", (-1, 0.25, 1), (1, 0, 0), FAR, False),
        ("parallel, in the plane", (-1, 0.25, 0), (1, 0, 0), FAR, False),
        ("dead ray", (0.25, 0.25, 1), (0, 0, 0), 0.0, False),
    ],
)
def test_boundaries(name, o, d, t_max, expected):
    hit, *_ = shoot(o, d, RIGHT, t_max)
    assert hit == expected, name


def test_side():
    assert shoot((0.25, 0.25, 1), DOWN, RIGHT)[4] == -1
    assert shoot((0.25, 0.25, -1), (0, 0, 1), RIGHT)[4] == 1


@pytest.mark.parametrize(
    ("name", "triangle", "flagged"),
    [
        ("control", RIGHT, False),
        ("a point", [(1, 2, 3)] * 3, True),
        ("two equal vertices", [(0, 0, 0), (1, 0, 0), (1, 0, 0)], True),
        ("three in a row", [(0, 0, 0), (1, 1, 1), (2, 2, 2)], True),
        ("weights beyond float32", [(0, 0, 0), (1e-39, 0, 0), (0, 1e-39, 0)], True),
        ("tiny but sound", [(0, 0, 0), (1e-6, 0, 0), (0, 1e-6, 0)], False),
        ("a sliver", [(0, 0, 0), (1, 0, 0), (0.5, 1e-6, 0)], False),
    ],
)
def test_degenerate(name, triangle, flagged):
    records = pack_triangles(np.array([triangle], np.float32))
    assert bool(records.degenerate[0]) == flagged, name
    assert all(np.isfinite(x).all() for x in records[:5])
    if flagged:
        assert not records.n.any() and not records.m1.any() and not records.m2.any()
        centre = np.mean(np.array(triangle, np.float32), axis=0)
        for d in np.vstack([np.eye(3), -np.eye(3)]):
            assert not shoot(centre - d.astype(np.float32), d, triangle)[0], name


@pytest.mark.parametrize("shape", [(3, 3), (2, 4, 3), (2, 3, 2)])
def test_wrong_shapes_are_refused(shape):
    with pytest.raises(InputError, match=r"\[n, 3, 3\]"):
        pack_triangles(np.zeros(shape, np.float32))


def test_golden_numbers():
    records = pack_triangles(np.array([[(1, 0, 2), (3, 0, 2), (1, 4, 2)]], np.float32))
    assert records.n[0].tolist() == [0, 0, 1] and records.offset[0] == 2
    assert records.m1[0].tolist() == [0.5, 0, 0] and records.m2[0].tolist() == [0, 0.25, 0]
    hit, t, u, v, den = shoot((2, 1, 5), DOWN, [(1, 0, 2), (3, 0, 2), (1, 4, 2)])
    assert (hit, t, u, v, den) == (True, 3, 0.5, 0.25, -1)
