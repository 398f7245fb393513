"""NamedTuples as columns and back: nested ones, vectors, integers; uniforms with arrays; classes defined right here.

Plan
- What is put into columns or rows comes out again, bit for bit, at any index, for any values.
- Fields are counted out in order: names with their path, kind, first column, size.
- Uniforms of nested NamedTuples, tuples, arrays, booleans and plain numbers arrive in the shaders as they were, beside
  nested varyings and outputs.
- What has no columns, or is no uniform, is refused in one sentence naming the field.
"""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.jit import func
from refsim.pipeline.draw import draw
from refsim.pipeline.layout import Layout, f32, i32, ivec2, ivec3, plain, shape_of, vec2, vec3, vec4
from refsim.pipeline.resources import Framebuffer
from refsim.pipeline.state import FragmentState, Pipeline, TextureFormat, VertexState


class Inner(NamedTuple):
    """Innermost."""

    weight: f32
    cell: ivec2


class Middle(NamedTuple):
    """One down, twice."""

    first: Inner
    axis: vec3
    second: Inner


class Outer(NamedTuple):
    """Floats and integers in turn, scalars of the Python kind too."""

    number: i32
    middle: Middle
    plane: vec4
    cells: ivec3
    real: float
    whole: int


LAYOUT = Layout.of(Outer)
get, put, get_row, put_row = LAYOUT.get, LAYOUT.put, LAYOUT.get_row, LAYOUT.put_row


@njit(error_model="numpy")
def through_columns(floats, ints, new_floats, new_ints):
    """Every value read from columns and put into rows, then back."""
    for i in range(floats.shape[1]):
        put_row(new_floats, new_ints, i, get(floats, ints, i))


@njit(error_model="numpy")
def through_rows(floats, ints, new_floats, new_ints):
    """Every value read from rows and put into columns."""
    for i in range(floats.shape[0]):
        put(new_floats, new_ints, i, get_row(floats, ints, i))


@settings(deadline=None)
@given(st.integers(0, 2**31), st.integers(1, 20))
def test_values_go_through_columns_and_rows_unchanged(seed, n):
    rng = np.random.default_rng(seed)
    floats = rng.integers(0, 2**32, (LAYOUT.floats, n), np.uint32).view(np.float32)
    floats[np.isnan(floats)] = np.nan
    ints = rng.integers(-(2**31), 2**31, (LAYOUT.ints, n)).astype(np.int32)
    rows, columns = (np.zeros((n, k), d) for k, d in ((LAYOUT.floats, np.float32), (LAYOUT.ints, np.int32)))
    through_columns(floats, ints, rows, columns)
    np.testing.assert_array_equal(rows.T.copy().view(np.uint32), floats.view(np.uint32))
    np.testing.assert_array_equal(columns.T, ints)
    again_floats, again_ints = np.zeros_like(floats), np.zeros_like(ints)
    through_rows(rows, columns, again_floats, again_ints)
    np.testing.assert_array_equal(again_floats.view(np.uint32), floats.view(np.uint32))
    np.testing.assert_array_equal(again_ints, ints)


def test_fields_are_counted_out_in_order():
    assert [(f.name, f.kind, f.first, f.size) for f in LAYOUT.fields] == [
        ("number", "i", 0, 1),
        ("middle.first.weight", "f", 0, 1),
        ("middle.first.cell", "i", 1, 2),
        ("middle.axis", "f", 1, 3),
        ("middle.second.weight", "f", 4, 1),
        ("middle.second.cell", "i", 3, 2),
        ("plane", "f", 5, 4),
        ("cells", "i", 5, 3),
        ("real", "f", 9, 1),
        ("whole", "i", 8, 1),
    ]
    assert (LAYOUT.floats, LAYOUT.ints) == (10, 9)


class Light(NamedTuple):
    """A nested uniform."""

    power: f32
    colors: tuple[vec2, vec2]


class Scene(NamedTuple):
    """Uniforms of every kind."""

    table: np.ndarray
    light: Light
    codes: np.ndarray
    on: bool
    offset: i32


class Carried(NamedTuple):
    """Nested varyings."""

    inner: Inner
    row: i32


class Shown(NamedTuple):
    """Nested outputs: targets are named with their path."""

    inner: Inner
    sums: vec2


@func
def row_vertex(u, t, attributes, vertex_index, instance_index):
    """A full-width row of pixels a vertex."""
    y = np.float32(1) - (np.float32(vertex_index) + np.float32(0.5)) * np.float32(0.5)
    inner = Inner(u.table[vertex_index, 1], (vertex_index, u.codes[vertex_index]))
    return (np.float32(0), y, np.float32(0), np.float32(1)), np.float32(1), Carried(inner, vertex_index)


@func
def uniform_fragment(u, t, v, inputs, pixel):
    """Sums of uniforms."""
    light = u.light.power if u.on else np.float32(-1)
    sums = (light * u.light.colors[0][1] + v.inner.weight, u.light.colors[1][0])
    return True, np.float32(0), Shown(Inner(v.inner.weight, (v.inner.cell[1], v.row + u.offset)), sums)


@pytest.mark.parametrize(("on", "offset"), [(True, 7), (False, np.int32(-2))])
def test_uniforms_and_nested_classes_arrive(on, offset):
    targets = {"inner.weight": TextureFormat.R32FLOAT, "inner.cell": TextureFormat.RG32SINT,
               "sums": TextureFormat.RG32FLOAT}  # fmt: skip
    framebuffer = Framebuffer(1, 4, targets)
    table = np.arange(8, dtype=np.float32).reshape(4, 2)
    uniforms = Scene(table, Light(0.5, ((1.0, 2.0), (3.0, 4.0))), np.array([9, 8, 7, 6], np.int32), on, offset)
    pipe = Pipeline(VertexState(row_vertex, Carried), FragmentState(uniform_fragment, Shown))
    draw(pipe, framebuffer=framebuffer, counters=Counters(), uniforms=uniforms, vertex_count=4, threads=1, loop="list")
    power = 0.5 if on else -1.0
    assert framebuffer.color("inner.weight")[0, :, 0].tolist() == [1, 3, 5, 7]
    assert framebuffer.color("inner.cell")[0, :, 0].tolist() == [9, 8, 7, 6]
    assert framebuffer.color("inner.cell")[1, :, 0].tolist() == [k + offset for k in range(4)]
    assert framebuffer.color("sums")[0, :, 0].tolist() == [2 * power + w for w in (1, 3, 5, 7)]
    assert framebuffer.color("sums")[1, :, 0].tolist() == [3] * 4


def test_plain_values_are_sized():
    value = plain(Scene(np.zeros(2), Light(0.5, ((1.0, 2.0), (3.0, 4.0))), np.zeros(1, np.int32), True, 3))
    assert type(value) is tuple and type(value[1]) is tuple
    assert (type(value[1][0]), type(value[3]), type(value[4])) == (np.float32, bool, np.int32)
    assert shape_of(value)[0] is None and shape_of(Light(0.5, ()))[0] is Light and plain(None) == ()


class Text(NamedTuple):
    """A field that has no columns."""

    name: str


class Mixed(NamedTuple):
    """A tuple of two kinds."""

    pair: tuple[f32, i32]


class Empty(NamedTuple):
    """A tuple of nothing."""

    pair: tuple[()]


@pytest.mark.parametrize(("cls", "sentence"), [
    (Text, "field 'name' of Text"),
    (Mixed, "field 'pair' of Mixed"),
    (Empty, "field 'pair' of Empty"),
    (int, "is not a NamedTuple class"),
    (tuple, "is not a NamedTuple class"),
])  # fmt: skip
def test_classes_without_columns_are_refused(cls, sentence):
    with pytest.raises(InputError, match=sentence):
        Layout.of(cls)


@pytest.mark.parametrize("value", ["text", [1, 2], {"a": 1}, ..., 2**40, -(2**31) - 1], ids=str)
def test_what_is_no_uniform_is_refused(value):
    assert plain((1, 2.0)) == (1, 2.0)
    with pytest.raises(InputError, match="uniform"):
        plain((value,))
