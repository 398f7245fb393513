"""The scenes of this room: procedural ones always, real meshes where they are at hand."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from refsim import Material, Rays, Scene, camera_rays, load_scene
from refsim.scene.known import scenes_folder
from tests.scenes_present import real_scene

# Name, size of the image: the larger the mesh, the smaller the picture, so that every ray can meet every triangle.
REAL = {"torus_knot_1024": 96, "suzanne": 72, "teapot": 48, "dragon_res4": 48, "bunny": 32}
PROCEDURAL = ("torus_knot_128", "blob_100", "cornell_box", "mirror_room", "doubled")


@cache
def scene_of(name: str) -> Scene | None:
    """The scene of that name, made once; None where a real mesh is missing."""
    if name == "mirror_room":
        return load_scene("room").with_materials(Material("mirror", "mirror"))
    if name == "doubled":
        return doubled()
    if name == "slivers":
        return slivers()
    if name == "torus_knot_1024":
        # A file too, but one that the library makes as well
        folder = scenes_folder()
        file = Path(folder) / f"{name}.ply" if folder is not None else None
        return load_scene(str(file) if file is not None and file.exists() else name)
    if name in REAL:
        return real_scene(name)
    return load_scene(name)


def doubled() -> Scene:
    """A sphere whose triangles lie on each other three times: as they are, in reverse order, and with vertices rolled.

    The first two give exactly equal t on every hit, so the triangle listed first has to win; the third has the same
    plane up to rounding.
    """
    once = load_scene("sphere_112").triangles
    rolled = np.roll(once, 1, axis=1)[:: -1]
    return Scene(np.concatenate([once, once[::-1], rolled]), "doubled")


def slivers() -> Scene:
    """A blob among four triangles of zero area (points, a segment, a repeated vertex) and one of almost zero area."""
    body = load_scene("blob_100").triangles
    point = np.broadcast_to(body[7, 0], (1, 3, 3))
    segment = np.array([[[0, 0, 0], [0.25, 0.25, 0.25], [0.5, 0.5, 0.5]]])
    sliver = np.stack([body[9, 0], 0.5 * (body[9, 0] + body[9, 1]), body[9, 1]])[None]
    repeated = body[[3]][:, [0, 0, 1]]
    parts = [point, body[:50], repeated, segment, sliver, body[50:], point]
    return Scene(np.concatenate(parts).astype(np.float32), "slivers")


def rays_of(name: str, width: int = 40, height: int = 30) -> Rays:
    """Camera rays at a procedural scene, close enough for most of them to hit."""
    scene = scene_of(name)
    assert scene is not None
    return camera_rays(scene, width, height, fill=0.55)


def wild_rays(scene: Scene, width: int, height: int, seed: int) -> Rays:
    """An image of incoherent rays: origins in and around the scene, any direction, some dead, some of bounded t."""
    random = np.random.default_rng(seed)
    n = width * height
    origin = scene.center + scene.diagonal * random.uniform(-0.7, 0.7, (n, 3))
    direction = random.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    t_max = np.where(random.random(n) < 0.3, scene.diagonal * random.random(n), np.inf)
    dead = random.random(n) < 0.1
    direction[dead], t_max[dead] = 0.0, 0.0
    return Rays(origin.astype(np.float32), direction.astype(np.float32), t_max.astype(np.float32), width, height)
