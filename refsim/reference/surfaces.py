"""A scene as a method sees it, one row a triangle, and what happens where rays meet it: hits, and the rays after."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from refsim.reference.optics import next_ray
from refsim.reference.triangle import intersect, pack
from refsim.reference.vector import normalise
from refsim.scene.mesh import Scene

ONE = np.float32(1)


class Following(NamedTuple):
    """Rays after n hits: origin, direction f32[n, 3], t_max f32[n] (inf, 0 where the path ends), kind int32[n]."""

    origin: np.ndarray
    direction: np.ndarray
    t_max: np.ndarray
    kind: np.ndarray


@dataclass(frozen=True)
class Surfaces:
    """Triangles in plane form (`refsim.reference.triangle.pack`), their normals, and the options that bend rays.

    v0, n, m1, m2 f32[m, 3]; vertex_normals f32[m, 3, 3]; index f32[m]: of refraction, 0 mirror, −1 diffuse.
    """

    v0: np.ndarray
    n: np.ndarray
    m1: np.ndarray
    m2: np.ndarray
    vertex_normals: np.ndarray
    index: np.ndarray
    epsilon: np.float32
    front_only: bool
    smooth: bool

    @classmethod
    def of(cls, scene: Scene, options: Mapping[str, Any]) -> Surfaces:
        """The scene under the options `ior`, `facing` and `shading`."""
        v0, n, _, m1, m2, _ = pack(scene.triangles)
        front_only, smooth = options["facing"] == "front", options["shading"] == "smooth"
        index = scene.optical_indices(options["ior"])
        return cls(v0, n, m1, m2, scene.vertex_normals, index, scene.epsilon, front_only, smooth)


def shoot(
    surfaces: Surfaces, triangle: int, o: np.ndarray, d: np.ndarray, t_max: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rays [n, 3] against one triangle: ``(hit, t, u, v)``, each [n]; the triangle's back counts unless front_only."""
    row = (surfaces.v0[triangle], surfaces.n[triangle], surfaces.m1[triangle], surfaces.m2[triangle])
    hit, t, u, v, den = intersect(o, d, t_max, *row)
    return (hit & (den < 0) if surfaces.front_only else hit), t, u, v


def following_rays(
    surfaces: Surfaces, o: np.ndarray, d: np.ndarray, triangle: np.ndarray, t: np.ndarray, u: np.ndarray, v: np.ndarray
) -> Following:
    """Section 5: the ray of the next generation for every hit, all zero where `triangle` is −1."""
    rows = np.flatnonzero(triangle >= 0)
    k = triangle[rows]
    normal = surfaces.n[k]
    if surfaces.smooth:
        # The interpolated vertex normal, weights of vertices 0, 1, 2 in this order
        corner = surfaces.vertex_normals[k]
        b1, b2 = u[rows, None], v[rows, None]
        normal = normalise((corner[:, 0] * (ONE - b1 - b2) + corner[:, 1] * b1) + corner[:, 2] * b2)
    origin, direction, kind, alive = next_ray(
        o[rows], d[rows], t[rows], surfaces.n[k], normal, surfaces.index[k], np.asarray(surfaces.epsilon)
    )
    new = Following(np.zeros_like(o), np.zeros_like(d), np.zeros_like(t), np.zeros(len(t), np.int32))
    new.origin[rows], new.direction[rows], new.kind[rows] = origin, direction, kind
    new.t_max[rows] = np.where(alive, np.float32(np.inf), np.float32(0))
    return new
