"""Listings 3 to 5 in plain Python and float64, a record at a time: what each stage of a pass must make of its input.

A record is the 16 numbers of Listing 2. Nothing here is shared with the tracer but the rules as the text gives them:
states 0, 1 and 3; type −n for the surface ray of node n, 1 + l + L·n for its shadow ray to light l; first the ray
itself, then its shadow rays, then the reflected and the refracted one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from refsim import Scene

AMBIENT = 0.2


class Emitted(NamedTuple):
    """A ray that leaves the geometry shader. `weight` is the float32 product; origin, direction, t are float64."""

    state: int
    type: int
    index: int
    weight: np.float32
    origin: np.ndarray
    direction: np.ndarray
    t: float


class Shaded(NamedTuple):
    """A fragment that is kept: RGBA a target, "unshadowed" first."""

    targets: list[np.ndarray]


@dataclass
class Listings:
    """The rules for one scene and set of options."""

    scene: Scene
    branching: int
    background: tuple[float, float, float] = (0.1, 0.12, 0.15)
    shadows: bool = True
    ior: float = 1.5
    indices: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.triangles = self.scene.triangles.astype(np.float64)
        cross = np.cross(self.triangles[:, 1] - self.triangles[:, 0], self.triangles[:, 2] - self.triangles[:, 0])
        self.normals = cross / np.linalg.norm(cross, axis=1, keepdims=True)
        self.lights = self.scene.lights
        self.indices = self.scene.optical_indices(self.ior)

    def all_hits(self, o: np.ndarray, d: np.ndarray, t_max: float) -> dict[int, float]:
        """Every triangle that the ray meets before t_max, and where (Möller and Trumbore)."""
        v0 = self.triangles[:, 0]
        e1, e2 = self.triangles[:, 1] - v0, self.triangles[:, 2] - v0
        p = np.cross(d, e2)
        with np.errstate(all="ignore"):
            det = (e1 * p).sum(axis=1)
            s = o - v0
            u = (s * p).sum(axis=1) / det
            q = np.cross(s, e1)
            v = (q * d).sum(axis=1) / det
            t = (e2 * q).sum(axis=1) / det
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < t_max)
        return {int(k): float(t[k]) for k in np.flatnonzero(hit)}

    def decoded(self, code: int) -> tuple[int, int]:
        """Node and light of a type; light −1 for a surface ray."""
        if code <= 0:
            return -code, -1
        return (code - 1) // len(self.lights), (code - 1) % len(self.lights)

    def emits(self, r: np.ndarray, last: bool) -> list[Emitted]:
        """Listing 4, generalised."""
        state, code, index = int(r[14]), int(r[15]), int(r[11])
        node, light = self.decoded(code)
        o, d = r[4:7].astype(np.float64), r[8:11].astype(np.float64)
        itself = Emitted(3, code, index, r[2], o, d, float(r[7]))
        if state > 1:
            return []
        if index == -1:
            return [itself] if light < 0 and node > 0 and any(self.background) else []
        if light >= 0 or last:
            return [itself]
        return [itself, *self.spawned(r, o, d, node, index)]

    def spawned(self, r: np.ndarray, o: np.ndarray, d: np.ndarray, node: int, index: int) -> list[Emitted]:
        """Shadow rays, reflected ray, refracted ray of a hit."""
        material = self.scene.materials[self.scene.material_ids[index]]
        point, n, epsilon = o + d * float(r[7]), self.normals[index], float(self.scene.epsilon)
        found = []
        for number, light in enumerate(self.lights) if self.shadows else ():
            place = np.array(light.position)
            origin = point + epsilon * (n if (place - point) @ n > 0 else -n)
            distance = float(np.linalg.norm(place - origin))
            code = 1 + number + len(self.lights) * node
            found.append(Emitted(1, code, -1, r[2], origin, (place - origin) / distance, distance))
        cosine = d @ n
        m = n if cosine < 0 else -n
        inside = float(self.indices[index]) if material.kind == "glass" else 1.0
        eta = 1 / inside if cosine < 0 else inside
        k = 1 - eta**2 * (1 - cosine**2)
        rho, tau = np.float32(material.rho), np.float32(material.tau)
        if tau > 0 and k < 0:
            rho, tau = rho + tau, np.float32(0)
        if rho > 0:
            found.append(self._leaves(self.branching * node + 1, r[2] * rho, point, d - 2 * cosine * n, n))
        if tau > 0:
            bent = eta * d + (eta * abs(cosine) - np.sqrt(k)) * m
            found.append(self._leaves(self.branching * node + 2, r[2] * tau, point, bent, n))
        return found

    def _leaves(self, node: int, weight: np.float32, point: np.ndarray, d: np.ndarray, n: np.ndarray) -> Emitted:
        d = d / np.linalg.norm(d)
        origin = point + float(self.scene.epsilon) * (n if d @ n > 0 else -n)
        return Emitted(1, -node, -1, weight, origin, d, np.inf)

    def shades(self, r: np.ndarray) -> Shaded | None:
        """Listing 5 and Eq. 1, a target a light: what replaces a layer's texels, or what extinguishes one."""
        state, code, index = int(r[14]), int(r[15]), int(r[11])
        if state < 3:
            return None
        _, light = self.decoded(code)
        leave, erase = np.array([0.0, 0, 0, 1]), np.zeros(4)
        if light >= 0:
            return Shaded([leave, *(erase if k == light else leave for k in range(len(self.lights)))])
        weight = float(r[2])
        if index == -1:
            return Shaded([np.append(np.array(self.background) * weight, 0), *[erase] * len(self.lights)])
        material = self.scene.materials[self.scene.material_ids[index]]
        color = np.array(material.color) if material.kind == "diffuse" else np.zeros(3)
        o, d = r[4:7].astype(np.float64), r[8:11].astype(np.float64)
        point, n = o + d * float(r[7]), self.normals[index]
        n = n if n @ d < 0 else -n
        targets = [np.append(AMBIENT * color * weight, 0)]
        for source in self.lights:
            towards = np.array(source.position) - point
            towards /= np.linalg.norm(towards)
            cosine = max(float(n @ towards), 0.0)
            shine = max(float(-(2 * cosine * n - towards) @ d), 0.0) ** round(material.shininess) if cosine > 0 else 0.0
            radiance = np.array(source.color) * source.intensity
            targets.append(np.append((color * cosine + material.specular * shine) * radiance * weight, 0))
        return Shaded(targets)
