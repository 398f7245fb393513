"""Plan: the program on the page docs/conventions.md computes what the pipeline computes, to the bit.

- Frames: the camera looks along −z, NDC's upper left corner is the first pixel's.
- Random triangles, half of whose corners lie on multiples of half a pixel so that edges run through centres: corners,
  coverage, varyings of all three interpolations and depths are those of a draw, with depth bias and in both formats.
- Triangles through every clipping plane: pieces, coverage, varyings and depths likewise.
- The top-left table, an edge through a centre for each direction; points; 8-bit and depth rounding of special values.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
import pytest
from numba import njit

import refsim
from refsim.pipeline.blend import to_unorm8
from refsim.pipeline.clip import CORNER, MOST_CORNERS, PLANES, clip_polygon, distance
from refsim.pipeline.draw import draw
from refsim.pipeline.enums import DepthStencilFormat
from refsim.pipeline.resources import Framebuffer
from refsim.pipeline.taps import Taps
from refsim.pipeline.triangle import locate_in_triangle, shape_of_triangle
from refsim.pipeline.viewport import screen_map, to_depth, to_screen
from refsim.scene.camera import camera_frame
from tests.package.conventions_page import called, table
from tests.pipeline import device_loops
from tests.raster.drawing import LIST, TARGETS, Screen, clip_positions, vertices_of, with_depth

F = np.float32
SCREEN = Screen(40, 28, (1.5, 2.0, 36.0, 24.5, 0.25, 0.75))
SPECIAL = np.array([0, -0.0, 0.5, 1, -1, 2, 1.5 / 255, 2.5 / 255, 1e-40, np.inf, -np.inf, np.nan], F)


def test_frames() -> None:
    """The camera looks along −z, right is +x, row 0 is the top; NDC's upper left corner is the first pixel's."""
    scene = refsim.load_scene("room")
    rays = refsim.camera_rays(scene, 4, 2, view=(0, 0, 1)).direction.reshape(2, 4, 3)
    assert (rays[..., 2] < 0).all() and (rays[0, :, 1] > 0).all() and (rays[1, :, 1] < 0).all()
    assert (np.sign(rays[0, :, 0]) == [-1, -1, 1, 1]).all()
    assert np.allclose(np.linalg.norm(rays, axis=-1), 1, atol=1e-6)
    for ndc, place in (((-1, 1, 0), (0, 0, 0)), ((1, -1, 1), (40, 28, 1)), ((0, 0, 0.5), (20, 14, 0.5))):
        assert called("window")((*ndc, 1), (0, 0, 40, 28, 0, 1)) == place
    eye, *_ = camera_frame(scene, (0, 0, 1), 60.0, 2.0)
    assert np.linalg.norm(eye - scene.center) == pytest.approx(scene.diagonal / 2 / 0.5 * 2)
    assert scene.epsilon == pytest.approx(2**-12 * scene.diagonal)


def random_triangles(seed: int, count: int, w: float) -> np.ndarray:
    """Clip positions [3 · count, 4], half of them with corners on multiples of half a pixel."""
    rng = np.random.default_rng(seed)
    corner = rng.uniform((-3, -2), (43, 30), (3 * count, 2))
    corner[::2] = np.round(corner[::2] * 2) / 2
    z, depth = rng.uniform(0, 1, 3 * count), rng.uniform(1 / w, w, 3 * count)
    return clip_positions(SCREEN, *corner.T, z, depth)


def tapped(position, columns, pipe=LIST, screen=SCREEN):
    framebuffer, taps = Framebuffer(screen.width, screen.height, TARGETS, pipe.depth_stencil.format), Taps()
    draw(pipe, framebuffer=framebuffer, counters=refsim.Counters(), vertices=vertices_of(position, **columns),
         dynamic=screen.dynamic, taps=taps, threads=1)  # fmt: skip
    return taps


class Piece(NamedTuple):
    """A triangle that is drawn, as the page has it: number, snapped corners clockwise, depths, 1/w, varyings."""

    number: int
    corners: tuple
    z: np.ndarray
    inverse: list
    smooth: np.ndarray
    straight: np.ndarray
    first: np.float32

    @staticmethod
    def of(number: int, position, smooth, straight, first) -> Piece:
        """From three clip positions and the varyings there."""
        screen = [called("window")(corner, SCREEN.viewport) for corner in position]
        flat = [tuple(called("snapped")(part) for part in place[:2]) for place in screen]
        corners = called("clockwise")(flat)
        order = [0, 1, 2] if list(corners) == flat else [0, 2, 1]
        z, inverse = np.array([screen[k][2] for k in order]), [F(1) / F(position[k][3]) for k in order]
        return Piece(number, corners, z, inverse, np.array(smooth, F)[order], np.array(straight, F)[order], first)


def fragments_of(piece: Piece, form: str, bias=None) -> list[tuple]:
    """What the page gives for a piece: (number, row, column, three varyings, stored depth) a fragment."""
    left, top, width, height, low, high = SCREEN.viewport
    offset = called("bias_of")(piece.z, piece.corners, *bias, form) if bias else F(0)
    rows = []
    for y, x in product(range(SCREEN.height), range(SCREEN.width)):
        inside = left <= x + 0.5 < left + width and top <= y + 0.5 < top + height
        if inside and called("covers")(piece.corners, x, y):
            b1, b2, p1, p2 = called("weights")(piece.corners, piece.inverse, x, y)
            depth = called("stored_depth")(called("depth_at")(piece.z, offset, b1, b2), form, F(low), F(high))
            smooth = called("varying")(piece.smooth, p1, p2)
            straight = called("varying")(piece.straight, F(b1), F(b2))
            rows.append((piece.number, y, x, smooth, straight, piece.first, depth))
    return rows


def assert_same(rows: list[tuple], taps: Taps) -> None:
    """The page's fragments are those of the tap, to the bit."""
    tap, rows = taps.fragment[0], sorted(rows, key=lambda row: row[:3])
    assert [list(map(int, row[:3])) for row in rows] == np.column_stack([tap.primitive, tap.y, tap.x]).tolist()
    assert np.array_equal(np.array([row[3:6] for row in rows], F), tap.outputs["values"])
    assert np.array_equal(np.array([row[6] for row in rows], F), tap.depth)


def some_columns(count: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    return {name: rng.normal(size=count).astype(F) for name in ("smooth", "straight", "first")}


@njit(error_model="numpy")
def located(corners, x, y, out):
    """Coverage and linear weights before they are rounded."""
    for i in range(len(corners)):
        out[i, 0], out[i, 1], out[i, 2] = locate_in_triangle(shape_of_triangle(corners, np.uintp(i)), x[i], y[i])


def test_weights_before_they_are_rounded() -> None:
    rng, found = np.random.default_rng(8), np.empty((300, 3))
    corners, pixel = rng.integers(-3000, 9000, (300, 3, 2)), rng.integers(0, 30, (2, 300))
    corners = np.array([called("clockwise")(three) for three in corners.tolist()])
    located(corners.reshape(300, 6).astype(np.int32), *pixel, found)
    for three, x, y, row in zip(corners.tolist(), *pixel.tolist(), found, strict=True):
        assert [called("covers")(three, x, y), *called("weights")(three, [F(1)] * 3, x, y)[:2]] == row.tolist()


@njit(error_model="numpy")
def screens(position, view, out):
    """Where positions fall before they are snapped, and their depths."""
    for i in range(len(position)):
        x, y, z, w = position[i]
        inverse = F(1) / w
        out[i, 0], out[i, 1] = to_screen(x, y, inverse, view)
        out[i, 2] = to_depth(z, inverse, view)


def test_screen_before_it_is_snapped() -> None:
    position = np.random.default_rng(9).normal(size=(500, 4)).astype(F)
    for viewport in (SCREEN.viewport, (0.3, 0.7, 13.7, 511.1, 0.1, 0.9)):
        found = np.empty((500, 3), F)
        screens(position, tuple(screen_map(*viewport)), found)
        assert np.array_equal([called("window")(row, viewport) for row in position], found)


@pytest.mark.parametrize(
    ("form", "bias"),
    [(0, ()), (0, (-70000, 0.75, -0.004)), (1, (90, -0.5, 0.0)), (1, (3, 2.0, 0.01)), (1, (2**22, 0.0, 0.0))],
)
def test_triangles(form: int, bias: tuple) -> None:
    form, columns = list(DepthStencilFormat)[form], some_columns(36)
    position = random_triangles(5, 12, 4.0)
    settings = dict(zip(("depth_bias", "depth_bias_slope_scale", "depth_bias_clamp"), bias, strict=False))
    taps = tapped(position, columns, replace(LIST, depth_stencil=with_depth(form=form, **settings)))
    pieces = []
    for number in taps.raster[0].primitive:
        three = slice(3 * number, 3 * number + 3)
        varyings = (columns[name][three] for name in ("smooth", "straight"))
        pieces.append(Piece.of(number, position[three], *varyings, columns["first"][3 * number]))
    assert [[list(corner) for corner in piece.corners] for piece in pieces] == taps.raster[0].corners.tolist()
    rows = [row for piece in pieces for row in fragments_of(piece, form.name.lower(), bias)]
    assert len(rows) > 1000
    assert_same(rows, taps)


def test_clipping() -> None:
    """Triangles through every plane: vertices behind the eye, before the near plane, beyond the far one and far out."""
    rng, count = np.random.default_rng(11), 40
    position = rng.normal(size=(3 * count, 4)) * (1.5, 1.5, 1, 1) + (0, 0, 0.3, 0.5)
    position[:: 3 * 5] *= (4e4, 1, 1, 1)
    position[7 :: 3 * 5] *= (1, 4e4, 1, 1)
    position, columns = position.astype(F), some_columns(3 * count)
    taps = tapped(position, columns)
    planes, guards = called("planes"), called("guards")(SCREEN.viewport)
    crossed = np.zeros(7, int)
    rows, drawn = [], set()
    for number in dict.fromkeys(taps.raster[0].primitive.tolist()):
        three = slice(3 * number, 3 * number + 3)
        triangle, first = position[three], columns["first"][3 * number]
        outside = [[part < 0 for part in planes(*(np.float64(c) for c in vertex), *guards)] for vertex in triangle]
        crossed += np.any(outside, axis=0)
        smooth, straight = columns["smooth"][three], columns["straight"][three]
        if not np.any(outside):
            pieces = [Piece.of(number, triangle, smooth, straight, first)]
        else:
            polygon = called("clipped")(triangle, SCREEN.viewport)
            weights = [called("weights_of_corner")(corner, triangle) for corner in polygon]
            at = [called("varying")(smooth, p1, p2) for _, _, p1, p2 in weights]
            linear = [called("varying")(straight, b1, b2) for b1, b2, _, _ in weights]
            corners = [[F(part) for part in corner[:4]] for corner in polygon]
            places = [called("window")(corner, SCREEN.viewport)[:2] for corner in corners]
            ring = called("convex")([tuple(map(called("snapped"), place)) for place in places])
            pieces = [Piece.of(number, *([part[k] for k in (ring[0], *two)] for part in (corners, at, linear)), first)
                      for two in pairwise(ring[1:])]  # fmt: skip
        drawn |= {piece.corners for piece in pieces}
        rows += [row for piece in pieces for row in fragments_of(piece, "depth32float_stencil8")]
    assert (crossed > 0).all() and len(rows) > 2000
    assert {tuple(map(tuple, corners)) for corners in taps.raster[0].corners.tolist()} <= drawn
    assert_same(rows, taps)


@njit(error_model="numpy")
def distances(position, guard_x, guard_y, out):
    """How far inside each plane positions lie."""
    for i in range(len(position)):
        for k in range(PLANES):
            x, y, z, w = position[i]
            out[i, k] = distance(k, x, y, z, w, guard_x, guard_y)


@njit(error_model="numpy")
def polygons(triangle, guard_x, guard_y, out, counts):
    """What clipping leaves of each triangle: its corners and how many."""
    spare = np.empty((MOST_CORNERS, CORNER), np.float64)
    for i in range(len(triangle)):
        for k in range(3):
            for c in range(4):
                out[i, k, c] = triangle[i, k, c]
            for c in range(3):
                out[i, k, 4 + c] = k == c
        counts[i] = clip_polygon(out[i], spare, guard_x, guard_y)


def test_polygons_before_they_are_rounded() -> None:
    triangle = np.random.default_rng(12).normal((0, 0, 0.3, 0.5), size=(300, 3, 4))
    triangle[::4, 0, 0] *= 1e5
    triangle[1::4, 1, 2:] = 0, 0  # in the eye itself
    triangle[2::4, 1] = 0, 0, 2.0**-101, 2.0**-101
    triangle = triangle.astype(F)
    out, counts = np.zeros((300, MOST_CORNERS, CORNER)), np.zeros(300, np.int64)
    polygons(triangle, *called("guards")(SCREEN.viewport), out, counts)
    assert set(counts.tolist()) > {0, 3, 4, 5}
    for k in range(300):
        assert np.array_equal(np.reshape(called("clipped")(triangle[k], SCREEN.viewport), (-1, 7)), out[k, : counts[k]])


def test_planes_and_guard_band() -> None:
    view, guards = screen_map(*SCREEN.viewport), called("guards")(SCREEN.viewport)
    assert guards == (view.guard_x, view.guard_y)
    position, found = np.random.default_rng(4).normal(size=(50, 4)) * (900, 900, 1, 1), np.empty((50, PLANES))
    distances(position, *guards, found)
    assert np.array_equal([called("planes")(*row, *guards) for row in position], found)


def test_top_left_rule() -> None:
    rows = table("clockwise, the edge goes", "it is")
    step = {"up": (0, -1), "down": (0, 1), "left": (-1, 0), "right": (1, 0)}
    ways = [np.sum([step[word] for word in row[0].split(" and ")], axis=0) for row in rows]
    assert len({tuple(way) for way in ways}) == 8
    screen, centre = Screen(40, 28), np.array([20.5, 14.5])
    corners = [centre + 3 * np.array(way) * side for way in ways for side in (-1, 1, 0)]
    for k, (dx, dy) in enumerate(ways):
        corners[3 * k + 2] = centre + 5 * np.array((-dy, dx))  # to the right of the way
    taps = tapped(clip_positions(screen, *np.array(corners).T, np.full(24, 0.5)), {}, screen=screen)
    assert len(taps.raster[0].primitive) == 8
    tap = taps.fragment[0]
    at_centre = set(tap.primitive[(tap.x == 20) & (tap.y == 14)].tolist())
    for k, (_, kind, fate) in enumerate(rows):
        assert (fate == "covered") is (k in at_centre) is (kind in ("left", "top"))


def test_points() -> None:
    rng = np.random.default_rng(2)
    n = 400
    x, y, size = rng.uniform(0, 64, n), rng.uniform(0, 64, n), rng.uniform(0.5, 20, n).astype(F)
    x[::3], y[::4], size[::5] = np.round(x[::3] * 2) / 2, np.round(y[::4] * 8) / 8, np.round(size[::5])
    position = clip_positions(Screen(64, 64), x, y, np.full(n, 0.5)).astype(F)
    rect, depth, fate = np.empty((4, n), np.int32), np.empty(n, F), np.empty(n, np.int32)
    bounds = tuple(F(edge) for edge in (-100, -100, 200, 200))
    device_loops.points(np.ascontiguousarray(position.T), size, tuple(screen_map(0, 0, 64, 64, 0, 1)), bounds, rect,
                        depth, fate)  # fmt: skip
    for k in range(n):
        column, row, _ = called("window")(position[k], (0, 0, 64, 64, 0, 1))
        assert called("pixels_of_point")(column, row, size[k]) == tuple(rect[:, k].tolist())


@njit(error_model="numpy")
def unorms(x, out):
    """What 8-bit targets hold."""
    for i in range(len(x)):
        out[i] = to_unorm8(x[i])


def test_what_8_bits_and_depths_hold() -> None:
    x = np.concatenate([SPECIAL, np.random.default_rng(6).uniform(-0.1, 1.1, 3000).astype(F),
                        (np.arange(256) + F(0.5)) / F(255)]).astype(F)  # fmt: skip
    found = np.empty_like(x)
    unorms(x, found)
    assert np.array_equal([called("unorm8")(value) for value in x], found)
    for code, form in enumerate(DepthStencilFormat):
        device_loops.stored_depths(np.int32(code), x, found)
        assert np.array_equal([called("stored_depth")(value, form.name.lower()) for value in x], found)
