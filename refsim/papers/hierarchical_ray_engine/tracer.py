"""Both engines: per generation, (build cones,) draw all triangles over all rays, hand the new rays to the next pass.

Reads like Figure 1's block diagram. State that lives on from pass to pass is the stencil and the ray textures; depth
is cleared, and the next-ray target is cleared to dead rays, because a pixel that the stencil skips writes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from refsim.counters import Counters
from refsim.geometry.cone import Printed
from refsim.papers.hierarchical_ray_engine import passes, shaders
from refsim.papers.hierarchical_ray_engine.results import cones_of, generation_of, ray_textures, trace_of
from refsim.papers.hierarchical_ray_engine.vertices import corner_vertices, tile_vertices, triangle_vertices
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import Framebuffer, VertexBuffer
from refsim.pipeline.state import DepthStencilFormat, DynamicState, EarlyTests, ScissorRect
from refsim.pipeline.taps import Taps
from refsim.results import Generation, Trace
from refsim.scene.mesh import Scene
from refsim.scene.rays import Rays

STENCIL_BITS = 8
ALL_BITS = 0xFF


@dataclass(frozen=True)
class EngineOptions:
    """What both engines share; names and values as the methods' options."""

    generations: int
    ior: float
    facing: str
    smooth: bool
    early_tests: EarlyTests
    depth_format: DepthStencilFormat
    stencil: bool
    threads: int | None
    taps: Taps | None


def stencil_state(generation: int, scissor: ScissorRect) -> DynamicState:
    """Section 5: pass 0 writes bit 0 untested, pass k tests bit k − 1 and writes bit k; from pass 8 on no test is left.

    The comparison is EQUAL under the read mask, so a read mask of 0 lets everything pass.
    """
    read = 1 << (generation - 1) if 0 < generation < STENCIL_BITS else 0
    write = 1 << generation if generation < STENCIL_BITS else 0
    return DynamicState(None, scissor, ALL_BITS, read, write)


def depth_scale(scene: Scene, rays: Rays) -> np.float32:
    """A power of two that takes every possible t below 1: then no two different t become equal."""
    live = rays.t_max > 0
    origins = rays.origin if live.all() else rays.origin[live]
    lowest, highest = scene.lower.astype(np.float64), scene.upper.astype(np.float64)
    for axis in range(3 if len(origins) else 0):  # a column at a time is quicker than rows
        lowest[axis] = min(lowest[axis], origins[:, axis].min())
        highest[axis] = max(highest[axis], origins[:, axis].max())
    farthest = 1.01 * float(np.linalg.norm(highest - lowest)) + 4 * float(scene.epsilon)
    farthest = max(farthest, float(np.finfo(np.float32).tiny))  # all in one point
    return np.float32(2.0 ** -np.ceil(np.log2(farthest)))


def next_target(width: int, height: int, depth_format: DepthStencilFormat, stencil: np.ndarray | None) -> Framebuffer:
    """A cleared render target: no hit, dead rays; the stencil of the pass before."""
    target = Framebuffer(width, height, passes.RAY_TARGETS, depth_format)
    target.clear_color("triangle", -1)
    target.clear_color("hit", (np.inf, 0.0, 0.0))
    if stencil is not None:
        target.stencil = stencil
    return target


def trace_ray_engine(scene: Scene, rays: Rays, options: EngineOptions) -> Trace:
    """Section 2.1: every ray against every triangle."""
    triangles, corners = triangle_vertices(scene, options.ior), corner_vertices()
    pipeline = passes.ray_engine_pass(
        options.facing, options.smooth, options.stencil, options.early_tests, options.depth_format
    )
    textures, (width, height) = ray_textures(rays, 1)
    image = ScissorRect(0, 0, width, height)
    uniforms = shaders.EngineUniforms(depth_scale(scene, rays), scene.epsilon)
    found: list[Generation] = []
    stencil = None
    for k in range(options.generations):
        counters = Counters()
        target = next_target(width, height, options.depth_format, stencil)
        draw(
            pipeline,
            vertices=(corners, triangles),
            instances=len(scene.triangles),
            uniforms=uniforms,
            textures=textures,
            framebuffer=target,
            counters=counters,
            dynamic=stencil_state(k, image),
            taps=options.taps,
            threads=options.threads,
        )
        found.append(generation_of(rays, textures, target, image, found, counters, None, triangles.count))
        textures = shaders.RayTextures(target.texture("origin"), target.texture("direction"))
        stencil = target.stencil
    return trace_of("ray_engine", scene, rays, found)


def trace_hierarchical(
    scene: Scene, rays: Rays, options: EngineOptions, tile_size: int, submission: str, printed: Printed
) -> Trace:
    """Sections 3 to 5: every tile's cone against every triangle's sphere, then the rays of the tiles that are left."""
    triangles, corners = triangle_vertices(scene, options.ior), corner_vertices()
    pipeline = passes.hierarchical_pass(
        submission, options.facing, options.smooth, options.early_tests, options.depth_format, printed.E4
    )
    # Targets are padded to whole tiles, or sprites whose centre lies outside would be clipped; padding rays are dead
    textures, (width, height) = ray_textures(rays, tile_size)
    padded_height, padded_width = textures.origin.data.shape[1:]
    tiles = tile_vertices(padded_width, padded_height, tile_size)
    per_vertex, per_instance = (triangles, tiles) if submission == "tile" else (tiles, triangles)
    image = ScissorRect(0, 0, width, height)
    scale = depth_scale(scene, rays)
    found: list[Generation] = []
    stencil = None
    for k in range(options.generations):
        counters = Counters()
        cone_target = build_cones(textures, tile_size, printed, corners, counters, options)
        target = next_target(padded_width, padded_height, options.depth_format, stencil)
        cones_read = read_back(cone_target, submission)
        draw(
            pipeline,
            vertices=(per_vertex, per_instance),
            instances=per_instance.count,
            uniforms=shaders.TileUniforms(scale, scene.epsilon, np.float32(tile_size), cones_read),
            textures=with_cones(textures, cone_target),
            framebuffer=target,
            counters=counters,
            dynamic=stencil_state(k, image),
            taps=options.taps,
            threads=options.threads,
        )
        cones = cones_of(cone_target, tile_size)
        counters.add("cone.sphere_tests", counters["vertex.invocations"] - CORNERS_OF_CONE_PASS)
        counters.add("cone.pairs_kept", counters["raster.primitives"] - 1 - counters["raster.clipped"])
        found.append(generation_of(rays, textures, target, image, found, counters, cones, triangles.count))
        textures = shaders.RayTextures(target.texture("origin"), target.texture("direction"))
        stencil = target.stencil
    return trace_of("hierarchical_ray_engine", scene, rays, found)


CORNERS_OF_CONE_PASS = 4


def build_cones(
    textures: Any, tile_size: int, printed: Printed, corners: VertexBuffer, counters: Counters, options: EngineOptions
) -> Framebuffer:
    """Section 4: a target of one texel a tile, drawn with one quad."""
    height, width = textures.origin.data.shape[1:]
    target = Framebuffer(width // tile_size, height // tile_size, passes.CONE_TARGETS)
    draw(
        passes.cone_pass(printed._replace(E4=False)),  # E4 is the sphere test's alone
        vertices=corners,
        uniforms=shaders.ConeUniforms(np.int32(tile_size)),
        textures=textures,
        framebuffer=target,
        counters=counters,
        taps=options.taps,
        threads=options.threads,
    )
    return target


def read_back(cones: Framebuffer, submission: str) -> np.ndarray:
    """The cone texture as uniforms f32[tiles, 9] (section 3); nothing to read where the vertex shader fetches it."""
    planes = cones.floats if submission == "tile" else cones.floats[:, :0]
    return np.ascontiguousarray(planes.reshape(len(planes), -1).T)


def with_cones(rays: Any, cones: Framebuffer) -> shaders.ConeTextures:
    """The rays, and the cones of their tiles, as textures of the intersection pass."""
    return shaders.ConeTextures(
        rays.origin, rays.direction, cones.texture("apex"), cones.texture("axis"), cones.texture("slack")
    )
