"""Where a triangle falls on the screen, in NumPy: viewport, sub-pixel grid, facing, coverage, strips.

In: clip positions ``[..., 4]`` and viewports ``(x, y, width, height, min_depth, max_depth)``. Out: corners in whole
1/256 of a pixel, and which pixels they cover. Framebuffer origin top-left, rows go down, pixel centres at .5.

The viewport keeps the dtype of the positions and its order of operations is part of the pipeline's convention: float32
gives the bits. From the sub-pixel grid on everything is a whole number of at most 50 bits, so int64 is exact.
Sources: WebGPU 23.2.4 and Vulkan 28.12 (rasterisation), Direct3D 11.3 3.4.2 (top-left rule, sub-pixel precision).
"""

from __future__ import annotations

import numpy as np

SUBPIXELS = 256
Viewport = tuple[float, float, float, float, float, float]
Bounds = tuple[int, int, int, int]


def divide(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Perspective division, ``[..., 4] -> (ndc [..., 3], 1 / w [...])``; multiplies by the inverse."""
    with np.errstate(all="ignore"):
        inverse = position.dtype.type(1) / position[..., 3]
        return position[..., :3] * inverse[..., None], inverse


def to_screen(ndc: np.ndarray, viewport: Viewport) -> np.ndarray:
    """Pixels ``[..., 2]`` of normalised device coordinates; y turns over, because NDC points up and rows go down."""
    x, y, width, height = (ndc.dtype.type(part) for part in viewport[:4])
    half_width, half_height = width / ndc.dtype.type(2), height / ndc.dtype.type(2)
    with np.errstate(all="ignore"):
        column = ndc[..., 0] * half_width + (x + half_width)
        row = -ndc[..., 1] * half_height + (y + half_height)
    return np.stack([column, row], axis=-1)


def window_depth(ndc: np.ndarray, viewport: Viewport) -> np.ndarray:
    """Depth ``[...]`` in the viewport's depth range."""
    near, far = (ndc.dtype.type(part) for part in viewport[4:])
    return near + ndc[..., 2] * (far - near)


def snap(screen: np.ndarray) -> np.ndarray:
    """Pixels as whole 1/256, int64: to nearest, halves to even."""
    return np.rint(screen * screen.dtype.type(SUBPIXELS)).astype(np.int64)


def corners_of(position: np.ndarray, viewport: Viewport) -> np.ndarray:
    """Snapped corners int64 ``[..., 2]`` of clip positions ``[..., 4]`` that need no clipping."""
    ndc, _ = divide(position)
    return snap(to_screen(ndc, viewport))


def edge_function(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
    """(b − a) × (p − a): positive where p lies to the right of the way from a to b, as seen on the screen."""
    return (b[..., 0] - a[..., 0]) * (p[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (p[..., 0] - a[..., 0])


def doubled_area(corners: np.ndarray) -> np.ndarray:
    """Twice the signed area of triangles ``[..., 3, 2]``: positive if they go clockwise on the screen."""
    return edge_function(corners[..., 0, :], corners[..., 1, :], corners[..., 2, :])


def faces_front(corners: np.ndarray, front_face: str) -> np.ndarray:
    """Whether triangles show their front; `front_face` "ccw" or "cw" as seen on the screen. Zero area: the back."""
    area = doubled_area(corners)
    return area < 0 if front_face == "ccw" else area > 0


def is_kept(front: np.ndarray, cull_mode: str) -> np.ndarray:
    """Whether triangles that show their front, or not, are left by `cull_mode` "none", "front" or "back"."""
    return {"none": np.ones_like(front), "front": ~front, "back": front}[cull_mode]


def owns_edge(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Top-left rule: whether centres on the edge from a to b belong to the triangle on its right.

    Left edges go up, top edges are level and go right.
    """
    step = b - a
    return (step[..., 1] < 0) | ((step[..., 1] == 0) & (step[..., 0] > 0))


def centres(bounds: Bounds) -> np.ndarray:
    """Pixel centres of bounds [x0, x1) × [y0, y1) in whole 1/256, int64 ``[h, w, 2]``."""
    x0, y0, x1, y1 = bounds
    row, column = np.mgrid[y0:y1, x0:x1]
    return np.stack([column, row], axis=-1) * SUBPIXELS + SUBPIXELS // 2


def coverage(corners: np.ndarray, bounds: Bounds) -> np.ndarray:
    """Pixels of `bounds` that one triangle ``[3, 2]`` covers, bool ``[h, w]``; zero area covers nothing."""
    point = centres(bounds)
    area = doubled_area(corners)
    ordered = corners if area > 0 else corners[::-1]
    inside = np.full(point.shape[:2], area != 0)
    for k in range(3):
        a, b = ordered[k], ordered[(k + 1) % 3]
        edge = edge_function(a, b, point)
        inside &= (edge > 0) | ((edge == 0) & owns_edge(a, b))
    return inside


def pixels_of(viewport: Viewport, scissor: Bounds) -> Bounds:
    """Bounds of the pixels of the scissor ``(x0, y0, x1, y1)`` whose centres lie in the viewport; x1 >= x0, y1 >= y0.

    Triangles are clipped to the viewport; a centre on its left or top border is inside, as the top-left rule has it.
    """
    x, y, width, height = viewport[:4]
    low = max(scissor[0], int(np.ceil(x - 0.5))), max(scissor[1], int(np.ceil(y - 0.5)))
    high = min(scissor[2], int(np.ceil(x + width - 0.5))), min(scissor[3], int(np.ceil(y + height - 0.5)))
    return *low, max(high[0], low[0]), max(high[1], low[1])


def holds_centre(corners: np.ndarray, bounds: Bounds) -> bool:
    """Whether the bounding box of a triangle ``[3, 2]``, open on the right and below, holds a pixel centre of `bounds`.

    Centres on the right or lower border are on no left or top edge.
    """
    low, high = corners.min(axis=0), corners.max(axis=0)
    point = centres(bounds)
    return bool(((point >= low) & (point < high)).all(axis=-1).any())


def list_triangles(count: int) -> np.ndarray:
    """Vertices int64 ``[count // 3, 3]`` of a triangle list; a rest of one or two vertices makes nothing."""
    return np.arange(count // 3 * 3).reshape(-1, 3)


def strip_triangles(count: int) -> np.ndarray:
    """Vertices int64 ``[count − 2, 3]`` of a strip: (i, i + 1, i + 2), odd ones (i, i + 2, i + 1): all wind alike."""
    first = np.arange(max(count - 2, 0))
    odd = first % 2
    return np.stack([first, first + 1 + odd, first + 2 - odd], axis=1)
