"""Arithmetic and fetches of each shader, from the shaders' own source and what happened in a pass (Table 1).

The paper's footnote says what Table 1 holds: "% of executed instructions distributed between shaders". Here they follow
from blocks: what a run of a shader costs for each thing that can happen to a ray, a cell, a triangle test. Their
operations are counted by `source_walk`; how often they ran, the counters and the rays' own numbers tell.

    vertex      a ray that is finished; one that is shot: before the search, to the search's early exit, the rest of its
                beginning, a cell, a triangle test
    geometry    a ray that is finished, that only passes on, that spawns; each kind of record emitted
    fragment    one that is discarded, a shadow, a ray that missed, a surface (for each Phong exponent)

What is not emitted is not computed. Not counted: attributes read and records written (64 bytes each), fixed-function
stages, and the blending passes that add the targets up, which Table 1's single target does without.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.geometry.optics import next_ray
from refsim.geometry.triangle import intersect
from refsim.papers.geometry_shader_rays import shaders
from refsim.papers.geometry_shader_rays.acceleration import test_triangle
from refsim.papers.geometry_shader_rays.errata import Printed
from refsim.papers.geometry_shader_rays.fragment_shaders import lit, shaded, unshadowed
from refsim.papers.geometry_shader_rays.operations import Cost, Unknown
from refsim.papers.geometry_shader_rays.record import PackedHit
from refsim.papers.geometry_shader_rays.shading import ambient, lookup_normal, phong, shadow_ray
from refsim.papers.geometry_shader_rays.source_walk import walk

SHADERS = ("vertex", "geometry", "fragment")
F0, F1 = np.float32(0), np.float32(1)
EYE, LATER, FINISHED = F0, F1, np.float32(3)


class Work(NamedTuple):
    """Operations and texels fetched."""

    arithmetic: int = 0
    fetches: int = 0

    def times(self, count: int) -> Work:
        """The same, so many times."""
        return Work(self.arithmetic * int(count), self.fetches * int(count))

    def plus(self, *others: Work) -> Work:
        """The sum."""
        every = (self, *others)
        return Work(sum(each.arithmetic for each in every), sum(each.fetches for each in every))


@dataclass(frozen=True)
class Prices:
    """What an operation and a fetch cost; by default an instruction each, as in Table 1's footnote."""

    arithmetic: float = 1.0
    fetch: float = 1.0


AN_INSTRUCTION_EACH = Prices()


def shares(counters: Mapping[str, int], prices: Prices = AN_INSTRUCTION_EACH) -> dict[str, float]:
    """Table 1: percent of all cost that falls to each shader."""
    costs = {
        name: counters[f"{name}.arithmetic"] * prices.arithmetic + counters[f"{name}.fetches"] * prices.fetch
        for name in SHADERS
    }
    total = sum(costs.values())
    return {name: 100.0 * cost / total if total else 0.0 for name, cost in costs.items()}


class Search(NamedTuple):
    """What a search costs: a ray that visits no cell, what one that does costs more, a cell, a triangle test."""

    outside: Work
    walking: Work
    cell: Work
    test: Work


def work_of(cost: Cost) -> Work:
    """Operations and fetches of a cost, loops that run nobody knows how often left out."""
    return Work(cost.arithmetic, cost.fetches)


def _unknown(*names: str) -> tuple[Unknown, ...]:
    return tuple(Unknown(name) for name in names)


def _loops(cost: Cost) -> list[Cost]:
    return [each for loop in cost.loops for each in (loop, *_loops(loop))]


@lru_cache(64)
def search_work(traverse: Any) -> Search:
    """The blocks of an accelerator's `traverse`, found in its source.

    A cell is an iteration of the loop that counts `cells`, a test one of the loop that calls the triangle test (within
    the loop of cells, where there is one). A ray without a cell runs to the last early exit before that loop, or all
    but the branch around it.
    """
    arguments = _unknown("t.structure", "t.triangles", "o", "d", "t_max", "any_hit", "front_only")
    cost, _ = walk(traverse, *arguments)
    whole = work_of(cost)
    per_cell = [loop for loop in _loops(cost) if loop.cells]
    tests = [loop for loop in _loops(per_cell[0] if per_cell else cost) if loop.tests]
    tests = tests or [loop for loop in _loops(cost) if loop.tests]
    outside = work_of(cost.exits[-1]) if cost.exits else work_of(Cost(cost.counts - cost.walking))
    return Search(
        outside,
        Work(whole.arithmetic - outside.arithmetic, whole.fetches - outside.fetches),
        work_of(per_cell[0]) if per_cell else Work(),
        work_of(tests[0]) if tests else Work(),
    )


class Setup(NamedTuple):
    """What decides which sides of the shaders' branches are taken, beside the ray: pipeline and uniforms.

    `surfaces`: (specular strength, Phong exponent) of each kind of surface.
    """

    traverse: Any
    stages: str
    lights: int
    smooth: int
    rasterised: int
    background: tuple[float, float, float]
    printed: Printed
    surfaces: tuple[tuple[float, float], ...]


def frame_of(setup: Setup, last: int) -> shaders.Frame:
    """The uniforms, as far as they are known."""
    known: dict[str, Any] = {
        "last": last,
        "smooth": int(setup.smooth),
        "rasterised": int(setup.rasterised),
        "background": setup.background,
        "printed": setup.printed,
    }
    fields: list[Any] = [known.get(name, Unknown(f"u.{name}")) for name in shaders.Frame._fields]
    return shaders.Frame(*fields)


def _ray(state: np.float32, code: int, hit: bool) -> PackedHit:
    """A record of which only state, type, and whether it hit are known; it hit triangle 0."""
    pos, origin, direction = (tuple(_unknown(*(f"{name}[{k}]" for k in range(3)))) for name in ("pos", "o", "d"))
    u, v, t = _unknown("u", "v", "t")
    parts: list[Any] = [(*pos, F1), (*origin, t), (*direction, F0 if hit else -F1), (u, v, state, np.float32(code))]
    return PackedHit(*parts)


@lru_cache(64)
def blocks(setup: Setup) -> dict[str, Work]:
    """What each event of `SHADERS` costs, by names such as "vertex.later" and "fragment.surface.0"."""
    t, facts = Unknown("t"), {"u.lights.shape[0]": setup.lights}
    free = (setup.traverse, test_triangle)
    going, lights = frame_of(setup, 0), max(setup.lights, 1)
    shot = shaders.shooting(setup.traverse)
    shooter: Any = shot
    if setup.stages == "vertex_only":
        shooter = shaders.finishing_vertex(shot)

    def made(function: Any, *arguments: Any, known: Mapping[str, Any] = facts) -> Work:
        return work_of(walk(function, *arguments, facts=known, free=free)[0])

    def shooting(state: np.float32) -> Work:
        ray = _ray(state, 0, False)
        arguments = (ray, 0) if setup.stages != "vertex_only" else ((ray,), 0, 0)
        return made(shooter, going, t, *arguments)

    found = {
        "vertex.finished": shooting(FINISHED),
        "vertex.eye": shooting(EYE),
        "vertex.later": shooting(LATER),
        "geometry.finished": made(shaders.spawning, going, t, _ray(FINISHED, 0, True), lights),
        "geometry.kept": made(shaders.spawning, frame_of(setup, 1), t, _ray(LATER, 0, True), lights),
        "geometry.spawning": made(shaders.spawning, going, t, _ray(LATER, 0, True), lights),
    }
    ray, s = _ray(LATER, 0, True), Unknown("s")
    emitted = {
        "passed": (shaders.passed_on, ()), "shadow": (shaders.shadow_entry, (0, lights)),
        "reflected": (shaders.reflected_entry, ()), "refracted": (shaders.refracted_entry, ()),
    }  # fmt: skip
    found |= {f"geometry.{name}": made(function, going, ray, s, *more) for name, (function, more) in emitted.items()}

    def fragment(state: np.float32, code: int, hit: bool, surface: tuple[float, float] = (0.0, 0.0)) -> Work:
        known = facts | {
            "t.surfaces.data[0, 0, 0, 3]": np.float32(surface[0]),
            "t.triangles.data[0, 0, 3, 3]": np.float32(surface[1]),
        }
        cost, what = walk(shaded, going, t, _ray(state, code, hit), lights, facts=known)
        if state < FINISHED:
            return work_of(cost)  # discarded
        targets = (made(lit, going, what, k, setup.lights, known=known) for k in range(setup.lights))
        return work_of(cost).plus(made(unshadowed, going, what), *targets)

    found["fragment.discarded"] = fragment(LATER, 0, False)
    found["fragment.shadow"] = fragment(FINISHED, 1, True)
    found["fragment.missed"] = fragment(FINISHED, -1, False)
    for k, surface in enumerate(setup.surfaces):
        found[f"fragment.surface.{k}"] = fragment(FINISHED, 0, True, surface)
    return found


def building_blocks(traverse: Any, exponent: int = 32) -> dict[str, Work]:
    """The parts that the shaders are made of, for a table: name and work."""
    search = search_work(traverse)
    p, d, n, x = (_unknown(*(f"{name}{k}" for k in range(3))) for name in "pdnx")
    t, weight, epsilon = _unknown("t", "w", "epsilon")
    setup = Setup(traverse, "vertex", 1, 0, 0, (0.0, 0.0, 0.0), Printed(), ())
    return {
        "search, no cell": search.outside,
        "search, first cell": search.walking,
        "cell": search.cell,
        "triangle test": search.test,
        "intersection alone": work_of(walk(intersect, p, d, t, x, n, p, d)[0]),
        "eye ray (GSR-E12)": work_of(walk(shaders.eye_ray, frame_of(setup, 0), p)[0]),
        "normal, flat": work_of(walk(lookup_normal, *_unknown("t.triangles", "t.surfaces", "i", "u", "v"), 0)[0]),
        "normal, smooth": work_of(walk(lookup_normal, *_unknown("t.triangles", "t.surfaces", "i", "u", "v"), 1)[0]),
        "Phong, one light": work_of(walk(phong, p, d, n, x, F1, exponent, p, x, weight)[0]),
        "ambient light": work_of(walk(ambient, x, weight)[0]),
        "shadow ray": work_of(walk(shadow_ray, p, n, n, x, epsilon, 0)[0]),
        "reflected or refracted ray": work_of(walk(next_ray, p, d, t, n, n, Unknown("ior"), epsilon)[0]),
        "passed on": blocks(setup)["geometry.passed"],
    }


@dataclass(frozen=True)
class PassEvents:
    """What happened in a pass. `finished`, `shot`: rays in the vertex buffer; `walked`: those that visited a cell;
    `searched`: those not found by rasterisation; `cells`, `tests`; `spawning`: hits that sent rays; `emitted`: records
    by kind; fragments: `fragments` in all, of them `shadows`, `missed` and surfaces by kind shaded.
    """

    finished: int
    shot: int
    walked: int
    searched: int
    cells: int
    tests: int
    spawning: int
    emitted: Mapping[str, int]
    fragments: int
    shadows: int
    missed: int
    surfaces: NDArray[np.int64]


def pass_work(setup: Setup, first: bool, events: PassEvents) -> dict[str, Work]:
    """The work of each shader in a pass, none of one that the pipeline lacks. Raises `operations.Uncountable`."""
    cost, search = blocks(setup), search_work(setup.traverse)
    shooting = cost["vertex.finished"].times(events.finished).plus(
        cost["vertex.eye" if first else "vertex.later"].times(events.shot),
        search.outside.times(events.searched),
        search.walking.times(events.walked),
        search.cell.times(events.cells),
        search.test.times(events.tests),
    )  # fmt: skip
    spawning = cost["geometry.finished"].times(events.finished).plus(
        cost["geometry.kept"].times(events.shot - events.spawning),
        cost["geometry.spawning"].times(events.spawning),
        *(cost[f"geometry.{kind}"].times(count) for kind, count in events.emitted.items()),
    )  # fmt: skip
    shaded_ones = events.shadows + events.missed + int(events.surfaces.sum())
    shading = cost["fragment.discarded"].times(events.fragments - shaded_ones).plus(
        cost["fragment.shadow"].times(events.shadows),
        cost["fragment.missed"].times(events.missed),
        *(cost[f"fragment.surface.{k}"].times(int(n)) for k, n in enumerate(events.surfaces)),
    )  # fmt: skip
    if setup.stages == "vertex_only":
        return {"vertex": shooting, "geometry": Work(), "fragment": shading}
    if setup.stages == "geometry":
        return {"vertex": Work(), "geometry": shooting.plus(spawning), "fragment": shading}
    return {"vertex": shooting, "geometry": spawning, "fragment": shading}
