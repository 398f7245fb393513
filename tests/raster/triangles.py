"""Random triangles and meshes in pixels, for the tests of this room."""

import numpy as np

from tests.raster.drawing import Screen

KINDS = ("plain", "sliver", "on the grid", "huge", "off the screen", "below a pixel", "degenerate")


def random_triangle(rng: np.random.Generator, kind: str, screen: Screen) -> np.ndarray:
    """Corners float64 [3, 2] in pixels, of one of `KINDS`; none as far out as the guard band."""
    size = np.array([screen.width, screen.height])
    corners = rng.uniform(-0.3, 1.3, (3, 2)) * size
    if kind == "sliver":
        corners[2] = corners[0] + rng.uniform(-0.5, 1.5) * (corners[1] - corners[0])
        corners[2] += rng.normal(0, rng.choice([1e-3, 0.02, 0.3]), 2)
    elif kind == "on the grid":  # corners and edges on pixel centres
        corners = np.rint(corners * 2) / 2
    elif kind == "huge":
        reach = rng.choice([300.0, 5000.0, 30000.0])
        corners = rng.uniform(-reach, reach, (3, 2))
    elif kind == "off the screen":
        corners += rng.choice([-3, 3]) * size * rng.permutation([0, 1])
    elif kind == "below a pixel":
        corners = corners[0] + rng.uniform(-0.6, 0.6, (3, 2))
    elif kind == "degenerate":
        corners[1] = corners[0] if rng.random() < 0.5 else corners[1]
        corners[2] = corners[0] + rng.choice([0, 0.5, 1, 2]) * (corners[1] - corners[0])
    return corners


def random_triangles(rng: np.random.Generator, count: int, screen: Screen) -> np.ndarray:
    """Triangles [count, 3, 2] of all kinds in turn."""
    return np.array([random_triangle(rng, KINDS[k % len(KINDS)], screen) for k in range(count)])


def turned(rng: np.random.Generator, points: np.ndarray, screen: Screen) -> np.ndarray:
    """Points [n, 2] about the origin, turned at random and put somewhere near the middle of the screen."""
    angle = rng.uniform(0, 2 * np.pi)
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return points @ rotation.T + np.array([screen.width, screen.height]) / 2 + rng.uniform(-2, 2, 2)


def grid_faces(rng: np.random.Generator, columns: int, rows: int) -> np.ndarray:
    """Vertices [2 · columns · rows, 3] of a grid of quads, each split along either diagonal, first corner at random."""
    y, x = (part.ravel() for part in np.mgrid[0:rows, 0:columns])
    a = y * (columns + 1) + x
    b, c, d = a + 1, a + columns + 2, a + columns + 1
    other = rng.random(len(a)) < 0.5
    first = np.where(other[:, None], np.stack([a, b, d], 1), np.stack([a, b, c], 1))
    second = np.where(other[:, None], np.stack([b, c, d], 1), np.stack([a, c, d], 1))
    faces = np.stack([first, second], axis=1).reshape(-1, 3)
    turns = rng.integers(0, 3, len(faces))
    return np.take_along_axis(faces, (np.arange(3) + turns[:, None]) % 3, axis=1)


def grid_points(columns: int, rows: int) -> np.ndarray:
    """Points [n, 2] of a unit-spaced grid about the origin, rows first."""
    y, x = (part.ravel() for part in np.mgrid[0 : rows + 1, 0 : columns + 1])
    return np.stack([x - columns / 2, y - rows / 2], axis=1)


def rotation(rng: np.random.Generator) -> np.ndarray:
    """A random rotation of space."""
    matrix, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return matrix * np.sign(np.linalg.det(matrix))


def perspective_positions(points: np.ndarray, distance: float, extent: float, screen: Screen) -> np.ndarray:
    """Clip positions f32 [..., 4] of points about the origin, seen from (0, 0, distance) along −z.

    At the origin's distance one unit of space is `extent` pixels; near plane at half the distance, far at twice.
    """
    depth = distance - points[..., 2]
    near, far = distance / 2, distance * 2
    scale = distance * extent * 2
    x, y = points[..., 0] * scale / screen.width, points[..., 1] * scale / screen.height
    return np.stack([x, y, (depth - near) * far / (far - near), depth], axis=-1).astype(np.float32)
