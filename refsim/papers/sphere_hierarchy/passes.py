"""The pipelines of both forms: which shaders and which state. Compiled once for a set of device functions."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from refsim.papers.sphere_hierarchy.shaders import (
    Best,
    Corner,
    EntryVertex,
    NoVaryings,
    RayTexels,
    RayVertex,
    quad_vertex,
    searching_fragment,
    searching_vertex,
)
from refsim.pipeline.resources import VertexBuffer
from refsim.pipeline.state import (
    FragmentState,
    Pipeline,
    PrimitiveTopology,
    StreamOutputState,
    VertexBufferLayout,
    VertexState,
)

CORNERS = VertexBuffer.of(Corner, position=np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], np.float32))


@cache
def fragment_pass(traverse: Any) -> Pipeline:
    """A viewport quad, every pixel a ray: render targets take what is found."""
    return Pipeline(
        VertexState(quad_vertex, NoVaryings, (VertexBufferLayout(Corner),)),
        FragmentState(searching_fragment(traverse), Best, RayTexels),
        PrimitiveTopology.QUAD_LIST,
        label="traversal in the fragment shader",
    )


@cache
def vertex_pass(traverse: Any) -> Pipeline:
    """Points, every one a ray: stream output takes what is found, nothing is rasterised."""
    buffers = tuple(VertexBufferLayout(record) for record in (RayVertex, EntryVertex, Best))
    return Pipeline(
        VertexState(searching_vertex(traverse), Best, buffers),
        None,
        PrimitiveTopology.POINT_LIST,
        label="traversal in the vertex shader",
        stream_output=StreamOutputState(Best),
        rasterizer_discard=True,
    )
