"""Vertices and faces of the library's bodies: pure NumPy, the same on every machine, closed and wound outward.

Every function returns ``(vertices float64[v, 3], faces int[n, 3])``; front is counter-clockwise seen from outside.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

__all__ = ["blob", "box", "joined_cubes", "open_cube", "quad", "sphere", "torus", "torus_knot"]

Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]

# Corner k of a box is at bit 0 of k along x, bit 1 along y, bit 2 along z. One row a side: -x +x -y +y -z +z.
BOX_SIDES = np.array([(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)])
SIDE_STEPS = np.array([(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)])


def quad(a: Iterable[float], b: Iterable[float], c: Iterable[float], d: Iterable[float]) -> Mesh:
    """Two triangles abc and acd; the front shows a, b, c, d counter-clockwise."""
    return np.array([tuple(a), tuple(b), tuple(c), tuple(d)], np.float64), np.array([(0, 1, 2), (0, 2, 3)])


def box(center: Iterable[float], size: Iterable[float], turn: float = 0.0) -> Mesh:
    """A closed box of 12 triangles with edge lengths ``size``, turned about the y axis by ``turn`` radians."""
    corners = np.array([[(k >> axis & 1) - 0.5 for axis in range(3)] for k in range(8)]) * tuple(size)
    cosine, sine = math.cos(turn), math.sin(turn)
    rotation = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    return corners @ rotation.T + tuple(center), _fans(BOX_SIDES)


def open_cube() -> list[tuple[str, Mesh]]:
    """Five walls of the cube [-1, 1]^3 by name, two triangles each, fronts inward: open towards +z, where the default
    camera stands."""
    corner = [np.array([k & 1, k >> 1 & 1, k >> 2 & 1]) * 2.0 - 1.0 for k in range(8)]
    sides = {"left": 0, "right": 1, "floor": 2, "ceiling": 3, "back": 4}
    return [(wall, quad(*(corner[k] for k in BOX_SIDES[side][::-1]))) for wall, side in sides.items()]


def joined_cubes(cells: Iterable[tuple[int, int, int]]) -> Mesh:
    """The surface of unit cubes at integer cells, sides between neighbours removed and vertices shared."""
    cells = list(cells)
    filled = set(cells)
    corners: dict[tuple[int, int, int], int] = {}
    sides = []
    for cell in cells:
        for side, step in zip(BOX_SIDES, SIDE_STEPS, strict=True):
            if (cell[0] + step[0], cell[1] + step[1], cell[2] + step[2]) in filled:
                continue
            points = [(cell[0] + (k & 1), cell[1] + (k >> 1 & 1), cell[2] + (k >> 2 & 1)) for k in map(int, side)]
            sides.append([corners.setdefault(point, len(corners)) for point in points])
    return np.array(list(corners), np.float64), _fans(np.array(sides))


def sphere(segments: int, bands: int) -> Mesh:
    """The unit sphere by longitude and latitude, poles on the y axis: 2 * segments * bands triangles."""
    return _globe(segments, np.arange(1, bands + 1) * (math.pi / (bands + 1)))


def blob(segments: int, bands: int) -> Mesh:
    """A smooth body, star-shaped about the origin, with the topology of ``sphere``.

    The radius is that of the superellipsoid x^6 + y^6 + (z / 0.8)^6 = 1 with low bumps: boxy enough to cover every
    pixel of the default view at fill 0.55, where a sphere would leave the corners of the picture empty.
    """
    # Circles of latitude crowd where the body bends most, at 45 degrees, so that 100 triangles cover the view.
    angle = np.arange(1, bands + 1) * (math.pi / (bands + 1))
    direction, faces = _globe(segments, angle + 0.175 * np.sin(4.0 * angle), turn=0.15 * math.pi)
    x, y, z = direction.T
    radius = (x**6 + y**6 + (z / 0.8) ** 6) ** (-1.0 / 6.0)
    radius *= 1.0 + 0.03 * np.sin(3.0 * x + 1.0) * np.sin(3.0 * y - 0.5) * np.cos(2.5 * z)
    return direction * radius[:, None], faces


def torus(segments: int, radial: int, radius: float, tube: float) -> Mesh:
    """A ring about the y axis, a tube of ``radial`` sides: 2 * segments * radial triangles."""
    around, along = np.arange(segments) * (math.tau / segments), np.arange(radial) * (math.tau / radial)
    reach = radius + tube * np.cos(along)
    x, z = np.sin(around)[:, None] * reach, np.cos(around)[:, None] * reach
    y = np.broadcast_to(tube * np.sin(along), x.shape)
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), _rolled_up(segments, radial)


def torus_knot(segments: int, radial: int, radius: float = 1.0, tube: float = 0.4, p: int = 2, q: int = 3) -> Mesh:
    """The (p, q) torus knot as in three.js TorusKnotGeometry: 2 * segments * radial triangles.

    Row i of ``radial`` vertices circles the centre line at u = 2 pi p i / segments, in the frame that the points at u
    and u + 0.01 span; quads join neighbouring rows, first along the row.
    """
    u = np.arange(segments) / segments * (p * math.tau)
    here, ahead = _knot_line(u, radius, p, q), _knot_line(u + 0.01, radius, p, q)
    binormal = np.cross(ahead - here, ahead + here)
    normal = np.cross(binormal, ahead - here)
    binormal /= np.linalg.norm(binormal, axis=1, keepdims=True)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    v = np.arange(radial) / radial * math.tau
    circle = -tube * np.cos(v)[None, :, None] * normal[:, None] + tube * np.sin(v)[None, :, None] * binormal[:, None]
    return (here[:, None] + circle).reshape(-1, 3), _rolled_up(segments, radial)


def _knot_line(u: NDArray[np.float64], radius: float, p: int, q: int) -> NDArray[np.float64]:
    around = q / p * u
    reach = radius * (2.0 + np.cos(around)) * 0.5
    return np.stack([reach * np.cos(u), reach * np.sin(u), radius * np.sin(around) * 0.5], axis=1)


def _rolled_up(segments: int, radial: int) -> NDArray[np.int64]:
    # Quads between neighbours of a grid of vertices whose rows and columns both run round.
    i, j = np.meshgrid(np.arange(segments), np.arange(radial), indexing="ij")
    a, b = i * radial + j, (i + 1) % segments * radial + j
    next_j = (j + 1) % radial
    c, d = (i + 1) % segments * radial + next_j, i * radial + next_j
    return np.stack([np.stack([a, b, d], axis=-1), np.stack([b, c, d], axis=-1)], axis=2).reshape(-1, 3)


def _globe(segments: int, polar: NDArray[np.floating], turn: float = 0.0) -> Mesh:
    # One circle of vertices for each angle from the north pole. A cap at a pole has half the triangles of a strip
    # between two circles, so `bands` circles make 2 * segments * bands triangles.
    bands = len(polar)
    longitude = np.arange(segments) * (math.tau / segments) + turn
    around = np.stack([np.sin(longitude), np.zeros(segments), np.cos(longitude)], axis=1)
    axis = np.array([0.0, 1.0, 0.0])
    circles = np.sin(polar)[:, None, None] * around + np.cos(polar)[:, None, None] * axis
    vertices = np.concatenate([axis[None], circles.reshape(-1, 3), -axis[None]])
    here = np.arange(segments)
    after = (here + 1) % segments
    south = len(vertices) - 1
    last = 1 + (bands - 1) * segments
    strips = [np.stack([np.zeros_like(here), 1 + here, 1 + after], axis=1)]
    for band in range(bands - 1):
        top, bottom = 1 + band * segments, 1 + (band + 1) * segments
        upper = np.stack([top + here, bottom + here, top + after], axis=1)
        lower = np.stack([bottom + here, bottom + after, top + after], axis=1)
        strips.append(np.stack([upper, lower], axis=1).reshape(-1, 3))
    strips.append(np.stack([last + here, np.full_like(here, south), last + after], axis=1))
    return vertices, np.concatenate(strips)


def _fans(quads: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.stack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]], axis=1).reshape(-1, 3)
