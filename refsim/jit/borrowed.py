"""Arrays without reference counts, for the stages' loops.

A kernel's arguments are kept alive by its caller, yet numba counts references to an array each time that a device
function takes one out of a tuple: two atomic instructions, which LLVM removes only where no branch comes between. In a
shader with a dozen arrays and a few branches that is more work than the shader's own. `borrowed` hands the same arrays
on without the record that the counts are kept in; counting then is nothing, and LLVM drops it.
"""

from __future__ import annotations

from typing import Any

from numba.core import types
from numba.core.cgutils import create_struct_proxy, unpack_tuple
from numba.extending import intrinsic


def _stripped(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if isinstance(kind, types.Array):
        array = create_struct_proxy(kind)(context, builder, value=value)
        array.meminfo = array.meminfo.type(None)
        array.parent = array.parent.type(None)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        parts = unpack_tuple(builder, value, len(kind))
        stripped = [_stripped(context, builder, part, item) for part, item in zip(kind, parts, strict=True)]
        return context.make_tuple(builder, kind, stripped)
    return value


@intrinsic
def borrowed(typing_context: Any, value: Any) -> Any:
    """`value`, an argument of the kernel: an array, a scalar or tuples of them, without reference counts."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _stripped(context, builder, signature.args[0], arguments[0])

    return value(value), code
