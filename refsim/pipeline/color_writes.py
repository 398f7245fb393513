"""What a draw does to its colour targets, settled before it is compiled: which plane is replaced, blended or masked.

In: the pipeline's colour target states and the framebuffer's formats; out: `ColorWrites`, constants for the fragment
loops and the two device functions that write a block of lanes and a single fragment. They are generated text, a line a
plane that is written: the lines differ in their constants, and a loop over planes could not have constants.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

from refsim.pipeline.blend import FACTOR_CODE, OPERATION_CODE, Channel, blend_plane, component
from refsim.pipeline.enums import BlendFactor, TextureFormat
from refsim.pipeline.layout import Field, Layout, device_function
from refsim.pipeline.packet import select_plane
from refsim.pipeline.state import ColorTargetState, FragmentState

SECOND_SOURCE = "src1"
READS_SECOND_SOURCE = frozenset(factor for factor in BlendFactor if "src1" in factor.value)
READS_ALPHA = frozenset(factor for factor in BlendFactor if "src" in factor.value and "alpha" in factor.value)


class ColorWrites(NamedTuple):
    """How fragments are written. `plain`: every plane is replaced as it is, so the loops copy; `floats`, `ints`: planes
    of the targets; `blends`: some plane that is written is blended.

    ``write_block(packet, constant, first)`` and ``write_fragment(F, I, i, floats, ints, y, x, constant)`` write the
    outputs of a block of lanes and those in column i.
    """

    plain: bool
    floats: int
    ints: int
    blends: bool
    write_block: Any
    write_fragment: Any


def second_source(fragment: FragmentState) -> Field | None:
    """The output that is the second source, if a blend factor reads one and the shader has it."""
    fields = Layout.of(fragment.outputs).fields
    if fields and fields[-1].name == SECOND_SOURCE and any(reads_second_source(state) for state in fragment.targets):
        return fields[-1]
    return None


def target_fields(fragment: FragmentState) -> list[Field]:
    """The outputs that go to colour targets: all but a second source."""
    fields = Layout.of(fragment.outputs).fields
    return fields[:-1] if second_source(fragment) else fields


def reads_second_source(state: ColorTargetState) -> bool:
    """Whether a factor of the target's blend state is one of the `SRC1` factors."""
    parts = state.blend or ()
    return any(factor in READS_SECOND_SOURCE for part in parts for factor in (part.src_factor, part.dst_factor))


@lru_cache(maxsize=512)
def color_writes(fragment: FragmentState | None, formats: tuple[TextureFormat, ...]) -> ColorWrites:
    """The writes of `fragment` to targets of `formats`; without a fragment stage nothing is written."""
    if fragment is None:
        return ColorWrites(True, 0, 0, False, *_functions([], [], {}))
    fields = target_fields(fragment)
    states = fragment.targets or (ColorTargetState(),) * len(fields)
    second = second_source(fragment)
    block: list[str] = []
    single: list[str] = []
    names: dict[str, Any] = {"blend_plane": blend_plane, "select_plane": select_plane, "component": component}
    plain = second is None
    blends = False
    for field, state, form in zip(fields, states, formats, strict=True):
        for k in range(field.size):
            channel = _channel(state, form, k)
            written = bool(state.write_mask >> k & 1)
            copied = not (channel.blended or channel.unorm8)
            plain = plain and written and copied
            blends = blends or (written and channel.blended)
            if written and copied:
                _add_copy(block, single, field, k)
            elif written:
                _add_blend(block, single, names, channel, field, k, second)
    floats, ints = (sum(field.size for field in fields if field.kind == kind) for kind in "fi")
    return ColorWrites(plain, floats, ints, blends, *_functions(block, single, names))


def _channel(state: ColorTargetState, form: TextureFormat, k: int) -> Channel:
    """The constants of component `k` of a target."""
    has_alpha, is_alpha = form.components == 4, k == 3
    blend = state.blend
    if blend is None:
        return Channel(0, 0, 0, False, form.is_unorm8, is_alpha, has_alpha)
    part = blend.alpha if is_alpha else blend.color
    codes = OPERATION_CODE[part.operation], FACTOR_CODE[part.src_factor], FACTOR_CODE[part.dst_factor]
    return Channel(*codes, True, form.is_unorm8, is_alpha, has_alpha)


def _add_copy(block: list[str], single: list[str], field: Field, k: int) -> None:
    """Component `k` replaces what is stored."""
    row, short, planes = field.first + k, field.kind.upper(), "floats" if field.kind == "f" else "ints"
    block.append(f"select_plane(packet.write, packet.O{short}[{row}], packet.C{short}[{row}], first)")
    single.append(f"{planes}[{row}, y, x] = {short}[{row}, i]")


def _add_blend(
    block: list[str], single: list[str], names: dict[str, Any], channel: Channel, field: Field, k: int,
    second: Field | None,
) -> None:  # fmt: skip
    """Component `k` goes through `component`. Where there is no alpha or no second source, another column stands in."""
    name = f"CHANNEL{len(block)}"
    names[name] = channel
    new, alpha = field.first + k, field.first + field.size - 1
    new1, alpha1 = (second.first + k, second.first + second.size - 1) if second else (new, alpha)
    rows = (
        f"packet.OF[{new}], packet.CF[{new}], packet.OF[{new1}], "
        f"packet.OF[{alpha}], packet.CF[{alpha}], packet.OF[{alpha1}]"
    )
    block.append(f"blend_plane({name}, packet.write, {rows}, constant[{k}], first)")
    single.append(
        f"floats[{new}, y, x] = component({name}, F[{new}, i], floats[{new}, y, x], F[{new1}, i], constant[{k}], "
        f"F[{alpha}, i], floats[{alpha}, y, x], F[{alpha1}, i])"
    )


def _functions(block: list[str], single: list[str], names: dict[str, Any]) -> tuple[Any, Any]:
    """The two generated device functions."""
    def_block = "def write_block(packet, constant, first):\n" + "".join(f"    {line}\n" for line in block or ["pass"])
    head = "def write_fragment(F, I, i, floats, ints, y, x, constant):\n"
    def_single = head + "".join(f"    {line}\n" for line in single or ["pass"])
    return (
        device_function(def_block, "write_block", names),
        device_function(def_single, "write_fragment", names),
    )
