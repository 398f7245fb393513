"""What 24 bits of depth cost: the distance t in a fixed-point depth buffer, as the paper's card had it, in wrong hits.

The Hierarchical Ray Engine, section 2.1: "using the distance of the intersection as a depth value, a depth test is
performed to verify that no closer intersection has been found yet". t is divided by a power of two, the range; a depth
of 24 bits rounds it to whole steps of range · 2⁻²⁴. Two hits of one step are alike, and the first drawn stays: it is
wrong where it is not the nearer one. A float32 depth orders every two different t.

Prediction: a hit is wrong exactly where an earlier triangle in the file is hit within the nearest one's step, so never
by more than a step. Every ray is shot at every triangle to know that before the engine says it.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.experiments.depth_24_plot import plot
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import HIERARCHICAL, RAY_ENGINE, scene_named
from refsim.geometry.triangle import pack_triangles
from refsim.image import encode_srgb
from refsim.jit import specialise
from refsim.methods import trace
from refsim.results import Generation, Trace
from refsim.scene import Rays, Scene, camera_rays
from refsim.scene.stages import on_ground
from refsim.shading import environment_of, shade

BODIES = ("torus_knot_1024", "torus_knot_5000", "blob_1000", "sphere_896")
QUICK_BODIES = ("torus_knot_256", "blob_200")
FILL = 0.8  # outlines in view: there, front and back are close to each other
MOST = 1100  # triangles that the Ray Engine is run with
# Half the side of a ground below, in diagonals of the body: the range grows with it
GROUNDS = (0.75, 4.0)
# The range, times these: what the same rays would meet in a larger world
FACTORS = (1, 16, 256, 4096, 65536)
STEPS = 2**24 - 1
FLOAT, FIXED = "depth32float-stencil8", "depth24unorm-stencil8"
MILLION = 1e6


def cases(quick: bool) -> list[Case]:
    """A case a body, and one on grounds. `--quick` runs the plain NumPy reference: same hits, less to compile."""
    backend = "numpy" if quick else "numba"
    frame = {"size_px": 32 if quick else 256, "tile_px": 8 if quick else 16, "generations": 5, "backend": backend}
    bodies = [(scene, 0.0) for scene in (QUICK_BODIES if quick else BODIES)]
    bodies += [] if quick else [("torus_knot_1024", half) for half in GROUNDS]
    return [{"scene": scene, "ground_half": half, "fill": FILL, **frame} for scene, half in bodies]


@lru_cache(maxsize=2)
def stage(scene: str, ground_half: float) -> Scene:
    """The body, or the body on a ground of that size; 0: none."""
    body = scene_named(scene)
    return on_ground(body, half=ground_half) if ground_half else body


def measure(
    scene: str, ground_half: float, fill: float, size_px: int, tile_px: int, generations: int, backend: str
) -> Rows:
    """A row a generation; a row a range; and one for the picture."""
    world = stage(scene, ground_half)
    rays = camera_rays(scene_named(scene), size_px, size_px, fill=fill)
    options: dict[str, Any] = {"generations": generations, "backend": backend}
    tiles = {**options, "tile_size": tile_px}
    right = trace(HIERARCHICAL, world, rays, depth_format=FLOAT, **tiles)
    coarse = trace(HIERARCHICAL, world, rays, depth_format=FIXED, **tiles)
    others = {"other_submission": trace(HIERARCHICAL, world, rays, depth_format=FIXED, submission="primitive", **tiles)}
    if len(world) <= MOST:
        others["ray_engine"] = trace(RAY_ENGINE, world, rays, depth_format=FIXED, stencil=True, **options)
    scale = depth_scale(world, rays)
    head = {
        "scene": scene, "triangles": len(world), "ground_half": ground_half, "size_px": size_px, "tile_px": tile_px,
        "fill": fill, "depth_range": float(1.0 / scale),
    }  # fmt: skip
    rows: Rows = []
    for k, passed in enumerate(right.generations):
        weighed = weigh(world, passed, scale)
        found = {name: other.generations[k] for name, other in others.items()}
        rows.append({**head, "generation": k, **_generation(world, passed, coarse.generations[k], found, weighed)})
        rows += [{**head, "generation": k, **line} for line in _ranges(passed, weighed)]
    return [*rows, {**head, **_pictures(right, coarse)}]


def depth_scale(scene: Scene, rays: Rays) -> np.float32:
    """The power of two that the engines multiply t by."""
    from refsim.papers.hierarchical_ray_engine.tracer import depth_scale as of_engine

    return of_engine(scene, rays)


class Weighed(NamedTuple):
    """What `weigh_hits` found: per ray, and with 24 bits per factor and ray."""

    nearest: NDArray[np.int32]
    t: NDArray[np.float32]
    tied: NDArray[np.int32]
    shown: NDArray[np.int32]
    shown_t: NDArray[np.float32]
    last: NDArray[np.int32]
    alike: NDArray[np.int32]
    scale: float

    def wrong(self, factor: int) -> NDArray[np.bool_]:
        """Rays whose first drawn hit of the nearest step is not the nearest hit."""
        return (self.nearest >= 0) & (self.shown_t[factor] != self.t)


def weigh(scene: Scene, passed: Generation, scale: np.float32) -> Weighed:
    """All hits of a generation's rays."""
    from refsim.experiments.depth_24_kernels import weigh_hits

    records = pack_triangles(scene.triangles)
    triangles = np.column_stack([records.v0, records.n, records.m1, records.m2])
    live = np.flatnonzero(passed.alive)
    n, k = len(passed.alive), len(FACTORS)
    none, zero = np.full(len(live), -1, np.int32), np.zeros(len(live), np.int32)
    nearest, tied, t = none.copy(), zero, np.full(len(live), np.inf, np.float32)
    shown, shown_t = np.full((k, len(live)), -1, np.int32), np.full((k, len(live)), np.inf, np.float32)
    last, alike = shown.copy(), np.zeros((k, len(live)), np.int32)
    scales = np.array([scale / np.float32(factor) for factor in FACTORS], np.float32)
    rays = passed.rays
    specialise(weigh_hits, {})(
        rays.origin[live], rays.direction[live], rays.t_max[live], triangles, scales,
        t, nearest, tied, shown, shown_t, last, alike,
    )  # fmt: skip

    def everywhere(part: NDArray[Any], value: float) -> NDArray[Any]:
        whole = np.full((*part.shape[:-1], n), value, part.dtype)
        whole[..., live] = part
        return whole

    return Weighed(
        everywhere(nearest, -1), everywhere(t, np.inf), everywhere(tied, 0), everywhere(shown, -1),
        everywhere(shown_t, np.inf), everywhere(last, -1), everywhere(alike, 0), float(scale),
    )  # fmt: skip


def same_rays(a: Generation, b: Generation) -> NDArray[np.bool_]:
    """Live rays that are the same, bit for bit: what an earlier generation did wrong is not counted again."""
    same = a.alive & b.alive
    for name in ("origin", "direction"):
        same &= (getattr(a.rays, name) == getattr(b.rays, name)).all(axis=1)
    return same


def _generation(
    scene: Scene, right: Generation, coarse: Generation, others: Mapping[str, Generation], weighed: Weighed
) -> Row:
    same, hit = same_rays(right, coarse), right.hits.triangle >= 0
    wrong = same & ((right.hits.triangle != coarse.hits.triangle) | (right.hits.t != coarse.hits.t))
    behind = wrong & hit & (coarse.hits.triangle >= 0)
    gap = coarse.hits.t[behind].astype(np.float64) - right.hits.t[behind]
    worst = float(gap.max()) if len(gap) else 0.0
    unlike_float = (right.hits.triangle != weighed.nearest) & right.alive
    unlike_fixed = same & ((coarse.hits.triangle != weighed.shown[0]) | hit & (coarse.hits.t != weighed.shown_t[0]))
    row: Row = {
        "rays": int(right.alive.sum()),
        "hits": int(hit.sum()),
        "same_rays": int(same.sum()),
        "float32_tied_rays": int((weighed.tied > 1).sum()),
        "float32_wrong_hits": int(unlike_float.sum()),
        "alike_rays": int((weighed.alike[0] > 1).sum()),
        "wrong_hits": int(wrong.sum()),
        "lost_hits": int((wrong & hit & (coarse.hits.triangle < 0)).sum()),
        "predicted_wrong_hits": int((weighed.wrong(0) & same).sum()),
        "not_as_predicted": int(unlike_fixed.sum()),
        "worst_gap_steps": round(worst * weighed.scale * STEPS, 4),
        "worst_gap_ppm_of_scene": round(MILLION * worst / scene.diagonal, 5),
    }
    row["ray_engine_differs"] = ""
    for name, other in others.items():
        both = same_rays(coarse, other)
        row[f"{name}_differs"] = int(
            (coarse.alive != other.alive).sum() + (coarse.alive & ~both).sum()
            + (both & (coarse.hits.triangle != other.hits.triangle)).sum()
        )  # fmt: skip
    return row


def _ranges(passed: Generation, weighed: Weighed) -> Rows:
    hits = int((weighed.nearest >= 0).sum())
    rows = []
    for k, factor in enumerate(FACTORS):
        wrong = weighed.wrong(k)
        gap = weighed.shown_t[k, wrong].astype(np.float64) - weighed.t[wrong]
        rows.append(
            {
                "range_factor": factor,
                "hits": hits,
                "alike_rays": int((weighed.alike[k] > 1).sum()),
                "wrong_hits": int(wrong.sum()),
                "worst_gap_steps": round(float(gap.max()) * weighed.scale / factor * STEPS, 4) if len(gap) else 0.0,
            }
        )
    return rows


def _pictures(right: Trace, coarse: Trace) -> Row:
    """How many pixels of the picture, in 8-bit sRGB, are not the same, and by how much."""
    surroundings = environment_of(right.scene, None)
    a, b = (encode_srgb(np.clip(shade(found, surroundings), 0.0, 1.0)).astype(int) for found in (right, coarse))
    change = np.abs(a - b).max(axis=1)
    return {
        "pixels": len(change),
        "pixels_changed": int((change > 0).sum()),
        "pixels_changed_by_16": int((change >= 16).sum()),
        "largest_change_of_255": int(change.max()),
    }


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Generations, ranges, pictures."""
    return {
        "depth-24": [row for row in rows if "not_as_predicted" in row],
        "depth-24-ranges": [row for row in rows if "range_factor" in row],
        "depth-24-pictures": [row for row in rows if "pixels_changed" in row],
    }


EXPERIMENT = Experiment(
    "depth-24",
    "What 24 bits of depth cost in wrong hits",
    "256² rays, 5 generations (32² in the NumPy reference with `--quick`), the same rays with a float32 and with a "
    "24-bit depth. A hit is wrong where the first drawn of several hits of one depth step is not the nearest. Left: "
    "wrong hits per million hits, if the range of depth were larger by a factor (every hit of every ray is weighed); "
    "at 1 the engine is run and found to do just that. A marker at the foot: none. Right: how far a wrong hit lies "
    "behind the nearest, at most, in depth steps.",
    cases,
    measure,
    plot,
    tables,
    alt="Left, wrong hits per million rise with the depth range, about as fast as the range. Right, markers for each "
    "body that all stay below one depth step.",
)
