"""What the raster tap says became of every primitive: why a triangle is not there.

Plan
- As many primitives have each fate as are counted, in any draw: triangles whole, cut into pieces, outside and without
  area, with either face culled or none; points and quads; strips that a geometry shader emits. Those drawn are those
  that have rows. Threads, small rounds and small feeds change no fate.
- Triangles that need no clipping have the fate that the reference gives them. What is culled with one cull mode is what
  is drawn without, facing that way.
- Points: clipped where the vertex is outside.
- The taps of fragments have fates that the counters know.
- A table: one draw with a triangle of every fate, by hand; an empty draw.
- A raster tap refuses more primitives than it may hold, though none is drawn; taps can be cleared and shown shortly.
"""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.pipeline import CullMode, FragmentFate, PrimitiveFate, Taps, emission, rounds
from refsim.pipeline import taps as taps_module
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import Framebuffer
from refsim.reference import clip, raster
from tests.pipeline import geometry_pipelines as emitting
from tests.pipeline import scenes
from tests.pipeline.pipelines import POOL, as_quads
from tests.raster.drawing import BACKS, FRONTS, LIST, TARGETS, Screen, clip_positions, vertices_of
from tests.raster.test_clipping import COMBINATIONS, vertex_in

SCREEN = Screen(40, 28, (1.5, 2.0, 36.0, 24.5, 0.25, 0.75))
BOUNDS = raster.pixels_of(SCREEN.viewport, SCREEN.scissor)
DRAWN, CLIPPED, EMPTY, CROOKED, CULLED = PrimitiveFate
EMITTED = replace(
    emitting.drawing(emitting.POOL["list to strips"]), cull_mode=CullMode.BACK, stream_output=None, label="fates"
)


def small_rounds(patch, primitives=8):
    """Rounds and feeds of few primitives from here on."""
    patch.setattr(rounds, "SMALLEST_SLICE", primitives)
    patch.setattr(rounds, "ROUND_PRIMITIVES", primitives)
    patch.setattr(emission, "SMALLEST_SLICE", 1)
    patch.setattr(emission, "EMITTED_ROWS", primitives)


def agreeing(tap, counters):
    """The fates of a tap, which are as many of each as the counters say; those drawn are those with rows."""
    assert tap.fate.dtype == np.int32 and len(tap.fate) == counters["raster.primitives"]
    found = Counter(tap.fate.tolist())
    names = {DRAWN: "drawn", CLIPPED: "clipped", EMPTY: "empty", CULLED: "culled"}
    assert found == {fate: n for fate, name in names.items() if (n := counters[f"raster.{name}"])}
    np.testing.assert_array_equal(np.unique(tap.primitive), np.flatnonzero(tap.fate == DRAWN))
    return tap.fate


def fates_of(pipe, position, *, threads=1, **options):
    """Of triangles drawn once; with the rows of the raster tap."""
    counters, taps = Counters(), Taps("raster")
    draw(pipe, framebuffer=Framebuffer(SCREEN.width, SCREEN.height, TARGETS), counters=counters, taps=taps,
         vertices=vertices_of(position), dynamic=SCREEN.dynamic, threads=threads, **options)  # fmt: skip
    return agreeing(taps.raster[0], counters), taps.raster[0], counters


def whole_fate(position, viewport, bounds, culled=None):
    """The fate of a triangle f32 [3, 4] that needs no clipping, by the reference; `culled`: front faces, back ones."""
    if clip.is_outside(position):
        return CLIPPED
    snapped = raster.corners_of(position, viewport)
    if raster.doubled_area(snapped) == 0:
        return EMPTY
    if culled is not None and raster.faces_front(snapped, "ccw") == culled:
        return CULLED
    return DRAWN if raster.holds_centre(snapped, bounds) else EMPTY


def some_triangles(seed):
    """Positions f32 [n, 3, 4]: through every plane and outside, and small ones of which many hold no centre."""
    rng = np.random.default_rng(seed)
    regions = [COMBINATIONS[k] for k in rng.integers(0, len(COMBINATIONS), 150)]
    through = np.array([[vertex_in(rng, region) for region in three] for three in regions], np.float32)
    middle, spread = rng.uniform((-4, -4), (44, 32), (60, 1, 2)), rng.choice([0.0, 0.4, 9.0], (60, 1, 1))
    corner = middle + spread * rng.normal(size=(60, 3, 2))
    small = clip_positions(SCREEN, corner[..., 0], corner[..., 1], rng.uniform(0.1, 0.9, (60, 3)), 1.5)
    return rng.permutation(np.concatenate([through, small]))


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**31), st.integers(1, 2), st.booleans())
def test_triangles(seed, threads, small):
    position = some_triangles(seed)
    uncut = [k for k, three in enumerate(position) if not clip.needs_clipping(three, SCREEN.viewport)]
    with pytest.MonkeyPatch.context() as patch:
        if small:
            small_rounds(patch)
        fate, rows, counters = fates_of(LIST, position, threads=threads)
        assert set(fate) == {DRAWN, CLIPPED, EMPTY} and counters["raster.clipped_pieces"] > 0
        front = np.zeros(len(position), bool)
        front[rows.primitive] = rows.front
        for pipe, dropped in ((LIST, None), (FRONTS, False), (BACKS, True)):
            both = fates_of(pipe, position, threads=threads, instances=2)[0].reshape(2, -1)
            got = both[0]
            np.testing.assert_array_equal(both[1], got)
            expected = [whole_fate(position[k], SCREEN.viewport, BOUNDS, dropped) for k in uncut]
            np.testing.assert_array_equal(got[uncut], expected)
            shown = fate == DRAWN
            gone = shown & (front == dropped) if dropped is not None else np.zeros_like(shown)
            np.testing.assert_array_equal(got[shown], np.where(gone, CULLED, DRAWN)[shown])
            np.testing.assert_array_equal(got == CLIPPED, fate == CLIPPED)


def test_small_rounds_are_really_taken(monkeypatch):
    small_rounds(monkeypatch)
    counts = []
    make = rounds.Round.__init__
    monkeypatch.setattr(rounds.Round, "__init__", lambda self, *a: counts.append(a[2]) or make(self, *a))
    fates_of(LIST, some_triangles(1), threads=2)
    assert len(counts) >= 2 * 27 and max(counts) <= 8


@settings(deadline=None, max_examples=16)
@given(st.integers(0, 2**31), st.booleans(), st.integers(1, 2), st.booleans())
def test_points_and_quads(seed, quads, threads, small):
    scene = scenes.random_scene(seed, quads=quads)
    pipe, taps = as_quads(POOL["nearest"]) if quads else POOL["nearest"], Taps("vertex", "raster", "fragment")
    with pytest.MonkeyPatch.context() as patch:
        if small:
            small_rounds(patch)
        _, counters = scenes.run(pipe, scene, taps=taps, threads=threads, instances=2)
    fate = agreeing(taps.raster[0], counters)
    x, y, z, w = taps.vertex[0].position.T
    inside = (w > 0) & (abs(x) <= w) & (abs(y) <= w) & (z >= 0) & (z <= w)
    inside = inside.reshape(-1, 4).all(axis=1) if quads else inside
    np.testing.assert_array_equal(fate == CLIPPED, ~inside)
    np.testing.assert_array_equal(np.unique(taps.fragment[0].primitive), np.flatnonzero(fate == DRAWN))
    assert_fragment_fates(taps.fragment[0], counters)


def assert_fragment_fates(tap, counters):
    """As many fragments of each fate as are counted."""
    found = {fate: int((tap.fate == fate).sum()) for fate in FragmentFate}
    assert sum(found.values()) == len(tap.fate) == counters["raster.fragments"]
    early, names = FragmentFate.EARLY_STENCIL, FragmentFate
    assert found[early] == counters["stencil.failed_early"]
    assert found[names.EARLY_DEPTH] == counters["depth.failed_early"]
    assert found[names.DISCARDED] == counters["fragment.discarded"]
    assert found[names.STENCIL_FAILED] + found[early] == counters["stencil.failed"]
    assert found[names.DEPTH_FAILED] + found[names.EARLY_DEPTH] == counters["depth.failed"]
    assert found[names.WRITTEN] == counters["fragment.written"]


@settings(deadline=None, max_examples=12)
@given(st.integers(0, 2**31), st.integers(1, 2), st.sampled_from([2**18, 16, 40]))
def test_emitted_strips(seed, threads, rows):
    rng = np.random.default_rng(seed)
    buffer, table = emitting.seeds(60, rng), rng.integers(0, 3, (20, emitting.MOST)).astype(np.int32)
    buffer.floats[0, 30:36] += 500
    table[10] = 1
    counters, taps, target = Counters(), Taps("geometry", "raster"), emitting.target()
    with pytest.MonkeyPatch.context() as patch:
        small_rounds(patch, rows)
        draw(EMITTED, vertices=buffer, uniforms=emitting.Codes(table), framebuffer=target, counters=counters,
             taps=taps, instances=2, threads=threads)  # fmt: skip
    fate = agreeing(taps.raster[0], counters)
    side = float(emitting.SIDE)
    viewport, bounds = (0.0, 0.0, side, side, 0.0, 1.0), (0, 0, emitting.SIDE, emitting.SIDE)
    emitted = taps.geometry[0]
    expected = [whole_fate(emitted.position[three], viewport, bounds, False) for three in emitted.primitives]
    np.testing.assert_array_equal(fate, expected)
    assert CLIPPED in fate and len(fate) == counters["geometry.primitives_out"]


BY_HAND = {
    "front": ([(-1, 1, 0, 1), (-1, -1, 0, 1), (1, 1, 0, 1)], DRAWN),
    "back": ([(-1, 1, 0, 1), (1, 1, 0, 1), (-1, -1, 0, 1)], CULLED),
    "back, between pixel centres": ([(0, 1e-3, 0, 1), (1e-2, 1e-3, 0, 1), (0, -1e-2, 0, 1)], CULLED),
    "no number": ([(-1, np.nan, 0, 1), (-1, -1, 0, 1), (1, 1, 0, 1)], CLIPPED),
    "behind the eye": ([(-1, 1, 0, -1), (-1, -1, 0, -1), (1, 1, 0, -1)], CLIPPED),
    "a point": ([(0, 0, 0, 1)] * 3, EMPTY),
    "front, cut": ([(-1, 1, -0.5, 1), (-1, -1, 0.5, 1), (1, 1, 0.5, 1)], DRAWN),
    "back, cut": ([(-1, 1, -0.5, 1), (1, 1, 0.5, 1), (-1, -1, 0.5, 1)], CULLED),
    "left of the screen": ([(-3, 1, 0, 1), (-3, -1, 0, 1), (-2, 1, 0, 1)], CLIPPED),
    "between the planes' corners": ([(1.5, -0.4, -0.4, 1), (1.5, -0.5, -0.5, 1), (0.5, 0.5, -0.1, 1)], CLIPPED),
}


def test_by_hand():
    triangles, expected = zip(*BY_HAND.values(), strict=True)
    fate = fates_of(FRONTS, np.array(triangles))[0]
    assert dict(zip(BY_HAND, (PrimitiveFate(one).name for one in fate), strict=True)) == {
        name: fate.name for name, fate in zip(BY_HAND, expected, strict=True)
    }
    assert len(fates_of(FRONTS, np.empty((0, 3, 4)))[0]) == 0


def test_more_primitives_than_fit_are_refused(monkeypatch):
    outside = np.array([BY_HAND["behind the eye"][0]] * 10)
    monkeypatch.setattr(taps_module, "MAX_TAPPED", 10)
    assert fates_of(LIST, outside)[0].tolist() == [CLIPPED] * 10
    monkeypatch.setattr(taps_module, "MAX_TAPPED", 9)
    with pytest.raises(InputError, match="tapping 'triangles' would copy 10 records, more than 9"):
        fates_of(LIST, outside)


def test_taps_are_cleared_and_shown():
    taps, target = Taps("vertex", "raster"), Framebuffer(SCREEN.width, SCREEN.height, TARGETS)
    assert repr(taps) == "<Taps, records of vertex: 0, raster: 0>"
    position = np.array([BY_HAND["front"][0], BY_HAND["a point"][0]])
    for _ in range(2):
        draw(LIST, framebuffer=target, counters=Counters(), taps=taps, vertices=vertices_of(position), threads=1)
    assert repr(taps) == "<Taps, records of vertex: 2, raster: 2>"
    assert repr(taps.vertex[1]) == (
        "VertexTap('triangles', position [6, 4], point_size [6], vertex_index [6], instance_index [6])"
    )
    kept = taps.raster
    taps.clear()
    assert (taps.vertex, taps.raster, kept, taps.stages) == ([], [], [], ("vertex", "raster"))
