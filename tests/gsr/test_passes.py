"""Every stage of every pass, a record at a time, against the listings in plain Python (`tests.gsr.listings`).

Plan
- A box with mirror, glass, diffuse walls, two lights, three passes, all taps. What the vertex shader made of every ray
  of the buffer; what the geometry shader emitted for it, in order, and where on the layers; that stream output
  captured just this, and the next pass read just that; what the fragment shader made of each point and which it
  discarded; Eq. 1 and the sum of all targets by hand.
- The same without taps gives the same bytes.
- Counts of each pass, from the taps.

Bounds. Origins lie within 4 roundings of the box's size (2) and of t (up to 4); directions carry the roundings of
normal, cosine and root; none is near total reflection by less than 1e-3. 2e-6 covers them. Colours are sums of products
of such: 4e-6.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from refsim.pipeline import fragment as fates
from refsim.pipeline.taps import Taps
from refsim.results import RayKind, Trace
from tests.gsr.listings import Listings
from tests.gsr.scenes import cornell, cornell_rays, traced

PASSES, LIGHTS, BRANCHING = 3, 2, 2
LAYERS = 2**PASSES - 1
WIDTH, HEIGHT = 10, 8
FIELDS = ("pos", "orig_t", "dir_idx", "uv_state")
NEAR = 2e-6


@dataclass
class Run:
    """A trace, its taps, and the records f32[n, 16] that each stage of each pass held."""

    trace: Trace
    taps: Taps
    drawn: list[np.ndarray]
    shot: list[np.ndarray]
    emitted: list[np.ndarray]


def records(columns: dict[str, np.ndarray]) -> np.ndarray:
    return np.concatenate([columns[name] for name in FIELDS], axis=1)


@cache
def run() -> Run:
    taps, rays = Taps(), cornell_rays(WIDTH, HEIGHT)
    trace = traced(cornell(), rays, passes=PASSES, taps=taps)
    x, y = np.meshgrid((np.arange(WIDTH) + 0.5) / WIDTH * 2 - 1, 1 - (np.arange(HEIGHT) + 0.5) / HEIGHT * 2)
    eye = np.zeros((len(rays), 16), np.float32)
    eye[:, 0], eye[:, 1], eye[:, 2:4], eye[:, 7], eye[:, 11] = x.ravel(), y.ravel(), 1, np.inf, -1
    eye[:, 4:7], eye[:, 8:11] = rays.origin, rays.direction
    captured = [records(tap.records) for tap in taps.stream_output]
    return Run(
        trace, taps, [eye, *captured[:-1]], [records(tap.varyings) for tap in taps.vertex],
        [records(tap.varyings) for tap in taps.geometry],
    )  # fmt: skip


@pytest.fixture(scope="module")
def listings() -> Listings:
    return Listings(cornell(), BRANCHING)


def test_the_run_has_everything() -> None:
    """Else the rest would show little: all kinds, total reflection in the glass, a reflected ray that leaves."""
    spawned = {"shadow": 100, "reflected": 20, "refracted": 10}
    assert all(run().trace.counters[f"geometry.spawned_{kind}"] >= least for kind, least in spawned.items())
    assert all(run().trace.counters[f"geometry.passed_{kind}"] > 0 for kind in ("eye", *spawned))
    everything = np.concatenate(run().emitted)
    assert ((everything[:, 14] == 3) & (everything[:, 11] == -1)).any()
    scene = cornell()
    glass = np.array([material.kind == "glass" for material in scene.materials])[scene.material_ids]
    total = 0
    for generation in run().trace.generations[:-1]:
        surface = np.flatnonzero((generation.kind != RayKind.SHADOW) & (generation.hits.triangle >= 0))
        total += sum(1 for row in surface if glass[generation.hits.triangle[row]])
    assert run().trace.counters["geometry.spawned_refracted"] < total
    assert len(run().taps.stream_output) == len(run().taps.geometry) == PASSES
    assert len(run().taps.fragment) == len(run().taps.vertex) == PASSES


@pytest.mark.parametrize("k", range(PASSES))
def test_the_vertex_shader_intersects(k: int, listings: Listings) -> None:
    """Listing 3: rays of state 0 and 1 are shot and leave with state 1; others are left alone."""
    before, after = run().drawn[k], run().shot[k]
    assert before.shape == after.shape
    assert (after[:, [0, 1, 2, 3, 4, 5, 6, 8, 9, 10, 15]] == before[:, [0, 1, 2, 3, 4, 5, 6, 8, 9, 10, 15]]).all()
    done = before[:, 14] == 3
    assert (after[done] == before[done]).all() and (k == 0 or done.any())
    assert set(before[~done, 14]) == {0.0 if k == 0 else 1.0} and (after[~done, 14] == 1).all()
    for r, hit in zip(before[~done], after[~done], strict=True):
        found = listings.all_hits(r[4:7].astype(np.float64), r[8:11].astype(np.float64), float(r[7]))
        index = int(hit[11])
        if index == -1:
            assert not found and hit[7] == r[7] and (hit[12:14] == 0).all()
        elif r[15] > 0:
            assert found[index] == pytest.approx(float(hit[7]), abs=1e-5)
        else:
            nearest = min(found, key=lambda triangle: found[triangle])
            assert index == nearest and found[nearest] == pytest.approx(float(hit[7]), abs=1e-5)


@pytest.mark.parametrize("k", range(PASSES))
def test_the_geometry_shader_emits(k: int, listings: Listings) -> None:
    """Listing 4: what passes, what is spawned, in which order, where on the layers."""
    tap, emitted = run().taps.geometry[k], run().emitted[k]
    row = 0
    for number, r in enumerate(run().shot[k]):
        for expected in listings.emits(r, last=k == PASSES - 1):
            found = emitted[row]
            assert tap.invocation[row] == number == tap.vertices[row, 0]
            assert (found[14], found[15], found[11]) == (expected.state, expected.type, expected.index)
            assert (found[[0, 1, 3]] == r[[0, 1, 3]]).all() and found[2] == expected.weight
            assert np.abs(found[4:7] - expected.origin).max() <= NEAR
            assert np.abs(found[8:11] - expected.direction).max() <= NEAR
            assert found[7] == pytest.approx(expected.t, abs=2 * NEAR)
            assert (found[12:14] == (r[12:14] if expected.state == 3 else 0)).all()
            node, _ = listings.decoded(expected.type)
            y = 1 - ((1 - float(r[1])) + 2 * node) / LAYERS
            assert tap.position[row] == pytest.approx([r[0], y, 0, 1], abs=1e-6)
            row += 1
    assert row == len(emitted) > 0


@pytest.mark.parametrize("k", range(PASSES))
def test_stream_output_captures_what_was_emitted(k: int) -> None:
    tap = run().taps.stream_output[k]
    assert tap.first_row == 0 and (records(tap.records) == run().emitted[k]).all()
    assert (tap.primitives == np.arange(len(run().emitted[k]))).all()
    occupancy = run().trace.generations[k].occupancy
    assert occupancy is not None and occupancy.vertices == len(run().emitted[k])
    assert occupancy.bytes == 64 * len(run().emitted[k])


@pytest.mark.parametrize("k", range(PASSES))
def test_the_fragment_shader_shades(k: int, listings: Listings) -> None:
    """Listing 5: a point is a fragment of its pixel in its layer; what is not ready is discarded."""
    tap, emitted = run().taps.fragment[k], run().emitted[k]
    assert (tap.primitive == np.arange(len(emitted))).all(), "a fragment a point, in buffer order"
    kept = 0
    for i, r in enumerate(emitted):
        node, _ = listings.decoded(int(r[15]))
        assert tap.x[i] == round((float(r[0]) + 1) / 2 * WIDTH - 0.5)
        assert tap.y[i] == node * HEIGHT + round((1 - float(r[1])) / 2 * HEIGHT - 0.5)
        shaded = listings.shades(r)
        assert tap.fate[i] == (fates.DISCARDED if shaded is None else fates.WRITTEN)
        if shaded is not None:
            kept += 1
            for name, expected in zip(("unshadowed", "light0", "light1"), shaded.targets, strict=True):
                assert np.abs(tap.outputs[name][i] - expected).max() <= 4e-6
    counters = run().trace.generations[k].counters
    assert counters["fragment.written"] == kept > 0
    assert counters["fragment.discarded"] == len(emitted) - kept


def test_the_image_is_the_sum_of_the_targets(listings: Listings) -> None:
    """Eq. 1 by hand: shaded points replace or extinguish texels in buffer order; the image is the sum of them all."""
    layers = np.zeros((LAYERS, LIGHTS + 1, HEIGHT, WIDTH, 3))
    layers[0, 0] = listings.background
    for k in range(PASSES):
        tap = run().taps.fragment[k]
        for i, r in enumerate(run().emitted[k]):
            shaded = listings.shades(r)
            node, row = divmod(int(tap.y[i]), HEIGHT)
            for target, rgba in enumerate(shaded.targets if shaded is not None else ()):
                texel = layers[node, target, row, tap.x[i]]
                texel[:] = rgba[:3] + rgba[3] * texel
    image = run().trace.image
    assert image is not None and np.abs(layers.sum(axis=(0, 1)) - image).max() <= 4e-6


def test_counts_of_each_pass() -> None:
    """Everything that a draw counts, from the records it read and made."""
    triangles = len(cornell())
    for k, generation in enumerate(run().trace.generations):
        before, shot, emitted = run().drawn[k], run().shot[k], run().emitted[k]
        count = generation.counters
        assert count["draw.calls"] == 1
        assert (
            count["vertex.invocations"] == count["geometry.invocations"] == count["assembly.primitives"] == len(before)
        )
        assert count["geometry.vertices_out"] == count["stream_output.primitives"] == len(emitted)
        assert count["stream_output.overflowed"] == 0 and count["raster.drawn"] == len(emitted)
        assert count["geometry.in_finished"] == int((before[:, 14] == 3).sum())
        live = shot[shot[:, 14] == 1]
        shadow = live[:, 15] > 0
        stopped = np.where(live[:, 11] >= 0, live[:, 11] + 1, triangles)  # any hit, in file order
        # A ray that the box turns away meets nothing (`test_the_vertex_shader_intersects`) and costs no test
        turned_away = generation.per_ray["box_rejections"][generation.alive] == 1
        assert (live[turned_away, 11] == -1).all()
        tests = np.where(turned_away, 0, np.where(shadow, stopped, triangles))
        assert count["intersection.triangle_tests"] == int(tests.sum())
        assert (generation.per_ray["triangle_tests"][generation.alive] == tests).all()
        assert count["rays.shadow"] == int(shadow.sum()) == count["geometry.in_shadow"]


def test_taps_change_nothing() -> None:
    plain = traced(cornell(), cornell_rays(WIDTH, HEIGHT), passes=PASSES)
    tapped = run().trace
    assert plain.image is not None and tapped.image is not None
    assert plain.image.tobytes() == tapped.image.tobytes() and dict(plain.counters) == dict(tapped.counters)
    for a, b in zip(plain.generations, tapped.generations, strict=True):
        for column in ("alive", "kind", "pixel", "parent", "node", "light", "weight"):
            assert getattr(a, column).tobytes() == getattr(b, column).tobytes()
        assert a.rays.origin.tobytes() == b.rays.origin.tobytes() and a.hits.t.tobytes() == b.hits.t.tobytes()
