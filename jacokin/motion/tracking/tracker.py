"""`Tracker`: one tick at a time, from where the arm is towards a target, within every limit. Read this file first.

A tick first asks what displacement of the joints is missing to the target: the minimiser of the error to second order
within the joint limits and the distances to what is near (`problem`), or for a twist the displacement along it
(`twist`). Then how much of it the arm goes in this tick: all joints the same part, as fast as they may and still stop
at the end (`joint_limits`). By default they accelerate harder than to full speed in 0.3 s only as the target does, so
that a joint which could does not jerk to and fro with a target that jumps. Where that leads is looked at before it is
taken: a step that makes the error grow is halved, one that brings shapes too near, or from which the arm could not
brake clear of what stands still, is brought nearer to braking. So the way out is always known, and limits hold exactly.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.options import TRACKING_ORIENTATION_TOLERANCE, TRACKING_POSITION_TOLERANCE
from jacokin.ik.qp_backend import Backend, QPFailed
from jacokin.ik.seeds import checked_start
from jacokin.kernels.tolerances import LIMIT_SNAP
from jacokin.kernels.tracking.run import FROM_STEP, FROM_TOTAL, FROM_TWIST, ON_TARGET, WHOLE
from jacokin.kernels.tracking.tick import NEEDS_QP, SOLVED
from jacokin.model import checks, poses
from jacokin.model.robot import (
    Robot,
    catching_accelerations,
    checked_robot,
    tracking_accelerations,
    velocity_limits,
)
from jacokin.model.scene import Scene
from jacokin.motion.rows import MotionState, checked_velocity
from jacokin.motion.tracking.avoidance import CLEARANCE, NO_CONTACTS, ClearanceGuard, Contacts, Distances, make_guard
from jacokin.motion.tracking.joint_limits import JointLimits
from jacokin.motion.tracking.moving import Motion, Whereabouts
from jacokin.motion.tracking.problem import Level, Objective, checked_objectives, refine, wished
from jacokin.motion.tracking.steps import (
    SINGULAR_POSE,
    TIME_BUDGET,
    StepTally,
    TrackerStatus,
    TrackerStep,
    TrackerSummary,
)
from jacokin.motion.tracking.targets import IN_BASE, Kinematics, TaskFactory, Tasks, TrackingTarget
from jacokin.motion.tracking.ticks import Asked, JointState, OutOfTime, Report, TickSolver
from jacokin.motion.tracking.twist import (
    TwistFollower,
    TwistLine,
    TwistStep,
    in_base_axes,
    is_astray,
    missing,
    moved,
)

NEGLIGIBLE = 0.1  # of the tolerances: an error below this may grow again, and is not worth while to be made smaller by
SHORTEST = 1e-6  # [s] of a control step: what joints move in less is lost in rounding
RESERVE = 1e-4  # [s] of a budget that braking and the report take
STILL = 1e-5  # [rad/s] a slower arm stands still
GROWTH_TIME = 0.25  # [s] of growing error until the target counts as lost
GROWTH = 1e-7  # [m] an error must grow by this in a tick to count as growing
NOTHING_LIMITS: tuple[str, ...] = ()  # what limits a tick that is on its target
NEARBY = 0.05  # [rad] a measured configuration this near to the tracker's own is one of a motion that goes on


class TrackerState(NamedTuple):
    """Everything a tick starts from."""

    arm: JointState
    """Where the arm is, and its velocity over the last tick; read-only."""
    a: Array
    """(dof,) by how much that changed in that tick [rad/s^2]; read-only."""
    distances: Distances | None
    """Of the shapes there; None where nothing is kept apart."""
    guard: ClearanceGuard | None
    """What keeps shapes apart."""
    scene: Scene | None
    """What the arm is kept clear of."""
    where: Whereabouts | None
    """The obstacles that can move, at the end of the last tick; None when no shapes are kept apart."""
    can_stop: bool
    """Whether braking from now on is certain to come too near to nothing."""
    error: float
    """Of the last tick [m], position and orientation in one."""
    growing: int
    """Ticks in a row in which the error grew."""
    asked: Asked | None
    """What the last tick was asked for; None after a twist, and before the first tick."""
    line: TwistLine | None
    """Where twists have led; None after a target."""


class MovedObstacles(NamedTuple):
    """Where obstacles are at the end of a tick."""

    where: Whereabouts | None
    """None when no shapes are kept apart."""
    shift: Array | None
    """(k,) how far they moved since distances were measured, at most [m]; None for not."""


NO_OBSTACLES = MovedObstacles(None, None)


class Tracker:
    """Follows targets with one robot and frame at a fixed rate.

    A call that fails or is interrupted leaves the tracker as it was. A tracker is for one thread at a time; several
    threads may each have one of the same robot.

    Attributes:
        robot: the arm.
        frame: the frame that follows targets which name none.
        tool: T_frame_tool.
        dt: control step [s].
        velocity_limit: (dof,) [rad/s]; read-only.
        acceleration_limit: (dof,) [rad/s^2], read-only; inf for none.
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
        state: MotionState | None = None,
        qp_solver: str = "daqp",
        position_tolerance: float = TRACKING_POSITION_TOLERANCE,
        orientation_tolerance: float = TRACKING_ORIENTATION_TOLERANCE,
    ) -> None:
        """Build the QP's parts once.

        Args:
            robot: the arm.
            frame: name of the frame to move; None for the robot's default frame.
            dt: control step [s], at least 1e-6.
            q: (dof,) where the arm is [rad]; None for the robot's home.
            tool: T_frame_tool, a constant pose after the frame.
            velocity_limit: (dof,) or one for all [rad/s]; None for the robot's own.
            acceleration_limit: (dof,) or one for all [rad/s^2]; None for the robot's own, of which joints use no more
                to catch up with a target than takes them to full speed in 0.3 s; `numpy.inf` for none: then a joint may
                stop within a tick.
            scene: obstacles around the arm, in the base frame.
            clearance: shapes are kept this far apart [m]; None for 0.01.
            collision: "reject" keeps the arm clear of the scene and of itself, "ignore" keeps nothing apart. None is
                "reject" where a scene, a clearance or pairs are given, else "ignore".
            self_collision: False to keep the arm clear of obstacles only.
            pairs: exactly these pairs of shapes, by name, instead of all.
            posture: (dof,) configuration [rad] to stay near with the freedom that targets leave.
            objectives: what else to do with that freedom, see `Objective`. They are added up; for wishes in order, give
                targets a `priority`.
            state: a motion under way, `state` of another tracker, to go on from instead of standing at `q`.
            qp_solver: a QP solver installed for qpsolvers: "daqp", "quadprog", "osqp", "proxqp".
            position_tolerance: the target is reached this near [m].
            orientation_tolerance: the target is reached this near [rad].

        Raises:
            InvalidInputError: a number that is malformed or not positive, a frame that does not move, velocity limits
                missing in the robot's file and here, `q` and `state`, or a scene, clearance or pairs with
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
        if self.dt < SHORTEST:
            raise InvalidInputError(f"dt must be at least {SHORTEST:g} s, got {self.dt:g} s")
        self.velocity_limit = checks.read_only(velocity_limits(robot, velocity_limit))
        self.acceleration_limit = checks.read_only(
            tracking_accelerations(robot, acceleration_limit, self.velocity_limit)
        )
        catching = catching_accelerations(robot, self.velocity_limit) if acceleration_limit is None else None
        self._limits = JointLimits(robot, self.velocity_limit, self.acceleration_limit, self.dt, catching)
        self._make_guard = partial(
            make_guard,
            robot,
            self._limits,
            self.dt,
            clearance=clearance,
            collision=collision,
            self_collision=self_collision,
            pairs=pairs,
        )
        self._guard = self._make_guard(scene=scene)
        self._scene = None if self._guard is None else Scene() if scene is None else scene
        self.clearance = CLEARANCE if clearance is None else float(clearance)
        self._objectives = checked_objectives(robot, objectives, posture)
        self._position_tolerance = checks.positive("position_tolerance", position_tolerance, "m")
        self._orientation_tolerance = checks.positive("orientation_tolerance", orientation_tolerance, "rad")
        tolerances = self._position_tolerance, self._orientation_tolerance
        negligible = NEGLIGIBLE * self._position_tolerance
        self._ticks = TickSolver(self._kinematics, self._limits, self.dt, negligible, tolerances)
        self._twists = TwistFollower(self._kinematics, self._limits, self._ticks, self.dt)
        self._qp = Backend(qp_solver)
        if state is None:
            self.reset(q)
            return
        if q is not None:
            raise InvalidInputError("give at most one of q and state")
        checks.instance("state", state, MotionState, "a MotionState, `state` of another tracker")
        self.reset(state.q, v=state.v)

    @property
    def q(self) -> Array:
        """(dof,) where the arm is [rad]; read-only."""
        return self._state.arm.q

    @property
    def v(self) -> Array:
        """(dof,) its velocity over the last tick [rad/s]; read-only."""
        return self._state.arm.v

    @property
    def tool_pose(self) -> pin.SE3:
        """T_base_tool, where the tool is."""
        self._kinematics.move_to(self.q)
        return self._kinematics.pose(self._kinematics.frame(self.frame)) * self.tool

    @property
    def state(self) -> MotionState:
        """The motion now, for another tracker to go on from."""
        return MotionState(*self._state.arm, self._state.a)

    @property
    def scene(self) -> Scene | None:
        """What the arm is kept clear of, obstacles where they first stood; None where nothing is kept apart."""
        return self._state.scene

    @property
    def summary(self) -> TrackerSummary:
        """How often what happened since the last `reset`."""
        return self._tally.summary()

    def reset(self, q: ArrayLike | None = None, *, v: ArrayLike | None = None) -> None:
        """Put the arm somewhere.

        Obstacles go back to where the scene has them, unless the motion goes on.

        Args:
            q: (dof,) configuration [rad]; None for the robot's home. A joint past its limit by at most 1e-6 rad is put
                on the limit, as is one of a motion that goes on within the limits; one that is farther past it comes
                back within it and moves no farther out.
            v: (dof,) its velocity [rad/s], at most the limits. None lets a motion that is under way go on where no
                joint is farther than 0.05 rad from where the tracker has it, as a measured configuration is; elsewhere
                the arm stands still.

        Raises:
            InvalidInputError: malformed, or faster than the limits; the tracker stays as it was.
        """
        start = checked_start(self.robot, q, outside=True)
        before: TrackerState | None = getattr(self, "_state", None)
        if v is not None:
            speed = checked_velocity(self.robot, v, self.velocity_limit)
            before = None
        elif before is not None and q is not None and bool((np.abs(start - before.arm.q) <= NEARBY).all()):
            speed = before.arm.v
        else:
            speed, before = np.zeros(self.robot.dof), None
        if before is not None:
            # Where the arm was sent within its limits, what is measured beyond them is noise, and is not kept.
            start = checks.read_only(self._limits.move(before.arm.q, start - before.arm.q))
            distances = before.distances
            if before.guard is not None and before.where is not None and distances is not None:
                before.guard.put(before.where)
                distances = before.guard.move(start, distances, start - before.arm.q)
            arm = JointState(start, checks.read_only(speed))
            state = before._replace(arm=arm, distances=distances, can_stop=False)
        else:
            guard, where, distances = self._guard, None, None
            if guard is not None:
                where = guard.shapes.start
                guard.put(where)
                distances = guard.start(start)
            still = checks.read_only(np.zeros(self.robot.dof))
            state = TrackerState(
                arm=JointState(start, checks.read_only(speed)),
                a=still,
                distances=distances,
                guard=guard,
                scene=self._scene,
                where=where,
                can_stop=v is None,
                error=np.inf,
                growing=0,
                asked=None,
                line=None,
            )
            self._tally = StepTally()
        self._state = state

    def step(
        self,
        target: pin.SE3 | ArrayLike | TrackingTarget | Sequence[TrackingTarget] | None = None,
        *,
        twist: ArrayLike | None = None,
        reference: str = "local_world_aligned",
        obstacles: Mapping[str, Motion | None] | None = None,
        budget: float | None = None,
    ) -> TrackerStep:
        """One tick towards a target, or along a twist.

        Args:
            target: T_base_tool as `pin.SE3` or (4, 4), a position (3,) [m], or targets from `jacokin.motion`.
            twist: (6,) velocity of the tool, linear [m/s] then angular [rad/s]; instead of a target. It is followed in
                its direction and never exceeded; where the arm cannot, it goes slower.
            reference: where the twist is expressed: "local_world_aligned", "local" or "world".
            obstacles: where obstacles are now, by name: T_base_shape, a position (3,) [m], or an obstacle as of a
                scene, which is a new one, or takes the place of the one of its name; or a tuple of any of these and
                the twist (6,): velocity of the shape's origin [m/s], then angular velocity [rad/s], in base axes.
                Without a twist it stands still. None takes an obstacle away. Those that are not named go on as they
                moved.
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
        limit = math.inf if budget is None else checks.positive("budget", budget, "s")
        state = self._state if obstacles is None else self._around(self._state, obstacles)
        deadline = began + limit - RESERVE
        if twist is not None:
            after, step = self._follow(state, twist, reference, began, deadline)
        else:
            after, step = self._approach(state, self._targets.tasks(target), began, deadline)
        self._state = after  # one assignment: an interrupt leaves the old state or the new one
        self._tally.add(step, limit)
        return step

    def brake(self, *, obstacles: Mapping[str, Motion | None] | None = None) -> TrackerStep:
        """One tick of braking as hard as the limits allow, towards nothing: OK once the arm stands still.

        Without acceleration limits it stands at once.

        Args:
            obstacles: as in `step`.
        """
        began = time.perf_counter()
        state = self._state if obstacles is None else self._around(self._state, obstacles)
        after, step = self._brake(state, None, self._targets.nothing, began)
        self._state = after
        self._tally.add(step, math.inf)
        return step

    def measure(self, target: pin.SE3 | ArrayLike | TrackingTarget | Sequence[TrackingTarget]) -> TrackerStep:
        """How far the tool is from a target, without moving; errors as `step`."""
        began, state, tasks = time.perf_counter(), self._state, self._targets.tasks(target)
        self._qp.reset()
        found = self._ticks.measure(state.arm.q, state.arm, tasks, goes=False)
        return self._end(state, found, state.distances, began, excused=False)[1]

    def __repr__(self) -> str:
        """Robot, frame and control step."""
        return f"Tracker({self.robot.name!r}, frame={self.frame!r}, dt={self.dt:g})"

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Unpickled arrays are writable until told otherwise."""
        self.__dict__.update(state)
        now = self._state
        for array in (*now.arm, now.a, self.velocity_limit, self.acceleration_limit):
            array.setflags(write=False)

    def _around(self, state: TrackerState, obstacles: Mapping[str, Motion | None]) -> TrackerState:
        """The state with the obstacles where they are told to be now."""
        if state.guard is None or state.where is None or state.scene is None:
            raise InvalidInputError("obstacles has no effect without a scene: nothing is kept apart")
        given = checks.mapping("obstacles", obstacles, "a dict of poses by name")
        news = state.guard.shapes.sorted(given)
        if news.leaving:
            state = self._in_scene(state, state.scene.changed(news.leaving, news.coming))
        assert state.guard is not None
        assert state.where is not None
        return state._replace(where=state.guard.shapes.told(state.where, news.motions)) if news.motions else state

    def _in_scene(self, state: TrackerState, scene: Scene) -> TrackerState:
        """The state among other obstacles; those that were there before go on as they moved."""
        guard, before = self._make_guard(scene=scene), state.guard
        assert guard is not None
        assert before is not None
        assert state.where is not None
        where = guard.shapes.carried(before.shapes, state.where)
        guard.put(where)
        assert state.distances is not None
        distances = guard.start(state.arm.q, guard.carried(before, state.distances))
        return state._replace(guard=guard, scene=scene, where=where, distances=distances, can_stop=False)

    def _approach(
        self, state: TrackerState, tasks: Tasks, began: float, deadline: float
    ) -> tuple[TrackerState, TrackerStep]:
        """A tick towards targets: the state after it."""
        self._qp.reset()
        state, places, contacts = self._look(state)
        try:
            return self._solve(state, contacts, tasks, began, deadline)
        except OutOfTime:
            return self._brake(state, places, tasks, began)

    def _follow(
        self, state: TrackerState, twist: ArrayLike, reference: str, began: float, deadline: float
    ) -> tuple[TrackerState, TrackerStep]:
        """A tick along a twist: the state after it."""
        kinematics = self._kinematics
        kinematics.move_to(state.arm.q)
        tool = kinematics.pose(kinematics.tool).homogeneous
        line = state.line
        if line is None:
            velocity = kinematics.jacobian(kinematics.tool, IN_BASE).dot(state.arm.v)
            line = TwistLine(tool, velocity)
        off = missing(line.pose, tool)
        if is_astray(off):
            line, off = line._replace(pose=tool), np.zeros(6)
        wanted = in_base_axes(twist, reference, line.pose)
        goal = self._targets.tasks(moved(line.pose, wanted, self.dt))
        self._qp.reset()
        state, places, contacts = self._look(state)
        try:
            if self._ticks.linearise(state.arm, goal):  # shapes are moved apart first
                after, step = self._solve(state, contacts, goal, began, deadline)
                return after._replace(asked=None, line=None), step
            self._twists.ask(line, off, wanted, state.arm.q, self._wish(state.arm.q))
            self._ticks.go(FROM_TWIST, deadline, can_stop=state.can_stop)
        except OutOfTime:
            return self._brake(state, places, goal, began)
        along = self._twists.found(line)
        found = self._ticks.report(ON_TARGET if along.is_followed else SOLVED, None)
        return self._end(state, found, self._found(state, contacts), began, along=along)

    def _look(self, state: TrackerState) -> tuple[TrackerState, MovedObstacles, Contacts]:
        """Have the kernel know what is near at the end of the tick; with the state there, and what is in contact.

        Distances are measured anew where obstacles moved or there was no time for it.
        """
        guard, distances = state.guard, state.distances
        if guard is None or distances is None:
            self._ticks.among(None)
            return state, NO_OBSTACLES, NO_CONTACTS
        where, shift = places = self._move_obstacles(state)
        if shift is not None or not distances.measured:
            distances = guard.refresh(state.arm.q, distances, shift)
        if where is not state.where or distances is not state.distances:
            state = state._replace(distances=distances, where=where)
        self._ticks.among(guard.work)
        return state, places, guard.take(distances)

    def _move_obstacles(self, state: TrackerState) -> MovedObstacles:
        """Put the obstacles where they are at the end of the tick."""
        guard = state.guard
        if guard is None or state.where is None:
            return NO_OBSTACLES
        before = self._state.where if self._state.guard is guard else state.where
        assert before is not None
        where = state.where.after(self.dt)
        guard.put(where)
        return MovedObstacles(where, None if where.poses is before.poses else guard.shapes.travel(before, where))

    def _solve(
        self, state: TrackerState, contacts: Contacts, tasks: Tasks, began: float, deadline: float
    ) -> tuple[TrackerState, TrackerStep]:
        """A tick towards targets whose distances are known."""
        ticks, held = self._ticks, ""
        wish = self._wish(state.arm.q) if self._objectives else None
        ticks.ask(state.arm, tasks, state.asked, refined=wish is not None)
        outcome = ticks.go(WHOLE, deadline, can_stop=state.can_stop)
        while outcome > ON_TARGET:
            stage = FROM_STEP
            if outcome == NEEDS_QP:
                try:
                    ticks.use_qp(self._qp)
                    stage = FROM_TOTAL
                except QPFailed:
                    ticks.step[:], held = 0.0, "no QP solver solved this tick"
            if stage == FROM_STEP and not held and (wish is not None or tasks.number > tasks.first):
                later = [Level(*level) for level in ticks.later(tasks)]
                if wish is not None:
                    later.append(Level(np.eye(self.robot.dof), wish, ends_there=False))
                ticks.step[:] = refine(ticks.step.copy(), ticks, later, self._limits, self._qp)
            outcome = ticks.go(stage, deadline, can_stop=state.can_stop)
        found, apart = ticks.report(outcome, tasks), ()
        if found.apart and state.distances is not None:
            apart = state.distances.near[ticks.apart].tolist()
        if held and found.asked is not None:
            found = found._replace(asked=found.asked._replace(is_aimed=False))
        elif found.grew:
            held = "every step makes the error grow"
        # Shapes moving apart, or joints still gathering speed, may take the tool away from its target for a while.
        excused = bool(apart) or found.is_slowed
        distances = self._found(state, contacts)
        return self._end(state, found, distances, began, excused=excused, held=held, apart=apart)

    def _wish(self, q: Array) -> Array | None:
        """The displacement (dof,) [rad] that the objectives want in a tick at `q` (dof,) [rad]; None without any."""
        if not self._objectives:
            return None
        return wished(self.robot, self.frame, q, self._objectives, self._limits.step, self.dt)

    def _brake(
        self,
        state: TrackerState,
        moved: MovedObstacles | None,
        tasks: Tasks,
        began: float,
    ) -> tuple[TrackerState, TrackerStep]:
        """A tick of braking: because it was asked for, with `moved` None, or because time ran out."""
        late = moved is not None
        where, shift = self._move_obstacles(state) if moved is None else moved
        arm, distances, can_stop = state.arm, state.distances, state.can_stop
        q = self._limits.move(arm.q, self._limits.brake(arm.v))
        if state.guard is not None and distances is not None:
            distances = state.guard.unmeasured(distances, q - arm.q, shift)
            distances = distances if late else state.guard.refresh(q, distances, None)
            can_stop = state.can_stop and shift is None
        found = self._ticks.measure(q, arm, tasks, goes=True)._replace(can_stop=can_stop)
        if not tasks.number:
            found = found._replace(on_target=found.fastest < STILL)
        return self._end(state._replace(where=where), found, distances, began, late=late)

    def _found(self, state: TrackerState, contacts: Contacts) -> Distances | None:
        """The distances where the kernel has moved the arm to; None where nothing is kept apart."""
        return None if state.guard is None or state.distances is None else state.guard.found(contacts)

    def _end(
        self,
        before: TrackerState,
        found: Report,
        distances: Distances | None,
        began: float,
        *,
        excused: bool = True,
        held: str = "",
        apart: Sequence[int] = (),
        along: TwistStep | None = None,
        late: bool = False,
    ) -> tuple[TrackerState, TrackerStep]:
        """The state after a tick, and what is said about it.

        Args:
            before: the state that it started from.
            found: what it has come to.
            distances: there; None where nothing is kept apart.
            began: when, by `time.perf_counter` [s].
            excused: whether the error may grow.
            held: why the arm stands, if it does.
            apart: numbers of the pairs of shapes that move apart.
            along: the step along a twist; None for other targets.
            late: whether the time budget ran out.
        """
        arm, a, position, orientation, error, fastest, past, on_target, singular, can_stop, _, _, _, asked = found
        guard, growing = before.guard, 0
        if not (excused or on_target) and error > before.error + GROWTH:
            growing = before.growing + 1
        line = None if along is None else along.line
        after = TrackerState(
            arm, a, distances, guard, before.scene, before.where, can_stop, error, growing, asked, line
        )
        status, limiting, message = TrackerStatus.OK, NOTHING_LIMITS, ""
        if late or not on_target:
            limiting = self._limits.names(self._ticks.reached)
            if late:
                limiting = (TIME_BUDGET, *limiting)
            if guard is not None and distances is not None:
                limiting += tuple(guard.limiting(distances, apart))
            if along is not None and along.cause and along.cause not in limiting:
                limiting += (along.cause,)
            if singular:
                limiting += (SINGULAR_POSE,)
            if late:
                status, message = TrackerStatus.LATE, "the time budget ran out, so the arm brakes"
            elif growing * self.dt >= GROWTH_TIME:
                status, message = TrackerStatus.LOST, f"the error has grown for {growing * self.dt:.2f} s"
            elif fastest < STILL:
                status, message = TrackerStatus.HELD, held or "the arm has come as near as it can"
            else:
                status = TrackerStatus.LIMITED
                message = f"slowed by {', '.join(limiting) or 'damping near a singular pose'}"
        if past > LIMIT_SNAP:
            message += self._limits.outside(arm.q)
        if guard is not None and distances is not None:
            message += guard.staying(distances)
        least = None if distances is None else distances.least
        used, elapsed = self._qp.used, time.perf_counter() - began
        step = TrackerStep(
            arm.q, arm.v, status, position, orientation, limiting, least, used, message.removeprefix("; "), elapsed
        )
        return after, step
