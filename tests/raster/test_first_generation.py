"""A rasterised first generation is the ray-traced one.

Plan
- The triangles of a scene, drawn with the camera's projection and the nearest depth kept, give at every pixel the
  triangle that the camera's ray hits first (brute force). Where the two differ, one of the two triangles is shown to
  pass its border so near to the pixel centre that the sub-pixel grid and float32 may decide it, or both to lie at
  depths that the same movement of a corner brings to touch.
- The library's scenes, from outside and from inside (most of the scene is clipped then); the real meshes that are
  present, so near that triangles are some pixels large; absent ones read missing.
- The judge of differences is not blind: on the same picture with two triangles' numbers exchanged, or a triangle left
  out, it names the pixels.
"""

from typing import NamedTuple

import numpy as np
import pytest

import refsim
from refsim.reference import clip
from refsim.scene import Scene, camera_rays, load_scene
from refsim.scene.camera import camera_frame
from tests.raster import exact_values
from tests.raster.certainty import UNIT, certain_coverage, movement, to_screen
from tests.raster.drawing import NEAREST, NOTHING, Screen, rasterise
from tests.scenes_present import real_scene

SCREEN = Screen(56, 48)
SLACK_OF_RAYS = 1e-3  # pixels; float32's directions and intersections, far below a sub-pixel step


class View(NamedTuple):
    """A camera's arguments."""

    view: tuple[float, float, float] = (0.3, 0.25, 1.0)
    fov: float = 40.0
    fill: float = 1.0


def projected(scene: Scene, view: View) -> np.ndarray:
    """Clip positions f32 [n, 3, 4] of the scene's triangles as that camera sees them."""
    eye, right, up, forward = camera_frame(scene, *view)
    half = np.tan(np.radians(view.fov) / 2)
    seen = scene.triangles.astype(np.float64) - eye
    w = seen @ forward
    reach = scene.diagonal / 2
    middle = float((scene.center - eye) @ forward)
    near, far = max(middle - 1.01 * reach, 1e-3 * reach), middle + 1.01 * reach
    x, y = seen @ right / half * SCREEN.height / SCREEN.width, seen @ up / half
    return np.stack([x, y, (w - near) * far / (far - near), w], axis=-1).astype(np.float32)


def border_is_near(position: np.ndarray, x: int, y: int) -> bool:
    """Whether a triangle's border may, by the movement of its corners, be on either side of that pixel's centre."""
    left = clip.clip(position, SCREEN.viewport) @ position.astype(np.float64)
    _, doubtful = certain_coverage(left, SCREEN.viewport, (x, y, x + 1, y + 1), SLACK_OF_RAYS)
    return bool(doubtful[0, 0])


def covers(position: np.ndarray, x: int, y: int) -> bool:
    """Whether a triangle covers that pixel in float64."""
    left = clip.clip(position, SCREEN.viewport) @ position.astype(np.float64)
    inside, _ = certain_coverage(left, SCREEN.viewport, (x, y, x + 1, y + 1))
    return bool(inside[0, 0])


def depths_touch(positions: np.ndarray, x: int, y: int) -> bool:
    """Whether the depths of two triangles [2, 3, 4] at that pixel, their corners moved, may be equal."""
    intervals = []
    for position in positions:
        left = clip.clip(position, SCREEN.viewport) @ position.astype(np.float64)
        slack = movement(to_screen(left, SCREEN.viewport), SCREEN.viewport).max() + SLACK_OF_RAYS
        weights = exact_values.weights_around(position, SCREEN.viewport, np.array([x]), np.array([y]), slack)
        intervals.append(exact_values.depths(weights, position, SCREEN.viewport))
    a, b = intervals
    overlap = max(a.low[0], b.low[0]) <= min(a.high[0], b.high[0]) + 16 * UNIT
    return bool(overlap or not (a.exists[0] and b.exists[0]))


def unexplained(position: np.ndarray, drawn: np.ndarray, traced: np.ndarray) -> list[tuple[int, int, int, int]]:
    """(x, y, drawn triangle, traced triangle) of differences that no rounding explains; −1 is none."""
    found = []
    for y, x in np.argwhere(drawn != traced):
        pair = [int(k) for k in (drawn[y, x], traced[y, x]) if k >= 0]
        if any(border_is_near(position[k], x, y) for k in pair):
            continue
        tie = len(pair) == 2 and all(covers(position[k], x, y) for k in pair) and depths_touch(position[pair], x, y)
        if not tie:
            found.append((int(x), int(y), int(drawn[y, x]), int(traced[y, x])))
    return found


def pictures(scene: Scene, view: View) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(clip positions, triangles drawn, triangles traced)."""
    position = projected(scene, view)
    drawn = rasterise(SCREEN, position, pipe=NEAREST, tap=False).framebuffer.color("id")[0]
    rays = camera_rays(scene, SCREEN.width, SCREEN.height, *view)
    traced = refsim.trace("brute_force", scene, rays, generations=1).hits.triangle.reshape(drawn.shape)
    return position, np.where(drawn == NOTHING, -1, drawn), traced


INSIDE = View((0.2, 0.1, 1.0), 70.0, 0.12)
CASES = [
    ("cornell_box", View()),
    ("cornell_box", INSIDE),
    ("torus_knot_1024", View()),
    ("torus_knot_1024", View((1.0, 0.4, -0.2), 25.0, 0.5)),
    ("room", View((-0.4, 0.5, 1.0), 60.0, 0.7)),
    ("room", INSIDE),
    ("cubes", View()),
    ("cubes", View((0, 1, 0))),
    ("sphere", View()),
    ("blob", View(fill=0.55)),
]


@pytest.mark.parametrize(("name", "view"), CASES)
def test_library_scene(name, view):
    position, drawn, traced = pictures(load_scene(name), view)
    assert unexplained(position, drawn, traced) == []
    assert (drawn == traced).mean() > 0.97 and (traced >= 0).sum() > 300


@pytest.mark.parametrize("name", ["bunny", "suzanne", "teapot", "horse"])
def test_real_mesh(name, record_property):
    scene = real_scene(name)
    record_property(name, "missing" if scene is None else "present")
    if scene is None:
        return
    near = View((0.3, 0.25, 1.0), 3.0, 0.06 if len(scene) > 10_000 else 0.3)
    position, drawn, traced = pictures(scene, near)
    assert unexplained(position, drawn, traced) == []
    assert (drawn == traced).mean() > 0.95 and (traced >= 0).sum() > 300


def test_the_judge_sees_what_is_wrong():
    position, drawn, traced = pictures(load_scene("torus_knot_1024"), View())
    common = np.bincount(drawn[drawn >= 0]).argsort()[::-1]
    a, b = int(common[0]), int(common[1])
    exchanged = np.where(drawn == a, b, np.where(drawn == b, a, drawn))
    assert len(unexplained(position, exchanged, traced)) > 0.7 * ((drawn == a) | (drawn == b)).sum()
    left_out = np.where(drawn == a, -1, drawn)
    assert len(unexplained(position, left_out, traced)) > 0.7 * (drawn == a).sum()
