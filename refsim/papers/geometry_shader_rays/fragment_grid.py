"""The method "fragment_grid": rays are pixels and the fragment shader traces, one pass a ray generation.

The previous work that the paper is compared with in Figure 4b and Tables 2 and 3 (Ralovich 2007, its reference 6): the
same scene, structure and shading as the geometry shader's method, but a viewport quad in the place of points and render
targets in the place of stream output. "A ray generation is for example the first level of shadow rays only (without
mixing different type of rays)" (section 1): the rays of one node of the pixels' ray tree (`record`), or the shadow rays
from their hits towards one light. Per node, in order:

    1  the node's surface rays are made from the parent's hits and intersected    `shooting_pass`
    2  ambient light and background are added to the image                        `lighting_pass`
    3  for each light: shadow rays are made and intersected (any hit), if another depth follows;
       what that light gives where nothing hides it is added to the image

The nodes of a depth keep their targets until those of the next are shot: the paper's "large number of textures (render
targets) to emulate a stack". Nothing is read back, so the passes depend on options and materials alone: a node that no
pixel reaches is drawn all the same. The image is the geometry shader's, bit for bit: it is summed in the order of
`composition`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.papers.geometry_shader_rays import record
from refsim.papers.geometry_shader_rays.composition import CORNERS
from refsim.papers.geometry_shader_rays.fragment_grid_shaders import (
    LitTexels,
    LitTextures,
    NoVaryings,
    QuadFrame,
    SenderTexels,
    Shot,
    ShotTextures,
    lighting_fragment,
    quad_vertex,
    shooting_fragment,
)
from refsim.papers.geometry_shader_rays.fragment_shaders import Picture
from refsim.papers.geometry_shader_rays.passes import COLOR_FORMATS, SUM, Corner
from refsim.papers.geometry_shader_rays.setup import Options, Prepared
from refsim.papers.geometry_shader_rays.tracer import Setting, frame_of
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import MAX_TARGET_PIXELS, Framebuffer, Texture
from refsim.pipeline.state import (
    ColorTargetState,
    FragmentState,
    Pipeline,
    PrimitiveTopology,
    TextureFormat,
    VertexBufferLayout,
    VertexState,
)
from refsim.results import RayKind
from refsim.scene.rays import Rays

RAY_TARGETS = {
    "origin": TextureFormat.RGBA32FLOAT,
    "direction": TextureFormat.RGBA32FLOAT,
    "hit": TextureFormat.RGBA32FLOAT,
    "counts": TextureFormat.RGB32SINT,
}


class Shooting(NamedTuple):
    """A ray generation: its kind, its node, its light (−1 none), and the node whose hits send it (−1 none)."""

    kind: RayKind
    node: int
    light: int
    sender: int


class RayTextures(NamedTuple):
    """The textures of a generation of rays; of eye rays before they are shot: no hit."""

    origin: Texture
    direction: Texture
    hit: Texture


AfterPass = Callable[[Shooting, Framebuffer, Counters], None]


def _quad(fragment: FragmentState, label: str) -> Pipeline:
    vertex = VertexState(quad_vertex, NoVaryings, (VertexBufferLayout(Corner),))
    return Pipeline(vertex, fragment, PrimitiveTopology.QUAD_LIST, label=label)


@cache
def shooting_pass(traverse: Any) -> Pipeline:
    """Makes and intersects the rays of any generation: their kind is a uniform."""
    return _quad(FragmentState(shooting_fragment(traverse), Shot, SenderTexels), "rays in the fragment shader")


@cache
def lighting_pass() -> Pipeline:
    """Adds what surface rays see to the image."""
    return _quad(FragmentState(lighting_fragment, Picture, LitTexels, targets=(ColorTargetState(SUM),)), "lighting")


class FragmentGridTracer:
    """State for pictures of one scene, size and set of options; `draw_passes` makes one."""

    def __init__(self, prepared: Prepared, width: int, height: int, options: Options) -> None:
        self.prepared, self.options = prepared, options
        self.width, self.height = width, height
        nodes = record.node_count(options.passes, prepared.branching) if prepared.goes_on else 1
        if width * height * nodes > MAX_TARGET_PIXELS:
            raise InputError(
                f"fragment_grid: {options.passes} passes make a tree of {nodes} rays; the targets of as many ray "
                f"generations of {width} × {height} pixels are more than 2**28 pixels."
            )
        self.nodes = nodes
        self.frame = frame_of(prepared, options, Setting(), nodes)
        self.image = Framebuffer(width, height, {"color": COLOR_FORMATS[options.color_format]})
        self._nothing = Texture(np.full((4, height, width), -1, np.float32))

    def draw_passes(self, rays: Rays, counters: Counters, after: AfterPass | None = None) -> np.ndarray:
        """All passes: the image f32[4, h, w]. `after` sees what the pass of each ray generation drew."""
        self.image.clear_color("color", 0.0)
        self.image.invocations[:] = 0
        shadows = Framebuffer(self.width, self.height, RAY_TARGETS)
        depth = [Shooting(RayKind.EYE, 0, -1, -1)]
        senders = {-1: self._eye_textures(rays)}
        for k in range(self.options.passes):
            shot: dict[int, RayTextures] = {}
            for surface in depth:
                target = Framebuffer(self.width, self.height, RAY_TARGETS)
                self._shoot(surface, senders[surface.sender], target, counters, after)
                mine = shot[surface.node] = RayTextures(*(target.texture(name) for name in RayTextures._fields))
                self._light(surface, mine, self._nothing, counters)
                for light in range(len(self.options.lights)):
                    shadow = Shooting(RayKind.SHADOW, surface.node, light, surface.node)
                    occluders = self._nothing
                    if self.options.shadows and k < self.options.passes - 1:
                        self._shoot(shadow, mine, shadows, counters, after)
                        occluders = shadows.texture("hit")
                    self._light(shadow, mine, occluders, counters)
            depth = [child for surface in depth for child in self.children(surface.node)]
            senders = shot
        return self.image.color("color")

    def children(self, node: int) -> list[Shooting]:
        """The surface rays that the hits of a node can send out."""
        b = self.prepared.branching
        sent = [(RayKind.REFLECTED, b * node + 1)] if self.options.reflections else []
        sent += [(RayKind.REFRACTED, b * node + 2)] if b == 2 else []
        return [Shooting(kind, child, -1, node) for kind, child in sent if child < self.nodes]

    def _eye_textures(self, rays: Rays) -> RayTextures:
        """Eye rays as texels; where there are fewer than pixels, the others are dead."""
        n = len(rays)
        origin, direction = (np.zeros((4, self.height * self.width), np.float32) for _ in range(2))
        origin[:3, :n], origin[3, :n] = rays.origin.T, rays.t_max
        direction[:3, :n], direction[3] = rays.direction.T, 1
        shape = (4, self.height, self.width)
        return RayTextures(Texture(origin.reshape(shape)), Texture(direction.reshape(shape)), self._nothing)

    def _uniforms(self, shooting: Shooting) -> QuadFrame:
        unorm8 = COLOR_FORMATS[self.options.color_format].is_unorm8
        numbers = (shooting.kind, shooting.node, shooting.light, unorm8)
        return QuadFrame(self.frame, *(np.int32(number) for number in numbers))

    def _shoot(
        self, shooting: Shooting, sender: RayTextures, target: Framebuffer, counters: Counters, after: AfterPass | None
    ) -> None:
        """The pass of one ray generation; every pixel of `target` is written."""
        counted, accelerator, t = Counters(), self.prepared.accelerator, self.prepared.textures
        draw(
            shooting_pass(accelerator.traverse),
            vertices=CORNERS,
            uniforms=self._uniforms(shooting),
            textures=ShotTextures(accelerator.structure, t.triangles, t.surfaces, *sender),
            framebuffer=target,
            counters=counted,
            taps=self.options.taps,
            threads=self.options.threads,
        )
        counters.merge(counted)
        if after is not None:
            after(shooting, target, counted)

    def _light(self, shooting: Shooting, surface: RayTextures, occluders: Texture, counters: Counters) -> None:
        """Adds one term of the node's surface rays to the image: without a light what no shadow takes away."""
        t = self.prepared.textures
        draw(
            lighting_pass(),
            vertices=CORNERS,
            uniforms=self._uniforms(shooting),
            textures=LitTextures(t.triangles, t.surfaces, *surface, occluders),
            framebuffer=self.image,
            counters=counters,
            taps=self.options.taps,
            threads=self.options.threads,
        )
