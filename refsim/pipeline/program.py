"""A pipeline compiled: which kernels a draw needs, made by filling the stages' templates with shaders and constants.

Also decides what the early-test policy means for the pipeline at hand (`fragment_tests`). Kernels are made when first
needed and found again by the pipeline's value; `refsim.jit` keeps them on disk.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from refsim.jit import specialise
from refsim.pipeline.dense import dense_bins
from refsim.pipeline.fragment import STENCIL_IN_LOOP, STENCIL_MASK, STENCIL_OFF, Tests
from refsim.pipeline.fragment_list import count_fragments, listed_bins
from refsim.pipeline.layout import Layout, rebuilder
from refsim.pipeline.raster import bin_primitives
from refsim.pipeline.state import (
    CompareFunction,
    DepthStencilState,
    EarlyTests,
    FragmentState,
    Pipeline,
    PrimitiveTopology,
    StencilFaceState,
    StencilOperation,
)
from refsim.pipeline.vertex import attribute_fetcher, front_end, positions


def fragment_tests(fragment: FragmentState, state: DepthStencilState, policy: EarlyTests) -> Tests:
    """What the fragment loops do under `policy`. Early rejection is used only where it cannot be seen in the result:

    stencil before the shader when failing changes nothing or the shader never discards; depth before the shader when
    the shader does not write depth, and no discarded fragment could have changed the stencil by failing.
    """
    face = state.stencil_front
    forced = policy == EarlyTests.FORCED
    writes_depth = fragment.writes_depth and not forced
    stencil_tests = face.compare != CompareFunction.ALWAYS
    depth_tests = state.depth_compare != CompareFunction.ALWAYS
    keeps = StencilOperation.KEEP
    active = stencil_tests or face.pass_op != keeps or (depth_tests and face.depth_fail_op != keeps)
    if policy == EarlyTests.MESA:
        allowed = not (fragment.discards or fragment.writes_depth)
    else:
        allowed = policy == EarlyTests.IDEAL
    early_stencil = allowed and stencil_tests and (face.fail_op == keeps or not fragment.discards)
    early_depth = (
        (allowed and depth_tests and not writes_depth)
        and (face.depth_fail_op == keeps or not fragment.discards)
        and (early_stencil or not stencil_tests)
    )
    mode = STENCIL_OFF
    if active:
        mode = STENCIL_MASK if early_stencil and face.fail_op == keeps else STENCIL_IN_LOOP
    tests_first = forced or early_depth
    failing_changes = (stencil_tests and face.fail_op != keeps) or (depth_tests and face.depth_fail_op != keeps)
    may_reject = fragment.discards or depth_tests or (mode == STENCIL_IN_LOOP and stencil_tests)
    early_in_loop = tests_first or (early_stencil and mode == STENCIL_IN_LOOP)
    return Tests(
        stencil=StencilFaceState(*(int(part) for part in face)),  # type: ignore[arg-type]
        stencil_mode=mode,
        depth_format=int(state.format),
        depth_compare=int(state.depth_compare),
        depth_write=state.depth_write_enabled,
        writes_depth=writes_depth,
        discards=fragment.discards,
        early_stencil=early_stencil or forced,
        tests_first=tests_first,
        forced=forced,
        probe=may_reject and not failing_changes and not early_in_loop,
    )


class Program:
    """The kernels of one pipeline for one shape of uniforms and textures.

    Kernels are looked up at every draw: `specialise` finds an unchanged one at once, and notices when a constant
    that a shader reads has changed.
    """

    def __init__(self, pipeline: Pipeline, uniforms: Any, textures: Any, indexed: bool) -> None:
        self.pipeline = pipeline
        self.corners = 1 if pipeline.topology == PrimitiveTopology.POINT_LIST else 4
        self.varyings = Layout.of(pipeline.vertex.varyings)
        self.outputs = Layout.of(pipeline.fragment.outputs)
        self.inputs = Layout.of(pipeline.fragment.inputs) if pipeline.fragment.inputs else None
        self.tests = fragment_tests(pipeline.fragment, pipeline.depth_stencil, pipeline.early_tests)
        self._rebuild = {"rebuild_uniforms": rebuilder(uniforms), "rebuild_textures": rebuilder(textures)}
        self._indexed = indexed
        self._vertex_slots = self._slots_of_vertex_stage()
        self._fragment_slots = self._slots_of_fragment_stage()

    def _slots_of_vertex_stage(self) -> dict[str, Any]:
        return {
            **self._rebuild,
            "fetch": attribute_fetcher(self.pipeline.vertex.buffers),
            "vertex_shader": self.pipeline.vertex.shader,
            "put_varyings": self.varyings.put_row,
            "INDEXED": self._indexed,
            "CORNERS": self.corners,
        }

    def _slots_of_fragment_stage(self) -> dict[str, Any]:
        inputs = self.inputs
        return {
            **self._rebuild,
            "get_varyings": self.varyings.get_row,
            "fragment": self.pipeline.fragment.shader,
            "get_inputs": inputs.get if inputs else rebuilder_of_nothing(),
            "put_outputs": self.outputs.put,
            "TESTS": self.tests,
            "IN_F": inputs.floats if inputs else 0,
            "IN_I": inputs.ints if inputs else 0,
            "OUT_F": self.outputs.floats,
            "OUT_I": self.outputs.ints,
        }

    @property
    def front_end(self) -> Any:
        """Vertex stage, clipping, rectangles."""
        return specialise(front_end, self._vertex_slots)

    @property
    def vertex_tap(self) -> Any:
        """Vertex stage alone, everything kept."""
        return specialise(positions, self._vertex_slots)

    @property
    def dense(self) -> Any:
        """Fragment stage over bins in vectorised passes."""
        return specialise(dense_bins, self._fragment_slots)

    @property
    def listed(self) -> Any:
        """Fragment stage over fragment lists."""
        return specialise(listed_bins, {**self._fragment_slots, "TAP": False})

    @property
    def tapped(self) -> Any:
        """Fragment stage over fragment lists, every fragment copied out."""
        return specialise(listed_bins, {**self._fragment_slots, "TAP": True})

    @property
    def bin_primitives(self) -> Any:
        """Binning; the same for all pipelines."""
        return specialise(bin_primitives, {})

    @property
    def count_fragments(self) -> Any:
        """Fragments a bin; the same for all pipelines."""
        return specialise(count_fragments, {})


@lru_cache(maxsize=1)
def rebuilder_of_nothing() -> Any:
    """What a fragment shader without input attachments gets as inputs: the empty tuple."""
    from refsim.pipeline.layout import device_function

    return device_function("def get(F, I, i):\n    return ()\n", "get", {})


@lru_cache(maxsize=512)
def program_of(pipeline: Pipeline, uniforms: Any, textures: Any, indexed: bool) -> Program:
    """The program of `pipeline` for uniforms and textures of these shapes (`refsim.pipeline.layout.shape_of`)."""
    return Program(pipeline, uniforms, textures, indexed)


