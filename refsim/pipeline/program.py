"""A pipeline compiled: which kernels a draw needs, made by filling the stages' templates with shaders and constants.

Also decides what the early-test policy means for the pipeline at hand (`fragment_tests`). Kernels are made when first
needed and found again by the pipeline's value; `refsim.jit` keeps them on disk.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from refsim.jit import func, specialise
from refsim.pipeline.assembly import SLOTS, triangle_slot
from refsim.pipeline.color_writes import color_writes, target_fields
from refsim.pipeline.dense import dense_bins
from refsim.pipeline.fragment import STENCIL_IN_LOOP, STENCIL_MASK, STENCIL_OFF, Tests
from refsim.pipeline.fragment_list import count_fragments, listed_bins
from refsim.pipeline.geometry import amplify, amplify_slots, emission_of, emitted_fetcher, emitted_slots, emitted_vertex
from refsim.pipeline.interpolation import Spread
from refsim.pipeline.layout import Layout, device_function, rebuilder
from refsim.pipeline.raster import bin_primitives
from refsim.pipeline.state import (
    CompareFunction,
    CullMode,
    DepthStencilState,
    EarlyTests,
    FragmentState,
    FrontFace,
    GeometryState,
    Pipeline,
    StencilFaceState,
    StencilOperation,
    TextureFormat,
)
from refsim.pipeline.stream_output import capture, capture_slots
from refsim.pipeline.surface import rectangle_slots, triangle_slots
from refsim.pipeline.triangle_front import triangle_front
from refsim.pipeline.vertex import attribute_fetcher, corner_shader, front_end, positions


def fragment_tests(fragment: FragmentState, state: DepthStencilState, policy: EarlyTests) -> Tests:
    """What the fragment loops do to front faces under `policy` (see `both_faces`).

    Early rejection is used only where it cannot be seen in the result: stencil before the shader when failing changes
    nothing or the shader never discards; depth before the shader when the shader does not write depth, and no discarded
    fragment could have changed the stencil by failing.
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
    stencil_first = early_stencil and mode == STENCIL_IN_LOOP and not tests_first
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
        probe=may_reject and not failing_changes and not stencil_first,
        stencil_first=stencil_first,
        counts_lanes=tests_first or stencil_first,
    )


def both_faces(fragment: FragmentState, state: DepthStencilState, policy: EarlyTests) -> tuple[Tests, Tests]:
    """The tests of front and back faces of triangles.

    Where they differ, each face has its own order, and the stencil is tested in the loop: a mask for all primitives
    cannot know their faces.
    """
    back_state = state._replace(stencil_front=state.stencil_back)
    front, back = fragment_tests(fragment, state, policy), fragment_tests(fragment, back_state, policy)
    if state.stencil_front == state.stencil_back:
        return front, front
    active = front.stencil_mode != STENCIL_OFF or back.stencil_mode != STENCIL_OFF

    def in_loop(tests: Tests) -> Tests:
        mode = STENCIL_IN_LOOP if active else STENCIL_OFF
        first = tests.early_stencil and active and not tests.tests_first
        return tests._replace(stencil_mode=mode, stencil_first=first, counts_lanes=True, probe=False)

    return in_loop(front), in_loop(back)


class Nothing(NamedTuple):
    """No colour targets."""


@func
def no_colour(uniforms: Any, textures: Any, varyings: Any, inputs: Any, pixel: Any) -> Any:
    """The fragment shader of a pipeline that has none: the rasteriser's depth."""
    return True, np.float32(0), ()


NO_FRAGMENT = FragmentState(no_colour, Nothing)


class Program:
    """The kernels of one pipeline for one shape of uniforms and textures.

    Kernels are looked up at every draw: `specialise` finds an unchanged one at once, and notices when a constant
    that a shader reads has changed.
    """

    def __init__(
        self, pipeline: Pipeline, uniforms: Any, textures: Any, indexed: bool, formats: tuple[TextureFormat, ...]
    ) -> None:
        self.pipeline = pipeline
        self.triangles = pipeline.rasterized.is_triangles
        self.varyings = Layout.of(pipeline.vertex.varyings)
        self.spread: Any = Spread.of(pipeline.last_varyings) if self.triangles else Layout.of(pipeline.last_varyings)
        fragment = pipeline.fragment or NO_FRAGMENT
        self.fragment = fragment
        self.outputs = Layout.of(fragment.outputs)
        self.inputs = Layout.of(fragment.inputs) if fragment.inputs else None
        self.tests, self.back_tests = fragment_tests(fragment, pipeline.depth_stencil, pipeline.early_tests), None
        if self.triangles:
            self.tests, self.back_tests = both_faces(fragment, pipeline.depth_stencil, pipeline.early_tests)
        self._rebuild = {"rebuild_uniforms": rebuilder(uniforms), "rebuild_textures": rebuilder(textures)}
        self.writes = color_writes(pipeline.fragment, formats)
        self.target_fields = target_fields(fragment)
        self.indexed = indexed
        self._vertex_slots = self._slots_of_vertex_stage()
        self._fragment_slots = self._slots_of_fragment_stage()
        self.emission = emission_of(pipeline)
        self._emission_slots = self._slots_of_emission(self.emission) if self.emission else {}
        self._front_slots = self._slots_of_front_end()

    def for_a_draw(self) -> Program:
        """The same, for one draw: each kernel is looked for once, as shaders do not change while it runs."""
        return copy(self)

    def _slots_of_vertex_stage(self) -> dict[str, Any]:
        return {
            **self._rebuild,
            "fetch": attribute_fetcher(self.pipeline.vertex.buffers),
            "vertex_shader": self.pipeline.vertex.shader,
            "put_varyings": self.varyings.put_row,
            "INDEXED": self.indexed,
            "CORNERS": self.pipeline.topology.corners,
        }

    def _slots_of_triangles(self, fetch: Any, vertex_shader: Any, slot: Any, indexed: bool) -> dict[str, Any]:
        pipeline, state = self.pipeline, self.pipeline.depth_stencil
        biased = state.depth_bias != 0 or state.depth_bias_slope_scale != 0
        sign = -1 if pipeline.front_face == FrontFace.CCW else 1
        facing = (sign, pipeline.cull_mode == CullMode.FRONT, pipeline.cull_mode == CullMode.BACK, biased)
        return {
            **self._rebuild,
            "corner_shader": corner_shader(vertex_shader, fetch, slot, indexed),
            "put_spread": self.spread.put,
            "mix": self.spread.mix,
            "FACING": facing,
        }

    def _slots_of_fragment_stage(self) -> dict[str, Any]:
        inputs, writes = self.inputs, self.writes
        return {
            **self._rebuild,
            **(triangle_slots(self.spread) if self.triangles else rectangle_slots(self.spread)),
            "fragment": self.fragment.shader,
            "get_inputs": inputs.get if inputs else rebuilder_of_nothing(),
            "put_outputs": self.outputs.put,
            "TESTS": self.tests,
            "BACK_TESTS": self.back_tests or self.tests,
            "TWO_SIDED": self.back_tests is not None and self.back_tests != self.tests,
            "TRIANGLES": self.triangles,
            "IN_F": inputs.floats if inputs else 0,
            "IN_I": inputs.ints if inputs else 0,
            "OUT_F": self.outputs.floats,
            "OUT_I": self.outputs.ints,
            "TARGET_F": writes.floats,
            "TARGET_I": writes.ints,
            "PLAIN": writes.plain,
            "write_block": writes.write_block,
            "write_fragment": writes.write_fragment,
        }

    def _slots_of_emission(self, emission: GeometryState) -> dict[str, dict[str, Any]]:
        """Of the geometry stage and of stream output."""
        pipeline, vertex = self.pipeline, self._vertex_slots
        shade = corner_shader(vertex["vertex_shader"], vertex["fetch"], SLOTS[pipeline.topology], self.indexed)
        slots = {"amplify": {**self._rebuild, **amplify_slots(emission, pipeline.topology, shade)}}
        if pipeline.stream_output is not None:
            slots["capture"] = capture_slots(emission, pipeline.stream_output.record)
        return slots

    def _slots_of_front_end(self) -> dict[str, Any]:
        """Of the front end that takes the draw's vertices, or what was emitted."""
        pipeline = self.pipeline
        if self.emission is not None:
            varyings = Layout.of(self.emission.varyings)
            fetch = emitted_fetcher(varyings)
            if self.triangles:
                return self._slots_of_triangles(fetch, emitted_vertex, triangle_slot, True)
            return {**self._rebuild, **emitted_slots(varyings, fetch)}
        if self.triangles:
            fetch, slot = self._vertex_slots["fetch"], SLOTS[pipeline.topology]
            return self._slots_of_triangles(fetch, pipeline.vertex.shader, slot, self.indexed)
        return self._vertex_slots

    @cached_property
    def amplify(self) -> Any:
        """Vertex and geometry stage, everything emitted is kept."""
        return specialise(amplify, self._emission_slots["amplify"])

    @cached_property
    def capture(self) -> Any:
        """Copies emitted primitives to a vertex buffer."""
        return specialise(capture, self._emission_slots["capture"])

    @cached_property
    def front_end(self) -> Any:
        """Vertex stage (or what was emitted), clipping, rectangles or triangles in screen space."""
        return specialise(triangle_front if self.triangles else front_end, self._front_slots)

    @cached_property
    def vertex_tap(self) -> Any:
        """Vertex stage alone, everything kept."""
        return specialise(positions, self._vertex_slots)

    @cached_property
    def dense(self) -> Any:
        """Fragment stage over bins in vectorised passes."""
        return specialise(dense_bins, self._fragment_slots)

    @cached_property
    def listed(self) -> Any:
        """Fragment stage over fragment lists."""
        return specialise(listed_bins, {**self._fragment_slots, "TAP": False})

    @cached_property
    def tapped(self) -> Any:
        """Fragment stage over fragment lists, every fragment copied out."""
        return specialise(listed_bins, {**self._fragment_slots, "TAP": True})

    @cached_property
    def bin_primitives(self) -> Any:
        """Binning; the same for all pipelines."""
        return specialise(bin_primitives, {})

    @cached_property
    def count_fragments(self) -> Any:
        """Fragments a bin."""
        slots = self._fragment_slots
        return specialise(count_fragments, {name: slots[name] for name in ("shape_of", "fragments_of")})


@lru_cache(maxsize=1)
def rebuilder_of_nothing() -> Any:
    """What a fragment shader without input attachments gets as inputs: the empty tuple."""
    return device_function("def get(F, I, i):\n    return ()\n", "get", {})


@lru_cache(maxsize=512)
def program_of(
    pipeline: Pipeline, uniforms: Any, textures: Any, indexed: bool, formats: tuple[TextureFormat, ...]
) -> Program:
    """The program of `pipeline` for uniforms and textures of these shapes (`refsim.pipeline.layout.shape_of`), and
    colour targets of these formats."""
    return Program(pipeline, uniforms, textures, indexed, formats)


