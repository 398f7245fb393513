"""What moves: a knight who walks in a box, frame by frame, and a point light on its way round a scene.

The knight stands for "Knight in Box (646), 198 animated frames", Table 1 of *Recursive Ray Tracing in Geometry Shader*
(Ralovich, Magdics, 2010), whose mesh is not published: 646 triangles in every frame, 10 of them the walls of the cube
[-1, 1]^3, open towards +z as `room` and `cornell_box` are, so that every ray of the default camera at fill 0.55 enters
it and hits something. He walks a small circle once, nine strides long, looks about and swings his sword; the frame
after the last is the first.

Frames are the same bits on every machine: bodies are rounded to a grid of 2^-20 before they are placed, which hides the
last bits of a sine, and all that moves is made with + - x / and square roots, one rounding each.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.scene import shapes
from refsim.scene.light import PointLight
from refsim.scene.material import Material
from refsim.scene.mesh import Scene

__all__ = ["FRAMES", "KNIGHT_TRIANGLES", "frames", "knight_in_box", "moving_light"]

FRAMES = 198
KNIGHT_TRIANGLES = 646
STRIDES = 9
CIRCLE, CIRCLE_Z = 0.2, -0.12  # radius of the walk, and where its middle is
GRID = 2.0**20
FLOOR = -1.0 + 2.0**-6  # where his soles are

WALL = Material("wall", "diffuse", (0.73, 0.71, 0.68))
LEFT_WALL = Material("left wall", "diffuse", (0.63, 0.06, 0.05))
RIGHT_WALL = Material("right wall", "diffuse", (0.14, 0.45, 0.09))
STEEL = Material("steel", "diffuse", (0.42, 0.45, 0.5), specular=0.7, shininess=32.0, reflectivity=0.25)
CLOTH = Material("cloth", "diffuse", (0.12, 0.2, 0.55))
GOLD = Material("gold", "diffuse", (0.7, 0.5, 0.12), specular=0.6, shininess=24.0, reflectivity=0.25)
MATERIALS = (WALL, LEFT_WALL, RIGHT_WALL, STEEL, CLOTH, GOLD)
WALLS = {"left": LEFT_WALL, "right": RIGHT_WALL}

Triple = tuple[float, float, float]
Part = tuple[NDArray[np.float64], Material]  # corners float64[n, 3, 3]


def frames(count: int = FRAMES) -> Iterator[Scene]:
    """All frames in order, ``count`` of them for one round."""
    _check_count(count)
    return (knight_in_box(frame, count) for frame in range(count))


def knight_in_box(frame: int = 0, count: int = FRAMES, name: str = "knight_in_box") -> Scene:
    """One frame: walls first, then the knight, always the same triangles in the same order. Frames repeat after
    ``count``."""
    _check_count(count)
    if not isinstance(frame, (int, np.integer)) or isinstance(frame, bool):
        raise InputError(f"frame must be a whole number, not {frame!r}")
    parts = [*_walls(), *_knight(Beat(int(frame) % count, count))]
    ids = [np.full(len(corners), MATERIALS.index(material), np.int32) for corners, material in parts]
    triangles = np.concatenate([corners for corners, _ in parts]).astype(np.float32)
    return Scene(triangles, name, MATERIALS, np.concatenate(ids), lights=(PointLight((0.35, 0.85, 0.55)),))


def moving_light(
    scene: Scene, count: int = 48, *, around: float = 0.8, low: float = -0.4, high: float = 0.9
) -> list[PointLight]:
    """Places of the scene's first light (a white one if it has none) on a closed way about the middle of its box.

    "Moving the light source in the scene incurs high variability in rendering times" (section 6). In ``count`` steps
    the light goes round once, counter-clockwise from above, beginning on the +z side, and twice from ``high`` down to
    ``low`` and up again: from above, where shadow rays leave the ground steeply, to a grazing light, whose shadow rays
    run along it. Distances are in half sides of the bounding box; up to 1 the light stays within it.
    """
    _check_count(count)
    if not all(np.isfinite(value) for value in (around, low, high)):
        raise InputError(f"around, low and high must be finite numbers, not {around!r}, {low!r}, {high!r}")
    first = scene.lights[0] if scene.lights else PointLight((0.0, 0.0, 0.0))
    center = scene.center.tolist()
    half = ((scene.upper.astype(np.float64) - scene.lower) * 0.5).tolist()
    places = []
    for step in range(count):
        beat = Beat(step, count)
        sine, cosine = beat.heading()
        height = 0.5 * (high + low) + 0.5 * (high - low) * beat.wave(2, 0.25)
        offset = (around * sine, height, around * cosine)
        x, y, z = (c + h * o for c, h, o in zip(center, half, offset, strict=True))
        places.append(PointLight((x, y, z), first.color, first.intensity))
    return places


class Beat(NamedTuple):
    """A moment of something that repeats: step ``step`` of ``steps``."""

    step: int
    steps: int

    def wave(self, times: int, shift: float = 0.0) -> float:
        """A smooth wave between -1 and 1 that swings ``times`` times in ``steps``; ``shift`` in swings.

        A sine as Bhaskara I wrote it, 16 x (1 - x) / (5 - 4 x (1 - x)) over half a turn: right to 0.002.
        """
        turn = (times * self.step % self.steps) / self.steps + shift
        turn -= float(np.floor(turn))
        x = 2.0 * turn if turn < 0.5 else 2.0 * turn - 1.0
        bow = 4.0 * x * (1.0 - x)
        value = 4.0 * bow / (5.0 - bow)
        return value if turn < 0.5 else -value

    def heading(self) -> tuple[float, float]:
        """Sine and cosine of an angle that goes round once, to rounding of unit length."""
        sine, cosine = self.wave(1), self.wave(1, 0.25)
        length = float(np.sqrt(sine * sine + cosine * cosine))
        return sine / length, cosine / length


class Joint(NamedTuple):
    """Where a limb hangs: a place, and the directions of its own x (left), y (up) and z (ahead)."""

    at: Triple = (0.0, 0.0, 0.0)
    x: Triple = (1.0, 0.0, 0.0)
    y: Triple = (0.0, 1.0, 0.0)
    z: Triple = (0.0, 0.0, 1.0)

    def moved(self, x: float, y: float, z: float) -> Joint:
        """Shifted in its own directions."""
        a, b, c = (p + (x * i + y * j + z * k) for p, i, j, k in zip(*self, strict=True))
        return self._replace(at=(a, b, c))

    def nodded(self, tangent: float) -> Joint:
        """Turned about its x, up towards ahead, by twice the angle of that tangent."""
        cosine, sine = _half_angle(tangent)
        return self._replace(y=_mix(cosine, self.y, sine, self.z), z=_mix(cosine, self.z, -sine, self.y))

    def rolled(self, tangent: float) -> Joint:
        """Turned about its z, left towards up, by twice the angle of that tangent."""
        cosine, sine = _half_angle(tangent)
        return self._replace(x=_mix(cosine, self.x, sine, self.y), y=_mix(cosine, self.y, -sine, self.x))

    def turned(self, sine: float, cosine: float) -> Joint:
        """Turned about its y, ahead towards left."""
        return self._replace(z=_mix(cosine, self.z, sine, self.x), x=_mix(cosine, self.x, -sine, self.z))

    def carry(self, corners: NDArray[np.float64]) -> NDArray[np.float64]:
        """Corners given in its own directions, in the world's."""
        x, y, z = corners[..., 0], corners[..., 1], corners[..., 2]
        return np.stack([p + (x * i + y * j + z * k) for p, i, j, k in zip(*self, strict=True)], axis=-1)


def _half_angle(tangent: float) -> tuple[float, float]:
    # Cosine and sine of twice the angle of a tangent: rational, so the same everywhere.
    square = tangent * tangent
    return (1.0 - square) / (1.0 + square), 2.0 * tangent / (1.0 + square)


def _mix(a: float, v: Triple, b: float, w: Triple) -> Triple:
    x, y, z = (a * i + b * j for i, j in zip(v, w, strict=True))
    return x, y, z


@cache
def _body(kind: str) -> NDArray[np.float64]:
    """Corners of a body about as large as a unit: 12 to 80 triangles."""
    vertices, faces = {
        "block": lambda: shapes.box((0.0, 0.0, 0.0), (2.0, 2.0, 2.0)),
        "limb": lambda: shapes.sphere(6, 3),
        "head": lambda: shapes.sphere(8, 4),
        "trunk": lambda: shapes.sphere(8, 5),
        "ring": lambda: shapes.torus(8, 3, 1.0, 0.22),
    }[kind]()
    corners = np.rint(vertices[faces] * GRID) / GRID + 0.0  # which turns -0.0, also a matter of last bits, into 0.0
    corners.flags.writeable = False
    return corners


def _placed(joint: Joint, kind: str, half: Triple, material: Material) -> Part:
    return joint.carry(_body(kind) * np.array(half)), material


@cache
def _walls() -> tuple[Part, ...]:
    return tuple((vertices[faces], WALLS.get(wall, WALL)) for wall, (vertices, faces) in shapes.open_cube())


def _knight(beat: Beat) -> list[Part]:
    """All of him, on his feet."""
    sine, cosine = beat.heading()
    # On the circle at that angle he looks along the tangent.
    hips = Joint((CIRCLE * sine, 0.0, CIRCLE * cosine + CIRCLE_Z)).turned(cosine, -sine)
    parts = [*_legs(hips, beat), *_trunk(hips, beat)]
    lowest = min(float(corners[..., 1].min()) for corners, _ in parts)
    lift = np.array([0.0, FLOOR - lowest, 0.0])
    return [(corners + lift, material) for corners, material in parts]


def _legs(hips: Joint, beat: Beat) -> list[Part]:
    parts = [_placed(hips, "block", (0.13, 0.07, 0.09), CLOTH)]
    for side, shift in ((1.0, 0.0), (-1.0, 0.5)):
        # A leg that swings forward is bent; one that stands is straight.
        thigh = hips.moved(0.085 * side, -0.04, 0.0).nodded(-0.24 * beat.wave(STRIDES, shift))
        shin = thigh.moved(0.0, -0.3, 0.0).nodded(0.16 + 0.16 * beat.wave(STRIDES, shift + 0.25))
        foot = shin.moved(0.0, -0.31, 0.0).nodded(-0.1 - 0.08 * beat.wave(STRIDES, shift + 0.25))
        parts += [
            _placed(thigh.moved(0.0, -0.15, 0.0), "limb", (0.075, 0.18, 0.085), STEEL),
            _placed(shin.moved(0.0, -0.155, 0.0), "limb", (0.06, 0.18, 0.065), STEEL),
            _placed(foot.moved(0.0, -0.02, 0.05), "block", (0.05, 0.03, 0.11), STEEL),
        ]
    return parts


def _trunk(hips: Joint, beat: Beat) -> list[Part]:
    chest = hips.moved(0.0, 0.06, 0.0).nodded(0.03).turned(*_swing(0.09 * beat.wave(STRIDES, 0.5)))
    head = chest.moved(0.0, 0.47, 0.0).turned(*_swing(0.2 * beat.wave(2)))
    return [
        _placed(chest.moved(0.0, 0.2, 0.0), "trunk", (0.19, 0.25, 0.13), CLOTH),
        _placed(chest.moved(0.0, 0.01, 0.0), "ring", (0.14, 0.14, 0.105), GOLD),
        _placed(head.moved(0.0, 0.09, 0.0), "head", (0.105, 0.135, 0.115), STEEL),
        _placed(head.moved(0.0, 0.1, 0.09), "block", (0.085, 0.02, 0.035), GOLD),
        _placed(head.moved(0.0, 0.22, -0.03).nodded(-0.2), "block", (0.015, 0.06, 0.08), CLOTH),
        *_shield_arm(chest, beat),
        *_sword_arm(chest, beat),
    ]


def _swing(tangent: float) -> tuple[float, float]:
    cosine, sine = _half_angle(tangent)
    return sine, cosine


def _arm(shoulder: Joint, bend: float) -> tuple[Joint, list[Part]]:
    elbow = shoulder.moved(0.0, -0.23, 0.0).nodded(bend)
    hand = elbow.moved(0.0, -0.22, 0.0)
    return hand, [
        _placed(shoulder.moved(0.0, -0.11, 0.0), "limb", (0.06, 0.14, 0.065), STEEL),
        _placed(elbow.moved(0.0, -0.1, 0.0), "limb", (0.048, 0.13, 0.05), STEEL),
        _placed(hand, "block", (0.035, 0.045, 0.04), GOLD),
    ]


def _shield_arm(chest: Joint, beat: Beat) -> list[Part]:
    shoulder = chest.moved(0.21, 0.36, 0.0).rolled(0.1).nodded(-0.22 + 0.05 * beat.wave(STRIDES))
    hand, parts = _arm(shoulder, -0.45)
    shield = hand.moved(0.05, 0.06, 0.05)
    return [*parts, _placed(shield, "limb", (0.025, 0.2, 0.17), GOLD)]


def _sword_arm(chest: Joint, beat: Beat) -> list[Part]:
    lifted = 0.5 + 0.5 * beat.wave(3, 0.75)
    shoulder = chest.moved(-0.21, 0.36, 0.0).rolled(-0.12).nodded(-0.15 - 0.75 * lifted)
    hand, parts = _arm(shoulder, -0.3)
    # The hilt stands across the hand; the blade goes ahead of it.
    sword = hand.nodded(-0.25)
    return [
        *parts,
        _placed(sword.moved(0.0, 0.0, 0.02), "block", (0.012, 0.012, 0.08), CLOTH),
        _placed(sword.moved(0.0, 0.0, 0.11), "block", (0.06, 0.016, 0.012), GOLD),
        _placed(sword.moved(0.0, 0.0, 0.3), "block", (0.008, 0.022, 0.19), STEEL),
    ]


def _check_count(count: object) -> None:
    if not isinstance(count, (int, np.integer)) or isinstance(count, bool) or count < 1:
        raise InputError(f"count must be a whole number from 1, not {count!r}")
