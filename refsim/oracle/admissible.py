"""Which answers a correct float32 implementation may give for each ray, and how far away the nearest other one is.

Exact equality is the wrong contract and a plain tolerance excuses real faults. Here every triangle near a ray is
weighed against a proven forward-error bound (`bounds.py`): it must be accepted, may be, or must not. Of the triangles
that may be accepted, those that lie surely behind one that must be are not admissible. Shares no code with the engine.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.oracle.bounds import LENGTH, MUST, NORMAL
from refsim.oracle.exact import closest as exact_closest
from refsim.oracle.search import HIGH, LOW, U_BOUND, V_BOUND, T, U, V, search
from refsim.oracle.tree import Bodies, prepare
from refsim.oracle.watertight import sealed_depth
from refsim.scene.rays import Rays

Facing = Literal["both", "front"]
_RUN = 8192  # rays a kernel call: bounds the scratch memory and spreads the work


@dataclass(frozen=True)
class Admissible:
    """Admissible answers of n rays; candidates of ray i are rows offsets[i] … offsets[i+1] − 1, by triangle index.

    offsets i64[n+1]; triangles i32[k]: those that may be returned as the closest hit.
    t_float64 f64[k]: where the ray crosses the plane; the float32 t may be anywhere in [t_low, t_high] f64[k],
    t_bound f64[k] is the larger deviation. u, v f64[k], u_bound, v_bound f64[k]: weights of vertices 1 and 2 and their
    bounds. Bounds are inf where the ray may lie in the plane. certain bool[k]: a correct implementation accepts it.
    miss bool[n]: a miss is admissible. closest i32[n], t f64[n]: the exact answer, lowest index among exact ties,
    −1 and inf for a miss; t errs by less than 1e-6 of its bound. order_dependent bool[n]: several tie exactly.
    margin f64[n]: by how many bounds the nearest other answer is away, at most 8; above 1 the answer is unique (without
    claims of watertightness). conditioning f64[n]: 1/|cos θ| at the closest hit, 0 for a miss.
    dead bool[n]: zero direction or t_max 0; only a miss is admissible. Lengths are in multiples of the direction.
    """

    offsets: NDArray[np.int64]
    triangles: NDArray[np.int32]
    t_float64: NDArray[np.float64]
    t_low: NDArray[np.float64]
    t_high: NDArray[np.float64]
    t_bound: NDArray[np.float64]
    u: NDArray[np.float64]
    v: NDArray[np.float64]
    u_bound: NDArray[np.float64]
    v_bound: NDArray[np.float64]
    certain: NDArray[np.bool_]
    miss: NDArray[np.bool_]
    closest: NDArray[np.int32]
    t: NDArray[np.float64]
    margin: NDArray[np.float64]
    conditioning: NDArray[np.float64]
    order_dependent: NDArray[np.bool_]
    dead: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.miss)

    @property
    def answers(self) -> NDArray[np.int64]:
        """i64[n]: number of admissible answers, a miss counted as one."""
        return np.diff(self.offsets) + self.miss

    def of(self, ray: int) -> NDArray[np.int32]:
        """Return the admissible triangles of one ray, i32, ascending."""
        return self.triangles[self.offsets[ray]:self.offsets[ray + 1]]

    def rows(self, triangle: NDArray[np.int32]) -> NDArray[np.int64]:
        """Return for each ray the row of its candidate `triangle` (i32[n]), −1 where that is not admissible."""
        owner = np.repeat(np.arange(len(self), dtype=np.int64), np.diff(self.offsets))
        keys = (owner << 32) + self.triangles
        wanted = (np.arange(len(self), dtype=np.int64) << 32) + np.maximum(triangle, 0)
        row = np.searchsorted(keys, wanted)
        found = (triangle >= 0) & (row < len(keys))
        found[found] = keys[row[found]] == wanted[found]
        return np.where(found, row, -1)


def bodies_of(scene_or_triangles: Any) -> Bodies:
    """Return prepared triangles of a scene (its `.triangles`), an array f32[n,3,3], or as they are when prepared."""
    if isinstance(scene_or_triangles, Bodies):
        return scene_or_triangles
    return prepare(np.asarray(getattr(scene_or_triangles, "triangles", scene_or_triangles)))


def admissible(
    scene_or_triangles: Any, rays: Rays, *, facing: Facing = "both", watertight: bool = False,
    threads: int | None = None, brute: bool = False,
) -> Admissible:
    """Find the admissible answers of every ray, whatever the number of threads.

    scene_or_triangles: a Scene, f32[n,3,3], or the result of `bodies_of` (saves building the tree again).
    facing: "front" accepts only hits with n·d < 0, back faces within their bound. watertight: a miss through a closed
    patch of triangles with common vertex positions is not admissible. brute: weigh every triangle, without the tree.
    Raises InputError for an unknown facing or an array that is not f32[n,3,3].
    """
    if facing not in ("both", "front"):
        raise InputError(f'facing is {facing!r}, it must be "both" or "front"')
    bodies = bodies_of(scene_or_triangles)
    n = len(rays)
    kinds = (bool, np.int32, float, float, bool, np.int64)  # miss, closest, t, margin, in doubt, number of candidates
    columns = tuple(np.empty(n, kind) for kind in kinds)
    dead = ~np.any(rays.direction != 0.0, axis=1) | ~(rays.t_max > 0.0)
    singles = np.flatnonzero(~bodies.degenerate).astype(np.int32) if brute else bodies.slivers

    ball = np.append(bodies.middle, bodies.radius)

    def settle(first: int) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.int32]]:
        part = slice(first, min(first + _RUN, n))
        return search(
            bodies.table, tuple(bodies.space), tuple(bodies.planes), singles, ball, bodies.reach, bodies.edge, brute,
            rays.origin[part], rays.direction[part], rays.t_max[part], ~dead[part], facing == "front",
            *(column[part] for column in columns))

    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        parts = list(pool.map(settle, range(0, max(n, 1), _RUN)))
    ids, values, bits = (np.concatenate([part[k] for part in parts]) for k in range(3))
    miss, closest, t, margin, unsure, counts = columns
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    ties = _decide_exactly(bodies, rays, np.flatnonzero(unsure), offsets, ids, closest, t, facing == "front")
    if watertight:
        keep = _seal(bodies, rays, offsets, ids, values, bits, miss)
        owner = np.repeat(np.arange(n), np.diff(offsets))[keep]
        ids, values, bits = ids[keep], values[keep], bits[keep]
        offsets = np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=n))]).astype(np.int64)
    with np.errstate(invalid="ignore"):
        wide = np.maximum(values[:, HIGH] - values[:, T], values[:, T] - values[:, LOW])
    return Admissible(
        offsets=offsets, triangles=ids, t_float64=values[:, T].copy(), t_low=values[:, LOW].copy(),
        t_high=values[:, HIGH].copy(), t_bound=wide, u=values[:, U].copy(), v=values[:, V].copy(),
        u_bound=values[:, U_BOUND].copy(), v_bound=values[:, V_BOUND].copy(), certain=(bits & MUST) != 0,
        miss=miss, closest=closest, t=t, margin=margin, conditioning=_conditioning(bodies, rays, closest),
        order_dependent=ties, dead=dead)


def _conditioning(bodies: Bodies, rays: Rays, closest: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return 1/|cos θ| at the closest hit, 0 for a miss."""
    result = np.zeros(len(rays))
    hit = closest >= 0
    row = bodies.table[closest[hit]]
    way = rays.direction[hit].astype(np.float64)
    across = np.abs((row[:, NORMAL:NORMAL + 3] * way).sum(axis=1))
    with np.errstate(divide="ignore"):
        result[hit] = row[:, LENGTH] * np.sqrt((way * way).sum(axis=1)) / across
    return result


def _decide_exactly(
    bodies: Bodies, rays: Rays, doubtful: NDArray[np.int64], offsets: NDArray[np.int64], ids: NDArray[np.int32],
    closest: NDArray[np.int32], t: NDArray[np.float64], front: bool,
) -> NDArray[np.bool_]:
    """Settle closest and t of the doubtful rays in integers; return bool[n], the rays with exact ties."""
    ties = np.zeros(len(rays), bool)
    for i in doubtful:
        closest[i], t[i], ties[i] = exact_closest(
            rays.origin[i], rays.direction[i], float(rays.t_max[i]), bodies.vertices,
            ids[offsets[i]:offsets[i + 1]].tolist(), front)
    return ties


def _seal(
    bodies: Bodies, rays: Rays, offsets: NDArray[np.int64], ids: NDArray[np.int32], values: NDArray[np.float64],
    bits: NDArray[np.int32], miss: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Forbid misses through closed patches, and hits behind them; return bool[k], the candidates that stay."""
    keep = np.ones(len(ids), bool)
    for i in np.flatnonzero(np.diff(offsets) > 1):
        part = slice(offsets[i], offsets[i + 1])
        highs, known = values[part, HIGH].tolist(), bits[part].tolist()
        depth = sealed_depth(rays.direction[i], bodies.vertices[ids[part]], highs, known)
        if depth < np.inf:
            miss[i] = False
            keep[part] = values[part, LOW] <= depth
    return keep
