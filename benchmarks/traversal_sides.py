"""What traversal of lists is measured against, on the same rays: the same loop in C, and Embree through Open3D.

Rays of three kinds, each as large as the image of eye rays they come from, rows of pixels that saw nothing dead:
primary; shadow, towards a light above; bounce, one a hit in a direction drawn by the cosine law, from a seed.
"""

from __future__ import annotations

import ctypes
import subprocess
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

import refsim
from refsim import Hits, Rays, Scene
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy import traversal
from refsim.papers.sphere_hierarchy.directions import list_of_rays
from refsim.papers.sphere_hierarchy.hierarchy import build_hierarchy
from refsim.papers.sphere_hierarchy.lists import TraversalLists, build_lists
from refsim.papers.sphere_hierarchy.search import Found, by_list, search, tile_order

Side = Callable[[], Any]

LIGHT = (0.6, 1.3, 0.45)  # from the scene's middle, in diagonals


def lists_of(scene: Scene) -> TraversalLists:
    """Six lists with the defaults."""
    return build_lists(build_hierarchy(scene), 6)


def rays_of(scene: Scene, lists: TraversalLists, kind: str, size: int) -> Rays:
    """Rays of a kind, from the camera's image of size²."""
    rays = refsim.camera_rays(scene, size, size)
    if kind == "primary":
        return rays
    hits = search([lists], rays).hits
    hit = hits.hit
    corners = scene.triangles[hits.triangle[hit]].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    seen = rays.direction[hit].astype(np.float64)
    normal *= -np.sign(np.sum(normal * seen, axis=1, keepdims=True))
    origin = np.zeros((len(rays), 3))
    direction, t_max = np.zeros((len(rays), 3)), np.zeros(len(rays))
    origin[hit] = rays.origin[hit] + hits.t[hit, None] * seen + scene.epsilon * normal
    if kind == "shadow":
        towards = scene.center + scene.diagonal * np.array(LIGHT) - origin[hit]
        t_max[hit] = np.linalg.norm(towards, axis=1)
    else:
        on_sphere = np.random.default_rng(1).normal(size=normal.shape)
        towards = normal + on_sphere / np.linalg.norm(on_sphere, axis=1, keepdims=True)
        t_max[hit] = np.inf
    direction[hit] = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    return Rays(origin, direction, t_max, size, size)


class Embree:
    """The scene in Open3D's RaycastingScene; `live` rays alone are given to it, and nothing is gathered while timed."""

    def __init__(self, scene: Scene, rays: Rays, any_hit: bool, threads: int) -> None:
        import open3d

        vertices = np.ascontiguousarray(scene.triangles.reshape(-1, 3))
        corners = np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3)
        self.scene = open3d.t.geometry.RaycastingScene(nthreads=threads)
        self.scene.add_triangles(open3d.core.Tensor(vertices), open3d.core.Tensor(corners))
        self.live, self.any_hit, self.threads = rays.t_max > 0, any_hit, threads
        direction = rays.direction[self.live]
        if any_hit:  # test_occlusions has one end for all rays: here 1, so directions are as long as their rays
            direction = direction * rays.t_max[self.live, None]
        self.rays = open3d.core.Tensor(np.hstack([rays.origin[self.live], direction]).astype(np.float32))

    def __call__(self) -> Any:
        if self.any_hit:
            return self.scene.test_occlusions(self.rays, tnear=0.0, tfar=1.0, nthreads=self.threads)
        return self.scene.cast_rays(self.rays, nthreads=self.threads)

    def hit(self) -> np.ndarray:
        """bool[live]: which rays hit."""
        answer = self()
        return answer.numpy() if self.any_hit else np.isfinite(answer["t_hit"].numpy())


class Loop:
    """The pseudo-code's loop, ours or C's, on prepared rows: nothing but the loop is timed."""

    def __init__(self, lists: TraversalLists, rays: Rays, threads: int) -> None:
        self.lists, self.rays, self.threads, n = lists, rays, threads, len(rays)
        self.picked, self.starts = list_of_rays(rays.direction, lists.count), np.zeros(n, np.int32)
        rows = by_list(tile_order(rays.width, rays.height, n), self.picked)
        self.parts = np.array_split(rows, 8 * threads)
        self.pool = ThreadPoolExecutor(threads)
        self.clear()

    def clear(self) -> None:
        """Fresh results, which a search adds to."""
        n = len(self.rays)
        self.found = Found(Hits.misses(n), np.zeros(n, np.int32), np.zeros(n, np.int32))

    def __call__(self) -> None:
        list(self.pool.map(self.part, self.parts))

    def outputs(self) -> tuple[np.ndarray, ...]:
        """What the loop writes."""
        hits = self.found.hits
        return hits.triangle, hits.t, hits.u, hits.v, self.found.nodes, self.found.triangle_tests


class OurLoop(Loop):
    """`traversal.walk`."""

    def __call__(self) -> None:
        self.function = specialise(traversal.walk, {})
        super().__call__()

    def part(self, rows: np.ndarray) -> None:
        a, rays = self.lists, self.rays
        self.function(
            rows, self.picked, self.starts, rays.origin, rays.direction, rays.t_max, a.escape, a.spheres, a.payload,
            a.first, a.records, a.hierarchy.spheres[0], False, False, np.int32(0), *self.outputs(),
        )  # fmt: skip


class CLoop(Loop):
    """traversal.c, built with gcc -O3 -march=native and without contraction."""

    def __init__(self, lists: TraversalLists, rays: Rays, threads: int, folder: Path) -> None:
        super().__init__(lists, rays, threads)
        library, source = folder / "traversal.so", Path(__file__).with_name("traversal.c")
        options = ["-O3", "-march=native", "-ffp-contract=off", "-shared", "-fPIC"]
        subprocess.run(["gcc", *options, str(source), "-o", str(library), "-lm"], check=True)
        self.function = ctypes.CDLL(str(library)).traverse

    def part(self, rows: np.ndarray) -> None:
        a, rays = self.lists, self.rays
        columns = (
            rows, self.picked, self.starts, rays.origin, rays.direction, rays.t_max, a.escape, a.payload, a.first,
            a.records, a.hierarchy.spheres[0], *self.outputs(),
        )  # fmt: skip
        self.function(ctypes.c_size_t(len(rows)), *[ctypes.c_void_p(column.ctypes.data) for column in columns])


def best_of(sides: dict[str, Side], rounds: int, before: Side = lambda: None) -> dict[str, float]:
    """The least seconds of each side, which take turns; each runs once before."""
    best = dict.fromkeys(sides, np.inf)
    for turn in range(rounds + 1):
        for name, side in sides.items():
            before()
            start = time.perf_counter()
            side()
            taken = time.perf_counter() - start
            best[name] = min(best[name], taken) if turn else np.inf
    return best
