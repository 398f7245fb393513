"""Plan: the camera shoots one unit ray through each pixel centre of a picture that frames the scene.

- Every ray starts at the pinhole, half-diagonal / sin(fov / 2) * fill from the box's centre, has unit length, no limit.
- Seen from the pinhole, pixel (row, column) lies where a plain projection of its centre puts it; row 0 is the top.
- Pictures are mirror symmetric about the view axis, and the middle of an odd picture looks at the centre of the box.
- Scaling a scene by a power of two scales the pinhole and changes no direction; moving it changes none either.
- At fill 1 no vertex of the scene falls outside a square picture.
- The bits of a small picture are golden numbers; wrong arguments are refused by name.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim.errors import InputError
from refsim.scene import Scene, camera_frame, camera_rays, load_scene

BOX = load_scene("cornell_box")
COMPONENT = st.floats(-10.0, 10.0, width=32).map(lambda x: round(x, 3))
VIEWS = st.tuples(COMPONENT, COMPONENT, COMPONENT).filter(lambda v: max(map(abs, v)) > 0.01)
SIZES = st.integers(1, 17)
FOVS = st.floats(1.0, 170.0)
FILLS = st.floats(0.1, 4.0)


def box(lower: tuple[float, ...], upper: tuple[float, ...]) -> Scene:
    """Two triangles that span the box."""
    a, b = np.array(lower), np.array(upper)
    middle = (a + b) / 2 + [0.0, 0.0, 1e-3]
    return Scene(np.array([[a, b, middle], [b, a, middle]], np.float32))


@given(SIZES, SIZES, VIEWS, FOVS, FILLS)
def test_rays_are_unit_and_leave_the_pinhole(width: int, height: int, view, fov: float, fill: float) -> None:
    rays = camera_rays(BOX, width, height, view, fov, fill)
    assert (len(rays), rays.width, rays.height) == (width * height, width, height)
    assert np.abs(np.linalg.norm(rays.direction.astype(np.float64), axis=1) - 1.0).max() < 2e-7
    distance = math.sqrt(3.0) / math.sin(math.radians(fov) / 2) * fill
    wanted = distance * np.array(view) / np.linalg.norm(view)
    np.testing.assert_allclose(rays.origin, np.tile(wanted, (len(rays), 1)), rtol=0, atol=3e-7 * distance)
    assert np.isinf(rays.t_max).all()
    assert all(column.flags.c_contiguous and column.dtype == np.float32 for column in (rays.origin, rays.direction))


@given(SIZES, SIZES, VIEWS.filter(lambda v: math.hypot(v[0], v[2]) > 0.1), FOVS)
def test_pixel_centres_project_to_their_place(width: int, height: int, view, fov: float) -> None:
    rays = camera_rays(BOX, width, height, view, fov)
    forward = -np.array(view) / np.linalg.norm(view)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    assert up[1] > 0
    direction = rays.direction.astype(np.float64).reshape(height, width, 3)
    depth = direction @ forward
    # WebGPU's normalised device coordinates: x right, y up, the vertical field of view spans y from -1 to 1.
    focal = 1.0 / math.tan(math.radians(fov) / 2)
    x = direction @ right / depth * focal * height / width
    y = direction @ up / depth * focal
    np.testing.assert_allclose((x + 1) / 2 * width, np.tile(np.arange(width) + 0.5, (height, 1)), atol=2e-4 * width)
    rows = np.arange(height)[:, None] + 0.5
    np.testing.assert_allclose((1 - y) / 2 * height, np.tile(rows, (1, width)), atol=2e-4 * height)


@given(SIZES, SIZES, st.floats(-5.0, 5.0), FOVS)
def test_pictures_are_mirror_symmetric(width: int, height: int, rise: float, fov: float) -> None:
    direction = camera_rays(BOX, width, height, (0.0, rise, 1.0), fov).direction.reshape(height, width, 3)
    np.testing.assert_array_equal(direction[:, ::-1] * np.float32([-1, 1, 1]), direction)
    level = camera_rays(BOX, width, height, (0.0, 0.0, 1.0), fov).direction.reshape(height, width, 3)
    np.testing.assert_array_equal(level[::-1] * np.float32([1, -1, 1]), level)


@given(SIZES, SIZES, VIEWS)
def test_middle_of_an_odd_picture_looks_at_the_centre(half_width: int, half_height: int, view) -> None:
    scene = box((-1.0, 2.0, 3.0), (4.0, 2.5, 9.0))
    rays = camera_rays(scene, 2 * half_width + 1, 2 * half_height + 1, view)
    middle = len(rays) // 2
    np.testing.assert_allclose(rays.direction[middle], -np.array(view) / np.linalg.norm(view), atol=1e-7)
    to_center = scene.center - rays.origin[middle]
    np.testing.assert_allclose(to_center / np.linalg.norm(to_center), rays.direction[middle], atol=1e-6)


@given(st.integers(-40, 40), VIEWS, FOVS, FILLS)
def test_scaling_by_a_power_of_two_changes_no_direction(exponent: int, view, fov: float, fill: float) -> None:
    knot = load_scene("torus_knot_100")
    scale = np.float32(2.0**exponent)
    rays = camera_rays(knot, 7, 5, view, fov, fill)
    scaled = camera_rays(knot.replace(triangles=knot.triangles * scale), 7, 5, view, fov, fill)
    np.testing.assert_array_equal(scaled.direction, rays.direction)
    np.testing.assert_array_equal(scaled.origin, rays.origin * scale)


@given(VIEWS)
def test_view_has_no_length(view) -> None:
    rays = camera_rays(BOX, 4, 3, view)
    for factor in (2.0**-900, 2.0**900):
        long = camera_rays(BOX, 4, 3, np.array(view) * factor)
        np.testing.assert_array_equal(long.direction, rays.direction)


@given(VIEWS, st.floats(1.0, 120.0))
def test_fill_1_frames_the_whole_scene(view, fov: float) -> None:
    scene = box((-1.0, -2.0, -3.0), (4.0, 0.5, 9.0))
    corners = np.array([[(scene.lower, scene.upper)[k >> i & 1][i] for i in range(3)] for k in range(8)], np.float64)
    eye, right, up, forward = camera_frame(scene, view, fov)
    depth = (corners - eye) @ forward
    limit = math.tan(math.radians(fov) / 2) * (1 + 1e-9)
    assert (depth > 0).all()
    assert (np.abs((corners - eye) @ right) <= limit * depth).all()
    assert (np.abs((corners - eye) @ up) <= limit * depth).all()


@pytest.mark.parametrize(
    ("view", "top"), [((0, 1, 0), (0, 0, -1)), ((0, -3, 0), (0, 0, 1)), ((1e-9, 1, 0), (0, 0, -1))]
)
def test_straight_up_and_down_has_x_to_the_right(view, top) -> None:
    _, right, up, forward = camera_frame(BOX, view)
    np.testing.assert_allclose(right, (1, 0, 0), atol=1e-8)
    np.testing.assert_allclose(up, top, atol=1e-8)
    np.testing.assert_allclose(forward, -np.array(view) / np.linalg.norm(view))
    assert np.isfinite(camera_rays(BOX, 3, 3, view).direction).all()


def test_default_view_is_golden() -> None:
    # Worked out apart from the code: pixel offsets turned by the view's elevation, then by its azimuth.
    rays = camera_rays(BOX, 3, 2)
    np.testing.assert_allclose(rays.origin[0], (1.41517364, 1.17931137, 4.71724547), atol=3e-7)
    wanted = [
        (-0.59302536, -0.05176921, -0.80351781),
        (-0.28691313, -0.05498825, -0.95637710),
        (0.05279118, -0.05176921, -0.99726277),
        (-0.57046635, -0.37962677, -0.72832112),
    ]
    np.testing.assert_allclose(rays.direction[:4], wanted, atol=1e-7)


CORRECT = {"width": 4, "height": 3, "view": (0.3, 0.25, 1.0), "fov": 40.0, "fill": 1.0}
WRONG = {
    "control": ({}, None),
    "NumPy numbers": ({"width": np.int64(4), "fov": np.float32(40)}, None),
    "no width": ({"width": 0}, "width must be a whole number"),
    "negative height": ({"height": -2}, "height must be a whole number"),
    "half a pixel": ({"width": 2.5}, "width must be a whole number"),
    "width in words": ({"width": "4"}, "width must be a whole number"),
    "truth": ({"height": True}, "height must be a whole number"),
    "most rays": ({"width": 2**15, "height": 2**13 + 1}, "more than 268435456 rays"),
    "beyond int64": ({"width": 2**40, "height": 2**40}, "more than 268435456 rays"),
    "flat field": ({"fov": 0.0}, "fov must be an angle"),
    "half turn": ({"fov": 180.0}, "fov must be an angle"),
    "field NaN": ({"fov": math.nan}, "fov must be an angle"),
    "field in words": ({"fov": "wide"}, "fov must be an angle"),
    "no fill": ({"fill": 0.0}, "fill must be a finite number above 0"),
    "negative fill": ({"fill": -1.0}, "fill must be a finite number above 0"),
    "infinite fill": ({"fill": math.inf}, "fill must be a finite number above 0"),
    "absurd fill": ({"fill": 1e39}, "outside the range of float32"),
    "zero view": ({"view": (0, 0, 0)}, "view must be a direction"),
    "view NaN": ({"view": (0, math.nan, 1)}, "view must be three finite numbers"),
    "two numbers": ({"view": (0, 1)}, "view must be three finite numbers"),
    "view in words": ({"view": "top"}, "view must be three finite numbers"),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("row", WRONG)
def test_arguments(row: str) -> None:
    changed, message = WRONG[row]
    arguments = {**CORRECT, **changed}
    if message is None:
        assert len(camera_rays(BOX, **arguments)) == 12
        return
    with pytest.raises(InputError, match=message):
        camera_rays(BOX, **arguments)
