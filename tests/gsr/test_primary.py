"""Plan: what is rasterised through the rays' camera is what the rays hit first.

- The drawn triangle is the one hit first, naive search deciding. Wherever they differ, the sub-pixel grid explains it:
  drawn and hit triangle both reach within its step of the pixel's centre, and one of them ends there or both are
  equally near there. The judge is not blind: exchanged or missing triangles are named.
- Only fronts when asked, for a mirrored camera too; the first of equal triangles; nothing nearer than the near plane;
  the same for any number of threads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

import refsim
from refsim.counters import Counters
from refsim.papers.geometry_shader_rays.primary import NEAR, first_triangles
from refsim.scene import Scene, load_scene
from tests.gsr.cameras import View, rays_of


class Footprint(NamedTuple):
    """What a triangle is to a pixel: it reaches the square about its centre, it covers all of it, it covers the centre,
    and its least and greatest inverse distance there."""

    reaches: bool
    covers: bool
    middle: bool
    inverse: tuple[float, float]


def footprint(view: View, triangle: int, x: int, y: int) -> Footprint:
    """By separating axes of the triangle and the square of ± slack about the pixel's centre, in float64."""
    eye, matrix = view.matrix()
    corners = view.scene.triangles[triangle].astype(np.float64) - eye
    screen = corners @ np.linalg.inv(matrix).T  # w · (pixel x, pixel y, 1)
    here, slack = np.array([x + 0.5, y + 0.5, 1.0]), view.slack()
    side = np.linalg.det(screen)
    reaches, covers, middle = side != 0, side != 0, side != 0
    for k in range(3):
        edge = np.cross(screen[k - 2], screen[k - 1]) * np.sign(side)
        reach = slack * (abs(edge[0]) + abs(edge[1]))
        value = float(edge @ here)
        reaches, covers, middle = reaches and value >= -reach, covers and value >= reach, middle and value >= 0
    if (screen[:, 2] > 0).all():  # else it has no box on the screen
        flat = screen[:, :2] / screen[:, 2:]
        reaches = reaches and bool(
            (flat.min(axis=0) <= here[:2] + slack).all() and (flat.max(axis=0) >= here[:2] - slack).all()
        )
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    plane = normal @ matrix / (normal @ corners[0])
    spread = slack * (abs(plane[0]) + abs(plane[1]))
    return Footprint(bool(reaches), bool(covers), bool(middle), (plane @ here - spread, plane @ here + spread))


def unexplained(view: View, drawn: np.ndarray, hit: np.ndarray) -> list[tuple[int, int, int, int]]:
    """(x, y, drawn, hit) where the two differ and the sub-pixel grid does not explain it."""
    found = []
    for y, x in np.argwhere(drawn != hit):
        pair = [footprint(view, int(k), x, y) for k in (drawn[y, x], hit[y, x]) if k >= 0]
        # float32 keeps inverse distances to 2^-23 or so; both tests compare them.
        a, b = pair[0].inverse, pair[-1].inverse
        tie = len(pair) == 2 and max(a[0], b[0]) <= min(a[1], b[1]) * (1 + 2.0**-20)
        ends = not all(part.covers for part in pair)
        if not (all(part.reaches for part in pair) and (ends or tie)):
            found.append((int(x), int(y), int(drawn[y, x]), int(hit[y, x])))
    return found


def pictures(view: View, facing: str = "both") -> tuple[np.ndarray, np.ndarray]:
    """Triangles drawn, and hit by naive search."""
    rays = view.rays()
    drawn = first_triangles(view.scene, rays, Counters(), facing=facing).data
    assert drawn.dtype == np.int32 and drawn.shape == (1, *view.size[::-1])
    hits = refsim.trace("brute_force", view.scene, rays, generations=1, facing=facing).hits
    return drawn[0], hits.triangle.reshape(view.size[::-1])


INSIDE = ((0.2, 0.1, 1.0), 70.0, 0.12)
VIEWS = {
    "knot on ground": View(load_scene("knot_on_ground"), (192, 192)),
    "knot on ground, mirrored": View(load_scene("knot_on_ground"), (96, 64), mirrored=True),
    "knight": View(load_scene("knight_in_box"), (160, 128)),
    "knight, from within": View(load_scene("knight_in_box"), (96, 96), ((0.5, 0.3, 1.0), 110.0, 0.3)),
    "box": View(load_scene("cornell_box"), (128, 128)),
    "box, from within": View(load_scene("cornell_box"), (96, 64), INSIDE),
    "room, wide": View(load_scene("room"), (64, 96), ((-0.4, 0.5, 1.0), 150.0, 0.1)),
    "fine knot": View(load_scene("torus_knot_5000"), (96, 96)),
    "narrow": View(load_scene("torus_knot_1024"), (96, 96), ((0.3, 0.25, 1.0), 1.0, 0.5)),
    "ground from above": View(load_scene("cubes"), (96, 96), ((0.0, 1.0, 0.0), 40.0, 1.0)),
}


@pytest.mark.parametrize("name", VIEWS)
def test_the_rasteriser_draws_what_rays_hit(name: str, record_property) -> None:
    view = VIEWS[name]
    drawn, hit = pictures(view)
    assert unexplained(view, drawn, hit) == []
    differ = drawn != hit
    both = sum(footprint(view, drawn[y, x], x, y).middle for y, x in np.argwhere(differ & (drawn >= 0)))
    record_property("differing", f"{differ.sum()} of {differ.size}; in {both} of them the ray hits the drawn one too")
    # Of the pixels that a border crosses, those differ whose centre it passes within the slack: 2 of 512 a border.
    assert differ.mean() < 0.004 and (hit >= 0).sum() > 1000


def test_some_pixels_differ() -> None:
    counts = [int((np.subtract(*pictures(VIEWS[name])) != 0).sum()) for name in ("knot on ground", "fine knot")]
    assert min(counts) > 0, "the explanation is put to use"


@pytest.mark.parametrize("mirrored", [False, True])
def test_only_fronts(mirrored: bool) -> None:
    opened = Scene(load_scene("torus_knot_1024").triangles[::2])  # holes show backs
    view = View(opened, (64, 64), mirrored=mirrored)
    (both, _), (front, hit) = pictures(view), pictures(view, "front")
    assert unexplained(view, front, hit) == []
    assert (front != hit).mean() < 0.004 and (both != front).mean() > 0.05


def test_the_judge_sees_what_is_wrong() -> None:
    view = VIEWS["knight"]._replace(size=(48, 40))
    drawn, hit = pictures(view)
    # Of the largest triangle in the picture the border is a small part.
    largest = int(np.bincount(drawn[drawn >= 0]).argmax())
    mine = drawn == largest
    for wrong in (np.where(mine, -1, drawn), np.where(mine, largest + 1, drawn), np.roll(drawn, 1, axis=1)):
        judged = np.isin(np.arange(drawn.size), [y * view.size[0] + x for x, y, *_ in unexplained(view, wrong, hit)])
        assert judged[(wrong != hit).ravel()].mean() > 0.95


def wall(distance: float, half: float = 4.0) -> np.ndarray:
    """A triangle across the view of `AHEAD`, at z = −distance."""
    reach = half * distance
    return np.float32([[(-reach, -reach, -distance), (reach, -reach, -distance), (0.0, 2 * reach, -distance)]])


AHEAD = rays_of((0, 0, 0), np.diag([0.5, 0.5, -1.0]), 16, 16)


def test_of_equal_triangles_the_first_is_drawn() -> None:
    scene = Scene(np.concatenate([wall(2.0), wall(1.0), wall(1.0), wall(3.0)]))
    assert (first_triangles(scene, AHEAD, Counters()).data == 1).all()
    scene = scene.replace(triangles=scene.triangles[::-1])
    assert (first_triangles(scene, AHEAD, Counters()).data == 1).all()


@pytest.mark.parametrize(("ratio", "drawn"), [(0.5, 1), (0.99, 1), (1.01, 0), (4.0, 0)])
def test_the_near_plane(ratio: float, drawn: int) -> None:
    far = wall(1.0)
    farthest = float(np.linalg.norm(np.abs(far).max(axis=(0, 1)).astype(np.float64)))
    scene = Scene(np.concatenate([wall(ratio * NEAR * farthest), far]))
    assert (first_triangles(scene, AHEAD, Counters()).data == drawn).all()


def test_distances_are_told_apart_by_their_ratio() -> None:
    # From just behind the near plane to the farthest wall: always the nearer one, listed last.
    for distance in (1.0, 2.0**-6, 2.0**-12, 2.0**-16):
        pair = np.concatenate([wall(distance * (1 + 2.0**-21)), wall(distance)])
        scene = Scene(np.concatenate([wall(1.5), pair]))
        assert (first_triangles(scene, AHEAD, Counters()).data == 2).all(), distance


def test_nothing_there_and_counters() -> None:
    counters = Counters()
    scene = Scene(wall(1.0) * np.float32([1, 1, -1]))  # behind the eye
    assert (first_triangles(scene, AHEAD, counters).data == -1).all()
    assert counters["raster.primitives"] == 1 and counters["raster.clipped"] == 1 and counters["draw.calls"] == 1


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_threads_do_not_matter(threads: int) -> None:
    view = VIEWS["fine knot"]
    drawn = first_triangles(view.scene, view.rays(), Counters(), threads).data
    np.testing.assert_array_equal(drawn, first_triangles(view.scene, view.rays(), Counters()).data)
