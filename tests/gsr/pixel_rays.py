"""Traces of the method "fragment_grid", and two traces compared ray by ray whatever order their rays come in."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

import refsim
from refsim import Rays, Scene
from refsim.results import Generation, RayKind, Trace

COLUMNS = ("origin", "direction", "t_max")
FOUND = ("triangle", "t", "u", "v")


def by_pixels(scene: Scene, rays: Rays, **options: Any) -> Trace:
    return refsim.trace("fragment_grid", scene, rays, **{"acceleration": "naive", **options})


class Table(NamedTuple):
    """All live rays of a trace by (pixel, node, light): `keys` i64[n, 3] in order, `parents` the keys of their parents
    (−1 of eye rays), `words` i32[n, 16]: bits of kind, weight, ray (7 words), hit (4), counts (3)."""

    keys: np.ndarray
    parents: np.ndarray
    words: np.ndarray


def keys_of(generation: Generation) -> np.ndarray:
    assert generation.node is not None and generation.light is not None
    return np.column_stack([generation.pixel, generation.node, generation.light]).astype(np.int64)


def table(trace: Trace) -> Table:
    rows: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for generation in trace.generations:
        live = generation.alive
        if not live.any():
            continue
        keys, parents = keys_of(generation), np.full((len(live), 3), -1, np.int64)
        sent = live & (generation.parent >= 0)
        if sent.any():
            sender = trace.generations[generation.parent_generation]
            parents[sent] = keys_of(sender)[generation.parent[sent]]
        assert generation.weight is not None
        parts = [generation.kind, generation.weight, *(getattr(generation.rays, name) for name in COLUMNS)]
        parts += [getattr(generation.hits, name) for name in FOUND]
        parts += [generation.per_ray[name] for name in sorted(generation.per_ray)]
        words = [np.ascontiguousarray(part).view(np.int32).reshape(len(live), -1) for part in parts]
        rows.append((keys[live], parents[live], np.concatenate(words, axis=1)[live]))
    keys, parents, words = (np.concatenate(part) for part in zip(*rows, strict=True))
    order = np.lexsort(keys.T)
    return Table(keys[order], parents[order], words[order])


def assert_same(found: Trace, expected: Trace) -> None:
    """The same rays, hits, counts and image."""
    mine, other = table(found), table(expected)
    assert mine.keys.shape == other.keys.shape and (mine.keys == other.keys).all()
    assert (mine.parents == other.parents).all()
    off = np.flatnonzero((mine.words != other.words).any(axis=1))
    assert not len(off), f"(pixel, node, light) {mine.keys[off[0]]}: {mine.words[off[0]]}, {other.words[off[0]]}"
    assert found.image is not None and expected.image is not None
    assert (found.image.view(np.int32) == expected.image.view(np.int32)).all()


def same_totals(found: Trace, expected: Trace) -> bool:
    names = [f"rays.{kind.name.lower()}" for kind in RayKind]
    names += ["intersection.triangle_tests", "traversal.cells", "traversal.box_rejections"]
    return all(found.counters[name] == expected.counters[name] for name in names)
