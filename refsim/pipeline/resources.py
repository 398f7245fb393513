"""What a draw reads and writes: textures, the framebuffer, vertex buffers. Plain arrays, stored as planes.

Framebuffer origin is top-left, pixel centres at .5, rows first (WebGPU). A texture is ``data[component, y, x]``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, cast

import numpy as np

from refsim.errors import InputError
from refsim.jit import func
from refsim.pipeline.blend import clear_values
from refsim.pipeline.depth import clear_value
from refsim.pipeline.state import DepthStencilFormat, TextureFormat, member
from refsim.pipeline.vertex_buffer import VertexBuffer as VertexBuffer

MAX_TARGET_PIXELS = 2**28


class Texture(NamedTuple):
    """Planes ``[component, height, width]``, float32 or int32. Shaders fetch from it with `texel…` (no filtering)."""

    data: np.ndarray


class Texture3D(NamedTuple):
    """Texels ``[height, width, depth, component]``: those of one (x, y) lie together, whatever their depth slice."""

    data: np.ndarray


@func
def texel1(texture: Any, x: Any, y: Any) -> Any:
    """Component 0 at pixel (x, y)."""
    return texture.data[0, y, x]


@func
def texel3(texture: Any, x: Any, y: Any) -> Any:
    """Components 0–2 at pixel (x, y)."""
    return texture.data[0, y, x], texture.data[1, y, x], texture.data[2, y, x]


@func
def texel4(texture: Any, x: Any, y: Any) -> Any:
    """Components 0–3 at pixel (x, y)."""
    return texture.data[0, y, x], texture.data[1, y, x], texture.data[2, y, x], texture.data[3, y, x]


@func
def slice4(texture: Any, x: Any, y: Any, z: Any) -> Any:
    """Components 0–3 of a `Texture3D` at (x, y) in depth slice z."""
    t = texture.data
    return t[y, x, z, 0], t[y, x, z, 1], t[y, x, z, 2], t[y, x, z, 3]


class Framebuffer:
    """Colour targets, depth, stencil, and the number of fragment-shader invocations per pixel.

    `floats` f32[planes, h, w] and `ints` i32[planes, h, w] hold all colour targets in the order given; `color(name)`
    is a view. `depth` is f32[h, w] in the units of `depth_format`, `stencil` uint8[h, w], `invocations` int32[h, w]
    (logical invocations, summed over draws until cleared). A target of an 8-bit format holds float32 k / 255.
    """

    def __init__(
        self,
        width: int,
        height: int,
        targets: Mapping[str, TextureFormat],
        depth_format: DepthStencilFormat = DepthStencilFormat.DEPTH32FLOAT_STENCIL8,
    ) -> None:
        whole = all(isinstance(size, int | np.integer) for size in (width, height))
        if not whole or width < 1 or height < 1 or width * height > MAX_TARGET_PIXELS:
            raise InputError(f"a framebuffer of {width} × {height} pixels cannot be made; give 1 to 2**28 pixels.")
        self.width, self.height = int(width), int(height)
        if not isinstance(targets, Mapping) or not all(isinstance(name, str) for name in targets):
            raise InputError(f"framebuffer: targets must map names to formats, not {targets!r}.")
        formats = {name: member("framebuffer", name, TextureFormat, form) for name, form in targets.items()}
        self.targets = cast(dict[str, TextureFormat], formats)
        checked = member("framebuffer", "depth_format", DepthStencilFormat, depth_format)
        self.depth_format = cast(DepthStencilFormat, checked)
        float_planes = sum(form.components for form in self.targets.values() if form.is_float)
        int_planes = sum(form.components for form in self.targets.values() if not form.is_float)
        shape = (self.height, self.width)
        self.floats = np.zeros((float_planes, *shape), np.float32)
        self.ints = np.zeros((int_planes, *shape), np.int32)
        self.depth = np.empty(shape, np.float32)
        self.stencil = np.zeros(shape, np.uint8)
        self.invocations = np.zeros(shape, np.int32)
        self.clear_depth()

    def color(self, name: str) -> np.ndarray:
        """The planes [component, h, w] of target `name`: a view, no copy."""
        first = {True: 0, False: 0}
        for target, form in self.targets.items():
            if target == name:
                planes = self.floats if form.is_float else self.ints
                return planes[first[form.is_float] : first[form.is_float] + form.components]
            first[form.is_float] += form.components
        raise InputError(f"the framebuffer has no target {name!r}; it has {', '.join(self.targets)}.")

    def texture(self, name: str) -> Texture:
        """Target `name` as a texture for a later draw."""
        return Texture(self.color(name))

    def clear_color(self, name: str, value: float | tuple[float, ...]) -> None:
        """Sets every pixel of target `name` to `value` (a scalar, or one number a component) as its format holds it."""
        planes, values = self.color(name), np.reshape(value, (-1, 1, 1))
        if len(values) not in (1, len(planes)):
            raise InputError(f"target {name!r} has {len(planes)} components, {len(values)} were given.")
        planes[:] = clear_values(self.targets[name], values)

    def bytes(self, name: str) -> np.ndarray:
        """The 8-bit values uint8[component, h, w] of target `name`: a copy. Raises `InputError` for other formats."""
        planes = self.color(name)
        if not self.targets[name].is_unorm8:
            raise InputError(f"target {name!r} is {self.targets[name].value}, which holds no bytes.")
        return np.rint(planes * np.float32(255)).astype(np.uint8)

    def clear_depth(self, value: float = 1.0) -> None:
        """Sets every depth to `value` in [0, 1]."""
        self.depth[:] = clear_value(self.depth_format, value)

    def clear_stencil(self, value: int = 0) -> None:
        """Sets every stencil value."""
        self.stencil[:] = value & 0xFF
