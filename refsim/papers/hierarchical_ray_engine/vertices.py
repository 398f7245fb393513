"""The vertex layout of section 4: a triangle as one vertex, and the tiles that it is drawn over.

    position         enclosing sphere: centre, radius
    normal           the triangle's plane: unit normal, offset
    texture 0–2      pre-processed vertex data for fast intersection: v0, m1, m2 (`refsim.geometry.triangle`)
    further          normals, then texture coordinates, at the triangle's vertices

The fourth component of texture 0 carries the surface: index of refraction, 0 mirror, −1 diffuse.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from refsim.geometry.sphere import enclosing_spheres
from refsim.geometry.triangle import pack_triangles
from refsim.pipeline.layout import ivec2, vec2, vec3, vec4
from refsim.pipeline.resources import VertexBuffer
from refsim.scene.mesh import Scene


class TriangleVertex(NamedTuple):
    """Section 4's vertex data of a triangle primitive."""

    position: vec4
    normal: vec4
    texture0: vec4
    texture1: vec3
    texture2: vec3
    normal0: vec3
    normal1: vec3
    normal2: vec3
    texcoord0: vec2
    texcoord1: vec2
    texcoord2: vec2


class CornerVertex(NamedTuple):
    """A corner of the full-screen quad, in clip space."""

    position: vec2


class TileVertex(NamedTuple):
    """A tile: its centre in clip space, and its texel in the cone texture."""

    position: vec2
    texel: ivec2


def triangle_vertices(scene: Scene, ior: float) -> VertexBuffer:
    """One vertex a triangle, in file order; `ior` serves glass that names no index of its own."""
    records = pack_triangles(scene.triangles)
    centre, radius = enclosing_spheres(scene.triangles)
    index = scene.optical_indices(ior)
    normals, texcoords = scene.vertex_normals, scene.texcoords
    return VertexBuffer.of(
        TriangleVertex,
        position=np.column_stack([centre, radius]),
        normal=np.column_stack([records.n, records.offset]),
        texture0=np.column_stack([records.v0, index]),
        texture1=records.m1,
        texture2=records.m2,
        normal0=normals[:, 0],
        normal1=normals[:, 1],
        normal2=normals[:, 2],
        texcoord0=texcoords[:, 0],
        texcoord1=texcoords[:, 1],
        texcoord2=texcoords[:, 2],
    )


def corner_vertices() -> VertexBuffer:
    """The four corners of the screen."""
    return VertexBuffer.of(CornerVertex, position=np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]], np.float32))


def tile_vertices(width: int, height: int, tile_size: int) -> VertexBuffer:
    """All tiles of a target of `width` × `height` pixels (multiples of the tile size), row-major."""
    rows, columns = np.mgrid[: height // tile_size, : width // tile_size]
    x = (columns.ravel() + 0.5) * tile_size / width * 2 - 1
    y = 1 - (rows.ravel() + 0.5) * tile_size / height * 2
    texel = np.column_stack([columns.ravel(), rows.ravel()])
    return VertexBuffer.of(TileVertex, position=np.column_stack([x, y]), texel=texel)
