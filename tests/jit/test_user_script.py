"""Plan: a user's script, run as ``__main__`` with shaders, uniforms and varyings of its own, is cached and never stale.

- Its first process compiles every kernel, its second compiles none and gives the same values.
- After an edit of everything a shader can depend on, every kernel is compiled anew and gives the value of the edited
  source; a kernel whose dependencies were not edited still comes from disk.
- Kernels of device functions that differ by a closure cell only, compiled in two processes, do not get each other's
  code when a third loads both.
- Where the package's directory cannot be written, clones go to the user's cache directory, are found, and are pruned.
"""

import os
import time
from pathlib import Path

import pytest

STAGE = '''
def stage(columns):
    for i in range(columns.size):
        columns[i] = shader(columns[i])


def stage_of(shader):
    def stage(columns):
        for i in range(columns.size):
            columns[i] = shader(columns[i])
    return stage


def constant_stage(columns):
    for i in range(columns.size):
        columns[i] = columns[i] + AMOUNT


def uniform_stage(uniforms, columns):
    for i in range(columns.size):
        columns[i] = put(shader(rebuild(uniforms), columns[i]))


def class_stage(columns):
    for i in range(columns.size):
        columns[i] = Record(columns[i]).field
'''

OWN = '''
import enum
from refsim.jit import func
LEVEL = 10.0
class Mode(enum.IntEnum):
    ADD = 7
@func
def lift(x):
    return x + 20.0
'''

SCRIPT = '''
import enum, functools, json
from typing import NamedTuple
import numpy as np
from numba import njit
from refsim.jit import func, specialise
import own, stages

class Mode(enum.IntEnum):
    ADD = 1
class Shade(enum.Enum):
    DARK = 0.25
class Inner(NamedTuple):
    scale: "np.float32"
class Uniforms(NamedTuple):
    inner: Inner
    amount: np.float64  # rounds
class Varyings(NamedTuple):
    value: float
class Sized(NamedTuple):
    field: float = 4.0
class Record(NamedTuple):
    field: float
GAIN = 2.0
TABLE = np.array([1.0, 6.0])
TENTH = np.float32(0.1)
PAIR = (1.0, (2.0, 8.0))

@func
def body(x): return x + 1.0
@func
def inmost(x): return x * 3.0
@func
def middle(x): return inmost(x) + 1.0
@func
def by_helper(x): return middle(x)
@njit(error_model="numpy")
def divide(x): return 1.0 / (x - x)
@func
def by_option(x): return divide(x) if x > 0.0 else 0.0
@func
def by_global(x): return x * GAIN
@func
def by_module(x): return x * own.LEVEL
@func
def by_module_function(x): return own.lift(x)
@func
def by_enum(x): return x + Mode.ADD.value
@func
def by_enum_value(x): return x + Shade.DARK.value
@func
def by_other_enum(x): return x + own.Mode.ADD.value
@func
def by_default(x, k=5.0): return x * k
@func
def by_array(x): return x + TABLE[1]
@func
def by_dtype(x): return x * TENTH
@func
def by_tuple(x): return x + PAIR[1][1]
@func
def by_nested(x):
    def inner(y): return y + 30.0
    return inner(x)
@functools.lru_cache
def adder(k):
    @func
    def add(x): return x + k
    return add
@func
def recurse(x): return x if x > 100.0 else recurse(x * 3.0)
@func
def untouched(x): return x + 1000.0

@func
def light(uniforms, x): return Varyings(x * uniforms.inner.scale + uniforms.amount)

def glue(text, name, names):
    exec(text, names)
    return func(names[name])

def rebuilder(cls):
    """A device function from leaf values, nested as the class is, to the class: as source text."""
    names = {"np": np}
    def build(cls, value):
        names[cls.__name__] = cls
        parts = [build(kind, f"{value}[{k}]") if hasattr(kind := hints[name], "_fields") else
                 f"np.{kind.__name__}({value}[{k}])"
                 for hints in [__import__("typing").get_type_hints(cls)] for k, name in enumerate(cls._fields)]
        return f"{cls.__name__}({', '.join(parts)})"
    return glue(f"def rebuild(u):\\n    return {build(cls, 'u')}", "rebuild", names)

def own_value(value):
    return tuple(map(own_value, value)) if isinstance(value, tuple) else value

report = {}
def measure(name, kernel, *arguments):
    columns = np.array([1.0])
    error = None
    try: kernel(*arguments, columns)
    except ZeroDivisionError: columns[0] = -1.0
    report[name] = [float(columns[0]), sum(kernel.stats.cache_hits.values()), sum(kernel.stats.cache_misses.values())]

for name, shader in list(globals().items()):
    if name.startswith(("body", "by_", "recurse", "untouched")):
        measure(name, specialise(stages.stage, {"shader": shader}))
measure("cell", specialise(stages.stage, {"shader": adder(40.0)}))
measure("closed_stage", specialise(stages.stage_of(untouched), {}))
measure("slot", specialise(stages.constant_stage, {"AMOUNT": 50.0}))
measure("kernel_option", specialise(stages.constant_stage, {"AMOUNT": 51.0}, boundscheck=False))
measure("class_slot", specialise(stages.class_stage, {"Record": Record}))
measure("class_default", specialise(stages.class_stage, {"Record": Sized}))
uniforms = Uniforms(Inner(2.0), 0.1)
measure("uniforms", specialise(stages.uniform_stage, {
    "shader": light, "rebuild": rebuilder(Uniforms),
    "put": glue("def put(v):\\n    return v.value", "put", {})}), own_value(uniforms))
print(json.dumps(report))
'''

# what is edited: kernel -> (value before, value after, text before, text after)
EDITS = {
    "body": (2.0, 3.0, "x + 1.0\n@func\ndef inmost", "x + 2.0\n@func\ndef inmost"),
    "by_helper": (4.0, 5.0, "x * 3.0\n@func\ndef middle", "x * 4.0\n@func\ndef middle"),
    "by_option": (float("inf"), -1.0, '@njit(error_model="numpy")', '@njit(error_model="python")'),
    "by_global": (2.0, 2.5, "GAIN = 2.0", "GAIN = 2.5"),
    "by_module": (10.0, 11.0, "LEVEL = 10.0", "LEVEL = 11.0"),
    "by_module_function": (21.0, 22.0, "x + 20.0", "x + 21.0"),
    "by_enum": (2.0, 6.0, "ADD = 1\n", "ADD = 5\n"),
    "by_enum_value": (1.25, 1.5, "DARK = 0.25", "DARK = 0.5"),
    "by_other_enum": (8.0, 9.0, "ADD = 7", "ADD = 8"),
    "by_default": (5.0, 5.5, "k=5.0", "k=5.5"),
    "by_array": (7.0, 7.5, "[1.0, 6.0]", "[1.0, 6.5]"),
    "by_dtype": (0.10000000149011612, 0.1, "np.float32(0.1)", "np.float64(0.1)"),
    "by_tuple": (9.0, 9.5, "(2.0, 8.0)", "(2.0, 8.5)"),
    "by_nested": (31.0, 32.0, "y + 30.0", "y + 31.0"),
    "cell": (41.0, 42.0, "adder(40.0)", "adder(41.0)"),
    "slot": (51.0, 52.0, '"AMOUNT": 50.0', '"AMOUNT": 51.0'),
    "kernel_option": (52.0, 52.0, "boundscheck=False", "boundscheck=True"),
    "class_slot": (1.0, 1.0, "field: float\n", "field: int\n"),
    "class_default": (1.0, 1.0, "field: float = 4.0", "field: float = 4.5"),
    "uniforms": (2.1, 2.10000000149011612, "amount: np.float64", "amount: np.float32"),
}
KEPT = {"recurse": 243.0, "untouched": 1001.0, "closed_stage": 1001.0}


@pytest.fixture
def script(tmp_path: Path) -> Path:
    """The user's script, with a module of his own and the stages beside it."""
    (tmp_path / "stages.py").write_text(STAGE)
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "script.py").write_text(SCRIPT)
    return tmp_path / "script.py"


def test_a_second_process_hits_and_an_edited_one_is_never_stale(script, run) -> None:
    before = {**{name: edit[0] for name, edit in EDITS.items()}, **KEPT}
    after = {**{name: edit[1] for name, edit in EDITS.items()}, **KEPT}
    # a report is kernel -> [value, hits, misses]
    assert run(script) == {name: [value, 0, 1] for name, value in before.items()}
    assert run(script) == {name: [value, 1, 0] for name, value in before.items()}

    for file in (script, script.with_name("own.py")):
        text = file.read_text()
        for _, _, old, new in EDITS.values():
            text = text.replace(old, new)
        file.write_text(text)
    assert run(script) == {name: [value, int(name in KEPT), int(name in EDITS)] for name, value in after.items()}


def test_every_edit_of_the_table_finds_its_text_once() -> None:
    for name, (_, _, old, _) in EDITS.items():
        assert (SCRIPT + OWN).count(old) == 1, name


COLLIDE = '''
import json, sys
import numpy as np
from numba import njit
from refsim.jit import specialise
import stages
def make(k):
    @njit  # not inlined, so that it keeps a symbol of its own in the machine code
    def shader(x):
        for i in range(40):
            x = x * 0.5 + k
            if x > 1e9:
                x = x - k
        return x
    return shader
report = []
for k in map(float, sys.argv[1:]):
    kernel = specialise(stages.stage, {"shader": make(k)})
    columns = np.array([1.0])
    kernel(columns)
    report.append([round(columns[0], 6), sum(kernel.stats.cache_hits.values())])
print(json.dumps(report))
'''


def test_kernels_of_two_processes_do_not_share_symbols_in_a_third(tmp_path: Path, run) -> None:
    (tmp_path / "stages.py").write_text(STAGE)
    (tmp_path / "collide.py").write_text(COLLIDE)
    assert run(tmp_path / "collide.py", "2") == [[4.0, 0]]
    assert run(tmp_path / "collide.py", "3") == [[6.0, 0]]
    assert run(tmp_path / "collide.py", "2", "3") == [[4.0, 1], [6.0, 1]]


PLAIN = '''
import json
import numpy as np
from refsim.jit import func, specialise
import stages
@func
def shader(x): return x + 1.0
kernel = specialise(stages.stage, {"shader": shader})
columns = np.array([1.0])
kernel(columns)
stats = getattr(kernel, "stats", None)
print(json.dumps([columns[0], sum(stats.cache_hits.values()), stats.cache_path] if stats else [columns[0]]))
'''


def test_a_read_only_installation_caches_in_the_users_directory(tmp_path: Path, run) -> None:
    (tmp_path / "stages.py").write_text(STAGE)
    (tmp_path / "plain.py").write_text(PLAIN)
    (tmp_path / "__pycache__").write_text("a file where the directory should be")
    home = {"NUMBA_CACHE_DIR": None, "XDG_CACHE_HOME": str(tmp_path / "home"), "HOME": str(tmp_path / "home"),
            "LOCALAPPDATA": str(tmp_path / "home")}
    value, hits, path = run(tmp_path / "plain.py", **home)
    assert (value, hits) == (2.0, 0)
    assert Path(path).is_relative_to(tmp_path / "home")
    old = Path(path) / "stages.stage_refsim_00000000000000000000-2.py311.1.nbc"
    old.touch()
    os.utime(old, (time.time() - 31 * 86400,) * 2)
    assert run(tmp_path / "plain.py", **home) == [2.0, 1, path]
    assert old.exists()  # a hit does not prune
    (tmp_path / "plain.py").write_text(PLAIN.replace("x + 1.0", "x + 2.0"))
    assert run(tmp_path / "plain.py", **home) == [3.0, 0, path]
    assert not old.exists()


def test_without_jit_the_same_code_runs_as_plain_python(tmp_path: Path, run) -> None:
    (tmp_path / "stages.py").write_text(STAGE)
    (tmp_path / "plain.py").write_text(PLAIN)
    assert run(tmp_path / "plain.py", NUMBA_DISABLE_JIT="1") == [2.0]
