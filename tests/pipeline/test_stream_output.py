"""Stream output: what is captured, in which order, and how much of it fits.

Plan
- Whatever the capacity and however full the buffer is, the records are the first whole primitives that fit, behind what
  was there, and the others are counted: every capacity from 0 to one too many, points and triangles.
- Without a geometry stage the assembled primitives are captured, strips as triangles, drawn at once or not.
- The tap holds what was captured by this draw alone.
- A draw that is refused or whose shader does not compile leaves the buffer as it was.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.jit import func
from refsim.pipeline import taps as taps_module
from refsim.pipeline.draw import draw
from refsim.pipeline.layout import i32, vec4
from refsim.pipeline.resources import VertexBuffer
from refsim.pipeline.state import FragmentState, Pipeline, StreamOutputState
from refsim.pipeline.taps import Taps
from refsim.reference.geometry_stage import assembled, captured, emitted
from tests.pipeline.geometry_pipelines import (
    MOST,
    POINTS,
    POOL,
    STRIPS,
    VERTEX,
    Codes,
    Color,
    Record,
    T,
    capture,
    drawing,
    number_fragment,
    seeds,
    target,
)

HALF = np.float32(0.5)
CUT = 0xFFFF


@settings(deadline=None, max_examples=80)
@given(st.sampled_from(["points", "strips"]), st.integers(0, 2**31), st.integers(0, 40), st.integers(0, 5),
       st.integers(1, 2))  # fmt: skip
def test_whole_primitives_that_fit_are_captured(name, seed, room, filled, threads):
    rng = np.random.default_rng(seed)
    pipe, buffer, table = POOL[name], seeds(5, rng), rng.integers(0, 3, (5, MOST))
    everything = capture(pipe, buffer, table)[0].records()
    size = pipe.rasterized.corners
    _, primitives = emitted(table.tolist(), pipe.rasterized.is_triangles)
    numbers = [tuple(range(size * k, size * k + size)) for k in range(len(primitives))]
    rows, overflowed = captured(numbers, room)
    out, counters = VertexBuffer(Record, filled + room), Counters()
    out.count = filled
    out.ints[0, :filled], out.floats[:, filled:] = -5, np.nan
    draw(pipe, vertices=buffer, uniforms=Codes(table.astype(np.int32)), stream_output=out, counters=counters,
         threads=threads)  # fmt: skip
    counters.check()
    assert out.rows == filled + len(rows) and out.overflowed == overflowed
    assert counters["stream_output.overflowed"] == overflowed
    assert counters["stream_output.generated"] == len(primitives)
    assert counters["stream_output.primitives"] == len(rows) // size
    got = out.records()
    assert (got["number"][:filled] == -5).all()
    assert got[filled:].tobytes() == everything[rows].tobytes()
    # Nothing is written where no whole primitive fits
    assert np.isnan(out.floats[:, out.rows :]).all()


@pytest.mark.parametrize("pipe", [POINTS, STRIPS], ids=["points", "triangles"])
def test_every_capacity(pipe):
    buffer, table = seeds(3), np.array([[1, 1, 1, 1, 2, 1, 1, 1], [0, 0, 1, 0, 0, 0, 0, 0], [1, 1, 1, 0, 0, 0, 0, 0]])
    size = pipe.rasterized.corners
    made = {1: 8 + 1 + 3, 3: 3 + 1 + 0 + 1}[size]
    everything = capture(pipe, buffer, table)[0].records()
    assert len(everything) == made * size
    for capacity in range(made * size + 2):
        out, counters = capture(pipe, buffer, table, capacity)
        fits = min(capacity // size, made)
        assert out.records().tobytes() == everything[: fits * size].tobytes()
        assert counters["stream_output.primitives"] == fits and out.overflowed == made - fits


def test_captures_append_and_overflow_adds_up():
    buffer, table, out = seeds(2), np.ones((1, MOST), np.int32), VertexBuffer(Record, 40)
    for captures, rows, overflowed in ((1, 16, 0), (2, 32, 0), (3, 40, 8), (4, 40, 24)):
        draw(POINTS, vertices=buffer, uniforms=Codes(table), stream_output=out, counters=Counters())
        assert (out.rows, out.overflowed) == (rows, overflowed), captures
    numbers = out.records()["number"]
    assert numbers.tolist() == [*range(16), *range(16), *range(8)]
    out.clear()
    assert (out.count, out.overflowed, len(out.records())) == (0, 0, 0)


class Plain(NamedTuple):
    """What is captured without a geometry stage."""

    number: i32
    position: vec4


def passing(topology, **state):
    """A pipeline that captures what it assembles."""
    return Pipeline(VERTEX, None, topology, stream_output=StreamOutputState(Plain), rasterizer_discard=True, **state)


@settings(deadline=None, max_examples=40)
@given(st.booleans(), st.lists(st.sampled_from([0, 1, 2, 3, CUT]), max_size=24), st.integers(1, 2), st.integers(0, 20))
def test_assembled_primitives_are_captured_without_a_geometry_stage(strips, stream, instances, capacity):
    topology = T.TRIANGLE_STRIP if strips else T.POINT_LIST
    stream = stream if strips else [index for index in stream if index != CUT]
    kept = [index for index in stream if index != CUT]
    buffer, out, counters, taps = seeds(4), VertexBuffer(Plain, capacity), Counters(), Taps("geometry", "stream_output")
    draw(passing(topology), vertices=buffer, indices=np.array(stream, np.uint16), instances=instances,
         stream_output=out, counters=counters, taps=taps)  # fmt: skip
    counters.check()
    primitives = assembled(topology.value, stream, CUT) * instances
    rows, overflowed = captured(numbered(primitives), capacity)
    flat = [kept[v] for one in primitives for v in one]
    per_instance = len(flat) // instances
    assert out.records()["number"].tolist() == [flat[r] + 1000 * (r // per_instance) for r in rows]
    assert out.overflowed == overflowed and counters["stream_output.generated"] == len(primitives)
    assert counters["geometry.invocations"] == 0 and not taps.geometry
    assert taps.stream_output[0].primitives.tolist() == list(range(len(rows) // topology.corners))


def numbered(primitives):
    """Primitives as runs of rows, in order."""
    rows = iter(range(sum(map(len, primitives))))
    return [tuple(next(rows) for _ in one) for one in primitives]


def test_captured_without_a_geometry_stage_and_drawn():
    rng = np.random.default_rng(8)
    buffer, stream = seeds(30, rng), rng.integers(0, 30, 60).astype(np.uint16)
    fragment = FragmentState(number_fragment, Color)
    pipe = replace(passing(T.POINT_LIST), fragment=fragment, rasterizer_discard=False)
    out, both, alone, counters = VertexBuffer(Plain, 50), target(), target(), Counters()
    taps, options = Taps("fragment"), {"vertices": buffer, "indices": stream}
    draw(pipe, framebuffer=both, stream_output=out, counters=counters, taps=taps, **options)
    draw(replace(pipe, stream_output=None), framebuffer=alone, counters=Counters(), taps=Taps("fragment"), **options)
    np.testing.assert_array_equal(both.ints, alone.ints)
    assert (both.ints != -7).any() and counters["raster.primitives"] == 60
    # A full buffer keeps no primitive from the rasteriser
    assert out.records()["number"].tolist() == stream[:50].tolist() and out.overflowed == 10
    # Without a geometry shader a fragment's vertices are those of the vertex tap: the places of the indices
    tap = taps.fragment[0]
    assert tap.vertices[:, 0].tolist() == list(range(60)) and set(tap.invocation) == {-1}
    np.testing.assert_array_equal(tap.outputs["number"], stream)


def test_the_tap_holds_what_this_draw_captured():
    table, out, taps = np.ones((1, MOST), np.int32), VertexBuffer(Record, 20), Taps("stream_output")
    for _ in range(2):
        draw(POINTS, vertices=seeds(2), uniforms=Codes(table), stream_output=out, counters=Counters(), taps=taps)
    first, second = taps.stream_output
    assert (first.first_row, second.first_row) == (0, 16)
    assert second.primitives.tolist() == [0, 1, 2, 3] and first.primitives.tolist() == list(range(16))
    records = out.records()
    for name in Record._fields:
        np.testing.assert_array_equal(first.records[name], records[name][:16])
        np.testing.assert_array_equal(second.records[name], records[name][16:])
    assert first.label == POINTS.label and not taps.geometry and not taps.vertex


@func
def broken_fragment(u, t, v, inputs, pixel):
    """Reads a varying that does not exist."""
    return True, HALF, Color(v.nothing)


@pytest.mark.parametrize("stage", ["geometry", "stream_output", "fragment", "shader"])
def test_a_draw_that_fails_leaves_the_buffer_as_it_was(monkeypatch, stage):
    pipe, table = drawing(POINTS), np.ones((1, MOST), np.int32)
    out, framebuffer, counters = VertexBuffer(Record, 30), target(), Counters()
    taps = Taps("vertex", *([stage] if stage != "shader" else []))
    if stage == "shader":
        message = "does not compile.*nothing"
        pipe = replace(pipe, fragment=FragmentState(broken_fragment, Color))
    else:
        message = "tapping 'point-list to point-list' would copy 16 records, more than 15"
        monkeypatch.setattr(taps_module, "MAX_TAPPED", 15)
    out.count = 3
    with pytest.raises(InputError, match=message):
        draw(pipe, vertices=seeds(2), uniforms=Codes(table), framebuffer=framebuffer, stream_output=out, taps=taps,
             counters=counters)  # fmt: skip
    assert (out.rows, out.overflowed, dict(counters)) == (3, 0, {})
    assert not (taps.vertex or taps.geometry or taps.stream_output or taps.fragment)
    assert (framebuffer.ints == -7).all() and not framebuffer.invocations.any()
    if stage != "shader":
        monkeypatch.setattr(taps_module, "MAX_TAPPED", 66)
        draw(pipe, vertices=seeds(2), uniforms=Codes(table), framebuffer=framebuffer, stream_output=out, taps=taps,
             counters=counters)  # fmt: skip
        assert out.rows == 19
