"""From a target to a `View`: which branches there are, where the arm is, and why the others are not feasible.

An `Inspector` knows the robot and the solver but no browser.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import preferences
from jacokin.ik.results import Branches, Status
from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.angles import TURN
from jacokin.model.poses import FreeAxis
from jacokin.motion.tracking.tracker import TrackerStep
from jacokin.viewer.view import Free, Places, View

if TYPE_CHECKING:
    from jacokin.ik.families.family import Family


class Postures:
    """Measures configurations of one robot. One thread at a time.

    Attributes:
        solver: the solver; another one of the same robot may take its place.
        robot: its robot.
    """

    def __init__(self, solver: IKSolver) -> None:
        """Prepare working memory."""
        self.solver = solver
        self.robot = solver.robot
        self._data = self.robot.pin_model.createData()

    def pose_of(self, q: Array) -> pin.SE3:
        """T_base_tool at joint values (dof,)."""
        pose = self.robot.forward_kinematics(q, self.solver.frame)
        tool = self.solver.tool
        return pose if tool is None else pose * tool

    def errors(self, q: Array, target: pin.SE3) -> tuple[float, float]:
        """How far the tool is from a target at `q`: position [m], angle [rad]."""
        reached = self.pose_of(q)
        angle = float(np.linalg.norm(pin.log3(reached.rotation.T @ target.rotation)))
        return float(np.linalg.norm(target.translation - reached.translation)), angle

    def ellipsoid(self, q: Array) -> tuple[Array, Array]:
        """The ellipsoid of manipulability: how fast the tool moves each way when the joint rates have length 1.

        Returns:
            Its semi-axes (3,) [m/s for rad/s], longest first, and their directions as the columns of a rotation (3, 3).
        """
        jacobian = self.robot.jacobian(q, self.solver.frame)
        linear = jacobian[:3]
        if self.solver.tool is not None:
            arm = self.robot.forward_kinematics(q, self.solver.frame).rotation @ self.solver.tool.translation
            linear = linear - pin.skew(arm) @ jacobian[3:]
        directions, lengths, _ = np.linalg.svd(linear, full_matrices=True)
        if np.linalg.det(directions) < 0.0:
            directions[:, 2] *= -1.0
        return np.pad(lengths, (0, 3 - len(lengths))), directions

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
        over = np.maximum(np.maximum(self.robot.lower - q, q - self.robot.upper), 0.0)
        return [(self.robot.joint_names[joint], float(over[joint])) for joint in np.flatnonzero(over > 0.0)]

    def margin(self, q: Array) -> Array:
        """(dof,) distance to the nearer limit [rad]: negative outside, inf where there are none."""
        return np.minimum(q - self.robot.lower, self.robot.upper - q)

    def touching(self, q: Array) -> tuple[tuple[str, str], ...]:
        """Pairs of shapes that touch at `q`; none when the solver does not look."""
        return tuple(self.solver.verifier.touching(q))


MEMBERS = 12  # least number of postures drawn of a family
FREE_JOINT = 2  # of a seven-joint arm, the parameter of its families
FULL_TURN = (-math.pi, math.pi)  # [rad]
SAME = 1e-6  # [rad] a branch this near to the joint angles is the arm itself


class Inspector(Postures):
    """Computes views. One thread at a time.

    Attributes:
        solver: the solver; another one of the same robot may take its place.
        robot: its robot.
        prefer: which feasible branch the arm goes to: "nearest", or one of "margin" and "manipulability".
    """

    def __init__(self, solver: IKSolver, *, prefer: str = "nearest") -> None:
        """Prepare working memory.

        Raises:
            UnknownNameError: an unknown preference.
        """
        super().__init__(solver)
        self.prefer = checks.choice("prefer", prefer, preferences.PREFERENCES)
        self._lower, self._upper = self.robot.lower, self.robot.upper

    def at(self, target: pin.SE3, seed: Array) -> View:
        """The view of a target: the arm at the nearest feasible branch, or waiting at `seed` for the closest one.

        Args:
            target: T_base_tool, checked.
            seed: (dof,) where the arm is, within the limits [rad].
        """
        if not self.solver.has_closed_form:
            return self._searched(target, seed)
        found = self.solver.solve_all(target, seed)
        if not isinstance(found, Branches):  # a robot with a joint too many
            return self._searched(target, seed)
        view = View(
            target=target,
            status=Status.OK,
            q=seed,
            seed=seed,
            selected=None,
            branches=found.q,
            margins=found.margin,
            within=found.within_limits,
            touching=found.touching,
        )
        feasible = np.flatnonzero(view.feasible)
        if len(feasible):
            return self.choose(view, self._preferred(view, feasible))
        status = Status.UNREACHABLE
        if len(found):
            status = Status.IN_COLLISION if view.within.any() else Status.OUTSIDE_LIMITS
        return replace(view, status=status, errors=self.errors(seed, target), pending=True)

    def turned(
        self,
        pose: pin.SE3,
        axis: int,
        seed: Array,
        angle: float | None = None,
        limits: tuple[float, float] = FULL_TURN,
    ) -> View:
        """The view of a target that may turn about an axis of the tool.

        Args:
            pose: T_base_tool at angle 0, checked.
            axis: 0, 1 or 2.
            seed: (dof,) where the arm is, within the limits [rad].
            angle: where to turn [rad], brought within `limits`; None for the member that is preferred.
            limits: least and largest angle [rad].

        Raises:
            InvalidInputError: the robot has no closed form, or the limits are not in order.
        """
        direction = np.eye(3)[axis]
        target = FreeAxis(pose, axis=direction, range=limits)
        family = self.solver.solve_all(target, seed)
        near = seed
        if angle is None:
            found = self.solver.solve(target, seed, closest=False, prefer=self.prefer)
            angle = min(max(0.0, limits[0]), limits[1]) if found.parameter is None else float(found.parameter)
            near = found.q if found.success else seed
        angle = min(max(angle, limits[0]), limits[1])
        intervals = tuple((float(interval.start), float(interval.stop)) for interval in family)
        view = self.at(pose * pin.SE3(pin.exp3(angle * direction), np.zeros(3)), near)
        free = Free(f"angle about {'xyz'[axis]}", angle, *limits, intervals, axis, pose)
        return replace(view, seed=seed, free=free)

    def slid(self, view: View, value: float) -> View:
        """The view of a seven-joint arm with its free joint elsewhere and the tool where it is.

        Args:
            view: what is shown.
            value: of the free joint [rad]; brought to the nearest one that reaches the target within the limits.

        Raises:
            InvalidInputError: the value is not finite, or the arm has no joint too many.
        """
        if view.free is None:
            raise InvalidInputError(f"{self.robot.name} has no joint too many")
        value = checks.number("value", value, "rad")
        family = self.solver.solve_all(view.target, view.q)
        members = []
        for interval in family:
            near = value + TURN * round((0.5 * (interval.start + interval.stop) - value) / TURN)
            inside = min(max(near, interval.start), interval.stop)
            q = interval.at(inside, view.q)
            members.append((abs(inside - near), float(np.abs(q - view.q).max()), q))
        if not members:
            return view
        _, _, q = min(members, key=lambda member: member[:2])
        moved = self._apart(view, checks.read_only(q))
        return self._with_family(replace(moved, seed=moved.q, errors=self.errors(q, view.target)), family)

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
            errors=self.errors(q, view.target),
            message="",
            pending=False,
        )

    def posture(self, q: Array) -> View:
        """The view of an arm whose joints are set by hand: the target is where its tool is."""
        inside = np.clip(q, self._lower, self._upper)
        target = self.pose_of(inside)
        if not self.solver.has_closed_form:
            return self._with_family(self._apart(self._empty(target, inside), checks.read_only(inside)))
        view = self.at(target, inside)
        if view.selected is not None and np.abs(view.q - inside).max() < SAME:
            return replace(view, q=checks.read_only(inside))
        # In a singular posture the branch that the arm is at may stand for many, or be in contact.
        near = np.flatnonzero((np.abs(view.branches - inside) < SAME).all(axis=1))
        if len(near):
            return replace(self.choose(view, int(near[0])), q=checks.read_only(inside))
        return self._apart(view, checks.read_only(inside))

    def followed(self, target: pin.SE3, step: TrackerStep) -> View:
        """The view of a target that a tracker follows: the arm where the tracker is."""
        view = self.at(target, step.q) if self.solver.has_closed_form else self._empty(target, step.q)
        view = self._apart(view, step.q)
        by = f", held back by {', '.join(step.limiting)}" if step.limiting else ""
        position, angle = step.position_error, step.orientation_error
        far = f"{1e3 * position:.1f} mm and {math.degrees(angle):.1f} deg from the target{by}"
        return replace(
            view,
            errors=(position, angle),
            note=f"Tracking, {step.status.name.lower()}: {far}",
        )

    def played(self, q: Array, note: str) -> View:
        """The view of an arm at the joint values (dof,) of a trajectory, within the limits or not."""
        view = self.posture(q)
        over = ", ".join(name for name, _ in self.excess(q))
        if not over:
            return replace(view, note=note)
        return replace(
            view,
            target=self.pose_of(q),
            status=Status.OUTSIDE_LIMITS,
            q=checks.read_only(q),
            selected=None,
            note=f"{note}; outside the limits: {over}",
        )

    def closest(self, view: View) -> View:
        """A view whose target is not reached, with the arm at the closest configuration: a search.

        Where contact is only reported, that is a branch in contact.
        """
        result = self.solver.solve(view.target, view.q, prefer=self.prefer)
        found = replace(
            view,
            q=result.q,
            seed=view.q,
            selected=None,
            status=result.status,
            errors=(result.position_error, result.orientation_error),
            arm_touching=result.touching,
            message=result.message,
            pending=False,
        )
        same = np.flatnonzero((np.abs(view.branches - result.q) < SAME).all(axis=1))
        return self.choose(found, int(same[0])) if result.success and len(same) else found

    def _apart(self, view: View, q: Array) -> View:
        """A view with the arm at joint values that are none of its branches."""
        touching = self.touching(q)
        status = Status.IN_COLLISION if touching else Status.OK
        return replace(
            view, status=status, q=q, selected=None, arm_touching=touching, errors=(0.0, 0.0), pending=False, message=""
        )

    def _searched(self, target: pin.SE3, seed: Array) -> View:
        """Without a closed form there is one answer at a time."""
        view = self._empty(target, seed)
        result = self.solver.solve(target, seed, prefer=self.prefer)
        view = replace(
            view,
            status=result.status,
            q=result.q,
            errors=(result.position_error, result.orientation_error),
            arm_touching=result.touching,
            message=result.message,
        )
        return self._with_family(view) if result.success else view

    def _with_family(self, view: View, found: Branches | Family | None = None) -> View:
        """A reached view of an arm with a joint too many: some of the postures that reach the target for branches."""
        if not self.solver.has_families:
            return view
        found = self.solver.solve_all(view.target, view.q) if found is None else found
        members = found.q if isinstance(found, Branches) else found.sample(MEMBERS)
        branches = np.vstack((view.q, members))
        margins = np.minimum(branches - self._lower, self._upper - branches)
        return replace(
            view,
            selected=0,
            branches=checks.read_only(branches),
            margins=checks.read_only(margins),
            within=(margins >= 0.0).all(axis=1),
            touching=tuple(map(self.touching, branches)) if self.solver.verifier.looks_for_contact else None,
            free=self._joint(found, view.q),
        )

    def _joint(self, found: Branches | Family, q: Array) -> Free | None:
        """The joint of a seven-joint arm that may move while the tool stays."""
        if isinstance(found, Branches):
            return None
        joint = FREE_JOINT
        intervals = tuple((float(interval.start), float(interval.stop)) for interval in found)
        low, high = (max(self._lower[joint], -np.pi), min(self._upper[joint], np.pi))
        return Free(self.robot.joint_names[joint], float(q[joint]), float(low), float(high), intervals)

    def _preferred(self, view: View, feasible: NDArray[np.intp]) -> int:
        """The number of the feasible branch that is preferred."""
        cost = preferences.cost_of(self.prefer, self.robot, self.solver.frame)
        return int(feasible[0 if cost is None else np.argmin(cost(view.branches[feasible]))])

    def _empty(self, target: pin.SE3, q: Array) -> View:
        none = np.zeros((0, self.robot.dof))
        here = checks.read_only(q)
        return View(target, Status.OK, here, here, None, none, none, np.zeros(0, dtype=np.bool_), None)
