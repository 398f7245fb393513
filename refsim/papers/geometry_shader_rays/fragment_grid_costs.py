"""Arithmetic and fetches of the method "fragment_grid", from its shaders' own source and what happened in its passes.

As `costs` does for the geometry shader's method: what a fragment costs for each thing that can happen to its pixel is
counted by `source_walk`, how often it happened the rays and hits of the pass tell.

    shooting    idle: a dead eye ray, or no hit that could send a ray; refused: a hit that sends none; sent: all that is
                not the search, whose blocks are those of `costs.search_work`
    lighting    of ambient light and background: no hit, a surface; of a light: no hit, a surface in its shadow, one
                that it reaches (for each Phong exponent)

Every pixel of the target runs, dead ones too. Not counted, as there: texels of the pixel's own ray, which are inputs as
a vertex's attributes are, and what is written. The passes that light the rays of a node belong to the generation of
these rays; the geometry shader's method has no such passes, it shades where it intersects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.papers.geometry_shader_rays.acceleration import test_triangle
from refsim.papers.geometry_shader_rays.costs import F0, F1, Setup, Work, blocks, frame_of, search_work, work_of
from refsim.papers.geometry_shader_rays.errata import CORRECTED
from refsim.papers.geometry_shader_rays.fragment_grid import FragmentGridTracer
from refsim.papers.geometry_shader_rays.fragment_grid_shaders import (
    LitTexels,
    QuadFrame,
    SenderTexels,
    lighting_fragment,
    quad_vertex,
    sent_ray,
    shooting_fragment,
)
from refsim.papers.geometry_shader_rays.operations import Uncountable, Unknown
from refsim.papers.geometry_shader_rays.pass_costs import surfaces_of
from refsim.papers.geometry_shader_rays.passes import COLOR_FORMATS
from refsim.papers.geometry_shader_rays.shaders import spawning
from refsim.papers.geometry_shader_rays.source_walk import walk
from refsim.results import Generation, RayKind

CORNERS = 4  # of the viewport quad
HIT, MISSED = F0, -F1  # triangle 0, none
NO_LIGHT = -1


class Shooting(NamedTuple):
    """What a pixel costs in a pass that shoots rays, but for the search."""

    idle: Work
    refused: Work
    sent: Work


class Lighting(NamedTuple):
    """What a pixel costs in a pass that lights: of ambient light and background, then of a light."""

    background: Work
    ambient: Work
    unlit: Work
    shadowed: Work
    lit: tuple[Work, ...]


def _texel(name: str, last: Any) -> tuple[Any, ...]:
    return (*(Unknown(f"{name}[{k}]") for k in range(3)), last)


def _uniforms(setup: Setup, kind: int, light: int, unorm8: int) -> QuadFrame:
    return QuadFrame(frame_of(setup, 0), *(np.int32(number) for number in (kind, 0, light, unorm8)))


@lru_cache(64)
def shooting_blocks(setup: Setup, kind: int) -> Shooting:
    """The pass of a generation of rays of this kind.

    Making a ray is counted apart from the rest of the shader: whether it was made is known, of the search and of
    `spawning` only that they were called.
    """
    u, t = _uniforms(setup, kind, NO_LIGHT, 0), Unknown("t")
    fragment, free = shooting_fragment(setup.traverse), (setup.traverse, test_triangle)

    def shot(alive: bool) -> Work:
        t_max = F1 if alive else F0
        inputs = SenderTexels(_texel("origin", t_max), _texel("direction", F1), _texel("hit", MISSED))
        known = {"sent_ray()[2]": t_max}
        return work_of(walk(fragment, u, t, None, inputs, None, facts=known, free=(*free, sent_ray))[0])

    def made(hit: np.float32, sends: int) -> Work:
        if kind == RayKind.EYE:
            return Work()
        sender = SenderTexels(_texel("origin", Unknown("t_max")), _texel("direction", F1), _texel("hit", hit))
        known = {"spawning().reflects": sends, "spawning().refracts": sends}
        cost = work_of(walk(sent_ray, u, t, sender, facts=known, free=(spawning,))[0])
        spawns = hit == HIT and kind != RayKind.SHADOW
        return cost.plus(blocks(setup)["geometry.spawning"]) if spawns else cost

    return Shooting(
        idle=made(MISSED, 0).plus(shot(False)),
        refused=made(HIT, 0).plus(shot(False)),
        sent=made(HIT, 1).plus(shot(True)),
    )


@lru_cache(64)
def lighting_blocks(setup: Setup, unorm8: int) -> Lighting:
    """The passes that add light to the image, whose format is of 8 bits or not."""
    t = Unknown("t")

    def lighting(light: int, hit: np.float32, occluder: np.float32, surface: tuple[float, float] = (0.0, 0.0)) -> Work:
        inputs = LitTexels(
            _texel("origin", Unknown("t_max")), _texel("direction", Unknown("weight")), _texel("hit", hit),
            _texel("occluder", occluder),
        )  # fmt: skip
        known = {
            "u.lights.shape[0]": setup.lights,
            "t.surfaces.data[0, 0, 0, 3]": np.float32(surface[0]),
            "t.triangles.data[0, 0, 3, 3]": np.float32(surface[1]),
        }
        u = _uniforms(setup, RayKind.EYE, light, unorm8)
        return work_of(walk(lighting_fragment, u, t, None, inputs, None, facts=known)[0])

    return Lighting(
        background=lighting(NO_LIGHT, MISSED, MISSED),
        ambient=lighting(NO_LIGHT, HIT, MISSED),
        unlit=lighting(0, MISSED, MISSED),
        shadowed=lighting(0, HIT, HIT),
        lit=tuple(lighting(0, HIT, MISSED, surface) for surface in setup.surfaces),
    )


@lru_cache(1)
def corner_work() -> Work:
    """A run of the vertex shader."""
    return work_of(walk(quad_vertex, Unknown("u"), Unknown("t"), (Unknown("corner"),), 0, 0)[0])


@dataclass(frozen=True)
class ShotEvents:
    """What happened in a pass that shot rays. `pixels` of the target; `senders`: of them those with a hit that could
    send a ray; `shot`: with a ray; `walked`: whose rays visited a cell; `cells`, `tests`."""

    kind: int
    pixels: int
    senders: int
    shot: int
    walked: int
    cells: int
    tests: int


@dataclass(frozen=True)
class LitEvents:
    """What happened in the passes that lit the rays of a node. `pixels` of the image; `hits`: pixels with a surface;
    `shadowed`, for each light: those in its shadow; `lit`, for each: those it reaches, by kind of surface."""

    pixels: int
    hits: int
    shadowed: tuple[int, ...]
    lit: tuple[tuple[int, ...], ...]


def shooting_work(setup: Setup, events: ShotEvents) -> Work:
    """The work of a pass's fragments. Raises `operations.Uncountable`."""
    cost, search = shooting_blocks(setup, events.kind), search_work(setup.traverse)
    sent = events.kind != RayKind.EYE
    refused = events.senders - events.shot if sent else 0
    return cost.idle.times(events.pixels - events.shot - refused).plus(
        cost.refused.times(refused),
        cost.sent.plus(search.outside).times(events.shot),
        search.walking.times(events.walked),
        search.cell.times(events.cells),
        search.test.times(events.tests),
    )


def lighting_work(setup: Setup, unorm8: int, events: LitEvents) -> Work:
    """The work of the fragments of a node's lighting passes, one without a light and one for each."""
    cost = lighting_blocks(setup, unorm8)
    missed = events.pixels - events.hits
    work = cost.background.times(missed).plus(cost.ambient.times(events.hits))
    for shadowed, lit in zip(events.shadowed, events.lit, strict=True):
        reached = (cost.lit[k].times(count) for k, count in enumerate(lit))
        work = work.plus(cost.unlit.times(missed), cost.shadowed.times(shadowed), *reached)
    return work


def shot_events(generation: Generation, sender: Generation | None) -> ShotEvents:
    """Of a generation whose rays the hits of `sender` send (none: eye rays)."""
    return ShotEvents(
        kind=int(generation.kind[0]),
        pixels=generation.counters["fragment.invocations"],
        senders=int((sender.hits.triangle >= 0).sum()) if sender is not None else 0,
        shot=int(generation.alive.sum()),
        walked=int((generation.per_ray["cells"] > 0).sum()),
        cells=int(generation.per_ray["cells"].sum(dtype=np.int64)),
        tests=int(generation.per_ray["triangle_tests"].sum(dtype=np.int64)),
    )


def lit_events(
    generation: Generation, shadows: Sequence[NDArray[np.bool_] | None], surface_of: NDArray[np.int64], kinds: int
) -> LitEvents:
    """Of a generation of surface rays; `shadows`: for each light which rows are in its shadow, None where no shadow
    rays were shot; `surface_of`: the kind of surface of each triangle."""
    triangle = generation.hits.triangle
    hit = triangle >= 0
    hidden = [np.zeros(len(hit), np.bool_) if dark is None else dark for dark in shadows]
    lit = (np.bincount(surface_of[triangle[hit & ~dark]], minlength=kinds) for dark in hidden)
    return LitEvents(
        pixels=generation.counters["fragment.invocations"],
        hits=int(hit.sum()),
        shadowed=tuple(int((hit & dark).sum()) for dark in hidden),
        lit=tuple(tuple(int(count) for count in counts) for counts in lit),
    )


class QuadCosts:
    """Adds what the shaders of each generation cost; nothing where the accelerator's source cannot be read."""

    def __init__(self, tracer: FragmentGridTracer) -> None:
        options, prepared = tracer.options, tracer.prepared
        surfaces, self._surface_of = surfaces_of(prepared.scene)
        self._unorm8 = int(COLOR_FORMATS[options.color_format].is_unorm8)
        self._setup = Setup(
            prepared.accelerator.traverse, "vertex", len(options.lights), int(options.smooth), 0, options.background,
            CORRECTED, surfaces,
        )  # fmt: skip

    def add(self, generations: Sequence[Generation]) -> None:
        """Completes the counters of all generations, which hold all else already."""
        try:
            works = [self._work(k, generations) for k in range(len(generations))]
        except Uncountable:
            return
        for generation, (corners, fragments) in zip(generations, works, strict=True):
            for shader, done in (("vertex", corners), ("fragment", fragments)):
                generation.counters.add(f"{shader}.arithmetic", done.arithmetic)
                generation.counters.add(f"{shader}.fetches", done.fetches)

    def _work(self, k: int, generations: Sequence[Generation]) -> tuple[Work, Work]:
        """Of the vertex and of the fragment shaders: the pass that shot generation k, and those that lit its rays."""
        own, setup = generations[k], self._setup
        sender = generations[own.parent_generation] if own.parent_generation >= 0 else None
        shooting, vertices = shooting_work(setup, shot_events(own, sender)), own.counters["vertex.invocations"]
        if own.kind[0] == RayKind.SHADOW:
            return corner_work().times(vertices), shooting
        shadows: list[NDArray[np.bool_] | None] = [None] * setup.lights
        for each in generations[k + 1 :]:
            if each.parent_generation == k and each.kind[0] == RayKind.SHADOW:
                assert each.light is not None
                shadows[int(each.light[0])] = each.hits.triangle >= 0
        lighting = lit_events(own, shadows, self._surface_of, len(setup.surfaces))
        vertices += CORNERS * (1 + setup.lights)
        return corner_work().times(vertices), shooting.plus(lighting_work(setup, self._unorm8, lighting))
