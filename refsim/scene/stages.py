"""Stages: any scene put above a ground with a light that throws its shadow there, as papers show their meshes.

Figure 1 of *Recursive Ray Tracing in Geometry Shader* (Ralovich, Magdics, 2010): "the 'Dragon' shadowcasted, the
'Horse' scene with specular materials, and the 'Torus Knot' scene with reflections and shadows from a single light".
The paper does not list its scenes; sizes here are fractions of the body's diagonal, so that a body of any size gives
the same picture.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.scene import shapes
from refsim.scene.light import PointLight
from refsim.scene.material import Material, as_triple
from refsim.scene.mesh import Scene

__all__ = ["METAL", "SILK", "STANDING", "TILES", "on_ground", "standing_up"]

Up = Literal["y", "z"]

TILES = Material("ground", "diffuse", (0.42, 0.43, 0.45), specular=0.1, shininess=24.0, reflectivity=0.25)
SILK = Material("silk", "diffuse", (0.82, 0.42, 0.16), specular=0.6, shininess=48.0, reflectivity=0.25)
METAL = Material("metal", "diffuse", (0.5, 0.36, 0.2), specular=0.9, shininess=24.0, reflectivity=0.25)

# Meshes that do not stand on their feet when y is up: their up axis, and quarter turns that show them from their side.
STANDING: dict[str, tuple[Up, int]] = {"horse": ("z", 1), "lucy_100k": ("z", 2)}

# Fractions of the body's diagonal.
GAP = 2.0**-8
HALF_GROUND = 0.75
LIGHT = (0.6, 1.3, 0.45)


def standing_up(scene: Scene, up: Up = "z", quarters: int = 0) -> Scene:
    """The scene with its axis ``up`` turned to +y, then by quarter turns about +y, counter-clockwise from above.

    Components are exchanged and negated, nothing is rounded. Normals turn with it; lights and environment do not.
    """
    if up not in ("y", "z"):
        raise InputError(f"up must be 'y' or 'z', not {up!r}")
    if not isinstance(quarters, int) or isinstance(quarters, bool):
        raise InputError(f"quarters must be a whole number of quarter turns, not {quarters!r}")

    def turned(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
        x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
        if up == "z":
            y, z = z, -y
        for _ in range(quarters % 4):
            x, z = z, -x
        return np.stack((x, y, z), axis=-1)

    normals = None if scene.normals is None else turned(scene.normals)
    return scene.replace(triangles=turned(scene.triangles), normals=normals)


def on_ground(
    scene: Scene,
    *,
    material: Material | None = None,
    ground: Material = TILES,
    light: PointLight | tuple[float, float, float] = LIGHT,
    gap: float = GAP,
    half: float = HALF_GROUND,
    up: Up | None = None,
) -> Scene:
    """The scene above a square ground of two triangles, which come last, with one point light.

    material  of the body throughout; None keeps its own
    ground    material of the ground, which faces up
    light     a PointLight, or the place of a white one from the middle of the body's box, in diagonals of that box
    gap       between the lowest vertex and the ground, in diagonals: more than 0, or ground and body would be one where
              they touch
    half      half the ground's side, in diagonals
    up        the axis that shall be +y; None is y, but what `STANDING` says for the meshes named there

    Triangles keep their order and, unless they are turned, their bits. Their lights make way for the one.
    """
    if not (np.isfinite(gap) and gap > 0.0):
        raise InputError(f"gap must be a finite number above 0, not {gap!r}")
    if not (np.isfinite(half) and half > 0.0):
        raise InputError(f"half must be a finite number above 0, not {half!r}")
    axis, quarters = STANDING.get(scene.name, ("y", 0)) if up is None else (up, 0)
    body = scene if (axis, quarters) == ("y", 0) else standing_up(scene, axis, quarters)
    body = body if material is None else body.with_materials(material)
    square = _ground_below(body, gap, half)
    source = light if isinstance(light, PointLight) else PointLight(_place(body, as_triple(light, "light")))
    up_normals = np.tile(np.array([0.0, 1.0, 0.0], np.float32), (2, 3, 1))
    return body.replace(
        triangles=np.concatenate([body.triangles, square]),
        materials=(*body.materials, ground),
        material_ids=np.concatenate([body.material_ids, np.full(2, len(body.materials), np.int32)]),
        normals=None if body.normals is None else np.concatenate([body.normals, up_normals]),
        texcoords=np.concatenate([body.texcoords, np.zeros((2, 3, 2), np.float32)]),
        lights=(source,),
    )


def _ground_below(body: Scene, gap: float, half: float) -> NDArray[np.float32]:
    x, _, z = body.center.tolist()
    y, reach = float(body.lower[1]) - gap * body.diagonal, half * body.diagonal
    left, right, back, front = x - reach, x + reach, z - reach, z + reach
    vertices, faces = shapes.quad((left, y, front), (right, y, front), (right, y, back), (left, y, back))
    return vertices[faces].astype(np.float32)


def _place(body: Scene, light: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = (body.center + body.diagonal * np.array(light)).tolist()
    return x, y, z
