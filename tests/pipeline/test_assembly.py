"""Which vertices make a primitive: the kernels' slots and the table of cut strips against a walk along the stream.

Plan
- Every topology and every length: the device functions give the primitives of the plain restatement, the NumPy
  numbering that taps use gives the same, and what is left over makes none.
- Strips with restarts anywhere (in front, at the end, several in a row, after one or two vertices): the same, and the
  vertices of the table are numbered as the indices that are left.
- A restart is a restart in strips alone, and only for the two types that have one: 0xFFFF in uint16, 0xFFFFFFFF in
  uint32; boundary rows beside it.
- Instances count on through the draw.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim.jit import specialise
from refsim.pipeline.assembly import SLOTS, assembled, restart_places
from refsim.pipeline.enums import PrimitiveTopology as T
from refsim.reference.geometry_stage import assembled as plain
from refsim.reference.geometry_stage import strip_triangles

CUT = 0xFFFF


def all_slots(table, primitives, corners, out):
    """Template: the slots of every primitive."""
    for p in range(primitives):
        for c in range(corners):
            out[p, c] = slot(table, p, c)  # noqa: F821


def slots(topology, assembly):
    """Slots of every primitive of an instance, from the device function."""
    out = np.full((assembly.primitives, topology.corners), -1, np.int64)
    specialise(all_slots, {"slot": SLOTS[topology]})(assembly.table, assembly.primitives, topology.corners, out)
    return out


def as_tuples(array):
    """Rows as a list of tuples."""
    return [tuple(row) for row in array.tolist()]


@pytest.mark.parametrize("topology", list(T))
def test_every_length_of_every_topology(topology):
    for vertices in range(14):
        assembly = assembled(topology, vertices)
        expected = plain(topology.value, range(vertices))
        assert assembly.vertices == vertices and assembly.primitives == len(expected)
        assert as_tuples(slots(topology, assembly)) == expected
        assert as_tuples(assembly.invocations(topology, np.arange(assembly.primitives))) == expected


indices = st.lists(st.sampled_from([0, 1, 2, 3, 4, 5, CUT]), max_size=40)


@given(indices)
def test_strips_are_cut_where_they_restart(stream):
    array = np.array(stream, np.uint16)
    assembly = assembled(T.TRIANGLE_STRIP, len(stream), restart_places(T.TRIANGLE_STRIP, array))
    expected = plain("triangle-strip", stream, CUT)
    assert assembly.vertices == len(stream) - stream.count(CUT)
    assert assembly.primitives == len(expected)
    assert as_tuples(slots(T.TRIANGLE_STRIP, assembly)) == expected
    assert as_tuples(assembly.invocations(T.TRIANGLE_STRIP, np.arange(assembly.primitives))) == expected


ROWS = [
    ("control: nothing to cut", T.TRIANGLE_STRIP, np.uint16, CUT - 1, 0),
    ("uint16", T.TRIANGLE_STRIP, np.uint16, CUT, 1),
    ("uint32", T.TRIANGLE_STRIP, np.uint32, 0xFFFFFFFF, 1),
    ("uint32 has another value", T.TRIANGLE_STRIP, np.uint32, CUT, 0),
    ("a signed type has none", T.TRIANGLE_STRIP, np.int32, -1, 0),
    ("int64 has none", T.TRIANGLE_STRIP, np.int64, 0xFFFFFFFF, 0),
    ("uint8 has none", T.TRIANGLE_STRIP, np.uint8, 0xFF, 0),
    ("a list of triangles has none", T.TRIANGLE_LIST, np.uint16, CUT, 0),
    ("a list of points has none", T.POINT_LIST, np.uint32, 0xFFFFFFFF, 0),
]


@pytest.mark.parametrize(("topology", "dtype", "value", "count"), [row[1:] for row in ROWS], ids=[r[0] for r in ROWS])
def test_what_is_a_restart(topology, dtype, value, count):
    places = restart_places(topology, np.array([1, 2, value, 4], dtype))
    assert places.tolist() == [2] * count


@given(indices, st.integers(1, 4))
def test_instances_count_on(stream, instances):
    array = np.array(stream, np.uint16)
    assembly = assembled(T.TRIANGLE_STRIP, len(stream), restart_places(T.TRIANGLE_STRIP, array))
    numbers = assembly.invocations(T.TRIANGLE_STRIP, np.arange(assembly.primitives * instances))
    once = plain("triangle-strip", stream, CUT)
    later = [tuple(k + copy * assembly.vertices for k in one) for copy in range(instances) for one in once]
    assert as_tuples(numbers) == later


def test_strip_triangles_wind_alike():
    # A zigzag: every triangle of it turns the same way round
    x, y = np.arange(9) * 0.5, np.arange(9) % 2
    areas = []
    for a, b, c in strip_triangles(range(9)):
        areas.append((x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a]))
    assert areas == [-1.0] * 7 and [one[0] for one in strip_triangles(range(9))] == list(range(7))
