"""What to show for a target: every branch, the one the arm is at, and why the others are not. Read this file first.

An `Inspector` knows the robot and the solver but no browser; it turns a target into a `View`, which is only data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.results import Status
from jacokin.ik.solver import IKSolver
from jacokin.model import checks

SAME = 1e-6  # [rad] a branch this near to the joint angles is the arm itself


class Places(NamedTuple):
    """Where the parts of k arms are, in the base frame."""

    positions: NDArray[np.float32]
    """(k, parts, 3) [m]."""
    wxyzs: NDArray[np.float32]
    """(k, parts, 4) unit quaternions w, x, y, z."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Everything there is to show for one target. Arrays are read-only."""

    target: pin.SE3
    """T_base_tool that is asked for."""
    status: Status
    """Whether the target is reached, or why not."""
    q: Array
    """(dof,) joint values of the arm that is drawn solid [rad]."""
    selected: int | None
    """The branch that the solid arm is at; None when it is at none."""
    branches: Array
    """(k, dof) every branch, nearest to where the arm was first [rad]."""
    margins: Array
    """(k, dof) distance of each branch to the nearer limit [rad]: negative outside, inf where there are none."""
    within: NDArray[np.bool_]
    """(k,) whether every joint of a branch is within its limits, exactly."""
    touching: tuple[tuple[tuple[str, str], ...], ...] | None
    """Pairs of shapes that touch in each branch; None when the solver does not look."""
    arm_touching: tuple[tuple[str, str], ...] = ()
    """Pairs of shapes of the solid arm that touch."""
    errors: tuple[float, float] = (0.0, 0.0)
    """How far the solid arm is from the target: position [m], angle [rad]."""
    message: str = ""
    """What the solver says, with numbers."""
    pending: bool = False
    """True while the closest configuration is still to be looked for."""

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """(k,) branches that count as reached: within the limits, and free of contact if the solver looks for it."""
        if self.touching is None:
            return self.within
        return self.within & np.array([not pairs for pairs in self.touching], dtype=np.bool_)

    @property
    def ghosts(self) -> NDArray[np.int64]:
        """Numbers of the branches that the solid arm is not at."""
        numbers = np.arange(len(self.branches))
        return numbers if self.selected is None else numbers[numbers != self.selected]


class Inspector:
    """Computes views. One thread at a time."""

    def __init__(self, solver: IKSolver) -> None:
        """Prepare working memory."""
        self.solver = solver
        self.robot = solver.robot
        self._data = self.robot.pin_model.createData()
        self._lower, self._upper = self.robot.lower, self.robot.upper

    def pose_of(self, q: Array) -> pin.SE3:
        """T_base_tool at joint values (dof,)."""
        pose = self.robot.forward_kinematics(q, self.solver.frame)
        tool = self.solver.tool
        return pose if tool is None else pose * tool

    def at(self, target: pin.SE3, seed: Array) -> View:
        """The view of a target: the arm at the nearest feasible branch, or waiting at `seed` for the closest one.

        Args:
            target: T_base_tool, checked.
            seed: (dof,) where the arm is, within the limits [rad].
        """
        if not self.solver.has_closed_form:
            return self._searched(target, seed)
        found = self.solver.solve_all(target, seed)
        view = View(
            target=target,
            status=Status.OK,
            q=seed,
            selected=None,
            branches=found.q,
            margins=found.margin,
            within=found.within_limits,
            touching=found.touching,
        )
        feasible = np.flatnonzero(view.feasible)
        if len(feasible):
            return self.choose(view, int(feasible[0]))
        status = Status.UNREACHABLE
        if len(found):
            status = Status.IN_COLLISION if view.within.any() else Status.OUTSIDE_LIMITS
        return replace(view, status=status, errors=self._errors(seed, target), pending=True)

    def choose(self, view: View, branch: int) -> View:
        """The same view with the solid arm at another branch, within the limits or not."""
        q = view.branches[branch]
        touching = view.touching[branch] if view.touching is not None else ()
        status = Status.OK
        if not view.within[branch]:
            status = Status.OUTSIDE_LIMITS
        elif touching:
            status = Status.IN_COLLISION
        return replace(
            view,
            status=status,
            q=checks.read_only(q),
            selected=branch,
            arm_touching=touching,
            errors=self._errors(q, view.target),
            message="",
            pending=False,
        )

    def posture(self, q: Array) -> View:
        """The view of an arm whose joints are set by hand: the target is where its tool is."""
        inside = np.clip(q, self._lower, self._upper)
        target = self.pose_of(inside)
        if not self.solver.has_closed_form:
            return replace(self._empty(target, inside), status=Status.OK)
        view = self.at(target, inside)
        if view.selected is not None and np.abs(view.q - inside).max() < SAME:
            return replace(view, q=checks.read_only(inside))
        # In a singular posture the branch that the arm is at may stand for many, or be in contact.
        near = np.flatnonzero((np.abs(view.branches - inside) < SAME).all(axis=1))
        if len(near):
            return replace(self.choose(view, int(near[0])), q=checks.read_only(inside))
        return replace(
            view, status=Status.OK, q=checks.read_only(inside), selected=None, errors=(0.0, 0.0), pending=False
        )

    def closest(self, view: View) -> View:
        """A view whose target is not reached, with the arm at the closest configuration: a search."""
        result = self.solver.solve(view.target, view.q)
        return replace(
            view,
            q=result.q,
            selected=None,
            status=result.status,
            errors=(result.position_error, result.orientation_error),
            arm_touching=result.touching,
            message=result.message,
            pending=False,
        )

    def places(self, configurations: Sequence[Array] | Array) -> Places:
        """Where the base and the part of each joint are, for k configurations (k, dof)."""
        count, parts = len(configurations), self.robot.dof + 1
        table = np.empty((count, parts, 7))
        model, data = self.robot.pin_model, self._data
        for row, q in enumerate(configurations):
            pin.forwardKinematics(model, data, np.ascontiguousarray(q))
            for part, placement in enumerate(data.oMi):
                table[row, part] = pin.SE3ToXYZQUAT(placement)
        return Places(table[:, :, :3].astype(np.float32), table[:, :, [6, 3, 4, 5]].astype(np.float32))

    def excess(self, q: Array) -> list[tuple[str, float]]:
        """The joints that are outside their limits at `q`, each with by how much [rad]."""
        over = np.maximum(np.maximum(self._lower - q, q - self._upper), 0.0)
        return [(self.robot.joint_names[joint], float(over[joint])) for joint in np.flatnonzero(over > 0.0)]

    def margin(self, q: Array) -> Array:
        """(dof,) distance to the nearer limit [rad]: negative outside, inf where there are none."""
        return np.minimum(q - self._lower, self._upper - q)

    def _searched(self, target: pin.SE3, seed: Array) -> View:
        """Without a closed form there is one answer at a time."""
        view = self._empty(target, seed)
        result = self.solver.solve(target, seed)
        return replace(
            view,
            status=result.status,
            q=result.q,
            errors=(result.position_error, result.orientation_error),
            arm_touching=result.touching,
            message=result.message,
        )

    def _empty(self, target: pin.SE3, q: Array) -> View:
        none = np.zeros((0, self.robot.dof))
        return View(target, Status.OK, checks.read_only(q), None, none, none, np.zeros(0, dtype=np.bool_), None)

    def _errors(self, q: Array, target: pin.SE3) -> tuple[float, float]:
        reached = self.pose_of(q)
        angle = float(np.linalg.norm(pin.log3(reached.rotation.T @ target.rotation)))
        return float(np.linalg.norm(target.translation - reached.translation)), angle
