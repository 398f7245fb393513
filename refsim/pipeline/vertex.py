"""The vertex stage: positions first, in SIMD; then varyings, only for primitives that survive clipping.

`front_end` is a template (see `refsim.jit.specialise`): the free names in its body are slots that a draw fills in. A
vertex shader is evaluated once for its position and, for the first vertex of a surviving primitive, once more for its
varyings (flat interpolation takes the first vertex, WebGPU's default). Invocations are counted once a vertex and
instance, whatever is evaluated. Indexed draws count each index: no vertex cache is modelled.
"""

# ruff: noqa: F821
from __future__ import annotations

import numpy as np

from refsim.jit import borrowed
from refsim.pipeline.layout import Layout, device_function
from refsim.pipeline.raster import CLIPPED, CROOKED, DRAWN, EMPTY, rasterise_points, rasterise_quads
from refsim.pipeline.state import VertexBufferLayout, VertexStepMode

BLOCK = 2048
I = np.int32  # noqa: E741
U = np.uintp


def front_end(
    uniforms, textures, buffers, indices, table, per_instance, first, count, view, bounds, bias, columns, fates
):
    """Runs points or quads [first, first + count) of the draw; appends survivors to the columns.

    `columns` = (rect i32[c, 4], depth f32[c], source i64[c] (number of the primitive in the draw), VF f32[c, k], VI
    i32[c, k], two that only triangles have, and became i8[count], the fate of every primitive); `fates` i64[8]
    receives the numbers of primitives drawn, clipped, empty and not rectangular, of the pixels that are covered, 0, and
    drawn again.
    """
    rect, depth, source, VF, VI, _, _, became = columns
    u = rebuild_uniforms(borrowed(uniforms))
    t = rebuild_textures(borrowed(textures))
    position = np.empty((4, BLOCK * CORNERS), np.float32)
    size = np.empty(BLOCK * CORNERS, np.float32)
    block_rect = np.empty((4, BLOCK), np.int32)
    block_depth = np.empty(BLOCK, np.float32)
    fate = np.empty(BLOCK, np.int32)
    kept = 0
    clipped, empty, crooked, area = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
    done = 0
    while done < count:
        # A run of primitives of one instance, so that the inner loop advances only through vertices
        primitive = first + done
        instance = primitive // per_instance
        start = primitive - instance * per_instance
        run = min(min(per_instance - start, count - done), BLOCK)
        for j in range(run * CORNERS):
            vertex = U(start * CORNERS + j)
            if INDEXED:
                vertex = U(indices[vertex])
            attributes = fetch(buffers, vertex, U(instance))
            p, s, _ = vertex_shader(u, t, attributes, I(vertex), I(instance))
            x, y, z, w = p
            position[0, U(j)] = x
            position[1, U(j)] = y
            position[2, U(j)] = z
            position[3, U(j)] = w
            size[U(j)] = s
        if CORNERS == 1:
            rasterise_points(position, size, run, view, bounds, block_rect, block_depth, fate)
        else:
            rasterise_quads(position, run, view, bounds, block_rect, block_depth, fate)
        # Survivors get their varyings
        for j in range(run):
            i = U(j)
            became[U(done + j)] = fate[i]
            clipped += np.int64(fate[i] == CLIPPED)
            empty += np.int64(fate[i] == EMPTY)
            crooked += np.int64(fate[i] == CROOKED)
            if fate[i] == DRAWN:
                vertex = U((start + j) * CORNERS)
                if INDEXED:
                    vertex = U(indices[vertex])
                attributes = fetch(buffers, vertex, U(instance))
                _, _, varyings = vertex_shader(u, t, attributes, I(vertex), I(instance))
                put_varyings(VF, VI, U(kept), varyings)
                for k in range(4):
                    rect[U(kept), U(k)] = block_rect[U(k), i]
                area += np.int64(block_rect[2, i] - block_rect[0, i]) * np.int64(block_rect[3, i] - block_rect[1, i])
                depth[U(kept)] = block_depth[i]
                source[U(kept)] = primitive + j
                kept += 1
        done += run
    fates[0], fates[1], fates[2], fates[3], fates[4], fates[6] = kept, clipped, empty, crooked, area, kept


def positions(uniforms, textures, buffers, indices, n_vertices, first, count, position, size, VF, VI):
    """The vertex tap: positions, sizes and varyings of invocations [first, first + count), in order."""
    u = rebuild_uniforms(borrowed(uniforms))
    t = rebuild_textures(borrowed(textures))
    for j in range(count):
        instance = (first + j) // n_vertices
        vertex = U(first + j - instance * n_vertices)
        if INDEXED:
            vertex = U(indices[vertex])
        attributes = fetch(buffers, vertex, U(instance))
        p, s, varyings = vertex_shader(u, t, attributes, I(vertex), I(instance))
        x, y, z, w = p
        position[0, U(j)], position[1, U(j)], position[2, U(j)], position[3, U(j)] = x, y, z, w
        size[U(j)] = s
        put_varyings(VF, VI, U(j), varyings)


def corner_shader(vertex_shader, fetch, slot, indexed: bool):
    """Device function ``shade(u, t, buffers, indices, table, start, instance, corner)``: the vertex shader's result for
    a corner of primitive `start` of an instance."""
    names = {"vertex_shader": vertex_shader, "fetch": fetch, "slot": slot, "I": I, "U": U}
    lines = ["def shade(u, t, buffers, indices, table, start, instance, corner):"]
    lines += ["    vertex = U(slot(table, start, corner))"]
    lines += ["    vertex = U(indices[vertex])"] if indexed else []
    lines += ["    return vertex_shader(u, t, fetch(buffers, vertex, U(instance)), I(vertex), I(instance))", ""]
    return device_function("\n".join(lines), "shade", names)


def attribute_fetcher(buffers: tuple[VertexBufferLayout, ...]):
    """Device function ``fetch(buffers, vertex, instance)``: one NamedTuple a buffer, by vertex or by instance."""
    names = {f"get{k}": Layout.of(buffer.attributes).get for k, buffer in enumerate(buffers)}
    parts = [
        f"get{k}(buffers[{k}][0], buffers[{k}][1], "
        + ("vertex)" if buffer.step_mode == VertexStepMode.VERTEX else "instance)")
        for k, buffer in enumerate(buffers)
    ]
    result = f"({', '.join(parts)},)" if parts else "()"
    return device_function(f"def fetch(buffers, vertex, instance):\n    return {result}\n", "fetch", names)


