"""Meshes that are hard on a hierarchy, and rays that are hard on it, as Hypothesis strategies and plain functions.

    soup         triangles anywhere, of mixed sizes          flat      all in one axis-aligned plane
    coincident   all barycentres in one point                nested    each half as large as the one before
    identical    one triangle several times                  far       a small mesh a long way from the origin
    zero_area    points and segments among triangles         sliver    so thin that no margin bounds what is accepted
    grid         small whole numbers: ties and shared edges  single    one triangle

`meshes()` draws one of them, scaled by a power of two from 2⁻⁴⁰ to 2⁴⁰: float32[n, 3, 3].
"""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from refsim.scene import Rays, Scene

Triangles = NDArray[np.float32]


def soup(rng: np.random.Generator, n: int) -> Triangles:
    """Triangles around random places, their sizes over three decades."""
    middle = rng.uniform(-1.0, 1.0, (n, 1, 3))
    size = 10.0 ** rng.uniform(-3.0, 0.0, (n, 1, 1))
    return (middle + size * rng.normal(size=(n, 3, 3))).astype(np.float32)


def grid(rng: np.random.Generator, n: int) -> Triangles:
    """Vertices with whole coordinates from −2 to 2: many equal keys, equal t, shared edges, some of zero area."""
    return rng.integers(-2, 3, (n, 3, 3)).astype(np.float32)


def coincident(rng: np.random.Generator, n: int) -> Triangles:
    """Different triangles whose barycentres are all the origin, exactly: whole numbers that sum to 0."""
    two = rng.integers(-8, 9, (n, 2, 3))
    return np.concatenate([two, -two.sum(axis=1, keepdims=True)], axis=1).astype(np.float32)


def identical(rng: np.random.Generator, n: int) -> Triangles:
    """The same triangle n times."""
    return np.repeat(rng.normal(size=(1, 3, 3)), n, axis=0).astype(np.float32)


def zero_area(rng: np.random.Generator, n: int) -> Triangles:
    """Two of three have no area: their corners are one point, or on a line (exactly: coordinates are eighths)."""
    triangles = np.round(8.0 * rng.uniform(-1.0, 1.0, (n, 3, 3))) / 8.0
    triangles[::3] = triangles[::3, :1]
    triangles[1::3, 2] = 0.5 * (triangles[1::3, 0] + triangles[1::3, 1])
    return triangles.astype(np.float32)


def sliver(rng: np.random.Generator, n: int) -> Triangles:
    """Ordinary triangles, and every second one so thin that its acceptance margin is large or infinite."""
    triangles = rng.uniform(-1.0, 1.0, (n, 3, 3))
    along = rng.uniform(0.2, 0.8, (n, 1))
    middle = along * triangles[:, 0] + (1.0 - along) * triangles[:, 1]
    width = 10.0 ** rng.uniform(-8.0, -4.0, (n, 1))
    triangles[::2, 2] = (middle + width * rng.normal(size=(n, 3)))[::2]
    return triangles.astype(np.float32)


def flat(rng: np.random.Generator, n: int) -> Triangles:
    """Small triangles in one axis-aligned plane: boxes without thickness."""
    triangles = rng.uniform(-1.0, 1.0, (n, 1, 3)) + 0.1 * rng.normal(size=(n, 3, 3))
    triangles[:, :, rng.integers(3)] = 0.25
    return triangles.astype(np.float32)


def nested(rng: np.random.Generator, n: int) -> Triangles:
    """The same triangle about the origin, each time half as large: nodes within nodes."""
    size = 0.5 ** np.arange(n, dtype=np.float64)
    return (rng.normal(size=(1, 3, 3)) * size[:, None, None]).astype(np.float32)


def far(rng: np.random.Generator, n: int) -> Triangles:
    """A small mesh a thousand of its sizes from the origin."""
    return (soup(rng, n) + 1000.0 * rng.normal(size=3)).astype(np.float32)


def single(rng: np.random.Generator, n: int) -> Triangles:
    """One triangle, whatever n."""
    return rng.normal(size=(1, 3, 3)).astype(np.float32)


KINDS = {
    kind.__name__: kind
    for kind in (grid, soup, coincident, identical, zero_area, sliver, flat, nested, far, single)
}
SCALES = (0, -40, 40, -13, 13)


@st.composite
def meshes(draw: st.DrawFn, most: int = 24, kinds: tuple[str, ...] = tuple(KINDS), scaled: bool = True) -> Triangles:
    """One of the kinds above, 1 to `most` triangles."""
    kind = KINDS[draw(st.sampled_from(kinds))]
    n = draw(st.integers(1, most))
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    scale = np.float32(2.0 ** draw(st.sampled_from(SCALES))) if scaled else np.float32(1)
    return np.ascontiguousarray(kind(rng, n) * scale)


def scenes(most: int = 24, kinds: tuple[str, ...] = tuple(KINDS), scaled: bool = True) -> st.SearchStrategy[Scene]:
    """Scenes of such triangles."""
    return meshes(most, kinds, scaled).map(Scene)


def rays_at(triangles: Triangles, count: int, seed: int) -> Rays:
    """Rays that a structure may lose: `count` of them, unit directions in float32, from a seed.

    By turns: at points of triangles from outside; through corners and edges' middles; along an axis; in a direction on
    the border of sextants and octants; from a point of a triangle; anywhere. Some have a finite t_max.
    """
    rng = np.random.default_rng(seed)
    lower, upper = triangles.min(axis=(0, 1)).astype(np.float64), triangles.max(axis=(0, 1)).astype(np.float64)
    middle, size = 0.5 * (lower + upper), max(float(np.linalg.norm(upper - lower)), float(np.finfo(np.float32).tiny))
    weights = rng.dirichlet((1.0, 1.0, 1.0), count)
    kind = np.arange(count) % 6
    weights[kind == 1] = np.round(2.0 * weights[kind == 1]) / 2.0
    chosen = triangles[rng.integers(len(triangles), size=count)].astype(np.float64)
    target = (chosen * weights[:, :, None]).sum(axis=1)
    direction = rng.normal(size=(count, 3))
    axis = rng.integers(3, size=count)
    signs = rng.choice((-1.0, 1.0), (count, 3))
    along = kind == 2
    direction[along] = np.eye(3)[axis[along]] * signs[along]
    border = kind == 3
    direction[border] = signs[border] * (rng.integers(0, 2, (count, 3)) + np.eye(3)[axis])[border].clip(0.0, 1.0)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    origin = target - direction * size * rng.uniform(0.0, 3.0, (count, 1))
    origin[kind == 4] = target[kind == 4]
    origin[kind == 5] = (middle + size * rng.normal(size=(count, 3)))[kind == 5]
    t_max = np.where(rng.random(count) < 0.2, size * rng.uniform(0.1, 3.0, count), np.inf)
    return Rays(origin.astype(np.float32), direction.astype(np.float32), t_max.astype(np.float32))


def same_hits(one: object, other: object) -> None:
    """Asserts equal bits of hits: triangle, t, u, v."""
    for name in ("triangle", "t", "u", "v"):
        a, b = getattr(one, name), getattr(other, name)
        assert a.dtype == b.dtype and a.shape == b.shape, name
        wrong = np.flatnonzero(a.view(np.int32) != b.view(np.int32))
        assert not len(wrong), f"{name} of ray {wrong[0]}: {a[wrong[0]]!r}, not {b[wrong[0]]!r} ({len(wrong)} rays)"
