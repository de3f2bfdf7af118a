"""Sets of orientations: evenly spread ones, and tools that point down.

Sources: super-Fibonacci spirals for rotations (Alexa, Super-Fibonacci Spirals: Fast, Low-Discrepancy Sampling of SO(3),
CVPR 2022); the spherical Fibonacci lattice for directions (Gonzalez, Measurement of Areas on a Sphere Using Fibonacci
and Latitude-Longitude Lattices, Mathematical Geosciences 42, 2010).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.files.orientations import rotations_from_quats
from jacokin.model import checks
from jacokin.model.poses import DOWN_QUAT_WXYZ

GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))  # [rad]
PHI = math.sqrt(2.0)  # the constants of Alexa, section 3: psi solves psi^4 = psi + 4
PSI = 1.533751168755204288118041413
MOST = 100_000


class Orientations:
    """Orientations of the tool in the base frame; immutable.

    Attributes:
        name: how they were made.
        quats_wxyz: (m, 4) unit quaternions.
        rotations: (m, 3, 3) the same as matrices.
    """

    __slots__ = ("name", "quats_wxyz", "rotations")

    def __init__(self, quats_wxyz: ArrayLike, name: str = "given") -> None:
        """Take quaternions (m, 4) whose norm is within 1 % of one.

        Raises:
            InvalidInputError: malformed, none, more than 100,000, or a wrong norm.
        """
        quats = checks.matrix("quats_wxyz", quats_wxyz, 4, "wxyz")
        if len(quats) > MOST:
            raise InvalidInputError(f"at most {MOST} orientations, got {len(quats)}")
        rotations, wrong = rotations_from_quats(quats)
        if len(wrong):
            raise InvalidInputError(f"quats_wxyz[{wrong[0]}] must have norm 1 (within 1 %), got {quats[wrong[0]]}")
        self.name = name
        self.quats_wxyz = checks.read_only(quats)
        self.rotations = checks.read_only(rotations)

    def __len__(self) -> int:
        """How many."""
        return len(self.quats_wxyz)

    @classmethod
    def even(cls, count: int) -> Orientations:
        """Rotations spread evenly over all of them, by a super-Fibonacci spiral."""
        count = checks.whole_number("count", count, lowest=1)
        s = np.arange(min(count, MOST + 1)) + 0.5
        inner, outer = np.sqrt(s / count), np.sqrt(1.0 - s / count)
        alpha, beta = 2.0 * np.pi * s / PHI, 2.0 * np.pi * s / PSI
        spiral = [inner * np.sin(alpha), inner * np.cos(alpha), outer * np.sin(beta), outer * np.cos(beta)]
        return cls(np.stack(spiral, axis=1), f"{count} rotations, super-Fibonacci")

    @classmethod
    def directions(cls, count: int, axis: ArrayLike = (0.0, 0.0, 1.0)) -> Orientations:
        """Rotations that turn `axis` of the tool into directions spread evenly over the sphere, with any roll."""
        count = checks.whole_number("count", count, lowest=1)
        number = np.arange(min(count, MOST + 1))
        z = 1.0 - (2.0 * number + 1.0) / count
        radius, angle = np.sqrt(1.0 - z * z), number * GOLDEN_ANGLE
        return cls(
            turning(_unit(axis), np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)),
            f"{count} directions, spherical Fibonacci",
        )

    @classmethod
    def down(cls, yaws: int = 1) -> Orientations:
        """The tool pointing vertically down, turned about the vertical in equal steps."""
        yaws = checks.whole_number("yaws", yaws, lowest=1)
        half = np.pi * np.arange(min(yaws, MOST + 1)) / yaws
        w, x, y, z = DOWN_QUAT_WXYZ
        c, s = np.cos(half), np.sin(half)  # Rz(2 half) times the tool pointing down
        quats = np.stack([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w], axis=1)
        return cls(quats, f"tool down, {yaws} yaws")

    def without_roll(self, axis: Array) -> Orientations:
        """One of those that turn `axis` of the tool into the same direction."""
        directions = self.rotations @ axis
        _, first = np.unique(np.round(directions, 9), axis=0, return_index=True)
        return Orientations(self.quats_wxyz[np.sort(first)], self.name)


def turning(axis: Array, directions: Array) -> Array:
    """Quaternions (m, 4) of the smallest rotations from a unit vector to others (m, 3)."""
    quats = np.concatenate([1.0 + directions @ axis[:, None], np.cross(axis, directions)], axis=1)
    opposite = quats[:, 0] < 1e-12
    if opposite.any():  # half a turn about anything perpendicular
        across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        quats[opposite] = [0.0, *(across / np.linalg.norm(across))]
    return np.asarray(quats / np.linalg.norm(quats, axis=1, keepdims=True))


def checked_orientations(value: Orientations | int, axis: Array | None) -> Orientations:
    """A set of orientations; of a number, so many rotations, or directions of an axis about which roll is free.

    Raises:
        InvalidInputError: neither a set nor a number.
    """
    if isinstance(value, Orientations):
        return value if axis is None else value.without_roll(axis)
    count = checks.whole_number("orientations", value, lowest=1)
    return Orientations.even(count) if axis is None else Orientations.directions(count, axis)


def _unit(axis: ArrayLike) -> Array:
    vector = checks.vector("axis", axis, 3, "")
    norm = float(np.linalg.norm(vector))
    if norm == 0.0:
        raise InvalidInputError("axis must not be zero")
    return np.asarray(vector / norm)
