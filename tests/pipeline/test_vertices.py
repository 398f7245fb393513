"""How vertices reach their shader: indices, instances, step modes, counts, buffers of several kinds, none at all.

Plan
- Any index list draws what the same vertices written out would draw, in that order; every index is one invocation.
- Instances draw the stream again in whole, one after the other; a per-instance buffer advances with them and a
  per-vertex buffer does not.
- Without a per-vertex buffer vertex_count tells how many vertices there are (1 by default, 4 for quads).
- vertex_count draws the first vertices of a buffer alone; `count`, not capacity, bounds a buffer.
- Buffers refuse what does not fit, in one sentence; beside each a control.
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
from refsim.pipeline.draw import draw
from refsim.pipeline.layout import f32, i32, ivec2, vec2
from refsim.pipeline.resources import VertexBuffer
from refsim.pipeline.state import PrimitiveTopology, VertexBufferLayout, VertexState, VertexStepMode
from refsim.pipeline.taps import Taps
from tests.pipeline.pipelines import POOL, Flat
from tests.pipeline.scenes import assert_same, full_screen, random_scene, run, target_of

HALF = np.float32(0.5)
ONE = np.float32(1)


class Place(NamedTuple):
    """A per-vertex buffer: clip x, an integer pair."""

    x: f32
    pair: ivec2


class Kind(NamedTuple):
    """A per-instance buffer."""

    y: f32
    shade: vec2
    size: f32
    number: i32


@func
def stepping_vertex(u, t, attributes, vertex_index, instance_index):
    """A point from two buffers; its number says which rows it was given, and where it stands."""
    place, kind = attributes
    row = vertex_index * np.int32(100) + instance_index + np.int32(1)
    number = np.int32(kind.number + place.pair[0] - place.pair[1] + row)
    return (place.x, kind.y, HALF, ONE), kind.size, Flat(HALF, kind.shade, number)


@func
def bare_vertex(u, t, attributes, vertex_index, instance_index):
    """The corners of quad `vertex_index` // 4: the left or right half of the screen."""
    corner = vertex_index % 4
    right = (corner == 1) | (corner == 2)
    x = np.float32(vertex_index // 4) - (np.float32(0) if right else ONE)
    y = np.float32(2 * (corner // 2) - 1)
    shade = np.float32(vertex_index)
    return (x, y, HALF, ONE), ONE, Flat(HALF, (shade, shade), np.int32(vertex_index + 10 * instance_index + 1))


def with_vertex(shader, *layouts, quads=False):
    """The shared fragment stage behind another vertex stage."""
    topology = PrimitiveTopology.QUAD_LIST if quads else PrimitiveTopology.POINT_LIST
    return replace(POOL["nearest"], vertex=VertexState(shader, Flat, layouts), topology=topology)


STEPPING = with_vertex(stepping_vertex, VertexBufferLayout(Place), VertexBufferLayout(Kind, VertexStepMode.INSTANCE))
BARE = with_vertex(bare_vertex, quads=True)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**31), st.lists(st.integers(0, 9), max_size=40), st.integers(1, 3))
def test_indices_draw_the_vertices_they_name(seed, indices, instances):
    scene = random_scene(seed, count=60)
    scene = scene._replace(columns={name: column[:10] for name, column in scene.columns.items()})
    written_out = scene._replace(columns={name: column[indices] for name, column in scene.columns.items()})
    a, b = Taps(), Taps()
    named = run(POOL["nearest"], scene, indices=np.array(indices, np.uint8), instances=instances, taps=a)
    assert_same(named, run(POOL["nearest"], written_out, instances=instances, taps=b))
    assert named[1]["vertex.invocations"] == len(indices) * instances
    np.testing.assert_array_equal(a.vertex[0].position, b.vertex[0].position)
    np.testing.assert_array_equal(a.vertex[0].varyings["id"], b.vertex[0].varyings["id"])
    np.testing.assert_array_equal(a.fragment[0].primitive, b.fragment[0].primitive)


def stepping_buffers(vertices=5, instances=3):
    """Pixel columns 0 … vertices − 1, pixel rows 0 … instances − 1 of a 16 × 12 target; 100-capacity buffers."""
    place, kind = VertexBuffer(Place, 100), VertexBuffer(Kind, 100)
    place.floats[:], kind.floats[:] = np.nan, np.nan
    place.count, kind.count = vertices, instances
    v, k = np.arange(vertices), np.arange(instances)
    place.floats[0, :vertices], place.ints[:, :vertices] = (v + 0.5) / 8 - 1, [10 * v, 3 * v]
    kind.floats[:, :instances] = [1 - (k + 0.5) / 6, k, -k, np.ones(instances)]
    kind.ints[0, :instances] = 1000 * k
    return place, kind


@pytest.mark.parametrize(("instances", "count"), [(3, None), (1, None), (2, 4), (3, 0), (0, None)])
def test_step_modes(instances, count):
    scene = full_screen()
    framebuffer, counters = target_of(STEPPING, scene), Counters()
    draw(STEPPING, framebuffer=framebuffer, counters=counters, vertices=stepping_buffers(), vertex_count=count,
         instances=instances, uniforms=scene.rules, textures=scene.images, threads=1, loop="dense")  # fmt: skip
    columns = 5 if count is None else count
    rows, xs = np.meshgrid(np.arange(instances), np.arange(columns), indexing="ij")
    expected = np.full((12, 16), -7)
    expected[rows, xs] = 1000 * rows + 10 * xs - 3 * xs + 100 * xs + rows + 1
    np.testing.assert_array_equal(framebuffer.color("id")[0], expected)
    np.testing.assert_array_equal(framebuffer.color("color")[0, rows, xs], rows)
    assert counters["vertex.invocations"] == counters["raster.drawn"] == instances * columns


@pytest.mark.parametrize(("options", "quads", "halves"), [
    ({}, 1, 1),
    ({"vertex_count": 8}, 2, 2),
    ({"vertex_count": 7}, 1, 1),
    ({"vertex_count": 8, "instances": 2}, 4, 2),
    ({"indices": np.array([4, 5, 6, 7])}, 1, 1),
])  # fmt: skip
def test_draws_without_buffers(options, quads, halves):
    scene = full_screen()
    framebuffer, counters = target_of(BARE, scene), Counters()
    draw(BARE, framebuffer=framebuffer, counters=counters, uniforms=scene.rules, textures=scene.images, threads=1,
         loop="dense", **options)  # fmt: skip
    assert counters["raster.drawn"] == quads
    assert counters["raster.fragments"] == quads * 16 * 12 // 2
    assert (framebuffer.invocations > 0).mean() == halves / 2
    left = "indices" not in options
    assert (framebuffer.color("id")[0, :, 0] == (1 if left else -7)).all()
    assert (framebuffer.color("id")[0, :, 8] == (5 if halves == 2 or not left else -7)).all()


def test_vertex_count_draws_the_first_vertices():
    scene = random_scene(4)
    first = scene._replace(columns={name: column[:7] for name, column in scene.columns.items()})
    a, b = run(POOL["nearest"], scene, vertex_count=7, loop="dense"), run(POOL["nearest"], first, loop="dense")
    np.testing.assert_array_equal(a[0].ints, b[0].ints)
    assert dict(a[1]) == dict(b[1]) and a[1]["vertex.invocations"] == 7


COLUMNS = {"x": np.zeros(3), "pair": np.zeros((3, 2))}
BUFFERS = [
    ("control", COLUMNS, None),
    ("a field missing", {"x": np.zeros(3)}, "'pair' is missing"),
    ("an unknown field", {**COLUMNS, "z": np.zeros(3)}, "'z' is unknown; there are"),
    ("two lengths", {"x": np.zeros(3), "pair": np.zeros((2, 2))}, r"differ in length: \[2, 3\]"),
    ("too few components", {"x": np.zeros(3), "pair": np.zeros(3)}, "'pair' needs 2 components"),
    ("too many components", {"x": np.zeros((3, 2)), "pair": np.zeros((3, 2))}, "'x' needs 1 components"),
    ("no array", {"x": 1.0, "pair": np.zeros((3, 2))}, "'x'"),
    ("control: empty", {"x": np.zeros(0), "pair": np.zeros((0, 2))}, None),
    ("empty, too few components", {"x": np.zeros(0), "pair": np.zeros((0, 3))}, "'pair' needs 2 components"),
]


@pytest.mark.parametrize(("columns", "sentence"), [row[1:] for row in BUFFERS], ids=[row[0] for row in BUFFERS])
def test_vertex_buffer_row(columns, sentence):
    if sentence is None:
        buffer = VertexBuffer.of(Place, **columns)
        assert buffer.count == buffer.capacity == len(columns["x"])
    else:
        with pytest.raises(InputError, match=sentence):
            VertexBuffer.of(Place, **columns)
