"""Scenes and rays at which structures fail, and the loop that puts rays through one: one kernel for each structure."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from refsim import Scene
from refsim.jit import func, specialise
from refsim.papers.geometry_shader_rays.acceleration import Accelerator, test_triangle
from refsim.papers.geometry_shader_rays.bvh import bvh
from refsim.papers.geometry_shader_rays.grid import grid
from refsim.papers.geometry_shader_rays.naive import naive
from refsim.papers.geometry_shader_rays.triangle_textures import triangle_textures

U = np.uintp
I = np.int32  # noqa: E741
F0 = np.float32(0)
INF = np.float32(np.inf)
KINDS = ("soup", "spanning", "lattice", "flat", "line", "point", "slivers", "needles", "copies", "stack", "far corner")


class Shot(NamedTuple):
    """triangle, cells, tests, rejected: int32[n]; t, u, v: float32[n]."""

    triangle: np.ndarray
    cells: np.ndarray
    tests: np.ndarray
    rejected: np.ndarray
    t: np.ndarray
    u: np.ndarray
    v: np.ndarray


def loop(structure, triangles, origin, direction, t_max, any_hit, front_only, whole, real):
    """Rays f32[n, 3], f32[n, 3], f32[n]; `whole` i32[4, n], `real` f32[3, n] are written."""
    for j in range(t_max.size):
        i = U(j)
        o = origin[i, 0], origin[i, 1], origin[i, 2]
        d = direction[i, 0], direction[i, 1], direction[i, 2]
        triangle, t, u, v, cells, tests, rejected = traverse(  # noqa: F821
            structure, triangles, o, d, t_max[i], any_hit, front_only
        )
        whole[0, i], whole[1, i], whole[2, i], whole[3, i] = triangle, cells, tests, rejected
        real[0, i], real[1, i], real[2, i] = t, u, v


def shoot(
    accelerator: Accelerator, scene: Scene, rays: tuple[Any, Any, Any], any_hit: bool = False, front_only: bool = False
) -> Shot:
    origin, direction, t_max = (np.ascontiguousarray(x, np.float32) for x in rays)
    whole, real = np.zeros((4, len(t_max)), np.int32), np.zeros((3, len(t_max)), np.float32)
    textures = triangle_textures(scene, 1.5)
    kernel = specialise(loop, {"traverse": accelerator.traverse})
    flags = np.int32(any_hit), np.int32(front_only)
    kernel(accelerator.structure, textures.triangles, origin, direction, t_max, *flags, whole, real)
    return Shot(*whole, *real)


class Everything(NamedTuple):
    """How many triangles there are."""

    count: np.int32


@func
def all_of_them(structure, triangles, o, d, t_max, any_hit, front_only):
    """Every triangle, with no box in front and no ray told from another: the yardstick."""
    triangle, t, u, v = I(-1), t_max, F0, F0
    for k in range(structure.count):
        triangle, t, u, v = test_triangle(triangles, I(k), o, d, t_max, front_only, triangle, t, u, v)
    return triangle, t, u, v, I(0), structure.count, I(0)


def everything(scene: Scene) -> Accelerator:
    return Accelerator("everything", Everything(np.int32(len(scene))), all_of_them)


def structures(scene: Scene, resolution: Any = None, reach: float | None = None) -> list[Accelerator]:
    """The yardstick first, then what must find the same."""
    return [everything(scene), naive(scene, reach), grid(scene, resolution, reach), bvh(scene, reach)]


def scene_of(kind: str, rng: np.random.Generator, scale: float = 1.0) -> Scene:
    """Some 10 to 40 triangles."""
    n = int(rng.integers(10, 40))
    p = rng.normal(size=(n, 1, 3)) + rng.normal(size=(n, 3, 3)) * 0.2
    if kind == "spanning":
        p = rng.normal(size=(n, 3, 3)) * 2
    elif kind == "lattice":  # shared edges and corners, planes of cells, the same t for several triangles
        p = rng.integers(-2, 3, (n, 3, 3)).astype(float)
    elif kind == "flat":
        p[..., rng.integers(3)] = rng.choice([0.0, 1.0, -0.3])
    elif kind == "line":  # thickness along one axis, and triangles of no area but for the last
        p[..., [1, 2]] = 0.5
        p[-1, 0, 1] += 1e-3
    elif kind == "point":
        p[:] = rng.normal(size=3)
    elif kind == "slivers":
        p[:, 2] = p[:, 0] + (p[:, 1] - p[:, 0]) * rng.random((n, 1)) + rng.normal(size=(n, 3)) * 1e-5
    elif kind == "needles":  # sharper than the weights can tell: loose
        p[:, 2] = p[:, 1] + rng.normal(size=(n, 3)) * 10.0 ** rng.uniform(-8, -3, (n, 1))
    elif kind == "copies":
        p = p[rng.integers(0, n // 3, n)]
    elif kind == "stack":  # sheets closer together than the margins
        p = p[:1] + np.linspace(0, 1e-5, n)[:, None, None] * rng.normal(size=3)
    elif kind == "far corner":
        p[0] += 300.0
        p += 50.0
    return Scene((p * scale).astype(np.float32))


def rays_of(scene: Scene, rng: np.random.Generator, n: int = 240) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rays of every sort: inside, outside, from vertices and box corners, along axes, through edges, from far away."""
    size = max(scene.diagonal, 1e-3 * float(np.abs(scene.triangles).max()), 1e-12)
    vertices = scene.triangles.reshape(-1, 3).astype(np.float64)
    triangles = scene.triangles.astype(np.float64)[rng.integers(0, len(scene), n)]
    corners = np.where(rng.random((n, 3)) < 0.5, scene.lower, scene.upper).astype(np.float64)
    weights = rng.dirichlet([0.5] * 3, n)
    edge = np.eye(3)[rng.integers(0, 3, n)] * 0.5 + np.eye(3)[rng.integers(0, 3, n)] * 0.5
    weights = np.where(rng.random((n, 1)) < 0.4, edge, weights)
    target = np.einsum("nk,nkc->nc", weights, triangles)
    box = scene.lower + rng.random((n, 3)) * (scene.upper - scene.lower)
    around = scene.center + rng.normal(size=(n, 3)) * size
    origin = np.choose(
        rng.integers(0, 6, (n, 1)),
        [box, around, corners, vertices[rng.integers(0, len(vertices), n)], scene.center + (around - scene.center) * 6,
         np.where(rng.random((n, 3)) < 0.5, target, around)],
    )  # fmt: skip
    along = np.eye(3)[rng.integers(0, 3, n)] * rng.choice([-1.0, 1.0], (n, 1))
    diagonals = rng.choice([-1.0, -0.0, 0.0, 1.0], (n, 3))
    nearly = along + rng.normal(size=(n, 3)) * 10.0 ** rng.uniform(-12, -1, (n, 1))
    aimed, aimed_edge = target - origin, triangles[:, 1] - triangles[:, 0]
    direction = np.choose(
        rng.integers(0, 6, (n, 1)), [aimed, aimed, along * rng.choice([1.0, -1.0]), diagonals, nearly, aimed_edge]
    )
    # An axis-parallel ray that meets something starts beside its target
    straight = (np.count_nonzero(direction, axis=1) == 1) & (rng.random(n) < 0.7)
    origin = np.where(straight[:, None], target - direction * size, origin)
    length = np.linalg.norm(direction, axis=1, keepdims=True)
    unit = direction / np.where(length > 0, length, 1.0)
    direction = np.where(rng.random((n, 1)) < 0.8, unit, unit * 10.0 ** rng.uniform(-3, 3, (n, 1)))
    t_max = np.where(rng.random(n) < 0.7, np.inf, rng.exponential(size, n))
    return origin.astype(np.float32), direction.astype(np.float32), t_max.astype(np.float32)


def assert_same(expected: Shot, found: Shot, which: str) -> None:
    """Triangle, t, u and v bit for bit."""
    for name in ("triangle", "t", "u", "v"):
        a, b = getattr(expected, name).view(np.int32), getattr(found, name).view(np.int32)
        wrong = np.flatnonzero(a != b)
        first = wrong[:1]
        assert not wrong.size, (
            f"{which}: {name} of ray {first} is {getattr(found, name)[first]}, not {getattr(expected, name)[first]}; "
            f"triangles {expected.triangle[first]}, {found.triangle[first]}; {wrong.size} rays"
        )
