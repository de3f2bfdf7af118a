"""Chains of revolute joints out of a Pinocchio model, and checks of how their axes stand to each other."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.errors import StructureError
from jacokin.ik.closed_form.kernels.tolerances import SMALLEST_LENGTH, SMALLEST_TWIST, STRUCTURE_TOLERANCE

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
    if axis[2] == 1.0:
        return np.eye(3)
    x = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


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
