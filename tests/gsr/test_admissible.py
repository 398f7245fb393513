"""Every hit is one that a right float32 answer may be, for the very ray that was shot.

Plan
- Eye, reflected and refracted rays: nearest hit, both facings, geometric and smooth normals. Shadow rays: hit or miss,
  and with E6 (nearest hit) the hit too. Kinds are judged apart, each must have hits and misses to judge.
- The judge, which shares no code with the tracer, sees one moved hit (control).
- Front facing: nothing is hit from behind; smooth: normals bend the rays, hits stay admissible.
- Of two triangles in one place the one listed first is hit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from refsim import Hits, Rays, Scene
from refsim.oracle import judge
from refsim.results import RayKind, Trace
from tests.gsr.scenes import GLASS, MIRROR, SHINY, cornell, cornell_rays, cornell_trace, soup, traced, wild

OTHERS = (RayKind.EYE, RayKind.REFLECTED, RayKind.REFRACTED)


def pooled(trace: Trace, kind: RayKind) -> tuple[Rays, Hits]:
    """All rays of a kind, of all passes, and their hits."""
    columns: list[list[np.ndarray]] = [[] for _ in range(7)]
    for g in trace.generations:
        rows = (g.kind == kind) & g.alive
        every = (g.rays.origin, g.rays.direction, g.rays.t_max, g.hits.triangle, g.hits.t, g.hits.u, g.hits.v)
        for column, part in zip(columns, every, strict=True):
            column.append(part[rows])
    o, d, t_max, *hits = (np.ascontiguousarray(np.concatenate(column)) for column in columns)
    return Rays.unchecked(o, d, t_max), Hits(*hits)


def assert_admissible(
    trace: Trace, facing: Any = "both", nearest_shadows: bool = False
) -> dict[RayKind, tuple[int, int]]:
    """Judges all kinds; hits and misses of each."""
    seen = {}
    for kind in RayKind:
        rays, hits = pooled(trace, kind)
        any_hit = kind == RayKind.SHADOW and not nearest_shadows
        verdicts = judge(trace.scene, rays, hits, any_hit=any_hit, facing=facing)
        assert verdicts.ok, f"{kind.name}: {verdicts.worst()}"
        seen[kind] = int(hits.hit.sum()), int((~hits.hit).sum())
    return seen


@pytest.mark.parametrize("errata", ["corrected", "GSR-E6"])
def test_the_box(errata: str) -> None:
    trace = traced(cornell(), cornell_rays(20, 16), passes=4, errata=errata)
    seen = assert_admissible(trace, nearest_shadows=errata == "GSR-E6")
    assert all(hits > 20 for hits, _ in seen.values()) and all(seen[kind][1] > 0 for kind in OTHERS[:2]), seen


@pytest.mark.parametrize(
    "options", [{}, {"facing": "front"}, {"shading": "smooth"}, {"ior": 0.7}, {"errata": "GSR-E11"}], ids=str
)
def test_soups(options: dict[str, Any]) -> None:
    scene = soup(24, 40, (GLASS, GLASS, MIRROR, SHINY), 2)
    trace = traced(scene, wild(20, 15, 21), passes=4, **options)
    seen = assert_admissible(trace, options.get("facing", "both"))
    assert all(min(both) >= 10 for both in seen.values()), seen
    if "facing" in options:
        corner = scene.triangles.astype(np.float64)
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        for generation in trace.generations:
            hit = generation.hits.triangle >= 0
            assert ((generation.rays.direction[hit] * normal[generation.hits.triangle[hit]]).sum(axis=1) < 0).all()


def test_the_judge_sees_a_wrong_hit() -> None:
    for kind, any_hit in ((RayKind.REFLECTED, False), (RayKind.SHADOW, True)):
        rays, hits = pooled(cornell_trace(), kind)
        row = int(np.flatnonzero(hits.hit)[3])
        triangle = hits.triangle.copy()
        triangle[row] = -1
        verdicts = judge(cornell(), rays, Hits(triangle, hits.t, hits.u, hits.v), any_hit=any_hit)
        assert np.flatnonzero(~verdicts.admissible).tolist() == [row]


def test_of_two_triangles_in_one_place_the_first_is_hit() -> None:
    """Every triangle listed twice: nearest hits are on the first copy, and picture and rays are those of one copy."""
    once = soup(26, 12, (GLASS, MIRROR, SHINY))
    twice = Scene(
        np.concatenate([once.triangles] * 2), "twice", once.materials, np.tile(once.material_ids, 2), lights=once.lights
    )
    a, b = (traced(scene, wild(12, 9, 26), passes=4) for scene in (once, twice))
    assert a.image is not None and b.image is not None and a.image.tobytes() == b.image.tobytes()
    for one, two in zip(a.generations, b.generations, strict=True):
        assert (
            one.hits.triangle.tobytes() == two.hits.triangle.tobytes() and one.hits.t.tobytes() == two.hits.t.tobytes()
        )
        assert one.rays.direction.tobytes() == two.rays.direction.tobytes()
