"""Scenes small enough to be drawn: triangles that a view along z shows as lines, "5 primitives roughly ordered along
the x axis" (section 3)."""

from __future__ import annotations

import numpy as np

from refsim.scene import Rays, Scene, camera_rays

# Ends of the lines in the plane z = 0: x, y, x, y. The third vertex stands above the middle, half a depth off the plane
FIVE = ((0.0, 0.55, 0.6, 0.15), (0.5, -0.8, 1.2, -1.1), (1.55, 0.45, 1.75, -0.3), (2.35, -1.05, 2.95, -0.75),
        (2.8, 0.85, 3.3, 0.35))  # fmt: skip
NINE = (*FIVE, (3.75, 0.75, 4.15, 1.05), (4.1, -0.95, 4.65, -0.6), (4.75, 0.15, 5.1, 0.65), (5.2, -0.2, 5.7, -0.55))
DEPTH = 0.01
EYE = (-1.0, 0.0, 0.0)


def lines_scene(lines: tuple[tuple[float, float, float, float], ...]) -> Scene:
    """A triangle a line, normals towards +x where the line runs down, each DEPTH deep around z = 0."""
    triangles = [
        [(ax, ay, -DEPTH), (bx, by, -DEPTH), (0.5 * (ax + bx), 0.5 * (ay + by), DEPTH)] for ax, ay, bx, by in lines
    ]
    scene = Scene(np.array(triangles, np.float32))
    flipped = scene.triangles[:, [0, 2, 1]]
    return Scene(np.where((_normals(scene.triangles)[:, 0] > 0)[:, None, None], scene.triangles, flipped))


def _normals(triangles: np.ndarray) -> np.ndarray:
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def looking_along_x(scene: Scene, side: int) -> Rays:
    """Rays of a small picture, the eye before the scene's left end."""
    return camera_rays(scene, side, side, view=EYE, fov=50.0, fill=0.8)
