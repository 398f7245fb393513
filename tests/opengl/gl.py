"""The OpenGL entry points that moderngl has no words for, found through eglGetProcAddress and called through ctypes.

`GL()` holds one function per name of `_ARGUMENTS`; a letter stands for an argument: e enum or name, i int, f float,
d double, b boolean, z size or offset, p pointer. An OpenGL error after a call of `checked` is an exception. Constants
are the values of the OpenGL registry (gl.xml).
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

_ARGUMENTS = {
    "glGetError": "",
    "glFinish": "",
    "glGetIntegerv": "ep",
    "glGetString": "e",
    "glEnable": "e",
    "glDisable": "e",
    "glEnablei": "ee",
    "glDisablei": "ee",
    "glViewport": "iiii",
    "glScissor": "iiii",
    "glViewportIndexedf": "effff",
    "glDepthRange": "dd",
    "glClipControl": "ee",
    "glProvokingVertex": "e",
    "glFrontFace": "e",
    "glCullFace": "e",
    "glPolygonOffsetClamp": "fff",
    "glDepthFunc": "e",
    "glDepthMask": "b",
    "glStencilFuncSeparate": "eeie",
    "glStencilOpSeparate": "eeee",
    "glStencilMaskSeparate": "ee",
    "glBlendFuncSeparatei": "eeeee",
    "glBlendEquationSeparatei": "eee",
    "glBlendColor": "ffff",
    "glColorMaski": "ebbbb",
    "glGenTextures": "ip",
    "glDeleteTextures": "ip",
    "glBindTexture": "ee",
    "glTexImage2D": "eiiiiieep",
    "glGetTexImage": "eieep",
    "glTexParameteri": "eei",
    "glPixelStorei": "ei",
    "glGenFramebuffers": "ip",
    "glDeleteFramebuffers": "ip",
    "glBindFramebuffer": "ee",
    "glFramebufferTexture2D": "eeeei",
    "glDrawBuffers": "ip",
    "glCheckFramebufferStatus": "e",
    "glClearBufferfv": "eip",
    "glClearBufferfi": "eifi",
    "glUseProgram": "e",
    "glBindVertexArray": "e",
    "glGenVertexArrays": "ip",
    "glDeleteVertexArrays": "ip",
    "glGenBuffers": "ip",
    "glDeleteBuffers": "ip",
    "glBindBuffer": "ee",
    "glBindBufferBase": "eee",
    "glBufferData": "ezpe",
    "glGetBufferSubData": "ezzp",
    "glEnableVertexAttribArray": "e",
    "glVertexAttribPointer": "eiebiz",
    "glVertexAttribIPointer": "eieiz",
    "glVertexAttribDivisor": "ee",
    "glDrawArraysInstanced": "eiii",
    "glDrawElementsInstanced": "eiezi",
    "glGenTransformFeedbacks": "ip",
    "glDeleteTransformFeedbacks": "ip",
    "glBindTransformFeedback": "ee",
    "glBeginTransformFeedback": "e",
    "glEndTransformFeedback": "",
    "glDrawTransformFeedback": "ee",
    "glGenQueries": "ip",
    "glDeleteQueries": "ip",
    "glBeginQuery": "ee",
    "glEndQuery": "e",
    "glGetQueryObjectui64v": "eep",
}
_TYPES: dict[str, Any] = {
    "e": ctypes.c_uint, "i": ctypes.c_int, "f": ctypes.c_float, "d": ctypes.c_double, "b": ctypes.c_ubyte,
    "z": ctypes.c_ssize_t, "p": ctypes.c_void_p,
}  # fmt: skip
_RETURNS = {"glGetError": ctypes.c_uint, "glCheckFramebufferStatus": ctypes.c_uint, "glGetString": ctypes.c_char_p}

NO_ERROR = 0
POINTS, TRIANGLES, TRIANGLE_STRIP = 0x0000, 0x0004, 0x0005
FRONT, BACK, FRONT_AND_BACK = 0x0404, 0x0405, 0x0408
CW, CCW = 0x0900, 0x0901
CULL_FACE, DEPTH_TEST, STENCIL_TEST, BLEND, SCISSOR_TEST = 0x0B44, 0x0B71, 0x0B90, 0x0BE2, 0x0C11
PROGRAM_POINT_SIZE, POLYGON_OFFSET_FILL, RASTERIZER_DISCARD, DITHER = 0x8642, 0x8037, 0x8C89, 0x0BD0
UPPER_LEFT, ZERO_TO_ONE, FIRST_VERTEX_CONVENTION = 0x8CA2, 0x935F, 0x8E4D
SUBPIXEL_BITS, VENDOR, RENDERER, VERSION = 0x0D50, 0x1F00, 0x1F01, 0x1F02
UNPACK_ALIGNMENT, PACK_ALIGNMENT = 0x0CF5, 0x0D05
UNSIGNED_BYTE, INT, UNSIGNED_INT, FLOAT = 0x1401, 0x1404, 0x1405, 0x1406
COLOR, DEPTH_STENCIL = 0x1800, 0x84F9
UNSIGNED_INT_24_8, FLOAT_32_UNSIGNED_INT_24_8_REV = 0x84FA, 0x8DAD
DEPTH24_STENCIL8, DEPTH32F_STENCIL8 = 0x88F0, 0x8CAD
TEXTURE_2D, TEXTURE_MIN_FILTER, TEXTURE_MAG_FILTER, NEAREST = 0x0DE1, 0x2801, 0x2800, 0x2600
FRAMEBUFFER, COLOR_ATTACHMENT0, DEPTH_STENCIL_ATTACHMENT, FRAMEBUFFER_COMPLETE = 0x8D40, 0x8CE0, 0x821A, 0x8CD5
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, STATIC_DRAW = 0x8892, 0x8893, 0x88E4
TRANSFORM_FEEDBACK, TRANSFORM_FEEDBACK_BUFFER = 0x8E22, 0x8C8E
QUERY_RESULT = 0x8866
PRIMITIVES_GENERATED, PRIMITIVES_WRITTEN, SAMPLES_PASSED = 0x8C87, 0x8C88, 0x8914
VERTICES_SUBMITTED, PRIMITIVES_SUBMITTED, VERTEX_INVOCATIONS = 0x82EE, 0x82EF, 0x82F0
GEOMETRY_INVOCATIONS, GEOMETRY_PRIMITIVES, CLIPPING_INPUT = 0x887F, 0x82F3, 0x82F6


class GLError(RuntimeError):
    """An OpenGL call was refused."""


class GL:
    """The functions of `_ARGUMENTS`, of the context that is current when they are called."""

    def __init__(self) -> None:
        find = ctypes.CDLL("libEGL.so.1").eglGetProcAddress
        find.restype, find.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
        self._functions: dict[str, Callable[..., Any]] = {}
        for name, letters in _ARGUMENTS.items():
            address = find(name.encode())
            if not address:
                raise GLError(f"{name} is not there.")
            kind = ctypes.CFUNCTYPE(_RETURNS.get(name), *(_TYPES[letter] for letter in letters))
            self._functions[name] = kind(address)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        return self._functions[name]

    def check(self, what: str) -> None:
        """Raises `GLError` if a call since the last check was refused."""
        error = self.glGetError()
        if error != NO_ERROR:
            raise GLError(f"{what}: OpenGL error 0x{error:04x}.")

    def new(self, kind: str) -> int:
        """A new object; `kind` is "Textures", "Buffers", "Queries" …"""
        name = ctypes.c_uint()
        self._functions[f"glGen{kind}"](1, ctypes.byref(name))
        return name.value

    def delete(self, kind: str, name: int) -> None:
        """Deletes an object made by `new`."""
        self._functions[f"glDelete{kind}"](1, ctypes.byref(ctypes.c_uint(name)))

    def integer(self, what: int) -> int:
        """One integer of the context's state."""
        value = ctypes.c_int()
        self.glGetIntegerv(what, ctypes.byref(value))
        return value.value

    def text(self, what: int) -> str:
        """One string of the context."""
        return str((self.glGetString(what) or b"").decode())
