"""Loops around the stages' device functions with the whole state at run time: the state-generic compile."""

import numpy as np
from numba import njit

from refsim.pipeline.depth import stored_depth
from refsim.pipeline.fragment import STENCIL_IN_LOOP, Tests, TestValues, resolve
from refsim.pipeline.raster import first_pixel, rasterise_points
from refsim.pipeline.state import StencilFaceState
from refsim.pipeline.stencil import compare, stencil_operation

F = np.float32
I = np.int32  # noqa: E741
MODE = I(STENCIL_IN_LOOP)


@njit(error_model="numpy")
def operations(operation, value, reference, out):
    """`out` = values after the operations, element for element, int32."""
    for i in range(len(out)):
        out[i] = stencil_operation(operation[i], value[i], reference[i])


@njit(error_model="numpy")
def comparisons(function, new, stored, out):
    """`out` = whether each relation holds; float32 or int32."""
    for i in range(len(out)):
        out[i] = compare(function[i], new[i], stored[i])


@njit(error_model="numpy")
def stored_depths(form, z, out):
    """`out` = depths as the format stores them."""
    for i in range(len(out)):
        out[i] = stored_depth(form, z[i], F(0), F(1))


@njit(error_model="numpy")
def first_pixels(edge, low, high, out):
    """`out` = index of the first pixel centre at or beyond each edge."""
    for i in range(len(out)):
        out[i] = first_pixel(edge[i], low, high)


@njit(error_model="numpy")
def points(position, size, view, bounds, rect, depth, fate):
    """Rectangles of points; see `refsim.pipeline.raster.rasterise_points`."""
    rasterise_points(position, size, len(size), view, bounds, rect, depth, fate)


@njit(error_model="numpy")
def tests_of(face, depth_compare, depth_write, forced):
    """The constants of a draw, here run-time values; `face` = compare, fail, depth fail, pass."""
    state = StencilFaceState(I(face[0]), I(face[1]), I(face[2]), I(face[3]))
    return Tests(state, MODE, I(0), I(depth_compare), depth_write, True, True, False, forced, forced, False)


@njit(error_model="numpy")
def fragments(faces, values, depth_compare, depth_write, forced, covered, keep, z, depth, new_depth, new_stencil, ok):
    """Every row one fragment: `faces` i32[n, 4], `values` i32[n, 4] = stencil, reference, read and write mask; `ok`
    [n, 3] gets written, stencil passed, depth passed."""
    for i in range(len(z)):
        tests = tests_of(faces[i], depth_compare[i], depth_write[i], forced[i])
        run_time = TestValues(values[i, 1], values[i, 2], values[i, 3], F(0), F(1))
        written, s_ok, d_ok, nd, ns = resolve(tests, run_time, covered[i], keep[i], z[i], depth[i], values[i, 0])
        new_depth[i], new_stencil[i] = nd, ns
        ok[i, 0], ok[i, 1], ok[i, 2] = written, s_ok, d_ok


@njit(error_model="numpy")
def every_stencil_update(operation, holds, through, boundary, wrong):
    """Every comparison × three operations × depth outcome × (value, reference, read mask, write mask) of `boundary`.

    Tables of the restatement: `operation` [8, 256, 256] by value and reference, `holds` [8, 256, 256] by masked
    reference and value, `through` [256, 256, 256] by old, new and mask. Returns how many rows differ; `wrong` gets the
    first: depth outcome · 8^4 + pass · 8^3 + depth fail · 8^2 + fail · 8 + compare, value, reference, read, write mask.
    """
    less, z = I(1), F(0.5)
    differ = 0
    for code in range(8**4 * 2):
        face = (code & 7, code >> 3 & 7, code >> 6 & 7, code >> 9 & 7)
        depth_passes = code >> 12
        depth = F(0.75) if depth_passes else F(0.25)
        tests = tests_of(face, less, True, False)
        for value in boundary:
            for reference in boundary:
                for read in boundary:
                    stencil_passes = holds[face[0], reference & read, value & read]
                    op = face[3] if depth_passes else face[2]
                    op = op if stencil_passes else face[1]
                    new = operation[op, value, reference]
                    for write in boundary:
                        run_time = TestValues(reference, read, write, F(0), F(1))
                        written, _, _, nd, ns = resolve(tests, run_time, True, True, z, depth, value)
                        passes = bool(stencil_passes) & bool(depth_passes)
                        right = (ns == through[value, new, write]) & (written == passes)
                        right &= nd == (z if passes else depth)
                        if not right:
                            if differ == 0:
                                wrong[0], wrong[1], wrong[2] = code, value, reference
                                wrong[3], wrong[4] = read, write
                            differ += 1
    return differ
