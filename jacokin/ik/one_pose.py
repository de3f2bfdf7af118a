"""`solve_ik`: one pose in one call."""

from __future__ import annotations

from pathlib import Path

import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.ik.results import IKResult
from jacokin.ik.solver import IKSolver
from jacokin.ik.targets import Target
from jacokin.model.loading import load_robot
from jacokin.model.robot import Robot


def solve_ik(
    target: Target,
    robot: Robot | str | Path | None = None,
    *,
    seed: ArrayLike | None = None,
    frame: str | None = None,
    tool: pin.SE3 | ArrayLike | None = None,
) -> IKResult:
    """Solve one pose: `IKSolver(robot, frame, tool=tool, warm=None).solve(target, seed)`.

    Args:
        target: what `IKSolver.solve` takes: T_base_tool as `pin.SE3` or (4, 4), a position (3,) [m] with free
            orientation, a `FreeAxis`.
        robot: a robot, or what `load_robot` takes; None for the j2n6s300.
        seed: (dof,) configuration [rad] to stay near to.
        frame: frame to bring to the target; None for the robot's default frame.
        tool: constant pose after the frame.

    Raises:
        JacokinError: as `load_robot` and `IKSolver.solve`.
    """
    if not isinstance(robot, Robot):
        robot = load_robot() if robot is None else load_robot(robot)
    return IKSolver(robot, frame, tool=tool, warm=None).solve(target, seed)
