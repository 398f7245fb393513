"""Needles that clipping cuts: corners rounded to the sub-pixel grid may fold a polygon that was convex.

Plan
- The ring of corners that is drawn equals the reference's for any polygon; it is convex, of the polygon's own facing,
  and all of it where nothing was folded.
- Clipped needles by the thousand (near plane, guard band, both): no pixel is covered twice by one of them, and all
  pieces of one face the same way; so culling one side and the other share them out without overlap.
- A needle of which two pieces covered one pixel, facing both ways, before rings were made convex.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from refsim.counters import Counters
from refsim.pipeline.clip import MOST_CORNERS, convex_ring
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import Framebuffer, VertexBuffer
from refsim.pipeline.taps import Taps
from refsim.reference import clip as reference
from tests.raster.drawing import BACKS, FRONTS, LIST, TARGETS, Corner

SIDE = 64


@njit(error_model="numpy")
def rings(corners, count, ring):
    """The device function."""
    return convex_ring(corners, count, ring)


def ring_of(points) -> list[int]:
    """The numbers of the corners that are kept."""
    corners = np.zeros((MOST_CORNERS, 4), np.float32)
    corners[: len(points), :2] = points
    ring = np.zeros(MOST_CORNERS, np.int64)
    return ring[: rings(corners, len(points), ring)].tolist()


def turns(points) -> list[int]:
    """Twice the areas of every three neighbours."""
    p = [tuple(int(v) for v in point) for point in points]
    triples = [(p[k - 2], p[k - 1], p[k]) for k in range(len(p))]
    return [(b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]) for a, b, c in triples]


grids = st.integers(-3, 3) | st.integers(-(2**23), 2**23)


@given(st.lists(st.tuples(grids, grids), min_size=3, max_size=MOST_CORNERS))
def test_the_ring_is_the_reference_s_and_convex(points):
    points = np.array(points, np.int64)
    ring = ring_of(points)
    assert ring == reference.convex_ring(points)
    if len(ring) > 2:
        found = turns(points[ring])
        assert all(turn > 0 for turn in found) or all(turn < 0 for turn in found)


@given(st.integers(3, MOST_CORNERS), st.integers(0, 2**31), st.booleans())
def test_a_convex_polygon_keeps_all_its_corners(count, seed, turned):
    angles = np.sort(np.random.default_rng(seed).choice(64, count, replace=False)) * (np.pi / 32)
    points = np.rint(np.stack([np.cos(angles), np.sin(angles)], axis=1) * 2**20).astype(np.int64)
    points = points[::-1] if turned else points
    assert ring_of(points) == list(range(count))


def needles(kind: str, count: int, seed: int) -> np.ndarray:
    """Clip positions f32[count, 3, 4] of needles that the planes cut."""
    rng = np.random.default_rng(seed)
    base, way = rng.uniform(-1, 1, (2, count, 1, 4))
    if kind == "guard band":
        position = base + rng.uniform(-3000, 3000, (count, 3, 1)) * way * [1, 1, 0, 0]
        position += rng.uniform(-0.05, 0.05, (count, 3, 4)) * [1, 1, 0, 0]
        position[..., 2:] = 0.5, 1
    else:
        width = 0.01 if kind == "near" else 0.003
        position = base + rng.uniform(-3, 3, (count, 3, 1)) * way + rng.uniform(-width, width, (count, 3, 4))
        position[..., 2:] += 0.3, 0.8
    return position.astype(np.float32)


def drawn(pipe, position, **options):
    """Target and taps of a draw."""
    n = 3 * len(position)
    vertices = VertexBuffer.of(Corner, position=position.reshape(n, 4), smooth=np.zeros(n), straight=np.zeros(n),
                               first=np.zeros(n), id=np.arange(n) // 3)  # fmt: skip
    target, counters, taps = Framebuffer(SIDE, SIDE, TARGETS), Counters(), Taps("raster", "fragment")
    draw(pipe, framebuffer=target, counters=counters, vertices=vertices, taps=taps, **options)
    counters.check()
    return target, counters, taps


@pytest.mark.parametrize("kind", ["near", "near and behind", "guard band"])
def test_a_needle_covers_no_pixel_twice_and_faces_one_way(kind):
    position = needles(kind, 20_000, 7)
    _, counters, taps = drawn(LIST, position)
    fragments, raster = taps.fragment[0], taps.raster[0]
    assert counters["raster.clipped_pieces"] > 5_000 and len(fragments.x) > 5_000
    places = np.stack([fragments.primitive, fragments.y, fragments.x])
    assert np.unique(places, axis=1).shape[1] == len(fragments.x)
    front, back = np.unique(raster.primitive[raster.front]), np.unique(raster.primitive[~raster.front])
    assert not np.intersect1d(front, back).size
    fronts, backs = drawn(FRONTS, position)[2].fragment[0], drawn(BACKS, position)[2].fragment[0]
    assert len(fronts.x) + len(backs.x) == len(fragments.x)


FOLDED = [
    (-0.11916026695484862, 0.7402019735180089, 1.2680881163900384, 1.2516908748505218),
    (0.10515874592073386, 0.1520147722586101, 0.8577260238963048, 1.2516908748505218),
    (0.031471429573421424, 0.3479291200495883, 0.9836919323225322, 1.2516908748505218),
]


@pytest.mark.parametrize("loop", ["dense", "list"])
def test_a_needle_that_folded(loop):
    target, counters, taps = drawn(LIST, np.array([FOLDED], np.float32), loop=loop)
    assert counters["raster.drawn"] == 1 and (target.invocations <= 1).all()
    assert len(np.unique(taps.raster[0].front)) == 1
