"""`Tracker`: one QP a tick, from where the arm is towards a target, within every limit. Read this file first.

A tick asks for the joint displacement that brings the tool to its target, as least squares inside a box (velocity and
position limits) and a few linear inequalities (clearance). What the QP says of linearised kinematics is checked at the
new configuration: a step that makes the error grow is taken again with more damping, one that brings shapes too near is
shortened. So the error never oscillates and the limits hold exactly. Why this QP is written on Pinocchio and the one of
the solver is mink's: see `jacokin.ik.qp`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import targets
from jacokin.ik.options import TRACKING_ORIENTATION_TOLERANCE, TRACKING_POSITION_TOLERANCE
from jacokin.ik.qp_backend import Backend, QPFailed
from jacokin.ik.seeds import checked_start
from jacokin.model import checks, poses
from jacokin.model.jacobians import REFERENCES
from jacokin.model.robot import Robot, checked_robot, velocity_limits
from jacokin.model.scene import Scene
from jacokin.motion.tracking.avoidance import Distances, make_guard
from jacokin.motion.tracking.joint_limits import Follower, JointBox
from jacokin.motion.tracking.problem import (
    Objective,
    Quadratic,
    TickProblem,
    build_problem,
    checked_objectives,
    null_space_objective,
)
from jacokin.motion.tracking.targets import FrameTask, Kinematics, TaskFactory, TrackingTarget

NEGLIGIBLE = 0.1  # of the tolerances: an error below this may grow again
DAMPING = (1e-2, 1e4)  # relative to the squared error: least, and where no step helps any more
MORE_DAMPING, LESS_DAMPING = 10.0, 3.0  # factors after a step that makes the error grow, and after a good one
RETRIES = 6  # QPs in one tick at most
SHORTENINGS = 6  # halvings of a step that comes too near, before the arm stays
STILL = 1e-5  # [rad/s] a slower arm stands still
GROWTH_TIME = 0.25  # [s] of growing error until the target counts as lost
GROWTH = 1e-7  # [m] an error must grow by this in a tick to count as growing


class TrackerStatus(Enum):
    """Outcome of a tick; the value is a sentence that says what to try."""

    OK = "the tool is on its target within the tolerances"
    LIMITED = (
        "the tool is behind its target and closing in, slowed by what `limiting` names: "
        "move the target more slowly, or wait"
    )
    HELD = (
        "no allowed step brings the tool nearer, so the arm stays: the target is out of reach, behind a limit "
        "or behind an obstacle (see `limiting`)"
    )
    LOST = "the error keeps growing: the target runs away faster than the limits allow; slow it down"


@dataclass(frozen=True, slots=True, eq=False)
class TrackerStep:
    """One tick. Arrays are read-only."""

    q: Array
    """(dof,) joint angles to command [rad], inside the limits exactly."""
    v: Array
    """(dof,) joint velocities that led here, constant over the tick [rad/s]."""
    status: TrackerStatus
    """What happened; `status.value` says what to try."""
    position_error: float
    """Distance between tool and target after the tick [m]; the largest one of several targets."""
    orientation_error: float
    """Angle between tool and target after the tick [rad]; the largest one of several targets."""
    limiting: tuple[str, ...]
    """What held the arm back: "joint_2 velocity", "joint_3 upper limit", "link_3_beam~box". Empty when OK."""
    clearance: float | None
    """Smallest distance between shapes that are kept apart [m]: measured where it is near the one allowed, a lower
    bound where it is larger; negative when shapes overlap; None when none are kept apart."""
    qp_solver: str
    """QP solver that ran, with a fallback named."""
    message: str
    """What happened in this tick, with numbers; empty when OK."""

    def __str__(self) -> str:
        """The step on one line."""
        by = f" ({', '.join(self.limiting)})" if self.limiting else ""
        return (
            f"{self.status.name}{by}: position error {self.position_error:.3g} m, "
            f"orientation error {self.orientation_error:.3g} rad"
        )


class JointState(NamedTuple):
    """A configuration (dof,) [rad] and the distances of the shapes there."""

    q: Array
    distances: Distances | None


class TrackerState(NamedTuple):
    """Everything a tick starts from."""

    arm: JointState
    """Where the arm is."""
    v: Array
    """(dof,) its velocity over the last tick [rad/s]; read-only."""
    reference: JointState
    """What the QP moves and the arm follows; the arm itself without acceleration limits."""
    damping: float
    """Of the next QP, relative to the squared error."""
    error: float
    """Of the last tick [m], position and orientation in one."""
    growing: int
    """Ticks in a row in which the error grew."""
    twist_pose: pin.SE3 | None
    """T_base_tool that the last twist asked for, while the arm keeps up with twists."""

    @classmethod
    def at_rest(cls, arm: JointState, damping: float) -> TrackerState:
        """Standing still."""
        return cls(arm, checks.read_only(np.zeros(len(arm.q))), arm, damping, np.inf, 0, None)

    def move(self, arm: JointState, reference: JointState, dt: float, damping: float) -> TrackerState:
        """After a tick of `dt` [s]."""
        v = (arm.q - self.arm.q) / dt
        for array in (arm.q, v):
            array.setflags(write=False)
        return TrackerState(arm, v, reference, damping, self.error, self.growing, None)


class Tracker:
    """Follows targets with one robot and frame at a fixed rate.

    A call that fails or is interrupted leaves the tracker as it was.

    Attributes:
        robot: the arm.
        frame: the frame that follows targets which name none.
        dt: control step [s].
        velocity_limit: (dof,) [rad/s]; read-only.
    """

    def __init__(
        self,
        robot: Robot,
        frame: str | None = None,
        *,
        dt: float = 0.01,
        q: ArrayLike | None = None,
        tool: pin.SE3 | ArrayLike | None = None,
        velocity_limit: ArrayLike | None = None,
        acceleration_limit: ArrayLike | None = None,
        scene: Scene | None = None,
        clearance: float | None = None,
        collision: str | None = None,
        self_collision: bool = True,
        pairs: Sequence[tuple[str, str]] | None = None,
        posture: ArrayLike | None = None,
        objectives: Sequence[Objective] = (),
        qp_solver: str = "daqp",
        position_tolerance: float = TRACKING_POSITION_TOLERANCE,
        orientation_tolerance: float = TRACKING_ORIENTATION_TOLERANCE,
    ) -> None:
        """Build the QP's parts once.

        Args:
            robot: the arm.
            frame: name of the frame to move; None for the robot's default frame.
            dt: control step [s].
            q: (dof,) where the arm is [rad]; None for the robot's home.
            tool: T_frame_tool, a constant pose after the frame.
            velocity_limit: (dof,) or one for all [rad/s]; None for the robot's own.
            acceleration_limit: (dof,) or one for all [rad/s^2]; None for none. A step that is shortened to keep
                shapes apart may brake harder.
            scene: obstacles around the arm, in the base frame.
            clearance: shapes are kept this far apart [m]; None for 0.01.
            collision: "reject" keeps the arm clear of the scene and of itself, "ignore" keeps nothing apart. None is
                "reject" where a scene, a clearance or pairs are given, else "ignore".
            self_collision: False to keep the arm clear of obstacles only.
            pairs: exactly these pairs of shapes, by name, instead of all.
            posture: (dof,) configuration [rad] to stay near with the freedom that targets leave.
            objectives: what else to do with that freedom, see `Objective`.
            qp_solver: a QP solver installed for qpsolvers: "daqp", "quadprog", "osqp", "proxqp".
            position_tolerance: the target is reached this near [m].
            orientation_tolerance: the target is reached this near [rad].

        Raises:
            InvalidInputError: a number that is malformed or not positive, a frame that does not move, velocity limits
                missing in the robot's file and here, `q` outside the limits, or a scene, clearance or pairs with
                collision="ignore".
            UnknownNameError: unknown frame, QP solver, collision mode or shape.
            ModelError: shapes are to be kept apart and the description has none.
        """
        checked_robot("robot", robot)
        self.robot = robot
        self.frame = robot.default_frame if frame is None else frame
        self._kinematics = Kinematics(robot, self.frame, None if tool is None else poses.checked_pose(tool, "tool"))
        self._targets = TaskFactory(self._kinematics)
        self.dt = checks.positive("dt", dt, "s")
        self.velocity_limit = velocity_limits(robot, velocity_limit)
        self._box = JointBox(robot, self.velocity_limit, self.dt)
        self._follower = None
        if acceleration_limit is not None:
            acceleration = checks.positive_vector("acceleration_limit", acceleration_limit, robot.dof, "rad/s^2")
            self._follower = Follower(robot, self._box, acceleration, self.dt)
        self._guard = make_guard(
            robot,
            self.velocity_limit,
            self.dt,
            scene=scene,
            clearance=clearance,
            collision=collision,
            self_collision=self_collision,
            pairs=pairs,
        )
        self._objectives = checked_objectives(robot, objectives, posture)
        self._position_tolerance = checks.positive("position_tolerance", position_tolerance, "m")
        self._orientation_tolerance = checks.positive("orientation_tolerance", orientation_tolerance, "rad")
        self._negligible = (NEGLIGIBLE * self._position_tolerance) ** 2
        self._qp = Backend(qp_solver)
        self.reset(q)

    @property
    def q(self) -> Array:
        """(dof,) where the arm is [rad]; read-only."""
        return self._state.arm.q

    @property
    def v(self) -> Array:
        """(dof,) its velocity over the last tick [rad/s]; read-only."""
        return self._state.v

    def reset(self, q: ArrayLike | None = None) -> None:
        """Put the arm somewhere, standing still.

        Args:
            q: (dof,) configuration [rad]; None for the robot's home. A joint past its limit by at most 0.01 rad, as
                an encoder may report it, is put on the limit.

        Raises:
            InvalidInputError: malformed or outside the limits; the tracker stays as it was.
        """
        start = checked_start(self.robot, q)
        guard = self._guard
        self._state = TrackerState.at_rest(JointState(start, None if guard is None else guard.start(start)), DAMPING[0])

    def step(
        self,
        target: pin.SE3 | ArrayLike | TrackingTarget | Sequence[TrackingTarget] | None = None,
        *,
        twist: ArrayLike | None = None,
        reference: str = "local_world_aligned",
    ) -> TrackerStep:
        """One tick towards a target, or along a twist.

        Args:
            target: T_base_tool as `pin.SE3` or (4, 4), a position (3,) [m], or targets from `jacokin.motion`.
            twist: (6,) velocity of the tool, linear [m/s] then angular [rad/s]; instead of a target.
            reference: where the twist is expressed: "local_world_aligned", "local" or "world".

        Returns:
            Where the arm is after the tick.

        Raises:
            InvalidInputError: both or neither given, or malformed; the tracker stays as it was.
            UnknownNameError: unknown frame or reference.
        """
        if (target is None) == (twist is None):
            raise InvalidInputError("give exactly one of target and twist")
        state = self._state
        twist_pose = None
        if twist is not None:
            twist_pose = move_by_twist(self._twist_start(state), twist, reference, self.dt)
            target = twist_pose
        after, step = self._tick(state, self._targets.tasks(target))
        # Rounding does not add up while the arm keeps up; when it cannot, no backlog builds.
        keeps_up = step.status is TrackerStatus.OK
        # One assignment, the last one: an interrupt leaves the old state or the new one.
        self._state = after._replace(twist_pose=twist_pose) if keeps_up and twist_pose is not None else after
        return step

    def measure(self, target: pin.SE3 | ArrayLike | TrackingTarget | Sequence[TrackingTarget]) -> TrackerStep:
        """How far the tool is from a target, without moving; errors as `step`."""
        tasks = self._targets.tasks(target)
        self._qp.reset()
        return self._report(tasks, self._state, self._state, "", excused=False)[1]

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Unpickled arrays are writable until told otherwise."""
        self.__dict__.update(state)
        for array in (self._state.arm.q, self._state.v, self._state.reference.q, self.velocity_limit):
            array.setflags(write=False)

    def _twist_start(self, state: TrackerState) -> pin.SE3:
        """T_base_tool that a twist moves on from."""
        if state.twist_pose is not None:
            return state.twist_pose
        self._kinematics.move_to(state.arm.q)
        return pin.SE3(self._kinematics.pose(self._kinematics.tool))

    def _tick(self, state: TrackerState, tasks: list[FrameTask]) -> tuple[TrackerState, TrackerStep]:
        """Solve, check and move: the state after the tick."""
        before = state.reference
        self._qp.reset()
        self._kinematics.move_to(before.q)
        problem = build_problem(self._kinematics, tasks, before.q, self._guard, before.distances)
        null_space = None
        if self._objectives:
            null_space = null_space_objective(
                self.robot, self.frame, before.q, problem.jacobian, self._objectives, self._box.step, self.dt
            )
        reference, damping, held = self._descend(tasks, problem, null_space, before, state.damping)
        if self._follower is None:
            arm = reference
        else:
            wanted = self._follower.displacement(state.arm.q, state.v, reference.q, (reference.q - before.q) / self.dt)
            arm = self._try(state.arm, wanted, problem.exits)
            # An arm that an obstacle stops takes its reference with it.
            if not np.array_equal(arm.q, self._box.move(state.arm.q, wanted)):
                reference = arm
        after = state.move(arm, reference, self.dt, damping)
        # Shapes moving apart, or joints still gathering speed, may take the tool away from its target for a while.
        lagging = self._follower is not None and not np.array_equal(arm.q, reference.q)
        return self._report(tasks, state, after, held, excused=problem.separating or lagging)

    def _descend(
        self,
        tasks: list[FrameTask],
        problem: TickProblem,
        null_space: Quadratic | None,
        start: JointState,
        damping: float,
    ) -> tuple[JointState, float, str]:
        """The first state that is no farther from the target, with as little damping as that takes.

        Returns:
            The state, the damping for the next tick, and why the arm stays if it does.
        """
        low, high = self._box.bounds(start.q)
        for _ in range(RETRIES):
            try:
                displacement = self._qp.minimize(*problem.damp(damping, null_space), problem.inequalities, low, high)
            except QPFailed:
                return start, damping, "no QP solver solved this tick"
            found = self._try(start, displacement, problem.exits)
            if problem.separating or self._nearer(tasks, found.q, problem.cost):
                return found, max(damping / LESS_DAMPING, DAMPING[0]), ""
            null_space = None
            if damping >= DAMPING[1]:
                break
            damping *= MORE_DAMPING
        return start, damping, "every step makes the error grow"

    def _try(self, start: JointState, displacement: Array, exits: Mapping[int, Array]) -> JointState:
        """Where a displacement leads, shortened until nothing comes too near."""
        guard = self._guard
        for _ in range(SHORTENINGS):
            q = self._box.move(start.q, displacement)
            if guard is None or start.distances is None:
                return JointState(q, None)
            distances = guard.move(q, start.distances, displacement, exits)
            if guard.acceptable(start.distances, distances):
                return JointState(q, distances)
            displacement = 0.5 * displacement
        return start

    def _nearer(self, tasks: list[FrameTask], q: Array, cost: float) -> bool:
        """Whether the error shrank, or is too small to matter."""
        self._kinematics.move_to(q)
        now = 0.0
        for task in tasks:
            error = task.error(self._kinematics)
            now += float(error.dot(error))
        return now <= cost or now <= self._negligible

    def _report(
        self, tasks: list[FrameTask], before: TrackerState, after: TrackerState, held: str, *, excused: bool
    ) -> tuple[TrackerState, TrackerStep]:
        """Measure where the arm is; the state with what was learned of the error."""
        self._kinematics.move_to(after.arm.q)
        position, orientation = tasks[0].measure(self._kinematics)
        for task in tasks[1:]:
            position, orientation = map(max, (position, orientation), task.measure(self._kinematics))
        on_target = position <= self._position_tolerance and orientation <= self._orientation_tolerance
        error = targets.combined_error(position, orientation)
        grows = not (excused or on_target) and error > before.error + GROWTH
        after = after._replace(error=error, growing=before.growing + 1 if grows else 0)
        status, limiting, message = TrackerStatus.OK, list[str](), ""
        if not on_target:
            limiting = self._box.limiting(after.arm.q - before.arm.q, before.arm.q)
            if self._follower is not None:
                limiting.extend(self._follower.limiting(after.v, before.v))
            if self._guard is not None and after.arm.distances is not None:
                limiting.extend(self._guard.limiting(after.arm.distances))
            status, message = self._why(after, limiting, held)
        distances = after.arm.distances
        step = TrackerStep(
            q=after.arm.q,
            v=after.v,
            status=status,
            position_error=position,
            orientation_error=orientation,
            limiting=tuple(limiting),
            clearance=None if distances is None else distances.least,
            qp_solver=self._qp.used,
            message=message,
        )
        return after, step

    def _why(self, state: TrackerState, limiting: list[str], held: str) -> tuple[TrackerStatus, str]:
        """Status and sentence of a tick that is off target."""
        if state.growing * self.dt >= GROWTH_TIME:
            return TrackerStatus.LOST, f"the error has grown for {state.growing * self.dt:.2f} s"
        if float(np.abs(state.v).max()) < STILL:
            return TrackerStatus.HELD, held or "the arm has come as near as it can"
        return TrackerStatus.LIMITED, f"slowed by {', '.join(limiting) or 'damping near a singular pose'}"


def move_by_twist(pose: pin.SE3, twist: ArrayLike, reference: str, dt: float) -> pin.SE3:
    """A pose after moving along a twist (6,) for `dt` [s].

    Raises:
        InvalidInputError: the twist is malformed.
        UnknownNameError: the reference is unknown.
    """
    checks.choice("reference", reference, REFERENCES)
    motion = checks.vector("twist", twist, 6, "m/s, rad/s") * dt
    if reference == "local":
        return pose * pin.exp6(motion)
    if reference == "world":
        return pin.exp6(motion) * pose
    return pin.SE3(pin.exp3(motion[3:]) @ pose.rotation, pose.translation + motion[:3])
