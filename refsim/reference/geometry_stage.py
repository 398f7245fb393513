"""Assembly, geometry stage and stream output once more, on lists, one vertex after the other.

Nothing is shaded here: vertices are numbers, and a geometry shader is the list of codes that it returns (0 skip, 1
emit, 2 emit and end the strip). Sources: WebGPU "primitive assembly" (strip restart), Vulkan 1.3 section 20.1 (order
of strip triangles, first vertex provoking), OpenGL 4.6 sections 11.3.4 and 13.3.2.
"""

from __future__ import annotations

from collections.abc import Sequence

CORNERS = {"point-list": 1, "quad-list": 4, "triangle-list": 3}


def strip_triangles(strip: Sequence[int]) -> list[tuple[int, ...]]:
    """The triangles of one strip, all wound like the first."""
    triangles: list[tuple[int, ...]] = []
    while len(strip) - len(triangles) > 2:
        a, b, c = strip[len(triangles) : len(triangles) + 3]
        triangles.append((a, b, c) if len(triangles) % 2 == 0 else (a, c, b))
    return triangles


def assembled(topology: str, stream: Sequence[int], restart: int | None = None) -> list[tuple[int, ...]]:
    """Primitives of a stream of indices, as vertex invocations: a restart is none, every other index is one.

    `restart` cuts a strip; a list takes it for an index like any other.
    """
    primitives: list[tuple[int, ...]] = []
    if topology == "triangle-strip":
        strip: list[int] = []
        invocations = 0
        for index in stream:
            if index == restart:
                primitives += strip_triangles(strip)
                strip = []
            else:
                strip.append(invocations)
                invocations += 1
        return primitives + strip_triangles(strip)
    size = CORNERS[topology]
    for first in range(0, len(stream) - size + 1, size):
        primitives.append(tuple(range(first, first + size)))
    return primitives


def emitted(codes: Sequence[Sequence[int]], strips: bool) -> tuple[list[tuple[int, int]], list[tuple[int, ...]]]:
    """What invocations that return `codes` emit: (invocation, entry) of every vertex; primitives as rows of these."""
    vertices: list[tuple[int, int]] = []
    primitives: list[tuple[int, ...]] = []
    for invocation, entries in enumerate(codes):
        strip: list[int] = []
        for entry, code in enumerate(entries):
            if code == 0:
                continue
            strip.append(len(vertices))
            vertices.append((invocation, entry))
            if not strips:
                primitives.append((strip[-1],))
            elif code == 2:
                primitives += strip_triangles(strip)
                strip = []
        if strips:
            primitives += strip_triangles(strip)
    return vertices, primitives


def captured(primitives: Sequence[tuple[int, ...]], room: int) -> tuple[list[int], int]:
    """Vertices written to a buffer with `room` for so many records, and how many primitives did not fit whole."""
    written: list[int] = []
    for number, primitive in enumerate(primitives):
        if len(written) + len(primitive) > room:
            return written, len(primitives) - number
        written += primitive
    return written, 0
