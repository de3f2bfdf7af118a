"""Measure, on a Pinocchio model, whether the closed form applies, and the few numbers it needs.

The letters are those of ``docs/closed_form.md``: axes ``w1 .. w6``, the points ``O`` (axes 1 and 2), ``C``
(axes 3 and 4), ``B`` (axes 4 and 5), ``A`` (axes 5 and 6), all at q = 0 in the base frame.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.errors import StructureError
from jacokin.kernels.tolerances import (
    SMALLEST_LENGTH,
    SMALLEST_OFFSET,
    SMALLEST_TWIST,
    SPHERICAL_TOLERANCE,
    STRUCTURE_TOLERANCE,
)
from jacokin.model import checks
from jacokin.model.kinematics import arm_of

WORDS = {6: "six", 7: "seven"}


def chain_of(model: pin.Model, frame_id: int, tool: pin.SE3 | None, count: int) -> NDArray[np.float64]:
    """(count + 1, 3, 4) placements between so many joints that all turn about z.

    Raises:
        StructureError: the model is not one chain of revolute joints, or the frame is not on its last link.
    """
    if model.nq != count or model.nv != count or model.njoints != count + 1:
        hint = ": solve_all holds joints at values with fixed=" if model.nv > count else ""
        raise StructureError(
            f"the closed form needs {WORDS[count]} joints of one angle each; this model has {model.nv}{hint}"
        )
    names = [str(name) for name in list(model.names)[1:]]
    if list(model.parents)[1:] != list(range(count)):
        raise StructureError(f"the closed form needs the {WORDS[count]} joints in one chain; this model branches")
    frame = model.frames[frame_id]
    if frame.parentJoint != count:
        raise StructureError(
            f"the closed form solves for frames on the last link; frame {frame.name!r} does not move with "
            f"joint {names[-1]!r}",
            (names[-1], str(frame.name)),
        )
    arm = arm_of(model, frame_id, tool)
    for slide in np.flatnonzero(arm.sliding).tolist():
        kind, name = model.joints[slide + 1].shortname(), names[slide]
        raise StructureError(f"the closed form needs revolute joints; joint {name!r} is a {kind}", (name, name))
    return arm.placements


Frames = list[tuple[NDArray[np.float64], NDArray[np.float64]]]


def frames_at_zero(chain: NDArray[np.float64]) -> Frames:
    """Rotation (3, 3) and origin (3,) of every joint at q = 0 in the base, z along its axis; last the solved frame."""
    rotation, position = np.eye(3), np.zeros(3)
    frames = []
    for placement in chain:
        position = position + rotation @ placement[:, 3]
        rotation = rotation @ placement[:, :3]
        frames.append((rotation, position))
    return frames


class StructureCheck:
    """Measures pairs of axes at q = 0, keeps the worst misfit, and raises with the names of the pair.

    Attributes:
        frames: rotation (3, 3) and origin (3,) of each joint in the base.
        axes: (3,) unit vectors in the base, one for each joint.
        home: rotation and position of the solved frame.
        worst: the largest misfit so far [m or rad].
    """

    def __init__(self, names: Sequence[str], chain: NDArray[np.float64]) -> None:
        """Place the joints of a chain, which have these names."""
        self._names = names
        *self.frames, self.home = frames_at_zero(chain)
        self.axes = [rotation[:, 2].copy() for rotation, _ in self.frames]
        self._points = [position for _, position in self.frames]
        self.worst = 0.0

    def _check(self, i: int, j: int, misfit: float, unit: str, wanted: str) -> None:
        self.worst = max(self.worst, misfit)
        if not misfit <= STRUCTURE_TOLERANCE:
            self._refuse(i, j, misfit, unit, f"{wanted}; they miss it by {misfit:.3g} {unit}")

    def _refuse(self, i: int, j: int, misfit: float, unit: str, text: str) -> None:
        pair = (self._names[i], self._names[j])
        raise StructureError(
            f"the closed form does not fit this robot: {pair[0]} and {pair[1]}: {text} "
            f"(tolerance {STRUCTURE_TOLERANCE:g} {unit})",
            pair,
            misfit,
            unit,
        )

    def angle(self, i: int, j: int, degrees: float) -> None:
        """Axes i and j must enclose this angle."""
        sine = np.linalg.norm(np.cross(self.axes[i], self.axes[j]))
        angle = np.arctan2(sine, self.axes[i] @ self.axes[j])
        self._check(i, j, abs(float(angle) - np.radians(degrees)), "rad", f"the axes must enclose {degrees:g} deg")

    def parallel(self, i: int, j: int) -> float:
        """Axes i and j must be parallel (1.0) or antiparallel (-1.0)."""
        sine = float(np.linalg.norm(np.cross(self.axes[i], self.axes[j])))
        self._check(i, j, sine, "rad", "the axes must be parallel")
        return 1.0 if self.axes[i] @ self.axes[j] > 0.0 else -1.0

    def twist(self, i: int, j: int) -> None:
        """Axes i and j must be clearly not parallel."""
        sine = float(np.linalg.norm(np.cross(self.axes[i], self.axes[j])))
        if sine < np.sin(SMALLEST_TWIST):
            self._refuse(i, j, sine, "rad", f"the axes must not be parallel; they enclose {np.arcsin(sine):.3g} rad")

    def meet(self, i: int, j: int) -> NDArray[np.float64]:
        """The point where axes i and j meet: the middle of their common perpendicular."""
        normal = np.cross(self.axes[i], self.axes[j])
        normal /= np.linalg.norm(normal)
        between = self._points[j] - self._points[i]
        self._check(i, j, abs(float(between @ normal)), "m", "the axes must meet")
        along = np.linalg.solve(np.column_stack([self.axes[i], -self.axes[j], normal]), between)
        first = self._points[i] + along[0] * self.axes[i]
        second = self._points[j] + along[1] * self.axes[j]
        return np.asarray(0.5 * (first + second), dtype=np.float64)

    def same_point(self, i: int, j: int, first: NDArray[np.float64], second: NDArray[np.float64]) -> None:
        """Two points where axes meet, the second on axes i and j, must be one."""
        misfit = float(np.linalg.norm(second - first))
        self._check(i, j, misfit, "m", "the axes must meet where those before them do")

    def long_enough(self, i: int, j: int, length: float, what: str, least: float = SMALLEST_LENGTH) -> None:
        """A length of the mechanism must not vanish."""
        if length < least:
            self._refuse(i, j, length, "m", f"{what} is {length:.3g} m; it must be at least {least:g} m")


class ArmGeometry(NamedTuple):
    """What the kernels know about an arm, as flat read-only arrays."""

    chain: NDArray[np.float64]
    """(dof + 1, 3, 4) [-, m]; pose = chain[0] Rz(q1) chain[1] Rz(q2) ... chain[dof], exactly the model's."""
    arm: NDArray[np.float64]
    """Six joints: (46,) the constants of the closed form, in the order of ``kernels.closed_form.arm.unpack_arm``.
    Seven: (12,) W in the tool frame, O in the base, O after joint 2, W after joint 4, see ``self_motion.seven`` [m]."""
    misfit: float
    """The largest deviation from the structure found [m or rad]."""
    spherical: bool
    """Whether the axes of the last three joints meet in one point."""


def measure(model: pin.Model, frame_id: int, tool: pin.SE3 | None = None) -> ArmGeometry:
    """Measure the structure of a six-joint arm.

    Args:
        model: Pinocchio model with six revolute joints in one chain, nq == nv == 6.
        frame_id: index of the frame to solve for; it must be fixed to the last link.
        tool: T_frame_tool, a constant pose after that frame, or None.

    Raises:
        StructureError: The model is no such chain, or a pair of axes does not meet, is not parallel or not
            perpendicular where the closed form needs it; names the joints and the misfit.
    """
    return measure_chain(list(model.names)[1:], chain_of(model, frame_id, tool, 6))


def measure_chain(names: Sequence[str], chain: NDArray[np.float64]) -> ArmGeometry:
    """Measure the structure of a chain (7, 3, 4) of six joints, as `measure` does; the names are those of its joints.

    Raises:
        StructureError: as there.
    """
    check = StructureCheck(names, chain)
    w, (R_home, p_home) = check.axes, check.home

    check.angle(0, 1, 90.0)
    origin = check.meet(0, 1)
    side = check.parallel(1, 2)
    check.angle(2, 3, 90.0)
    C = check.meet(2, 3)
    check.twist(3, 4)
    check.twist(4, 5)
    B = check.meet(3, 4)
    A = check.meet(4, 5)
    c4 = float((C - B) @ w[3])
    e3 = float((C - origin) @ w[2])
    upper_arm = math.sqrt(max(float((C - origin) @ (C - origin)) - e3**2, 0.0))
    check.long_enough(2, 3, upper_arm, "the distance from axis 2 to axis 3")
    check.long_enough(3, 4, abs(c4), "the distance from axis 3 to axis 5 along axis 4")
    check.long_enough(0, 2, abs(e3), "the lateral offset of the shoulder", SMALLEST_OFFSET)

    # Shoulder frame: x = w3 x w1, y = w3, z = w1. Wrist frame: x = e, y = f, z = w5 with w4 in the x, z plane.
    S = _orthonormal(w[0], w[2])
    E = _orthonormal(w[4], np.cross(w[4], w[3]))
    cos_a = float(np.clip(w[3] @ w[4], -1.0, 1.0))
    C_s, w4_s, w3_w = S @ (C - origin), S @ w[3], E @ w[2]
    w4_w = E @ w[3]
    g_w = np.cross(w4_w, (0.0, 1.0, 0.0))
    b5 = float((B - A) @ w[4])
    spherical = abs(b5) < SPHERICAL_TOLERANCE
    arm = np.concatenate(
        [
            (E @ R_home).ravel(),  # 0:9 N
            S.ravel(),  # 9:18
            origin,  # 18:21 O
            E @ (A - p_home),  # 21:24
            E @ w[5],  # 24:27
            [cos_a, np.sqrt(1.0 - cos_a**2), b5, c4, e3, float((C - origin) @ (C - origin))],  # 27:33
            [side],  # 33
            [
                np.arctan2(C_s[0], C_s[2]),
                np.arctan2(w4_s[0], w4_s[2]),
                np.arctan2(w3_w @ g_w, w3_w[1]),
            ],  # 34:37
            [float(spherical), check.worst],  # 37:39
            [0.0] * 7,  # 39:46, of arms of another structure
        ]
    ).astype(np.float64)
    return ArmGeometry(checks.sealed(chain), checks.sealed(arm), check.worst, spherical)


def _orthonormal(z: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation into the frame with the given z and, as nearly as possible, the given y axis (rows are axes)."""
    y = y - (y @ z) * z
    y = y / np.linalg.norm(y)
    return np.vstack([np.cross(y, z), y, z])


def measure_seven(model: pin.Model, frame_id: int, tool: pin.SE3 | None = None) -> ArmGeometry:
    """Measure the structure of a seven-joint arm: axes 1 and 2 meet in O, axes 5, 6 and 7 in W.

    Args:
        model: Pinocchio model with seven revolute joints in one chain, nq == nv == 7.
        frame_id: index of the frame to solve for; it must be fixed to the last link.
        tool: T_frame_tool, a constant pose after that frame, or None.

    Raises:
        StructureError: The model is no such chain, or a pair of axes does not meet; names the joints and the misfit.
    """
    chain = chain_of(model, frame_id, tool, 7)
    check = StructureCheck(list(model.names)[1:], chain)
    for i in range(6):
        check.twist(i, i + 1)
    S = check.meet(0, 1)
    W = check.meet(4, 5)
    check.same_point(5, 6, W, check.meet(5, 6))
    (R2, p2), (R4, p4), (R_home, p_home) = check.frames[1], check.frames[3], check.home
    lever = float(np.linalg.norm(np.cross(check.axes[3], W - p4)))
    check.long_enough(3, 4, lever, "the distance from axis 4 to the wrist")
    arm = np.concatenate([R_home.T @ (W - p_home), S, R2.T @ (S - p2), R4.T @ (W - p4)])
    return ArmGeometry(checks.sealed(chain), checks.sealed(arm), check.worst, spherical=True)
