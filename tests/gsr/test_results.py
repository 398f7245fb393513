"""What a trace says of its rays: kinds, nodes, lights, weights, pixels, parents, counts, picture.

Plan
- Property, on soups and on the box: a child starts epsilon off its parent's hit, in its parent's pixel; its node,
  light, kind and direction are those of one of the rays that the hit sends; its weight is the float32 product along the
  chain. No light is lost: the weights of what a hit sends on add up to ρ + τ of its own.
- Counts: the laws hold, totals are the sums over passes and over rays, by kind too.
- Golden counts of one small run.
- Dead eye rays stay dead and dark rows; rays without an image size make the squarest picture; one pixel; wide and tall.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim import Rays, Scene
from refsim.results import Generation, RayKind, Trace
from tests.gsr.scenes import (
    BACKGROUND,
    GLASS,
    MIRROR,
    SHINY,
    TILES,
    cornell,
    cornell_rays,
    cornell_trace,
    court,
    court_rays,
    soup,
    traced,
    wild,
)

EYE, SHADOW, REFLECTED, REFRACTED = RayKind


def normals(scene: Scene, triangle: np.ndarray) -> np.ndarray:
    corner = scene.triangles[triangle].astype(np.float64)
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return cross / np.linalg.norm(cross, axis=1, keepdims=True)


def assert_children(scene: Scene, before: Generation, after: Generation, branching: int) -> None:
    """Every ray of a pass follows from the hit of its parent in the pass before."""
    columns = (before.node, before.weight, after.node, after.light, after.weight)
    owners = (before, before, after, after, after)
    assert all(column is not None and len(column) == len(g.rays) for column, g in zip(columns, owners, strict=True))
    assert after.alive.all() and (after.rays.t_max > 0).all()
    parent, kind = after.parent, after.kind
    assert ((parent >= 0) & (parent < len(before.rays))).all() and (np.diff(parent) >= 0).all()
    assert (before.hits.triangle[parent] >= 0).all() and (before.kind[parent] != SHADOW).all()
    assert (after.pixel == before.pixel[parent]).all()

    o, d = before.rays.origin[parent].astype(np.float64), before.rays.direction[parent].astype(np.float64)
    point = o + d * before.hits.t[parent, None].astype(np.float64)
    n = normals(scene, before.hits.triangle[parent])
    offset, new = after.rays.origin - point, after.rays.direction.astype(np.float64)
    size = np.abs(point).max() + float(before.hits.t[parent].max()) if len(parent) else 1.0
    bound = 2.0**-22 * size
    side = np.sign((offset * n).sum(axis=1))
    assert (np.abs(offset - (side * float(scene.epsilon))[:, None] * n).max(axis=1) <= bound).all()
    clear = np.abs((new * n).sum(axis=1)) > 1e-5
    light_side = np.array([light.position for light in scene.lights])[np.maximum(after.light, 0)] - point
    towards = np.where((kind == SHADOW)[:, None], light_side, new)
    assert (np.sign((towards * n).sum(axis=1)) == side)[clear].all(), "on the side that it travels to"

    shadow = kind == SHADOW
    assert (after.node[shadow] == before.node[parent[shadow]]).all() and (after.light[~shadow] == -1).all()
    assert (after.weight[shadow] == before.weight[parent[shadow]]).all()
    assert np.isinf(after.rays.t_max[~shadow]).all() and (after.node[~shadow] > 0).all()
    second = np.where(kind == REFRACTED, 2, 1)
    assert (after.node[~shadow] == (branching * before.node[parent] + second)[~shadow]).all()
    to = np.array([light.position for light in scene.lights])[after.light[shadow]] - after.rays.origin[shadow]
    distance = np.linalg.norm(to, axis=1)
    assert (np.abs(after.rays.t_max[shadow] - distance) <= 4e-7 * distance).all()
    assert (np.abs(new[shadow] - to / distance[:, None]) <= 4e-7).all()
    mirrored = d - 2 * (d * n).sum(axis=1, keepdims=True) * n
    assert (np.abs(new - mirrored)[kind == REFLECTED] <= 2e-6).all()
    # Refraction leaves through the surface, and sines are in the ratio of the indices
    through = kind == REFRACTED
    assert ((new * n).sum(axis=1) * (d * n).sum(axis=1) >= 0)[through].all()
    eta = np.where((d * n).sum(axis=1) < 0, 1 / 1.5, 1.5)
    assert (np.abs(np.cross(n, new) - eta[:, None] * np.cross(n, d))[through] <= 2e-6).all()


def assert_weights(scene: Scene, before: Generation, after: Generation) -> None:
    """ρ and τ in float32, and both together where all light is reflected."""
    assert before.weight is not None and after.weight is not None
    rho, tau = (np.array([getattr(m, name) for m in scene.materials], np.float32) for name in ("rho", "tau"))
    material = scene.material_ids[before.hits.triangle[after.parent]]
    refracted = after.kind == REFRACTED
    splits = np.zeros(len(before.rays), bool)
    splits[after.parent[refracted]] = True
    split = splits[after.parent]
    whole = rho[material] + np.where(split, np.float32(0), tau[material])
    share = np.where(refracted, tau[material], np.where(after.kind == SHADOW, np.float32(1), whole))
    assert (after.weight == before.weight[after.parent] * share).all()
    surface = after.kind != SHADOW
    sent = np.bincount(after.parent[surface], after.weight[surface], len(before.rays))
    hit = np.flatnonzero((before.kind != SHADOW) & (before.hits.triangle >= 0))
    kept = (rho + tau)[scene.material_ids[before.hits.triangle[hit]]] * before.weight[hit]
    assert np.abs(sent[hit] - kept).max(initial=0) <= 2e-7


def assert_sound(trace: Trace, branching: int) -> None:
    first = trace.generations[0]
    assert (first.kind == EYE).all() and (first.parent == -1).all()
    assert first.node is not None and first.light is not None and first.weight is not None
    assert (first.node == 0).all() and (first.light == -1).all() and (first.weight == 1).all()
    assert (first.pixel == np.arange(len(first.rays))).all()
    for before, after in zip(trace.generations, trace.generations[1:], strict=False):
        assert_children(trace.scene, before, after, branching)
        assert_weights(trace.scene, before, after)
    assert_counts(trace)


def assert_counts(trace: Trace) -> None:
    names = {"cells": "traversal.cells", "triangle_tests": "intersection.triangle_tests",
             "box_rejections": "traversal.box_rejections"}  # fmt: skip
    pixels = len(trace.generations[0].rays)
    for generation in trace.generations:
        counters = generation.counters
        counters.check()
        assert counters["geometry.in_finished"] + int(generation.alive.sum()) == counters["geometry.invocations"]
        for kind in RayKind:
            name = kind.name.lower()
            shot = int((generation.alive & (generation.kind == kind)).sum())
            assert shot == counters[f"rays.{name}"] == counters[f"geometry.in_{name}"]
            hit = int(((generation.kind == kind) & (generation.hits.triangle >= 0)).sum())
            lost = shot - hit if kind in (REFLECTED, REFRACTED) else 0
            assert counters[f"geometry.passed_{name}"] == hit + lost
        for name, counter in names.items():
            assert generation.per_ray[name].sum() == counters[counter]
    for before, after in zip(trace.generations, trace.generations[1:], strict=False):
        for kind in ("shadow", "reflected", "refracted"):
            assert before.counters[f"geometry.spawned_{kind}"] == after.counters[f"rays.{kind}"]
        passed = [before.counters[f"geometry.passed_{kind.name.lower()}"] for kind in RayKind]
        assert sum(passed) == after.counters["geometry.in_finished"]
    for name in names:
        summed = np.zeros(pixels, np.int64)
        for generation in trace.generations:
            np.add.at(summed, generation.pixel, generation.per_ray[name])
        assert (trace.per_ray[name] == summed).all()
    for name in trace.counters:
        if name.split(".")[0] in ("geometry", "stream_output", "rays", "traversal", "intersection"):
            expected = sum(generation.counters[name] for generation in trace.generations)
            assert (
                trace.counters[name] == expected + (name == "intersection.degenerate_triangles") * trace.counters[name]
            )
    trace.counters.check()


def test_the_box() -> None:
    assert_sound(cornell_trace(), 2)
    kinds = [set(generation.kind.tolist()) for generation in cornell_trace().generations]
    assert kinds == [
        {EYE},
        {SHADOW, REFLECTED, REFRACTED},
        {SHADOW, REFLECTED, REFRACTED},
        {SHADOW, REFLECTED, REFRACTED},
    ]


@settings(max_examples=30)
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(1, 12),
    glass=st.booleans(),
    lights=st.integers(1, 2),
)
def test_soups(seed: int, count: int, glass: bool, lights: int) -> None:
    palette = (GLASS, SHINY, MIRROR) if glass else (TILES, SHINY, MIRROR)
    scene = soup(seed, count, palette, lights)
    refracts = any(scene.materials[k].kind == "glass" for k in scene.material_ids)
    assert_sound(traced(scene, wild(6, 5, seed), passes=4), 2 if refracts else 1)


# A pass each: cornell_box, its light and a second one, 14 × 11, four passes
GOLDEN = {
    "rays.eye": [154, 0, 0, 0],
    "rays.shadow": [0, 298, 60, 52],
    "rays.reflected": [0, 32, 17, 17],
    "rays.refracted": [0, 14, 10, 8],
    "geometry.invocations": [154, 493, 166, 135],
    "geometry.in_finished": [0, 149, 79, 58],
    "stream_output.primitives": [493, 166, 135, 57],
    "fragment.written": [149, 79, 58, 57],
    "fragment.discarded": [344, 87, 77, 0],
}


def test_golden_counts() -> None:
    generations = cornell_trace().generations
    assert {name: [g.counters[name] for g in generations] for name in GOLDEN} == GOLDEN
    # Tests, and the 36 of each ray that the box turned away
    counts = [(g.counters["intersection.triangle_tests"], g.counters["traversal.box_rejections"]) for g in generations]
    assert [tests + 36 * spared for tests, spared in counts] == [5544, 11927, 2936, 2548]


def test_dead_eye_rays() -> None:
    """They are in the buffer, end in the geometry shader, and their pixels keep the background."""
    rays, scene = wild(7, 5, 3, dead=0.4), soup(3, 9, (SHINY, MIRROR))
    dead = ~rays.alive
    assert 0 < dead.sum() < len(rays)
    trace = traced(scene, rays, passes=3)
    whole = traced(scene, wild(7, 5, 3), passes=3)
    first = trace.generations[0]
    assert (first.alive == ~dead).all() and (first.hits.triangle[dead] == -1).all()
    assert first.counters["geometry.in_finished"] == dead.sum() and first.counters["rays.eye"] == (~dead).sum()
    assert all((counts[dead] == 0).all() for counts in trace.per_ray.values())
    assert trace.image is not None and whole.image is not None
    assert (trace.image.reshape(-1, 3)[dead] == np.float32(BACKGROUND)).all()
    assert (trace.image.reshape(-1, 3)[~dead] == whole.image.reshape(-1, 3)[~dead]).all()
    nobody = traced(scene, Rays(rays.origin, np.zeros((35, 3)), 0.0, 7, 5), passes=3)
    assert [len(g.rays) for g in nobody.generations] == [35, 0, 0] and (nobody.image == np.float32(BACKGROUND)).all()


def test_bounded_eye_rays() -> None:
    """Nothing at or beyond t_max is hit; the pixel keeps the background."""
    free = traced(court(), court_rays([0, 1]), passes=1)
    t = free.generations[0].hits.t
    for factor, hits in ((1.0, False), (1.01, True)):
        rays = Rays(court_rays([0, 1]).origin, court_rays([0, 1]).direction, t * np.float32(factor), 2, 1)
        trace = traced(court(), rays, passes=1)
        assert ((trace.generations[0].hits.triangle >= 0) == hits).all()
        assert trace.image is not None and ((trace.image == np.float32(BACKGROUND)).all(axis=2) != hits).all()


@pytest.mark.parametrize(("count", "shape"), [(1, (1, 1)), (2, (1, 2)), (5, (2, 3)), (9, (3, 3)), (10, (3, 4))])
def test_rays_without_an_image(count: int, shape: tuple[int, int]) -> None:
    """The squarest picture that holds them; pixels beyond the last ray keep the background."""
    scene, rays = soup(8, 9, (SHINY, TILES)), wild(5, 2, 8)
    loose = Rays(rays.origin[:count], rays.direction[:count], rays.t_max[:count])
    trace, whole = traced(scene, loose, passes=3), traced(scene, rays, passes=3)
    assert trace.image is not None and whole.image is not None and trace.image.shape == (*shape, 3)
    flat = trace.image.reshape(-1, 3)
    assert (flat[:count] == whole.image.reshape(-1, 3)[:count]).all() and (flat[count:] == np.float32(BACKGROUND)).all()
    assert trace.generations[1].pixel.max(initial=0) < count


@pytest.mark.parametrize(("width", "height"), [(1, 1), (17, 1), (1, 17), (13, 3), (3, 13), (31, 2)])
def test_any_shape_of_picture(width: int, height: int) -> None:
    """A pixel does not know its neighbours: the same rays in another shape give the same colours."""
    scene, n = soup(11, 10, (GLASS, SHINY)), width * height
    rays = wild(width, height, 12)
    square = Rays(rays.origin, rays.direction, rays.t_max, n, 1)
    a, b = traced(scene, rays, passes=3), traced(scene, square, passes=3)
    assert a.image is not None and b.image is not None and a.image.shape == (height, width, 3)
    assert a.image.tobytes() == b.image.tobytes()
    assert all((x.pixel == y.pixel).all() for x, y in zip(a.generations, b.generations, strict=True))


@pytest.mark.parametrize(("width", "height"), [(1501, 2), (2, 1501)])
def test_a_large_picture_keeps_its_pixels(width: int, height: int) -> None:
    """Pixel centres survive NDC: every 40th ray lives, its point stays in its pixel, all others keep the background."""
    n = width * height
    live = np.arange(n) % 40 == 7
    direction = np.where(live[:, None], [[0.0, -1.0, 0.0]], 0.0)
    rays = Rays(np.tile([[2.0, 2.0, 0.0]], (n, 1)), direction, np.where(live, np.inf, 0.0), width, height)
    trace = traced(court(), rays)
    assert (trace.generations[0].pixel == np.arange(n)).all()
    assert (trace.generations[1].pixel == np.flatnonzero(live)).all()
    assert trace.image is not None
    colors = trace.image.reshape(-1, 3)
    assert (colors[live] == colors[7]).all() and colors[7, 0] > 0.5 and (colors[~live] == np.float32(BACKGROUND)).all()


def test_the_last_ray_of_each_pixel() -> None:
    """`exit_rays`: the surface ray of the pixel that was shot last."""
    trace = cornell_trace()
    direction = trace.generations[0].rays.direction.copy()
    for generation in trace.generations[1:]:
        for row in np.flatnonzero(generation.kind != SHADOW):
            direction[generation.pixel[row]] = generation.rays.direction[row]
    assert (trace.exit_rays.direction == direction).all()
    assert len(trace.exit_rays) == len(cornell_rays()) and trace.scene is cornell()
