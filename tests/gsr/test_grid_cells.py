"""The grid's textures: what each cell lists, how the lists lie in memory, how many cells there are.

Plan
- Property, exact: every cell that holds a point of a triangle (ten rational points of its surface, its edges and
  corners, cells closed, in fractions) lists it; triangles of no area and those that every ray tests are in no cell.
- Property: the lists are those of the twin in `reference`, which shares no code; counts of cells and tests, and the
  hits, of single rays are the twin's too: a triangle listed in k visited cells is tested k times.
- Lists are packed without gaps, ascending, row after row of the reference texture; the same for any number of threads.
- Dilations are the twin's, and cover the judge's own bound on accepted points.
- Resolution: the default rule, one whole number, three; one cell along an axis without thickness; refusals.
"""

from __future__ import annotations

from collections import defaultdict
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim import Scene, load_scene
from refsim.errors import InputError
from refsim.papers.geometry_shader_rays import grid as grid_module
from refsim.papers.geometry_shader_rays.grid import DENSITY, MOST_CELLS, ROW, Grid, grid
from refsim.papers.geometry_shader_rays.grid_margins import margins
from refsim.reference import grid as twin
from refsim.reference.triangle import pack
from tests.gsr.grid_cases import INF, KINDS, rays_of, scene_of, shoot

seeds = st.integers(0, 2**32 - 1)
# Ways to stand in a triangle: corners, edges, inside, close to an edge
WEIGHTS = [(8, 0, 0), (0, 8, 0), (0, 0, 8), (4, 4, 0), (0, 5, 3), (7, 0, 1), (2, 3, 3), (6, 1, 1), (1, 6, 1), (1, 1, 6)]


def lists_of(g: Grid) -> dict[tuple[int, int, int], list[int]]:
    """(x, y, z) → triangles, read as a shader does: start in the reference texture, length."""
    lists = {}
    for z, y, x in product(*map(range, g.cells.shape[:3])):
        column, row, count = map(int, g.cells[z, y, x])
        places = [row * ROW + column + k for k in range(count)]
        lists[x, y, z] = [int(g.references[k // ROW, k % ROW]) for k in places]
    return lists


def lattice_of(g: Grid) -> twin.Lattice:
    return twin.Lattice(*(np.array(x, np.float32) for x in (g.lower, g.size, g.inverse_size, g.shape)), g.far)


def cells_holding(point: list[Fraction], g: Grid) -> list[tuple[int, ...]]:
    """The closed cells that a rational point lies in: two along an axis where it is on their common wall."""
    along = []
    for a in range(3):
        place = (point[a] - Fraction(float(g.lower[a]))) / Fraction(float(g.size[a]))
        cells = {place.numerator // place.denominator, -(-place.numerator // place.denominator) - 1}
        assert min(cells) >= 0 and max(cells) < g.shape[a]  # the grid's box holds the scene with room to spare
        along.append(sorted(cells))
    return list(product(*along))


@given(seed=seeds, kind=st.sampled_from(KINDS), exponent=st.integers(-6, 6), resolution=st.integers(1, 24))
@settings(max_examples=60)
def test_every_cell_that_the_surface_crosses_lists_it(seed: int, kind: str, exponent: int, resolution: int) -> None:
    rng = np.random.default_rng(seed)
    scene = scene_of(kind, rng, 10.0**exponent)
    g = grid(scene, resolution, reach=float(rng.choice([0.0, 2.0])) * scene.diagonal).structure
    lists, unlisted = lists_of(g), set(g.loose.tolist()) | set(np.flatnonzero(scene.degenerate).tolist())
    assert not unlisted & {k for members in lists.values() for k in members}
    for i in range(len(scene)):
        if i in unlisted:
            continue
        corners = [[Fraction(float(x)) for x in vertex] for vertex in scene.triangles[i]]
        for weights in WEIGHTS:
            point = [sum(w * c[a] for w, c in zip(weights, corners, strict=True)) / 8 for a in range(3)]
            assert all(i in lists[cell] for cell in cells_holding(point, g)), (i, weights)


@given(seed=seeds, kind=st.sampled_from(KINDS), resolution=st.one_of(st.none(), st.integers(1, 12)))
@settings(max_examples=40)
def test_lists_and_counts_are_the_twins(seed: int, kind: str, resolution: int | None) -> None:
    rng = np.random.default_rng(seed)
    scene = scene_of(kind, rng)
    reach = 3 * scene.diagonal
    g = grid(scene, resolution, reach).structure
    lattice, growth = lattice_of(g), twin.growth_of(scene.triangles, reach, scene.degenerate)
    expected = defaultdict(list)
    for i, dilation in enumerate(growth.dilation):
        if 0 <= dilation < np.inf:
            for cell in twin.cells_of(scene.triangles[i], dilation + growth.slack, lattice):
                expected[cell].append(i)
    assert {cell: members for cell, members in lists_of(g).items() if members} == expected
    loose = np.flatnonzero(np.isinf(growth.dilation)).tolist()
    assert g.loose.tolist() == loose
    any_hit, front_only = bool(rng.integers(2)), bool(rng.integers(2))
    rays, records = rays_of(scene, rng, 40), pack(scene.triangles)
    shot = shoot(grid(scene, resolution, reach), scene, rays, any_hit, front_only)
    for k in range(40):
        if not rays[1][k].any():
            continue
        ray = rays[0][k], rays[1][k], rays[2][k]
        found = twin.search(ray, lattice, expected, loose, records, any_hit, front_only)
        assert found == twin.Found(*(shot_field[k] for shot_field in (
            shot.triangle, shot.t, shot.u, shot.v, shot.cells, shot.tests, shot.rejected
        )))  # fmt: skip


def test_a_triangle_in_k_cells_is_tested_k_times() -> None:
    """A sheet along the ray lies in all ten cells that the ray passes, the other end's marker in the last."""
    sheet, end = [(0, 0.01, 0), (10, 0.01, 0), (10, 0.01, 1)], [(10, -1, -1), (10, -1.1, -1), (10, -1, -1.1)]
    scene = Scene(np.array([sheet, end], np.float32))
    accelerator = grid(scene, (10, 1, 1))
    shot = shoot(accelerator, scene, ([(-1, 0, 0.001)], [(1, 0, 0)], [INF]))
    assert (shot.triangle[0], shot.cells[0], shot.tests[0]) == (-1, 10, 11)


def test_lists_are_packed_and_ascending() -> None:
    g = grid(load_scene("torus_knot_1024")).structure
    start = g.cells[..., 1].astype(np.int64) * ROW + g.cells[..., 0]
    counts = g.cells[..., 2].ravel()
    assert (start.ravel() == np.concatenate([[0], np.cumsum(counts)[:-1]])).all()
    assert g.references.dtype == g.cells.dtype == np.int32 and g.references.shape[1] == ROW
    assert -(-counts.sum() // ROW) == len(g.references)
    assert all(members == sorted(set(members)) for members in lists_of(g).values())
    assert np.shares_memory(g.cells, g.texels) and np.shares_memory(g.references, g.lists)


def test_the_number_of_threads_changes_nothing() -> None:
    """Enough triangles for four parts."""
    rng = np.random.default_rng(5)
    p = rng.random((1 << 16, 1, 3)) + rng.normal(size=(1 << 16, 3, 3)) * 0.01
    scene = Scene(p.astype(np.float32))
    one, four = (grid(scene, 30, threads=n).structure for n in (1, 4))
    assert (one.cells == four.cells).all() and (one.references == four.references).all()


@given(seed=seeds, kind=st.sampled_from(KINDS), reach=st.sampled_from([0.0, 1.0, 50.0]))
@settings(max_examples=40)
def test_dilations_are_the_twins(seed: int, kind: str, reach: float) -> None:
    rng = np.random.default_rng(seed)
    scene = scene_of(kind, rng)
    distance = reach * scene.diagonal
    found, expected = margins(scene, distance), twin.growth_of(scene.triangles, distance, scene.degenerate)
    held = np.isfinite(expected.dilation)
    assert found.loose.tolist() == np.flatnonzero(~held).tolist()
    # float64, in another order
    assert np.allclose(found.dilation[held], expected.dilation[held], rtol=1e-12, atol=0)
    assert np.isclose(found.slack, expected.slack, rtol=1e-12, atol=0)


def test_resolution() -> None:
    scene = Scene(np.array([[(0, 0, 0), (8, 0, 0), (8, 4, 2)], [(0, 4, 2), (1, 4, 2), (1, 4, 1)]], np.float32))
    assert grid(scene, 16).structure.cells.shape == (4, 8, 16, 3)
    assert grid(scene, (3, 5, 7)).structure.cells.shape == (7, 5, 3, 3)
    assert grid(scene, 1).structure.cells.shape == (1, 1, 1, 3)
    assert grid(scene, np.int64(4)).structure.cells.shape == (1, 2, 4, 3)
    knot = load_scene("torus_knot_1024")
    assert 0.8 * DENSITY * 1024 < np.prod(grid(knot).structure.shape) < 1.2 * DENSITY * 1024


def test_one_cell_along_an_axis_without_thickness() -> None:
    rng = np.random.default_rng(2)
    triangles = rng.random((500, 3, 3))
    for axis in range(3):
        flat = triangles.copy()
        flat[..., axis] = 0.25
        for resolution in (None, 20, (9, 9, 9)):
            shape = np.array(grid(Scene(flat.astype(np.float32)), resolution).structure.shape)
            assert shape[axis] == 1 and (np.delete(shape, axis) > 8).all()
    flat = triangles.copy()
    flat[..., 0] = flat[..., 2] = 0.0
    assert grid(Scene(flat.astype(np.float32)), 6).structure.shape == (1, 6, 1)
    flat[:] = 3.0
    assert grid(Scene(flat.astype(np.float32)), (5, 6, 7)).structure.shape == (1, 1, 1)


@pytest.mark.parametrize(
    "wrong", [0, -1, 2.5, "8", True, (4, 4), (4, 4, 4, 4), (4, 0, 4), (4, 4.0, 4), (), np.nan, [[1, 2, 3]], {}]
)
def test_nonsense_resolutions(wrong: object) -> None:
    with pytest.raises(InputError, match=r"resolution must be one or three whole numbers from 1, not .*\.$"):
        grid(scene_of("soup", np.random.default_rng(0)), wrong)


def test_too_large_grids(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of("soup", np.random.default_rng(0))
    for resolution in (2000, (400, 400, 400), MOST_CELLS + 1, 10**30):
        with pytest.raises(InputError, match=rf"more than the {MOST_CELLS} that fit its memory\.$"):
            grid(scene, resolution)
    references = int(grid(scene, 20).structure.cells[..., 2].sum())
    monkeypatch.setattr(grid_module, "MOST_REFERENCES", references)
    grid(scene, 20)
    monkeypatch.setattr(grid_module, "MOST_REFERENCES", references - 1)
    with pytest.raises(InputError, match=rf"a grid of {references} references is more than the {references - 1} that"):
        grid(scene, 20)


@pytest.mark.parametrize("wrong", [-1.0, np.nan, np.inf, "far", True, (1, 2)])
def test_nonsense_reaches(wrong: object) -> None:
    with pytest.raises(InputError, match=r"reach must be a distance, zero or more, not .*\.$"):
        grid(scene_of("soup", np.random.default_rng(0)), reach=wrong)
