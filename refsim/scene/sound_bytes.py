"""Mesh files made safe for trimesh: what it would lose, reorder, clip or wrap without a word is refused or spelt out.

Each function takes the bytes of a file and returns bytes that trimesh reads rightly; the comments name what it would do
otherwise (as trimesh 5.2 does). Numbers are left as the file spells them.
"""

from __future__ import annotations

import re
from collections import Counter
from itertools import pairwise

from refsim.errors import InputError

__all__ = ["ply_face_count", "sound_obj", "sound_ply", "sound_stl"]

WHOLE = r"u?(?:char|short|int|int8|int16|int32)"
PLY_LINE = re.compile(
    r"format (?:ascii|binary_little_endian|binary_big_endian) \S+|element [\w-]+ [0-9]{1,18}|"
    rf"property (?:list {WHOLE} )?(?:{WHOLE}|float|float32|float64|double) \S+"
)
OBJ_WIDTHS = {"v": 3, "vt": 2, "vn": 3}
NUMBER = r"[-+]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:e[-+]?[0-9]++)?|[-+]?(?:nan|inf)"
STL_ITEM = re.compile(
    rf"\s*(?:(?P<end>end)?solid\b[^\n]*|(?P<facet>facet\s+normal(?:\s+\S+){{3}}\s+outer\s+loop\s+"
    rf"(?:vertex(?:[ \t]+(?:{NUMBER})){{3}}[ \t\r]*\n\s*){{3}}endloop\s+endfacet\b))\s*",
    re.IGNORECASE,
)


def ply_face_count(data: bytes) -> int | None:
    """Number of faces that a PLY header declares; ``data`` need only hold the header; None if it has none."""
    found = re.search(rb"^element[ \t]+face[ \t]+([0-9]{1,18})\s*$", data.partition(b"\nend_header")[0], re.MULTILINE)
    return int(found[1]) if found and data.startswith(b"ply") else None


def sound_ply(label: str, data: bytes) -> bytes:
    """The PLY file with a plain header, its elements face and edge renamed to all.face and all.edge."""
    if not re.match(rb"ply[ \t\r]*\n", data):
        raise InputError(f"{label} is not a PLY file: it does not begin with the line 'ply'")
    end = re.search(rb"\nend_header[ \t\r]*\n", data)
    if end is None:
        raise InputError(f"{label} is truncated: its header has no end_header line")
    # trimesh takes whatever stands in the second line for the format, and anything but "ascii" there for little-endian.
    lines = [" ".join(line.split()) for line in data[: end.start()].decode("latin-1").split("\n")[1:]]
    lines = [line for line in lines if line and line.split()[0] not in ("comment", "obj_info")]
    for line in lines:
        if not PLY_LINE.fullmatch(line):
            raise InputError(f"{label} has a PLY header line that cannot be read: {line!r}")
    if [line.startswith("format ") for line in lines] != [True] + [False] * (len(lines) - 1):
        raise InputError(f"{label} has a PLY header without a format line at its top, or with two")
    layout = _ply_layout(label, lines[1:])
    header = "\n".join(["ply", *lines, "end_header\n"])
    # From elements of its own names trimesh would make triangles in another order (triangles, quads, then the rest),
    # or a path; with others it hands over the tables as they are.
    header = re.sub(r"(?m)^element (face|edge) ", r"element all.\1 ", header)
    if "format ascii" not in lines[0]:
        return header.encode() + data[end.end() :]
    # A blank line would be the number -1.
    rows = [row for row in data[end.end() :].decode("latin-1").splitlines() if row.strip()]
    _check_ply_rows(label, rows, layout)
    # trimesh casts the numbers of a text to the types in the header: 300 becomes 44 as uchar, 1.5 becomes 1 as int.
    header = re.sub(r"(?m)^(property (?:list \S+ )?)\S+( \S+)$", r"\1double\2", header)
    return (header + "\n".join(rows) + "\n").encode()


def _ply_layout(label: str, lines: list[str]) -> dict[str, tuple[int, dict[str, bool]]]:
    # Element name to rows, and property name to whether it is a list.
    layout: dict[str, tuple[int, dict[str, bool]]] = {}
    for line in lines:
        kind, *words = line.split()
        columns = next(reversed(layout.values()))[1] if layout else {}
        # Of two of the same name trimesh keeps one.
        if (kind == "element" and words[0] in layout) or (kind == "property" and words[-1] in columns):
            raise InputError(f"{label} has a PLY header line for the second time: {line!r}")
        if kind == "element":
            layout[words[0]] = int(words[1]), {}
        else:
            columns[words[-1]] = words[0] == "list"
    if not {"x", "y", "z"} <= layout.get("vertex", (0, {}))[1].keys():
        raise InputError(f"{label} has no element vertex with the properties x, y and z")
    return layout


def _check_ply_rows(label: str, rows: list[str], layout: dict[str, tuple[int, dict[str, bool]]]) -> None:
    # trimesh is content with fewer rows than the header declares and with more, takes the length of a list from the
    # first row when all rows are of one width, and clips a list that is too short.
    start = 0
    for element, (length, columns) in layout.items():
        here, start = rows[start : start + length], start + length
        if len(here) < length:
            raise InputError(f"{label} is truncated: it ends inside its {length} rows of element {element}")
        for number, row in enumerate(here):
            words, width = row.split(), 0
            try:
                for is_list in columns.values():
                    width += 1 + (int(words[width]) if is_list else 0)
                fits = width == len([float(word) for word in words])
            except (ValueError, IndexError):
                fits = False
            if not fits:
                raise InputError(f"{label} has a wrong row {number} in its element {element}: {row[:80]!r}")
    if len(rows) > start:
        raise InputError(f"{label} has a row that its header does not declare: {rows[start][:80]!r}")


def sound_obj(label: str, data: bytes) -> bytes:
    """The v, vn, vt and f lines of the OBJ file, faces as fans of triangles whose corners are all of one form.

    trimesh would make every material a mesh, the last one first; read an index that counts back as one from the end of
    the file and 0 as the first vertex; split quads before or behind the rest; take a hexagon for a triangle with
    texture coordinates; pass over lines that begin with blanks and faces of two corners; drop normals and texture
    coordinates whose index is out of range.
    """
    if b"\0" in data:
        raise InputError(f"{label} is not an OBJ file: it holds binary data")
    text = data.decode("latin-1").replace("\\\r\n", " ").replace("\\\n", " ")
    rows = [row.partition("#")[0] for row in text.splitlines()]
    total = Counter(words[0] for row in rows if (words := row.split(None, 1)))
    seen: Counter[str] = Counter()
    known: dict[str, str] = {}
    lines: list[str] = []
    faces: list[str] = []
    for number, row in enumerate(rows, start=1):
        words = row.split()
        if words and words[0] in OBJ_WIDTHS:
            seen[words[0]] += 1
            lines.append(_obj_numbers(label, number, words))
        elif words and words[0] == "f":
            if len(words) < 4:
                raise InputError(f"{label} has a face with {len(words) - 1} vertices in line {number}, no polygon")
            first, *others = [
                known.get(word) or _obj_corner(label, number, word, seen, total, known) for word in words[1:]
            ]
            faces += [f"f {first} {second} {third}" for second, third in pairwise(others)]
    if not faces:
        raise InputError(f"{label} holds no triangles")
    return "\n".join([*lines, *_obj_of_one_form(faces, known)]).encode()


def _obj_of_one_form(faces: list[str], known: dict[str, str]) -> list[str]:
    # Normals and texture coordinates count only where every corner has them. trimesh reads all faces as the first one
    # is written, if they only have as many numbers.
    forms = {tuple(bool(part) for part in [*corner.split("/"), "", ""][:3]) for corner in known.values()}
    if len(forms) == 1:
        return faces
    texcoords, normals = (all(form[slot] for form in forms) for slot in (1, 2))
    form = (r"\1", r"\1/\2", r"\1//\3", r"\1/\2/\3")[texcoords + 2 * normals]
    return [re.sub("([0-9]+)/?([0-9]*)/?([0-9]*)", form, face) for face in faces]


def _obj_numbers(label: str, number: int, words: list[str]) -> str:
    # A texture coordinate may have one number only; its second is then 0. trimesh cuts all rows to the shortest.
    width = OBJ_WIDTHS[words[0]]
    values = [*words[1:], "0"][:width] if words[0] == "vt" else words[1 : 1 + width]
    try:
        sound = len([float(value) for value in values]) == width
    except ValueError:
        sound = False
    if not sound:
        raise InputError(
            f"{label} has a {words[0]} line that is not {width} numbers, line {number}: {' '.join(words[1:])!r}"
        )
    return " ".join([words[0], *values])


def _obj_corner(
    label: str, number: int, word: str, seen: Counter[str], total: Counter[str], known: dict[str, str]
) -> str:
    # The corner with indices counted from the front; kept in ``known`` under each word that always means it.
    parts = word.split("/")
    rows: list[str] = []
    try:
        for keyword, part in zip(OBJ_WIDTHS, parts, strict=False):
            index = int(part) if part or keyword == "v" else None
            row = index if index is None or index > 0 else seen[keyword] + 1 + index
            if index == 0 or (row is not None and not 1 <= row <= total[keyword]):
                raise ValueError
            rows.append("" if row is None else str(row))
        if len(parts) > 3:
            raise ValueError
    except ValueError:
        lines = ", ".join(f"{total[keyword]} {keyword}" for keyword in OBJ_WIDTHS)
        raise InputError(
            f"{label} has a face corner that is no index in line {number}: {word[:40]!r} (of {lines} lines)"
        ) from None
    corner = "/".join(rows).rstrip("/")
    known[corner] = corner
    if "-" not in word:
        known[word] = corner
    return corner


def sound_stl(label: str, data: bytes) -> bytes:
    """The STL file; of an ASCII one, its facets as a single solid without a name.

    A file whose length fits its binary header is binary, even if it begins with "solid", as some exporters write.
    """
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else -1
    if count >= 0 and len(data) == 84 + 50 * count:
        return data
    # A binary file of the wrong length would be taken for an ASCII one without any solid, which is empty.
    if data.lstrip()[:5].lower() != b"solid" or b"\0" in data:
        if count < 0:
            raise InputError(f"{label} is not an STL file: it is shorter than a binary header and no 'solid'")
        raise InputError(
            f"{label} is truncated or no STL file: its header says {count} triangles, "
            f"and it holds {(len(data) - 84) / 50:.6g}"
        )
    # trimesh drops a solid without endsolid, reads "vertex" in a name, and counts vertices without regard to facets.
    text = data.decode("latin-1")
    facets: list[str] = []
    position, ended = 0, False
    while item := STL_ITEM.match(text, position):
        position, ended = item.end(), item["end"] is not None
        facets += [item["facet"]] if item["facet"] else []
    if position < len(text) or not ended:
        raise InputError(
            f"{label} is truncated or no ASCII STL of triangles, an item a line: behind {len(facets)} facets stands "
            f"{' '.join(text[position : position + 200].split())[:90]!r}, neither facet nor endsolid"
        )
    return "\n".join(["solid", *facets, "endsolid\n"]).encode()
