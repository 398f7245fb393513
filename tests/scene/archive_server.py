"""A server on loopback with small made-up archives, and a made-up table of known meshes that points to it."""

from __future__ import annotations

import gzip
import hashlib
import io
import tarfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

from refsim.scene import fetch
from refsim.scene.archives import Original
from refsim.scene.known import KNOWN_MESHES, KnownMesh

VERTICES = np.random.default_rng(11).normal(size=(60, 3)).astype(np.float32)
FACES = np.random.default_rng(12).integers(0, 60, size=(90, 3))
MEMBER = "stone/reconstruction/stone.ply"


def text_ply(vertices=VERTICES, faces=FACES) -> bytes:
    """A PLY file as archives have it: text, with a comment and columns that nobody reads."""
    head = f"ply\nformat ascii 1.0\ncomment zipped by hand\nelement vertex {len(vertices)}\n"
    head += "".join(f"property float {name}\n" for name in ("x", "y", "z", "confidence"))
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [" ".join(str(value) for value in row) + " 0.5" for row in vertices]
    return (head + "\n".join(rows + [f"3 {a} {b} {c}" for a, b, c in faces]) + "\n").encode()


def tar_of(files: dict[str, bytes], links: dict[str, str] | None = None) -> bytes:
    """A compressed tar archive of ``files`` and symbolic ``links``."""
    memory = io.BytesIO()
    with tarfile.open(fileobj=memory, mode="w:gz") as tar:
        for name, data in files.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(data)
            tar.addfile(entry, io.BytesIO(data))
        for name, target in (links or {}).items():
            entry = tarfile.TarInfo(name)
            entry.type, entry.linkname = tarfile.SYMTYPE, target
            tar.addfile(entry)
    return memory.getvalue()


# What the mesh must become, written here byte by byte and not by the code under test.
WANTED = (
    b"ply\nformat binary_little_endian 1.0\nelement vertex 60\nproperty float x\nproperty float y\nproperty float z\n"
    b"element face 90\nproperty list uchar int vertex_indices\nend_header\n"
    + VERTICES.tobytes()
    + b"".join(b"\x03" + np.int32(face).tobytes() for face in FACES)
)
STONE = KnownMesh("stone", "Stone, a made-up archive", 90, hashlib.sha256(WANTED).hexdigest())
SHIFTED = VERTICES + np.float32([0, 0, 1e-3])
GOOD = tar_of({"stone/README": b"read me", MEMBER: text_ply()})
ARCHIVES = {
    "good.tar.gz": GOOD,
    "good.ply.gz": gzip.compress(text_ply()),
    "turned.ply.gz": gzip.compress(text_ply(faces=FACES[:, ::-1])),
    "sly.tar.gz": tar_of({"../../escaped.ply": text_ply(), MEMBER: text_ply()}, {"stone/link": "../.."}),
    "linked.tar.gz": tar_of({"other.ply": text_ply()}, {MEMBER: "../../other.ply"}),
    "looped.tar.gz": tar_of({}, {MEMBER: "stone.ply"}),
    "swollen.ply.gz": gzip.compress(bytes(9_000)),
    "swollen.tar.gz": tar_of({MEMBER: bytes(9_000)}),
    "moved.tar.gz": tar_of({MEMBER: text_ply(SHIFTED)}),
    "fewer.tar.gz": tar_of({MEMBER: text_ply(faces=FACES[:-1])}),
    "empty.tar.gz": tar_of({"stone/README": b"read me"}),
    "truncated.tar.gz": GOOD[: len(GOOD) // 2],
    "truncated.ply.gz": gzip.compress(text_ply())[:-300],
    "page.tar.gz": b"<html>we have moved</html>",
    "nonsense.tar.gz": tar_of({MEMBER: b"no mesh"}),
}


class Handler(BaseHTTPRequestHandler):
    """Answers with an archive; /coded/ names gzip as the transfer's coding.

    /cut/ promises all of it and sends half, /stalled/ does and then sends nothing, /silent/ does not even answer.
    """

    def do_GET(self) -> None:
        self.server.asked.append(self.path)
        *way, name = self.path.strip("/").split("/")
        data = ARCHIVES.get(name)
        if data is None:
            return self.send_error(404)
        if way == ["silent"]:
            return self.server.over.wait()
        self.send_response(200)
        self.send_header("Content-Length", str(len(data)))
        if way == ["coded"]:
            self.send_header("Content-Encoding", "gzip")
        self.end_headers()
        self.wfile.write(data[: len(data) // 2] if way in (["cut"], ["stalled"]) else data)
        if way == ["stalled"]:
            self.server.over.wait()

    def log_message(self, *_) -> None:
        pass


@contextmanager
def serving() -> Iterator[ThreadingHTTPServer]:
    """A server that lists in ``asked`` what it was asked for."""
    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        server.asked, server.over = [], threading.Event()
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server
        finally:
            server.over.set()
            server.shutdown()
            thread.join()


def known_at(monkeypatch: pytest.MonkeyPatch, url: str, **changes: object) -> None:
    """Know a mesh ``stone`` whose archive is at ``url``, and the same as ``pebble``; no proxy stands between."""
    member = MEMBER if ".tar" in url else None
    original = replace(Original(url, member, 60, "the mason", "free for all"), **changes)
    known = {"stone": STONE, "pebble": replace(STONE, name="pebble")}
    monkeypatch.setattr(fetch, "KNOWN_MESHES", {**KNOWN_MESHES, **known})
    monkeypatch.setattr(fetch, "ORIGINALS", dict.fromkeys(known, original))
    for name in ("NO_PROXY", "no_proxy"):
        monkeypatch.setenv(name, "127.0.0.1")
