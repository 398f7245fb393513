"""Configurations of Table 2 and section 4.1: with a geometry shader, without one, and all in the geometry shader.

Plan
- Without a geometry shader: the picture of one pass, its rays and hits, and no geometry stage at all.
- Intersection in the geometry shader: the same bits everywhere, the same buffer and the same counts; the work stands in
  the other stage, which only a tap of the vertex shader shows.
- Listing 3 as printed makes eye rays 90 degrees wide (E12), whatever the rays; and all errata together.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from refsim import camera_rays
from refsim.counters import Counters
from refsim.errors import InputError
from refsim.pipeline.taps import Taps
from refsim.results import Generation, Trace
from refsim.scene import PointLight
from refsim.scene.camera import camera_frame
from tests.gsr.scenes import FLOOR, SHINY, assembled, cornell, cornell_rays, court, court_rays, quad, soup, traced, wild

COLUMNS = ("alive", "kind", "pixel", "parent", "node", "light", "weight")


def assert_same_generation(a: Generation, b: Generation) -> None:
    for column in COLUMNS:
        assert getattr(a, column).tobytes() == getattr(b, column).tobytes(), column
    for column in ("origin", "direction", "t_max"):
        assert getattr(a.rays, column).tobytes() == getattr(b.rays, column).tobytes(), column
    for column in ("triangle", "t", "u", "v"):
        assert getattr(a.hits, column).tobytes() == getattr(b.hits, column).tobytes(), column
    assert all(a.per_ray[name].tobytes() == b.per_ray[name].tobytes() for name in a.per_ray)


def image_of(trace: Trace) -> np.ndarray:
    assert trace.image is not None
    return trace.image


@cache
def one_light(stages: str, passes: int) -> Trace:
    return traced(cornell(), cornell_rays(), passes=passes, lights=1, stages=stages)


def test_without_a_geometry_shader() -> None:
    """What is hit is shaded at once; nothing is captured."""
    alone, passing = one_light("vertex_only", 1), one_light("vertex", 1)
    assert image_of(alone).tobytes() == image_of(passing).tobytes()
    assert_same_generation(alone.generations[0], passing.generations[0])
    missed = int((alone.hits.triangle < 0).sum())
    assert 0 < missed == alone.counters["fragment.discarded"] and passing.counters["fragment.discarded"] == 0
    for name in ("geometry.invocations", "stream_output.generated", "stream_output.primitives"):
        assert alone.counters[name] == 0 < passing.counters[name]
    occupancy = alone.generations[0].occupancy
    assert occupancy is not None and occupancy.vertices == 0


def test_a_missing_geometry_shader_spawns_nothing() -> None:
    for passes in (2, None):
        with pytest.raises(InputError, match="needs passes=1"):
            traced(court(), court_rays(), passes=passes, stages="vertex_only")


def assert_counts_move(apart: Counters, together: Counters) -> None:
    """All counts are the same, but that the vertex shader's operations are now the geometry shader's."""
    moved = {f"{stage}.{what}" for stage in ("vertex", "geometry") for what in ("arithmetic", "fetches")}
    assert {n: c for n, c in apart.items() if n not in moved} == {n: c for n, c in together.items() if n not in moved}
    for what in ("arithmetic", "fetches"):
        assert apart[f"vertex.{what}"] > 0 == together[f"vertex.{what}"]
        both = apart[f"vertex.{what}"] + apart[f"geometry.{what}"]
        assert together[f"geometry.{what}"] == both


@pytest.mark.parametrize("passes", [1, 2, 4])
def test_all_in_the_geometry_shader(passes: int) -> None:
    apart, together = one_light("vertex", passes), one_light("geometry", passes)
    assert image_of(apart).tobytes() == image_of(together).tobytes()
    for a, b in zip(apart.generations, together.generations, strict=True):
        assert_same_generation(a, b)
        assert_counts_move(a.counters, b.counters)
        assert a.occupancy == b.occupancy
    assert_counts_move(apart.counters, together.counters)


def test_the_work_is_in_the_other_stage() -> None:
    """What leaves the vertex shader: hits in one configuration, the records as drawn in the other."""
    held = {}
    for stages in ("vertex", "geometry"):
        taps = Taps("vertex")
        traced(court(), court_rays(), passes=1, stages=stages, taps=taps)
        held[stages] = taps.vertex[0].varyings
    assert (held["vertex"]["dir_idx"][:, 3] >= 0).sum() == 7 and (held["vertex"]["uv_state"][:, 2] == 1).all()
    assert (held["geometry"]["dir_idx"][:, 3] == -1).all() and (held["geometry"]["uv_state"][:, 2] == 0).all()
    assert np.isinf(held["geometry"]["orig_t"][:, 3]).all()


@pytest.mark.parametrize(("width", "height"), [(6, 4), (5, 5), (4, 9)])
@pytest.mark.parametrize("fov", [20.0, 75.0])
def test_printed_eye_rays_are_90_degrees_wide(width: int, height: int, fov: float) -> None:
    """E12: the ray of NDC (x, y) runs along x · right + y · up + forward, unit axes, whatever fov and picture are."""
    scene = soup(2, 8, (SHINY,))
    given = camera_rays(scene, width, height, fov=fov)
    eye, right, up, forward = camera_frame(scene, fov=fov)
    x, y = np.meshgrid((np.arange(width) + 0.5) / width * 2 - 1, 1 - (np.arange(height) + 0.5) / height * 2)
    expected = x.reshape(-1, 1) * right + y.reshape(-1, 1) * up + forward
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    first = traced(scene, given, passes=2, errata="GSR-E12").generations[0]
    # The axes are fitted to float32 rays (2**-20 radians), whose narrow fan at 20 degrees widens the error five times
    assert np.abs(first.rays.direction - expected).max() <= 5 * 2.0**-20
    assert np.abs(first.rays.origin - eye).max() <= 1e-6 * max(np.abs(eye).max(), 1)
    assert np.isinf(first.rays.t_max).all()
    # The hits are those of the rays that were made
    shot = traced(scene, first.rays, passes=2).generations[0]
    assert (
        shot.hits.triangle.tobytes() == first.hits.triangle.tobytes()
        and shot.hits.t.tobytes() == first.hits.t.tobytes()
    )


def test_printed_eye_rays_need_a_camera() -> None:
    with pytest.raises(InputError, match="pinhole"):
        traced(soup(2, 8, (SHINY,)), wild(5, 4, 2), errata="GSR-E12")


def test_everything_as_printed() -> None:
    """A wall all around, a lamp between it and the eye, a small screen before the lamp. As printed: what is lit adds to
    the background, what the screen shadows is white; every surface reflects, and what is reflected leaves unseen."""
    wall = quad((-40, -40, -1), (40, -40, -1), (40, 40, -1), (-40, 40, -1))
    screen = quad((-0.25, -0.25, 0), (0.25, -0.25, 0), (0.25, 0.25, 0), (-0.25, 0.25, 0))
    lamp = PointLight((0.0, 0.0, 1.0))
    scene = assembled("screen", [(wall, FLOOR), (screen, FLOOR)], lamp)
    rays = camera_rays(scene, 9, 7, view=(0, 0, 1), fov=100.0, fill=0.02)
    trace = traced(scene, rays, passes=2, errata="as_printed")
    first = trace.generations[0]
    hit = first.hits.triangle >= 0
    assert hit.all()
    point = first.rays.origin + first.rays.direction.astype(np.float64) * first.hits.t[:, None]
    towards = np.array(lamp.position) - point
    cosine = towards[:, 2] / np.linalg.norm(towards, axis=1)
    printed = np.array([0.1, 0.12, 0.15]) + (0.2 + cosine[:, None]) * np.array(FLOOR.color)
    # Seen from the lamp the screen covers half the wall's distance: its shadow reaches from −0.5 to 0.5
    shadow = (np.abs(point[:, :2]).max(axis=1) < 0.5) & (first.hits.triangle < 2)
    expected = np.where(shadow[:, None], 1.0, printed)
    assert np.abs(image_of(trace).reshape(-1, 3) - expected).max() <= 2e-6
    assert trace.counters["rays.reflected"] == 63 and trace.counters["geometry.passed_reflected"] == 0
