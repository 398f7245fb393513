"""Checks of the traversal (section 2.1), of heads (section 3), layers and refits (section 5), and of the tables' sums.

Rays of one small picture, and their shadow rays, are traced by the compiled tracer and by the NumPy one: hits, nodes
and tests of every ray bit for bit. What must not change a hit is held against brute force. `count` is the side of the
picture.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from refsim.experiments import bsh_published as published
from refsim.experiments import gsr_published
from refsim.experiments.bsh_runs import rays_of, scene_of
from refsim.experiments.equations import Found, bits_differ, number
from refsim.methods import trace
from refsim.reference.list_heads import side_normals
from refsim.reference.traversal_lists import directions as list_directions
from refsim.results import Trace
from refsim.scene.material import Material

BODY, LISTS, CELLS = "torus_knot_100", 6, 4
GLASS = Material("glass", "glass", (1.0, 1.0, 1.0))
HEADS: dict[str, Any] = {"heads": "regular"}
SHARE = 0.05  # percentage points: what a figure of one digit leaves open


@lru_cache(maxsize=32)
def run(size: int, backend: str = "numba", glass: bool = False, **options: Any) -> Trace:
    """Eye rays and, of plaster, shadow rays; of glass, the path through it."""
    scene = scene_of(BODY)
    chosen: dict[str, Any] = {"shadows": True, "generations": 2, "facing": "front"}
    if glass:
        scene, chosen = scene.with_materials(GLASS), {"generations": 4}
    return trace("traversal_list", scene, rays_of(BODY, size), backend=backend, **chosen, **options)


@lru_cache(maxsize=4)
def right(size: int, glass: bool = False) -> Trace:
    """Brute force on the same eye rays."""
    scene = scene_of(BODY)
    chosen: dict[str, Any] = {"generations": 1, "facing": "front"}
    if glass:
        scene, chosen = scene.with_materials(GLASS), {"generations": 4}
    return trace("brute_force", scene, rays_of(BODY, size), **chosen)


def rays_differ(size: int, **options: Any) -> int:
    """Rays whose hit, nodes or tests differ between the compiled tracer and the NumPy one."""
    total = 0
    for a, b in zip(run(size, **options).generations, run(size, "numpy", **options).generations, strict=True):
        if len(a.rays) != len(b.rays):
            total += max(len(a.rays), len(b.rays))
            continue
        off = bits_differ(a.hits.triangle, b.hits.triangle) | bits_differ(a.hits.t, b.hits.t)
        for name in ("nodes", "triangle_tests"):
            off |= bits_differ(a.per_ray[name], b.per_ray[name])
        total += number(off)
    return total


def wrong_hits(size: int, glass: bool = False, **options: Any) -> int:
    """Rays of all generations that brute force also has, whose hit is another."""
    total = 0
    for a, b in zip(run(size, glass=glass, **options).generations, right(size, glass).generations, strict=False):
        total += number(bits_differ(a.hits.triangle, b.hits.triangle) | bits_differ(a.hits.t, b.hits.t))
    return total


def shot(size: int, **options: Any) -> int:
    """Rays of all generations."""
    return sum(number(g.alive) for g in run(size, **options).generations)


def pseudo_code(size: int) -> Found:
    """The loop with the exit root for "the intersection parameter" of a sphere, and with the entry root."""
    printed: dict[str, Any] = {"errata": "BSH-E5"}
    differs = rays_differ(size) + rays_differ(size, **printed)
    return Found(shot(size), differs, wrong_hits(size, **printed), wrong_hits(size))


def polygon_heads(size: int) -> Found:
    """Heads that skip what lies behind a polygon, for rays that leave it on either side (glass)."""
    printed = {**HEADS, "errata": "BSH-E9"}
    differs = rays_differ(size, glass=True, **HEADS) + rays_differ(size, glass=True, **printed)
    return Found(shot(size, glass=True, **HEADS), differs, wrong_hits(size, True, **printed),
                 wrong_hits(size, True, **HEADS))  # fmt: skip


def kept_hits(**options: Any) -> Any:
    """An optimisation that must lose no hit; shadow rays are held against a run without it."""
    def check(size: int) -> Found:
        wrong = wrong_hits(size, **options)
        plain, fast = run(size).generations[1], run(size, **options).generations[1]
        wrong += number((plain.hits.triangle >= 0) != (fast.hits.triangle >= 0))
        return Found(shot(size), rays_differ(size, **options), wrong, wrong)

    return check


simple_heads = kept_hits(heads="simple")
regular_heads = kept_hits(**HEADS)
screen_cells = kept_hits(screen_cells=CELLS)
safe_culling = kept_hits(culling="sextant_safe")
layers = kept_hits(layers=(40,))


def side_planes(size: int) -> Found:
    """Four further planes a sextant, which no direction of the sextant leaves."""
    rng = np.random.default_rng(63)
    wrong = 0
    for k, along in enumerate(list_directions(LISTS)):
        normals = side_normals(LISTS, k)
        axis = int(np.argmax(np.abs(along)))
        d = rng.uniform(-1.0, 1.0, (size * size, 3))
        d[:, axis] = along[axis]
        wrong += (len(normals) != 4) + number((d @ np.array(normals).T < 0.0).any(axis=1))
    return Found(LISTS * size * size, "", wrong, wrong)


def refits(size: int) -> Found:
    """Vertices moved without a new hierarchy: spheres hold their triangles, and no hit is lost."""
    from refsim.papers.sphere_hierarchy.hierarchy import build_hierarchy
    from refsim.papers.sphere_hierarchy.lists import build_lists
    from refsim.papers.sphere_hierarchy.refit import refit

    scene = scene_of(BODY)
    turn = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])
    moved = (scene.triangles.astype(np.float64) @ turn.T + [0.1, 0.0, -0.2]).astype(np.float32)
    lists = refit(build_lists(build_hierarchy(scene)), moved).lists
    h = lists.hierarchy
    wrong, parent = 0, h.owner.copy()
    rows = np.arange(len(moved))
    while len(rows):
        spheres = h.spheres[parent[rows]].astype(np.float64)
        reach = np.linalg.norm(moved[rows].astype(np.float64) - spheres[:, None, :3], axis=2).max(axis=1)
        wrong += number(reach > spheres[:, 3])
        parent[rows] = h.parent[parent[rows]]
        rows = rows[parent[rows] >= 0]
    return Found(len(moved), "", wrong, wrong)


def counter(size: int) -> Found:
    """Traversed nodes a ray, as printed, are not more than a list can have: two elements a triangle, and one."""
    wrong = [rates.nodes_per_ray > 2 * count + 1 for count, _, rates in published.TABLE_2.values()]
    return Found(len(wrong), printed_fails=sum(wrong))


def heavy(size: int) -> Found:
    """The incidence of the optimisations on nodes a ray: worst against best of Table 1."""
    nodes = [rates.nodes_per_ray for rates in published.TABLE_1.values()]
    least, most = min(nodes), max(nodes)
    readings = (100.0 * (1.0 - least / most), 100.0 * (most / least - 1.0))
    return Found(1, printed_fails=int(all(abs(value - published.SAID_HEAVY) > SHARE for value in readings)))


def copy_ratio(size: int) -> Found:
    """Table 3's third column is the first by the second: some numbers that round to all three as printed are."""
    half, wrong = 0.05, 0
    for copy, frame, ratio in published.TABLE_3.values():
        least, most = (100.0 * (copy + sign * half) / (frame - sign * half) for sign in (-1.0, 1.0))
        wrong += not (least <= ratio + half and ratio - half <= most)
    return Found(len(published.TABLE_3), printed_fails=wrong)


def frame_time(size: int) -> Found:
    """Table 3's frame is the inverse of Table 2's frames a second, which has three digits."""
    wrong = [
        abs(1e3 / published.TABLE_2[scene][2].fps / frame - 1.0) > 0.005
        for scene, (_, frame, _) in published.TABLE_3.items()
    ]
    return Found(len(wrong), printed_fails=sum(wrong))


def ground_quad(size: int) -> Found:
    """Table 2's scenes have two triangles more than the meshes, which the geometry shader's paper counts alone."""
    alone = {"Bunny": gsr_published.TABLE_3["Stanford Bunny"][0], "Dragon": gsr_published.TABLE_3["Dragon"][0]}
    wrong = [published.TABLE_2[scene][0] - count != 2 for scene, count in alone.items()]
    return Found(len(wrong), printed_fails=sum(wrong))


def eye_and_shadow(size: int) -> Found:
    """Rays a pixel, from rays a second and frames a second: between one (no light reaches) and two (every hit)."""
    rates = [rates for _, _, rates in published.TABLE_2.values()] + list(published.TABLE_1.values())
    wrong = [not 1.0 <= each.rays_per_pixel <= 2.0 for each in rates]
    return Found(len(wrong), printed_fails=sum(wrong))


