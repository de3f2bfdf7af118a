"""Chains of revolute joints out of a Pinocchio model, and checks of how their axes stand to each other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.errors import StructureError
from jacokin.kernels.tolerances import SMALLEST_LENGTH, SMALLEST_TWIST, SPHERICAL_TOLERANCE, STRUCTURE_TOLERANCE

WORDS = {6: "six", 7: "seven"}
_AXES = {
    "JointModelRX": (1.0, 0.0, 0.0),
    "JointModelRY": (0.0, 1.0, 0.0),
    "JointModelRZ": (0.0, 0.0, 1.0),
}


def chain_of(model: pin.Model, frame_id: int, tool: pin.SE3 | None, count: int) -> NDArray[np.float64]:
    """(count + 1, 3, 4) placements between so many joints that all turn about z.

    Raises:
        StructureError: the model is not one chain of revolute joints, or the frame is not on its last link.
    """
    joints = list(model.joints)[1:]
    if model.nq != count or model.nv != count or len(joints) != count:
        raise StructureError(
            f"the closed form needs {WORDS[count]} joints of one angle each; this model has {model.nv}"
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
    chain = np.empty((count + 1, 3, 4))
    turn = np.eye(3)  # from z-aligned axes to the joint's own
    for i, joint in enumerate(joints):
        placement = model.jointPlacements[i + 1]
        align = _align_z(joint, names[i])
        chain[i, :, :3] = turn.T @ placement.rotation @ align
        chain[i, :, 3] = turn.T @ placement.translation
        turn = align
    last = frame.placement if tool is None else frame.placement * tool
    chain[count, :, :3] = turn.T @ last.rotation
    chain[count, :, 3] = turn.T @ last.translation
    return chain


def _align_z(joint: pin.JointModel, name: str) -> NDArray[np.float64]:
    """A rotation that takes z to the axis of a revolute joint; the identity for z itself."""
    kind = joint.shortname()
    if kind in _AXES:
        axis = np.array(_AXES[kind])
    elif kind == "JointModelRevoluteUnaligned":
        axis = np.asarray(joint.extract().axis, dtype=np.float64).reshape(3)
    else:
        raise StructureError(f"the closed form needs revolute joints; joint {name!r} is a {kind}", (name, name))
    return np.eye(3) if axis[2] == 1.0 else frame_with_z(axis)


def frame_with_z(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """A rotation (3, 3) whose third column is a unit vector (3,)."""
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def axes_at_zero(
    chain: NDArray[np.float64],
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]], NDArray[np.float64]]:
    """Axes and joint origins at q = 0 in the base frame, and the (3, 4) home pose of the solved frame."""
    rotation, position = np.eye(3), np.zeros(3)
    axes, points = [], []
    for i in range(len(chain)):
        position = position + rotation @ chain[i, :, 3]
        rotation = rotation @ chain[i, :, :3]
        if i < len(chain) - 1:
            axes.append(rotation[:, 2].copy())
            points.append(position.copy())
    return axes, points, np.column_stack([rotation, position])


class StructureCheck:
    """Measures pairs of axes, keeps the worst misfit, and raises with the names of the pair."""

    def __init__(self, names: list[str], w: list[NDArray[np.float64]], points: list[NDArray[np.float64]]) -> None:
        """Take the names of the joints, their axes and their origins at q = 0."""
        self._names, self._w, self._points = names, w, points
        self.worst = 0.0

    def _check(self, i: int, j: int, misfit: float, unit: str, wanted: str) -> None:
        self.worst = max(self.worst, misfit)
        if not misfit <= STRUCTURE_TOLERANCE:
            self._refuse(i, j, misfit, unit, f"{wanted}; they miss it by {misfit:.3g} {unit}")

    def _refuse(self, i: int, j: int, misfit: float, unit: str, text: str) -> None:
        pair = (self._names[i], self._names[j])
        raise StructureError(
            f"the closed form does not fit this robot: {pair[0]} and {pair[1]}: {text} "
            f"(tolerance {STRUCTURE_TOLERANCE:g} {unit}). Use method='qp'.",
            pair,
            misfit,
            unit,
        )

    def angle(self, i: int, j: int, degrees: float) -> None:
        """Axes i and j must enclose this angle."""
        sine = np.linalg.norm(np.cross(self._w[i], self._w[j]))
        angle = np.arctan2(sine, self._w[i] @ self._w[j])
        self._check(i, j, abs(float(angle) - np.radians(degrees)), "rad", f"the axes must enclose {degrees:g} deg")

    def parallel(self, i: int, j: int) -> float:
        """Axes i and j must be parallel (1.0) or antiparallel (-1.0)."""
        sine = float(np.linalg.norm(np.cross(self._w[i], self._w[j])))
        self._check(i, j, sine, "rad", "the axes must be parallel")
        return 1.0 if self._w[i] @ self._w[j] > 0.0 else -1.0

    def twist(self, i: int, j: int) -> None:
        """Axes i and j must be clearly not parallel."""
        sine = float(np.linalg.norm(np.cross(self._w[i], self._w[j])))
        if sine < np.sin(SMALLEST_TWIST):
            self._refuse(i, j, sine, "rad", f"the axes must not be parallel; they enclose {np.arcsin(sine):.3g} rad")

    def meet(self, i: int, j: int) -> NDArray[np.float64]:
        """The point where axes i and j meet: the middle of their common perpendicular."""
        normal = np.cross(self._w[i], self._w[j])
        normal /= np.linalg.norm(normal)
        between = self._points[j] - self._points[i]
        self._check(i, j, abs(float(between @ normal)), "m", "the axes must meet")
        along = np.linalg.solve(np.column_stack([self._w[i], -self._w[j], normal]), between)
        first = self._points[i] + along[0] * self._w[i]
        second = self._points[j] + along[1] * self._w[j]
        return np.asarray(0.5 * (first + second), dtype=np.float64)

    def same_point(self, i: int, j: int, first: NDArray[np.float64], second: NDArray[np.float64]) -> None:
        """Two points where axes meet, the second on axes i and j, must be one."""
        misfit = float(np.linalg.norm(second - first))
        self._check(i, j, misfit, "m", "the axes must meet where those before them do")

    def long_enough(self, i: int, j: int, length: float, what: str) -> None:
        """A length of the mechanism must not vanish."""
        if length < SMALLEST_LENGTH:
            self._refuse(i, j, length, "m", f"{what} is {length:.3g} m; it must be at least {SMALLEST_LENGTH:g} m")


@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """What the kernels know about an arm, as flat read-only arrays.

    Attributes:
        chain: (7, 3, 4) [-, m]; pose = chain[0] Rz(q1) chain[1] Rz(q2) ... Rz(q6) chain[6], exactly the model's.
        arm: (39,) the constants of the closed form, in the order of ``kernels.arm.unpack_arm``.
        spherical: axes 4, 5 and 6 meet in one point.
        misfit: the largest deviation from the structure found [m or rad].
    """

    chain: NDArray[np.float64]
    arm: NDArray[np.float64]
    spherical: bool
    misfit: float


def measure(model: pin.Model, frame_id: int, tool: pin.SE3 | None = None) -> Geometry:
    """Measure the structure of a six-joint arm.

    Args:
        model: Pinocchio model with six revolute joints in one chain, nq == nv == 6.
        frame_id: index of the frame to solve for; it must be fixed to the last link.
        tool: T_frame_tool, a constant pose after that frame, or None.

    Raises:
        StructureError: The model is no such chain, or a pair of axes does not meet, is not parallel or not
            perpendicular where the closed form needs it; names the joints and the misfit.
    """
    chain = chain_of(model, frame_id, tool, 6)
    names = [str(name) for name in list(model.names)[1:]]
    w, points, home = axes_at_zero(chain)
    check = StructureCheck(names, w, points)

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
    check.long_enough(0, 2, abs(e3), "the lateral offset of the shoulder")

    # Shoulder frame: x = w3 x w1, y = w3, z = w1. Wrist frame: x = e, y = f, z = w5 with w4 in the x, z plane.
    S = _orthonormal(w[0], w[2])
    E = _orthonormal(w[4], np.cross(w[4], w[3]))
    R_home, p_home = home[:, :3], home[:, 3]
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
        ]
    ).astype(np.float64)
    chain.flags.writeable = False
    arm.flags.writeable = False
    return Geometry(chain=chain, arm=arm, spherical=spherical, misfit=check.worst)


def _orthonormal(z: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation into the frame with the given z and, as nearly as possible, the given y axis (rows are axes)."""
    y = y - (y @ z) * z
    y = y / np.linalg.norm(y)
    return np.vstack([np.cross(y, z), y, z])


class SevenJointGeometry(NamedTuple):
    """What the kernels know about an arm, as flat read-only arrays."""

    chain: NDArray[np.float64]
    """(8, 3, 4) [-, m]; pose = chain[0] Rz(q1) chain[1] Rz(q2) ... Rz(q7) chain[7], exactly the model's."""
    arm: NDArray[np.float64]
    """(12,) W in the tool frame, O in the base, O after joint 2, W after joint 4, see `curves.seven` [m]."""
    misfit: float
    """The largest deviation from the structure found [m or rad]."""


def measure_seven(model: pin.Model, frame_id: int, tool: pin.SE3 | None = None) -> SevenJointGeometry:
    """Measure the structure of a seven-joint arm: axes 1 and 2 meet in O, axes 5, 6 and 7 in W.

    Args:
        model: Pinocchio model with seven revolute joints in one chain, nq == nv == 7.
        frame_id: index of the frame to solve for; it must be fixed to the last link.
        tool: T_frame_tool, a constant pose after that frame, or None.

    Raises:
        StructureError: The model is no such chain, or a pair of axes does not meet; names the joints and the misfit.
    """
    chain = chain_of(model, frame_id, tool, 7)
    names = [str(name) for name in list(model.names)[1:]]
    axes, points, home = axes_at_zero(chain)
    check = StructureCheck(names, axes, points)
    for i in range(6):
        check.twist(i, i + 1)
    S = check.meet(0, 1)
    W = check.meet(4, 5)
    check.same_point(5, 6, W, check.meet(5, 6))
    R2, p2 = _after(chain, 2)
    R4, p4 = _after(chain, 4)
    lever = float(np.linalg.norm(np.cross(axes[3], W - points[3])))
    check.long_enough(3, 4, lever, "the distance from axis 4 to the wrist")
    arm = np.concatenate([home[:, :3].T @ (W - home[:, 3]), S, R2.T @ (S - p2), R4.T @ (W - p4)])
    chain.flags.writeable = False
    arm.flags.writeable = False
    return SevenJointGeometry(chain, arm, check.worst)


def _after(chain: NDArray[np.float64], joints: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotation and origin of the frame after so many joints at q = 0."""
    rotation, position = np.eye(3), np.zeros(3)
    for i in range(joints):
        position = position + rotation @ chain[i, :, 3]
        rotation = rotation @ chain[i, :, :3]
    return rotation, position
