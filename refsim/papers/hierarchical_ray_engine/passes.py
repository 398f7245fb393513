"""The engine's pipelines: state and shaders of the cone pass and of the intersection pass."""

from __future__ import annotations

from functools import cache

from refsim.geometry.cone import Printed
from refsim.papers.hierarchical_ray_engine import shaders
from refsim.papers.hierarchical_ray_engine.vertices import CornerVertex, TileVertex, TriangleVertex
from refsim.pipeline.state import (
    CompareFunction,
    DepthStencilFormat,
    DepthStencilState,
    EarlyTests,
    FragmentState,
    Pipeline,
    PrimitiveTopology,
    StencilFaceState,
    StencilOperation,
    TextureFormat,
    VertexBufferLayout,
    VertexState,
    VertexStepMode,
)

RAY_TARGETS = {
    "hit": TextureFormat.RGB32FLOAT,
    "origin": TextureFormat.RGBA32FLOAT,
    "direction": TextureFormat.RGB32FLOAT,
    "triangle": TextureFormat.R32SINT,
    "kind": TextureFormat.R32SINT,
}
CONE_TARGETS = {
    "apex": TextureFormat.RGBA32FLOAT,
    "axis": TextureFormat.RGBA32FLOAT,
    "slack": TextureFormat.R32FLOAT,
    "state": TextureFormat.R32SINT,
}

# Section 5: a pass tests the bit of the pass before and sets its own where a triangle is hit. Masks are run-time values
STENCIL_BIT_PER_GENERATION = StencilFaceState(compare=CompareFunction.EQUAL, pass_op=StencilOperation.REPLACE)


def _nearest_hit(stencil: bool, depth_format: DepthStencilFormat) -> DepthStencilState:
    """Section 2.1: t as depth, test LESS."""
    face = STENCIL_BIT_PER_GENERATION if stencil else StencilFaceState()
    return DepthStencilState(depth_format, True, CompareFunction.LESS, face)


def _intersection(facing: str, smooth: bool) -> FragmentState:
    return FragmentState(
        shaders.intersection_fragment(facing, smooth),
        shaders.NextRay,
        shaders.RayTexels,
        writes_depth=True,
        discards=True,
    )


@cache
def ray_engine_pass(
    facing: str, smooth: bool, stencil: bool, early_tests: EarlyTests, depth_format: DepthStencilFormat
) -> Pipeline:
    """Every triangle as a full-screen quad (section 2.1)."""
    buffers = (VertexBufferLayout(CornerVertex), VertexBufferLayout(TriangleVertex, VertexStepMode.INSTANCE))
    return Pipeline(
        VertexState(shaders.quad_vertex(smooth), shaders.varyings(smooth), buffers),
        _intersection(facing, smooth),
        PrimitiveTopology.QUAD_LIST,
        _nearest_hit(stencil, depth_format),
        early_tests,
        "ray engine",
    )


@cache
def hierarchical_pass(
    submission: str,
    facing: str,
    smooth: bool,
    early_tests: EarlyTests,
    depth_format: DepthStencilFormat,
    printed_sphere_test: bool,
) -> Pipeline:
    """Every triangle as a point sprite on every tile whose cone meets its sphere (section 3)."""
    # Of all errata the sphere test reads E4 alone, so the others share one compiled pass
    printed = Printed(E4=printed_sphere_test)
    triangle, tile = TriangleVertex, TileVertex
    per_vertex, per_instance = (triangle, tile) if submission == "tile" else (tile, triangle)
    buffers = (VertexBufferLayout(per_vertex), VertexBufferLayout(per_instance, VertexStepMode.INSTANCE))
    return Pipeline(
        VertexState(shaders.sprite_vertex(submission, smooth, printed), shaders.varyings(smooth), buffers),
        _intersection(facing, smooth),
        PrimitiveTopology.POINT_LIST,
        _nearest_hit(True, depth_format),
        early_tests,
        f"hierarchical ray engine, by {submission}",
    )


@cache
def cone_pass(printed: Printed) -> Pipeline:
    """One fragment a tile builds the tile's cone (section 4)."""
    return Pipeline(
        VertexState(shaders.screen_vertex, shaders.NoVaryings, (VertexBufferLayout(CornerVertex),)),
        FragmentState(shaders.cone_fragment(printed), shaders.ConeTexel),
        PrimitiveTopology.QUAD_LIST,
        label="enclosing cones",
    )
