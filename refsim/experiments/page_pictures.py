"""Pictures in the page itself: every pixel as drawn, in fewer bytes.

A PNG becomes a lossless WebP where that is smaller, and a data URI. Transparency goes: pictures stand on white.
"""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from PIL.Image import Image

WIDE = 6.0  # inches, from which on letters get too small where the picture is shrunk to a telephone's width
SCREEN_DPI = 150.0  # of a picture that does not say
EFFORT = {"lossless": True, "quality": 30, "method": 2}  # more effort takes longer and saves little


@dataclass(frozen=True)
class Embedded:
    """A picture as a data URI, its size in pixels, and whether it is too wide for a telephone."""

    uri: str
    width: int
    height: int
    wide: bool


def embedded(path: Path) -> Embedded:
    """The picture in `path`."""
    from PIL import Image, features

    data, kind = path.read_bytes(), "png"
    with Image.open(io.BytesIO(data)) as picture:
        size = picture.size
        inches = picture.width / picture.info.get("dpi", (SCREEN_DPI,))[0]
        if features.check("webp"):
            smaller = io.BytesIO()
            _on_white(picture).save(smaller, "WEBP", **EFFORT)
            if smaller.tell() < len(data):
                data, kind = smaller.getvalue(), "webp"
    text = base64.b64encode(data).decode("ascii")
    return Embedded(f"data:image/{kind};base64,{text}", *size, inches > WIDE)


def _on_white(picture: Image) -> Image:
    from PIL import Image

    if picture.mode == "RGB":
        return picture
    white = Image.new("RGBA", picture.size, "white")
    return Image.alpha_composite(white, picture.convert("RGBA")).convert("RGB")
