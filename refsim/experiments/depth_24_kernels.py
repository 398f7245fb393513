"""All hits of a ray weighed at once, for what a depth buffer of 24 bits must show. Templates of `refsim.jit`."""

from __future__ import annotations

import numpy as np

from refsim.geometry.triangle import intersect
from refsim.pipeline.depth import stored_depth
from refsim.pipeline.enums import DepthStencilFormat

U = np.uintp
INF = np.float32(np.inf)
ZERO, ONE = np.float32(0), np.float32(1)
FIXED = DepthStencilFormat.DEPTH24UNORM_STENCIL8


def weigh_hits(origin, direction, t_max, triangles, scales, first, nearest, tied, shown, shown_t, last, alike):  # type: ignore[no-untyped-def]
    """Hits of rays [n] in file order, by depth t · scale, for each of the scales [k].

    nearest i32[n]: the least t, the first drawn of ties; tied i32[n]: hits of that very t. With 24 bits, per scale:
    shown i32[k, n], the first hit whose stored depth is the least, its t in shown_t f32[k, n]; last i32[k, n], the last
    such; alike i32[k, n], how many. No hit: -1 and 0. first f32[n]: the least t. A depth of 1, as cleared, hides a hit.
    """
    depth = np.zeros(scales.shape[0], np.float32)
    for ray in range(origin.shape[0]):
        i = U(ray)
        o = (origin[i, 0], origin[i, 1], origin[i, 2])
        d = (direction[i, 0], direction[i, 1], direction[i, 2])
        best = INF
        for scale in range(scales.shape[0]):
            depth[U(scale)] = stored_depth(FIXED, ONE, ZERO, ONE)
        for number in range(triangles.shape[0]):
            j = U(number)
            v0 = (triangles[j, 0], triangles[j, 1], triangles[j, 2])
            n = (triangles[j, 3], triangles[j, 4], triangles[j, 5])
            m1 = (triangles[j, 6], triangles[j, 7], triangles[j, 8])
            m2 = (triangles[j, 9], triangles[j, 10], triangles[j, 11])
            hit, t, _u, _v, _den = intersect(o, d, t_max[i], v0, n, m1, m2)
            if not hit:
                continue
            if t < best:
                best = t
                nearest[i], tied[i] = number, 1
            elif t == best:
                tied[i] += 1
            for scale in range(scales.shape[0]):
                k = U(scale)
                z = stored_depth(FIXED, t * scales[k], ZERO, ONE)
                if z < depth[k]:
                    depth[k] = z
                    shown[k, i], shown_t[k, i], last[k, i], alike[k, i] = number, t, number, 1
                elif z == depth[k] and shown[k, i] >= 0:
                    last[k, i] = number
                    alike[k, i] += 1
        first[i] = best
