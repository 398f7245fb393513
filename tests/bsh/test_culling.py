"""Which triangles lists leave out: the safe rules lose nothing, the others do, and how much each leaves out.

Plan
- Property, safe rules: no ray of a list's partition hits the front of a triangle that the list leaves out, through the
  intersection test itself (brute force, compiled), for directions on and next to the borders, and triangles whose
  normals are on and next to the rule's border. d · n ≥ 0 for all of them, exactly and as float32 computes it.
- The border is where it is said to be: within 8 eps of it a triangle is kept, beyond it culled; zero area is kept.
- Unsafe rules: a ray and a triangle that it hits from the front and that its list left out, found by Hypothesis and
  shrunk, no border being involved. What comes out: for sextant_same d ∝ (4, 3, −3) and n ∝ (4, −3, 3),
  for sextant_opposite d ∝ (1, 0, 0) and n ∝ (−1, 0, 0), a triangle hit head on. Traced, the hit is lost; with the safe
  rule it is there.
- Shares of normals left out: arcsin(1/3)/π, 1/6, 1/8 (the text: 16.67 % and 12.25 %), 35 % of what sextant_same leaves
  out is unsafe; pairs of one sextant that face each other, 0.61 %, by quadrature: Monte Carlo is within four standard
  errors of each.
- Refused: rules with another number of lists, or where backs are hit too.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import find, given, settings
from hypothesis import strategies as st

from refsim import Rays, Scene, trace
from refsim.errors import InputError
from refsim.papers.sphere_hierarchy.culling import RULES, SURPLUS, check_culling, kept_triangles
from refsim.papers.sphere_hierarchy.directions import list_directions, list_of_rays
from refsim.reference.triangle import pack
from refsim.reference.vector import dot

SAFE = ["sextant_safe", "octant"]
NEEDS = {"sextant_opposite": 6, "sextant_same": 6, "sextant_safe": 6, "octant": 8}
Vector = tuple[int, int, int]


def border_directions(rng: np.random.Generator, count: int) -> np.ndarray:
    """Unit directions f32[count, 3]: anywhere, on borders of sextants and octants, a few float32 steps from them."""
    d = rng.normal(size=(count, 3))
    corner = rng.random(count) < 0.4
    d[corner] = rng.choice((-1.0, 1.0), (count, 3))[corner]
    edge = rng.random(count) < 0.3
    d[edge] = rng.integers(-1, 2, (count, 3))[edge]
    d[~d.any(axis=1)] = (0.0, 0.0, 1.0)
    d /= np.abs(d).max(axis=1, keepdims=True)
    d = (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)
    return d + rng.integers(-3, 4, (count, 3)).astype(np.float32) * np.spacing(d)


def border_triangles(rng: np.random.Generator, count: int) -> np.ndarray:
    """Triangles f32[count, 3, 3] about the origin whose normals are anywhere, on or next to a rule's border."""
    n = rng.normal(size=(count, 3))
    axis, sign = rng.integers(3, size=count), rng.choice((-1.0, 1.0), count)
    rows = np.arange(count)
    on_sum = rng.random(count) < 0.5
    others = np.abs(n).sum(axis=1) - np.abs(n[rows, axis])
    n[rows[on_sum], axis[on_sum]] = (sign * others * (1.0 + rng.uniform(-4.0, 12.0, count) * 2.0**-24))[on_sum]
    flat = rng.random(count) < 0.3
    n[rows[flat], axis[flat]] = (rng.uniform(-4.0, 12.0, count) * 2.0**-24)[flat]
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    a = np.cross(n, np.eye(3)[np.abs(n).argmin(axis=1)])
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(n, a)
    return np.stack([a, -0.5 * a + 0.9 * b, -0.5 * a - 0.9 * b], axis=1).astype(np.float32)


def left_out(triangles: np.ndarray, rule: str) -> list[np.ndarray]:
    """Rows that each list leaves out."""
    _, n, _, _, _, degenerate = pack(triangles)
    return [
        np.flatnonzero(~kept_triangles(n, ~degenerate, along, rule)) for along in list_directions(NEEDS[rule])
    ]


def towards(targets: np.ndarray, d: np.ndarray) -> Rays:
    """Rays f32 that pass close to the targets, from two units before them."""
    return Rays.unchecked((targets - 2.0 * d).astype(np.float32), d, np.full(len(d), np.inf, np.float32))


@pytest.mark.parametrize("rule", SAFE)
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_no_ray_hits_the_front_of_what_its_list_leaves_out(rule: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    triangles, d = border_triangles(rng, 60), border_directions(rng, 600)
    picked, culled = list_of_rays(d, NEEDS[rule]), left_out(triangles, rule)
    assert sum(map(len, culled)) > 0
    for number, rows in enumerate(culled):
        of_list = d[picked == number]
        if not len(rows) or not len(of_list):
            continue
        weights = rng.dirichlet((1, 1, 1), len(of_list))[:, :, None]
        rays = towards((triangles[rng.choice(rows, len(of_list))] * weights).sum(axis=1), of_list)
        shot = {side: trace("brute_force", Scene(triangles[rows]), rays, generations=1, facing=side, threads=1)
                for side in ("front", "both")}  # fmt: skip
        assert not shot["front"].hits.hit.any()
        assert shot["both"].hits.hit.mean() > 0.5, "the rays have to meet the triangles, from behind"


@pytest.mark.parametrize("rule", SAFE)
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_culled_normals_and_directions_never_oppose(rule: str, seed: int) -> None:
    """Neither exactly nor in the float32 product that the intersection test computes; the latter is why there is a
    surplus."""
    rng = np.random.default_rng(seed)
    triangles, d = border_triangles(rng, 400), border_directions(rng, 400)
    picked, normals = list_of_rays(d, NEEDS[rule]), pack(triangles)[1]
    for number, rows in enumerate(left_out(triangles, rule)):
        n, along = normals[rows], d[picked == number]
        assert (dot(n[:, None], along[None]) >= 0).all()
        for a, b in zip(n, along, strict=False):
            assert sum(Fraction(float(x)) * Fraction(float(y)) for x, y in zip(a, b, strict=True)) >= 0


@pytest.mark.parametrize("rule", SAFE)
def test_the_borders_of_the_safe_rules(rule: str) -> None:
    """One step of the surplus on either side; beside x and y, z is 0, which octants count as on the border."""
    along = list_directions(NEEDS[rule])[0]
    usable = np.ones(1, np.bool_)

    def kept(*n: float) -> bool:
        return bool(kept_triangles(np.array([n], np.float32), usable, along, rule)[0])

    step = np.float32(2.0**-24)
    if rule == "sextant_safe":
        assert kept(0.5, 0.25, -0.25) and kept(0.5 + 8 * step - step, 0.25, -0.25)
        assert not kept(0.5 + SURPLUS, 0.25, -0.25) and not kept(1, 0, 0) and not kept(0.75, 0.1, -0.6)
        assert kept(-1, 0, 0) and kept(0.7, 0.7, 0.0) and kept(0, 1, 0)
    else:
        assert kept(1, 0, 0) and kept(0.8, 0.6, SURPLUS - 2.0**-30) and kept(0.8, -0.6, 0.1)
        assert not kept(0.8, 0.6, SURPLUS) and kept(-0.6, -0.6, -0.5)


@pytest.mark.parametrize("rule", RULES)
def test_zero_area_is_kept(rule: str) -> None:
    """It has no normal; nothing hits it, and it keeps its place."""
    triangle = np.array([[[0, 0, 0], [1, 1, 1], [2, 2, 2]]], np.float32)
    assert all(len(rows) == 0 for rows in left_out(triangle, rule))


def facing(n: Vector) -> np.ndarray:
    """A triangle f32[1, 3, 3] about the origin with that normal."""
    normal = np.array(n, np.float64)
    normal /= np.linalg.norm(normal)
    a = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    b = np.cross(normal, a)
    return np.array([[a, -0.5 * a + b, -0.5 * a - b]], np.float32)


def ray_along(d: Vector) -> Rays:
    direction = np.array([d], np.float64) / np.linalg.norm(d)
    return towards(np.zeros((1, 3)), direction.astype(np.float32))


def sextant(v: np.ndarray) -> int:
    """The sextant inside which a vector lies, −1 on a border."""
    axis = int(np.abs(v).argmax())
    return 2 * axis + int(v[axis] < 0) if (np.abs(v) < np.abs(v[axis])).sum() == 2 else -1


def is_lost(pair: tuple[Vector, Vector], rule: str) -> bool:
    """Whether the ray along d hits the front of the triangle, which its list leaves out; d and n within sextants."""
    d, n = np.array(pair[0]), np.array(pair[1])
    if not d @ n < 0 or sextant(d) < 0 or sextant(n) != (sextant(d) if rule == "sextant_same" else sextant(-d)):
        return False
    number = int(list_of_rays(ray_along(pair[0]).direction, 6)[0])
    return len(left_out(facing(pair[1]), rule)[number]) == 1


def within_sextant(most: int) -> st.SearchStrategy[Vector]:
    """Whole vectors within the sextant of +x, of which the others are turned copies."""
    return st.integers(1, most).flatmap(
        lambda x: st.tuples(st.just(x), st.integers(1 - x, x - 1), st.integers(1 - x, x - 1))
    )


SHRUNK = {"sextant_same": ((4, 3, -3), (4, -3, 3)), "sextant_opposite": ((1, 0, 0), (-1, 0, 0))}


@pytest.mark.parametrize("rule", SHRUNK)
def test_the_unsafe_rules_lose_what_is_visible(rule: str) -> None:
    d = n = within_sextant(9)
    if rule == "sextant_opposite":
        n = n.map(lambda v: (-v[0], v[1], v[2]))
    search = settings(max_examples=20_000, database=None, derandomize=True, report_multiple_bugs=False)
    lost = find(st.tuples(d, n), lambda pair: is_lost(pair, rule), settings=search)
    for pair in (lost, SHRUNK[rule]):
        assert is_lost(pair, rule)
        check_that_only_this_rule_loses(rule, pair)


def check_that_only_this_rule_loses(rule: str, pair: tuple[Vector, Vector]) -> None:
    """A ray and a triangle, traced with the rule and without."""
    scene, ray = Scene(facing(pair[1])), ray_along(pair[0])
    shared = {"facing": "front", "generations": 1, "lists": 6}
    assert trace("traversal_list", scene, ray, **shared).hits.hit.all()
    assert trace("traversal_list", scene, ray, culling="sextant_safe", **shared).hits.hit.all()
    assert not trace("traversal_list", scene, ray, culling=rule, **shared).hits.hit.any()


SAMPLES = 400_000


def uniform_normals(seed: int) -> np.ndarray:
    n = np.random.default_rng(seed).normal(size=(SAMPLES, 3))
    return (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32)


def share_left_out(rule: str, n: np.ndarray) -> float:
    """Mean over the lists."""
    usable = np.ones(len(n), np.bool_)
    kept = [kept_triangles(n, usable, along, rule).mean() for along in list_directions(NEEDS[rule])]
    return 1.0 - float(np.mean(kept))


EXACT = {"sextant_safe": np.arcsin(1 / 3) / np.pi, "sextant_same": 1 / 6, "sextant_opposite": 1 / 6, "octant": 1 / 8}


@pytest.mark.parametrize("rule", RULES)
def test_the_shares_of_normals_left_out(rule: str) -> None:
    """10.82 %, 16.67 % and 12.5 %. Every normal is in one octant and in one sextant: for those rules only the borders,
    8 eps wide, can be missing; the safe sextants leave room, so there each list is a sample."""
    measured = share_left_out(rule, uniform_normals(7))
    if rule == "sextant_safe":
        error = np.sqrt(EXACT[rule] * (1.0 - EXACT[rule]) / SAMPLES)
        assert abs(measured - EXACT[rule]) < 4.0 * error
    else:
        assert abs(measured - EXACT[rule]) < 1e-5
    assert round(100 * float(EXACT["sextant_safe"]), 2) == 10.82


def test_a_third_of_what_the_same_sextant_leaves_out_is_unsafe() -> None:
    exact = 1.0 - EXACT["sextant_safe"] / EXACT["sextant_same"]
    assert round(100 * float(exact)) == 35
    n = uniform_normals(8)
    same, safe = share_left_out("sextant_same", n), share_left_out("sextant_safe", n)
    assert abs((1.0 - safe / same) - exact) < 4.0 * np.sqrt(exact * (1.0 - exact) / SAMPLES)


def facing_share() -> float:
    """The chance that d · n < 0 for d and n of one sextant, uniform in solid angle, by quadrature. With d ∝ (1, a, b),
    n ∝ (1, −y, −z) and by symmetry a, b, y, z in [0, 1] after four mirrorings: the measure of a y + b z > 1 under
    (1 + a² + b²)^−3/2 (1 + y² + z²)^−3/2, over (4π/6)². The integral over z is elementary.
    """
    nodes, weights = np.polynomial.legendre.leggauss(32)
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    a, c, e = np.meshgrid(nodes, nodes, nodes, indexing="ij")
    weight = weights[:, None, None] * weights[None, :, None] * weights[None, None, :]
    b = 1.0 - a + a * c  # from 1 − a to 1
    low = (1.0 - b) / a
    y = low + (1.0 - low) * e  # from (1 − b) / a to 1

    far, near = 1.0, (1.0 - a * y) / b
    over_z = far / np.sqrt(1.0 + y * y + far * far) - near / np.sqrt(1.0 + y * y + near * near)
    over_z = over_z / (1.0 + y * y)
    # a and b may each be mirrored, y and z with them: four times
    integrand = 4.0 * over_z * (1.0 + a * a + b * b) ** -1.5
    return float((weight * integrand * a * (1.0 - low)).sum() / (2.0 * np.pi / 3.0) ** 2)


def test_pairs_of_one_sextant_that_face_each_other() -> None:
    """0.61 % do; so of pairs in opposite sextants, which the text says cannot hit, 99.39 % do."""
    exact = facing_share()
    assert round(100 * exact, 2) == 0.61
    d, n = uniform_normals(9), uniform_normals(10)
    of_sextant = [v[list_of_rays(v, 6) == 0].astype(np.float64) for v in (d, n)]
    count = min(map(len, of_sextant))
    along = (of_sextant[0][:count] * of_sextant[1][:count]).sum(axis=1)
    error = np.sqrt(exact * (1.0 - exact) / count)
    assert abs((along < 0).mean() - exact) < 4.0 * error
    # The opposite sextant holds the mirrored normals
    assert abs((-along < 0).mean() - (1.0 - exact)) < 4.0 * error


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("lists", [1, 2, 6, 8])
@pytest.mark.parametrize("side", ["front", "both"])
def test_mismatches_are_refused(rule: str, lists: int, side: str) -> None:
    if lists == NEEDS[rule] and side == "front":
        check_culling(rule, lists, side)
        return
    wanted = "needs facing='front'" if lists == NEEDS[rule] else f"needs lists={NEEDS[rule]}, not lists={lists}"
    scene, ray = Scene(facing((0, 0, 1))), ray_along((0, 0, -1))
    for backend in ("numba", "numpy"):
        with pytest.raises(InputError, match=wanted):
            trace("traversal_list", scene, ray, lists=lists, culling=rule, facing=side, backend=backend)


def test_without_a_rule_nothing_is_left_out_or_refused() -> None:
    for lists, side in ((1, "front"), (2, "both"), (6, "both"), (8, "front")):
        check_culling(None, lists, side)
        assert kept_triangles(np.eye(3, dtype=np.float32), np.ones(3, np.bool_), list_directions(lists)[0], None).all()
