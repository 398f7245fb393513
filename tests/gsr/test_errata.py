"""What each printed formula does to a picture, predicted by hand from the court of `scenes`.

Plan
- The eight pixels of the court as corrected, with a mirror and with tiles for a wall.
- E1, E1b, E2, E4, E5, E9, E10 change the pixels that they must, to the values that they must, and no other.
- E3 leaves the background, and the same rays are shot again. E6 gives the same picture for more tests. E7 gives the
  same bits and counts. E8 is in `test_order`, E12 in `test_configurations`.
- E11 puts a ray on the far side of a triangle hit from behind, so that this shadows itself.
- On 8-bit targets E1b is black, and so what is corrected; E9 adds as it does on float ones.

A prediction is float64; 1e-6 is a dozen float32 roundings of numbers up to 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from refsim import Material, Scene
from refsim.results import RayKind, Trace
from refsim.scene import PointLight
from tests.gsr.scenes import (
    BACKGROUND,
    FLOOR,
    MIRROR,
    ON_WALL,
    ROOF,
    TILES,
    assembled,
    between_mirrors,
    cornell,
    cornell_rays,
    court,
    court_rays,
    facing_mirrors,
    floor_light,
    quad,
    traced,
    wall_light,
)

AMBIENT = 0.2 * np.array(FLOOR.color)
ON_TILES = 0.2 * np.array(TILES.color)
BEHIND = np.array(BACKGROUND)
LIT = floor_light()
WALL = wall_light()
WHITE = np.ones(3)
NOTHING = np.zeros(3)

Picture = dict[int, np.ndarray]


def corrected(wall: Material, depth: int = 3) -> Picture:
    """The court's picture; with two passes there are no shadows in the wall."""
    ambient, lit = (ON_TILES, WALL) if wall is TILES else (NOTHING, dict.fromkeys(ON_WALL, NOTHING))
    late = 1.0 if depth == 2 else 0.0
    return {
        0: AMBIENT + LIT[0],
        1: AMBIENT,
        2: ambient + lit[2] + 0.5 * (AMBIENT + LIT[2]),
        3: ambient + 0.5 * (AMBIENT + late * LIT[3]),
        4: ambient + 0.5 * (AMBIENT + LIT[4]),
        5: ambient + lit[5] + 0.5 * (AMBIENT + late * LIT[5]),
        6: BEHIND,
        7: ambient + lit[7] + 0.5 * BEHIND,
    }


def assert_shows(trace: Trace, expected: Picture) -> None:
    assert trace.image is not None
    rows = np.stack([expected[k] for k in sorted(expected)])
    off = np.abs(trace.image[0] - rows).max(axis=1)
    assert (off <= 1e-6).all(), (
        f"pixel {int(np.argmax(off))}: {trace.image[0][np.argmax(off)]}, not {rows[np.argmax(off)]}"
    )


def shown(wall: Material = MIRROR, **options: Any) -> Trace:
    return traced(court(wall), court_rays(), **{"passes": 3, **options})


@pytest.mark.parametrize("wall", [MIRROR, TILES], ids=["mirror", "tiles"])
@pytest.mark.parametrize("depth", [2, 3, 5])
def test_the_corrected_court(wall: Material, depth: int) -> None:
    assert_shows(shown(wall, passes=depth), corrected(wall, depth))


@pytest.mark.parametrize(("name", "colour"), [("E1", 1.0), ("E1b", -1.0)])
def test_shadows_add_their_own_colour(name: str, colour: float) -> None:
    """A shadow replaces its light's target by (1, 1, 1) or (−1, −1, −1), whatever the path's weight is."""
    right = corrected(MIRROR)
    shadows = {1: 1, 3: 2, 4: 1, 5: 1}
    assert_shows(shown(errata=f"GSR-{name}"), right | {k: right[k] + n * colour * WHITE for k, n in shadows.items()})


def test_negative_shadows_are_black_on_bytes() -> None:
    right, printed, white = (
        shown(color_format="rgba8unorm", errata=errata).image for errata in ("corrected", "GSR-E1b", "GSR-E1")
    )
    assert right is not None and printed is not None and white is not None
    assert (right == printed).all()
    assert (white[0, [1, 3, 4, 5]] == 1.0).all() and (white[0, [0, 2, 6, 7]] == right[0, [0, 2, 6, 7]]).all()


@pytest.mark.parametrize("wall", [MIRROR, TILES], ids=["mirror", "tiles"])
def test_misses_end_before_their_background(wall: Material) -> None:
    right, printed = corrected(wall), shown(wall, errata="GSR-E2")
    assert_shows(printed, right | {7: right[7] - 0.5 * BEHIND})
    assert printed.counters["geometry.passed_reflected"] == 4
    assert shown(wall).counters["geometry.passed_reflected"] == 5


def test_what_passes_unchanged_is_shot_again() -> None:
    """Seven eye rays hit and come back; up to the hit that they have there is nothing, so they end the second time. Of
    their seven shadow rays three hit (pixels 1, 3, 4) and come back, of the five reflected ones four, which send a
    shadow ray each."""
    printed = shown(errata="GSR-E3")
    assert_shows(printed, dict.fromkeys(range(8), BEHIND))
    expected = [
        {"eye": 8, "shadow": 0, "reflected": 0},
        {"eye": 7, "shadow": 7, "reflected": 5},
        {"eye": 0, "shadow": 3 + 4, "reflected": 4},
    ]
    for generation, counts in zip(printed.generations, expected, strict=True):
        assert {kind: generation.counters[f"rays.{kind}"] for kind in counts} == counts
        assert generation.counters["fragment.written"] == 0 < generation.counters["fragment.discarded"]


def test_every_surface_reflects_a_quarter() -> None:
    """Two passes. The floor sends a quarter too: pixel 0's leaves, pixel 1's meets the roof from below, where the light
    is behind it; the wall's half becomes a quarter."""
    right = corrected(MIRROR, 2)
    under_roof = 0.25 * 0.2 * np.array(ROOF.color)
    halved = {k: 0.5 * right[k] for k in (2, 3, 4, 5, 7)}
    printed = shown(passes=2, errata="GSR-E4")
    assert_shows(printed, right | halved | {0: right[0] + 0.25 * BEHIND, 1: right[1] + under_roof})
    weight = printed.generations[1].weight
    assert weight is not None
    assert set(weight[printed.generations[1].kind == RayKind.REFLECTED].tolist()) == {0.25}


@pytest.mark.parametrize("wall", [MIRROR, TILES], ids=["mirror", "tiles"])
def test_one_bounce_whatever_passes(wall: Material) -> None:
    """Only eye rays spawn: no shadows in the wall, as with two passes, and nothing left to shoot after these."""
    for passes in (2, 3, 5):
        printed = shown(wall, passes=passes, errata="GSR-E5")
        assert_shows(printed, corrected(wall, 2))
        assert [len(g.rays) > 0 for g in printed.generations] == [True, True] + [False] * (passes - 2)
    mirrors = [
        traced(facing_mirrors(), between_mirrors(5, 4), passes=passes, errata="GSR-E5").image for passes in (2, 6)
    ]
    assert (mirrors[0] == mirrors[1]).all()


def test_shadow_rays_that_look_for_the_nearest_hit() -> None:
    """Same picture, same bits; every shadow ray meets every triangle, where any hit would do."""
    right, printed = shown(), shown(errata="GSR-E6")
    assert (right.image == printed.image).all()
    triangles = len(court())
    for a, b in zip(right.generations, printed.generations, strict=True):
        shadow, inside = a.kind == RayKind.SHADOW, a.per_ray["box_rejections"] == 0
        first, second = a.per_ray["triangle_tests"], b.per_ray["triangle_tests"]
        assert (first[~shadow & inside & a.alive] == triangles).all() and (second[inside & b.alive] == triangles).all()
        hit = shadow & (a.hits.triangle >= 0)
        # In file order the search ends at the triangle found; the roof is triangles 2 and 3
        assert (first[hit] == a.hits.triangle[hit] + 1).all()
        assert not hit.any() or first[hit].max() < triangles
    assert right.counters["intersection.triangle_tests"] < printed.counters["intersection.triangle_tests"]


def test_numbers_that_are_right_change_nothing() -> None:
    right, printed = (traced(cornell(), cornell_rays(), passes=3, errata=e) for e in ("corrected", "GSR-E7"))
    assert (right.image == printed.image).all() and dict(right.counters) == dict(printed.counters)


def floor_under(radiance: float, color: float = 0.3) -> Scene:
    floor = quad((-8, 0, 8), (8, 0, 8), (8, 0, -8), (-8, 0, -8))
    return assembled(
        "floor", [(floor, Material("grey", "diffuse", (color,) * 3))], PointLight((0, 4, 0), (radiance,) * 3)
    )


@pytest.mark.parametrize("color_format", ["rgba32float", "rgba8unorm"])
def test_eye_fragments_add_to_the_clear_colour(color_format: str) -> None:
    """0.3 over 0.5 gives 0.8: straight below the light 0.3 · (0.2 + 1 · 0.8) is 0.3. On 8 bits the summands 0.06, 0.24
    and 0.5 are 15, 61 and 128 (or 127, a tie) steps of 1/255."""
    from refsim import Rays

    down = Rays([[0.0, 1.0, 0.0]], [[0.0, -1.0, 0.0]], np.inf, 1, 1)
    shared: dict[str, Any] = {"passes": 1, "background": (0.5, 0.5, 0.5), "color_format": color_format}
    scene = floor_under(0.8)
    right, printed = (traced(scene, down, errata=errata, **shared).image for errata in ("corrected", "GSR-E9"))
    assert right is not None and printed is not None
    step = 1e-6 if color_format == "rgba32float" else 1.5 / 255
    assert np.abs(right - 0.3).max() <= step and np.abs(printed - 0.8).max() <= step


def test_what_lies_behind_shines_through() -> None:
    """E9 in the court: the background is added wherever an eye ray hits."""
    right = corrected(TILES)
    assert_shows(shown(TILES, errata="GSR-E9"), {k: right[k] + BEHIND * (k != 6) for k in right})


@pytest.mark.parametrize("wall", [MIRROR, TILES], ids=["mirror", "tiles"])
def test_shadows_erase_ambient_light(wall: Material) -> None:
    right = corrected(wall)
    mine = ON_TILES if wall is TILES else NOTHING
    erased = {1: AMBIENT, 3: mine + 0.5 * AMBIENT, 4: mine, 5: 0.5 * AMBIENT}
    assert_shows(shown(wall, errata="GSR-E10"), right | {k: right[k] - light for k, light in erased.items()})


def test_offset_goes_inward_on_the_back() -> None:
    """The floor turned over: corrected nothing changes, as printed every shadow ray from it starts below it and meets
    it at once. The wall's front is hit, so that its rays start where they should."""
    scene = court(MIRROR, FLOOR, True)
    right = corrected(MIRROR)
    assert_shows(traced(scene, court_rays(), passes=3), right)
    printed = traced(scene, court_rays(), passes=3, errata="GSR-E11")
    dark = {0: AMBIENT, 2: 0.5 * AMBIENT, 4: 0.5 * AMBIENT}
    assert_shows(printed, right | dark)
    shadow = (printed.generations[1].kind == RayKind.SHADOW) & np.isin(printed.generations[1].pixel, (0, 1))
    height = printed.generations[1].rays.origin[shadow, 1]
    assert (height < 0).all() and np.abs(height + float(scene.epsilon)).max() <= 1e-6


def test_the_front_offset_is_the_same_either_way() -> None:
    """Where all hits are in front E11 changes no bit."""
    assert (shown().image == shown(errata="GSR-E11").image).all()


def test_all_together() -> None:
    """Several errata at once do what each does: white shadows over a background that shines through, nothing behind the
    wall, a quarter for every reflection."""
    printed = shown(passes=2, errata="GSR-E1,GSR-E2,GSR-E4,GSR-E9")
    right = corrected(MIRROR, 2)
    halved = {k: 0.5 * right[k] for k in (2, 3, 4, 5)} | {7: NOTHING}
    added = {k: BEHIND + WHITE * (k in (1, 3, 4)) for k in (0, 1, 2, 3, 4, 5, 7)}
    quarter = {1: 0.25 * 0.2 * np.array(ROOF.color)}
    merged = right | halved
    assert_shows(printed, {k: merged[k] + added.get(k, NOTHING) + quarter.get(k, NOTHING) for k in merged})
