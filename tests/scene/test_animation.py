"""Plan: 198 frames of 646 triangles in a box, the same everywhere, and a light that goes round a scene.

- Every frame: 646 triangles, walls unmoved, every part of the knight closed and wound outward, inside the box and on
  the floor, as long in every edge as in the first frame (parts move, they do not bend).
- Frames differ from each other, run smoothly into the next, the last into the first; frame n + count is frame n, and
  half as many frames are every other frame.
- The bits do not depend on the last bits of the machine's sine, and equal a golden hash.
- Every ray of the default view at fill 0.55 hits something.
- The light's way: within the box, closed, even, between the heights asked for; colour and intensity stay.
- Wrong counts and frames are refused.
"""

from __future__ import annotations

import hashlib
import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.errors import InputError
from refsim.scene import PointLight, Scene, animation, camera_rays, load_scene, shapes
from refsim.scene.animation import FRAMES, KNIGHT_TRIANGLES, Beat, frames, knight_in_box, moving_light
from tests.scene.test_library import edges, hit

ALL = list(frames())
CORNERS = np.array([scene.triangles for scene in ALL], np.float64)
WALLS = 10
# Triangles of the parts in order: hips; both legs; trunk, belt, head, visor, plume; shield arm; sword arm.
PARTS = [12, *[36, 36, 12] * 2, 80, 48, 64, 12, 12, 36, 36, 12, 36, 36, 36, 12, 12, 12, 12]


def test_every_frame_has_the_triangles_of_the_paper() -> None:
    assert len(ALL) == FRAMES == 198 and {len(scene) for scene in ALL} == {KNIGHT_TRIANGLES} == {646}
    assert sum(PARTS) + WALLS == 646
    for scene in ALL:
        assert scene.materials == ALL[0].materials and not scene.degenerate.any()
        np.testing.assert_array_equal(scene.material_ids, ALL[0].material_ids)
        np.testing.assert_array_equal(scene.triangles[:WALLS], ALL[0].triangles[:WALLS])


def test_he_is_in_the_box_and_on_the_floor() -> None:
    knight = CORNERS[:, WALLS:]
    margin = 16 * ALL[0].epsilon
    assert np.abs(knight).max() < 1 - margin
    np.testing.assert_allclose(knight[..., 1].min(axis=(1, 2)), animation.FLOOR, atol=1e-6)


@settings(max_examples=20)
@given(st.integers(0, FRAMES - 1))
def test_parts_are_closed_and_turned_outward(frame: int) -> None:
    first = WALLS
    for size in PARTS:
        part = ALL[frame].triangles[first : first + size]
        counts = edges(part)
        assert set(counts.values()) == {1} and all((end, start) in counts for start, end in counts)
        a, b, c = np.moveaxis(part - part.mean(axis=(0, 1)), 1, 0)
        assert (a * np.cross(b, c)).sum() > 0
        first += size


def test_parts_move_and_do_not_bend() -> None:
    lengths = np.linalg.norm(np.roll(CORNERS, 1, axis=2) - CORNERS, axis=3)
    np.testing.assert_allclose(lengths, np.broadcast_to(lengths[0], lengths.shape), atol=1e-6)


def test_frames_differ_and_run_on_smoothly() -> None:
    assert len({scene.triangles.tobytes() for scene in ALL}) == FRAMES
    step = np.roll(CORNERS, -1, axis=0) - CORNERS  # the last row: from the last frame to the first
    farthest = np.abs(step).max(axis=(1, 2, 3))
    assert (farthest > 0.005).all() and (farthest < 0.12).all()
    # No jerk at the seam: it changes as little from step to step there as elsewhere.
    jerk = np.abs(np.roll(step, -1, axis=0) - step).max(axis=(1, 2, 3))
    assert jerk[[-2, -1]].max() <= jerk[:-2].max()


@given(st.integers(-3, 3), st.integers(0, FRAMES - 1))
def test_frames_repeat(rounds: int, frame: int) -> None:
    again = knight_in_box(frame + rounds * FRAMES)
    assert again.triangles.tobytes() == ALL[frame].triangles.tobytes()
    half = knight_in_box(frame, FRAMES // 2)
    assert half.triangles.tobytes() == ALL[2 * frame % FRAMES].triangles.tobytes()


def test_frame_0_is_in_the_library() -> None:
    scene = load_scene("knight_in_box")
    assert scene.triangles.tobytes() == ALL[0].triangles.tobytes() and scene.materials == ALL[0].materials


def digest(scenes: list[Scene]) -> str:
    return hashlib.sha256(b"".join(scene.triangles.astype("<f4").tobytes() for scene in scenes)).hexdigest()


def test_bits_are_golden() -> None:
    assert digest(ALL) == "f17a58e570a48ec767cc552f9b5c28b0cc9ba7dbc43732d2a03974a57df02bee"


@pytest.mark.parametrize("towards", [math.inf, -math.inf])
def test_the_last_bits_of_a_sine_do_not_matter(towards: float, monkeypatch: pytest.MonkeyPatch) -> None:
    exact = shapes.sphere(6, 3)[0]
    other = SimpleNamespace(**vars(np))
    other.sin = lambda x: np.nextafter(np.sin(x), towards)
    other.cos = lambda x: np.nextafter(np.cos(x), towards)
    monkeypatch.setattr(shapes, "np", other)
    assert (shapes.sphere(6, 3)[0] != exact).any(), "the sine is another one"
    animation._body.cache_clear()
    try:
        assert digest([knight_in_box(frame) for frame in range(0, FRAMES, 30)]) == digest(ALL[::30])
    finally:
        animation._body.cache_clear()


def test_every_ray_of_the_default_view_hits_something() -> None:
    rays = camera_rays(ALL[0], 512, 512, fill=0.55)
    eye, direction = rays.origin[0].astype(np.float64), rays.direction.astype(np.float64)
    # All enter the cube by its open side, so they meet one of the five others: rays through the rim say it for all.
    entry = eye + direction * ((1 - eye[2]) / direction[:, 2])[:, None]
    assert eye[2] > 1 and (np.abs(entry[:, :2]) < 1).all()
    few = camera_rays(ALL[0], 16, 16, fill=0.55)
    assert hit(ALL[0].triangles[:WALLS], eye, few.direction).all()
    assert hit(ALL[0].triangles[WALLS:], eye, few.direction).mean() > 0.08, "he can be seen"


@given(st.integers(1, 400), st.integers(0, 400), st.integers(0, 12))
def test_the_wave_is_nearly_a_sine(count: int, step: int, times: int) -> None:
    beat = Beat(step, count)
    assert abs(beat.wave(times) - math.sin(math.tau * times * step / count)) < 0.0017
    sine, cosine = beat.heading()
    assert abs(math.hypot(sine, cosine) - 1) < 1e-15


@given(
    st.sampled_from(["knot_on_ground", "cornell_box", "knight_in_box"]),
    st.integers(3, 100),
    st.floats(0.1, 1.0),
    st.floats(-1.0, 1.0),
    st.floats(-1.0, 1.0),
)
def test_the_light_goes_round_within_the_box(name: str, count: int, around: float, low: float, high: float) -> None:
    lamp = PointLight((0.0, 9.0, 0.0), (1.0, 0.5, 0.25), 3.0)
    scene = load_scene(name).replace(lights=(lamp, lamp))
    lights = moving_light(scene, count, around=around, low=low, high=high)
    place = np.array([light.position for light in lights])
    assert len(lights) == count and {(light.color, light.intensity) for light in lights} == {(lamp.color, 3.0)}
    offset = (place - scene.center) / ((scene.upper.astype(np.float64) - scene.lower) / 2)
    assert np.abs(offset).max() <= 1 + 1e-12
    np.testing.assert_allclose(np.hypot(offset[:, 0], offset[:, 2]), around, rtol=1e-9)
    assert offset[:, 1].min() >= min(low, high) - 1e-9 and offset[:, 1].max() <= max(low, high) + 1e-9
    np.testing.assert_allclose(offset[0], [0, high, around], atol=1e-9)
    # Counter-clockwise from above, once: equal steps that add up to one turn, the last to the first too.
    angle = np.unwrap(np.arctan2(offset[:, 0], offset[:, 2]), period=math.tau)
    steps = np.diff(np.append(angle, angle[0] + math.tau))
    np.testing.assert_allclose(steps, math.tau / count, atol=0.02)


def test_the_light_reaches_both_heights() -> None:
    scene = load_scene("knot_on_ground")
    lights = moving_light(scene, 48)
    y = np.array([light.position[1] for light in lights])
    half = (float(scene.upper[1]) - float(scene.lower[1])) / 2
    np.testing.assert_allclose([y.max(), y.min()], scene.center[1] + half * np.array([0.9, -0.4]), rtol=1e-9)
    assert moving_light(scene.replace(lights=()), 1)[0].radiance == (1.0, 1.0, 1.0)


REFUSED = {
    "no frames": (lambda: frames(0), "count must be a whole number from 1, not 0"),
    "half a frame": (lambda: knight_in_box(0.5), "frame must be a whole number, not 0.5"),
    "true": (lambda: knight_in_box(True), "frame must be a whole number, not True"),
    "count of half": (lambda: knight_in_box(0, 1.5), "count must be a whole number from 1, not 1.5"),
    "no lights": (lambda: moving_light(ALL[0], 0), "count must be a whole number from 1, not 0"),
    "NaN": (lambda: moving_light(ALL[0], around=math.nan), "around, low and high must be finite numbers, not nan"),
}


@pytest.mark.parametrize("row", REFUSED)
def test_wrong_arguments_are_refused(row: str) -> None:
    call, message = REFUSED[row]
    with pytest.raises(InputError, match=message):
        call()
