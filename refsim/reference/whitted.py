"""Whitted's recursive ray tracer in plain NumPy: what "Recursive Ray Tracing in Geometry Shader" must draw.

Whitted, "An Improved Illumination Model for Shaded Display" (1980), as the paper's sections 3 and 4 set it to work. In:
a scene, eye rays, depth, lights, materials' ρ and τ. Out: the picture, and every ray that was shot with what it hit.
The recursion runs over nodes of a pixel's ray tree: all pixels' rays of a node go together as a bundle, as NumPy likes
it; a node's children are its reflected and its refracted rays.

Float32, the operations of the shaders in their order: light is multiplied by the weight of its path, kept apart by node
and light until the shadow rays have been shot (a shadow takes all light of one lamp, and ambient light stays), and only
then summed, nodes in order. An 8-bit picture rounds wherever a render target would.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from refsim.reference import phong
from refsim.reference.blend import Operands, blend, clamped, to_unorm8
from refsim.reference.optics import next_ray
from refsim.reference.searches import Found, Search
from refsim.reference.surfaces import Surfaces
from refsim.results import RayKind
from refsim.scene.light import PointLight
from refsim.scene.mesh import Scene

F0, F1 = np.float32(0), np.float32(1)
INFINITY = np.float32(np.inf)


class Bundle(NamedTuple):
    """Rays of one node, at most one a pixel: pixel int64[n], origin, direction f32[n, 3], t_max, weight f32[n].

    `light` is −1; for the shadow rays from a node's hits it is the lamp's number.
    """

    node: int
    light: int
    pixel: np.ndarray
    origin: np.ndarray
    direction: np.ndarray
    t_max: np.ndarray
    weight: np.ndarray

    def where(self, rows: np.ndarray) -> Bundle:
        """Some of the rays."""
        return Bundle(self.node, self.light, *(column[rows] for column in self[2:]))


class Shot(NamedTuple):
    """A bundle that was shot in pass `depth`, and what it hit."""

    depth: int
    kind: RayKind
    rays: Bundle
    found: Found


@dataclass(frozen=True)
class Shading:
    """A row a triangle: ρ, τ, k_s f32[m], Phong's exponent int32[m], k_d f32[m, 3] (black but for diffuse surfaces)."""

    rho: np.ndarray
    tau: np.ndarray
    specular: np.ndarray
    exponent: np.ndarray
    diffuse: np.ndarray

    @classmethod
    def of(cls, scene: Scene) -> Shading:
        """The scene's materials."""
        materials, ids = scene.materials, scene.material_ids
        rho, tau, specular = (
            np.array(column, np.float32)[ids]
            for column in zip(*((m.rho, m.tau, m.specular) for m in materials), strict=True)
        )
        exponent = np.array([round(m.shininess) for m in materials], np.float32).astype(np.int32)[ids]
        diffuse = np.array([m.color if m.kind == "diffuse" else (0, 0, 0) for m in materials], np.float32)[ids]
        return cls(rho, tau, specular, exponent, diffuse)


@dataclass
class Whitted:
    """One picture in the making: `trace` the eye rays, then take `picture()`.

    `passes`: depth of the tree, P. `branching`: children a node may have. `background` f32[3]: what leaving rays see.
    `fixed_point`: targets hold 8 bits. `shots`: all bundles, in the order in which the recursion shot them.
    """

    surfaces: Surfaces
    shading: Shading
    search: Search
    pixels: int
    passes: int
    lights: tuple[PointLight, ...]
    shadows: bool
    reflections: bool
    refractions: bool
    branching: int
    background: np.ndarray
    fixed_point: bool
    shots: list[Shot] = field(default_factory=list)
    light_by_node: dict[int, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        # Behind the eye's rays there is the background, as a cleared target holds it
        self.of_node(0)[0] = to_unorm8(self.background) if self.fixed_point else self.background

    def trace(self, rays: Bundle, depth: int = 0, kind: RayKind = RayKind.EYE) -> None:
        """Whitted's recursion: finds what a node's rays hit, lights it, and traces what the hits send on."""
        if not len(rays.pixel):
            return
        found = self.search.find(rays.origin, rays.direction, rays.t_max, any_hit=False)
        self.shots.append(Shot(depth, kind, rays, found))
        hit = found.triangle >= 0
        self.expose_misses(rays.where(~hit))
        rays, found = rays.where(hit), found.where(hit)
        point = rays.origin + rays.direction * found.t[:, None]
        normal = self.normal(found)
        self.expose_hits(rays, found, point, normal)
        if depth + 1 == self.passes:  # no ray is left for what these surfaces cannot see
            return
        if self.shadows:
            for light in range(len(self.lights)):
                self.cast_shadow(rays, found, point, light, depth + 1)
        reflected, refracted = self.sent_on(rays, found, normal)
        self.trace(reflected, depth + 1, RayKind.REFLECTED)
        self.trace(refracted, depth + 1, RayKind.REFRACTED)

    def normal(self, found: Found) -> np.ndarray:
        """The shading normals of hits."""
        if not self.surfaces.smooth:
            return self.surfaces.n[found.triangle]
        return phong.interpolated_normal(self.surfaces.vertex_normals[found.triangle], found.u, found.v)

    def expose_hits(self, rays: Bundle, found: Found, point: np.ndarray, normal: np.ndarray) -> None:
        """Ambient light, and what each lamp adds if nothing is in its way."""
        k, d = found.triangle, rays.direction
        against, diffuse = phong.facing(normal, d), self.shading.diffuse[k]
        specular, exponent = self.shading.specular[k], self.shading.exponent[k]
        sent = [phong.ambient(diffuse, rays.weight)]
        for lamp in self.lights:
            place, radiance = np.array(lamp.position, np.float32), np.array(lamp.radiance, np.float32)
            sent.append(phong.phong(point, d, against, diffuse, specular, exponent, place, radiance, rays.weight))
        self.replace(rays, np.stack(sent))

    def expose_misses(self, rays: Bundle) -> None:
        """The background; behind eye rays it is there already."""
        if rays.node == 0 or not self.background.any():
            return
        sent = np.zeros((1 + len(self.lights), len(rays.pixel), 3), np.float32)
        sent[0] = self.background * rays.weight[:, None]
        self.replace(rays, sent)

    def cast_shadow(self, rays: Bundle, found: Found, point: np.ndarray, light: int, depth: int) -> None:
        """Shoots from hits towards a lamp, and takes that lamp's light from all that see something before it."""
        place = np.array(self.lights[light].position, np.float32)
        geometric = self.surfaces.n[found.triangle]
        origin, direction, distance = phong.shadow_ray(point, geometric, place, self.surfaces.epsilon)
        shadow = Bundle(rays.node, light, rays.pixel, origin, direction, distance, rays.weight)
        blocked = self.search.find(origin, direction, distance, any_hit=True)
        self.shots.append(Shot(depth, RayKind.SHADOW, shadow, blocked))
        dark = shadow.pixel[blocked.triangle >= 0]
        held = self.of_node(rays.node)[1 + light]
        held[dark] = self.stored(np.zeros((len(dark), 3), np.float32), F0, held[dark])

    def sent_on(self, rays: Bundle, found: Found, normal: np.ndarray) -> tuple[Bundle, Bundle]:
        """The reflected and the refracted rays of hits.

        They weigh ρ and τ of the ray before. Where glass reflects all (total internal reflection), nothing is
        refracted and the mirrored ray carries both.
        """
        k, s = found.triangle, self.surfaces
        rho, tau = self.shading.rho[k], self.shading.tau[k]
        before = (rays.origin, rays.direction, found.t, s.n[k], normal)
        mirrored_origin, mirrored, _, _ = next_ray(*before, np.zeros_like(found.t), np.asarray(s.epsilon))
        bent_origin, bent, kind, _ = next_ray(*before, s.index[k], np.asarray(s.epsilon))
        glass = (tau > 0) & self.refractions
        refracts = glass & (kind == RayKind.REFRACTED)
        rho = np.where(glass & ~refracts, rho + tau, rho)
        reflects = (rho > 0) & self.reflections
        endless = np.full_like(found.t, INFINITY)
        first = self.branching * rays.node + 1
        reflected = Bundle(first, -1, rays.pixel, mirrored_origin, mirrored, endless, rays.weight * rho)
        refracted = Bundle(first + 1, -1, rays.pixel, bent_origin, bent, endless, rays.weight * tau)
        return reflected.where(reflects), refracted.where(refracts)

    def of_node(self, node: int) -> np.ndarray:
        """f32[1 + lights, pixels, 3]: what the eye gets over a node: ambient light or background, each lamp's light."""
        if node not in self.light_by_node:
            self.light_by_node[node] = np.zeros((1 + len(self.lights), self.pixels, 3), np.float32)
        return self.light_by_node[node]

    def replace(self, rays: Bundle, sent: np.ndarray) -> None:
        """Sets what the rays' pixels get over their node."""
        held = self.of_node(rays.node)
        held[:, rays.pixel] = self.stored(sent, F0, held[:, rays.pixel])

    def stored(self, source: np.ndarray, alpha: np.float32, destination: np.ndarray) -> np.ndarray:
        """Eq. 1, RGB_src + α_src · RGB_dst, as the target keeps it."""
        alphas = np.full_like(source, alpha)
        operands = Operands(source, destination, source, source, alphas, alphas, alphas)
        with np.errstate(all="ignore"):
            if not self.fixed_point:
                return blend("add", "one", "src-alpha", operands)
            return to_unorm8(blend("add", "one", "src-alpha", clamped(operands)))

    def picture(self) -> np.ndarray:
        """f32[pixels, 3]: the sum over nodes in order, ambient light before the lamps'."""
        image = np.zeros((self.pixels, 3), np.float32)
        for node in sorted(self.light_by_node):
            for light in self.light_by_node[node]:
                image = self.stored(light, F1, image)
        return image
