"""Enclosing spheres of triangles.

Plan
- In exact rational arithmetic the float32 sphere holds its three float32 vertices, for any float32 triangle.
- It is the smallest one but for what is stated: radius against an independent float64 search, ordinary shapes to 1e-4.
- It holds every point that the float32 weights accept: points just outside edges and corners, down to slivers.
- Tables: point, segment, three in a row, right, obtuse, acute, extreme sliver; wrong shapes are refused.
"""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from refsim.errors import InputError
from refsim.geometry.sphere import acceptance_margin, enclosing_spheres
from refsim.geometry.triangle import pack_triangles
from refsim.reference.sphere import smallest_sphere
from refsim.reference.triangle import dot
from tests.geometry.cone_bundles import unit

coordinate = st.floats(-1e6, 1e6, width=32, allow_subnormal=False) | st.floats(-1, 1, width=32, allow_subnormal=False)


def holds(centre, radius, vertices):
    """Whether the sphere holds the vertices, in rational arithmetic."""
    if np.isinf(radius):
        return True
    c = [Fraction(float(x)) for x in centre]
    return all(
        sum((Fraction(float(x)) - y) ** 2 for x, y in zip(vertex, c, strict=True)) <= Fraction(float(radius)) ** 2
        for vertex in vertices
    )


@settings(max_examples=400, deadline=None, derandomize=True, database=None)
@given(arrays(np.float32, (3, 3), elements=coordinate))
def test_vertices_are_held_exactly(triangle):
    centre, radius = enclosing_spheres(triangle[None])
    assert centre.dtype == radius.dtype == np.float32
    assert holds(centre[0], radius[0], triangle)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_vertices_are_held_exactly_in_bulk(scale):
    rng = np.random.default_rng(4)
    triangles = (rng.normal(size=(1000, 3, 3)) * scale * 10.0 ** rng.uniform(-3, 0, (1000, 3, 1))).astype(np.float32)
    centre, radius = enclosing_spheres(triangles)
    assert all(holds(c, r, t) for c, r, t in zip(centre, radius, triangles, strict=True))
    least = np.array([smallest_sphere(t)[1] for t in triangles])
    e1, e2 = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    thickness = np.linalg.norm(np.cross(e1, e2), axis=1) / least**2
    assert (radius[thickness > 0.3] / least[thickness > 0.3]).max() < 1 + 1e-4
    assert (radius - acceptance_margin(triangles) <= least * (1 + 1e-6)).all()


def test_accepted_points_are_held():
    rng = np.random.default_rng(8)
    n = 400000
    angle = 10.0 ** rng.uniform(-5, 0, (n, 1))
    e1 = unit(rng.normal(size=(n, 3)))
    e2 = unit(e1 + angle * unit(rng.normal(size=(n, 3)))) * rng.uniform(0.2, 1, (n, 1))
    v0 = rng.normal(size=(n, 3)) * 0.01
    turn = rng.integers(0, 3, n)
    corners = np.stack([v0, v0 + e1, v0 + e2], axis=1).astype(np.float32)
    corners = corners[np.arange(n)[:, None], (np.arange(3) + turn[:, None]) % 3]
    records = pack_triangles(corners)
    # Points past a corner, in the plane, by up to a few times the margin.
    c8 = corners.astype(np.float64)
    at = c8[np.arange(n), (3 - turn) % 3]
    outward = unit(2 * at - c8.sum(axis=1) + at)
    margin = acceptance_margin(corners)
    point = at + outward * (np.where(margin < 1, margin, 1.0) * 10.0 ** rng.uniform(-4, 0.5, n))[:, None]
    h = (point - c8[:, 0]).astype(np.float32)
    u, v = dot(h, records.m1), dot(h, records.m2)
    accepted = (u >= 0) & (v >= 0) & (u + v <= np.float32(1))
    centre, radius = enclosing_spheres(corners)
    gap = np.linalg.norm(c8[:, 0] + h - centre, axis=1) - radius
    assert accepted.sum() > 1000
    assert gap[accepted].max() <= 0
    # Control: the smallest sphere alone would not do.
    bare = np.array([smallest_sphere(t)[1] for t in c8[accepted][:3000]])
    outside = np.linalg.norm((c8[:, 0] + h - centre)[accepted][:3000], axis=1) > bare * (1 + 1e-6)
    assert outside.any()


@pytest.mark.parametrize(
    ("name", "triangle", "centre", "radius"),
    [
        ("point", [(1, 2, 3)] * 3, (1, 2, 3), 0),
        ("segment", [(0, 0, 0), (2, 0, 0), (2, 0, 0)], (1, 0, 0), 1),
        ("three in a row", [(0, 0, 0), (4, 0, 0), (1, 0, 0)], (2, 0, 0), 2),
        ("right", [(0, 0, 0), (6, 0, 0), (0, 8, 0)], (3, 4, 0), 5),
        ("obtuse", [(0, 0, 0), (8, 0, 0), (4, 1, 0)], (4, 0, 0), 4),
        ("acute", [(-4, 0, 0), (4, 0, 0), (0, 8, 0)], (0, 3, 0), 5),
    ],
)
def test_by_hand(name, triangle, centre, radius):
    for turn in range(3):
        c, r = enclosing_spheres(np.array([triangle[turn:] + triangle[:turn]], np.float32))
        assert np.allclose(c[0], centre, atol=1e-6), name
        assert radius <= r[0] <= radius * (1 + 1e-4), name


def test_an_extreme_sliver_is_never_culled_and_a_zero_area_triangle_has_a_plain_sphere():
    sliver = np.array([[(0, 0, 0), (1, 0, 0), (0.5, 1e-9, 0)]], np.float32)
    assert not pack_triangles(sliver).degenerate[0] and np.isinf(enclosing_spheres(sliver)[1][0])
    flat = np.array([[(0, 0, 0), (1, 0, 0), (0.5, 0, 0)]], np.float32)
    assert pack_triangles(flat).degenerate[0] and 0.5 <= enclosing_spheres(flat)[1][0] < 0.5000001


@pytest.mark.parametrize("shape", [(3, 3), (2, 4, 3)])
def test_wrong_shapes_are_refused(shape):
    with pytest.raises(InputError, match=r"\[n, 3, 3\]"):
        enclosing_spheres(np.zeros(shape, np.float32))
