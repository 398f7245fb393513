"""What the raster and fragment taps say of triangles: corners, boxes, facing, depths, and the vertices they came from.

Plan
- Lists and strips, indexed or not, in several instances: the raster tap has a row for every triangle that is drawn, in
  submission order. Its corners are the snapped positions of the vertices it names (rows of the vertex tap), clockwise
  on the screen with the first first; its box holds every pixel that they cover; front, depth at the corners likewise.
  The vertex tap knows the row of the buffers and the instance of each invocation; restarts of a strip are none.
- The fragment tap names the same vertices: what its shader returned of flat varyings is the first one's. What the
  targets held after a fragment is what the last one at the pixel left.
- Pieces of a clipped triangle share its number, its vertices and its facing; as many as are counted.
- Taps change nothing: all of them together leave the bits and counters of none.
"""

import numpy as np
import pytest

from refsim.counters import Counters
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import Framebuffer
from refsim.pipeline.taps import Taps
from refsim.reference import clip, raster
from tests.raster.certainty import UNIT
from tests.raster.drawing import LIST, STRIP, TARGETS, Drawn, Screen, assert_same_bits, clip_positions, vertices_of
from tests.raster.test_clipping import combinations

SCREEN = Screen(40, 28, (1.5, 2.0, 36.0, 24.5, 0.25, 0.75))


def tapped(pipe, position, taps, *, indices=None, instances=1, **columns) -> Drawn:
    """A draw with any taps."""
    framebuffer, counters = Framebuffer(SCREEN.width, SCREEN.height, TARGETS), Counters()
    draw(
        pipe, framebuffer=framebuffer, counters=counters, vertices=vertices_of(position, **columns), indices=indices,
        instances=instances, dynamic=SCREEN.dynamic, taps=taps, threads=1,
    )  # fmt: skip
    counters.check()
    return Drawn(framebuffer, counters, None)


def some_vertices(seed=1, n=50):
    """Clip positions [n, 4] that need no clipping, and columns; numbers are the vertices'."""
    rng = np.random.default_rng(seed)
    position = clip_positions(
        SCREEN, rng.uniform(-4, 44, n), rng.uniform(-4, 32, n), rng.uniform(0.1, 0.9, n), rng.uniform(0.5, 2, n)
    )
    columns = {name: rng.normal(size=n).astype(np.float32) for name in ("smooth", "straight", "first")}
    return position, columns | {"id": np.arange(n)}


def clockwise(corners: np.ndarray) -> np.ndarray:
    """Corners [3, k], the last two exchanged if they go counter-clockwise on the screen."""
    return corners if raster.doubled_area(corners[:, :2]) > 0 else corners[[0, 2, 1]]


@pytest.mark.parametrize("indexed", [False, True], ids=["in order", "indexed"])
@pytest.mark.parametrize("pipe", [LIST, STRIP], ids=["list", "strip"])
def test_rows_are_the_vertices_they_name(pipe, indexed):
    position, columns = some_vertices()
    indices = np.random.default_rng(3).integers(0, 50, 41) if indexed else None
    stream = indices if indexed else np.arange(50)
    taps = Taps("vertex", "raster", "fragment")
    tapped(pipe, position, taps, indices=indices, instances=3, **columns)
    vertex, rows, fragments = taps.vertex[0], taps.raster[0], taps.fragment[0]
    np.testing.assert_array_equal(vertex.position, position[np.tile(stream, 3)])
    np.testing.assert_array_equal(vertex.vertex_index, np.tile(stream, 3))
    np.testing.assert_array_equal(vertex.instance_index, np.repeat(np.arange(3), len(stream)))
    per_instance = raster.list_triangles(len(stream)) if pipe is LIST else raster.strip_triangles(len(stream))
    named = np.concatenate([per_instance + k * len(stream) for k in range(3)])
    np.testing.assert_array_equal(rows.vertices, named[rows.primitive])
    np.testing.assert_array_equal(fragments.vertices, named[fragments.primitive])
    assert (np.diff(rows.primitive) > 0).all() and (rows.invocation == -1).all() and (fragments.invocation == -1).all()
    bounds = raster.pixels_of(SCREEN.viewport, SCREEN.scissor)
    drawn = []
    for k, three in enumerate(named):
        snapped = raster.corners_of(vertex.position[three], SCREEN.viewport)
        outside = clip.is_outside(vertex.position[three])
        if not outside and raster.doubled_area(snapped) != 0 and raster.holds_centre(snapped, bounds):
            drawn.append(k)
    np.testing.assert_array_equal(rows.primitive, drawn)
    for k, three in enumerate(rows.vertices):
        snapped = raster.corners_of(vertex.position[three], SCREEN.viewport)
        ndc, _ = raster.divide(vertex.position[three])
        depth = raster.window_depth(ndc, SCREEN.viewport)
        expected = clockwise(np.column_stack([snapped, depth]))
        np.testing.assert_array_equal(rows.corners[k], expected[:, :2])
        assert np.abs(rows.depth[k] - expected[:, 2]).max() <= 4 * UNIT
        assert rows.front[k] == raster.faces_front(snapped, "ccw")
        x0, y0, x1, y1 = rows.rect[k]
        y, x = np.nonzero(raster.coverage(snapped, (0, 0, SCREEN.width, SCREEN.height)))
        inside = (x >= bounds[0]) & (x < bounds[2]) & (y >= bounds[1]) & (y < bounds[3])
        boxed = (x >= x0) & (x < x1) & (y >= y0) & (y < y1)
        np.testing.assert_array_equal(boxed, inside)
    assert len(rows.primitive) > 20 and len(set(rows.front)) == 2
    first = fragments.vertices[:, 0]
    np.testing.assert_array_equal(fragments.outputs["id"], vertex.varyings["id"][first])
    np.testing.assert_array_equal(fragments.outputs["values"][:, 2], vertex.varyings["first"][first])


def test_restarts_are_no_vertices():
    position, columns = some_vertices(4)
    stream = np.array([0xFFFF, 3, 9, 4, 1, 0xFFFF, 0xFFFF, 7, 7, 30, 0xFFFF], np.uint16)
    taps = Taps("vertex")
    tapped(STRIP, position, taps, indices=stream, instances=2, **columns)
    assert taps.vertex[0].vertex_index.tolist() == [3, 9, 4, 1, 7, 7, 30] * 2
    assert taps.vertex[0].instance_index.tolist() == [0] * 7 + [1] * 7
    assert (taps.vertex[0].vertex_index.dtype, taps.vertex[0].instance_index.dtype) == (np.int64, np.int64)


def test_stored_is_what_the_last_fragment_left():
    position, columns = some_vertices(2)
    taps = Taps("fragment")
    target = tapped(LIST, position, taps, **columns).framebuffer
    tap = taps.fragment[0]
    for name in ("values", "id"):
        np.testing.assert_array_equal(tap.stored[name], tap.outputs[name])
    last = {(int(y), int(x)): k for k, (y, x) in enumerate(zip(tap.y, tap.x, strict=True))}
    assert len(last) > 300
    for (y, x), k in last.items():
        assert target.color("id")[0, y, x] == tap.stored["id"][k]
        assert (target.color("values")[:, y, x] == tap.stored["values"][k]).all()


def test_pieces_share_number_vertices_and_facing():
    position, columns = combinations(5)
    taps = Taps("vertex", "raster")
    drawn = tapped(LIST, position, taps, **columns)
    rows = taps.raster[0]
    assert (np.diff(rows.primitive) >= 0).all()
    np.testing.assert_array_equal(rows.vertices, 3 * rows.primitive[:, None] + np.arange(3))
    whole = [k for k in set(rows.primitive) if not clip.needs_clipping(position[k], SCREEN.viewport)]
    assert len(set(rows.primitive)) == drawn.counters["raster.drawn"]
    assert drawn.counters["raster.clipped_pieces"] == len(rows.primitive) - len(whole) > 500
    for k in set(rows.primitive):
        assert len(set(rows.front[rows.primitive == k])) == 1, k
    assert all(raster.doubled_area(corners) > 0 for corners in rows.corners.astype(np.int64))


def test_taps_change_nothing():
    position, columns = combinations(6)
    assert_same_bits(tapped(LIST, position, Taps(), **columns), tapped(LIST, position, None, **columns))
