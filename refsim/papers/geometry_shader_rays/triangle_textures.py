"""Triangle data in two 3-D textures of four depth slices each, at the same (x, y) (section 4.3).

"Texels with the same (X, Y) coordinates in different Z slices are storing vertex, normal and material information
belonging to the same single triangle." Triangle i lies at x = i mod 1024, y = i div 1024 of both textures:

    slice    `triangles`: what the intersection reads    `surfaces`: what shading reads
    0        v0, optical index                           normal at vertex 0, specular strength
    1        unit normal n, reflectivity ρ               normal at vertex 1
    2        m1, transmission τ                          normal at vertex 2
    3        m2, Phong exponent                          colour of diffuse light

v0, n, m1, m2 are the plane form of `refsim.geometry.triangle`. The optical index is that of `Scene.optical_indices`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from refsim.errors import InputError
from refsim.geometry.triangle import pack_triangles
from refsim.jit import func
from refsim.papers.geometry_shader_rays.record import MOST_TRIANGLES
from refsim.pipeline.resources import Texture3D, slice4
from refsim.scene.mesh import Scene

WIDTH_BITS = 10
WIDTH = 1 << WIDTH_BITS
U = np.uintp


class TriangleTextures(NamedTuple):
    """Both textures, f32[rows, 1024, 4 slices, 4 components]."""

    triangles: Texture3D
    surfaces: Texture3D


def triangle_textures(scene: Scene, ior: float) -> TriangleTextures:
    """The scene's triangles; `ior` serves glass that names no index of its own."""
    count = len(scene)
    if count > MOST_TRIANGLES:
        raise InputError(f"{count} triangles are more than the {MOST_TRIANGLES} whose numbers a float32 holds.")
    records = pack_triangles(scene.triangles)
    materials, ids = scene.materials, scene.material_ids
    diffuse = np.array([m.color if m.kind == "diffuse" else (0, 0, 0) for m in materials], np.float32)

    def column(values: list[float]) -> np.ndarray:
        return np.array(values, np.float32)[ids]

    rows = max(-(-count // WIDTH), 1)
    triangles = np.zeros((rows * WIDTH, 4, 4), np.float32)
    surfaces = np.zeros((rows * WIDTH, 4, 4), np.float32)
    fourth = (
        scene.optical_indices(ior),
        column([m.rho for m in materials]),
        column([m.tau for m in materials]),
        column([float(round(m.shininess)) for m in materials]),
    )
    for k, (vector, scalar) in enumerate(zip((records.v0, records.n, records.m1, records.m2), fourth, strict=True)):
        triangles[:count, k, :3], triangles[:count, k, 3] = vector, scalar
    surfaces[:count, :3, :3] = scene.vertex_normals
    surfaces[:count, 0, 3] = column([m.specular for m in materials])
    surfaces[:count, 3, :3] = diffuse[ids]
    shape = (rows, WIDTH, 4, 4)
    return TriangleTextures(Texture3D(triangles.reshape(shape)), Texture3D(surfaces.reshape(shape)))


@func
def fetch(texture, triangle, z):
    """Slice z of a triangle's texel: four float32."""
    i = U(triangle)
    return slice4(texture, i & U(WIDTH - 1), i >> U(WIDTH_BITS), z)
