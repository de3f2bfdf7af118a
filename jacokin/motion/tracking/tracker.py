"""`Tracker`: one QP a tick, from where the arm is towards a target, within every limit. Read this file first.

A tick asks for the joint displacement that brings the tool to its target, as least squares inside a box (velocity and
position limits) and a few linear inequalities (clearance). What the QP says of linearised kinematics is checked at the
new configuration: a step that makes the error grow is taken again with more damping, one that brings shapes too near is
shortened. So the error never oscillates and the limits hold exactly. With acceleration limits no step is taken from
which the arm could not brake to rest within all limits and clear of what stands still: the way out is always known. Why
this QP is written on Pinocchio and the one of the solver is mink's: see `jacokin.ik.qp`.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import targets
from jacokin.ik.options import TRACKING_ORIENTATION_TOLERANCE, TRACKING_POSITION_TOLERANCE
from jacokin.ik.qp_backend import Backend, QPFailed
from jacokin.ik.seeds import LIMIT_NOISE, checked_start
from jacokin.model import checks, poses
from jacokin.model.jacobians import REFERENCES
from jacokin.model.robot import Robot, checked_robot, velocity_limits
from jacokin.model.scene import Scene
from jacokin.motion.tracking.avoidance import CLEARANCE, Distances, make_guard
from jacokin.motion.tracking.joint_limits import Follower, JointBox
from jacokin.motion.tracking.moving import Motion, Whereabouts
from jacokin.motion.tracking.problem import (
    Objective,
    Quadratic,
    TickProblem,
    build_problem,
    by_priority,
    checked_objectives,
    linearise,
    null_space_objective,
    refine,
)
from jacokin.motion.tracking.steps import (
    SINGULAR_POSE,
    TIME_BUDGET,
    StepTally,
    TrackerStatus,
    TrackerStep,
    TrackerSummary,
)
from jacokin.motion.tracking.targets import FrameTask, Kinematics, TaskFactory, TrackingTarget

NEGLIGIBLE = 0.1  # of the tolerances: an error below this may grow again
DAMPING = (1e-2, 1e4)  # relative to the squared error: least, and where no step helps any more
MORE_DAMPING, LESS_DAMPING = 10.0, 3.0  # factors after a step that makes the error grow, and after a good one
RETRIES = 6  # QPs in one tick at most
SHORTENINGS = 6  # halvings of a step that comes too near, before the arm stays
PARTS = (1.0, 0.5, 0.2)  # of the way from braking to what the arm would do, tried until it can still stop in time
SAME = 1e-12  # [rad] nearer to its reference, a joint is on it
SINGULAR = 0.01  # [m/rad] weighted; in directions with a smaller singular value the arm hardly moves the tool
MOSTLY = 0.5  # part of the error in such directions from which they hold the arm back
RESERVE = 1e-4  # [s] of a budget that braking and the report take
STILL = 1e-5  # [rad/s] a slower arm stands still
GROWTH_TIME = 0.25  # [s] of growing error until the target counts as lost
GROWTH = 1e-7  # [m] an error must grow by this in a tick to count as growing


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
    where: Whereabouts | None
    """The obstacles that can move, at the end of the last tick; None when no shapes are kept apart."""
    can_stop: bool
    """Whether braking from now on is certain to come too near to nothing."""
    damping: float
    """Of the next QP, relative to the squared error."""
    error: float
    """Of the last tick [m], position and orientation in one."""
    growing: int
    """Ticks in a row in which the error grew."""
    twist_pose: pin.SE3 | None
    """T_base_tool that the last twist asked for, while the arm keeps up with twists."""

    @classmethod
    def at_rest(cls, arm: JointState, where: Whereabouts | None, damping: float) -> TrackerState:
        """Standing still."""
        return cls(arm, checks.read_only(np.zeros(len(arm.q))), arm, where, True, damping, np.inf, 0, None)

    def move(self, arm: JointState, reference: JointState, dt: float, damping: float) -> TrackerState:
        """After a tick of `dt` [s]."""
        v = (arm.q - self.arm.q) / dt
        for array in (arm.q, v):
            array.setflags(write=False)
        return self._replace(arm=arm, v=v, reference=reference, damping=damping, twist_pose=None)


class OutOfTime(Exception):  # noqa: N818 - internal signal, never seen by users
    """The deadline of a tick has passed."""


class Tracker:
    """Follows targets with one robot and frame at a fixed rate.

    A call that fails or is interrupted leaves the tracker as it was.

    Attributes:
        robot: the arm.
        frame: the frame that follows targets which name none.
        tool: T_frame_tool.
        dt: control step [s].
        velocity_limit: (dof,) [rad/s]; read-only.
        acceleration_limit: (dof,) [rad/s^2], read-only; None for none.
        scene: what the arm is kept clear of, at the start; None where nothing is kept apart.
        clearance: shapes are kept this far apart [m].
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
            acceleration_limit: (dof,) or one for all [rad/s^2]; None for none: then a joint may stop within a tick.
            scene: obstacles around the arm, in the base frame.
            clearance: shapes are kept this far apart [m]; None for 0.01.
            collision: "reject" keeps the arm clear of the scene and of itself, "ignore" keeps nothing apart. None is
                "reject" where a scene, a clearance or pairs are given, else "ignore".
            self_collision: False to keep the arm clear of obstacles only.
            pairs: exactly these pairs of shapes, by name, instead of all.
            posture: (dof,) configuration [rad] to stay near with the freedom that targets leave.
            objectives: what else to do with that freedom, see `Objective`. They are added up; for wishes in order, give
                targets a `priority`.
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
        self.tool = pin.SE3.Identity() if tool is None else poses.checked_pose(tool, "tool")
        self._kinematics = Kinematics(robot, self.frame, self.tool)
        self._targets = TaskFactory(self._kinematics)
        self.dt = checks.positive("dt", dt, "s")
        self.velocity_limit = velocity_limits(robot, velocity_limit)
        self._box = JointBox(robot, self.velocity_limit, self.dt)
        self._follower, self.acceleration_limit, reaction = None, None, 0.0
        if acceleration_limit is not None:
            acceleration = checks.positive_vector("acceleration_limit", acceleration_limit, robot.dof, "rad/s^2")
            self.acceleration_limit = checks.read_only(acceleration)
            self._follower = Follower(robot, self._box, acceleration, self.dt)
            reaction = float((self.velocity_limit / acceleration).max())
        self._guard = make_guard(
            robot,
            self.velocity_limit,
            self.dt,
            scene=scene,
            clearance=clearance,
            collision=collision,
            self_collision=self_collision,
            pairs=pairs,
            reaction=reaction,
        )
        self.clearance = CLEARANCE if clearance is None else float(clearance)
        self.scene = None if self._guard is None else Scene() if scene is None else scene
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

    @property
    def summary(self) -> TrackerSummary:
        """How often what happened since the last `reset`."""
        return self._tally.summary()

    def reset(self, q: ArrayLike | None = None) -> None:
        """Put the arm somewhere, standing still, and obstacles back to where the scene has them.

        Args:
            q: (dof,) configuration [rad]; None for the robot's home. A joint past its limit by at most 0.01 rad, as
                an encoder may report it, is put on the limit.

        Raises:
            InvalidInputError: malformed or outside the limits; the tracker stays as it was.
        """
        start = checked_start(self.robot, q, noise=LIMIT_NOISE)
        guard, distances, where = self._guard, None, None
        if guard is not None:
            where = guard.shapes.start
            guard.put(where)
            distances = guard.start(start)
        self._tally = StepTally()
        self._state = TrackerState.at_rest(JointState(start, distances), where, DAMPING[0])

    def step(
        self,
        target: pin.SE3 | ArrayLike | TrackingTarget | Sequence[TrackingTarget] | None = None,
        *,
        twist: ArrayLike | None = None,
        reference: str = "local_world_aligned",
        obstacles: Mapping[str, Motion] | None = None,
        budget: float | None = None,
    ) -> TrackerStep:
        """One tick towards a target, or along a twist.

        Args:
            target: T_base_tool as `pin.SE3` or (4, 4), a position (3,) [m], or targets from `jacokin.motion`.
            twist: (6,) velocity of the tool, linear [m/s] then angular [rad/s]; instead of a target.
            reference: where the twist is expressed: "local_world_aligned", "local" or "world".
            obstacles: where obstacles of the scene are now, by name: T_base_shape or a position (3,) [m], or a tuple
                of that and the twist (6,) of its origin in base axes [m/s, rad/s]. Those that are not named go on as
                they moved.
            budget: time for this call [s]; None for any. When it runs out, the arm brakes within its limits.

        Returns:
            Where the arm is after the tick.

        Raises:
            InvalidInputError: both or neither of target and twist given, malformed, or obstacles where none are kept
                apart from the arm; the tracker stays as it was.
            UnknownNameError: unknown frame, reference or obstacle.
        """
        began = time.perf_counter()
        if (target is None) == (twist is None):
            raise InvalidInputError("give exactly one of target and twist")
        limit = np.inf if budget is None else checks.positive("budget", budget, "s")
        state = self._around(self._state, obstacles)
        twist_pose = None
        if twist is not None:
            twist_pose = move_by_twist(self._twist_start(state), twist, reference, self.dt)
            target = twist_pose
        after, step = self._tick(state, self._targets.tasks(target), began, began + limit - RESERVE)
        # Rounding does not add up while the arm keeps up; when it cannot, no backlog builds.
        keeps_up = step.status is TrackerStatus.OK
        # One assignment: an interrupt leaves the old state or the new one.
        self._state = after._replace(twist_pose=twist_pose) if keeps_up and twist_pose is not None else after
        self._tally.add(step, limit)
        return step

    def brake(self, *, obstacles: Mapping[str, Motion] | None = None) -> TrackerStep:
        """One tick of braking as hard as the limits allow, towards nothing: OK once the arm stands still.

        Without acceleration limits it stands at once.

        Args:
            obstacles: as in `step`.
        """
        began = time.perf_counter()
        after, step = self._braked(self._around(self._state, obstacles), None, [], began)
        self._state = after
        self._tally.add(step, np.inf)
        return step

    def measure(self, target: pin.SE3 | ArrayLike | TrackingTarget | Sequence[TrackingTarget]) -> TrackerStep:
        """How far the tool is from a target, without moving; errors as `step`."""
        levels = by_priority(self._targets.tasks(target))
        self._qp.reset()
        return self._report(levels[0], self._state, self._state, "", began=time.perf_counter(), excused=False)[1]

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Unpickled arrays are writable until told otherwise."""
        self.__dict__.update(state)
        limits = [self.velocity_limit, *([] if self.acceleration_limit is None else [self.acceleration_limit])]
        for array in (self._state.arm.q, self._state.v, self._state.reference.q, *limits):
            array.setflags(write=False)

    def _twist_start(self, state: TrackerState) -> pin.SE3:
        """T_base_tool that a twist moves on from."""
        if state.twist_pose is not None:
            return state.twist_pose
        self._kinematics.move_to(state.arm.q)
        return pin.SE3(self._kinematics.pose(self._kinematics.tool))

    def _around(self, state: TrackerState, obstacles: Mapping[str, Motion] | None) -> TrackerState:
        """The state with the obstacles where they are told to be now."""
        if obstacles is None:
            return state
        if self._guard is None or state.where is None:
            raise InvalidInputError("obstacles has no effect without a scene: nothing is kept apart")
        return state._replace(where=self._guard.shapes.told(state.where, obstacles))

    def _tick(
        self, state: TrackerState, tasks: list[FrameTask], began: float, deadline: float
    ) -> tuple[TrackerState, TrackerStep]:
        """Solve, check and move: the state after the tick."""
        levels = by_priority(tasks) if len(tasks) > 1 else [tasks]
        self._qp.reset()
        shift = self._move_obstacles(state)
        try:
            return self._solve(self._see(state, shift), levels, began, deadline)
        except OutOfTime:
            return self._braked(state, shift, levels[0], began)

    def _move_obstacles(self, state: TrackerState) -> tuple[Whereabouts | None, Array | None]:
        """Put the obstacles where they are at the end of the tick; with how far they moved (k,) [m], None for not."""
        guard, before = self._guard, self._state.where
        if guard is None or state.where is None or before is None:
            return None, None
        where = state.where.after(self.dt)
        guard.put(where)
        return where, None if where.poses is before.poses else guard.shapes.travel(before, where)

    def _see(self, state: TrackerState, moved: tuple[Whereabouts | None, Array | None]) -> TrackerState:
        """The state with distances to the obstacles where they are at the end of the tick."""
        where, shift = moved
        arm = self._measured(state.arm, shift)
        reference = arm if state.reference is state.arm else self._measured(state.reference, shift)
        return state._replace(arm=arm, reference=reference, where=where)

    def _measured(self, joints: JointState, shift: Array | None) -> JointState:
        """A configuration with its distances, measured anew where obstacles moved or there was no time for it."""
        if self._guard is None or joints.distances is None or (shift is None and joints.distances.measured):
            return joints
        return JointState(joints.q, self._guard.refresh(joints.q, joints.distances, shift))

    def _solve(
        self, state: TrackerState, levels: list[list[FrameTask]], began: float, deadline: float
    ) -> tuple[TrackerState, TrackerStep]:
        """A tick whose distances are known."""
        before, tasks = state.reference, levels[0]
        self._kinematics.move_to(before.q)
        problem = build_problem(self._kinematics, tasks, before.q, self._guard, before.distances, state.where)
        bounds = self._box.bounds(before.q)
        if problem.evading and self._follower is not None:
            # A reference that jumps away would be followed too late: the QP moves the arm itself, as fast as it can.
            if before is not state.arm:
                before = state.arm
                state = state._replace(reference=before)
                self._kinematics.move_to(before.q)
                problem = build_problem(self._kinematics, tasks, before.q, self._guard, before.distances, state.where)
            bounds = self._follower.bounds(before.q, state.v)
        later = [linearise(self._kinematics, level) for level in levels[1:]]
        null_space = None
        if self._objectives:
            everything = np.vstack([problem.jacobian, *(jacobian for jacobian, _ in later)])
            null_space = null_space_objective(
                self.robot, self.frame, before.q, everything, self._objectives, self._box.step, self.dt
            )
        reference, damping, held = self._descend(tasks, problem, later, null_space, state, bounds, deadline)
        arm, can_stop = reference, True
        if self._follower is not None:
            arm, reference, can_stop = self._follow(self._follower, state, reference, problem.exits, deadline)
        after = state.move(arm, reference, self.dt, damping)._replace(can_stop=can_stop)
        # Shapes moving apart, or joints still gathering speed, may take the tool away from its target for a while.
        lagging = self._follower is not None and arm is not reference
        excused = problem.separating or lagging
        return self._report(tasks, state, after, held, began=began, excused=excused, problem=problem)

    def _braked(
        self,
        state: TrackerState,
        moved: tuple[Whereabouts | None, Array | None] | None,
        tasks: list[FrameTask],
        began: float,
    ) -> tuple[TrackerState, TrackerStep]:
        """A tick of braking: because it was asked for, with `moved` None, or because time ran out."""
        late = moved is not None
        where, shift = self._move_obstacles(state) if moved is None else moved
        displacement = np.zeros(self.robot.dof) if self._follower is None else self._follower.brake(state.v)
        q = self._box.move(state.arm.q, displacement)
        arm, can_stop, guard = JointState(q, None), state.can_stop, self._guard
        if guard is not None and where is not None and state.arm.distances is not None:
            distances = guard.unmeasured(state.arm.distances, q - state.arm.q, shift)
            arm = JointState(q, distances if late else guard.refresh(q, distances, None))
            can_stop = state.can_stop and shift is None
        after = state.move(arm, arm, self.dt, state.damping)._replace(where=where, can_stop=can_stop)
        return self._report(tasks, state, after, "", began=began, excused=True, late=late)

    def _follow(
        self,
        follower: Follower,
        state: TrackerState,
        reference: JointState,
        exits: Mapping[int, Array],
        deadline: float,
    ) -> tuple[JointState, JointState, bool]:
        """The arm one tick nearer to its reference, no faster than it can stop clear of everything.

        Returns:
            The arm; its reference, which an arm that has to brake takes with it; and whether the arm can stop.
        """
        start, guard, where = state.arm, self._guard, state.where
        speed = (reference.q - state.reference.q) / self.dt
        wanted = follower.displacement(start.q, state.v, reference.q, speed)
        q = self._box.move(start.q, wanted)
        arrives = float(np.abs(q - reference.q).max()) <= SAME
        if guard is None or where is None or start.distances is None:
            return reference if arrives else JointState(q, None), reference, True
        braking = follower.brake(state.v)
        best, least = start, -np.inf
        for part in PARTS:
            if time.perf_counter() > deadline:
                raise OutOfTime
            if part == 1.0 and arrives:
                found = reference
            else:
                q = self._box.move(start.q, braking + part * (wanted - braking))
                found = JointState(q, guard.move(q, start.distances, q - start.q, exits))
            if found.distances is None or not guard.acceptable(start.distances, found.distances):
                continue
            rest = follower.braking(found.q, (found.q - start.q) / self.dt)
            clear, spare = guard.rests_clear(start.distances, found.distances, rest, where)
            if clear:
                return found, reference if part == 1.0 else found, True
            if spare > least:
                best, least = found, spare
        q = self._box.move(start.q, braking)
        distances = guard.move(q, start.distances, q - start.q, exits)
        found = JointState(q, distances)
        if state.can_stop and not where.moving:
            return found, found, True
        clear, spare = guard.rests_clear(
            start.distances, distances, follower.braking(q, (q - start.q) / self.dt), where
        )
        if not clear and spare < least:  # an obstacle comes nearer, and stopping keeps less far from it
            found = best
        return found, found, clear

    def _descend(
        self,
        tasks: list[FrameTask],
        problem: TickProblem,
        later: list[tuple[Array, Array]],
        null_space: Quadratic | None,
        state: TrackerState,
        bounds: tuple[Array, Array],
        deadline: float,
    ) -> tuple[JointState, float, str]:
        """The first state that is no farther from the target, with as little damping as that takes.

        Returns:
            The state, the damping for the next tick, and why the arm stays if it does.
        """
        start, damping = state.reference, state.damping
        low, high = bounds
        for _ in range(RETRIES):
            if time.perf_counter() > deadline:
                raise OutOfTime
            try:
                displacement = self._qp.minimize(*problem.damp(damping, null_space), problem.inequalities, low, high)
            except QPFailed:
                return start, damping, "no QP solver solved this tick"
            if later:
                displacement = refine(
                    displacement,
                    later,
                    problem.jacobian,
                    damping,
                    problem.inequalities,
                    low,
                    high,
                    self._box.step,
                    self._qp,
                )
            found = self._try(start, displacement, problem.exits)
            if problem.separating or self._nearer(tasks, found.q, problem.cost):
                return found, max(damping / LESS_DAMPING, DAMPING[0]), ""
            null_space, later = None, []
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
        self,
        tasks: list[FrameTask],
        before: TrackerState,
        after: TrackerState,
        held: str,
        *,
        began: float,
        excused: bool,
        problem: TickProblem | None = None,
        late: bool = False,
    ) -> tuple[TrackerState, TrackerStep]:
        """Measure where the arm is; the state with what was learned of the error."""
        self._kinematics.move_to(after.arm.q)
        position, orientation = 0.0, 0.0
        for task in tasks:
            position, orientation = map(max, (position, orientation), task.measure(self._kinematics))
        on_target = position <= self._position_tolerance and orientation <= self._orientation_tolerance
        if not tasks:
            on_target = float(np.abs(after.v).max()) < STILL
        error = targets.combined_error(position, orientation)
        grows = not (excused or on_target) and error > before.error + GROWTH
        after = after._replace(error=error, growing=before.growing + 1 if grows else 0)
        status, limiting, message = TrackerStatus.OK, list[str](), ""
        if late or not on_target:
            limiting = [TIME_BUDGET] if late else []
            limiting += self._box.limiting(after.arm.q - before.arm.q, before.arm.q)
            if self._follower is not None:
                limiting.extend(self._follower.limiting(after.v, before.v))
            if self._guard is not None and after.arm.distances is not None:
                limiting.extend(self._guard.limiting(after.arm.distances))
            if problem is not None and _is_singular(problem):
                limiting.append(SINGULAR_POSE)
            status, message = self._why(after, limiting, held, late=late)
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
            elapsed=time.perf_counter() - began,
        )
        return after, step

    def _why(self, state: TrackerState, limiting: list[str], held: str, *, late: bool) -> tuple[TrackerStatus, str]:
        """Status and sentence of a tick that is off target."""
        if late:
            return TrackerStatus.LATE, "the time budget ran out, so the arm brakes"
        if state.growing * self.dt >= GROWTH_TIME:
            return TrackerStatus.LOST, f"the error has grown for {state.growing * self.dt:.2f} s"
        if float(np.abs(state.v).max()) < STILL:
            return TrackerStatus.HELD, held or "the arm has come as near as it can"
        return TrackerStatus.LIMITED, f"slowed by {', '.join(limiting) or 'damping near a singular pose'}"


def _is_singular(problem: TickProblem) -> bool:
    """Whether most of the error is in directions in which the arm hardly moves the tool."""
    left, singular, _ = np.linalg.svd(problem.jacobian, full_matrices=False)
    missing = left[:, singular < SINGULAR].T @ problem.error
    return bool(missing @ missing > MOSTLY**2 * problem.cost)


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
