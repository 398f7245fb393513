"""Lists and rays as what shaders read: linear textures, ray textures, vertex buffers, targets.

"We used 1D texture caches to store the triangles and vertices" (section 4): a list is a one-dimensional texture of
linear memory, bound where it lies. Nothing is copied, so a list that was updated is seen at once. In CUDA such a
texture has at most 2²⁷ texels; more are refused.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.papers.sphere_hierarchy.directions import list_of_rays
from refsim.papers.sphere_hierarchy.lists import TraversalLists
from refsim.papers.sphere_hierarchy.shaders import Best, EntryVertex, ListTextures, RayVertex
from refsim.pipeline.resources import MAX_TARGET_PIXELS, Framebuffer, Texture, VertexBuffer
from refsim.pipeline.state import TextureFormat
from refsim.scene.rays import Rays

MOST_TEXELS = 2**27
TEXELS_OF_TRIANGLE = 3
BEST_TARGETS = {"hit": TextureFormat.RGB32FLOAT, "found": TextureFormat.RGB32SINT}
# No hit yet: t is infinite, no triangle, nothing counted
NO_HIT, NONE_FOUND = (np.inf, 0.0, 0.0), (-1, 0, 0)


def list_textures(lists: TraversalLists) -> ListTextures:
    """All lists of a hierarchy, one after the other, on the memory that they have."""
    texels = max(len(lists.escape), TEXELS_OF_TRIANGLE * len(lists.records))
    if texels > MOST_TEXELS:
        raise InputError(f"{texels} texels of a list are more than the {MOST_TEXELS} of a one-dimensional texture.")
    return ListTextures(lists.escape, lists.spheres, lists.payload, lists.records, lists.hierarchy.spheres[0])


def entries(lists: TraversalLists, rays: Rays, starts: NDArray[np.int32] | None) -> NDArray[np.int32]:
    """i32[2, n]: the element at which each ray begins, its list's head or `starts` after it, and its list's end."""
    picked = list_of_rays(rays.direction, lists.count)
    first = lists.first.astype(np.int32)
    found = np.stack([first[picked], first[picked + 1]])
    if starts is not None:
        found[0] += starts
    return found


def image_size(rays: Rays) -> tuple[int, int]:
    """Width and height of the rays' image; where there is none, of the squarest rectangle that holds them."""
    if rays.width is not None and rays.height is not None:
        width, height = rays.width, rays.height
    else:
        width = max(int(np.ceil(np.sqrt(len(rays)))), 1)
        height = -(-len(rays) // width)
    width, height = max(width, 1), max(height, 1)
    if width * height > MAX_TARGET_PIXELS:
        raise InputError(f"{width} × {height} rays are more than a target of {MAX_TARGET_PIXELS} pixels holds.")
    return width, height


def texture_of(rows: NDArray[np.float32] | NDArray[np.int32], size: tuple[int, int]) -> Texture:
    """Rows [k, n] as a texture of k planes; pixels beyond the last row are 0 (of an origin: t_max 0, a dead ray)."""
    width, height = size
    planes = np.zeros((len(rows), height * width), rows.dtype)
    planes[:, : rows.shape[1]] = rows
    return Texture(planes.reshape(len(rows), height, width))


def ray_textures(rays: Rays, size: tuple[int, int]) -> tuple[Texture, Texture]:
    """Origin (w: t_max) and direction."""
    origin = np.concatenate([rays.origin.T, rays.t_max[None]])
    return texture_of(origin, size), texture_of(rays.direction.T, size)


def best_target(size: tuple[int, int]) -> Framebuffer:
    """Colour targets for `Best`, cleared to no hit."""
    target = Framebuffer(*size, BEST_TARGETS)
    target.clear_color("hit", NO_HIT)
    target.clear_color("found", NONE_FOUND)
    return target


def ray_vertices(rays: Rays) -> VertexBuffer:
    """Every ray as a point."""
    return VertexBuffer.of(RayVertex, origin=rays.origin, t_max=rays.t_max, direction=rays.direction)


def entry_vertices(found: NDArray[np.int32]) -> VertexBuffer:
    """`entries` as attributes."""
    return VertexBuffer.of(EntryVertex, entry=np.ascontiguousarray(found.T))


def best_vertices(count: int) -> VertexBuffer:
    """`count` vertices that have found nothing yet. Cleared, it is the room for as many records."""
    hit, found = np.array(NO_HIT, np.float32), np.array(NONE_FOUND, np.int32)
    return VertexBuffer.of(Best, hit=np.broadcast_to(hit, (count, 3)), found=np.broadcast_to(found, (count, 3)))
