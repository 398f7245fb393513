"""Draw-auto: a draw takes what an earlier one captured, with no read-back between.

Plan
- A chain of passes from buffer to buffer, each drawing what the last one captured, equals the same chain on lists, and
  Python never asks for a count; buffers may run over, and run empty.
- A captured buffer is drawn as often as wanted; a count of one's own is checked against what it holds.
- `read_backs` counts what Python asks for after a capture; `clear` and a count that Python sets are no captures.
"""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.jit import func
from refsim.pipeline.draw import draw
from refsim.pipeline.layout import i32, vec2
from refsim.pipeline.resources import VertexBuffer
from refsim.pipeline.state import GeometryState, Pipeline, StreamOutputState, VertexBufferLayout, VertexState
from tests.pipeline.geometry_pipelines import T

HALF = np.float32(0.5)
ONE = np.float32(1)


class Walker(NamedTuple):
    """A particle, drawn and captured: how many steps it has left, and where it came from."""

    left: i32
    path: i32
    place: vec2


@func
def walker_vertex(u, t, attributes, vertex_index, instance_index):
    """A particle is its own varyings."""
    a = attributes[0]
    return (a.place[0], a.place[1], HALF, ONE), ONE, a


@func
def branching(u, t, vertices, primitive):
    """A particle with steps left becomes two, of one and of two steps fewer; one without vanishes."""
    p, size, v = vertices[0]
    one = Walker(np.int32(v.left - 1), np.int32(2 * v.path), v.place)
    two = Walker(np.int32(v.left - 2), np.int32(2 * v.path + 1), (v.place[1], v.place[0]))
    return (np.int32(v.left > 0), p, size, one), (np.int32(v.left > 1), p, size, two)


WALK = Pipeline(
    VertexState(walker_vertex, Walker, (VertexBufferLayout(Walker),)), None, T.POINT_LIST, label="walk",
    geometry=GeometryState(branching, Walker, T.POINT_LIST, 2), stream_output=StreamOutputState(Walker),
    rasterizer_discard=True,
)  # fmt: skip


def walked(state, room):
    """One pass on lists of (left, path, place)."""
    made = []
    for left, path, (x, y) in state:
        made += [(left - 1, 2 * path, (x, y))] if left > 0 else []
        made += [(left - 2, 2 * path + 1, (y, x))] if left > 1 else []
    return made[:room], max(len(made) - room, 0)


def rows_of(buffer):
    """Filled rows of a buffer of walkers."""
    got = buffer.records()
    return list(zip(got["left"].tolist(), got["path"].tolist(), map(tuple, got["place"].tolist()), strict=True))


def walkers(left, capacity):
    """A buffer that starts with one particle for every number of steps."""
    buffer = VertexBuffer(Walker, capacity)
    buffer.count = n = len(left)
    buffer.ints[:, :n] = [left, np.arange(n) + 1]
    buffer.floats[:, :n] = [np.arange(n), -np.arange(n)]
    return buffer


@settings(deadline=None, max_examples=40)
@given(st.lists(st.integers(0, 7), max_size=6), st.integers(6, 60), st.integers(1, 9))
def test_a_chain_of_passes_reads_nothing_back(left, capacity, passes):
    here, there = walkers(left, capacity), VertexBuffer(Walker, capacity)
    state = rows_of(here)
    invocations, overflowed, counters = 0, 0, Counters()
    for _ in range(passes):
        there.clear()
        draw(WALK, vertices=here, stream_output=there, counters=counters, threads=1)
        here, there = there, here
        invocations += len(state)
        state, lost = walked(state, capacity)
        overflowed += lost
    assert here.read_backs == there.read_backs == 0
    assert rows_of(here) == state and here.read_backs == 1
    assert counters["vertex.invocations"] == counters["geometry.invocations"] == invocations
    assert counters["stream_output.overflowed"] == overflowed


def test_a_captured_buffer_is_drawn_as_often_as_wanted():
    out = VertexBuffer(Walker, 100)
    draw(WALK, vertices=walkers([5, 3], 2), stream_output=out, counters=Counters())
    counters = Counters()
    for _ in range(3):
        draw(WALK, vertices=out, stream_output=VertexBuffer(Walker, 0), counters=counters)
    assert counters["vertex.invocations"] == 3 * out.rows == 12
    # A count of one's own is checked against what was captured
    draw(WALK, vertices=out, vertex_count=3, stream_output=VertexBuffer(Walker, 9), counters=counters)
    assert counters["vertex.invocations"] == 15
    with pytest.raises(InputError, match="vertex_count is 5, but there are 4 vertices"):
        draw(WALK, vertices=out, vertex_count=5, stream_output=VertexBuffer(Walker, 9), counters=counters)
    assert out.read_backs == 0


def test_what_counts_as_a_read_back():
    out = VertexBuffer(Walker, 10)
    assert (out.count, out.read_backs) == (0, 0)
    out.count = 3
    assert (out.count, out.read_backs) == (3, 0)
    out.clear()
    draw(WALK, vertices=walkers([2], 1), stream_output=out, counters=Counters())
    assert (out.rows, out.read_backs) == (2, 0)
    assert (out.count, out.read_backs) == (2, 1)
    assert len(out.records()) == out.read_backs == 2
    out.clear()
    assert (out.count, out.read_backs) == (0, 2)
    for value in (11, -1, True, 1.0):
        with pytest.raises(InputError, match="count must be a whole number from 0 to the capacity 10"):
            out.count = value
