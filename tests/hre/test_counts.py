"""Counts are logical invocations, and nothing is drawn but by `draw`.

Plan
- From a tap of the vertex and the fragment stage, restated here: cone–sphere tests, pairs kept, fragments by fate,
  shader invocations per pixel and in all, the hits themselves. They equal the counters of the generation.
- Counts per ray add up to the counters, per generation and over all.
- Against arithmetic: triangles × pixels, triangles × tiles, four vertices a quad; brute force tests live rays only.
- Without `draw` both engines stop, with a `draw` that does nothing they find nothing; brute force does not care.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import refsim
from refsim.papers.hierarchical_ray_engine import tracer
from refsim.pipeline import fragment as fates
from refsim.pipeline.taps import FragmentTap, Taps, VertexTap
from refsim.results import Generation, Trace
from tests.hre.scenes import rays_of, scene_of

HRE, RE, BRUTE = "hierarchical_ray_engine", "ray_engine", "brute_force"
WIDTH, HEIGHT = 30, 22
RAN = (fates.DISCARDED, fates.STENCIL_FAILED, fates.DEPTH_FAILED, fates.WRITTEN)


def traced(method: str, name: str = "torus_knot_128", **options: Any) -> Trace:
    scene = scene_of(name)
    assert scene is not None
    return refsim.trace(method, scene, rays_of(name, WIDTH, HEIGHT), **options)


def drawn(vertex: VertexTap) -> int:
    """Points whose vertex shader left them in view."""
    x, y, _, w = vertex.position.T
    return int(((np.abs(x) <= w) & (np.abs(y) <= w)).sum())


def assert_fragments(generation: Generation, tap: FragmentTap, tiles: int, early_stencil: bool) -> None:
    """Fates of one engine pass, one fragment at a time, against the generation's counters and hits."""
    counters, fate = generation.counters, tap.fate
    count = {code: int((fate == code).sum()) for code in range(fates.COUNTS)}
    early = count[fates.EARLY_STENCIL] + count[fates.EARLY_DEPTH]
    ran = np.isin(fate, RAN)
    assert counters["raster.fragments"] == len(fate) + tiles
    assert counters["fragment.invocations"] == int(ran.sum()) + tiles == len(fate) - early + tiles
    assert counters["fragment.discarded"] == count[fates.DISCARDED]
    assert counters["stencil.failed"] == count[fates.STENCIL_FAILED] + count[fates.EARLY_STENCIL]
    assert counters["stencil.failed_early"] == count[fates.EARLY_STENCIL]
    assert (count[fates.EARLY_STENCIL] > 0) <= early_stencil
    assert counters["depth.failed"] == count[fates.DEPTH_FAILED]
    assert counters["fragment.written"] == count[fates.WRITTEN] + tiles
    per_pixel = np.zeros((HEIGHT, WIDTH), np.int64)
    triangle = np.full((HEIGHT, WIDTH), -1)
    for x, y, code, run, hit in zip(tap.x, tap.y, fate, ran, tap.outputs["triangle"], strict=True):
        per_pixel[y, x] += run
        if code == fates.WRITTEN:
            triangle[y, x] = hit
    assert (per_pixel.ravel() == generation.per_ray["triangle_tests"]).all()
    assert counters["intersection.triangle_tests"] == per_pixel.sum()
    assert (triangle.ravel() == generation.hits.triangle).all()


@pytest.mark.parametrize("tile_size", [3, 8])
def test_hierarchical_counts_from_a_tap(tile_size: int) -> None:
    taps = Taps("vertex", "fragment")
    trace = traced(HRE, tile_size=tile_size, taps=taps, generations=3)
    assert len(taps.vertex) == len(taps.fragment) == 6
    tiles = -(-WIDTH // tile_size) * -(-HEIGHT // tile_size)
    for k, generation in enumerate(trace.generations):
        cone, sprites = taps.vertex[2 * k : 2 * k + 2]
        kept = drawn(sprites)
        assert len(cone.position) == 4 and len(sprites.position) == tiles * 128
        assert generation.counters["vertex.invocations"] == 4 + tiles * 128
        assert generation.counters["cone.sphere_tests"] == len(sprites.position)
        assert generation.counters["cone.pairs_kept"] == kept == generation.counters["raster.drawn"] - 1
        assert 0 < kept < len(sprites.position)
        assert generation.counters["raster.clipped"] == len(sprites.position) - kept
        cones, fragments = taps.fragment[2 * k : 2 * k + 2]
        assert len(cones.fate) == tiles and (cones.fate == fates.WRITTEN).all()
        assert len(np.unique(fragments.primitive)) == kept
        assert_fragments(generation, fragments, tiles, early_stencil=k > 0)
    assert trace.generations[1].counters["stencil.failed_early"] > 0


@pytest.mark.parametrize("stencil", [False, True])
def test_ray_engine_counts_from_a_tap(stencil: bool) -> None:
    taps = Taps("vertex", "fragment")
    trace = traced(RE, taps=taps, generations=2, stencil=stencil)
    for generation, vertex, fragments in zip(trace.generations, taps.vertex, taps.fragment, strict=True):
        assert len(vertex.position) == 4 * 128 == generation.counters["vertex.invocations"]
        assert len(fragments.fate) == 128 * WIDTH * HEIGHT
        assert_fragments(generation, fragments, 0, early_stencil=stencil)


@pytest.mark.parametrize(
    ("method", "options"),
    [
        (BRUTE, {}),
        (RE, {}),
        (RE, {"stencil": True}),
        (HRE, {}),
        (HRE, {"tile_size": 2}),
        (HRE, {"early_tests": "none"}),
    ],
)
def test_counts_per_ray_add_up(method: str, options: dict[str, Any]) -> None:
    trace = traced(method, "cornell_box", **options)
    for generation in trace.generations:
        assert generation.per_ray["triangle_tests"].sum() == generation.counters["intersection.triangle_tests"] > 0
    summed = sum(generation.per_ray["triangle_tests"].astype(np.int64) for generation in trace.generations)
    assert (trace.per_ray["triangle_tests"] == summed).all()
    assert trace.per_ray["triangle_tests"].dtype == np.int64
    for name in trace.counters:
        if name != "intersection.degenerate_triangles":
            assert trace.counters[name] == sum(generation.counters[name] for generation in trace.generations), name


def test_counts_by_arithmetic() -> None:
    pixels, triangles = WIDTH * HEIGHT, 36
    brute, engine = traced(BRUTE, "cornell_box"), traced(RE, "cornell_box")
    for a, b in zip(brute.generations, engine.generations, strict=True):
        live = int(a.alive.sum())
        assert a.counters["intersection.triangle_tests"] == live * triangles
        assert b.counters["intersection.triangle_tests"] == pixels * triangles == b.counters["raster.fragments"]
        by_kind = sum(b.counters[f"rays.{kind}"] for kind in ("eye", "reflected", "refracted"))
        assert by_kind == live == sum(a.counters[f"rays.{kind}"] for kind in ("eye", "reflected", "refracted"))
    hierarchical = traced(HRE, "cornell_box", tile_size=8)
    for generation in hierarchical.generations:
        cones = generation.cones
        assert cones is not None and len(cones.state) == 4 * 3 == cones.width * cones.height
        assert generation.counters["cone.sphere_tests"] == 12 * triangles
        states = [generation.counters[f"cone.tiles_{name}"] for name in ("empty", "bounded", "unbounded")]
        assert states == [int((cones.state == k).sum()) for k in range(3)] and sum(states) == 12


@pytest.mark.parametrize("method", [RE, HRE])
def test_without_draw_the_engines_stop(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_draw(*_: Any, **__: Any) -> None:
        raise RuntimeError("nothing draws")

    monkeypatch.setattr(tracer, "draw", no_draw)
    with pytest.raises(RuntimeError, match="nothing draws"):
        traced(method)
    assert (traced(BRUTE).hits.triangle >= 0).any()


def test_an_idle_draw_hits_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = traced(RE)
    assert (expected.hits.triangle >= 0).any()
    monkeypatch.setattr(tracer, "draw", lambda *_, **__: None)
    idle = traced(RE)
    for generation in idle.generations:
        assert (generation.hits.triangle == -1).all()
        assert generation.counters["intersection.triangle_tests"] == 0
    assert (idle.exit_rays.direction == expected.generations[0].rays.direction).all()


def test_half_of_draw_is_not_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """The cones come from a draw too: without that one, texels are zero and cull nothing."""
    culled = traced(HRE, generations=1).counters
    draw = tracer.draw

    def second_half(pipeline: Any, **arguments: Any) -> None:
        if pipeline.label != "enclosing cones":
            draw(pipeline, **arguments)

    monkeypatch.setattr(tracer, "draw", second_half)
    monkeypatch.setattr(tracer, "CORNERS_OF_CONE_PASS", 0)
    counters = traced(HRE, generations=1).counters
    assert counters["raster.drawn"] == counters["raster.primitives"] > culled["raster.drawn"]
    assert counters["cone.tiles_bounded"] == 0 < culled["cone.tiles_bounded"]
