"""The construction of enclosing cones ray by ray, with every vector that the steps name: for drawings and counts.

The Hierarchical Ray Engine, section 4, step 2 and Figures 2 and 3. The cones are those of `refsim.reference.cone`, to
the last bit; the vectors are its formulas, written down once more. Arrays as there: ``[b]`` bundles, ``[b, 3]``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from refsim.reference.cone import BOUNDED, Cones, choose, direction_away, empty, extend, include, outside
from refsim.reference.vector import angle, cross, dot, length


class Step(NamedTuple):
    """One ray of every bundle: the cones before it, widened by its direction (2a), and moved to its origin (2b).

    p, r: origins and directions of the rays ``[b, 3]``; live bool ``[b]``; extended, moved bool ``[b]``: 2(a) or 2(b)
    changed a bounded cone. A bundle's first ray, which makes its cone, is neither.
    """

    p: np.ndarray
    r: np.ndarray
    live: np.ndarray
    before: Cones
    wider: Cones
    after: Cones
    extended: np.ndarray
    moved: np.ndarray


class Extension(NamedTuple):
    """Step 2(a) of cones that a direction r is out of: q and e, and the angle theta of r from the axis, radians."""

    q: np.ndarray
    e: np.ndarray
    theta: np.ndarray


class Translation(NamedTuple):
    """Step 2(b) of cones that an origin p is out of.

    c = p − a; q away from p; e, n the farthest and the nearest generator; g from n to p; t = g² / (e·g) < 0, had from
    |g| = w cos φ − z sin φ as in the construction; a_new = a + e t, and a_printed = a − e t (HRE-E1).
    """

    c: np.ndarray
    q: np.ndarray
    e: np.ndarray
    n: np.ndarray
    g: np.ndarray
    t: np.ndarray
    a_new: np.ndarray
    a_printed: np.ndarray


def steps(p: np.ndarray, r: np.ndarray, live: np.ndarray) -> Iterator[Step]:
    """The construction of `refsim.reference.cone.build`, errata corrected, up to its repair: a step a ray.

    p, r ``[b, n, 3]``, live ``[b, n]``, rays in the order in which they enter.
    """
    cones = empty(live.shape[0], p.dtype.type)
    for i in range(live.shape[1]):
        with np.errstate(all="ignore"):
            bounded = live[:, i] & (cones.state == BOUNDED)
            wider = choose(bounded, extend(cones, r[:, i]), cones)
            after = include(cones, p[:, i], r[:, i], live[:, i])
        moved = bounded & (wider.state == BOUNDED) & _differ(wider, after)
        yield Step(p[:, i], r[:, i], live[:, i], cones, wider, after, bounded & _differ(cones, wider), moved)
        cones = after


def _differ(a: Cones, b: Cones) -> np.ndarray:
    parts = [getattr(a, name) != getattr(b, name) for name in Cones._fields]
    return np.asarray(np.logical_or.reduce([part.reshape(len(part), -1).any(axis=1) for part in parts]))


def extension(cones: Cones, r: np.ndarray) -> Extension:
    """The vectors of Figure 2."""
    with np.errstate(all="ignore"):
        q = direction_away(cones.axis, r, dot(cones.axis, r))
    e = cones.axis * cones.cos[:, None] + q * cones.sin[:, None]
    return Extension(q, e, angle(cones.axis, r))


def translation(cones: Cones, p: np.ndarray, product_norm: bool = False) -> Translation:
    """The vectors of Figure 3; `product_norm`: q divided by |x·c| |x − c|, as printed (HRE-E3)."""
    x, c = cones.axis, p - cones.apex
    with np.errstate(all="ignore"):
        z, w = dot(x, c), length(cross(x, c))
        q = direction_away(x, c, z)
        if product_norm:
            q = (x * z[:, None] - c) / (np.abs(z) * length(x - c))[:, None]
        e = x * cones.cos[:, None] + q * cones.sin[:, None]
        n = x * cones.cos[:, None] - q * cones.sin[:, None]
        g = c - n * dot(n, c)[:, None]
        t = dot(g, g) / dot(e, g) if product_norm else -(w * cones.cos - z * cones.sin) / (2 * cones.sin * cones.cos)
        way = e * t[:, None]
    return Translation(c, q, e, n, g, t, cones.apex + way, cones.apex - way)


def gap(cones: Cones, points: np.ndarray) -> np.ndarray:
    """How far points are outside cones, scene units: 0 inside, infinity where that is not a number."""
    c = points - cones.apex
    with np.errstate(all="ignore"):
        z, w = dot(cones.axis, c), length(cross(cones.axis, c))
        far = np.where(z * cones.cos + w * cones.sin < 0, length(c), w * cones.cos - z * cones.sin)
        beyond = np.where(outside(z, w, cones.cos, cones.sin), np.maximum(far, 0.0), 0.0)
    return np.where(np.isnan(z), np.inf, beyond)
