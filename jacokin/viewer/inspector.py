"""`Inspector`: from a target to a `View`, that is which branches there are, where the arm is, and what the solver says.

It knows the robot and the solver but no browser. The status of a target is the one that the solver gives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import diagnosis, preferences
from jacokin.ik.results import IKResult, Status
from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.angles import TURN
from jacokin.model.poses import FreeAxis
from jacokin.model.robot import in_words, limit_margins
from jacokin.viewer.view import Free, ShownPlaces, View

if TYPE_CHECKING:
    from jacokin.ik.solutions.solution_set import SolutionSet
    from jacokin.motion.tracking.steps import TrackerStep  # loads MuJoCo
    from jacokin.viewer.contents import Playback

MEMBERS = 12  # least number of postures drawn along curves
FULL_TURN = (-math.pi, math.pi)  # [rad]
SAME = 1e-6  # [rad] a branch this near to the joint angles is the arm itself


class Inspector:
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
        self.solver = solver
        self.robot = solver.robot
        self.prefer = checks.choice("prefer", prefer, preferences.PREFERENCES)
        self._data = self.robot.pin_model.createData()

    def at(self, target: pin.SE3, seed: Array) -> View:
        """The view of a target: the arm at the nearest feasible branch, or waiting at `seed` for the closest one.

        Args:
            target: T_base_tool, checked.
            seed: (dof,) where the arm is, within the limits [rad].
        """
        if self.solver.dimension() != 0:  # one answer, or curves
            view = self.closest(self._bare(target, seed))
            return self._with_curves(view) if view.status is Status.OK else view
        answer = self.solver.solve(target, seed, closest=False, prefer=self.prefer)
        found = self.solver.solve_all(target, seed)
        view = replace(
            self._bare(target, seed),
            branches=found.q,
            margins=found.margin,
            within=found.within_limits,
            touching=found.touching,
        )
        if not answer.success:
            errors = self.errors(seed, target)
            return replace(view, status=answer.status, message=answer.message, errors=errors, pending=True)
        if not (view.within if answer.touching else view.feasible).any():  # within the tolerances, as no branch is
            return _answered(view, answer)
        clear = np.flatnonzero(view.feasible)
        if answer.touching and len(clear):  # contact is only reported, and there is a branch without
            cost = preferences.cost_of(self.prefer, self.robot, self.solver.frame)
            return self.choose(view, int(clear[0 if cost is None else np.argmin(cost(view.branches[clear]))]))
        return self.choose(view, int(np.argmin(np.abs(view.branches - answer.q).max(axis=1))))

    def closest(self, view: View) -> View:
        """The view of the same target with the arm at the solver's answer: if need be the closest configuration."""
        return _answered(view, self.solver.solve(view.target, view.q, prefer=self.prefer))

    def choose(self, view: View, branch: int) -> View:
        """A view with the solid arm at another branch, within the limits or not."""
        q = view.branches[branch]
        touching = view.touching[branch] if view.touching is not None else ()
        errors = self.errors(q, view.target)
        return replace(self._placed(view, q, touching), selected=branch, errors=errors)

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
        found = self.solver.solve_all(target, seed)
        near = seed
        if angle is None:
            answer = self.solver.solve(target, seed, closest=False, prefer=self.prefer)
            angle = 0.0 if answer.parameter is None else answer.parameter
            near = answer.q if answer.success else seed
        angle = min(max(float(angle), limits[0]), limits[1])
        view = self.at(pose * pin.SE3(pin.exp3(angle * direction), np.zeros(3)), near)
        free = Free(f"angle about {'xyz'[axis]}", angle, *limits, _spans(found), axis, pose)
        return replace(view, seed=seed, free=free)

    def slid(self, view: View, value: float) -> View:
        """The view of a seven-joint arm with its free joint elsewhere and the tool where it is.

        Args:
            view: what is shown.
            value: of the free joint [rad]; brought to the nearest one that reaches the target within the limits.

        Raises:
            InvalidInputError: the value is not finite, or the arm has no redundant joint.
        """
        if view.free is None:
            raise InvalidInputError(f"{self.robot.name} has no redundant joint")
        value = checks.number("value", value, "rad")
        found = self.solver.solve_all(view.target, view.q)
        members = []
        for interval in found.intervals:
            near = value + TURN * round((0.5 * (interval.start + interval.stop) - value) / TURN)
            inside = min(max(near, interval.start), interval.stop)
            q = interval.at(inside, view.q)
            members.append((abs(inside - near), float(np.abs(q - view.q).max()), q))
        if not members:
            return view
        _, _, q = min(members, key=lambda member: member[:2])
        moved = replace(self._placed(view, q), seed=q, errors=self.errors(q, view.target))
        return self._with_curves(moved, found)

    def posture(self, q: Array) -> View:
        """The view of an arm whose joints are set by hand: the target is where its tool is."""
        inside = checks.read_only(np.clip(q, self.robot.lower, self.robot.upper))
        target = self.pose_of(inside)
        if self.solver.dimension() != 0:
            return self._with_curves(self._placed(self._bare(target, inside), inside))
        view = self.at(target, inside)
        # In a singular posture the branch that the arm is at may stand for many, or be in contact.
        near = np.flatnonzero((np.abs(view.branches - inside) < SAME).all(axis=1))
        if not len(near):
            return self._placed(view, inside)
        here = int(near[0]) if view.selected is None or view.selected not in near else view.selected
        return replace(self.choose(view, here), q=inside)

    def followed(self, target: pin.SE3, step: TrackerStep) -> View:
        """The view of a target that a tracker follows: the arm where the tracker is."""
        view = self.at(target, step.q) if self.solver.dimension() == 0 else self._bare(target, step.q)
        errors = step.position_error, step.orientation_error
        by = f", held back by {', '.join(step.limiting)}" if step.limiting else ""
        far = f"{1e3 * errors[0]:.1f} mm and {math.degrees(errors[1]):.1f} deg from the target{by}"
        return replace(self._placed(view, step.q), errors=errors, note=f"Tracking, {step.status.name.lower()}: {far}")

    def replayed(self, playback: Playback) -> View:
        """The view of where a trajectory that is played is, beside where it was to be."""
        q, note = playback.at(playback.time), f"Trajectory at {playback.said}"
        commanded = playback.commanded_at(playback.time)
        if commanded is None:
            return self.played(q, note)
        off = np.abs(commanded - q)
        worst = int(off.argmax())
        told = in_words(self.robot, worst, off[worst], ".2f")
        note = f"{note}; {self.robot.joint_names[worst]} is {told} from the command, the others less"
        return replace(self.played(q, note), commanded=checks.read_only(commanded))

    def played(self, q: Array, note: str) -> View:
        """The view of an arm at the joint values (dof,) of a trajectory, within the limits or not."""
        view = self.posture(q)
        over = ", ".join(name for name, _ in self.excess(q))
        if not over:
            return replace(view, note=note)
        moved = self._placed(view, checks.read_only(q))
        return replace(moved, target=self.pose_of(q), note=f"{note}; outside the limits: {over}")

    def underway(self, view: View, q: Array, note: str) -> View:
        """A view with the arm at joint values (dof,) on its way to the target."""
        moved = self._placed(view, checks.read_only(q))
        return replace(moved, errors=self.errors(q, view.target), note=note)

    def pose_of(self, q: Array) -> pin.SE3:
        """T_base_tool at joint values (dof,)."""
        pose = self.robot.forward_kinematics(q, self.solver.frame)
        return pose if self.solver.tool is None else pose * self.solver.tool

    def errors(self, q: Array, target: pin.SE3) -> tuple[float, float]:
        """How far the tool is from a target at `q`: position [m], angle [rad]."""
        reached = self.pose_of(q)
        angle = float(np.linalg.norm(pin.log3(reached.rotation.T @ target.rotation)))
        return float(np.linalg.norm(target.translation - reached.translation)), angle

    def margin(self, q: Array) -> Array:
        """(..., dof) distance to the nearer limit [rad]: negative outside, inf where there are none."""
        return limit_margins(self.robot, q)

    def excess(self, q: Array) -> list[tuple[str, float]]:
        """The joints that are outside their limits at `q`, each with by how much [rad]."""
        margins = zip(self.robot.joint_names, self.margin(q).tolist(), strict=True)
        return [(name, -margin) for name, margin in margins if margin < 0.0]

    def touching(self, q: Array) -> tuple[tuple[str, str], ...]:
        """Pairs of shapes that touch at `q`; none when the solver does not look."""
        return tuple(self.solver.verifier.touching(q))

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

    def places(self, configurations: Sequence[Array] | Array) -> ShownPlaces:
        """Where the base and the part of each joint are, for k configurations (k, dof)."""
        count, parts = len(configurations), self.robot.dof + 1
        table = np.empty((count, parts, 7))
        model, data = self.robot.pin_model, self._data
        for row, q in enumerate(configurations):
            pin.forwardKinematics(model, data, np.ascontiguousarray(q))
            for part, placement in enumerate(data.oMi):
                table[row, part] = pin.SE3ToXYZQUAT(placement)
        return ShownPlaces(table[:, :, :3].astype(np.float32), table[:, :, [6, 3, 4, 5]].astype(np.float32))

    def _bare(self, target: pin.SE3, seed: Array) -> View:
        """A view without branches, with the arm at a seed."""
        none = np.zeros((0, self.robot.dof))
        here = checks.read_only(seed)
        return View(target, Status.OK, here, here, None, none, none, np.zeros(0, dtype=np.bool_), None)

    def _placed(self, view: View, q: Array, touching: tuple[tuple[str, str], ...] | None = None) -> View:
        """A view with the arm at joint values that were chosen and not solved for.

        Args:
            view: of any target.
            q: (dof,) [rad], read-only.
            touching: pairs of shapes that touch there; None to look for them.
        """
        pairs = self.touching(q) if touching is None else touching
        status = diagnosis.diagnose_posture(self.robot.within_limits(q), pairs)
        return replace(
            view,
            status=status,
            q=q,
            selected=None,
            arm_touching=pairs,
            errors=(0.0, 0.0),
            message="",
            pending=False,
            commanded=None,
        )

    def _with_curves(self, view: View, found: SolutionSet | None = None) -> View:
        """A reached view of a seven-joint arm: some of the postures that reach the target for branches."""
        if self.solver.dimension() != 1:
            return view
        found = self.solver.solve_all(view.target, view.q) if found is None else found
        assert found.parameter is not None
        branches = np.vstack((view.q, found.sample(MEMBERS)))
        margins = self.margin(branches)
        joint = self.robot.joint_index(found.parameter)
        low, high = max(float(self.robot.lower[joint]), -np.pi), min(float(self.robot.upper[joint]), np.pi)
        return replace(
            view,
            selected=0,
            branches=checks.read_only(branches),
            margins=checks.read_only(margins),
            within=np.all(margins >= 0.0, axis=1),
            touching=tuple(map(self.touching, branches)) if self.solver.verifier.looks_for_contact else None,
            free=Free(self.robot.joint_names[joint], float(view.q[joint]), low, high, _spans(found)),
        )


def _answered(view: View, answer: IKResult) -> View:
    """A view with the arm at an answer of the solver."""
    return replace(
        view,
        status=answer.status,
        q=answer.q,
        seed=view.q,
        selected=None,
        arm_touching=answer.touching,
        errors=(answer.position_error, answer.orientation_error),
        message=answer.message,
        commanded=None,
        pending=False,
    )


def _spans(found: SolutionSet) -> tuple[tuple[float, float], ...]:
    """Values of the parameter from start to stop that curves have [rad]."""
    return tuple((float(interval.start), float(interval.stop)) for interval in found.intervals)
