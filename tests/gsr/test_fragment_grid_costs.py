"""Arithmetic and fetches of the method "fragment_grid": the counters of its passes.

Plan
- The shaders are run as plain Python over every pixel and pass of a picture, each operation reporting itself: they make
  the rays and the image of the pipeline, and do what the blocks say; where a branch is not told apart, no more than it.
- A generation's counters are the sums of its pixels' blocks, counted from the trace; generations add up to the run.
- Active lane-steps of the shooting passes are their arithmetic and fetches, in every configuration; a pass that lights
  costs what its light, its shadows and the format of the image ask for.
- A search whose source cannot be read has no such counters, the NumPy reference neither. Rays that are no image:
  pixels without a ray run too.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import refsim
from refsim import Rays
from refsim.counters import COSTS, Counters
from refsim.methods import METHODS
from refsim.papers.geometry_shader_rays import fragment_grid_costs as quads
from refsim.papers.geometry_shader_rays.costs import Work, search_work, shares
from refsim.papers.geometry_shader_rays.fragment_grid import FragmentGridTracer
from refsim.papers.geometry_shader_rays.fragment_grid_shaders import (
    LitTexels,
    LitTextures,
    QuadFrame,
    SenderTexels,
    ShotTextures,
    lighting_fragment,
    shooting_fragment,
)
from refsim.papers.geometry_shader_rays.pass_costs import surfaces_of
from refsim.papers.geometry_shader_rays.setup import options_of, prepared
from refsim.papers.geometry_shader_rays.simt_lanes import accounts, setup_of
from refsim.results import Generation, RayKind, Trace
from tests.gsr.counting_run import CountedRun
from tests.gsr.pixel_rays import by_pixels
from tests.gsr.scenes import cornell, cornell_rays

CONFIGURATIONS: dict[str, dict[str, Any]] = {
    "all rays": {},
    "smooth": {"shading": "smooth", "acceleration": "grid"},
    "no shadows": {"shadows": False},
    "no glass": {"refractions": False, "lights": 1},
    "eye rays": {"passes": 1, "lights": 0, "color_format": "rgba8unorm"},
    "8 bits": {"color_format": "rgba8unorm", "passes": 2, "background": (0.0, 0.0, 0.0)},
}


@cache
def configured(name: str) -> Trace:
    return by_pixels(cornell(), cornell_rays(), **{"passes": 3, "lights": 2, **CONFIGURATIONS[name]})


def columns(trace: Trace, generation: Generation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Texels of a generation, a row a pixel."""
    rays, hits = generation.rays, generation.hits
    found = np.column_stack([hits.t, hits.u, hits.v, hits.triangle]).astype(np.float32)
    return np.column_stack([rays.origin, rays.t_max]), np.column_stack([rays.direction, generation.weight]), found


class Replay:
    """The shaders of a trace in plain Python: what a pixel gets, and what it did for it."""

    def __init__(self, trace: Trace) -> None:
        defaults = {option.name: option.default for option in METHODS["fragment_grid"].options}
        options = {**defaults, **trace.options}
        shared, rays = options_of(trace.scene, options), cornell_rays()
        self.tracer = FragmentGridTracer(prepared(trace.scene, rays, options, shared), 14, 11, shared)
        self.trace, self.found = trace, (0,) * 7
        traverse = self.tracer.prepared.accelerator.traverse
        self.counted = CountedRun({traverse: lambda *_: self.found})
        self.shooting = self.counted.run(shooting_fragment(traverse))
        self.lighting = self.counted.run(lighting_fragment)

    def did(self) -> Work:
        done = self.counted.done
        return Work(done.total() - done["fetch"], done["fetch"])

    def uniforms(self, g: Generation, light: int) -> QuadFrame:
        assert g.node is not None
        return QuadFrame(self.tracer.frame, *(np.int32(n) for n in (g.kind[0], g.node[0], light, 0)))

    def shoot(self, k: int, pixel: int) -> tuple[Any, Work]:
        g, t = self.trace.generations[k], self.tracer.prepared.textures
        eye = g.parent_generation < 0
        sender = columns(self.trace, self.trace.generations[k if eye else g.parent_generation])
        assert g.light is not None
        u, hits = self.uniforms(g, g.light[0]), g.hits
        texels = SenderTexels(*(tuple(part[pixel]) for part in sender))
        counts = [np.int32(g.per_ray[name][pixel]) for name in ("cells", "triangle_tests", "box_rejections")]
        self.found = (hits.triangle[pixel], hits.t[pixel], hits.u[pixel], hits.v[pixel], *counts)  # type: ignore[assignment]
        self.counted.done.clear()
        textures = ShotTextures(None, t.triangles, t.surfaces, *(None,) * 3)  # type: ignore[arg-type]
        _, _, shot = self.shooting(u, textures, None, texels, None)
        return shot, self.did()

    def light(self, k: int, light: int, occluder: int, pixel: int) -> tuple[Any, Work]:
        t = self.tracer.prepared.textures
        g = self.trace.generations[k]
        own = (tuple(part[pixel]) for part in columns(self.trace, g))
        texels = LitTexels(*own, (0, 0, 0, np.float32(occluder)))  # type: ignore[arg-type]
        self.counted.done.clear()
        textures = LitTextures(t.triangles, t.surfaces, *(None,) * 4)  # type: ignore[arg-type]
        _, _, picture = self.lighting(self.uniforms(g, light), textures, None, texels, None)
        return picture.color, self.did()


def shadows_of(trace: Trace, k: int) -> dict[int, Generation]:
    return {int(g.light[0]): g for g in trace.generations  # type: ignore[index]
            if g.parent_generation == k and g.kind[0] == RayKind.SHADOW}  # fmt: skip


def bits(*rows: Any) -> list[int]:
    return np.concatenate([np.atleast_1d(np.asarray(row, np.float32)) for row in rows]).view(np.int32).tolist()


@pytest.mark.parametrize("name", ["all rays", "smooth"])
def test_shooting_in_plain_python(name: str) -> None:
    trace = configured(name)
    replay, setup = Replay(trace), setup_of(trace)
    seen: set[tuple[int, str, int]] = set()
    for k, g in enumerate(trace.generations):
        kind, blocks = int(g.kind[0]), quads.shooting_blocks(setup, int(g.kind[0]))
        eye = g.parent_generation < 0
        senders = np.full(len(g.rays), -1) if eye else trace.generations[g.parent_generation].hits.triangle
        for pixel in range(k % 3, len(g.rays), 3):
            shot, did = replay.shoot(k, pixel)
            alive = bool(g.alive[pixel])
            if alive:
                made = (shot.origin[:3], shot.origin[3], shot.direction[:3], shot.direction[3])
                assert g.weight is not None
                drawn = (getattr(g.rays, column)[pixel] for column in ("origin", "t_max", "direction"))
                assert bits(*made) == bits(*drawn, g.weight[pixel])
            else:
                assert not shot.origin[3] > 0
            case = "sent" if alive else "refused" if senders[pixel] >= 0 else "idle"
            block = getattr(blocks, case)
            over = block.arithmetic - did.arithmetic
            # Total internal reflection adds τ to ρ; whether it does, only the data say
            unsure = kind > RayKind.SHADOW and case != "idle"
            assert did.fetches == block.fetches and over in ((0, 1) if unsure else (0,))
            seen.add((kind, case, over))
    cases = {(kind, case) for kind, case, _ in seen}
    assert cases >= {(kind, case) for kind in (1, 2, 3) for case in ("sent", "idle")}
    assert cases >= {(RayKind.EYE, "sent"), (RayKind.REFLECTED, "refused"), (RayKind.REFRACTED, "refused")}
    assert (RayKind.REFLECTED, "sent", 0) in seen and (RayKind.REFLECTED, "sent", 1) in seen


@pytest.mark.parametrize("name", ["all rays", "smooth"])
def test_lighting_in_plain_python(name: str) -> None:
    trace = configured(name)
    replay, blocks = Replay(trace), quads.lighting_blocks(setup_of(trace), 0)
    kinds, surface_of = surfaces_of(trace.scene)
    image = np.zeros((len(cornell_rays()), 3), np.float32)
    exact: set[str] = set()
    for k, g in enumerate(trace.generations):
        if g.kind[0] == RayKind.SHADOW:
            continue
        shadows = shadows_of(trace, k)
        for light in (-1, 0, 1):
            for pixel in range(len(image)):
                triangle = int(g.hits.triangle[pixel])
                occluder = int(shadows[light].hits.triangle[pixel]) if light in shadows else -1
                color, did = replay.light(k, light, occluder, pixel)
                image[pixel] += np.array(color[:3], np.float32)
                surface = int(surface_of[triangle]) if triangle >= 0 else -1
                if light < 0:
                    case, block = ("background", blocks.background) if triangle < 0 else ("ambient", blocks.ambient)
                elif triangle < 0 or occluder >= 0:
                    case, block = ("unlit", blocks.unlit) if triangle < 0 else ("shadowed", blocks.shadowed)
                else:
                    case, block = f"lit {surface}", blocks.lit[surface]
                # A highlight that is not there is not raised to a power
                dark = case.startswith("lit") and kinds[surface][0] > 0
                assert did == block or (dark and did.fetches == block.fetches and did.arithmetic < block.arithmetic)
                exact |= {case} if did == block else set()
    assert exact == {"background", "ambient", "unlit", "shadowed", *(f"lit {n}" for n in range(len(kinds)))}
    assert trace.image is not None and bits(image.ravel()) == bits(trace.image.ravel())


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_counters_are_sums_of_blocks(name: str) -> None:
    trace = configured(name)
    setup, (_, surface_of) = setup_of(trace), surfaces_of(trace.scene)
    lighting = quads.lighting_blocks(setup, int(trace.options["color_format"] == "rgba8unorm"))
    search, shooting_steps = search_work(setup.traverse), 0
    for k, g in enumerate(trace.generations):
        blocks, work = quads.shooting_blocks(setup, int(g.kind[0])), Work()
        eye = g.parent_generation < 0
        for pixel, alive in enumerate(g.alive):
            hit = not eye and trace.generations[g.parent_generation].hits.triangle[pixel] >= 0
            work = work.plus(blocks.sent if alive else blocks.refused if hit else blocks.idle)
            if alive:
                cells, tests = g.per_ray["cells"][pixel], g.per_ray["triangle_tests"][pixel]
                work = work.plus(search.outside, search.walking.times(cells > 0), search.cell.times(cells),
                                 search.test.times(tests))  # fmt: skip
        shooting_steps += work.arithmetic + work.fetches
        for pixel, triangle in enumerate(g.hits.triangle if g.kind[0] != RayKind.SHADOW else ()):
            work = work.plus(lighting.background if triangle < 0 else lighting.ambient)
            for light in range(setup.lights):
                shadow = shadows_of(trace, k).get(light)
                dark = shadow is not None and shadow.hits.triangle[pixel] >= 0
                work = work.plus(lighting.unlit if triangle < 0 else lighting.shadowed if dark
                                 else lighting.lit[surface_of[triangle]])  # fmt: skip
        assert (g.counters["fragment.arithmetic"], g.counters["fragment.fetches"]) == work
        assert g.counters["vertex.arithmetic"] == g.counters["vertex.fetches"] == 0
    for cost in COSTS:
        assert trace.counters[cost] == sum(g.counters[cost] for g in trace.generations)
    assert shares(trace.counters) == {"vertex": 0.0, "geometry": 0.0, "fragment": 100.0}
    for width in (8, 64):
        assert accounts(trace, width)["fragment"].active == shooting_steps


def test_what_lighting_costs() -> None:
    wide, narrow = (quads.lighting_blocks(setup_of(configured("all rays")), bits) for bits in (0, 1))
    flat = [wide.background, wide.ambient, wide.unlit, wide.shadowed, *wide.lit]
    steps = [work.arithmetic for work in flat]
    assert steps[0] < steps[2] < steps[3] < steps[1] < steps[4] and steps[4:] == sorted(steps[4:])
    # Rounding a component: times 255, to the nearest, and back by two products and a sum; clamped by two selects
    for one, other in zip(flat, [narrow.background, narrow.ambient, narrow.unlit, narrow.shadowed, *narrow.lit],
                          strict=True):  # fmt: skip
        assert other == one.plus(Work(3 * 7, 0))
    assert quads.corner_work() == Work()


def test_pixels_without_a_ray_run_too() -> None:
    """Ten rays make four columns and three rows; the last two pixels are dead in every pass."""
    seen = cornell_rays(5, 2)
    trace = by_pixels(cornell(), Rays(seen.origin, seen.direction, seen.t_max), passes=2, lights=1)
    whole = by_pixels(cornell(), seen, passes=2, lights=1)
    setup = setup_of(trace)
    lighting = quads.lighting_blocks(setup, 0)
    for found, expected in zip(trace.generations, whole.generations, strict=True):
        idle = quads.shooting_blocks(setup, int(found.kind[0])).idle
        lit = Work() if found.kind[0] == RayKind.SHADOW else lighting.background.plus(lighting.unlit)
        more = idle.plus(lit).times(2)
        assert found.counters["fragment.arithmetic"] - expected.counters["fragment.arithmetic"] == more.arithmetic
        assert found.counters["fragment.fetches"] == expected.counters["fragment.fetches"]


def test_no_counters_without_a_source() -> None:
    trace = configured("no glass")
    names: dict[str, Any] = {}
    exec("def traverse(structure, triangles, o, d, t_max, any_hit, front_only): return -1", names)
    tracer = Replay(trace).tracer
    unread = tracer.prepared.accelerator._replace(traverse=names["traverse"])
    tracer.prepared = replace(tracer.prepared, accelerator=unread)
    generations = [replace(g, counters=Counters()) for g in trace.generations]
    quads.QuadCosts(tracer).add(generations)
    assert not any(g.counters for g in generations)
    reference = refsim.trace("fragment_grid", cornell(), cornell_rays(), passes=2, backend="numpy")
    assert not set(COSTS) & set(reference.counters)
