"""The bytes of traversal lists, and the file: what they are, that they come back, that damage does no harm.

Plan
- Golden: two triangles, written out byte for byte as section 2.1 lays them out.
- Property: over hard meshes, lists, orders and culling rules every array comes back bit for bit, from bytes and from
  the file, and the sizes are those of the bytes.
- Damage without a checksum: whichever byte of whichever part is changed, and wherever a part is cut, the reader refuses
  it with a sentence, or no ray can leave the lists; a table of what has to be refused, by name.
- Damage to a file: every cut, every changed byte, other files, none; an older file survives a failed write.
"""

from __future__ import annotations

import hashlib
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim import InputError
from refsim.papers.sphere_hierarchy import list_file
from refsim.papers.sphere_hierarchy.byte_layout import ListBytes, bytes_of, from_bytes, to_bytes
from refsim.papers.sphere_hierarchy.list_file import file_bytes, lists_of_file, read_lists, write_lists
from refsim.papers.sphere_hierarchy.lists import TraversalLists
from refsim.papers.sphere_hierarchy.search import search
from refsim.scene import load_scene
from tests.bsh.meshes import Triangles, grid, meshes, rays_at, same_hits
from tests.bsh.moved_lists import PARTITIONS, SQUARE, arrays, lists_of

FOUR = grid(np.random.default_rng(3), 5)


def assert_same_lists(one: TraversalLists, other: TraversalLists) -> None:
    for a, b in zip(arrays(one), arrays(other), strict=True):
        assert a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
        assert b.flags.c_contiguous and b.flags.writeable
    assert (one.directions == other.directions).all()
    assert (one.order, one.culling, one.count) == (other.order, other.culling, other.count)


def test_the_layout_of_two_triangles() -> None:
    """A pair far apart: root, sphere, triangle 0, sphere, triangle 1 along +x; the other way round along −x."""
    pair = np.concatenate([SQUARE[:1], SQUARE[1:] + np.float32([9, 0, 0])])
    lists = lists_of(pair, 2)
    parts = to_bytes(lists)
    assert parts.escape == struct.pack("<10i", -1, 2, 1, -1, 0, -1, 2, 1, -1, 0)
    spheres = lists.hierarchy.spheres
    assert (spheres[:, :3] == [[5, 0.5, 0], [0.5, 0.5, 0], [9.5, 0.5, 0]]).all()
    root, left, right = (struct.pack("<4f", *sphere) for sphere in spheres)
    first, second = struct.pack("<4i", 0, 1, 2, 0), struct.pack("<4i", 3, 4, 5, 1)
    assert parts.payload == root + left + first + right + second + root + right + second + left + first
    assert parts.vertices == b"".join(struct.pack("<4f", *vertex, 0) for vertex in pair.reshape(-1, 3))
    assert parts.heads == struct.pack("<3q", 0, 5, 10)
    host = struct.pack("<3i", -1, 0, 0), struct.pack("<2i", 1, 2), struct.pack("<6i", *range(6))
    assert (parts.parent, parts.owner, parts.corners) == host


@given(triangles=meshes(), partition=st.sampled_from(PARTITIONS), latest=st.booleans(), seed=st.integers(0, 999))
@settings(max_examples=60, deadline=None)
def test_lists_come_back(triangles: Triangles, partition: tuple[int, str | None], latest: bool, seed: int) -> None:
    count, culling = partition
    lists = lists_of(triangles, count, "latest_last" if latest else "earliest_first", culling)
    parts = to_bytes(lists)
    back = from_bytes(parts, lists.order, lists.culling)
    assert_same_lists(lists, back)
    assert_same_lists(lists, lists_of_file(file_bytes(lists)))
    rays = rays_at(triangles, 24, seed)
    one, other = (search([which], rays, facing="front", threads=1) for which in (lists, back))
    same_hits(one.hits, other.hits)
    assert (one.nodes == other.nodes).all()

    size = bytes_of(lists)
    assert (sum(size.escape), sum(size.payload)) == (len(parts.escape), len(parts.payload))
    assert (size.vertices, size.heads) == (len(parts.vertices), len(parts.heads))
    assert size.lists == tuple(20 * lists.length(k) for k in range(count))
    rows = size.table()
    assert rows[-1]["bytes"] == size.total == sum(row["bytes"] for row in rows[:-1]) == sum(map(len, parts[:4]))


def test_bytes_of_the_knot() -> None:
    """Golden: six lists of 1,024 triangles and their spheres, 512 vertices shared by all."""
    lists = lists_of(load_scene("torus_knot_1024").triangles)
    size, elements = bytes_of(lists), 1024 + len(lists.hierarchy)
    assert size.lists == (20 * elements,) * 6
    assert (size.vertices, size.heads, size.total) == (512 * 16, 56, 120 * elements + 8192 + 56)


# Damage to the bytes themselves


def assert_harmless(lists: TraversalLists) -> None:
    """From every element of every list each step leads on within the list or ends, and every number is in range."""
    n = len(lists.hierarchy.triangles)
    assert lists.first[0] == 0 and lists.first[-1] == len(lists.escape) == len(lists.payload)
    for k in range(lists.count):
        escape, payload = (array[slice(*lists.first[k : k + 2])] for array in (lists.escape, lists.payload))
        end = np.arange(len(escape))
        leaf = (escape == 0) | (escape == 1)
        assert (escape >= -1).all() and (end + escape < len(escape)).all()
        assert not len(escape) or leaf[-1]
        assert ((payload[leaf, 3] >= 0) & (payload[leaf, 3] < n)).all()
        assert ((payload[leaf, :3] >= 0) & (payload[leaf, :3] < len(lists.vertices.positions))).all()
    assert len(lists.records) == n and np.isfinite(lists.records).all()


@pytest.mark.parametrize("culling", [None, "sextant_safe"])
def test_any_changed_byte_is_refused_or_harmless(culling: str | None) -> None:
    lists = lists_of(FOUR, 6 if culling else 2, culling=culling)
    parts, outcomes = to_bytes(lists), {"refused": 0, "harmless": 0}
    for name, data in parts._asdict().items():
        for at in range(len(data)):
            for flip in (0x01, 0x80, 0xFF) if at % 4 in (0, 3) else (0xFF,):
                changed = bytearray(data)
                changed[at] ^= flip
                try:
                    assert_harmless(from_bytes(parts._replace(**{name: bytes(changed)}), lists.order, culling))
                    assert name == "vertices", f"byte {at} of {name} can be {changed[at]:#x}"
                    outcomes["harmless"] += 1
                except InputError as error:
                    assert "lists' bytes" in str(error) or "the bytes" in str(error)
                    outcomes["refused"] += 1
    assert min(outcomes.values()) > 10


def test_any_cut_part_is_refused() -> None:
    lists = lists_of(FOUR, 2)
    parts = to_bytes(lists)
    for name, data in parts._asdict().items():
        for end in range(len(data)):
            with pytest.raises(InputError, match="bytes"):
                from_bytes(parts._replace(**{name: data[:end]}), lists.order, None)


def changed(data: bytes, kind: str, at: int, *values: float) -> bytes:
    array = np.frombuffer(data, kind).copy()
    array[at : at + len(values)] = values
    return array.tobytes()


# The pair of the layout test, two lists: root, sphere, triangle 0, sphere, triangle 1
DAMAGE: dict[str, tuple[str, str, int, tuple[float, ...], str]] = {
    "past the end": ("escape", "<i4", 1, (9,), "list 0 of .* has an escape index .* element 1"),
    "to the end": ("escape", "<i4", 1, (4,), "escape index .* element 1"),
    "backwards": ("escape", "<i4", 1, (-2,), "escape index .* element 1"),
    "a sphere as triangle": ("escape", "<i4", 3, (1,), "number that is out of range: element 3"),
    "wraps around": ("escape", "<i4", 1, (2**31 - 1,), "escape index"),
    "ends at once": ("escape", "<i4", 1, (-1,), "not where the hierarchy has it: element 4"),
    "root ends early": ("escape", "<i4", 0, (3,), "element 3"),
    "last in the middle": ("escape", "<i4", 2, (0,), "last primitive .* element 2"),
    "no last": ("escape", "<i4", 4, (1,), "or none at its end: element 4"),
    "sphere as last": ("escape", "<i4", 4, (-1,), "escape index"),
    "triangle as root": ("escape", "<i4", 5, (1,), "list 1 .* outside its root: element 0"),
    "number too large": ("payload", "<i4", 4 * 2 + 3, (2,), "out of range: element 2"),
    "number negative": ("payload", "<i4", 4 * 2 + 3, (-1,), "out of range: element 2"),
    "triangle twice": ("payload", "<i4", 4 * 4, (0, 1, 2, 0), "second time: element 4"),
    "other vertices": ("payload", "<i4", 4 * 2, (0, 2, 1), "vertices that are not those"),
    "sphere too small": ("payload", "<f4", 4 * 1 + 3, (0.5,), "different spheres for one node"),
    "sphere not a number": ("payload", "<f4", 4 * 1 + 3, (np.nan,), "different spheres"),
    "vertex not finite": ("vertices", "<f4", 4, (np.inf,), "not finite"),
    "vertex elsewhere": ("vertices", "<f4", 4, (-3.0,), "sphere 0 .* not that of the triangles"),
    "a fourth number": ("vertices", "<f4", 3, (1.0,), "a fourth that is not 0"),
    "heads do not begin": ("heads", "<i8", 0, (1,), "heads"),
    "heads descend": ("heads", "<i8", 1, (11,), "heads"),
    "heads end early": ("heads", "<i8", 2, (9,), "heads"),
    "root has a parent": ("parent", "<i4", 0, (0,), "parent"),
    "a circle": ("parent", "<i4", 1, (2,), "parent"),
    "another parent": ("parent", "<i4", 2, (1,), "not where the hierarchy has it"),
    "owner out of range": ("owner", "<i4", 0, (3,), "owner"),
    "another owner": ("owner", "<i4", 0, (2,), "not where the hierarchy has it"),
    "corner out of range": ("corners", "<i4", 0, (6,), "corners"),
    "another corner": ("corners", "<i4", 0, (3,), "vertices that are not those"),
}


@pytest.mark.parametrize("what", DAMAGE)
def test_damage_is_named(what: str) -> None:
    name, kind, at, values, sentence = DAMAGE[what]
    pair = np.concatenate([SQUARE[:1], SQUARE[1:] + np.float32([9, 0, 0])])
    parts = to_bytes(lists_of(pair, 2))
    with pytest.raises(InputError, match=sentence):
        from_bytes(parts._replace(**{name: changed(getattr(parts, name), kind, at, *values)}), "earliest_first", None)


def test_a_sphere_that_ends_within_its_child_is_named() -> None:
    """All else fits: the tree and every other escape index."""
    lists = lists_of(load_scene("torus_knot_128").triangles, 1)
    parts, escape = to_bytes(lists), lists.escape
    at = 1 + int(np.argmax((escape[1:-1] > 4) & (escape[2:] > 4)))
    assert escape[at] > escape[at + 1] > 4
    short = changed(parts.escape, "<i4", at, escape[at + 1] - 1)
    with pytest.raises(InputError, match=f"escape index .* element {at + 1}[.]"):
        from_bytes(parts._replace(escape=short), "earliest_first", None)


def test_a_node_in_no_list_is_named() -> None:
    parts = to_bytes(lists_of(SQUARE, 1))
    more = len(parts.parent) // 4
    with pytest.raises(InputError, match=f"node {more} .* in no list"):
        from_bytes(parts._replace(parent=parts.parent + bytes(4)), "earliest_first", None)


def test_what_belongs_together_is_checked() -> None:
    lists = lists_of(SQUARE, 6, culling="sextant_safe")
    parts = to_bytes(lists)
    with pytest.raises(InputError, match=r"list 4 .* lacks triangle 0, against culling=None"):
        from_bytes(parts, "earliest_first", None)
    with pytest.raises(InputError, match=r"list 5 .* has triangle 0, against culling='sextant_opposite'"):
        from_bytes(to_bytes(lists_of(SQUARE, 6)), "earliest_first", "sextant_opposite")
    for order, culling in (("sideways", None), ("latest_last", "all")):
        with pytest.raises(InputError, match="none that there is"):
            from_bytes(parts, order, culling)
    with pytest.raises(InputError, match="no hierarchy"):
        from_bytes(ListBytes(*[b""] * 7), "earliest_first", None)


# The file


def test_the_file(tmp_path: Path) -> None:
    path, lists = tmp_path / "lists.bin", lists_of(FOUR, 8, "latest_last", "octant")
    path.write_bytes(b"older")
    write_lists(path, lists)
    assert_same_lists(lists, read_lists(str(path)))
    data = path.read_bytes()
    assert data == file_bytes(lists) and data[:8] == b"refsimTL" and data[-32:] == hashlib.sha256(data[:-32]).digest()
    assert [child.name for child in tmp_path.iterdir()] == ["lists.bin"]
    with pytest.raises(InputError, match=f"{path.name}' holds no traversal lists: it has"):
        path.write_bytes(data[:-1])
        read_lists(path)


def test_every_cut_and_every_changed_byte_of_a_file() -> None:
    data = file_bytes(lists_of(FOUR, 1))
    for end in range(len(data)):
        with pytest.raises(InputError):
            lists_of_file(data[:end])
    with pytest.raises(InputError, match="asks for"):
        lists_of_file(data + b"\0")
    for at in range(len(data)):
        for flip in (0x01, 0xFF):
            with pytest.raises(InputError):
                lists_of_file(data[:at] + bytes([data[at] ^ flip]) + data[at + 1 :])


@pytest.mark.parametrize(
    "at, value, sentence",
    [
        (0, b"P", "does not begin"),
        (8, struct.pack("<I", 2), "version is 2"),
        (12, struct.pack("<I", 2), "names order 2"),
        (16, struct.pack("<I", 5), "culling 5"),
        (20, struct.pack("<I", 3), "3 lists"),
        (24, struct.pack("<Q", 2**63), "its header asks for"),
        (56, struct.pack("<d", -1.0), "directions"),
    ],
)
def test_a_wrong_header_is_named(at: int, value: bytes, sentence: str) -> None:
    """With a checksum that fits."""
    body = bytearray(file_bytes(lists_of(SQUARE, 1))[:-32])
    body[at : at + len(value)] = value
    with pytest.raises(InputError, match=sentence):
        lists_of_file(bytes(body) + hashlib.sha256(body).digest())


def test_files_that_are_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lists = lists_of(SQUARE, 1)
    for path in (tmp_path / "none", tmp_path, tmp_path / "a\0b"):
        with pytest.raises(InputError, match="cannot read lists from"):
            read_lists(path)
    for path in (tmp_path / "none" / "file", tmp_path, tmp_path / "a\0b"):
        with pytest.raises(InputError, match="cannot write lists to"):
            write_lists(path, lists)
    assert list(tmp_path.iterdir()) == []

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    path = tmp_path / "file"
    write_lists(path, lists)
    monkeypatch.setattr(list_file.os, "replace", full)
    with pytest.raises(InputError, match="No space left"):
        write_lists(path, lists_of(FOUR, 1))
    assert_same_lists(lists, read_lists(path))
    assert [child.name for child in tmp_path.iterdir()] == ["file"]


def test_bytes_of_a_rule_with_other_lists_are_refused() -> None:
    """Such lists would lose hits that nothing culled them for."""
    with pytest.raises(InputError, match="culling='sextant_safe' needs lists=6, not lists=1"):
        from_bytes(to_bytes(lists_of(SQUARE, 1)), "earliest_first", "sextant_safe")
