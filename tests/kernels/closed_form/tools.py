"""What the tests of the closed form share: targets, circular distances, and branches found by brute force."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from jacokin import Robot
from jacokin.arrays import Array
from jacokin.ik.closed_form import ClosedForm
from jacokin.ik.solutions.points import BranchTable


def sizes(quick: int, thorough: int) -> list[Any]:  # Any: what pytest.param returns
    """How many samples a test takes: some in every run, more where the slow tests run too."""
    return [pytest.param(quick, id=f"{quick}"), pytest.param(thorough, id=f"{thorough}", marks=pytest.mark.slow)]


def closed_form(robot: Robot, frame: str | None = None, tool: pin.SE3 | None = None) -> ClosedForm:
    return ClosedForm(robot.pin_model, robot.frame_id(frame), tool, robot.lower, robot.upper)


def target(robot: Robot, q: Array, frame: str | None = None) -> Array:
    return np.ascontiguousarray(robot.forward_kinematics(q, frame).homogeneous)


def circular(a: Array, b: Array) -> Array:
    """Largest joint difference on the circle [rad]."""
    return np.asarray(np.abs((a - b + np.pi) % (2.0 * np.pi) - np.pi).max(axis=-1), dtype=np.float64)


def worst_error(rows: BranchTable) -> float:
    return float(max(rows.position_error.max(), rows.orientation_error.max())) if len(rows) else 0.0


def contains(rows: BranchTable, q: Array, tolerance: float = 1e-6) -> bool:
    return len(rows) > 0 and bool(circular(rows.q, q).min() < tolerance)


def closest_pair(rows: BranchTable) -> float:
    """Smallest circular distance between two branches [rad]."""
    q = rows.q
    return min((float(circular(q[i], q[j])) for i in range(len(q)) for j in range(i)), default=np.inf)


def fold_between(robot: Robot, a: Array, b: Array) -> Array | None:
    """A configuration between two where det J is 0, by bisection; None where it has one sign at both."""

    def det(q: Array) -> float:
        return float(np.linalg.det(robot.jacobian(q)))

    if det(a) * det(b) >= 0.0:
        return None
    for _ in range(60):
        middle = 0.5 * (a + b)
        a, b = (middle, b) if det(a) * det(middle) > 0.0 else (a, middle)
    return a


def brute_force(robot: Robot, T: Array, rng: np.random.Generator, starts: int) -> list[Array]:
    """Branches found by Newton on Pinocchio's Jacobian from random starts."""
    found: list[Array] = []
    wanted = pin.SE3(T)
    model, frame = robot.pin_model, robot.frame_id()
    data = model.createData()
    for q in rng.uniform(-np.pi, np.pi, (starts, 6)):
        for _ in range(25):
            pin.framesForwardKinematics(model, data, q)
            J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL)
            error = pin.log6(data.oMf[frame].actInv(wanted)).vector
            step = np.linalg.solve(J + 1e-12 * np.eye(6), error)
            q = q + step * min(1.0, 0.5 / max(np.abs(step).max(), 1e-300))
            if np.abs(step).max() < 1e-9:
                if not any(circular(q, other) < 1e-5 for other in found):
                    found.append(q)
                break
    return found
