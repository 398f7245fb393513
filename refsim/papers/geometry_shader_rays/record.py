"""The ray as a vertex: Listing 2's packed hit record, its states and types, and the tree of rays of a pixel.

    pos       vec4  offset  0   pixel centre in NDC (x, y); z carries the path's weight; w = 1
    orig_t    vec4  offset 16   ray origin, ray parameter t (before the search: where it ends)
    dir_idx   vec4  offset 32   ray direction, hit triangle (−1 none)
    uv_state  vec4  offset 48   barycentric u, v; state; type

64 bytes, all float32 (section 4); whole numbers in it are exact up to 2²⁴. Listing 1 is the same unpacked.

The listings know one tree: an eye ray, its shadow ray, its reflected ray. In general a surface ray of the tree is a
*node*: the eye ray is node 0; with b kinds of ray that go on from a hit, node n has the children b·n + 1 (reflected)
and, where b = 2, b·n + 2 (refracted). `type` is −n for the surface ray of node n, and 1 + l + L·n for the shadow ray
from its hit towards light l of L: on the listings' tree that is 0, −1 and 1, as printed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.pipeline.layout import vec4
from refsim.results import RayKind

# Listing 3–5: what a pass is to do with a ray
TO_BE_MADE, TO_BE_SHOT, MARKED, SHADED = 0, 1, 2, 3
RECORD_BYTES = 64
MOST_TRIANGLES = MOST_TYPES = 2**24


class PackedHit(NamedTuple):
    """Listing 2, "encoded as four component floating point vectors"."""

    pos: vec4
    orig_t: vec4
    dir_idx: vec4
    uv_state: vec4


# Columns of the record's scalars, as a vertex buffer stores them
X, Y, WEIGHT, ORIGIN, T, DIRECTION, INDEX, U, V, STATE, TYPE = 0, 1, 2, 4, 7, 8, 11, 12, 13, 14, 15


def nodes_of(types: NDArray[np.float32], lights: int) -> NDArray[np.int64]:
    """The node of each ray, or the node from whose hit a shadow ray starts."""
    code = types.astype(np.int64)
    return np.where(code > 0, (code - 1) // max(lights, 1), -code)


def kinds_of(types: NDArray[np.float32], branching: int) -> NDArray[np.int32]:
    """`RayKind` of each type, int32."""
    code = types.astype(np.int64)
    surface = np.where((branching == 2) & (code % 2 == 0), RayKind.REFRACTED, RayKind.REFLECTED)
    return np.where(code > 0, RayKind.SHADOW, np.where(code == 0, RayKind.EYE, surface)).astype(np.int32)


def check_types(nodes: int, lights: int) -> None:
    """Raises `InputError` where the type of some ray would be no whole number in float32."""
    if max(nodes - 1, lights * nodes) > MOST_TYPES:
        raise InputError(f"{nodes} nodes, {lights} lights: more types of rays than the {MOST_TYPES} of a float32.")


def node_count(passes: int, branching: int) -> int:
    """Nodes of the tree of depth `passes`: a chain, or a full binary tree."""
    return passes if branching == 1 else 2**passes - 1


def rays_of_depth(passes: int, lights: int, branching: int, goes_on: bool) -> list[int]:
    """The most rays of each depth that a pixel has: surface rays, and the shadow rays of the depth before."""
    surfaces = [1 if k == 0 else (branching**k if goes_on else 0) for k in range(passes)]
    return [surfaces[k] + (lights * surfaces[k - 1] if k else 0) for k in range(passes)]


def buffer_records(pixels: int, rays: list[int]) -> int:
    """w · h · (G + G'): records that each of the two vertex buffers holds (section 4); S_VB is 64 bytes times this.

    G and G' are the largest and second largest number of rays of a depth, as a buffer holds the rays of one depth that
    are to be shaded beside those of the next that are to be shot.
    """
    largest = sorted(rays, reverse=True)
    return pixels * (largest[0] + (largest[1] if len(largest) > 1 else 0))
