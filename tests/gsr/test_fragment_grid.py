"""The fragment shader over a viewport quad finds the same hits and makes the same image as the geometry shader, bit for
bit.

Plan
- Property: soups of mirrors, glass and diffuse triangles, dead rays among those of the eye, all options drawn: every
  ray of the geometry shader's method has its like here (pixel, node, light), with the same bits of ray, hit, weight and
  counts and the same parent, and there is no other; the images have the same bits. The same in the box with the grid
  and 8-bit targets, passes 1 to 3. A weight, a light or a quantisation that is off is seen (controls).
- Naive and grid agree in all but their counts; so do 1 and 2 threads, which take both fragment loops, and the plain
  NumPy reference.
- The judge, who shares no code with the engine, finds the hits of all four kinds of ray admissible, and those moved
  inadmissible.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import refsim
from refsim import Hits, Material, Rays, Scene
from refsim.oracle import judge
from refsim.results import RayKind, Trace
from refsim.scene import PointLight
from tests.gsr.pixel_rays import COLUMNS, FOUND, assert_same, by_pixels, same_totals, table
from tests.gsr.scenes import BACKGROUND, GLASS, MIRROR, SHINY, TILES, cornell, cornell_rays, soup, traced, wild

MATERIALS = (MIRROR, GLASS, SHINY, TILES, replace(GLASS, ior=1.8, reflectivity=0.0))
# Columns of a table: those of a ray end at RAY, those of its hit at HIT; counts follow
RAY, HIT = 9, 13
FORMATS = ("rgba32float", "rgba8unorm")
EIGHT_BITS: dict[str, Any] = {"acceleration": "grid", "lights": 1, "color_format": "rgba8unorm"}


@settings(max_examples=40)
@given(
    st.integers(0, 2**16),
    st.integers(1, 3),
    st.tuples(st.booleans(), st.booleans(), st.booleans()),
    st.sampled_from([BACKGROUND, (0.0, 0.0, 0.0), (0.0, 0.0, 2.5)]),
    st.sampled_from(["geometric", "smooth"]),
    st.sampled_from(["both", "front"]),
)
def test_every_ray_has_its_like(
    seed: int, passes: int, secondary: tuple[bool, bool, bool], background: Any, shading: str, facing: str
) -> None:
    scene, rays = soup(seed, 14, MATERIALS, lights=2), wild(9, 7, seed, dead=0.2)
    options = dict(zip(("shadows", "reflections", "refractions"), secondary, strict=True))
    options |= {"passes": passes, "background": background, "shading": shading, "facing": facing}
    found, expected = by_pixels(scene, rays, **options), traced(scene, rays, **options)
    assert_same(found, expected)
    assert same_totals(found, expected)
    for column in COLUMNS:
        assert (getattr(found.exit_rays, column) == getattr(expected.exit_rays, column)).all()


@cache
def box_trace(method: str = "fragment_grid", passes: int = 3, **options: Any) -> Trace:
    return refsim.trace(method, cornell(), cornell_rays(23, 17), passes=passes, **options)


@pytest.mark.parametrize("passes", [1, 2, 3])
def test_the_box_with_the_grid_and_eight_bits(passes: int) -> None:
    found = box_trace(passes=passes, **EIGHT_BITS)
    assert_same(found, box_trace("geometry_shader", passes, **EIGHT_BITS))
    assert same_totals(found, box_trace("geometry_shader", passes, **EIGHT_BITS))
    assert found.image is not None and found.image.shape == (17, 23, 3)
    steps = found.image * 255
    assert np.abs(steps - np.rint(steps)).max() < 1e-4 and len(np.unique(np.rint(steps))) > 30
    kinds = {RayKind(kind) for kind in np.unique(np.concatenate([g.kind[g.alive] for g in found.generations]))}
    assert kinds == ({RayKind.EYE} if passes == 1 else set(RayKind))


def test_what_is_off_is_seen() -> None:
    """Controls of the comparison: a weight one step off, a ray that is missing, the other format's image."""
    trace = box_trace(passes=3, **EIGHT_BITS)
    k = next(k for k, g in enumerate(trace.generations) if g.kind[0] == RayKind.REFRACTED and g.alive.any())
    whole = trace.generations[k]
    assert whole.weight is not None
    first = whole.alive & (np.cumsum(whole.alive) == 1)

    def changed(**fields: Any) -> Trace:
        generations = list(trace.generations)
        generations[k] = replace(whole, **fields)
        return replace(trace, generations=tuple(generations))

    for fields in (
        {"weight": np.where(first, np.nextafter(whole.weight, np.float32(2)), whole.weight)},
        {"alive": whole.alive & ~first},
        {"parent_generation": whole.parent_generation + 1},
    ):
        with pytest.raises(AssertionError):
            assert_same(changed(**fields), trace)
    with pytest.raises(AssertionError):
        assert_same(replace(trace, image=box_trace(acceleration="grid", lights=1).image), trace)
    assert_same(changed(), trace)


@pytest.mark.parametrize("lights", [1, 2])
@pytest.mark.parametrize("color_format", FORMATS)
def test_the_structure_changes_no_bit(lights: int, color_format: str) -> None:
    options = {"lights": lights, "color_format": color_format}
    by_grid, naive = box_trace(acceleration="grid", **options), box_trace(acceleration="naive", **options)
    mine, other = table(by_grid), table(naive)
    assert (mine.keys == other.keys).all() and (mine.parents == other.parents).all()
    surfaces = mine.keys[:, 2] < 0
    assert (mine.words[:, :RAY] == other.words[:, :RAY]).all()
    assert (mine.words[surfaces, :HIT] == other.words[surfaces, :HIT]).all()
    assert by_grid.image is not None and naive.image is not None
    assert (by_grid.image.view(np.int32) == naive.image.view(np.int32)).all()
    # Any hit ends a shadow ray's search, so of shadow rays only that there is one is the same
    for found, expected in zip(by_grid.generations, naive.generations, strict=True):
        assert ((found.hits.triangle >= 0) == (expected.hits.triangle >= 0)).all()
    tests = "intersection.triangle_tests"
    assert by_grid.counters[tests] < 0.7 * naive.counters[tests] and by_grid.counters["traversal.cells"] > 0


def test_threads_and_loops_change_no_bit() -> None:
    """70 × 66 pixels go through the dense loop with one thread and through the list with two."""
    rays = cornell_rays(70, 66)
    one, two = (by_pixels(cornell(), rays, passes=3, threads=threads) for threads in (1, 2))
    assert_same(two, one)
    assert one.counters == two.counters


@pytest.mark.parametrize("lights", [0, 1, 2])
@pytest.mark.parametrize("color_format", FORMATS)
def test_numpy_agrees(lights: int, color_format: str) -> None:
    options = {"passes": 3, "lights": lights, "color_format": color_format, "shading": "smooth"}
    rays = cornell_rays(9, 7)
    found, expected = (by_pixels(cornell(), rays, backend=name, **options) for name in ("numba", "numpy"))
    assert_same(found, expected)
    assert len(found.generations) == len(expected.generations)


def judged(trace: Trace) -> Iterator[tuple[RayKind, Any]]:
    """Verdicts by generation. A shadow ray that hits has found some triangle: it is judged as if it were alone."""
    for generation in trace.generations:
        hits, kind = generation.hits, RayKind(generation.kind[0])
        if kind != RayKind.SHADOW:
            yield kind, judge(trace.scene, generation.rays, hits)
            continue
        for triangle in np.unique(hits.triangle):
            rows = np.flatnonzero(hits.triangle == triangle)
            rays = Rays(*(getattr(generation.rays, name)[rows] for name in COLUMNS))
            scene, found = trace.scene, Hits(*(getattr(hits, name)[rows] for name in FOUND))
            if triangle >= 0:
                scene = Scene(trace.scene.triangles[[triangle]], "one")
                found = replace(found, triangle=np.zeros(len(rows), np.int32))
            yield kind, judge(scene, rays, found)


@pytest.mark.parametrize("acceleration", ["naive", "grid"])
def test_hits_are_admissible(acceleration: str) -> None:
    checked = dict.fromkeys(RayKind, 0)
    for kind, verdicts in judged(box_trace(acceleration=acceleration)):
        assert verdicts.ok, f"{kind.name}: {verdicts.worst()}"
        checked[kind] += int((verdicts.hits.triangle >= 0).sum())
    assert all(hits >= 20 for hits in checked.values()), checked


@pytest.mark.parametrize("kind", list(RayKind))
def test_the_judge_sees_a_wrong_hit(kind: RayKind) -> None:
    trace = box_trace(acceleration="naive")
    generations = list(trace.generations)
    k = next(k for k, g in enumerate(generations) if g.kind[0] == kind and (g.hits.triangle >= 0).any())
    hits = generations[k].hits
    row = int(np.flatnonzero(hits.triangle >= 0)[0])
    for column, value in (("triangle", -1), ("t", hits.t[row] * np.float32(1.001))):
        moved = getattr(hits, column).copy()
        moved[row] = value
        generations[k] = replace(trace.generations[k], hits=replace(hits, **{column: moved}))
        verdicts = [v for _, v in judged(replace(trace, generations=tuple(generations)))]
        assert sum(int((~v.admissible).sum()) for v in verdicts) == 1


def test_eight_bits_are_rounded_at_each_write() -> None:
    """A surface gives one step of 1/255 and, mirrored with weight 1/2, a background of one: 1 and 0 make 1, not 3/2."""
    step = 1 / 255
    pane = Scene(
        np.array([[[-9, -9, 0], [9, -9, 0], [0, 9, 0]]], np.float32),
        "pane",
        (Material("pane", "diffuse", (5 * step, 5 * step, 5 * step), reflectivity=0.5),),
    )
    rays = Rays(np.array([[0, 0, 1]], np.float32), np.array([[0, 0, -1]], np.float32), np.inf, 1, 1)
    options: dict[str, Any] = {"passes": 2, "lights": 0, "background": (step, step, step)}
    wide, narrow = (by_pixels(pane, rays, color_format=name, **options).image for name in FORMATS)
    assert wide is not None and narrow is not None
    assert np.allclose(wide * 255, 1.5) and (np.rint(wide * 255) == 2).all()
    assert (narrow == np.float32(step)).all()


def test_light_that_is_cut_off_at_white() -> None:
    """8 bits are clamped at each write, as in the geometry shader's layers."""
    scene = cornell().replace(lights=(PointLight((0.1, 0.9, 0.1), intensity=9.0), PointLight((-0.1, 0.9, 0.1))))
    rays, options = cornell_rays(), {"passes": 2, "acceleration": "grid"}
    wide = by_pixels(scene, rays, **options).image
    narrow = by_pixels(scene, rays, color_format="rgba8unorm", **options).image
    assert wide is not None and narrow is not None
    assert wide.max() > 2 and narrow.max() == 1 and (narrow[wide > 2] == 1).all()
    # Each of up to 21 terms is rounded by half a step of 1/255
    below = wide < 0.9
    assert np.abs(narrow - wide)[below].max() <= 21 * 0.5 / 255
