"""What geometry stage and stream output refuse: one sentence that names the field, and nothing has happened.

Plan
- States that mean nothing are refused when the pipeline is made, each beside a control.
- A record's fields are looked up by name and type among the built-ins and the last stage's varyings.
- A draw refuses a buffer that is missing, needless, of other records, or shares memory with anything that it reads or
  draws to: vertex and instance buffers, uniforms, textures, indices, the framebuffer; the buffer stays as it was.
- Records of another type or shape make no buffer.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.pipeline import EMIT, EMIT_AND_END, SKIP
from refsim.pipeline.draw import draw
from refsim.pipeline.layout import f32, i32, ivec2, vec2, vec3, vec4
from refsim.pipeline.resources import Texture, VertexBuffer
from refsim.pipeline.state import CullMode, GeometryState, StreamOutputState, VertexBufferLayout, VertexStepMode
from refsim.pipeline.vertex_buffer import record_type
from tests.pipeline.geometry_pipelines import (
    MOST,
    POINTS,
    SIDE,
    VERTEX,
    Carried,
    Codes,
    Grown,
    Record,
    Seed,
    T,
    drawing,
    seeds,
    table_geometry,
    target,
)


def geometry(**changes):
    """The pipeline with another geometry state."""
    state = {"shader": table_geometry, "varyings": Grown, "output": T.POINT_LIST, "max_vertices": MOST, **changes}
    return {"geometry": GeometryState(**state)}


def plain(u, t, vertices, primitive):
    """No device function."""


STATES = [
    ("control", {}, None),
    ("control: as WebGPU spells it", geometry(output="triangle-strip"), None),
    ("control: no entries", geometry(max_vertices=0), None),
    ("control: the most entries", geometry(max_vertices=1024), None),
    ("one entry more", geometry(max_vertices=1025), "geometry.max_vertices must be a whole number, 0 to 1024"),
    ("fewer than none", geometry(max_vertices=-1), "geometry.max_vertices .* not -1"),
    ("half an entry", geometry(max_vertices=0.5), "geometry.max_vertices .* not 0.5"),
    ("a truth value", geometry(max_vertices=True), "geometry.max_vertices .* not True"),
    ("triangle lists out", geometry(output=T.TRIANGLE_LIST), "geometry.output is 'triangle-list'"),
    ("quads out", geometry(output=T.QUAD_LIST), "geometry.output is 'quad-list'"),
    ("lines out", geometry(output="line-strip"), "geometry.output is 'line-strip'; lines are left out"),
    ("nonsense out", geometry(output="fans"), "geometry.output is 'fans'; it must be one of"),
    ("no device function", geometry(shader=plain), "geometry shader .* is not marked"),
    ("quads in", {"topology": T.QUAD_LIST}, "topology quad-list cannot feed a geometry shader"),
    ("adjacency in", {"topology": "triangle-list-with-adjacency"}, "adjacency is left out"),
    ("quads captured", {"topology": T.QUAD_LIST, "geometry": None}, "stream_output captures points and triangles"),
    ("points culled", {"cull_mode": CullMode.BACK}, "cull_mode is for triangles; point-list"),
]


@pytest.mark.parametrize(("changes", "sentence"), [row[1:] for row in STATES], ids=[row[0] for row in STATES])
def test_state(changes, sentence):
    if sentence is None:
        assert replace(POINTS, **changes).stream_output is POINTS.stream_output
        return
    with pytest.raises(InputError, match=sentence) as refused:
        replace(POINTS, **changes)
    assert str(refused.value).startswith(f"{POINTS.label}: ") and "\n" not in str(refused.value)


def record(**fields):
    """A record class with these fields."""
    return NamedTuple("Made", list(fields.items()))


class Named(NamedTuple):
    """Varyings one of which has the name of a built-in."""

    position: vec3
    inner: Carried


RECORDS = [
    # Grown: place ivec2, weight f32, color vec2, number i32
    ("control: a varying", Grown, record(number=i32), None),
    ("control: built-ins", Grown, record(point_size=f32, position=vec4), None),
    ("control: the varyings themselves", Grown, Grown, None),
    ("control: a varying within a varying", Named, record(inner=record(number=i32)), None),
    ("another type within", Named, record(inner=record(number=f32)), "field 'inner.number' is f32, .* is i32"),
    ("unknown", Grown, record(number=i32, nothing=f32), "field 'nothing' is none of position, point_size, place"),
    ("a varying of another stage", Carried, record(place=ivec2), "field 'place' is none of .*, color, number"),
    ("another kind", Grown, record(number=f32), "field 'number' is f32, what is captured is i32"),
    ("another size", Grown, record(color=vec3), "field 'color' is vec3, what is captured is vec2"),
    ("half a position", Grown, record(position=vec2), "field 'position' is vec2, what is captured is vec4"),
    ("an integer size", Grown, record(point_size=i32), "field 'point_size' is i32, what is captured is f32"),
    ("whole for float", Grown, record(color=ivec2), "field 'color' is ivec2, what is captured is vec2"),
    ("two of a name", Named, record(position=vec4), "'position' could be the built-in or the varying"),
    ("nothing", Grown, record(), "record Made has no field"),
    ("no class", Grown, 5, "5 is not a NamedTuple class"),
    ("no columns", Grown, record(number=str), "field 'number' of Made has type"),
]


@pytest.mark.parametrize(("varyings", "made", "sentence"), [r[1:] for r in RECORDS], ids=[r[0] for r in RECORDS])
def test_record(varyings, made, sentence):
    changes = {**geometry(varyings=varyings), "stream_output": StreamOutputState(made)}
    if sentence is None:
        assert replace(POINTS, **changes).stream_output.record is made
        return
    with pytest.raises(InputError, match=sentence):
        replace(POINTS, **changes)


def test_without_a_geometry_stage_the_vertex_stage_is_captured():
    changes = {"geometry": None, "stream_output": StreamOutputState(Carried)}
    assert replace(POINTS, **changes).last_varyings is Carried
    with pytest.raises(InputError, match="field 'place' is none of position, point_size, color, number"):
        replace(POINTS, geometry=None, stream_output=StreamOutputState(Grown))


class Both(NamedTuple):
    """A texture beside the codes."""

    table: np.ndarray
    more: tuple[np.ndarray, ...]


class Images(NamedTuple):
    """A texture of the draw."""

    image: Texture


class Depths(NamedTuple):
    """Two columns of floats, captured."""

    position: vec4
    point_size: f32
    color: vec2


OUT = VertexBuffer(Record, 40)
TABLE = np.ones((1, MOST), np.int32)
TARGET = target()
SHARED = "stream_output shares memory with the "


def alias_of(array):
    """A buffer of `Record` whose float columns lie in `array`."""
    buffer = VertexBuffer(Record, 10)
    buffer.floats = array.reshape(-1)[:70].view(np.float32).reshape(7, 10)
    return buffer


SELF = replace(
    POINTS,
    vertex=replace(VERTEX, buffers=(VertexBufferLayout(Seed), VertexBufferLayout(Record, VertexStepMode.INSTANCE))),
)
INDICES = np.arange(70, dtype=np.int32)
DRAWS = [
    ("control", POINTS, {}, None),
    ("control: no capture", replace(drawing(POINTS), stream_output=None),
     {"framebuffer": TARGET, "stream_output": None}, None),
    ("no buffer", POINTS, {"stream_output": None}, "stream_output must be a VertexBuffer .* not NoneType"),
    ("no vertex buffer", POINTS, {"stream_output": OUT.floats}, "must be a VertexBuffer .* not ndarray"),
    ("nothing to capture", replace(drawing(POINTS), stream_output=None),
     {"framebuffer": TARGET}, "no stream_output state"),
    ("other records", POINTS, {"stream_output": VertexBuffer(Seed, 9)}, "records of Record, a buffer of Seed was"),
    ("the buffer being drawn", replace(POINTS, stream_output=StreamOutputState(Carried), geometry=None,
     vertex=replace(VERTEX, buffers=(VertexBufferLayout(Carried),))), "self", "a vertex buffer that the draw reads"),
    ("an instance buffer", SELF, {"vertices": (seeds(2), OUT), "instances": 0}, "a vertex buffer that the draw reads"),
    ("a vertex buffer's memory", POINTS, "memory", "a vertex buffer that the draw reads"),
    ("a uniform", POINTS, {"uniforms": Codes(OUT.ints)}, SHARED + "uniforms"),
    ("within a uniform", POINTS, {"uniforms": Both(TABLE, (OUT.floats[:, 3:5],))}, SHARED + "uniforms"),
    ("a texture", POINTS, {"textures": Images(Texture(OUT.floats.reshape(7, 5, 8)))}, SHARED + "textures"),
    ("the indices", POINTS,
     {"vertices": seeds(70), "indices": INDICES, "stream_output": alias_of(INDICES)}, SHARED + "indices"),
    ("a target", drawing(POINTS), {"framebuffer": TARGET, "stream_output": alias_of(TARGET.ints)}, SHARED + "frameb"),
    ("the depths", drawing(POINTS),
     {"framebuffer": TARGET, "stream_output": alias_of(TARGET.depth)}, SHARED + "frameb"),
    ("the invocations", drawing(POINTS),
     {"framebuffer": TARGET, "stream_output": alias_of(TARGET.invocations)}, SHARED + "frameb"),
]  # fmt: skip


@pytest.mark.parametrize(("pipe", "changes", "sentence"), [row[1:] for row in DRAWS], ids=[row[0] for row in DRAWS])
def test_draw(pipe, changes, sentence):
    counters = Counters()
    if changes == "self":
        buffer = VertexBuffer(Carried, 4)
        changes = {"vertices": buffer, "stream_output": buffer}
    elif changes == "memory":
        buffer = seeds(70)
        changes = {"vertices": buffer, "stream_output": alias_of(buffer.floats)}
    options = {"vertices": seeds(2), "uniforms": Codes(TABLE), "stream_output": OUT, **changes}
    OUT.count = 7
    if sentence is None:
        draw(pipe, counters=counters, **options)
        assert OUT.rows == (7 if options["stream_output"] is None else 23)
        return
    with pytest.raises(InputError, match=sentence) as refused:
        draw(pipe, counters=counters, **options)
    assert str(refused.value).startswith(f"{POINTS.label}: ")
    assert (OUT.rows, OUT.overflowed, OUT.read_backs, dict(counters)) == (7, 0, 0, {})


def test_a_draw_needs_a_framebuffer_unless_it_discards():
    with pytest.raises(InputError, match="framebuffer must be a Framebuffer, not NoneType"):
        draw(drawing(POINTS), counters=Counters(), vertices=seeds(1), uniforms=Codes(TABLE), stream_output=OUT)
    framebuffer = target()
    counters = Counters()
    OUT.clear()
    draw(replace(POINTS, fragment=None), counters=counters, vertices=seeds(1), uniforms=Codes(TABLE),
         stream_output=OUT, framebuffer=None)  # fmt: skip
    assert OUT.rows == MOST and counters["raster.primitives"] == 0
    assert (framebuffer.ints == -7).all() and framebuffer.width == SIDE


def test_records_are_packed_in_order_and_come_back():
    buffer = VertexBuffer(Record, 5)
    buffer.count = 3
    buffer.floats[:], buffer.ints[:] = np.arange(35).reshape(7, 5), -np.arange(15).reshape(3, 5)
    records = buffer.records()
    assert records.dtype == np.dtype({
        "names": ["number", "position", "color", "point_size", "place"],
        "formats": ["<i4", ("<f4", 4), ("<f4", 2), "<f4", ("<i4", 2)],
        "offsets": [0, 4, 20, 28, 32],
        "itemsize": 40,
    })  # fmt: skip
    words = np.frombuffer(records.tobytes(), "<i4").reshape(3, 10)
    floats = words[:, 1:8].copy().view("<f4")
    np.testing.assert_array_equal(words[:, [0, 8, 9]], buffer.ints[:, :3].T)
    np.testing.assert_array_equal(floats, buffer.floats[:, :3].T)
    again = VertexBuffer.of_records(Record, records)
    assert again.capacity == again.rows == 3 and again.records().tobytes() == records.tobytes()


ARRAYS = [
    ("control", np.zeros(4, record_type(Record)), None),
    ("control: none", np.zeros(0, record_type(Record)), None),
    ("other records", np.zeros(4, record_type(Seed)), "records of Record are a row of"),
    ("two rows of them", np.zeros((2, 2), record_type(Record)), r"not .* of shape \(2, 2\)"),
    ("numbers", np.zeros((4, 10), np.float32), r"not float32 of shape \(4, 10\)"),
    ("no array", [1, 2], "not list"),
]


@pytest.mark.parametrize(("array", "sentence"), [row[1:] for row in ARRAYS], ids=[row[0] for row in ARRAYS])
def test_of_records(array, sentence):
    if sentence is None:
        assert VertexBuffer.of_records(Record, array).rows == len(array)
        return
    with pytest.raises(InputError, match=sentence):
        VertexBuffer.of_records(Record, array)


def test_the_codes_are_those_that_are_written_down():
    codes = (SKIP, EMIT, EMIT_AND_END)
    assert codes == (0, 1, 2) and {type(code) for code in codes} == {np.int32}


@pytest.mark.parametrize("code", [3, -1, 7, 2**31 - 1])
def test_emissions_that_mean_nothing(code):
    table = np.zeros((4, MOST), np.int32)
    table[2, 5] = code
    buffer, out, counters, codes = seeds(4), VertexBuffer(Record, 40), Counters(), Codes(table)
    with pytest.raises(InputError, match=r"returned 1 emissions that are neither SKIP \(0\) nor EMIT \(1\) nor"):
        draw(POINTS, vertices=buffer, stream_output=out, counters=counters, uniforms=codes)
    assert out.rows == out.overflowed == 0 and not dict(counters)
    table[2, 5] = EMIT_AND_END
    draw(POINTS, vertices=buffer, stream_output=out, counters=counters, uniforms=codes)
    assert out.rows == 1
