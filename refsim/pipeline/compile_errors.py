"""What is wrong with a shader that does not compile, as one sentence for the person who wrote it.

In: numba's error, a report of many lines that starts in the code at fault and goes outwards through the kernel; out:
the label of the pipeline, the place in the user's file where numba knows it, and numba's telling line without the names
of its intermediate code. Where the fault lies in the package's own code, which only calls shaders and takes what they
return, the sentence says what the shader takes or must return.
"""

from __future__ import annotations

import os
import re
from itertools import pairwise
from pathlib import Path

import numba
from numba.core.errors import NumbaError, UnsupportedBytecodeError

from refsim.errors import InputError
from refsim.jit.disk import MARK

COMPILE_ERRORS = (NumbaError, UnsupportedBytecodeError)

_PACKAGE, _NUMBA = Path(__file__).resolve().parents[1], Path(numba.__file__).resolve().parent
_PLACE = re.compile(r'^File "(?P<path>.+)", line (?P<line>\d+):')
_CALLEE = re.compile(rf"^During: resolving callee type: .*<function (?P<name>\w+?){MARK}[0-9a-f]+ ")
_BOILERPLATE = re.compile(r"^(Failed in \w+ mode pipeline|During:|File \"|$)")
_STAGES = {
    "vertex": ("vertex", "triangle_front"),
    "geometry": ("geometry",),
    "fragment": ("fragment", "fragment_list", "blocks", "dense"),
}
_TAKES = {
    "vertex": "(uniforms, textures, attributes, vertex_index, instance_index)",
    "geometry": "(uniforms, textures, vertices, primitive_index)",
    "fragment": "(uniforms, textures, varyings, inputs, pixel)",
}
_RETURNS = {
    "vertex": "(position, point_size, varyings), the position a vec4",
    "geometry": "a tuple of max_vertices entries (emission, position, point_size, varyings)",
    "fragment": "(keep, depth, outputs), every output of its field's components",
}
# numba's spelling → what the person who wrote the shader knows
_PLAIN = (
    (re.compile(r"Function\(<(?:built-in function|ufunc|intrinsic) '?([\w.]+)'?>\)"), r"\1"),
    (re.compile(r"Literal\[(\w+)\]\([^()]*\)"), r"\1"),
    (re.compile(r"\('wrong tuple length for .*?: ', '(.*)'\)"), r"wrong tuple length, \1"),
    (re.compile(r" for '\$[\w.]+'"), ""),
    (re.compile(r"'([A-Za-z_]\w*)\.\d+'"), r"'\1'"),
    (re.compile(r"\$[\w.]+"), "a value"),
    (re.compile(r",? defined at .* \(\d+\)"), ""),
    (re.compile(r"\.* Raised from .*"), ""),
    (re.compile(rf"{MARK}[0-9a-f]+"), ""),
)


def refusal(label: str, error: Exception) -> InputError:
    """The sentence for numba's `error`."""
    lines = [line.strip() for line in str(error).splitlines()]
    cause, stage = _cause(lines), _stage(lines)
    for line in lines:
        place, callee = _PLACE.match(line), _CALLEE.match(line)
        if callee and stage and cause.startswith("Cannot bind") and _is_called_by_a_kernel(lines, line):
            return _sentence(label, f"the {stage} shader {callee['name']} must take {_TAKES[stage]}")
        if callee and not cause.startswith("Cannot bind"):
            return _sentence(label, f"in {callee['name']}, {cause}")
        if place is None or _is_numba(place["path"]):
            continue
        if not _is_own(place["path"]):
            return _sentence(label, f"{_shown(place['path'])}, line {place['line']}: {cause}")
        if stage:
            return _sentence(label, f"the {stage} shader must return {_RETURNS[stage]}: {cause}")
    return _sentence(label, cause)


def lacks_return(error: TypeError) -> bool:
    """Whether a kernel raised this while it ran, because a shader ended without a return."""
    return re.search(r"expected .*, got None$", str(error)) is not None


def lacks_attribute(error: AttributeError) -> bool:
    """Whether a shader names what a module has not; numba passes that on as it is."""
    return re.match(r"module '[\w.]+' has no attribute", str(error)) is not None


def _sentence(label: str, what: str) -> InputError:
    return InputError(f"{label}: a shader does not compile: {what.rstrip('.')}.")


def _cause(lines: list[str]) -> str:
    """The first line that is no boilerplate, and the signature it announces."""
    telling = [line for line in lines if not _BOILERPLATE.match(line)] or ["numba does not say why"]
    cause = telling[0]
    if cause.endswith("for signature:"):
        cause = " ".join([cause, *(line.removeprefix(">>> ") for line in telling[1:2])])
    for spelling, plain in _PLAIN:
        cause = spelling.sub(plain, cause)
    return cause


def _stage(lines: list[str]) -> str | None:
    """The stage whose kernel was being compiled: the outermost place tells."""
    places = [place for place in map(_PLACE.match, lines) if place is not None]
    outer = Path(places[-1]["path"]).stem if places and _is_own(places[-1]["path"]) else ""
    stage = next((stage for stage, files in _STAGES.items() if outer in files), None)
    # The kernel of the geometry stage calls the vertex shader as well; numba marks the line at fault by one below it
    marked = [line for line, below in pairwise(lines) if below == "^"]
    return "vertex" if stage == "geometry" and marked and "assemble(" in marked[-1] else stage


def _is_called_by_a_kernel(lines: list[str], callee: str) -> bool:
    places = [place for place in map(_PLACE.match, lines[lines.index(callee) :]) if place is not None]
    return bool(places) and _is_own(places[0]["path"])


def _is_own(path: str) -> bool:
    """Whether the code is this package's, or glue that it generated."""
    return path == "<string>" or Path(os.path.abspath(path)).is_relative_to(_PACKAGE)


def _is_numba(path: str) -> bool:
    return Path(os.path.abspath(path)).is_relative_to(_NUMBA)


def _shown(path: str) -> str:
    """The file as a person would name it from here: below the working directory by its relative path."""
    return os.path.abspath(path) if path.startswith("..") else path
