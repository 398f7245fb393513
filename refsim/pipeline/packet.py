"""The working columns of the dense loop: a bin's pixels, a lane each, that stay in cache.

A packet is a bin's pixels (at most 1,024); lanes whose pixel an early stencil test has ruled out for good are left out.
Everything is done in blocks of 64 lanes, which the compiler turns into vector instructions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from refsim.jit import func

PACKET = 1024
STRIDE = PACKET + 16  # columns a cache line beyond 4 KiB apart, or they would all fall into one cache set
BLOCK = 64
I = np.int32  # noqa: E741
U = np.uintp
ON = np.int32(1)
OFF = np.int32(0)


class Packet(NamedTuple):
    """A bin's working columns, [PACKET] each: place in the bin, input texels (k rows), live mask, depth, stencil, total
    of shader invocations, outputs and colour targets (k rows), written mask; live lanes of each block."""

    x: np.ndarray
    y: np.ndarray
    TF: np.ndarray
    TI: np.ndarray
    alive: np.ndarray
    depth: np.ndarray
    stencil: np.ndarray
    total: np.ndarray
    OF: np.ndarray
    OI: np.ndarray
    CF: np.ndarray
    CI: np.ndarray
    write: np.ndarray
    block_alive: np.ndarray


@func
def new_packet(in_f, in_i, out_f, out_i):
    """Columns for a draw. They are rows of two arrays, so that the compiler can prove that they do not overlap."""
    F = np.zeros((in_f + 2 * out_f + 1, STRIDE), np.float32)
    N = np.zeros((in_i + 2 * out_i + 7, STRIDE), np.int32)
    a, b, c = in_f + out_f, in_f + 2 * out_f, in_i + out_i
    d = in_i + 2 * out_i
    return Packet(
        N[d], N[d + 1], F[:in_f], N[:in_i], N[d + 2], F[b], N[d + 3], N[d + 4],
        F[in_f:a], N[in_i:c], F[a:b], N[c:d], N[d + 5], N[d + 6],
    )  # fmt: skip


@func
def load_plane(plane, column, packet, origin, size, lanes):
    """Copies the lanes' pixels of `plane` into a working column: whole rows where every pixel has its lane."""
    x0, y0 = origin
    width, height = size
    if lanes == width * height:
        for y in range(height):
            for x in range(width):
                column[U(y * width + x)] = plane[U(y0 + y), U(x0 + x)]
    else:
        for j in range(lanes):
            i = U(j)
            column[i] = plane[U(y0 + packet.y[i]), U(x0 + packet.x[i])]


@func
def store_plane(plane, column, packet, origin, size, lanes):
    """Copies a working column back."""
    x0, y0 = origin
    width, height = size
    if lanes == width * height:
        for y in range(height):
            for x in range(width):
                plane[U(y0 + y), U(x0 + x)] = column[U(y * width + x)]
    else:
        for j in range(lanes):
            i = U(j)
            plane[U(y0 + packet.y[i]), U(x0 + packet.x[i])] = column[i]


@func
def select_plane(write, new, plane, first):
    """A block of one plane of a colour target takes `new` where a fragment is written."""
    for j in range(BLOCK):
        i = U(first + j)
        a, b = new[i], plane[i]
        plane[i] = a if write[i] != OFF else b


@func
def add_pending(packet, pending, lanes):
    """Counts `pending` shader invocations for every live lane."""
    for j in range(lanes):
        i = U(j)
        packet.total[i] = I(packet.total[i] + (pending if packet.alive[i] != OFF else OFF))
