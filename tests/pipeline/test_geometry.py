"""The geometry stage: what is emitted, in which order, and how it becomes primitives.

Plan
- Any pattern of codes (0 to 8 vertices a primitive, gaps, strips ended anywhere), points, triangle lists and cut strips
  in, points and strips out: the captured records are those of the plain restatement, in its order.
- 1, 2 and 3 threads, slices of a few primitives: the same bits. A draw of many whole slices, in NumPy.
- The tap leads every emitted vertex back to its invocation, its entry and its vertices in the vertex tap, from which it
  is recomputed; a tap changes nothing.
- Instances and indices: primitives count on through the draw, and every index is an invocation.
- Entries of different types, no entries at all, no primitives at all.
- Rasterised: the pixels of points are those that the records say; captured and drawn at once is what either alone is;
  triangles of a strip cover what the same triangles drawn as a list cover, and know which output primitive they were.
- A shader that returns another number of entries than declared is named.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.jit import func
from refsim.pipeline import emission, stream_output
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import VertexBuffer
from refsim.pipeline.taps import Taps
from refsim.reference.geometry_stage import assembled
from tests.pipeline.geometry_pipelines import (
    MOST,
    POINTS,
    POOL,
    SIDE,
    STRIPS,
    Codes,
    T,
    as_records,
    capture,
    capturing,
    drawing,
    expected_records,
    mixed_geometry,
    record_of,
    seeds,
    target,
)

CUT = 0xFFFF
codes = st.lists(st.lists(st.sampled_from([0, 1, 1, 2]), min_size=MOST, max_size=MOST), min_size=1, max_size=12)


def flat(primitives):
    """Records of all primitives, one after the other."""
    return [row for one in primitives for row in one]


@settings(deadline=None, max_examples=60)
@given(st.sampled_from(["points", "strips", "list to strips"]), codes, st.integers(0, 30), st.integers(1, 2))
def test_any_pattern_is_emitted_in_order(name, table, count, instances):
    pipe, buffer = POOL[name], seeds(count)
    once = assembled(pipe.topology.value, range(count))
    primitives = [tuple((copy, v) for v in one) for copy in range(instances) for one in once]
    expected, vertices, out = expected_records(buffer, primitives, table, pipe)
    got, counters = capture(pipe, buffer, table, instances=instances)
    assert as_records(got.records()) == flat(expected)
    assert dict(counters) == {
        "draw.calls": 1,
        "vertex.invocations": count * instances,
        "assembly.primitives": len(primitives),
        "geometry.invocations": len(primitives),
        "geometry.vertices_out": len(vertices),
        "geometry.primitives_out": len(out),
        "stream_output.generated": len(out),
        "stream_output.primitives": len(out),
        "stream_output.overflowed": 0,
    }


@settings(deadline=None, max_examples=60)
@given(codes, st.lists(st.sampled_from([0, 1, 2, 3, 4, CUT]), max_size=30), st.integers(1, 3))
def test_indexed_strips_with_restarts(table, stream, instances):
    pipe, buffer = POOL["strip to points"], seeds(5)
    kept = [index for index in stream if index != CUT]
    once = assembled("triangle-strip", stream, CUT)
    primitives = [tuple((copy, kept[v]) for v in one) for copy in range(instances) for one in once]
    expected, vertices, _ = expected_records(buffer, primitives, table, pipe)
    got, counters = capture(pipe, buffer, table, indices=np.array(stream, np.uint16), instances=instances)
    assert as_records(got.records()) == flat(expected)
    assert counters["vertex.invocations"] == len(kept) * instances
    assert counters["geometry.invocations"] == counters["assembly.primitives"] == len(primitives)
    assert counters["geometry.vertices_out"] == len(vertices)


def small_slices(patch, rows):
    """Slices of very few primitives from here on."""
    patch.setattr(emission, "EMITTED_ROWS", rows)
    patch.setattr(emission, "SMALLEST_SLICE", 1)
    patch.setattr(stream_output, "SMALLEST_SLICE", 1)


@settings(deadline=None, max_examples=30)
@given(st.sampled_from(["points", "strips"]), st.integers(0, 2**31), st.integers(2, 3), st.sampled_from([1, 24]))
def test_threads_and_slices_are_not_seen(name, seed, threads, rows):
    rng = np.random.default_rng(seed)
    table, buffer, capacity = rng.integers(0, 3, (40, MOST)), seeds(25, rng), int(rng.integers(0, 300))
    whole, parts = Taps("geometry", "stream_output"), Taps("geometry", "stream_output")
    expected, counters = capture(POOL[name], buffer, table, capacity, taps=whole, instances=2)
    with pytest.MonkeyPatch.context() as patch:
        small_slices(patch, rows)
        got, again = capture(POOL[name], buffer, table, capacity, threads=threads, taps=parts, instances=2)
    assert got.records().tobytes() == expected.records().tobytes()
    assert dict(counters) == dict(again)
    a, b = whole.geometry[0], parts.geometry[0]
    for column in ("position", "point_size", "invocation", "entry", "vertices", "primitives"):
        np.testing.assert_array_equal(getattr(a, column), getattr(b, column))
    np.testing.assert_array_equal(whole.stream_output[0].primitives, parts.stream_output[0].primitives)


def test_small_slices_are_really_taken(monkeypatch):
    small_slices(monkeypatch, 24)
    sizes = []
    columns = emission._columns
    monkeypatch.setattr(emission, "_columns", lambda *a: sizes.append(a[2]) or columns(*a))
    capture(POINTS, seeds(50), np.ones((1, MOST)), threads=2)
    assert sizes == [1] * 50  # two slices a thread share its rows


def test_a_draw_of_many_slices():
    rng = np.random.default_rng(21)
    count = 3 * emission.EMITTED_ROWS // MOST + 77
    buffer, table = seeds(count, rng), rng.integers(0, 3, (count, MOST))
    places = np.argwhere(table > 0)
    got, counters = capture(POINTS, buffer, table, len(places) - 5, threads=2)
    np.testing.assert_array_equal(got.records()["place"], places[:-5])
    np.testing.assert_array_equal(got.records()["number"], places[:-5] @ [MOST, 1])
    assert got.overflowed == 5 and counters["geometry.vertices_out"] == len(places)


@settings(deadline=None, max_examples=30)
@given(st.sampled_from(["points", "strips", "strip to points"]), st.integers(0, 2**31))
def test_the_tap_leads_back_from_every_vertex(name, seed):
    rng = np.random.default_rng(seed)
    pipe, buffer, table = POOL[name], seeds(6, rng), rng.integers(0, 3, (7, MOST))
    options = {"instances": 2}
    if pipe.topology == T.TRIANGLE_STRIP:
        options["indices"] = rng.choice([0, 1, 2, 3, 4, 5, CUT], 20).astype(np.uint16)
    taps = Taps("vertex", "geometry")
    tapped, counters = capture(pipe, buffer, table, taps=taps, **options)
    plain, again = capture(pipe, buffer, table, **options)
    assert tapped.records().tobytes() == plain.records().tobytes() and dict(counters) == dict(again)
    vertex, tap = taps.vertex[0], taps.geometry[0]
    corners = pipe.topology.corners
    assert tap.vertices.shape == (len(tap.position), corners) and len(tap.entry) == counters["geometry.vertices_out"]
    assert tap.primitives.shape == (counters["geometry.primitives_out"], pipe.rasterized.corners)
    # Entry k is corner k mod corners, moved by k pixels: from the vertex tap alone
    parent = tap.vertices[np.arange(len(tap.entry)), tap.entry % corners]
    k = tap.entry
    moved = vertex.position[parent] + np.outer(2 * k / SIDE, [1, 0, 0, 0]).astype(np.float32)
    np.testing.assert_array_equal(tap.position, moved)
    np.testing.assert_array_equal(tap.point_size, vertex.point_size[parent] + k % 3)
    np.testing.assert_array_equal(tap.varyings["number"], vertex.varyings["number"][parent] * MOST + k)
    # The shader counts primitives within an instance, the tap counts runs within the draw
    each = max(counters["geometry.invocations"] // 2, 1)
    np.testing.assert_array_equal(tap.varyings["place"], np.stack([tap.invocation % each, k], axis=1))
    # Every invocation's entries are those that its codes emit, and they come in order
    emits = table[np.arange(counters["geometry.invocations"]) % each % 7] > 0
    np.testing.assert_array_equal(np.stack([tap.invocation, k], axis=1), np.argwhere(emits))
    numbers = tap.varyings["number"][tap.primitives].ravel()
    np.testing.assert_array_equal(numbers, tapped.records()["number"])


def test_entries_of_different_types():
    pipe, buffer = capturing(T.POINT_LIST, T.POINT_LIST, mixed_geometry, 3), seeds(6)
    got, counters = capture(pipe, buffer, [])
    places = [(1, 2)] * 6
    rows = []
    for p in range(6):
        rows.append((p, places[p], 1.0))
        rows += [(7, (p, 0), 2.0)] if p % 2 == 0 else []
        rows += [(0, (0, 0), 0.5)] if p % 3 == 0 else []
    found = got.records()
    sizes = found["point_size"].tolist()
    assert list(zip(found["number"].tolist(), map(tuple, found["place"].tolist()), sizes, strict=True)) == rows
    assert counters["geometry.vertices_out"] == 6 + 3 + 2


@func
def silent_geometry(u, t, vertices, primitive):
    """Emits nothing."""
    return ()


def test_a_shader_may_emit_nothing():
    pipe = capturing(T.POINT_LIST, T.TRIANGLE_STRIP, silent_geometry, 0)
    taps = Taps("geometry", "stream_output")
    got, counters = capture(pipe, seeds(5), [], taps=taps)
    assert len(got.records()) == counters["geometry.vertices_out"] == counters["geometry.primitives_out"] == 0
    assert counters["geometry.invocations"] == 5
    assert taps.geometry[0].primitives.shape == (0, 3) and taps.geometry[0].vertices.shape == (0, 1)
    assert taps.stream_output[0].records["position"].shape == (0, 4)


@pytest.mark.parametrize(("most", "cause"), [(MOST, None), (MOST - 1, "8"), (MOST + 1, "8")])
def test_a_shader_with_another_number_of_entries_is_named(most, cause):
    pipe = capturing(T.POINT_LIST, T.POINT_LIST, most=most)
    if cause is None:
        assert len(capture(pipe, seeds(1), np.ones((1, MOST)))[0].records()) == MOST
    else:
        with pytest.raises(InputError, match=f"point-list to point-list: .*compile: the geometry shader must.*{cause}"):
            capture(pipe, seeds(1), np.ones((1, MOST)))


def drawn(pipe, buffer, table, **options):
    """Draws to the target; returns it, the taps and the counters."""
    framebuffer, counters, taps = target(), Counters(), Taps("geometry", "raster", "fragment")
    draw(pipe, vertices=buffer, uniforms=Codes(np.asarray(table, np.int32)), framebuffer=framebuffer,
         counters=counters, taps=taps, **{"threads": 1, **options})  # fmt: skip
    counters.check()
    return framebuffer, taps, counters


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**31), st.integers(1, 2))
def test_points_are_drawn_where_they_were_captured(seed, threads):
    rng = np.random.default_rng(seed)
    pipe, buffer, table = drawing(POINTS), seeds(20, rng), rng.integers(0, 3, (9, MOST))
    out = VertexBuffer(pipe.stream_output.record, 500)
    with pytest.MonkeyPatch.context() as patch:
        small_slices(patch, int(rng.choice([8, 64, 2**18])))
        framebuffer, taps, counters = drawn(pipe, buffer, table, stream_output=out, threads=threads)
    assert out.records().tobytes() == capture(POINTS, buffer, table)[0].records().tobytes()
    alone = drawn(replace(pipe, stream_output=None), buffer, table)
    np.testing.assert_array_equal(framebuffer.ints, alone[0].ints)
    # Squares of 1, 2 or 3 pixels around the centre of a pixel, later ones over earlier ones
    expected, fragments = np.full((SIDE, SIDE), -7), 0
    for number, position, _, size, _ in as_records(out.records()):
        x, y = (position[0] + 1) * SIDE / 2, (1 - position[1]) * SIDE / 2
        first = [int(np.ceil(part - size / 2 - 0.5)) for part in (x, y)]
        square = expected[max(first[1], 0) : first[1] + int(size), max(first[0], 0) : first[0] + int(size)]
        square[:] = number
        fragments += square.size
    np.testing.assert_array_equal(framebuffer.color("number")[0], expected)
    assert counters["raster.primitives"] == counters["geometry.primitives_out"] == len(out.records())
    assert counters["raster.fragments"] == fragments == len(taps.fragment[0].primitive)
    assert_leads_back(taps)


def assert_leads_back(taps):
    """Fragments and raster primitives know the vertices that they were made of, and the run that emitted these."""
    emitted = taps.geometry[0]
    for tap in (taps.fragment[0], taps.raster[0]):
        np.testing.assert_array_equal(tap.vertices, emitted.primitives[tap.primitive])
        np.testing.assert_array_equal(np.broadcast_to(tap.invocation, tap.vertices.T.shape).T,
                                      emitted.invocation[tap.vertices])  # fmt: skip
    # The first vertex provokes: a fragment stores its number
    tap = taps.fragment[0]
    np.testing.assert_array_equal(tap.outputs["number"], emitted.varyings["number"][tap.vertices[:, 0]])


def test_a_draw_of_nothing():
    for pipe in (POINTS, drawing(POINTS)):
        out, counters = VertexBuffer(pipe.stream_output.record, 10), Counters()
        framebuffer = None if pipe.rasterizer_discard else target()
        draw(pipe, vertices=seeds(0), uniforms=Codes(np.ones((1, MOST), np.int32)), framebuffer=framebuffer,
             counters=counters, stream_output=out, taps=Taps())  # fmt: skip
        assert out.count == counters["geometry.invocations"] == counters["raster.primitives"] == 0


def test_strips_are_drawn_as_the_triangles_they_hold():
    rng = np.random.default_rng(3)
    buffer, table = seeds(30, rng), rng.integers(0, 3, (30, MOST))
    buffer.floats[1] += np.arange(30) % 4
    pipe = drawing(POOL["list to strips"])
    out = VertexBuffer(pipe.stream_output.record, 500)
    framebuffer, taps, counters = drawn(pipe, buffer, table, stream_output=out, threads=2)
    with pytest.MonkeyPatch.context() as patch:
        small_slices(patch, 16)
        again = drawn(pipe, buffer, table, stream_output=VertexBuffer(pipe.stream_output.record, 500), threads=2)
    np.testing.assert_array_equal(framebuffer.ints, again[0].ints)
    np.testing.assert_array_equal(taps.fragment[0].primitive, again[1].fragment[0].primitive)
    assert dict(counters) == dict(again[2]) and counters["raster.fragments"] > 0
    assert_leads_back(taps)
    assert_leads_back(again[1])
    assert counters["raster.primitives"] == len(out.records()) // 3


def test_the_restatement_knows_a_strip_by_hand():
    table = [[1, 0, 1, 1, 1, 2, 1, 1]]
    got, _ = capture(STRIPS, seeds(1), table)
    entries = [row[4][1] for row in as_records(got.records())]
    assert entries == [0, 2, 3, 2, 4, 3, 3, 4, 5]
    assert as_records(got.records())[0] == record_of(seeds(1), ((0, 0),), 0, 0)
