"""What stands as printed, predicted and then run (option `errata`).

Plan
- BSH-E5, the exit root: one triangle in front of another, whose sphere reaches behind both, is lost, by hand; on soups
  hits are only ever lost to farther ones, never gained; without a nearer hit before it nothing is lost.
- BSH-E9, heads whatever the side: in a glass sphere every refracted ray leaves behind its polygon, in front of
  which there is nothing: all hits of the second generation are lost. Mirrors, whose rays leave on the normal's side,
  lose none.
- BSH-E1 and E2 are culling rules (`test_culling`); as_printed is E5 and E9; names in any form; refusals.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import refsim
from refsim import InputError, Rays, Scene
from refsim.papers.sphere_hierarchy.errata import Printed, printed_text
from tests.bsh.traced import bits, eye_rays, mixed, traced, wild_rays


def upright(x: float, size: float) -> np.ndarray:
    """A triangle that faces +x, around the axis."""
    return np.array([[x, -size, -size], [x, size, -size], [x, 0.0, size]], np.float32)


def test_the_exit_root_loses_what_lies_before_a_hit() -> None:
    """By its end along +x the far triangle comes first and is hit at t = 10. The near one's sphere, of radius 7 around
    x = 3, is left at t = 14."""
    scene = Scene(np.stack([upright(3.0, 5.0), upright(0.0, 0.5)]), "two")
    ray = Rays([[10, 0.125, 0]], [[-1, 0, 0]])
    for packet in (True, False):
        options: dict[str, Any] = {
            "lists": 1, "threshold": 1.0, "generations": 1, "packet": packet, "order": "latest_last",
        }  # fmt: skip
        right, printed = (traced(scene, ray, **options, errata=name) for name in ("corrected", "BSH-E5"))
        assert (right.hits.triangle.tolist(), right.hits.t.tolist()) == ([0], [7.0])
        assert (printed.hits.triangle.tolist(), printed.hits.t.tolist()) == ([1], [10.0])
        # By its beginning the near one comes first, and nothing is lost
        options["order"] = "earliest_first"
        assert traced(scene, ray, **options, errata="BSH-E5").hits.triangle.tolist() == [0]


def test_the_exit_root_loses_and_never_gains() -> None:
    lost = 0
    for name in ("torus_knot_100", "cubes"):
        scene = mixed(name)
        rays = wild_rays(scene, 2000, 4)
        right, printed = (
            traced(scene, rays, lists=1, generations=1, errata=errata).hits for errata in ("corrected", "as_printed")
        )
        assert (printed.t >= right.t).all()
        lost += int((printed.t > right.t).sum())
    assert lost > 20


def test_heads_whatever_the_side_lose_what_is_refracted() -> None:
    scene = refsim.load_scene("sphere_192")
    rays = refsim.camera_rays(scene, 20, 20, fill=0.6)
    for heads in ("simple", "regular"):
        printed = traced(scene, rays, heads=heads, errata="BSH-E9", generations=2)
        right = traced(scene, rays, heads=heads, generations=2)
        inside = (right.generations[1].hits.triangle >= 0).sum()
        assert inside == (right.hits.triangle >= 0).sum() > 50
        assert (printed.generations[1].hits.triangle >= 0).sum() == 0


def test_heads_whatever_the_side_serve_mirrors() -> None:
    options: dict[str, Any] = {"heads": "regular", "material": "mirror", "facing": "front"}
    assert bits(traced(mixed(), eye_rays(), errata="BSH-E9", **options)) == bits(traced(mixed(), eye_rays(), **options))


@pytest.mark.parametrize(
    ("given", "printed"),
    [
        ("corrected", Printed()),
        ("as_printed", Printed(True, True)),
        ("BSH-E5", Printed(E5=True)),
        ("e9", Printed(E9=True)),
        ("BSH-E5, E9", Printed(True, True)),
        (["BSH-E9"], Printed(E9=True)),
    ],
)
def test_names(given: Any, printed: Printed) -> None:
    assert printed_text(given) == printed


@pytest.mark.parametrize("given", ["BSH-E1", "E55", "", 5, None, ["E5", "x"]])
def test_refusals(given: Any) -> None:
    with pytest.raises(InputError, match="is not known; choose from corrected, as_printed, BSH-E5, BSH-E9"):
        traced(mixed(), eye_rays(), errata=given)
