"""What rays visit: the order of elements, ray by ray, and where in memory they lie.

Plan
- Random meshes, lists, orders, heads, layers, any hit, facing: as many elements a ray as the search counts; each is its
  list's head, or the one after, or where the escape of the one before leads; triangles as many as were tested.
- Rays that hit nothing, so that spheres alone decide: the pseudo-code in plain Python.
- Pieces of any size put together are the whole; threads change nothing; rows left out or empty visit nothing.
- Elements by layer, list and place; textures one after another, aligned, vertices of layers counted through.
- A loop that counts otherwise is refused.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.counters import ConservationError
from refsim.errors import InputError
from refsim.papers.sphere_hierarchy import traversal
from refsim.papers.sphere_hierarchy.hierarchy import build_hierarchy
from refsim.papers.sphere_hierarchy.lists import TraversalLists, build_lists
from refsim.papers.sphere_hierarchy.search import search
from refsim.papers.sphere_hierarchy.visits import ALIGNMENT, Layout, Recorder, Shot, list_and_place
from refsim.scene import Rays, Scene
from tests.bsh.meshes import meshes, rays_at

SEEDS = st.integers(0, 2**16)


def layers_of(triangles: np.ndarray, lists: int, order: str = "earliest_first", cut: int = 0) -> list[TraversalLists]:
    """The lists of a mesh, or of its first `cut` triangles and the others."""
    parts = [triangles] if not 0 < cut < len(triangles) else [triangles[:cut], triangles[cut:]]
    return [build_lists(build_hierarchy(Scene(np.ascontiguousarray(part))), lists, order) for part in parts]


@st.composite
def shots(draw: st.DrawFn, most: int = 16, rays: int = 24) -> Shot:
    """Any search of a few rays."""
    triangles = draw(meshes(most))
    seed = draw(SEEDS)
    order = draw(st.sampled_from(("earliest_first", "latest_last")))
    layers = layers_of(triangles, draw(st.sampled_from((1, 2, 6, 8))), order, draw(st.integers(0, 3)))
    starts = None
    if draw(st.booleans()):
        rng = np.random.default_rng(seed)
        starts = [rng.integers(0, 4, rays).astype(np.int32) for _ in layers]
    facing = draw(st.sampled_from(("both", "front")))
    return Shot(layers, rays_at(triangles, rays, seed), starts, draw(st.booleans()), facing)


def everything(shot: Shot) -> Any:
    return Recorder(shot, 1).visits(np.arange(len(shot.rays), dtype=np.int32))


@settings(max_examples=60)
@given(shots())
def test_each_step_is_to_the_next_element_or_along_the_escape(shot: Shot) -> None:
    found = search(shot.layers, shot.rays, starts=shot.starts, any_hit=shot.any_hit, facing=shot.facing, threads=1)
    visits = everything(shot)
    assert np.array_equal(np.diff(visits.offsets), found.nodes)
    assert visits.offsets[0] == 0 and visits.offsets[-1] == len(visits.elements)
    layer, number, place = list_and_place(shot.layers, visits.elements)
    edges = np.cumsum([0, *(len(lists.escape) for lists in shot.layers)])
    for ray in range(len(shot.rays)):
        tested, last = 0, -1
        for k, lists in enumerate(shot.layers):
            part = np.arange(visits.offsets[ray], visits.offsets[ray + 1])
            part = part[layer[part] == k]
            if not len(part):
                continue
            assert len(set(number[part].tolist())) == 1
            assert part[0] > last
            last = part[-1]
            escape = lists.escape[lists.first[number[part[0]]] :]
            assert place[part[0]] == (0 if shot.starts is None else shot.starts[k][ray])
            for one, other in zip(place[part[:-1]], place[part[1:]], strict=True):
                assert other == one + 1 or (escape[one] > 0 and other == one + escape[one])
            assert np.array_equal(visits.elements[part] - edges[k], lists.first[number[part]] + place[part])
            tested += int(np.isin(escape[place[part]], (0, 1)).sum())
            # A walk ends at an element whose escape leads nowhere, or at a triangle that any-hit search hit
            end = escape[place[part[-1]]]
            assert end <= 0 or place[part[-1]] + end == lists.length(number[part[0]]) or shot.any_hit
        assert tested == found.triangle_tests[ray]


def scalar_misses(o: Any, d: Any, slack: Any, best: Any, sphere: Any) -> bool:
    """The sphere test in float32 NumPy scalars, as `traversal` words it."""
    square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    x, y, z = (sphere[k] - o[k] for k in range(3))
    k = x * (d[0] / square) + y * (d[1] / square) + z * (d[2] / square)
    k = max(min(k, best), np.float32(0))
    x, y, z = x - k * d[0], y - k * d[1], z - k * d[2]
    return bool(x * x + y * y + z * z > (sphere[3] + slack) * (sphere[3] + slack))


@given(meshes(12, kinds=("soup", "grid", "nested"), scaled=False), SEEDS, st.sampled_from((1, 2, 6, 8)))
@settings(max_examples=20)
def test_rays_that_hit_nothing_visit_what_plain_python_visits(triangles: np.ndarray, seed: int, lists: int) -> None:
    """Spheres alone decide there, so the walk needs no triangle test; t_max bounds the segment."""
    layer = layers_of(triangles, lists)
    shot = Shot(layer, rays_at(triangles, 24, seed))
    found, visits = search(layer, shot.rays, threads=1), everything(shot)
    picked = Recorder(shot, 1).picked[0]
    root, rays = layer[0].hierarchy.spheres[0], shot.rays
    with np.errstate(all="ignore"):
        for ray in np.flatnonzero(~found.hits.hit):
            o, d, best = rays.origin[ray], rays.direction[ray], rays.t_max[ray]
            away = root[:3] - o
            reach = np.sqrt(away[0] * away[0] + away[1] * away[1] + away[2] * away[2]) + root[3]
            slack = max(traversal.KAPPA * reach, traversal.SMALLEST)
            slack = slack if reach < traversal.LARGEST else np.float32(np.inf)
            at, end, walked = layer[0].first[picked[ray]], layer[0].first[picked[ray] + 1], []
            while at < end:
                walked.append(int(at))
                step = int(layer[0].escape[at])
                if step not in (0, 1) and not scalar_misses(o, d, slack, best, layer[0].spheres[at]):
                    step = 1
                at = at + step if step > 0 else end
            assert walked == visits.elements[visits.offsets[ray] : visits.offsets[ray + 1]].tolist()


@settings(max_examples=20)
@given(shots(), st.integers(1, 60), st.integers(1, 9), SEEDS)
def test_pieces_are_the_whole(shot: Shot, most: int, lanes: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = rng.permutation(len(shot.rays)).astype(np.int32)[: 9 * 2]
    rows[rng.random(len(rows)) < 0.2] = -1
    order = rows[: len(rows) // lanes * lanes].reshape(-1, lanes)
    recorder = Recorder(shot, 1)
    whole = recorder.visits(order)
    pieces = list(recorder.chunks(order, most))
    assert [row for piece in pieces for row in piece.rows] == order.ravel().tolist()
    assert [element for piece in pieces for element in piece.elements] == whole.elements.tolist()
    assert all(len(piece.rows) % lanes == 0 for piece in pieces)
    assert all(len(piece.elements) <= most or len(piece.rows) == lanes for piece in pieces)
    counts = np.diff(whole.offsets)
    assert np.array_equal(counts, np.where(whole.rows < 0, 0, recorder.nodes[whole.rows]))
    other = Recorder(shot, 3).visits(order)
    assert all(np.array_equal(a, b) for a, b in zip(other, whole, strict=True))


def test_a_piece_must_have_room() -> None:
    triangles = np.eye(3, dtype=np.float32)[None]
    recorder = Recorder(Shot(layers_of(triangles, 1), rays_at(triangles, 4, 1)), 1)
    with pytest.raises(InputError, match="cannot hold any"):
        list(recorder.chunks(np.zeros((1, 1), np.int32), 0))


def test_two_triangles_by_hand() -> None:
    """One list of a root and two triangles along x: a ray that hits the first still meets the second's test."""
    square = np.array([[0, -1, -1], [0, 1, -1], [0, 0, 1]], np.float32)
    triangles = np.stack([square, square + np.float32([4, 0, 0])])
    layers = layers_of(triangles, 1)
    assert layers[0].escape.tolist() == [-1, 1, 0]
    rays = Rays(np.array([[-1, 0, 0], [-1, 9, 0], [0, 0, 0]]), np.array([[1, 0, 0], [1, 0, 0], [0, 0, 0]]))
    assert everything(Shot(layers, rays)).elements.tolist() == [0, 1, 2, 0]
    assert everything(Shot(layers, rays)).offsets.tolist() == [0, 3, 4, 4]
    assert everything(Shot(layers, rays, any_hit=True)).elements.tolist() == [0, 1, 0]
    # The same triangles as two layers: numbers go on, and a search for any hit leaves the second out
    two = layers_of(triangles, 1, cut=1)
    assert everything(Shot(two, rays)).elements.tolist() == [0, 1, 2, 0, 2]
    assert everything(Shot(two, rays, any_hit=True)).elements.tolist() == [0, 1, 0, 2]
    layer, number, place = list_and_place(two, np.arange(4, dtype=np.int32))
    assert (layer.tolist(), number.tolist(), place.tolist()) == ([0, 0, 1, 1], [0] * 4, [0, 1, 0, 1])


@given(meshes(20), st.sampled_from((1, 6)), st.integers(0, 8))
@settings(max_examples=20)
def test_textures_lie_one_after_another(triangles: np.ndarray, lists: int, cut: int) -> None:
    layers = layers_of(triangles, lists, cut=cut)
    layout = Layout.of(layers)
    elements = sum(len(part.escape) for part in layers)
    vertices = np.concatenate([part.vertices.positions for part in layers])
    assert layout.bases[0] == 0 and not (layout.bases % ALIGNMENT).any()
    assert 4 * elements <= layout.bases[1] < 4 * elements + ALIGNMENT
    assert 16 * elements <= layout.bases[2] - layout.bases[1] < 16 * elements + ALIGNMENT
    assert layout.size == layout.bases[2] + 16 * len(vertices)
    begin = 0
    for part in layers:
        own = slice(begin, begin + len(part.escape))
        assert np.array_equal(layout.escape[own], part.escape)
        tests = np.isin(part.escape, (0, 1))
        assert np.array_equal(layout.payload[own][~tests], part.payload[~tests])
        rows = part.payload[tests, 3]
        assert np.array_equal(vertices[layout.payload[own][tests, :3]], part.hierarchy.triangles[rows])
        begin += len(part.escape)


def test_a_loop_that_counts_otherwise_is_refused() -> None:
    triangles = np.stack([np.eye(3, dtype=np.float32) + np.float32(k) for k in range(6)])
    recorder = Recorder(Shot(layers_of(triangles, 1), rays_at(triangles, 8, 3)), 1)
    recorder.nodes[int(np.argmax(recorder.nodes))] += 1
    with pytest.raises(ConservationError, match="other elements"):
        recorder.visits(np.arange(8, dtype=np.int32))
