"""The order in which a hit emits its rays, which is that in which they reach the framebuffer (section 4.3, GSR-E8).

Plan
- The buffer holds, hit by hit: the ray itself, shadow rays light by light, the reflected, the refracted ray; or what
  the other two orders say.
- With a layer a node and a target a light the picture is the same, bit for bit, in all orders.
- In one target by Eq. 1 (E8): right for the printed order, one light, one bounce. Wrong where predicted, there only:
  reflected first, the shadow of a pixel extinguishes its reflection; two bounces, the shadow in a mirror extinguishes
  what the mirror itself shows; two lights, the shadow of one extinguishes both.

A shadow erases ambient light in one target (E10), so that is the corrected picture to compare with.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from refsim.results import RayKind, Trace
from refsim.scene import PointLight
from tests.gsr.scenes import FLOOR, MIRROR, TILES, cornell, cornell_rays, court, court_rays, lit_from, traced

ORDERS = ("listed", "reflected_first", "reversed")
LISTED, FIRST, REVERSED = ORDERS
# Rank of shadow, reflected and refracted rays of one hit
RANK = {
    LISTED: {RayKind.SHADOW: 0, RayKind.REFLECTED: 1, RayKind.REFRACTED: 2},
    FIRST: {RayKind.REFLECTED: 0, RayKind.REFRACTED: 1, RayKind.SHADOW: 2},
    REVERSED: {RayKind.REFRACTED: 0, RayKind.REFLECTED: 1, RayKind.SHADOW: 2},
}


@cache
def cornell_in(order: str) -> Trace:
    return traced(cornell(), cornell_rays(), passes=4, lights=1, emission_order=order)


@pytest.mark.parametrize("order", ORDERS)
def test_rays_of_a_hit_lie_together_in_order(order: str) -> None:
    for generation in cornell_in(order).generations[1:]:
        ranks = [RANK[order][RayKind(kind)] for kind in generation.kind]
        keys = list(zip(generation.parent.tolist(), ranks, strict=True))
        assert keys == sorted(keys) and len(set(keys)) == len(keys)


def test_lights_in_order() -> None:
    generation = traced(cornell(), cornell_rays(), passes=2).generations[1]
    assert generation.light is not None
    both = zip(generation.kind, generation.light, strict=True)
    rank = [3 * RANK[LISTED][RayKind(kind)] + max(light, 0) for kind, light in both]
    keys = list(zip(generation.parent.tolist(), rank, strict=True))
    assert keys == sorted(keys) and {0, 1, 3, 6} == set(rank)


@pytest.mark.parametrize("order", [FIRST, REVERSED])
def test_layers_do_not_care(order: str) -> None:
    listed, other = cornell_in(LISTED), cornell_in(order)
    assert listed.image is not None and other.image is not None
    assert listed.image.tobytes() == other.image.tobytes()
    changed = 0
    for a, b in zip(listed.generations, other.generations, strict=True):
        assert dict(a.counters) == dict(b.counters)
        assert a.node is not None and b.node is not None
        one, two = np.lexsort((a.kind, a.node, a.pixel)), np.lexsort((b.kind, b.node, b.pixel))
        assert (a.rays.origin[one] == b.rays.origin[two]).all() and (a.hits.t[one] == b.hits.t[two]).all()
        changed += int((a.kind != b.kind).sum())
    assert changed > 0, "the buffers do differ"


def picture(errata: str, order: str = LISTED, wall: object = TILES, passes: int = 2) -> np.ndarray:
    trace = traced(court(wall), court_rays(), passes=passes, errata=errata, emission_order=order)  # type: ignore[arg-type]
    assert trace.image is not None
    return trace.image[0]


@pytest.mark.parametrize("wall", [MIRROR, TILES], ids=["mirror", "tiles"])
def test_one_target_is_right_for_what_the_paper_shows(wall: object) -> None:
    """One light, one bounce, the printed order; sums are taken in another order, hence a rounding."""
    right, one_target = picture("GSR-E10", wall=wall), picture("GSR-E8", wall=wall)
    assert np.abs(right - one_target).max() <= 2.0**-23


@pytest.mark.parametrize("order", [FIRST, REVERSED])
@pytest.mark.parametrize("wall", [MIRROR, TILES], ids=["mirror", "tiles"])
def test_the_reflection_before_the_shadow(order: str, wall: object) -> None:
    """Pixels 3 and 4 see a wall that is in shadow: their shadow puts out the reflection, which should stay."""
    right, wrong = picture("GSR-E8", wall=wall), picture("GSR-E8", order, wall)
    assert (wrong[[3, 4]] == 0).all() and (right[[3, 4]] > 0.05).all()
    others = [0, 1, 2, 5, 6, 7]
    assert (wrong[others] == right[others]).all()


def test_a_second_bounce() -> None:
    """Pixels 3 and 5 see a floor in shadow in the wall. Pixel 5's own light goes out with it."""
    right, wrong = picture("GSR-E10", passes=3), picture("GSR-E8", passes=3)
    assert (wrong[[3, 5]] == 0).all() and (right[5] > 0.05).all() and (right[3] == 0).all()
    others = [0, 1, 2, 4, 6, 7]
    assert np.abs(right - wrong)[others].max() <= 2.0**-23


def test_two_lights() -> None:
    """A lamp under the roof lights pixel 1, which the first light does not reach: that one's shadow puts out both."""
    lamp = PointLight((-6.0, 3.0, 0.0), (0.5, 0.6, 0.7))
    scene = court(TILES).replace(lights=(*court().lights, lamp))
    right, wrong = (traced(scene, court_rays([0, 1]), errata=errata).image for errata in ("GSR-E10", "GSR-E8"))
    assert right is not None and wrong is not None
    under = np.array(FLOOR.color) * np.array(lamp.color) * lit_from((-6, 0, 0), (0, 1, 0), lamp)
    # E10 keeps ambient light in the first light's target, whose shadow takes it
    assert np.abs(right[0, 1] - under).max() <= 1e-6 and (wrong[0, 1] == 0).all()
    assert np.abs(right[0, 0] - wrong[0, 0]).max() <= 2.0**-22
