"""One draw as a value that both pipelines understand, and what it leaves behind.

A `Case` holds refsim's own state values, GLSL with the same meaning as the pipeline's shaders, vertices as arrays and
the planes drawn onto. `ours` draws it on refsim; `tests.opengl.witness` draws it on OpenGL; both give an `Outcome`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from refsim.counters import Counters
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import Framebuffer, VertexBuffer
from refsim.pipeline.state import DynamicState, Pipeline, TextureFormat
from tests.opengl.target import Planes, blank, dtype_of


class Glsl(NamedTuple):
    """Shader sources without their first line. A varying `x` is `v_x` after the vertex and `g_x` after the geometry
    shader; attributes are numbered in the order of their fields."""

    vertex: str
    fragment: str | None = None
    geometry: str | None = None


class Case(NamedTuple):
    """A draw. `vertices`: an array per attribute. `capture`: records that the stream output buffer holds."""

    pipeline: Pipeline
    glsl: Glsl
    vertices: Mapping[str, Any]
    targets: Mapping[str, TextureFormat]
    planes: Planes
    dynamic: DynamicState = DynamicState()
    indices: np.ndarray | None = None
    instances: int = 1
    capture: int | None = None

    @property
    def attributes(self) -> type:
        """The class of a vertex."""
        return self.pipeline.vertex.buffers[0].attributes

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        height, width = self.planes.depth.shape
        return width, height


class Outcome(NamedTuple):
    """What a draw left: planes, `counts` by refsim's counter names, captured records as a structured array."""

    planes: Planes
    counts: dict[str, int]
    records: np.ndarray | None = None


def case(
    pipeline: Pipeline,
    glsl: Glsl,
    vertices: Mapping[str, Any],
    targets: Mapping[str, TextureFormat],
    size: tuple[int, int],
    **others: Any,
) -> Case:
    """A case onto blank planes of (width, height), unless `planes` are among `others`."""
    planes = others.pop("planes", None) or blank(*size, targets, pipeline.depth_stencil.format)
    return Case(pipeline, glsl, vertices, targets, planes, **others)


def framebuffer_of(given: Case) -> Framebuffer:
    """refsim's framebuffer, filled with the case's planes."""
    made = Framebuffer(*given.size, given.targets, given.pipeline.depth_stencil.format)
    for name, form in given.targets.items():
        plane = given.planes.color[name]
        made.color(name)[:] = plane.astype(np.float32) / np.float32(255) if form.is_unorm8 else plane
    made.depth[:], made.stencil[:] = given.planes.depth, given.planes.stencil
    return made


def planes_of(framebuffer: Framebuffer) -> Planes:
    """What refsim's framebuffer holds, 8-bit targets as the bytes they stand for."""
    color = {}
    for name, form in framebuffer.targets.items():
        plane = framebuffer.color(name)
        if form.is_unorm8:
            plane = np.rint(plane * np.float32(255))
        color[name] = plane.astype(dtype_of(form))
    return Planes(color, framebuffer.depth.copy(), framebuffer.stencil.copy())


def ours(given: Case, *, loop: Any = "list", then: Case | None = None) -> Outcome:
    """The case on refsim. `then` is drawn from the records of `given`, with their count taken from the buffer, onto
    its own planes, which are what is returned."""
    target, counters = framebuffer_of(given), Counters()
    options: dict[str, Any] = {"counters": counters, "loop": loop, "threads": 2}
    captured = None
    if given.capture is not None:
        captured = options["stream_output"] = VertexBuffer(given.pipeline.stream_output.record, given.capture)
    draw(
        given.pipeline,
        framebuffer=None if given.pipeline.rasterizer_discard else target,
        vertices=VertexBuffer.of(given.attributes, **given.vertices),
        indices=given.indices,
        instances=given.instances,
        dynamic=given.dynamic,
        **options,
    )
    counters.check()
    if then is not None:
        target = framebuffer_of(then)
        draw(then.pipeline, framebuffer=target, vertices=captured, dynamic=then.dynamic, counters=counters, loop=loop)
    records = None if captured is None else captured.records()
    return Outcome(planes_of(target), dict(counters), records)
