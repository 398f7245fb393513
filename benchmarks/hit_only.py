"""The Ray Engine with the smallest useful shader: outputs t, u, v and the triangle's number, no refraction, no stencil.

Also the C loop it is compared with, built by the benchmark with gcc -O3 -march=native.
"""

from __future__ import annotations

import ctypes
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

import refsim
from refsim.counters import Counters
from refsim.geometry.triangle import intersect, pack_triangles
from refsim.jit import func
from refsim.papers.hierarchical_ray_engine import shaders
from refsim.papers.hierarchical_ray_engine.results import ray_textures
from refsim.papers.hierarchical_ray_engine.tracer import depth_scale
from refsim.papers.hierarchical_ray_engine.vertices import (
    CornerVertex,
    TriangleVertex,
    corner_vertices,
    triangle_vertices,
)
from refsim.pipeline.draw import draw
from refsim.pipeline.layout import i32, vec3
from refsim.pipeline.resources import Framebuffer
from refsim.pipeline.state import (
    CompareFunction,
    DepthStencilState,
    FragmentState,
    Pipeline,
    PrimitiveTopology,
    TextureFormat,
    VertexBufferLayout,
    VertexState,
    VertexStepMode,
)


class Hit(NamedTuple):
    """What the shader outputs."""

    hit: vec3
    triangle: i32


@func
def hit_fragment(u, t, v, inputs, pixel):
    """Intersection alone."""
    o = (inputs.origin[0], inputs.origin[1], inputs.origin[2])
    found, distance, b1, b2, _ = intersect(o, inputs.direction, inputs.origin[3], v.v0, v.n, v.m1, v.m2)
    return found, distance * u.depth_scale, Hit((distance, b1, b2), v.triangle)


PIPELINE = Pipeline(
    VertexState(
        shaders.quad_vertex(False),
        shaders.FlatTriangle,
        (VertexBufferLayout(CornerVertex), VertexBufferLayout(TriangleVertex, VertexStepMode.INSTANCE)),
    ),
    FragmentState(hit_fragment, Hit, shaders.RayTexels, writes_depth=True, discards=True),
    PrimitiveTopology.QUAD_LIST,
    DepthStencilState(depth_write_enabled=True, depth_compare=CompareFunction.LESS),
    label="ray engine, hits only",
)


class RayEngine:
    """One pass over `width`² camera rays of `scene`, ready to run again and again."""

    def __init__(self, scene: refsim.Scene, width: int, threads: int) -> None:
        self.rays = refsim.camera_rays(scene, width, width, fill=0.55)
        self.textures, _ = ray_textures(self.rays, 1)
        self.triangles, self.corners = triangle_vertices(scene, 1.5), corner_vertices()
        self.uniforms = shaders.EngineUniforms(depth_scale(scene, self.rays), scene.epsilon)
        self.target = Framebuffer(
            width, width, {"hit": TextureFormat.RGB32FLOAT, "triangle": TextureFormat.R32SINT}
        )
        self.threads = threads
        self.tests = width * width * len(scene.triangles)

    def __call__(self) -> Counters:
        self.target.clear_depth()
        self.target.clear_color("triangle", -1)
        counters = Counters()
        draw(
            PIPELINE,
            vertices=(self.corners, self.triangles),
            instances=self.triangles.count,
            uniforms=self.uniforms,
            textures=self.textures,
            framebuffer=self.target,
            counters=counters,
            threads=self.threads,
        )
        return counters


class CLoop:
    """The same rays and triangles in C, rays shared by threads."""

    def __init__(self, scene: refsim.Scene, rays: refsim.Rays, threads: int, folder: Path) -> None:
        library = folder / "ray_triangle.so"
        source = Path(__file__).with_name("ray_triangle.c")
        subprocess.run(
            ["gcc", "-O3", "-march=native", "-shared", "-fPIC", str(source), "-o", str(library)], check=True
        )
        self.function = ctypes.CDLL(str(library)).nearest_hits
        records = pack_triangles(scene.triangles)
        self.triangles = np.ascontiguousarray(np.column_stack([records.v0, records.n, records.m1, records.m2]))
        self.rays = np.ascontiguousarray(np.concatenate([rays.origin.T, rays.direction.T, rays.t_max[None]]))
        self.hit = np.zeros((3, len(rays)), np.float32)
        self.number = np.zeros(len(rays), np.int32)
        self.pool = ThreadPoolExecutor(threads)
        edges = np.linspace(0, len(rays), threads + 1).astype(int)
        self.parts = list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))

    def __call__(self) -> None:
        self.hit[:] = np.inf
        self.number[:] = -1
        list(self.pool.map(self._part, self.parts))

    def _part(self, part: tuple[int, int]) -> None:
        size, pointer = ctypes.c_size_t, lambda array: ctypes.c_void_p(array.ctypes.data)
        self.function(
            size(len(self.number)), size(part[0]), size(part[1]), pointer(self.rays), size(len(self.triangles)),
            pointer(self.triangles), pointer(self.hit), pointer(self.number),
        )  # fmt: skip
