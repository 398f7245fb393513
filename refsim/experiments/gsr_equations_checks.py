"""Checks of the listings of Recursive Ray Tracing in Geometry Shader, on the rays of one small picture.

The compiled tracer is held against the NumPy tracer (`refsim.reference`, which knows no errata) bit for bit: hits
(Listing 3), rays that the geometry shader emits (Listing 4), pixels (Listing 5 and Eq. 1). What an item must do is
checked on the compiled run with that erratum as printed, and on the corrected one. The scene is the Cornell box with a
mirror and a block of glass, from outside, so that the background shows; three passes, one light, float targets.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.experiments import gsr_published
from refsim.experiments.equations import Found, bits_differ, number
from refsim.experiments.gsr_runs import GEOMETRY_SHADER, rays_of, scene_of
from refsim.methods import trace
from refsim.papers.geometry_shader_rays import record
from refsim.results import Generation, RayKind, Trace

VIEW, PASSES = "cornell box from afar", 3
BACKGROUND = (0.5, 0.5, 0.5)
BLACK = (0.0, 0.0, 0.0)
ROUNDING = 1e-5  # float32 sums of a dozen numbers up to 1
Mask = NDArray[np.bool_]


@lru_cache(maxsize=64)
def run(size: int, errata: str = "corrected", backend: str = "numba", passes: int = PASSES,
        background: tuple[float, float, float] = BACKGROUND, shadows: bool = True, acceleration: str = "grid",
        ) -> Trace:  # fmt: skip
    """The picture's trace; rays and options the same for all items."""
    options: dict[str, Any] = {"passes": passes, "background": background, "shadows": shadows,
                               "acceleration": acceleration}  # fmt: skip
    if backend == "numba":
        options["errata"] = errata
    return trace(GEOMETRY_SHADER, scene_of(VIEW), rays_of(VIEW, size), backend=backend, **options)


def image(*arguments: Any, **options: Any) -> NDArray[np.float32]:
    """RGB of every pixel, f32[n, 3]."""
    found = run(*arguments, **options).image
    assert found is not None
    return found.reshape(-1, 3)


def hits_differ(size: int) -> int:
    """Rays whose hit differs between the compiled tracer and the NumPy one."""
    return _differ(size, lambda g: (g.hits.triangle, g.hits.t, g.hits.u, g.hits.v))


def rays_differ(size: int) -> int:
    """Emitted rays that differ: where they start and go, what they are, what they weigh, how far they look."""
    return _differ(size, lambda g: (g.rays.origin, g.rays.direction, g.rays.t_max, g.kind, g.pixel, g.weight))


def _differ(size: int, parts: Any) -> int:
    total = 0
    for a, b in zip(run(size).generations, run(size, backend="numpy").generations, strict=True):
        if len(a.rays) != len(b.rays):
            total += max(len(a.rays), len(b.rays))
            continue
        off = np.zeros(len(a.rays), np.bool_)
        for ours, theirs in zip(parts(a), parts(b), strict=True):
            off |= bits_differ(ours, theirs)
        total += number(off)
    return total


def pixels_differ(size: int) -> int:
    """Pixels that differ between the two."""
    return number(bits_differ(image(size), image(size, backend="numpy")))


def rays_shot(size: int) -> int:
    """Rays of all generations."""
    return sum(number(g.alive) for g in run(size).generations)


def of_kind(g: Generation, *kinds: RayKind) -> Mask:
    """Rays of these kinds that were shot."""
    return np.isin(g.kind, [int(kind) for kind in kinds]) & g.alive


def pixels_of(g: Generation, rays: Mask, count: int) -> Mask:
    """Which pixels some of these rays belong to."""
    found = np.zeros(count, np.bool_)
    found[g.pixel[rays]] = True
    return found


def both(check: Any, name: str) -> tuple[int, int]:
    """What fails as printed and as corrected."""
    return check(f"GSR-{name}"), check("corrected")


def buffer_size(size: int) -> Found:
    """S_VB: 48 MiB, and never less than two depths' rays hold."""
    said = gsr_published.buffer_bytes() != gsr_published.SAID_BUFFER_MBYTES * 2**20
    rays = record.rays_of_depth(2, 1, 1, True)
    ours = record.buffer_records(gsr_published.SIDE**2, rays) * record.RECORD_BYTES
    found = run(size).generations
    occupied = [g.occupancy for g in found if g.occupancy is not None]
    full = number([o.vertices > o.capacity for o in occupied])
    return Found(1 + len(occupied), printed_fails=int(said) + full, corrected_fails=int(ours != 48 * 2**20) + full)


def record_layout(size: int) -> Found:
    """Listings 1 and 2: 64 bytes, and what is packed is unpacked again."""
    from refsim.pipeline.vertex_buffer import record_type

    layout = record_type(record.PackedHit)
    rng = np.random.default_rng(51)
    count = size * size
    raw = rng.normal(size=(count, 16)).astype(np.float32)
    raw[:, record.INDEX] = rng.integers(-1, record.MOST_TRIANGLES, count)
    raw[:, record.STATE], raw[:, record.TYPE] = rng.integers(0, 4, count), rng.integers(-9, 10, count)
    packed = raw.view(np.uint8).reshape(-1).view(layout)
    wrong = np.full(count, layout.itemsize != record.RECORD_BYTES)
    for name, first in (("pos", 0), ("orig_t", 4), ("dir_idx", 8), ("uv_state", 12)):
        wrong |= bits_differ(np.ascontiguousarray(packed[name].reshape(count, 4)), raw[:, first : first + 4].copy())
    # Whole numbers travel as floats: triangle, state, type
    for column in (record.INDEX, record.STATE, record.TYPE):
        wrong |= raw[:, column].astype(np.int64).astype(np.float32) != raw[:, column]
    return Found(count, corrected_fails=number(wrong))


def types_of_rays(size: int) -> Found:
    """Type and state of Listing 1: 0 eye, 1 shadow, −1 reflected, generalised to any tree."""
    lights, branching, nodes = 3, 2, 15
    codes = [-n for n in range(nodes)] + [1 + light + lights * n for n in range(nodes) for light in range(lights)]
    types = np.array(codes, np.float32)
    kinds, of = record.kinds_of(types, branching), record.nodes_of(types, lights)
    wanted = [*range(nodes), *(n for n in range(nodes) for _ in range(lights))]
    shadow = np.arange(len(codes)) >= nodes
    wrong = (of != wanted) | ((kinds == RayKind.SHADOW) != shadow)
    return Found(len(codes), corrected_fails=number(wrong) + len(codes) - len(set(codes)))


def eye_rays(size: int) -> Found:
    """Listing 3's eye ray: those of the camera."""
    given = rays_of(VIEW, size).direction

    def fails(errata: str) -> int:
        made = run(size, errata).generations[0].rays.direction
        return number(np.abs(made.astype(np.float64) - given).max(axis=1) > ROUNDING)

    return Found(size * size, hits_differ(size), *both(fails, "E12"))


def nearest_hit(size: int) -> Found:
    """Listing 3's search: the nearest hit of every triangle, in the NumPy search without a grid."""
    found, alone = run(size).generations, run(size, backend="numpy", acceleration="naive").generations
    # Any hit before the light will do for a shadow ray, and the order of the tests decides which
    wrong = sum(
        number(np.where(a.kind == RayKind.SHADOW, (a.hits.triangle < 0) != (b.hits.triangle < 0),
                        a.hits.triangle != b.hits.triangle))
        for a, b in zip(found, alone, strict=True)
    )  # fmt: skip
    return Found(rays_shot(size), hits_differ(size), corrected_fails=wrong)


def shadow_search(size: int) -> Found:
    """A shadow ray's search ends at the light, and any hit before it is enough: which rays hit stays the same."""
    def fails(errata: str) -> int:
        total = 0
        for a, b in zip(run(size, errata).generations, run(size).generations, strict=True):
            rays = of_kind(a, RayKind.SHADOW)
            total += number(((a.hits.triangle >= 0) != (b.hits.triangle >= 0)) & rays)
            total += number((a.hits.triangle >= 0) & (a.hits.t > a.rays.t_max) & rays)
        return total

    count = sum(number(of_kind(g, RayKind.SHADOW)) for g in run(size).generations)
    return Found(count, hits_differ(size), *both(fails, "E6"))


def misses(size: int) -> Found:
    """Listing 4: what misses shows the background; so every pixel with such a ray changes with it."""
    def fails(errata: str) -> int:
        changes = (image(size, errata) != image(size, errata, background=BLACK)).any(axis=1)
        see = np.zeros(size * size, np.bool_)
        for g in run(size).generations:
            kinds = of_kind(g, RayKind.EYE, RayKind.REFLECTED, RayKind.REFRACTED)
            see |= pixels_of(g, kinds & (g.hits.triangle < 0), size * size)
        return number(see & ~changes)

    return Found(size * size, rays_differ(size), *both(fails, "E2"))


def passed_through(size: int) -> Found:
    """`emitPassThrough`: a ray that hit is shaded once, in its own pass."""
    def fails(errata: str) -> int:
        first = run(size, errata, passes=1).generations[0]
        return abs(number(first.hits.triangle >= 0) - first.counters["fragment.written"])

    return Found(size * size, rays_differ(size), *both(fails, "E3"))


def spawned(size: int) -> Found:
    """Each hit that is not the last pass's sends a shadow ray, whatever its depth."""
    def fails(errata: str) -> int:
        found, total = run(size, errata).generations, 0
        for before, after in pairwise(found):
            surface = of_kind(before, RayKind.EYE, RayKind.REFLECTED, RayKind.REFRACTED)
            total += abs(number(surface & (before.hits.triangle >= 0)) - number(of_kind(after, RayKind.SHADOW)))
        return total

    return Found(rays_shot(size), rays_differ(size), *both(fails, "E5"))


def offset(size: int) -> Found:
    """A shadow ray starts on the side of the surface that it travels to."""
    scene = scene_of(VIEW)
    corners = scene.triangles.astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])

    def fails(errata: str) -> int:
        found, total = run(size, errata).generations, 0
        for before, after in pairwise(found):
            rays = of_kind(after, RayKind.SHADOW)
            triangle = before.hits.triangle[after.parent[rays]]
            n, corner = normals[triangle], corners[triangle, 0]
            side = ((after.rays.origin[rays] - corner) * n).sum(axis=1)
            towards = (after.rays.direction[rays].astype(np.float64) * n).sum(axis=1)
            total += number((side > 0.0) != (towards > 0.0))
        return total

    count = sum(number(of_kind(g, RayKind.SHADOW)) for g in run(size).generations)
    return Found(count, rays_differ(size), *both(fails, "E11"))


def reflectivity(size: int, name: str) -> Found:
    """A reflected ray weighs as much as its path and the material's ρ, which total reflection adds τ to."""
    scene = scene_of(VIEW)
    rho, tau = (np.array([getattr(m, name) for m in scene.materials], np.float32) for name in ("rho", "tau"))

    def fails(errata: str) -> int:
        found, total = run(size, errata).generations, 0
        for before, after in pairwise(found):
            rays = of_kind(after, RayKind.REFLECTED)
            material = scene.material_ids[before.hits.triangle[after.parent[rays]]]
            assert before.weight is not None and after.weight is not None
            path = before.weight[after.parent[rays]]
            plain, total_reflection = path * rho[material], path * (rho[material] + tau[material])
            total += number((after.weight[rays] != plain) & (after.weight[rays] != total_reflection))
        return total

    def reflected(errata: str) -> int:
        return sum(number(of_kind(g, RayKind.REFLECTED)) for g in run(size, errata).generations)

    # As printed every surface reflects
    return Found(reflected(f"GSR-{name}") if name else reflected("corrected"), rays_differ(size),
                 fails(f"GSR-{name}") if name else fails("corrected"), fails("corrected"))  # fmt: skip


def quarter(size: int) -> Found:
    """Listing 5's literal."""
    return reflectivity(size, "E4")


def rho_of_the_material(size: int) -> Found:
    """Eq. 1's ρ: what is printed is right."""
    return reflectivity(size, "")


def rates(size: int) -> Found:
    """Table 2: 512² rays by the milliseconds printed beside them, to the digits printed."""
    wrong = [abs(gsr_published.rate_of(ms) - rate) > 0.5e-6 for rate, ms in gsr_published.TABLE_2.values()]
    return Found(len(wrong), printed_fails=sum(wrong))


def passes_of(size: int) -> Found:
    """P passes are the depth of the recursion: as many generations of rays, each with rays to shoot."""
    wrong = 0
    for passes in (1, 2, 3):
        found = run(size, passes=passes).generations
        wrong += len(found) != passes or any(g.alive.sum() == 0 for g in found)
    return Found(3, rays_differ(size), corrected_fails=wrong)
