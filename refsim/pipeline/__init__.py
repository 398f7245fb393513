"""A software pipeline behind one call: vertex, geometry, stream output, raster, fragment, stencil, depth and blend
stages. Knows nothing of rays.

    from refsim.pipeline import FragmentState, Framebuffer, Pipeline, VertexState, vec4
    from refsim.pipeline.draw import draw

Shader signatures stand at `VertexState` and `FragmentState`; names are looked up when first used.
"""

from __future__ import annotations

import importlib
from typing import Any

_HOMES = {
    "enums": ("FragmentFate", "PrimitiveFate"),
    "geometry": ("EMIT", "EMIT_AND_END", "SKIP"),
    "layout": ("f32", "i32", "ivec2", "ivec3", "ivec4", "vec2", "vec3", "vec4"),
    "resources": ("Framebuffer", "Texture", "VertexBuffer", "texel1", "texel3", "texel4"),
    "interpolation": ("Interpolation",),
    "state": (
        "BlendComponent", "BlendFactor", "BlendOperation", "BlendState", "ColorTargetState", "ColorWrite",
        "CompareFunction", "CullMode", "DepthStencilFormat", "DepthStencilState", "DynamicState", "EarlyTests",
        "FragmentState", "FrontFace", "GeometryState", "Pipeline", "PrimitiveTopology", "ScissorRect",
        "StencilFaceState", "StencilOperation", "StreamOutputState", "TextureFormat", "VertexBufferLayout",
        "VertexState", "VertexStepMode", "Viewport",
    ),
    "taps": ("FragmentTap", "GeometryTap", "RasterTap", "StreamOutputTap", "Taps", "VertexTap"),
}  # fmt: skip
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = sorted(_HOME_OF)


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'refsim.pipeline' has no attribute {name!r}")
    return getattr(importlib.import_module(f"refsim.pipeline.{_HOME_OF[name]}"), name)


def __dir__() -> list[str]:
    return __all__
