"""Render targets and blending passes (section 4.4): a layer a node of the ray tree, a target a light, then their sum.

"Ray generations should be sorted and rendered to multiple render targets that blending passes may blend together." The
layers lie one below the other in one framebuffer, as a texture array would; the geometry shader sends each point to the
layer of its node.
"""

from __future__ import annotations

import numpy as np

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.papers.geometry_shader_rays.errata import Printed
from refsim.papers.geometry_shader_rays.fragment_shaders import LayerSize, LayerTextures, layer_colors
from refsim.papers.geometry_shader_rays.passes import COLOR_FORMATS, Corner, blending_pass
from refsim.papers.geometry_shader_rays.setup import Options
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import MAX_TARGET_PIXELS, Framebuffer, Texture, VertexBuffer

# A point's y is off by at most 3 roundings of NDC, 3 · 2⁻²⁴ · 2¹⁹ = 0.1 rows here: it stays in its own
MOST_ROWS = 2**20
CORNERS = VertexBuffer.of(Corner, position=np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]], np.float32))


class Layers:
    """`count` layers of w × h pixels, and the image that their sum is drawn into."""

    def __init__(self, width: int, height: int, count: int, lights: int, options: Options, printed: Printed) -> None:
        if height * count > MOST_ROWS:
            raise InputError(
                f"{options.passes} passes make a tree of {count} rays; {count} layers of {height} rows are more than "
                f"the {MOST_ROWS} rows among which float32 can place a point."
            )
        if width * height * count > MAX_TARGET_PIXELS:
            raise InputError(
                f"{options.passes} passes make a tree of {count} rays; {count} layers of {width} × {height} pixels are "
                "more than a target of 2**28 pixels holds."
            )
        form = COLOR_FORMATS[options.color_format]
        self.width, self.height, self.count = width, height, count
        self.targets = layer_colors(lights)._fields
        self.framebuffer = Framebuffer(width, height * count, {name: form for name in self.targets})
        self.image = Framebuffer(width, height, {"color": form})
        self._background = Framebuffer(1, 1, {"color": form})
        self._background.clear_color("color", (*options.background, 1.0))
        # What the eye sees where nothing is drawn; where everything goes to one target (GSR-E8) it lies there
        self._behind = "light0" if printed.E8 and lights else "unshadowed"

    def clear(self) -> None:
        """All black but the eye's layer, which holds the background."""
        self.framebuffer.floats[:] = 0
        self.framebuffer.invocations[:] = 0
        first = self.framebuffer.color(self._behind)[:3, : self.height]
        first[:] = self._background.color("color")[:3]
        self.image.clear_color("color", 0.0)
        self.image.invocations[:] = 0

    def blend(self, counters: Counters, threads: int | None) -> np.ndarray:
        """Adds every target of every layer to the image, in order; returns it, f32[4, h, w]."""
        draw(
            blending_pass(),
            vertices=CORNERS,
            instances=self.count * len(self.targets),
            uniforms=LayerSize(np.int32(self.height), np.int32(len(self.targets))),
            textures=LayerTextures(Texture(self.framebuffer.floats)),
            framebuffer=self.image,
            counters=counters,
            threads=threads,
        )
        return self.image.color("color")
