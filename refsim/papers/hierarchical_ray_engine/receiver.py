"""What catches the light of a caustic: a parallelogram whose points are texels of a light map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.scene.material import DIFFUSE, as_triple
from refsim.scene.mesh import Scene


@dataclass(frozen=True)
class Receiver:
    """The parallelogram that catches the light: `corner`, and the edges `along` and `up` from there.

    Both sides catch. Texel (row 0, column 0) of its light map lies at the corner, columns run along, rows up.
    `InputError` where it has no area.
    """

    corner: tuple[float, float, float]
    along: tuple[float, float, float]
    up: tuple[float, float, float]

    def __post_init__(self) -> None:
        for name in ("corner", "along", "up"):
            object.__setattr__(self, name, as_triple(getattr(self, name), f"{name} of a receiver"))
        if not self.area > 0.0:
            raise InputError("a receiver needs two edges that are not parallel.")

    @property
    def area(self) -> float:
        """Scene units squared, m² by convention."""
        return float(np.linalg.norm(np.cross(self.along, self.up)))

    @property
    def triangles(self) -> NDArray[np.float32]:
        """float32[4, 3, 3]: two halves, and two that cover the line between them: the engine's test is not watertight,
        and on that line a hit of neither half is possible."""
        corner, a, b = (np.array(part) for part in (self.corner, self.along, self.up))
        halves = [[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)], [(0.0, 0.0), (1.0, 1.0), (0.0, 1.0)]]
        over = [[(0.0, 0.0), (1.0, 0.5), (0.5, 1.0)], [(1.0, 1.0), (0.0, 0.5), (0.5, 0.0)]]
        return np.array([[corner + s * a + r * b for s, r in part] for part in halves + over]).astype(np.float32)

    def coordinates(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Two vectors: their scalar products with (point − corner) run from 0 to 1 over the receiver."""
        a, b = np.array(self.along), np.array(self.up)
        normal = np.cross(a, b)
        square = normal @ normal
        return np.cross(b, normal) / square, np.cross(normal, a) / square


def with_receiver(scene: Scene, receiver: Receiver) -> Scene:
    """The scene, and the receiver's triangles after all others."""
    triangles = receiver.triangles
    flat = np.cross(receiver.along, receiver.up) / receiver.area
    normals = np.concatenate([scene.vertex_normals, np.tile(flat.astype(np.float32), (len(triangles), 3, 1))])
    ids = np.concatenate([scene.material_ids, np.full(len(triangles), len(scene.materials), np.int32)])
    return scene.replace(
        triangles=np.concatenate([scene.triangles, triangles]), normals=normals, material_ids=ids,
        materials=(*scene.materials, DIFFUSE), texcoords=None,
    )  # fmt: skip
