"""The method "geometry_shader": section 3's list, step by step, on the pipeline.

    1  two vertex buffers with enough space            `GeometryShaderTracer.__init__`
    2  one is filled with points for primary rays      `fill`
    3  the other is the stream-output target           `draw_passes`
    4  the pipeline with the three shaders             `passes.tracing_pass`
    5  P passes, no change of shaders, no read-back    `draw_passes`
    6  the buffers swap                                `draw_passes`

What the trace reports is copied out between passes; no draw depends on it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.papers.geometry_shader_rays import record
from refsim.papers.geometry_shader_rays.composition import Layers
from refsim.papers.geometry_shader_rays.errata import CORRECTED, Printed
from refsim.papers.geometry_shader_rays.passes import tracing_pass
from refsim.papers.geometry_shader_rays.primary import first_triangles, pinhole
from refsim.papers.geometry_shader_rays.record import PackedHit
from refsim.papers.geometry_shader_rays.setup import Options, Prepared
from refsim.papers.geometry_shader_rays.shaders import Found, Frame, SceneTextures
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import Texture, VertexBuffer
from refsim.scene.rays import Rays

AfterPass = Callable[[int, VertexBuffer, VertexBuffer, Found, Counters], None]


@dataclass(frozen=True)
class Setting:
    """What the geometry shader's method has of its own; names and values as its options."""

    printed: Printed = CORRECTED
    capacity: int | None = None
    emission_order: str = "listed"
    stages: str = "vertex"
    primary: str = "rays"


class GeometryShaderTracer:
    """Buffers, targets and state for pictures of one scene, size and set of options; `draw_passes` makes one."""

    def __init__(self, prepared: Prepared, width: int, height: int, options: Options, setting: Setting) -> None:
        if setting.stages == "vertex_only" and options.passes != 1:
            raise InputError("without a geometry shader no ray is spawned: stages='vertex_only' needs passes=1.")
        self.prepared, self.options, self.setting = prepared, options, setting
        self.width, self.height = width, height
        lights = len(options.lights)
        shadow_rays = lights if options.shadows else 0
        depths = record.rays_of_depth(options.passes, shadow_rays, prepared.branching, prepared.goes_on)
        if setting.printed.E4 and options.reflections:  # every surface mirrors
            depths = record.rays_of_depth(options.passes, shadow_rays, prepared.branching, True)
        self.needed = record.buffer_records(width * height, depths)
        if setting.printed.E3:
            self.needed = width * height * _records_without_end(options.passes, shadow_rays, prepared.branching)
        self.capacity = self.needed if setting.capacity is None else setting.capacity
        _check_size(self.capacity, options)
        if self.capacity < width * height:
            raise InputError(f"capacity is {self.capacity}; the buffer drawn first holds {width * height} eye rays.")
        self.buffers = (self._buffer(self.capacity), self._buffer(self.capacity))
        nodes = record.node_count(options.passes, prepared.branching)
        record.check_types(nodes, lights)
        self.layers = Layers(width, height, nodes, lights, options, setting.printed)
        rows = self.buffers[0].capacity
        made = np.zeros((width * height if setting.printed.E12 else 0, 6), np.float32)
        self.found = Found(np.zeros((rows, 3), np.float32), np.zeros((rows, 4), np.int32), made)
        traverse = prepared.accelerator.traverse
        self._centres = pixel_centres(width, height)
        self.pipeline = tracing_pass(traverse, lights, setting.stages, setting.emission_order)
        self.frame = frame_of(prepared, options, setting, nodes)

    @staticmethod
    def _buffer(capacity: int) -> VertexBuffer:
        return VertexBuffer(PackedHit, capacity)

    def fill(self, rays: Rays) -> VertexBuffer:
        """Step 2: a point at the centre of every pixel, its ray beside it. Dead rays are finished ones."""
        buffer, n = self.buffers[0], len(rays)
        columns = buffer.floats[:, :n]
        columns[record.X : record.WEIGHT] = self._centres[:, :n]
        columns[record.WEIGHT : record.ORIGIN] = 1
        columns[record.ORIGIN : record.T] = rays.origin.T
        columns[record.T] = rays.t_max
        columns[record.DIRECTION : record.INDEX] = rays.direction.T
        columns[record.INDEX] = -1
        columns[record.U : record.STATE] = 0
        columns[record.STATE] = np.where(rays.t_max > 0, record.TO_BE_MADE, record.SHADED)
        columns[record.TYPE] = 0
        buffer.clear()
        buffer.count = n
        return buffer

    def draw_passes(self, rays: Rays, counters: Counters, after: AfterPass | None = None) -> np.ndarray:
        """Steps 2 to 6 and the blending passes: the image f32[4, h, w]. `after` sees each pass's buffers."""
        o = self.options
        source, target = self.fill(rays), self.buffers[1]
        frame, first = self._primary(rays, counters)
        t = self.prepared.textures
        textures = SceneTextures(self.prepared.accelerator.structure, t.triangles, t.surfaces, first, self.found)
        self.layers.clear()
        for k in range(o.passes):
            target.clear()
            counted = Counters()
            draw(
                self.pipeline,
                vertices=source,
                uniforms=frame._replace(last=np.int32(k == o.passes - 1)),
                textures=textures,
                framebuffer=self.layers.framebuffer,
                stream_output=target if self.pipeline.stream_output else None,
                counters=counted,
                taps=o.taps,
                threads=o.threads,
            )
            counters.merge(counted)
            self._check_room(k, target)
            if after is not None:
                after(k, source, target, self.found, counted)
            source, target = target, source
        return self.layers.blend(counters, o.threads)

    def _primary(self, rays: Rays, counters: Counters) -> tuple[Frame, Texture]:
        """Section 6's first pass, and what Listing 3 as printed makes its eye rays of."""
        first, frame = Texture(np.full((1, 1, 1), -1, np.int32)), self.frame
        if self.setting.primary == "raster":
            o = self.options
            facing = "front" if o.front_only else "both"
            first = first_triangles(self.prepared.scene, rays, counters, o.threads, o.taps, facing=facing)
        if self.setting.printed.E12:
            frame = frame._replace(camera=printed_camera(rays))
        return frame, first

    def _check_room(self, k: int, target: VertexBuffer) -> None:
        if target.overflowed:
            raise InputError(
                f"geometry_shader: pass {k} had {target.overflowed} rays more than the stream-output buffer's "
                f"{target.capacity} records hold; S_VB needs {self.needed} records of 64 bytes."
            )


def frame_of(prepared: Prepared, o: Options, setting: Setting, nodes: int) -> Frame:
    """The uniforms of a pass that is not the last, for a tree of `nodes` surface rays."""
    return Frame(
        lights=np.array([light.position for light in o.lights], np.float32).reshape(-1, 3),
        radiances=np.array([light.radiance for light in o.lights], np.float32).reshape(-1, 3),
        background=tuple(np.float32(part) for part in o.background),  # type: ignore[arg-type]
        epsilon=prepared.scene.epsilon,
        branching=np.int32(prepared.branching),
        layers=np.int32(nodes),
        last=np.int32(0),
        shadows=np.int32(o.shadows),
        reflections=np.int32(o.reflections),
        refractions=np.int32(o.refractions),
        front_only=np.int32(o.front_only),
        smooth=np.int32(o.smooth),
        rasterised=np.int32(setting.primary == "raster"),
        camera=np.zeros((4, 3), np.float32),
        printed=Printed(*(np.int32(switch) for switch in setting.printed)),
    )


def pixel_centres(width: int, height: int) -> np.ndarray:
    """NDC of the centres of all pixels, row by row: f32[2, width · height] (section 4.3)."""
    y, x = np.divmod(np.arange(width * height), width)
    return np.stack([(x + 0.5) / width * 2 - 1, 1 - (y + 0.5) / height * 2]).astype(np.float32)


def printed_camera(rays: Rays) -> np.ndarray:
    """Eye, right, up, forward f32[4, 3] of Listing 3's ``rot3``: unit axes, so that ±1 is 45 degrees off the view."""
    eye, right, up, forward = (np.asarray(vector, np.float64) for vector in pinhole(rays))
    axes = [vector / np.linalg.norm(vector) for vector in (right, up, forward)]
    return np.stack([eye, *axes]).astype(np.float32)


def _records_without_end(passes: int, lights: int, branching: int) -> int:
    """Records a pixel has when rays passed on are shot again and spawn again (GSR-E3 as printed)."""
    surfaces, shadows = 1, 0
    for _ in range(passes - 1):
        surfaces, shadows = surfaces * (1 + branching), shadows + surfaces * lights
    return surfaces + shadows


def _check_size(records: int, options: Options) -> None:
    most = 2**31 // record.RECORD_BYTES * 8  # 16 GiB a buffer
    if records > most:
        raise InputError(
            f"geometry_shader: {options.passes} passes and {len(options.lights)} lights need vertex buffers of "
            f"{records} records of 64 bytes; {most} are the most."
        )
