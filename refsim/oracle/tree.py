"""The judge's own acceleration: one tree over positions, one over planes.

A triangle can be a candidate far away from its box: at grazing incidence the bound on u and v is proportional to
1/|cos θ|. The first tree finds candidates near the ray, above a fixed |cos θ|; the second, over unit normals and plane
offsets, finds the planes that nearly contain the ray, wherever their triangles are (`search.py` says why this is all).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.oracle.bounds import ASPECT, COLUMNS, E1, E2, EDGE, FINITE, LENGTH, NORMAL, SLIVER, V0
from refsim.oracle.compiled import kernel
from refsim.oracle.exact import zero_area

LEAF = 4
# Keys of a triangle: low and high corner, unit normal, offset of the plane from the scene's middle.
_LOW, _HIGH, _UNIT, _OFFSET, _KEYS = 0, 3, 6, 9, 10
# A node: centre and half size of [0:3] the box, [3:6] the normals, [6] the offset; then the largest aspect.
NODE_COLUMNS = 15


class Tree(NamedTuple):
    """order i32[k]: triangles, leaf after leaf; links i32[m,2]: both children, or first and −count of a leaf (0 too);
    nodes f64[m,15]: centres [0:7] and half sizes [7:14] of box, normals and offset, and the largest aspect.
    """

    order: NDArray[np.int32]
    links: NDArray[np.int32]
    nodes: NDArray[np.float64]


@dataclass(frozen=True)
class Bodies:
    """Triangles made ready to be judged against.

    vertices f32[n,3,3]; table f64[n,16] (`bounds.py` names the columns); degenerate bool[n]: exactly zero area or not
    finite, never hit. space, planes: the two trees. slivers i32: triangles outside the trees, always tested.
    middle f64[3], radius: a ball around the trees' triangles; reach, edge: their largest |vertex| and longest edge.
    """

    vertices: NDArray[np.float32]
    table: NDArray[np.float64]
    degenerate: NDArray[np.bool_]
    space: Tree
    planes: Tree
    slivers: NDArray[np.int32]
    middle: NDArray[np.float64]
    radius: float
    reach: float
    edge: float


def triangle_table(vertices: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the table f64[n,16] of edges, normal, shape, and which triangles have zero area or are not finite."""
    v = vertices.astype(np.float64)
    table = np.zeros((len(v), COLUMNS))
    finite = np.isfinite(v).all(axis=(1, 2))
    v[~finite] = 0.0
    e1, e2 = v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]
    normal = np.cross(e1, e2)
    length = np.sqrt((normal * normal).sum(axis=1))
    # Float64 decides where it can; the rest in integers.
    size = np.abs(e1).max(axis=1, initial=0.0) * np.abs(e2).max(axis=1, initial=0.0)
    degenerate: NDArray[np.bool_] = np.logical_not(finite)
    for i in np.flatnonzero(finite & (length <= 2.0**-48 * size)):
        degenerate[i] = zero_area(vertices[i]) or length[i] == 0.0
    table[:, V0:V0 + 3], table[:, E1:E1 + 3], table[:, E2:E2 + 3] = v[:, 0], e1, e2
    table[:, NORMAL:NORMAL + 3], table[:, LENGTH] = normal, length
    edge = np.sqrt(np.maximum.reduce([(e * e).sum(axis=1) for e in (e1, e2, e2 - e1)]))
    table[:, EDGE] = edge
    with np.errstate(all="ignore"):
        table[:, ASPECT] = np.where(degenerate, 0.0, edge * edge / length)
        m1, m2 = np.cross(e2, normal) / length[:, None] ** 2, np.cross(normal, e1) / length[:, None] ** 2
        table[:, FINITE] = (np.isfinite(m1.astype(np.float32)) & np.isfinite(m2.astype(np.float32))).all(axis=1)
    return table, degenerate


@kernel
def _split(points, ids, leaf):
    """Split at the median of the widest coordinate; return order, links and the span of every node."""
    n = len(ids)
    capacity = n + 8
    order = ids.copy()
    links = np.zeros((capacity, 2), np.int32)
    spans = np.zeros((capacity, 2), np.int32)
    spans[0, 1] = n
    used, at = 1, 0
    while at < used:
        first, last = spans[at, 0], spans[at, 1]
        if last - first <= leaf:
            links[at, 0], links[at, 1] = first, first - last
            at += 1
            continue
        axis, widest = 0, -1.0
        for k in range(points.shape[1]):
            lo, hi = np.inf, -np.inf
            for i in range(first, last):
                lo, hi = min(lo, points[order[i], k]), max(hi, points[order[i], k])
            if hi - lo > widest:
                axis, widest = k, hi - lo
        part = order[first:last].copy()
        keys = np.empty(last - first)
        for i in range(last - first):
            keys[i] = points[part[i], axis]
        rank = np.argsort(keys, kind="mergesort")
        for i in range(last - first):
            order[first + i] = part[rank[i]]
        half = first + (last - first) // 2
        links[at, 0], links[at, 1] = used, used + 1
        spans[used, 0], spans[used, 1] = first, half
        spans[used + 1, 0], spans[used + 1, 1] = half, last
        used += 2
        at += 1
    return order, links[:used].copy(), spans[:used].copy()


@kernel
def _fit(keys, aspect, order, spans, nodes):
    """Fill the nodes from the keys of their triangles, widened by more than the float64 roundings."""
    for at in range(len(nodes)):
        first, last = spans[at, 0], spans[at, 1]
        for k in range(7):
            a, b = (k, k + 3) if k < 3 else (k + 3, k + 3)
            lo, hi = np.inf, -np.inf
            for i in range(first, last):
                lo, hi = min(lo, keys[order[i], a]), max(hi, keys[order[i], b])
            nodes[at, k] = 0.5 * (lo + hi)
            nodes[at, 7 + k] = 0.5 * (hi - lo) * (1.0 + 2.0**-40) + 2.0**-46 * max(abs(lo), abs(hi))
        for i in range(first, last):
            nodes[at, 14] = max(nodes[at, 14], aspect[order[i]])


def _tree(
    points: NDArray[np.float64], keys: NDArray[np.float64], aspect: NDArray[np.float64], ids: NDArray[np.int32]
) -> Tree:
    """Build one tree over the triangles `ids`, split by `points` f64[n,k]."""
    order, links, spans = _split(points, ids, LEAF)
    nodes = np.zeros((len(links), NODE_COLUMNS))
    if len(ids):
        _fit(keys, aspect, order, spans, nodes)
    return Tree(order, links, nodes)


def prepare(vertices: NDArray[np.float32]) -> Bodies:
    """Build the table and the trees. vertices: f32[n,3,3].

    Raises InputError when the array has another shape or type.
    """
    if vertices.dtype != np.float32 or vertices.ndim != 3 or vertices.shape[1:] != (3, 3):
        raise InputError(f"triangles are {vertices.dtype}{list(vertices.shape)}, they must be float32[n, 3, 3]")
    table, degenerate = triangle_table(vertices)
    v = np.where(degenerate[:, None, None], 0.0, vertices.astype(np.float64))
    thin = ~degenerate & ~(table[:, ASPECT] < SLIVER)
    ids = np.flatnonzero(~degenerate & ~thin).astype(np.int32)
    keys = np.zeros((len(v), _KEYS))
    keys[:, _LOW:_LOW + 3], keys[:, _HIGH:_HIGH + 3] = v.min(axis=1), v.max(axis=1)
    corners = v[ids].reshape(-1, 3) if len(ids) else np.zeros((1, 3))
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    radius = float(np.sqrt(((corners - middle) ** 2).sum(axis=1).max())) * (1.0 + 2.0**-40)
    unit = table[ids, NORMAL:NORMAL + 3] / table[ids, LENGTH, None]
    keys[ids, _UNIT:_UNIT + 3] = unit
    keys[ids, _OFFSET] = (unit * (v[ids, 0] - middle)).sum(axis=1)
    plane = keys[:, _UNIT:] / np.array([1.0, 1.0, 1.0, max(radius, 1e-300)])
    return Bodies(
        vertices=vertices, table=table, degenerate=degenerate,
        space=_tree(keys[:, _LOW:_LOW + 3] + keys[:, _HIGH:_HIGH + 3], keys, table[:, ASPECT].copy(), ids),
        planes=_tree(plane, keys, table[:, ASPECT].copy(), ids),
        slivers=np.flatnonzero(thin).astype(np.int32), middle=middle, radius=radius,
        reach=float(np.sqrt((corners**2).sum(axis=1).max())), edge=float(table[ids, EDGE].max(initial=0.0)),
    )
