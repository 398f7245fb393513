"""The geometry stage: runs the vertex and geometry shaders over assembled primitives and appends what they emit.

`amplify` is a template (see `refsim.jit.specialise`). Entries that a geometry shader returns are taken in order; each
either becomes the next emitted vertex or nothing. Emitted vertices become primitives: points one each; in a strip every
vertex after the first two makes a triangle with the two before it, odd ones turned so that all wind alike, and a new
invocation starts a new strip. Invocations are counted once a primitive; vertices shared by primitives are shaded for
each, which is seen nowhere. Sources: OpenGL 4.6 section 11.3, Direct3D 11.3 functional specification section 13.
"""

# ruff: noqa: F821
from __future__ import annotations

import numpy as np

from refsim.jit import borrowed, func
from refsim.pipeline.enums import PrimitiveTopology
from refsim.pipeline.layout import Layout, device_function
from refsim.pipeline.state import GeometryState, Pipeline

I = np.int32  # noqa: E741
U = np.uintp

# What a geometry shader says of an entry: nothing, a vertex, a vertex that ends its strip
SKIP, EMIT, EMIT_AND_END = np.int32(0), np.int32(1), np.int32(2)


def amplify(
    uniforms, textures, buffers, indices, table, per_instance, first, count, position, size, VF, VI, origin,
    corners, totals,
):  # fmt: skip
    """Runs primitives [first, first + count) of the draw.

    `per_instance` primitives make an instance; `table` as in `refsim.pipeline.assembly`.
    Emitted vertices go to the rows of `position` f32[c, 4], `size` f32[c], `VF` f32[c, k], `VI` i32[c, k] and `origin`
    i32[c] (entry, counted from the first one of this call); triangles to `corners` i32[c, 3], as rows of these.
    `totals` i64[3] receives the numbers of vertices, of primitives and of emissions that mean nothing. There is room
    for every entry (c).
    """
    u = rebuild_uniforms(borrowed(uniforms))
    t = rebuild_textures(borrowed(textures))
    buffers = borrowed(buffers)
    rows, made, wrong = np.int64(0), np.int64(0), np.int64(0)
    done = np.int64(0)
    while done < count:
        # A run of primitives of one instance
        primitive = first + done
        instance = primitive // per_instance
        start = primitive - instance * per_instance
        run = min(per_instance - start, count - done)
        for j in range(run):
            vertices = assemble(u, t, buffers, indices, table, start + j, instance)
            entries = geometry_shader(u, t, vertices, I(start + j))
            wrong += odd_emissions(entries)
            rows, made = append(entries, (done + j) * MOST, rows, made, position, size, VF, VI, origin, corners)
        done += run
    totals[0], totals[1], totals[2] = rows, made, wrong


def amplify_slots(emission: GeometryState, topology: PrimitiveTopology, shade):
    """The slots of `amplify` but for the rebuilders; `shade` as `refsim.pipeline.vertex.corner_shader` makes it."""
    return {
        "assemble": assembler(topology, shade),
        "geometry_shader": emission.shader,
        "append": appender(Layout.of(emission.varyings), emission.output, emission.max_vertices),
        "odd_emissions": odd_counter(emission.max_vertices),
        "MOST": emission.max_vertices,
    }


def assembler(topology: PrimitiveTopology, shade):
    """Device function that runs the vertex shader on the corners of a primitive: one result each, in a tuple."""
    arguments = "u, t, buffers, indices, table, start, instance"
    corners = " ".join(f"shade({arguments}, {k})," for k in range(topology.corners))
    return device_function(f"def assemble({arguments}):\n    return ({corners})\n", "assemble", {"shade": shade})


def appender(varyings: Layout, output: PrimitiveTopology, most: int):
    """Device function that appends the `most` entries of an invocation, whose types may differ, one after the other."""
    place = device_function(_PLACE, "place", {"put_varyings": varyings.put_row, "U": U, "I": I})
    joined = joined_strip if output.is_triangles else joined_points
    steps = "\n".join(
        f"    place(e{k}, number + {k}, rows, position, size, VF, VI, origin)\n"
        f"    rows, made, run = joined(e{k}[0], rows, made, run, corners)"
        for k in range(most)
    )
    source = (
        "def append(entries, number, rows, made, position, size, VF, VI, origin, corners):\n"
        f"    {unpacking(most)}\n    run = I(0)\n{steps}\n    return rows, made\n"
    )
    return device_function(source, "append", {"place": place, "joined": joined, "I": I})


def odd_counter(most: int):
    """Device function ``odd(entries)``: how many say neither `SKIP` nor `EMIT` nor `EMIT_AND_END`."""
    parts = [f"neither(e{k}[0])" for k in range(most)]
    source = f"def odd(entries):\n    {unpacking(most)}\n    return {' + '.join(parts or ['0'])}\n"
    return device_function(source, "odd", {"neither": neither})


def unpacking(most: int) -> str:
    """The statement that takes the entries apart; a tuple of another length does not compile."""
    return f"{', '.join(f'e{k}' for k in range(most))}, = entries" if most else "() = entries"


@func
def neither(emission):
    """1 for an emission that means nothing."""
    return np.int64((emission != SKIP) & (emission != EMIT) & (emission != EMIT_AND_END))


# The next row always has room, so an entry is stored first and then kept or not: no branch that the processor misses
_PLACE = """
def place(entry, number, rows, position, size, VF, VI, origin):
    _, p, s, varyings = entry
    i = U(rows)
    x, y, z, w = p
    position[i, 0], position[i, 1], position[i, 2], position[i, 3] = x, y, z, w
    size[i] = s
    origin[i] = I(number)
    put_varyings(VF, VI, i, varyings)
"""


@func
def joined_points(emission, rows, made, run, corners):
    """A row was placed: numbers of rows and points with it, if it was emitted."""
    emitted = np.int64(emission != SKIP)
    return rows + emitted, made + emitted, run


@func
def joined_strip(emission, rows, made, run, corners):
    """A row was placed: numbers of rows and triangles with it, if it was emitted, and of vertices of the open strip."""
    emitted = emission != SKIP
    odd = np.int64(run & I(1))
    i = U(made)
    corners[i, 0], corners[i, 1], corners[i, 2] = I(rows - 2), I(rows - 1 + odd), I(rows - odd)
    made += np.int64(emitted & (run >= I(2)))
    rows += np.int64(emitted)
    return rows, made, I(0) if emission == EMIT_AND_END else I(run + I(emitted))


def emission_of(pipeline: Pipeline) -> GeometryState | None:
    """The pipeline's geometry stage. Where stream output captures without one, a stage that passes primitives on."""
    if pipeline.geometry is not None or pipeline.stream_output is None:
        return pipeline.geometry
    topology = pipeline.topology
    output = PrimitiveTopology.TRIANGLE_STRIP if topology.is_triangles else PrimitiveTopology.POINT_LIST
    return GeometryState(passer(topology), pipeline.vertex.varyings, output, topology.corners)


def passer(topology: PrimitiveTopology):
    """The geometry shader that emits the primitive it is given."""
    corners = range(topology.corners)
    entries = " ".join(f"(EMIT, vertices[{k}][0], vertices[{k}][1], vertices[{k}][2])," for k in corners)
    source = f"def passed(u, t, vertices, primitive):\n    return ({entries})\n"
    return device_function(source, "passed", {"EMIT": EMIT})


def emitted_slots(varyings: Layout, fetch):
    """The slots of `refsim.pipeline.vertex.front_end`, but for the rebuilders, that let it take emitted points."""
    slots = {"fetch": fetch, "vertex_shader": emitted_vertex, "put_varyings": varyings.put_row}
    return {**slots, "INDEXED": False, "CORNERS": 1}


def emitted_fetcher(varyings: Layout):
    """Device function ``fetch(buffers, row, instance)``: an emitted vertex, from ``((position, size), (VF, VI))``."""
    source = (
        "def fetch(buffers, row, instance):\n"
        "    p = buffers[0][0]\n"
        "    varyings = get_varyings(buffers[1][0], buffers[1][1], row)\n"
        "    return (p[row, 0], p[row, 1], p[row, 2], p[row, 3]), buffers[0][1][row], varyings\n"
    )
    return device_function(source, "fetch", {"get_varyings": varyings.get_row})


@func
def emitted_vertex(u, t, vertex, vertex_index, instance_index):
    """The vertex shader of what was emitted: nothing is left to do."""
    return vertex
