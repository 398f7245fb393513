"""Caustics: light rays through the engine, photon hits splatted on a receiver.

What section 9 of The Hierarchical Ray Engine leaves as future work. In: a scene, a light, a receiver. The light's
photons are a texture of rays; the engine follows them (same cones, same passes, non-ideal triangles by the rule
"nearest"), the receiver being four more triangles that end a path; one draw of points with additive blending makes the
light map. Ideal surfaces tint what passes them by their colour, as in pictures; there is no Fresnel term, so glass
lets all light through but where it reflects all.

Every photon ends in one place: on the receiver by way of glass or a mirror (`caustic`) or straight (`direct`), on a
diffuse triangle (`absorbed`), or out of the scene (`left`), unless it is still on its way after the last generation
(`unfinished`). The account holds photons, and energy in W, and is checked when it is made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.counters import ConservationError, Counters
from refsim.errors import InputError
from refsim.papers.hierarchical_ray_engine import photon_shaders as shaders
from refsim.papers.hierarchical_ray_engine.errata import printed_formulas
from refsim.papers.hierarchical_ray_engine.non_ideal import (
    Followed,
    check_tile_size,
    engine_options,
    follow,
    rows_of,
)
from refsim.papers.hierarchical_ray_engine.photons import Light, ParallelLight, Photons, around_ideal, photons_of
from refsim.papers.hierarchical_ray_engine.receiver import Receiver, with_receiver
from refsim.papers.hierarchical_ray_engine.vertices import corner_vertices
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import Framebuffer, Texture
from refsim.scene.light import PointLight
from refsim.scene.material import as_triple
from refsim.scene.mesh import Scene

__all__ = ["Account", "Caustic", "ParallelLight", "PointLight", "Receiver", "caustic", "with_receiver"]

FATES = ("caustic", "direct", "absorbed", "left", "unfinished")
COLORS_WIDTH = 4096
UNIT = 2.0**-24
# Roundings of one photon's irradiance: the share's, its product with the tint, the product with 0 or 1 (exact)
ROUNDINGS_A_PHOTON = 2


class Account(NamedTuple):
    """Where the light went. `sent` and each fate: photons, and W (RGB float64[3]) of what arrives there; `tinted`: W
    that coloured glass and mirrors kept. `rounding`: W that float32 sums of the light map may be off, at most."""

    photons: dict[str, int]
    energy: dict[str, NDArray[np.float64]]
    rounding: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Caustic:
    """A receiver's light map.

    irradiance  f32[h, w, 3] W/m² of light that glass or mirrors sent there
    direct      f32[h, w, 3] W/m² of the photons that came straight
    photons     int32[h, w, 2]: how many of either made a texel
    triangle, generation  int32[n] a photon: the triangle where its path ended (−1: none; the scene's, and from
                len(scene) on the receiver's), and the pass in which (−1: it goes on)
    point       f32[n, 3]: where, meaningless without a triangle
    texel_area  m²
    light, account, counters
    """

    irradiance: NDArray[np.float32]
    direct: NDArray[np.float32]
    photons: NDArray[np.int32]
    triangle: NDArray[np.int32]
    generation: NDArray[np.int32]
    point: NDArray[np.float32]
    texel_area: float
    light: Photons
    account: Account
    counters: Counters


def caustic(
    scene: Scene,
    light: Light,
    receiver: Receiver,
    *,
    photons_across: int = 512,
    resolution: tuple[int, int] = (256, 256),
    aim: tuple[tuple[float, float, float], float] | None = None,
    seed: int | None = 0,
    tile_size: int = 16,
    errata: str | Sequence[str] = "corrected",
    **options: Any,
) -> Caustic:
    """The light that `light` throws on `receiver` through the glass and by the mirrors of `scene`.

    photons_across  side of the square grid of photons, 1 to 4096; those in its disc are sent
    resolution      (width, height) of the light map
    aim             (centre, radius) of the sphere that the light falls on; None: the one around all ideal triangles
    seed            of the photons' places in their cells; None: in the middle

    `options` are those of `non_ideal.engine_options`. Lengths are metres. `InputError` names what is wrong.
    """
    sphere = around_ideal(scene) if aim is None else (np.array(as_triple(aim[0], "centre of aim")), float(aim[1]))
    engine = engine_options(**options)
    _check(resolution, sphere[1], seed)
    check_tile_size(tile_size)
    stage = with_receiver(scene, receiver)
    photons = photons_of(light, stage, sphere, photons_across, seed)
    size = -(-photons_across // tile_size) * tile_size
    tint = Framebuffer(size, size, shaders.TINT_TARGETS)
    tint.clear_color("tint", 1.0)
    tinting = partial(_tint, stage, tint, engine.threads)
    white = all(material.color == (1.0, 1.0, 1.0) for material in scene.materials if material.kind != "diffuse")
    followed = follow(
        stage, photons.rays, engine, tile_size, printed_formulas(errata), "nearest", scene.epsilon,
        None if white else tinting,
    )  # fmt: skip
    counters = Counters()
    for generation in followed.generations:
        counters.merge(generation.counters)
    share = photons.energy * (resolution[0] * resolution[1] / receiver.area)
    splats = _splat(followed, tint, receiver, len(scene), resolution, share, counters, engine.threads)
    counters.check()
    return _completed(scene, photons, followed, tint, splats, receiver, counters)


def _check(resolution: tuple[int, int], radius: float, seed: int | None) -> None:
    if len(resolution) != 2 or any(isinstance(n, bool) or not isinstance(n, int) or n < 1 for n in resolution):
        raise InputError(f"resolution is {resolution!r}; it must be two whole numbers of texels from 1.")
    if not 0.0 < radius < np.inf:
        raise InputError(f"the radius of aim is {radius!r}; it must be a finite number above 0.")
    if seed is not None and (isinstance(seed, bool) or not isinstance(seed, int) or seed < 0):
        raise InputError(f"seed is {seed!r}; it must be a whole number from 0, or None.")


def _tint(
    scene: Scene, tint: Framebuffer, threads: int | None, k: int, target: Framebuffer, counters: Counters
) -> None:
    """Multiplies what is left of the photons with the colours of the surfaces by which they go on."""
    table = np.array([material.color for material in scene.materials], np.float32)[scene.material_ids]
    rows = -(-len(table) // COLORS_WIDTH)
    colors = np.ones((3, rows * COLORS_WIDTH), np.float32)
    colors[:, : len(table)] = table.T
    draw(
        shaders.tint_pass(),
        vertices=corner_vertices(),
        uniforms=shaders.TintUniforms(np.int32(COLORS_WIDTH)),
        textures=shaders.TintTextures(
            target.texture("origin"), target.texture("triangle"), Texture(colors.reshape(3, rows, COLORS_WIDTH))
        ),
        framebuffer=tint,
        counters=counters,
        threads=threads,
    )


def _splat(
    followed: Followed,
    tint: Framebuffer,
    receiver: Receiver,
    first: int,
    resolution: tuple[int, int],
    share: NDArray[np.float64],
    counters: Counters,
    threads: int | None,
) -> Framebuffer:
    """One draw of points: the light map."""
    target, ends = Framebuffer(*resolution, shaders.MAP_TARGETS), followed.ends
    along, up = receiver.coordinates()
    uniforms = shaders.SplatUniforms(
        np.int32(ends.width), np.int32(resolution[0]), np.int32(resolution[1]), np.int32(first),
        *(_vec3(part) for part in (receiver.corner, along, up, share)),
    )  # fmt: skip
    draw(
        shaders.splat_pass(),
        vertex_count=ends.width * ends.height,
        uniforms=uniforms,
        textures=shaders.EndTextures(
            ends.texture("origin"), ends.texture("direction"), ends.texture("hit"), ends.texture("triangle"),
            ends.texture("generation"), tint.texture("tint"),
        ),
        framebuffer=target,
        counters=counters,
        threads=threads,
    )
    return target


def _vec3(values: Any) -> tuple[np.float32, np.float32, np.float32]:
    x, y, z = (np.float32(value) for value in values)
    return x, y, z


def _completed(
    scene: Scene,
    photons: Photons,
    followed: Followed,
    tint: Framebuffer,
    splats: Framebuffer,
    receiver: Receiver,
    counters: Counters,
) -> Caustic:
    count, ends = len(photons.rays), followed.ends
    row = {name: rows_of(ends.color(name), followed.image, count) for name in ends.targets}
    triangle, generation = row["triangle"][:, 0], row["generation"][:, 0]
    point = row["origin"][:, :3] + np.where(triangle >= 0, row["hit"][:, 0], np.float32(0))[:, None] * row["direction"]
    caustic_map, direct_map = (splats.color(name).transpose(1, 2, 0) for name in shaders.MAP_TARGETS)
    numbers = np.stack([caustic_map[..., 3], direct_map[..., 3]], axis=-1).astype(np.int32)
    fate = _fates(photons.rays.t_max > 0, triangle, generation, len(scene))
    left = rows_of(tint.color("tint"), followed.image, count).astype(np.float64) * photons.energy
    maps = [np.ascontiguousarray(part[..., :3]) for part in (caustic_map, direct_map)]
    texel = receiver.area / numbers[..., 0].size
    account = _account(photons, fate, left, maps, numbers, texel)
    return Caustic(maps[0], maps[1], numbers, triangle, generation, point, texel, photons, account, counters)


def _fates(
    sent: NDArray[np.bool_], triangle: NDArray[np.int32], generation: NDArray[np.int32], first: int
) -> dict[str, NDArray[np.bool_]]:
    arrives = triangle >= first
    return {
        "caustic": sent & arrives & (generation > 0),
        "direct": sent & arrives & (generation == 0),
        "absorbed": sent & (triangle >= 0) & ~arrives,
        "left": sent & (triangle < 0) & (generation >= 0),
        "unfinished": sent & (generation < 0),
    }


def _sum(energy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of rows [n, 3], rounded once."""
    return np.array([math.fsum(column) for column in energy.T.tolist()])


def _account(
    photons: Photons,
    fate: dict[str, NDArray[np.bool_]],
    left: NDArray[np.float64],
    maps: list[NDArray[np.float32]],
    numbers: NDArray[np.int32],
    texel: float,
) -> Account:
    """Photons and energy by fate, held against the light map; `ConservationError` where they do not meet."""
    counts = {"sent": photons.sent, **{name: int(rows.sum()) for name, rows in fate.items()}}
    energy = {"sent": photons.sent * photons.energy, **{name: _sum(left[rows]) for name, rows in fate.items()}}
    energy["tinted"] = _sum((photons.energy - left)[photons.rays.t_max > 0])
    if sum(counts[name] for name in FATES) != counts["sent"]:
        raise ConservationError(f"{counts['sent']} photons were sent, but their fates are {counts}.")
    rounding = np.zeros(3)
    for name, values, number in zip(("caustic", "direct"), maps, np.moveaxis(numbers, -1, 0), strict=True):
        if int(number.sum()) != counts[name]:
            raise ConservationError(f"{counts[name]} photons arrived ({name}), the light map holds {number.sum()}.")
        wide = values.astype(np.float64) * texel
        # m terms added one by one: m − 1 roundings of at most the sum, and those of each term
        bound = (wide * ((number + ROUNDINGS_A_PHOTON) * UNIT)[..., None]).sum(axis=(0, 1)) * (1.0 + 2.0**-8)
        if np.any(np.abs(wide.sum(axis=(0, 1)) - energy[name]) > bound):
            raise ConservationError(f"the light map ({name}) holds {wide.sum(axis=(0, 1))} W, not {energy[name]}.")
        rounding += bound
    return Account(counts, energy, rounding)
