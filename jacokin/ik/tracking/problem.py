"""The least-squares problem of one tick, linearised where the arm is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.qp.backend import Inequalities
from jacokin.ik.tracking.distances import ClearanceGuard, Distances
from jacokin.ik.tracking.kinematics import Kinematics
from jacokin.ik.tracking.objectives import Objective
from jacokin.ik.tracking.tasks import Task
from jacokin.model import checks
from jacokin.model.robot import Robot

Quadratic = tuple[Array, Array]  # H (dof, dof) and g (dof,) of x H x / 2 + g x

TIKHONOV = 1e-10  # keeps the QP strictly convex at singular poses
NULL_WEIGHT = 1e-4  # of null-space motion; it competes with nothing, so only the order of magnitude matters
NULL_SPEED = 0.25  # part of the velocity limits that null-space motion may use; its curvature costs microns a tick
RANK = 1e-3  # directions whose singular value is below this part of the largest are left to the null space


@dataclass(frozen=True, slots=True)
class Problem:
    """Minimise x H x / 2 + g x over displacements x [rad].

    Attributes:
        jacobian: (k, dof) weighted Jacobian of the tasks.
        cost: squared weighted error of the tasks.
        hessian: (dof, dof) of everything that is kept when damping is raised.
        gradient: (dof,) of the same.
        inequalities: G and h of G x <= h, or (None, None).
        separating: True when shapes are too near and are being moved apart.
        exits: see `Distances`.
    """

    jacobian: Array
    cost: float
    hessian: Array
    gradient: Array
    inequalities: Inequalities
    separating: bool
    exits: Mapping[int, Array]

    def damped(self, damping: float, null_space: Quadratic | None) -> Quadratic:
        """Hessian and gradient with the null-space objective and with damping relative to the squared error."""
        hessian, gradient = self.hessian.copy(), self.gradient
        if null_space is not None:
            hessian += null_space[0]
            gradient = gradient + null_space[1]
        hessian.flat[:: len(gradient) + 1] += TIKHONOV + damping * self.cost
        return hessian, gradient


def linearise(
    kinematics: Kinematics, tasks: list[Task], q: Array, guard: ClearanceGuard | None, distances: Distances | None
) -> Problem:
    """The problem at `q` (dof,) [rad], where the kinematics are, without the null-space objective."""
    # `dot` instead of @: on six numbers it costs half.
    if len(tasks) == 1:
        jacobian, error = tasks[0].linearised(kinematics)
    else:
        parts = [task.linearised(kinematics) for task in tasks]
        jacobian, error = np.vstack([J for J, _ in parts]), np.concatenate([e for _, e in parts])
    inequalities = [found for task in tasks if (found := task.inequalities(kinematics)) is not None]
    hessian, gradient, separating = jacobian.T.dot(jacobian), -error.dot(jacobian), False
    exits: Mapping[int, Array] = {}
    if guard is not None and distances is not None and distances.near.size:
        separation = guard.linearise(q, distances)
        inequalities.append(separation.inequalities)
        exits = separation.exits
        if separation.error.size:
            separating = True
            hessian = hessian + separation.jacobian.T @ separation.jacobian
            gradient = gradient - separation.error @ separation.jacobian
    stacked: Inequalities = (None, None)
    if len(inequalities) == 1:
        stacked = inequalities[0]
    elif inequalities:
        stacked = np.vstack([G for G, _ in inequalities]), np.concatenate([h for _, h in inequalities])
    return Problem(jacobian, float(error.dot(error)), hessian, gradient, stacked, separating, exits)


def null_space_objective(
    robot: Robot, frame: str, q: Array, jacobian: Array, objectives: Sequence[Objective], step_limit: Array, dt: float
) -> Quadratic:
    """Hessian and gradient that move the null space of the tasks as the objectives want.

    The projector N = I - V V^T leaves out the directions V that the tasks control, so to first order no task error
    changes.

    Raises:
        InvalidInputError: an objective returns something else than a joint velocity.
    """
    displacement = np.zeros(robot.dof)
    for objective in objectives:
        name = f"{type(objective).__name__}.velocity()"
        displacement += checks.vector(name, objective.velocity(robot, frame, q), robot.dof, "rad/s") * dt
    part = float(np.max(np.abs(displacement) / step_limit))
    if part > NULL_SPEED:
        displacement *= NULL_SPEED / part
    _, singular, right = np.linalg.svd(jacobian)
    controlled = right[: singular.size][singular > RANK * max(float(singular[0]), np.finfo(float).tiny)]
    projector = NULL_WEIGHT * (np.eye(robot.dof) - controlled.T @ controlled)
    return projector, -(projector @ displacement)
