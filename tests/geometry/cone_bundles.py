"""Bundles of rays for the cone tests: seeded in bulk, and as hypothesis strategies; and what "encloses" means, in
float64."""

from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

KINDS = (
    "tight", "moderate", "wide", "parallel", "opposite", "mirrored", "identical", "one origin", "far off",
    "not quite unit",
)


class Bundles(NamedTuple):
    """p, r float32 ``[b, n, 3]`` origins and directions, live bool ``[b, n]``, kind int ``[b]`` into KINDS."""

    p: np.ndarray
    r: np.ndarray
    live: np.ndarray
    kind: np.ndarray


def unit(v):
    """Unit vectors along the last axis, float64."""
    v = np.asarray(v, dtype=np.float64)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def arrange(kind, axis, noise, origins, spread, scale, signs):
    """One family of bundles ``(p, r)`` from raw numbers: axis [b,3], noise, origins [b,n,3], spread, scale [b,1,1]."""
    axis = unit(axis)[:, None, :]
    r = axis + noise * spread
    p = origins * scale
    if kind == "parallel":
        r = np.broadcast_to(axis, noise.shape).copy()
    elif kind == "opposite":                        # exactly or nearly opposite directions
        r = r * signs[..., None]
    elif kind == "mirrored":                        # origins up and down the axis: in the cone or in its mirror image
        p = axis * origins[..., :1] * scale + origins * scale * 0.1 * np.minimum(spread, 1.0)
    elif kind == "identical":
        p, r = np.broadcast_to(p[:, :1], p.shape), np.broadcast_to(r[:, :1], r.shape)
    elif kind == "one origin":
        p = np.broadcast_to(p[:, :1], p.shape)
    elif kind == "far off":
        p = p * 1e-4 + axis * scale
    r = np.where(np.linalg.norm(r, axis=-1, keepdims=True) < 1e-9, axis, r)
    r = unit(r)
    if kind == "not quite unit":                    # by 1e-4 at most, and at origins a few roundings apart
        r = r * (1.0 + 0.99e-4 * np.sign(origins[..., :1]))
        p = p * 1e-6 + axis * scale
    return p.astype(np.float32), r.astype(np.float32)


def bulk(seed, per_kind, n):
    """per_kind bundles of every kind, up to n rays each, scales 1e-6 ... 1e6, dead rays and empty bundles mixed in."""
    rng = np.random.default_rng(seed)
    ranges = {"tight": (-7, -2), "moderate": (-2, -0.5), "wide": (-0.5, 2)}
    p, r = [], []
    for kind in KINDS:
        spread = 10.0 ** rng.uniform(*ranges.get(kind, (-6, 1)), (per_kind, 1, 1))
        scale = 10.0 ** rng.uniform(-6, 6, (per_kind, 1, 1))
        origins = rng.uniform(-1, 1, (per_kind, n, 3)) * 10.0 ** rng.uniform(-4, 0, (per_kind, 1, 1))
        rows = arrange(
            kind, rng.normal(size=(per_kind, 3)), rng.normal(size=(per_kind, n, 3)), origins, spread, scale,
            rng.choice([-1.0, 1.0], (per_kind, n)),
        )
        p.append(rows[0])
        r.append(rows[1])
    b = per_kind * len(KINDS)
    live = (rng.random((b, n)) < 0.85) & (np.arange(n) < rng.integers(0, n + 1, (b, 1)))
    p, r = np.concatenate(p), np.concatenate(r)
    r[~live] = 0.0                                  # a dead ray has no direction
    return Bundles(p, r, live, np.repeat(np.arange(len(KINDS)), per_kind))


@st.composite
def bundles(draw):
    """One bundle of 1 to 6 rays of any kind, as Bundles with b = 1."""
    n = draw(st.integers(1, 6))
    number = st.floats(-1, 1, width=32)
    kind = draw(st.sampled_from(KINDS))
    axis = draw(arrays(np.float64, (1, 3), elements=number))
    axis = np.where(np.linalg.norm(axis) < 1e-3, [[0.0, 0.0, 1.0]], axis)
    noise, origins = (draw(arrays(np.float64, (1, n, 3), elements=number)) for _ in range(2))
    spread, scale = 10.0 ** draw(st.floats(-7, 2)), 10.0 ** draw(st.floats(-6, 6))
    signs = draw(arrays(np.float64, (1, n), elements=st.sampled_from([-1.0, 1.0])))
    p, r = arrange(kind, axis, noise, origins, spread, scale, signs)
    live = draw(arrays(np.bool_, (1, n)))
    return Bundles(p, np.where(live[..., None], r, np.float32(0)), live, np.array([KINDS.index(kind)]))


class Recipe(NamedTuple):
    """Few numbers that describe 100 bundles, so that a failing example is short and shrinks: towards few rays, scale
    and spread near 1 and a small seed."""

    kind: str
    rays: int           # most rays of a bundle
    spread: float       # of the directions and of the scale, exponents of ten
    scale: float
    seed: int


@st.composite
def recipes(draw):
    """Recipes of every kind; those that are mostly bounded twice as often."""
    kind = draw(st.sampled_from((*KINDS, "tight", "moderate", "parallel", "far off")))
    ranges = {"tight": (-7, -2), "moderate": (-2, -0.5), "wide": (-0.5, 0.5)}
    spread = draw(st.floats(*ranges.get(kind, (-6, 0))))
    return Recipe(kind, draw(st.integers(2, 8)), spread, draw(st.floats(-6, 6)), draw(st.integers(0, 2**32 - 1)))


def prepare(recipe):
    """The 100 bundles of a recipe, 92 of them with two live rays or more, up or down half an order of magnitude."""
    rng = np.random.default_rng(recipe.seed)
    b, n = 100, recipe.rays
    spread, scale = (10.0 ** (x + rng.uniform(-0.5, 0.5, (b, 1, 1))) for x in (recipe.spread, recipe.scale))
    origins = rng.uniform(-1, 1, (b, n, 3)) * 10.0 ** rng.uniform(-4, 0, (b, 1, 1))
    p, r = arrange(
        recipe.kind, rng.normal(size=(b, 3)), rng.normal(size=(b, n, 3)), origins, spread, scale,
        rng.choice([-1.0, 1.0], (b, n)),
    )
    # Live rays anywhere in the row: none or one in 8 bundles of 100, else 2 to n.
    count = np.where(rng.random(b) < 0.08, rng.integers(0, 2, b), rng.integers(2, n + 1, b))
    live = np.argsort(rng.random((b, n)), axis=1) < count[:, None]
    r[~live] = 0.0
    return Bundles(p, r, live, np.full(b, KINDS.index(recipe.kind)))


def outside_by(cones, slack, bundle, t):
    """How far the points p + t r lie outside the cone grown by slack, over their distance from the apex: float64
    ``[b, n]``.

    The cone's float32 numbers are taken as exact: axis and (cos, sin) normalised in float64. Dead rays and cones that
    are not bounded give -inf. Points nearer to the apex than 1e-300 count as on it.
    """
    apex, axis, cos, sin = (np.asarray(x, dtype=np.float64) for x in cones[:4])
    axis, size = unit(axis)[:, None, :], np.hypot(cos, sin)
    cos, sin = (cos / size)[:, None], (sin / size)[:, None]
    c = (bundle.p.astype(np.float64) - apex[:, None]) + bundle.r.astype(np.float64) * t
    z, w, far = np.sum(c * axis, -1), np.linalg.norm(np.cross(c, axis), axis=-1), np.linalg.norm(c, axis=-1)
    distance = np.where(z * cos + w * sin >= 0, w * cos - z * sin, far) - np.asarray(slack, np.float64)[:, None]
    ratio = distance / np.maximum(far, 1e-300)
    ratio = np.where(np.isnan(ratio), np.inf, ratio)
    return np.where(bundle.live & (np.asarray(cones.state) == 1)[:, None], ratio, -np.inf)


def widest_miss(cones, slack, bundle):
    """The worst of ``outside_by`` over t from 0 to 1e9 times the bundle's own size, ``[b]``, and the sine of the
    worst direction."""
    spans = np.linalg.norm(bundle.p.astype(np.float64) - np.asarray(cones.apex, np.float64)[:, None], axis=-1)
    size = np.where(bundle.live, spans, 0).max(axis=1)[:, None, None]
    size = np.where(np.isfinite(size) & (size > 0), size, 1.0)
    worst = np.full(len(bundle.p), -np.inf)
    for factor in (0.0, 1e-3, 0.1, 0.5, 1.0, 3.0, 10.0, 1e3, 1e6, 1e9):
        worst = np.maximum(worst, outside_by(cones, slack, bundle, size * factor).max(axis=1))
    return worst


def farthest(cones, bundle):
    """Largest distance of a live origin from the apex ``[b]``, float64."""
    spans = np.linalg.norm(bundle.p.astype(np.float64) - np.asarray(cones.apex, np.float64)[:, None], axis=-1)
    return np.where(bundle.live, spans, 0).max(axis=1)
