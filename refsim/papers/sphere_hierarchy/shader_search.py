"""`search` on the pipeline: the same traversal as a fragment shader or as a vertex shader, a draw a layer.

In and out as of `search.search`: the same bits and the same counts. So the paper's traversal, which was a CUDA kernel,
can be compared with the other papers' on one machine, one set of rays and one set of counters.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.papers.sphere_hierarchy import list_textures as textures
from refsim.papers.sphere_hierarchy import traversal
from refsim.papers.sphere_hierarchy.lists import TraversalLists
from refsim.papers.sphere_hierarchy.passes import CORNERS, fragment_pass, vertex_pass
from refsim.papers.sphere_hierarchy.search import Found, Slots, check_shot
from refsim.papers.sphere_hierarchy.shaders import (
    FragmentTextures,
    SearchFrame,
    VertexTextures,
    traverser,
)
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import Framebuffer
from refsim.pipeline.taps import Taps
from refsim.scene.rays import Hits, Rays

STAGES = ("fragment", "vertex")
# Device functions of `traversal` that errata may replace
REPLACEABLE = ("misses_sphere", "slack_of", "per_length", "intersect")
Planes = tuple[NDArray[np.float32], NDArray[np.int32]]


def shader_search(
    layers: Sequence[TraversalLists],
    rays: Rays,
    *,
    stage: str = "fragment",
    starts: Sequence[NDArray[np.int32] | None] | None = None,
    any_hit: bool = False,
    facing: str = "both",
    threads: int | None = None,
    counters: Counters | None = None,
    taps: Taps | None = None,
    slots: Slots | None = None,
) -> Found:
    """The nearest hit of each ray, or any; arguments as of `search.search`.

    stage     "fragment": a viewport quad, a ray a pixel; rays without an image fill a rectangle, the rest of which is
              dead. "vertex": a ray a point, stream output takes the results
    counters  what the stages counted is added to it
    """
    shoot = {"fragment": _by_fragments, "vertex": _by_vertices}.get(stage)
    if shoot is None:
        raise InputError(f"stage is {stage!r}; it must be one of {', '.join(map(repr, STAGES))}.")
    check_shot(layers, rays, starts, facing)
    replaced = slots or {}
    unknown = sorted(set(replaced) - set(REPLACEABLE))
    if unknown:
        raise InputError(f"slot {unknown[0]!r} is none of the traversal's: {', '.join(REPLACEABLE)}.")
    traverse = traverser(*(replaced.get(name) or getattr(traversal, name) for name in REPLACEABLE))
    places = [
        textures.entries(lists, rays, None if starts is None else starts[k]) for k, lists in enumerate(layers)
    ]
    offsets = np.cumsum([0, *(len(lists.hierarchy.triangles) for lists in layers)])
    frames = [SearchFrame(np.int32(any_hit), np.int32(facing == "front"), np.int32(offset)) for offset in offsets[:-1]]
    done = Counters()
    shared: dict[str, Any] = {"counters": done, "taps": taps, "threads": threads}
    hit, found = shoot(traverse, layers, rays, places, frames, shared)
    done.check()
    if counters is not None:
        counters.merge(done)
    t, u, v = (np.ascontiguousarray(plane) for plane in hit)
    triangle, nodes, tests = (np.ascontiguousarray(plane) for plane in found)
    return Found(Hits(triangle, t, u, v), nodes, tests)


def _by_fragments(
    traverse: Any,
    layers: Sequence[TraversalLists],
    rays: Rays,
    places: list[NDArray[np.int32]],
    frames: list[SearchFrame],
    shared: dict[str, Any],
) -> Planes:
    """A quad a layer; its targets are the next layer's textures."""
    size = textures.image_size(rays)
    origin, direction = textures.ray_textures(rays, size)
    best: Framebuffer = textures.best_target(size)
    for lists, place, frame in zip(layers, places, frames, strict=True):
        target = textures.best_target(size)
        read = FragmentTextures(
            textures.list_textures(lists), origin, direction, textures.texture_of(place, size), best.texture("hit"),
            best.texture("found"),
        )  # fmt: skip
        draw(fragment_pass(traverse), vertices=CORNERS, uniforms=frame, textures=read, framebuffer=target, **shared)
        best = target
    planes = (best.color(name).reshape(3, -1)[:, : len(rays)] for name in ("hit", "found"))
    return next(planes), next(planes)


def _by_vertices(
    traverse: Any,
    layers: Sequence[TraversalLists],
    rays: Rays,
    places: list[NDArray[np.int32]],
    frames: list[SearchFrame],
    shared: dict[str, Any],
) -> Planes:
    """A draw of points a layer; what it captures are vertices of the next."""
    points, best = textures.ray_vertices(rays), textures.best_vertices(len(rays))
    for lists, place, frame in zip(layers, places, frames, strict=True):
        captured = textures.best_vertices(len(rays))
        captured.clear()
        draw(
            vertex_pass(traverse),
            vertices=(points, textures.entry_vertices(place), best),
            uniforms=frame,
            textures=VertexTextures(textures.list_textures(lists)),
            stream_output=captured,
            **shared,
        )
        best = captured
    return best.floats[:, : len(rays)], best.ints[:, : len(rays)]
