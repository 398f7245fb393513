"""How vertices become triangles and which of them stay: strips, indices, instances, first vertex, facing, viewport.

Plan
- A strip draws what the list of its triangles (i, i + 1, i + 2), odd ones (i, i + 2, i + 1), draws, for any number of
  vertices, fewer than three included: same coverage, values, flat values of vertex i, numbers. All wind alike: a strip
  whose first triangle shows its front is drawn whole where backs are culled.
- Indexed lists and strips draw what the vertices written out draw; a rest of one or two indices makes nothing.
- Instances draw the list again, one after the other; a strip starts anew with each.
- Front face × cull mode × winding: the table, with what is counted as culled; zero area shows no side that is drawn.
- No pixel outside the viewport or the scissor is written, however large the triangle; depth fills the depth range.
- A viewport beyond ±16,384 pixels is refused for triangles, who would leave the sub-pixel grid's range; at the limit
  every pixel is drawn.
- Fragments of overlapping triangles arrive in submission order; with LESS the nearest stays.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from refsim.errors import InputError
from refsim.pipeline.state import CullMode
from refsim.reference import raster
from tests.raster.drawing import (
    BACKS,
    CLOCKWISE,
    FRONTS,
    LIST,
    NEAREST,
    NOTHING,
    STRIP,
    Screen,
    assert_same_bits,
    clip_positions,
    rasterise,
)

SCREEN = Screen(32, 24)
COLUMNS = ("smooth", "straight", "first")
seeds = st.integers(0, 2**31)


def random_vertices(rng: np.random.Generator, n: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Clip positions [n, 4] all over the screen, and columns; numbers are the vertices'."""
    x, y = rng.uniform(-5, 37, n), rng.uniform(-5, 29, n)
    position = clip_positions(SCREEN, x, y, rng.uniform(0, 1, n), rng.uniform(0.5, 2, n))
    return position, {name: rng.normal(size=n) for name in COLUMNS} | {"id": np.arange(n)}


def written_out(position, columns, rows) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The vertices that `rows` name, in that order."""
    return position[rows], {name: column[rows] for name, column in columns.items()}


def assert_same_fragments(a, b) -> None:
    """Same fragments of the same primitives, with the same values and depths; same counters but for vertices run."""
    for name in ("primitive", "x", "y", "depth"):
        np.testing.assert_array_equal(getattr(a.fragments, name), getattr(b.fragments, name), err_msg=name)
    for name, values in a.fragments.outputs.items():
        assert values.tobytes() == b.fragments.outputs[name].tobytes(), name
    counts = ({**drawn.counters, "vertex.invocations": 0} for drawn in (a, b))
    assert next(counts) == next(counts)


@settings(max_examples=30)
@given(seeds, st.integers(0, 12))
@example(1, 0)
@example(1, 1)
@example(1, 2)
@example(1, 3)
def test_a_strip_draws_the_list_of_its_triangles(seed, n):
    position, columns = random_vertices(np.random.default_rng(seed), n)
    strip = rasterise(SCREEN, position, pipe=STRIP, **columns)
    rows = [(i, i + 1, i + 2) if i % 2 == 0 else (i, i + 2, i + 1) for i in range(n - 2)]
    np.testing.assert_array_equal(raster.strip_triangles(n), np.array(rows, int).reshape(-1, 3))
    position, columns = written_out(position, columns, np.array(rows, int).reshape(-1))
    assert_same_fragments(strip, rasterise(SCREEN, position, **columns))
    assert strip.counters["raster.primitives"] == max(n - 2, 0) and strip.counters["vertex.invocations"] == n
    np.testing.assert_array_equal(strip.fragments.outputs["id"], strip.fragments.primitive)


def test_a_strip_winds_alike():
    # A band of ten triangles that zigzags from left to right; its first goes counter-clockwise, or is turned to
    x = np.arange(12) * 2.5 + 1.0
    y = np.where(np.arange(12) % 2 == 0, 5, 18)
    for cull, total in [(CullMode.NONE, 10), (CullMode.BACK, 10), (CullMode.FRONT, 0)]:
        strip = replace(FRONTS, cull_mode=cull, topology=STRIP.topology)
        drawn = rasterise(SCREEN, clip_positions(SCREEN, x, y), pipe=strip)
        assert drawn.counters["raster.drawn"] == total == 10 - drawn.counters["raster.culled"]
        assert drawn.coverage.max() == (total > 0)


@settings(max_examples=20)
@given(seeds, st.lists(st.integers(0, 8), max_size=20), st.sampled_from([LIST, STRIP]))
def test_indices_draw_the_vertices_they_name(seed, indices, pipe):
    position, columns = random_vertices(np.random.default_rng(seed), 9)
    named = rasterise(SCREEN, position, pipe=pipe, drawn={"indices": np.array(indices, np.int32)}, **columns)
    position, columns = written_out(position, columns, np.array(indices, int))
    assert_same_fragments(named, rasterise(SCREEN, position, pipe=pipe, **columns))
    assert named.counters["vertex.invocations"] == len(indices)
    triangles = len(indices) // 3 if pipe is LIST else max(len(indices) - 2, 0)
    assert named.counters["raster.primitives"] == triangles


@pytest.mark.parametrize("pipe", [LIST, STRIP], ids=["list", "strip"])
@pytest.mark.parametrize("n", [7, 8, 9])
def test_instances_draw_again_from_the_start(pipe, n):
    position, columns = random_vertices(np.random.default_rng(n), n)
    drawn = rasterise(SCREEN, position, pipe=pipe, drawn={"instances": 3}, **columns)
    once = rasterise(SCREEN, position, pipe=pipe, **columns)
    triangles = n // 3 if pipe is LIST else n - 2
    assert drawn.counters["raster.primitives"] == 3 * triangles == 3 * once.counters["raster.primitives"]
    assert drawn.counters["vertex.invocations"] == 3 * n
    for instance in range(3):
        mine = drawn.fragments.primitive // triangles == instance
        np.testing.assert_array_equal(drawn.fragments.x[mine], once.fragments.x)
        np.testing.assert_array_equal(drawn.fragments.primitive[mine] % triangles, once.fragments.primitive)
        number = drawn.fragments.outputs["id"][mine]
        np.testing.assert_array_equal(number, once.fragments.outputs["id"] + 1_000_000 * instance)


@pytest.mark.parametrize("pipe", [LIST, STRIP], ids=["list", "strip"])
def test_flat_values_are_the_first_vertex_s(pipe):
    position, columns = random_vertices(np.random.default_rng(4), 60)
    drawn = rasterise(SCREEN, position, pipe=pipe, **columns)
    rows = raster.list_triangles(60) if pipe is LIST else raster.strip_triangles(60)
    first = rows[drawn.fragments.primitive, 0]
    assert len(first) > 1000
    np.testing.assert_array_equal(drawn.fragments.outputs["id"], first)
    np.testing.assert_array_equal(drawn.fragments.outputs["values"][:, 2], columns["first"][first].astype(np.float32))


COUNTER_CLOCKWISE = [(4, 4), (6, 20), (28, 12)]  # down, then right, then back: as seen with rows going down
ROWS = [
    # front face, culled side, drawn when counter-clockwise, when clockwise
    ("ccw", "none", LIST, True, True),
    ("ccw", "back", FRONTS, True, False),
    ("ccw", "front", BACKS, False, True),
    ("cw", "none", CLOCKWISE[CullMode.NONE], True, True),
    ("cw", "back", CLOCKWISE[CullMode.BACK], False, True),
    ("cw", "front", CLOCKWISE[CullMode.FRONT], True, False),
]


@pytest.mark.parametrize(("face", "cull", "pipe", "left", "right"), ROWS, ids=[f"{row[0]}-{row[1]}" for row in ROWS])
def test_facing_row(face, cull, pipe, left, right):
    assert (pipe.front_face, pipe.cull_mode) == (face, cull)
    for turn, stays in [(1, left), (-1, right)]:
        corners = np.array(COUNTER_CLOCKWISE)[::turn]
        position = clip_positions(SCREEN, *corners.T, 0.5, [0.5, 1, 2])
        snapped = raster.corners_of(position, SCREEN.viewport)
        assert raster.is_kept(raster.faces_front(snapped, face), cull) == stays
        drawn = rasterise(SCREEN, position, pipe=pipe, tap=False)
        assert (drawn.counters["raster.drawn"], drawn.counters["raster.culled"]) == (stays, not stays)
        assert (drawn.coverage.sum() > 100) == stays and drawn.coverage.any() == stays


def test_no_area_shows_nothing():
    position = clip_positions(SCREEN, [4, 20, 12], [4, 4, 4])
    for pipe in (LIST, FRONTS, BACKS):
        drawn = rasterise(SCREEN, position, pipe=pipe, tap=False)
        assert not drawn.coverage.any() and drawn.counters["raster.drawn"] == 0


VIEWS = [
    ("control: the whole target", None, None, (0, 0, 32, 24)),
    ("whole pixels", (4, 3, 20, 10), None, (4, 3, 24, 13)),
    ("borders on centres", (4.5, 3.5, 10.0, 8.0), None, (4, 3, 14, 11)),
    ("borders between", (4.75, 3.25, 10.5, 8.5), None, (5, 3, 15, 12)),
    ("beyond the target", (-6.0, 20.0, 60.0, 30.0), None, (0, 20, 32, 24)),
    ("a scissor inside", (2, 2, 28, 20), (6, 5, 9, 3), (6, 5, 15, 8)),
    ("a scissor across", (8, 8, 10, 10), (0, 0, 12, 24), (8, 8, 12, 18)),
    ("outside the target", (40, 3, 10, 10), None, (0, 0, 0, 0)),
    ("less than a pixel", (5.25, 5.25, 0.5, 0.5), None, (5, 5, 6, 6)),
]


@pytest.mark.parametrize("reach", [1.5, 1000.0, 1e6], ids=["near", "within the guard band", "beyond it"])
@pytest.mark.parametrize(("view", "cut", "covered"), [row[1:] for row in VIEWS], ids=[row[0] for row in VIEWS])
def test_nothing_is_written_outside_viewport_and_scissor(view, cut, covered, reach):
    screen = Screen(32, 24, (*view, 0.25, 0.75) if view else None, cut)
    corners = np.array([[-reach, -reach], [reach, -reach], [reach, reach], [-reach, reach]])
    position = np.concatenate([corners, np.tile([0.5, 1], (4, 1))], axis=1)[[0, 1, 2, 0, 2, 3]]
    x0, y0, x1, y1 = covered
    expected = np.zeros((24, 32), int)
    expected[y0:y1, x0:x1] = 1
    drawn = rasterise(screen, position)
    np.testing.assert_array_equal(drawn.coverage, expected)
    inside = expected.astype(bool)
    assert (drawn.framebuffer.color("id")[0][~inside] == NOTHING).all()
    assert (drawn.framebuffer.depth[~inside] == 1).all() and (drawn.framebuffer.depth[inside] == 0.5).all()
    assert_same_bits(rasterise(screen, position, tap=False, loop="dense"), drawn)


LIMITS = [
    ("control: at the limit", Screen(16384, 2), None),
    ("control: at the limit on the other side", Screen(8, 2, (-16384, 0, 16392, 2)), None),
    ("a pixel too wide", Screen(16385, 2), "±16384"),
    ("a pixel too far left", Screen(8, 2, (-16385, 0, 16393, 2)), "±16384"),
    ("a pixel too high", Screen(2, 8, (0, -16385, 2, 16393)), "±16384"),
]


@pytest.mark.parametrize(("screen", "sentence"), [row[1:] for row in LIMITS], ids=[row[0] for row in LIMITS])
def test_viewport_limit(screen, sentence):
    position = np.array([(-1, -1, 0.5, 1), (3, -1, 0.5, 1), (-1, 3, 0.5, 1)])
    if sentence is None:
        assert (rasterise(screen, position, tap=False).coverage == 1).all()
    else:
        with pytest.raises(InputError, match=sentence):
            rasterise(screen, position, tap=False)


def test_the_nearest_of_overlapping_triangles_stays():
    rng = np.random.default_rng(2)
    corners = rng.uniform(-10, 42, (60, 3, 2))
    z = rng.permutation(60)[:, None] / 64
    position = clip_positions(SCREEN, corners[..., 0], corners[..., 1], np.broadcast_to(z, (60, 3)))
    every, nearest = rasterise(SCREEN, position), rasterise(SCREEN, position, pipe=NEAREST)
    last, best = np.full((24, 32), NOTHING), np.full((24, 32), np.inf)
    winner = np.full((24, 32), NOTHING)
    for k in range(60):
        here = every.covered_by(k) > 0
        last[here] = k
        closer = here & (z[k] < best)
        best[closer], winner[closer] = z[k], k
    np.testing.assert_array_equal(every.framebuffer.color("id")[0], last)
    np.testing.assert_array_equal(nearest.framebuffer.color("id")[0], winner)
    assert_same_bits(rasterise(SCREEN, position, pipe=NEAREST, tap=False, loop="dense"), nearest)
