"""Where the real meshes come from first: the archive of each mesh that has one, whom to credit, and its terms.

``ORIGINALS`` has a mesh of ``KNOWN_MESHES`` if what is known here is what its first archive holds; ``why_not`` says of
the others why they cannot be had from there. An address may grow old and an archive may change: the hash decides.
"""

from __future__ import annotations

from dataclasses import dataclass

from refsim.scene.known import KNOWN_MESHES

__all__ = ["ORIGINALS", "UNSEEN", "Original", "why_not"]


@dataclass(frozen=True)
class Original:
    """The archive at ``url`` and what of it is the mesh.

    member    path of the PLY file inside a tar archive; None where the download is the one file, compressed
    vertices  their number
    credit    whom its publisher asks to name
    terms     what its publisher allows, as far as known
    turned    the archive's triangles point inward and are turned round here
    """

    url: str
    member: str | None
    vertices: int
    credit: str
    terms: str
    turned: bool = False


_STANFORD = "https://graphics.stanford.edu/pub/3Dscanrep/"


def _stanford(archive: str, member: str, vertices: int) -> Original:
    return Original(
        _STANFORD + archive,
        member,
        vertices,
        "Stanford University Computer Graphics Laboratory",
        "research use, free mirroring, redistribution and publication with credit to the laboratory; "
        "no commercial use without its permission",
    )


def _dragon(ending: str, vertices: int) -> Original:
    return _stanford("dragon/dragon_recon.tar.gz", f"dragon_recon/dragon_vrip{ending}.ply", vertices)


ORIGINALS: dict[str, Original] = {
    "bunny": _stanford("bunny.tar.gz", "bunny/reconstruction/bun_zipper.ply", 35_947),
    "dragon": _dragon("", 437_645),
    "dragon_res2": _dragon("_res2", 100_250),
    "dragon_res3": _dragon("_res3", 22_998),
    "dragon_res4": _dragon("_res4", 5_205),
    "horse": Original(
        "http://www-static.cc.gatech.edu/data_files/large_models/horse.ply.gz",
        None,
        48_485,
        "Large Geometric Models Archive, Georgia Institute of Technology; scanned by Cyberware",
        "no explicit licence known; distributed by the archive for research",
        turned=True,
    ),
}

# What others made of an original; the rest has no original archive that is known.
CHANGED = ("bunny_closed", "dragon_100k", "buddha_100k", "armadillo_52k", "lucy_100k")

# Meshes of the papers whose archive is known and whose content is not, as no number here was made with them.
UNSEEN = {"happy_buddha": f"happy_recon/happy_vrip.ply in {_STANFORD}happy/happy_recon.tar.gz"}


def why_not(name: str) -> str:
    """Why the mesh ``name`` of ``UNSEEN`` or ``KNOWN_MESHES``, not ``ORIGINALS``, is not fetched, and where it is."""
    by_hand = f"put {name}.ply into the folder of scenes by hand"
    if name in UNSEEN:
        return (
            f"mesh {name!r} cannot be fetched: no SHA-256 of its content is known, so nothing here could tell the "
            f"right mesh from another; it is {UNSEEN[name]}; {by_hand}"
        )
    changed = name in CHANGED
    reason = "others changed it after its first publication" if changed else "no original archive of it is known"
    return f"mesh {name!r} cannot be fetched: {reason}; it comes from: {KNOWN_MESHES[name].source}; {by_hand}"
