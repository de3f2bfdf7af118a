"""The least-squares problem of one tick, linearised where the arm is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mink
import numpy as np
from numpy.typing import NDArray

from jacokin.ik.tracking.clearance import ClearanceGuard, Distances
from jacokin.ik.tracking.objectives import Objective
from jacokin.ik.tracking.tasks import Aim
from jacokin.model.robot import Robot

Array = NDArray[np.float64]

TIKHONOV = 1e-10  # keeps the QP strictly convex at singular poses
NULL_WEIGHT = 1e-4  # of null-space motion; it competes with nothing, so only the order of magnitude matters
NULL_SPEED = 0.25  # part of the velocity limits that null-space motion may use; its curvature costs microns a tick
RANK = 1e-3  # directions whose singular value is below this part of the largest are left to the null space


@dataclass(frozen=True, slots=True)
class Problem:
    """Minimise x H x / 2 + g x over displacements x [rad].

    Attributes:
        rows: (k, dof) weighted rows W of the targets.
        cost: squared weighted error e . e.
        hessian: (dof, dof) of everything that is kept when damping is raised.
        gradient: (dof,) of the same.
        walls: rows and ends of half-spaces, or (None, None).
        pushing: True when shapes are too near and are being moved apart.
    """

    rows: Array
    cost: float
    hessian: Array
    gradient: Array
    walls: tuple[Array, Array] | tuple[None, None]
    pushing: bool

    def damped(self, damping: float, drift: tuple[Array, Array] | None) -> tuple[Array, Array]:
        """Hessian and gradient with null-space motion and with damping relative to the squared error."""
        hessian, gradient = self.hessian.copy(), self.gradient
        if drift is not None:
            hessian += drift[0]
            gradient = gradient + drift[1]
        hessian.flat[:: len(gradient) + 1] += TIKHONOV + damping * self.cost
        return hessian, gradient


def linearise(
    configuration: mink.Configuration,
    aims: list[Aim],
    guard: ClearanceGuard | None,
    distances: Distances | None,
) -> Problem:
    """The problem at the configuration, without null-space motion."""
    if len(aims) == 1:
        rows, wanted = aims[0].rows(configuration), aims[0].wanted(configuration)
    else:
        rows = np.vstack([aim.rows(configuration) for aim in aims])
        wanted = np.concatenate([aim.wanted(configuration) for aim in aims])
    walls = [wall for aim in aims if (wall := aim.walls(configuration)) is not None]
    hessian, gradient, pushing = rows.T @ rows, -(wanted @ rows), False
    if guard is not None and distances is not None and distances.near.size:
        contact = guard.linearise(configuration.data, distances)
        walls.append(contact.walls)
        if contact.wanted.size:
            pushing = True
            hessian = hessian + contact.pushes.T @ contact.pushes
            gradient = gradient - contact.wanted @ contact.pushes
    stacked = (np.vstack([w[0] for w in walls]), np.concatenate([w[1] for w in walls])) if walls else (None, None)
    return Problem(rows, float(wanted @ wanted), hessian, gradient, stacked, pushing)


def null_motion(
    robot: Robot, frame: str, q: Array, rows: Array, objectives: Sequence[Objective], step_limit: Array, dt: float
) -> tuple[Array, Array]:
    """Hessian and gradient that move the null space of the rows as the objectives would like.

    The projector N = I - V V^T leaves out the directions V the targets control, so to first order no target moves.
    """
    wish = np.zeros(robot.dof)
    for objective in objectives:
        wish += objective.velocity(robot, frame, q) * dt
    part = float(np.max(np.abs(wish) / step_limit))
    if part > NULL_SPEED:
        wish *= NULL_SPEED / part
    _, singular, right = np.linalg.svd(rows)
    controlled = right[: singular.size][singular > RANK * max(float(singular[0]), np.finfo(float).tiny)]
    projector = NULL_WEIGHT * (np.eye(robot.dof) - controlled.T @ controlled)
    return projector, -(projector @ wish)
