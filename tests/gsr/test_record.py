"""The ray as a vertex: 64 bytes, a type for every ray of the tree, and how many of them a buffer must hold.

Plan
- `PackedHit` is Listing 2: four vectors at offsets 0, 16, 32, 48, read as bytes with `struct` from a buffer that a run
  captured.
- Types tell node, kind and light apart, all of them at once, for any number of lights and both branchings; on the
  listings' tree they are 0, 1 and −1. All types of a tree are whole numbers that float32 holds.
- S_VB: 48 MiB at 512², a light, two passes; a table by hand over P, L and branching; against a count of the tree's rays
  one by one.
"""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim import Rays
from refsim.counters import Counters
from refsim.methods import METHODS
from refsim.options import checked
from refsim.papers.geometry_shader_rays import record
from refsim.papers.geometry_shader_rays.record import PackedHit
from refsim.papers.geometry_shader_rays.setup import options_of, prepared
from refsim.papers.geometry_shader_rays.tracer import GeometryShaderTracer, Setting
from refsim.pipeline.vertex_buffer import record_type
from refsim.results import RayKind
from tests.gsr.scenes import court, court_rays


def tracer_of(passes: int, rays: Rays) -> GeometryShaderTracer:
    """A tracer of the court, with nothing drawn yet."""
    scene, given = court(), {"passes": passes, "acceleration": "naive"}
    options = checked("geometry_shader", METHODS["geometry_shader"].options, given)
    shared = options_of(scene, options)
    assert rays.width is not None and rays.height is not None
    return GeometryShaderTracer(prepared(scene, rays, options, shared), rays.width, rays.height, shared, Setting())


def test_listing_2() -> None:
    assert PackedHit._fields == ("pos", "orig_t", "dir_idx", "uv_state")
    kind = record_type(PackedHit)
    assert kind.itemsize == 64 == record.RECORD_BYTES and kind.fields is not None
    assert [kind.fields[name][1] for name in PackedHit._fields] == [0, 16, 32, 48]
    assert all(kind.fields[name][0] == np.dtype(("<f4", (4,))) for name in PackedHit._fields)


def test_a_captured_ray_as_bytes() -> None:
    """Pixel 2 of the court: the eye ray meets the wall at (2, 1.25, −8), t = 1.25; then its shadow ray, then the
    reflected one."""
    tracer = tracer_of(2, court_rays([2]))
    tracer.draw_passes(court_rays([2]), Counters())
    # Two passes: the first captured into buffer 1, the second into buffer 0
    first, last = (tracer.buffers[k].records().tobytes() for k in (1, 0))
    assert len(first) == 3 * 64
    eye, shadow, reflected = struct.iter_unpack("<16f", first)
    epsilon = float(court().epsilon)
    near = pytest.approx
    assert eye[:4] == (0, 0, 1, 1) and eye[4:8] == near((2, 2, -7, 1.25), abs=1e-6)
    assert eye[8:11] == near((0, -0.6, -0.8), abs=1e-7) and eye[11] in (4, 5) and eye[14:] == (3, 0)
    assert shadow[:4] == (0, 0, 1, 1) and shadow[4:7] == near((2, 1.25, -8 + epsilon), abs=1e-6)
    to_light = np.array((4.0, 8.0, 0.0)) - np.array((2, 1.25, -8 + epsilon))
    distance = float(np.linalg.norm(to_light))
    assert shadow[7] == near(distance, rel=1e-6) and shadow[8:11] == near(to_light / distance, abs=1e-6)
    assert shadow[11:] == (-1, 0, 0, 1, 1)
    assert reflected[:4] == (0, 0, 0.5, 1) and reflected[4:7] == near((2, 1.25, -8 + epsilon), abs=1e-6)
    assert reflected[7] == np.inf and reflected[8:11] == near((0, -0.6, 0.8), abs=1e-6)
    assert reflected[11:] == (-1, 0, 0, 1, -1)
    # The last pass: the shadow ray missed, the reflected ray met the floor, and nothing new is emitted
    (passed,) = struct.iter_unpack("<16f", last)
    assert passed[11] in (0, 1) and passed[14:] == (3, -1) and passed[4:7] == reflected[4:7]


@given(st.integers(0, 7), st.sampled_from([1, 2]), st.integers(1, 12))
def test_types_name_every_ray_of_a_tree_once(lights: int, branching: int, passes: int) -> None:
    nodes = record.node_count(passes, branching)
    surfaces = [(-n, n, None) for n in range(nodes)]
    shadows = [(1 + light + lights * n, n, light) for n in range(nodes) for light in range(lights)]
    types = np.array([code for code, _, _ in surfaces + shadows], np.float32)
    assert len(np.unique(types)) == len(surfaces) + len(shadows), "no two rays share a type"
    assert (record.nodes_of(types, lights) == [n for _, n, _ in surfaces + shadows]).all()
    kinds = record.kinds_of(types, branching)
    for kind, (_, n, light) in zip(kinds, surfaces + shadows, strict=True):
        # The refracted child of a node is its second one, an even number
        second = branching == 2 and n > 0 and n % 2 == 0
        surface = RayKind.EYE if n == 0 else RayKind.REFRACTED if second else RayKind.REFLECTED
        assert kind == (RayKind.SHADOW if light is not None else surface)
    assert (types.astype(np.int64) == [code for code, _, _ in surfaces + shadows]).all()


def test_types_of_the_listings() -> None:
    """Listing 4: 0 eye, 1 shadow, −1 reflected."""
    types = np.array([0, 1, -1], np.float32)
    assert record.kinds_of(types, 1).tolist() == [RayKind.EYE, RayKind.SHADOW, RayKind.REFLECTED]
    assert record.nodes_of(types, 1).tolist() == [0, 0, 1]
    assert (record.TO_BE_MADE, record.TO_BE_SHOT, record.SHADED) == (0, 1, 3)


# P, L, b, whether anything goes on: rays of each depth, and G + G'
TREES = {
    (1, 1, 1, True): ([1], 1),
    (2, 1, 1, True): ([1, 2], 3),
    (2, 1, 1, False): ([1, 1], 2),
    (2, 0, 1, True): ([1, 1], 2),
    (2, 3, 1, True): ([1, 4], 5),
    (3, 1, 1, True): ([1, 2, 2], 4),
    (3, 2, 1, False): ([1, 2, 0], 3),
    (4, 2, 1, True): ([1, 3, 3, 3], 6),
    (2, 1, 2, True): ([1, 3], 4),
    (3, 1, 2, True): ([1, 3, 6], 9),
    (3, 2, 2, True): ([1, 4, 8], 12),
    (4, 3, 2, True): ([1, 5, 10, 20], 30),
    (6, 0, 2, True): ([1, 2, 4, 8, 16, 32], 48),
}


@pytest.mark.parametrize("tree", TREES, ids=str)
def test_rays_of_each_depth(tree: tuple[int, int, int, bool]) -> None:
    rays, both = TREES[tree]
    assert record.rays_of_depth(*tree) == rays
    assert record.buffer_records(7, rays) == 7 * both


def test_figure_4() -> None:
    """512 · 512 · (2 + 1) · 64 bytes = 48 MiB."""
    records = record.buffer_records(512 * 512, record.rays_of_depth(2, 1, 1, True))
    assert records * 64 == 512 * 512 * (2 + 1) * 64 == 48 * 2**20


@given(st.integers(1, 7), st.integers(0, 4), st.sampled_from([1, 2]), st.booleans())
def test_the_tree_counted_ray_by_ray(passes: int, lights: int, branching: int, goes_on: bool) -> None:
    """Every surface ray of a depth sends its rays to the next: what a buffer holds at most is two depths' rays."""
    alive, counts = [0], [1]
    for _ in range(1, passes):
        children = [branching * n + 1 + j for n in alive for j in range(branching)] if goes_on else []
        counts.append(len(children) + lights * len(alive))
        alive = children
    assert record.rays_of_depth(passes, lights, branching, goes_on) == counts
    assert record.buffer_records(1, counts) >= max(a + b for a, b in zip(counts, [*counts[1:], 0], strict=True))


def test_both_buffers_have_room_for_s_vb() -> None:
    tracer = tracer_of(2, court_rays())
    assert [buffer.capacity for buffer in tracer.buffers] == [8 * 3, 8 * 3] == [tracer.needed] * 2
    assert all(buffer.floats.nbytes == 8 * 3 * 64 for buffer in tracer.buffers)
