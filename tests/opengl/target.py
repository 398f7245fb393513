"""A framebuffer of OpenGL whose planes go in and come out as refsim's: [component, row, column], row 0 at the top.

Colour targets are textures in the formats of `TextureFormat`; 8-bit planes are uint8. Depth is in the units of its
format: float32, or whole 1 / (2^24 − 1).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from refsim.pipeline.state import DepthStencilFormat, TextureFormat
from tests.opengl import gl as c
from tests.opengl.gl import GL, GLError

# Internal format and format, both of the registry
_FORMATS = {
    TextureFormat.R8UNORM: (0x8229, 0x1903),
    TextureFormat.RG8UNORM: (0x822B, 0x8227),
    TextureFormat.RGBA8UNORM: (0x8058, 0x1908),
    TextureFormat.R32FLOAT: (0x822E, 0x1903),
    TextureFormat.RG32FLOAT: (0x8230, 0x8227),
    TextureFormat.RGBA32FLOAT: (0x8814, 0x1908),
    TextureFormat.R32SINT: (0x8235, 0x8D94),
    TextureFormat.RG32SINT: (0x823B, 0x8228),
    TextureFormat.RGBA32SINT: (0x8D82, 0x8D99),
}
_FLOAT_AND_STENCIL = np.dtype([("depth", "<f4"), ("stencil", "<u4")])


class Planes(NamedTuple):
    """Everything a framebuffer holds: `color` by target, `depth` and `stencil` [h, w]."""

    color: dict[str, np.ndarray]
    depth: np.ndarray
    stencil: np.ndarray


def dtype_of(form: TextureFormat) -> type:
    """The type of a target's planes as compared here."""
    return np.uint8 if form.is_unorm8 else (np.float32 if form.is_float else np.int32)


def blank(width: int, height: int, targets: Mapping[str, TextureFormat], depth: DepthStencilFormat) -> Planes:
    """Targets and stencil 0, depth 1."""
    far = 1.0 if depth == DepthStencilFormat.DEPTH32FLOAT_STENCIL8 else 2.0**24 - 1
    color = {name: np.zeros((form.components, height, width), dtype_of(form)) for name, form in targets.items()}
    return Planes(color, np.full((height, width), far, np.float32), np.zeros((height, width), np.uint8))


class Target:
    """An OpenGL framebuffer filled with `planes`; bound for drawing by `__enter__`, deleted by `__exit__`."""

    def __init__(
        self, gl: GL, targets: Mapping[str, TextureFormat], depth_format: DepthStencilFormat, planes: Planes
    ) -> None:
        self.gl, self.targets, self.depth_format = gl, dict(targets), depth_format
        self.height, self.width = planes.depth.shape
        self._textures = {name: self._color(form, planes.color[name]) for name, form in targets.items()}
        self._depth = self._depth_stencil(planes)
        self._name = gl.new("Framebuffers")

    def __enter__(self) -> Target:
        gl = self.gl
        gl.glBindFramebuffer(c.FRAMEBUFFER, self._name)
        for k, texture in enumerate(self._textures.values()):
            gl.glFramebufferTexture2D(c.FRAMEBUFFER, c.COLOR_ATTACHMENT0 + k, c.TEXTURE_2D, texture, 0)
        gl.glFramebufferTexture2D(c.FRAMEBUFFER, c.DEPTH_STENCIL_ATTACHMENT, c.TEXTURE_2D, self._depth, 0)
        buffers = np.arange(len(self._textures), dtype=np.uint32) + c.COLOR_ATTACHMENT0
        gl.glDrawBuffers(len(buffers), buffers.ctypes.data)
        if (status := gl.glCheckFramebufferStatus(c.FRAMEBUFFER)) != c.FRAMEBUFFER_COMPLETE:
            raise GLError(f"framebuffer of {', '.join(self.targets.values())}: status 0x{status:04x}.")
        return self

    def __exit__(self, *_: object) -> None:
        self.gl.glBindFramebuffer(c.FRAMEBUFFER, 0)
        self.gl.delete("Framebuffers", self._name)
        for texture in (*self._textures.values(), self._depth):
            self.gl.delete("Textures", texture)

    def _texture(self, internal: int, form: int, kind: int, pixels: np.ndarray) -> int:
        gl, name = self.gl, self.gl.new("Textures")
        gl.glBindTexture(c.TEXTURE_2D, name)
        gl.glPixelStorei(c.UNPACK_ALIGNMENT, 1)
        gl.glTexImage2D(c.TEXTURE_2D, 0, internal, self.width, self.height, 0, form, kind, pixels.ctypes.data)
        gl.glTexParameteri(c.TEXTURE_2D, c.TEXTURE_MIN_FILTER, c.NEAREST)
        gl.glTexParameteri(c.TEXTURE_2D, c.TEXTURE_MAG_FILTER, c.NEAREST)
        gl.check("glTexImage2D")
        return name

    def _color(self, form: TextureFormat, planes: np.ndarray) -> int:
        internal, layout = _FORMATS[form]
        pixels = np.ascontiguousarray(np.moveaxis(planes, 0, -1), dtype_of(form))
        return self._texture(internal, layout, _kind(form), pixels)

    def _depth_stencil(self, planes: Planes) -> int:
        if self.depth_format == DepthStencilFormat.DEPTH24UNORM_STENCIL8:
            units = planes.depth.astype(np.uint32) << 8 | planes.stencil
            return self._texture(c.DEPTH24_STENCIL8, c.DEPTH_STENCIL, c.UNSIGNED_INT_24_8, units)
        pixels = np.empty((self.height, self.width), _FLOAT_AND_STENCIL)
        pixels["depth"], pixels["stencil"] = planes.depth, planes.stencil
        return self._texture(c.DEPTH32F_STENCIL8, c.DEPTH_STENCIL, c.FLOAT_32_UNSIGNED_INT_24_8_REV, pixels)

    def _read(self, texture: int, form: int, kind: int, pixels: np.ndarray) -> np.ndarray:
        self.gl.glBindTexture(c.TEXTURE_2D, texture)
        self.gl.glPixelStorei(c.PACK_ALIGNMENT, 1)
        self.gl.glGetTexImage(c.TEXTURE_2D, 0, form, kind, pixels.ctypes.data)
        self.gl.check("glGetTexImage")
        return pixels

    def planes(self) -> Planes:
        """What the framebuffer holds now."""
        shape = (self.height, self.width)
        color = {}
        for name, form in self.targets.items():
            pixels = np.empty((*shape, form.components), dtype_of(form))
            self._read(self._textures[name], _FORMATS[form][1], _kind(form), pixels)
            color[name] = np.ascontiguousarray(np.moveaxis(pixels, -1, 0))
        if self.depth_format == DepthStencilFormat.DEPTH24UNORM_STENCIL8:
            units = self._read(self._depth, c.DEPTH_STENCIL, c.UNSIGNED_INT_24_8, np.empty(shape, np.uint32))
            return Planes(color, (units >> 8).astype(np.float32), (units & 0xFF).astype(np.uint8))
        both = np.empty(shape, _FLOAT_AND_STENCIL)
        self._read(self._depth, c.DEPTH_STENCIL, c.FLOAT_32_UNSIGNED_INT_24_8_REV, both)
        return Planes(color, both["depth"].copy(), both["stencil"].astype(np.uint8))


def _kind(form: TextureFormat) -> int:
    return c.UNSIGNED_BYTE if form.is_unorm8 else (c.FLOAT if form.is_float else c.INT)
