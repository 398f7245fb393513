"""Work of the shaders by events, and the counters and shares of Table 1 that follow.

Plan (how operations are counted: `test_operations`)
- Every accelerator's search falls into its blocks, one written here too.
- A pass's counters are its events times the blocks, counted here once more from the trace; passes add up to the run.
- Shares add up to 100 and follow the prices; the vertex shader's grows with the triangles, as Table 1's does.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim.geometry import triangle
from refsim.papers.geometry_shader_rays import costs
from refsim.papers.geometry_shader_rays.bvh_nodes import search_hierarchy
from refsim.papers.geometry_shader_rays.costs import Prices, Work, search_work, shares
from refsim.papers.geometry_shader_rays.errata import Printed
from refsim.papers.geometry_shader_rays.grid_traversal import search_grid
from refsim.papers.geometry_shader_rays.setup import accelerator_of
from refsim.results import RayKind
from tests.gsr.scenes import SHINY, cornell, cornell_rays, cornell_trace, soup, traced, wild


def through_lists(structure, triangles, o, d, t_max, any_hit, front_only):
    """A search of another kind: an early exit, nodes, and a test in each without a loop."""
    cells, tests = 0, 0
    if o[0] + d[0] > structure.far:
        return -1, t_max, 0, 0, cells, tests, 1
    node = structure.root * 2
    while node > 0:
        cells += 1
        tests += 1
        triangle.intersect(o, d, t_max, o, d, o, d)
        node = structure.next[node]
    return -1, t_max, 0, 0, cells, tests, 0


def test_a_search_falls_into_its_blocks() -> None:
    found = search_work(through_lists)
    assert found.outside == Work(2, 0) and found.walking == Work(1, 0)
    assert found.cell == found.test == Work(1 + 40, 1)
    grid, hierarchy, every = (search_work(f) for f in (search_grid, search_hierarchy, naive_traverse()))
    assert every.cell == every.walking == Work() and grid.walking.arithmetic > 0 and every.test.fetches == 4
    # A reference and four slices of the triangle; a cell's texel; a node's box and links
    assert grid.test == hierarchy.test and grid.test.fetches == 5
    assert (grid.cell.fetches, hierarchy.cell.fetches) == (1, 2) and grid.cell.arithmetic < hierarchy.cell.arithmetic
    assert grid.test.arithmetic > costs.building_blocks(search_grid)["intersection alone"].arithmetic == 40


def naive_traverse() -> Any:
    return accelerator_of(cornell(), cornell_rays(), {"acceleration": "naive", "resolution": None}).traverse


def test_counters_of_a_pass_are_events_times_blocks() -> None:
    trace = cornell_trace()
    scene, first, *later = trace.scene, *trace.generations
    search = search_work(naive_traverse())
    kinds = sorted({(float(m.specular), float(round(m.shininess))) for m in scene.materials})
    blocks = costs.blocks(costs.Setup(naive_traverse(), "vertex", 2, 0, 0, (0.1, 0.12, 0.15), Printed(), tuple(kinds)))
    for k, g in enumerate((first, *later)):
        n, hit = g.counters, g.hits.triangle >= 0
        rays = int(g.alive.sum())
        finished = n["geometry.in_finished"]
        one = "vertex.eye" if k == 0 else "vertex.later"
        assert n["vertex.fetches"] == n["intersection.triangle_tests"] * search.test.fetches
        assert n["vertex.arithmetic"] == (
            finished * blocks["vertex.finished"].arithmetic
            + rays * (blocks[one].arithmetic + search.outside.arithmetic)
            + n["intersection.triangle_tests"] * search.test.arithmetic
        )
        surfaces = g.hits.triangle[hit & (g.kind != RayKind.SHADOW)]
        spawning = len(surfaces) if g is not later[-1] else 0
        assert n["geometry.fetches"] == spawning * blocks["geometry.spawning"].fetches
        shading = Counter((scene.materials[m].specular, scene.materials[m].shininess)
                          for m in scene.material_ids[surfaces])  # fmt: skip
        missed = sum(n[f"geometry.passed_{kind}"] for kind in ("reflected", "refracted", "eye")) - len(surfaces)
        shadows = n["geometry.passed_shadow"]
        left = n["fragment.invocations"] - len(surfaces) - missed - shadows
        assert left == n["fragment.discarded"] and shadows == int((hit & (g.kind == RayKind.SHADOW)).sum())
        works = [blocks[f"fragment.surface.{kinds.index((s, float(round(e))))}"].times(m)
                 for (s, e), m in shading.items()]  # fmt: skip
        works += [blocks["fragment.discarded"].times(left), blocks["fragment.shadow"].times(shadows)]
        whole = blocks["fragment.missed"].times(missed).plus(*works)
        assert (n["fragment.arithmetic"], n["fragment.fetches"]) == whole
    for name in ("vertex.arithmetic", "geometry.arithmetic", "fragment.fetches"):
        assert trace.counters[name] == sum(g.counters[name] for g in trace.generations) > 0


def test_what_a_ray_is_decides_what_it_costs() -> None:
    cheap, dear = (0.0, 7.0), (0.5, 1023.0)
    found = costs.blocks(costs.Setup(naive_traverse(), "vertex", 2, 0, 0, (0.1, 0.1, 0.1), Printed(), (cheap, dear)))
    arithmetic = {name: work.arithmetic for name, work in found.items()}
    assert arithmetic["vertex.finished"] < arithmetic["vertex.later"]
    assert arithmetic["geometry.finished"] <= arithmetic["geometry.kept"] < arithmetic["geometry.spawning"]
    order = [arithmetic[f"fragment.{name}"] for name in ("discarded", "shadow", "missed", "surface.0", "surface.1")]
    assert order == sorted(order)
    # The highlight of each of two lights: 20 products, their tests and shifts, and its own product
    assert order[4] - order[3] == 2 * (20 + 11 + 10 + 10 + 1)
    smooth = costs.blocks(costs.Setup(naive_traverse(), "vertex", 2, 1, 0, (0.1, 0.1, 0.1), Printed(), (cheap,)))
    assert smooth["geometry.spawning"].fetches == found["geometry.spawning"].fetches + 3
    assert smooth["fragment.surface.0"].fetches == found["fragment.surface.0"].fetches + 3


@given(st.lists(st.integers(0, 10**9), min_size=6, max_size=6), st.floats(0.125, 64), st.floats(0.125, 64))
def test_shares_add_up_and_follow_prices(numbers: list[int], operation: float, fetch: float) -> None:
    names = [f"{shader}.{what}" for shader in costs.SHADERS for what in ("arithmetic", "fetches")]
    counters = dict(zip(names, numbers, strict=True))
    found = shares(counters, Prices(operation, fetch))
    if not any(numbers):
        assert found == {"vertex": 0.0, "geometry": 0.0, "fragment": 0.0}
        return
    assert sum(found.values()) == pytest.approx(100.0, rel=1e-12)
    # Nothing but the ratio of the prices matters
    assert shares(counters, Prices(2 * operation, 2 * fetch)) == found
    total = sum(numbers[::2]) * operation + sum(numbers[1::2]) * fetch
    assert found["vertex"] == pytest.approx(100 * (numbers[0] * operation + numbers[1] * fetch) / total, rel=1e-12)


def test_shares_grow_as_in_table_1() -> None:
    rays = wild(12, 9, 3)
    found = []
    for count in (12, 36, 646):
        found.append(shares(traced(soup(5, count, [SHINY], 2), rays, passes=2).counters))
    vertex = [each["vertex"] for each in found]
    assert vertex == sorted(vertex) and vertex[0] < 90.0 < 98.0 < vertex[2]
    assert all(each["geometry"] > 0 and each["fragment"] > 0 for each in found)
