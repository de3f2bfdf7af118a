"""`KinovaDriver`: what kinova-ros' driver and the arm's base do with what clients send. Read this file first.

No ROS is in here. It is read from the source of kinova-ros (commit 924781d, 2023) and its README; files are named where
they tell. It was never compared with a real arm. Angles are in radians here; the node of ROS converts.

The base keeps a queue and takes one velocity each 10 ms, or goes to the target in front until it is there. Goals of
FollowJointTrajectory are played in an open loop, a velocity a tick; one that is cancelled kills the driver. Under
torque control it takes torques or forces instead, and forgets the queue.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.angles import nearest_copy, wrap_to_pi
from jacokin.model.poses import checked_pose
from jacokin.motion.tracking.tracker import Tracker
from jacokin.twin.arm import BRAKING, ArmController, ArmState, GoalStatus, Record, SimulatedArm, TwinGoal
from jacokin.twin.faults import TICK, Faults

TURNS = 6800.0  # of a finger's motor from open to closed (kinova_arm.cpp, cartesianVelocityWithFingersCallback)
PERIOD = 0.1  # [s] in which actions look at the arm, rate_hz, and in which the state is published
REACHED = 1e-3  # [rad], [m] a target in the queue this near is reached

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class JointVelocityCommand:
    """Turn the joints for a tick: (dof,) [rad/s]."""

    v: Array


@dataclass(frozen=True, slots=True, eq=False)
class ToolVelocityCommand:
    """Move the tool for a tick: twist (6,) in base axes [m/s, rad/s]; fingers (k,) [rad/s], None for as they are."""

    twist: Array
    fingers: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class JointTargetCommand:
    """Go to (dof,) angles [rad]."""

    q: Array


@dataclass(frozen=True, slots=True, eq=False)
class JointTorqueCommand:
    """Push the joints, under torque control: (dof,) [N m]."""

    torques: Array


@dataclass(frozen=True, slots=True, eq=False)
class ToolForceCommand:
    """Push the tool, under torque control: wrench (6,) in base axes, force first [N, N m]."""

    wrench: Array


Command = JointVelocityCommand | ToolVelocityCommand | JointTargetCommand
Push = JointTorqueCommand | ToolForceCommand


@dataclass(slots=True, eq=False)
class Watch:
    """How an action of the driver looks at its goal: near to it, or without motion for so long."""

    read: Callable[[ArmState], Array]
    target: Array
    tolerance: Array
    """Nearer than this in all entries is there."""
    threshold: float
    """More than this in any entry is motion."""
    patience: float
    """Without motion for so long, the goal is aborted [s]."""
    turns: bool = False
    """Whether it reads angles, which are compared up to whole turns (isCloseToOther in kinova_ros_types.cpp)."""
    seen: Array = field(init=False)
    since: float = field(init=False)

    def distance(self, one: Array, other: Array) -> Array:
        """How far two readings are apart in each entry."""
        return np.abs(wrap_to_pi(one - other) if self.turns else one - other)


@dataclass(slots=True, eq=False)
class Playing:
    """A trajectory that is played."""

    goal: TwinGoal
    times: Array
    velocities: Array
    index: int = 0
    begun: float = 0.0
    """When the controller got it [s]."""
    heard: float | None = None
    """When the action first heard of the controller after that, from which it counts the time [s]."""


class TorqueControl:
    """The mode in which the base takes torques instead of velocities (README of kinova-ros).

    The base holds the arm against gravity; torques come on top of that. Without one for 0.25 s they are zero. A joint
    that becomes too fast, or could no longer stop before its limit, takes the arm back to where positions are held.

    Attributes:
        is_on: whether it is in that mode.
        safety_factor: share of the velocity limits at which it leaves the mode, torque_parameters/safety_factor.
    """

    def __init__(self, arm: SimulatedArm) -> None:
        """Of an arm; off."""
        self.is_on, self.safety_factor = False, 1.0
        self._arm = arm
        self._torques = np.zeros(arm.robot.dof)
        self._heard = -np.inf

    def turn(self, *, on: bool) -> None:
        """Go into the mode, or out of it: then the arm stands as soon as it can."""
        if self.is_on and not on:
            self._arm.hold()
        self.is_on, self._heard = on, -np.inf

    def take(self, torques: Array) -> None:
        """Torques (dof,) came [N m]."""
        self._torques, self._heard = torques, self._arm.state.time

    def take_force(self, wrench: Array) -> None:
        """A wrench (6,) at the tool came, in base axes, force first [N, N m]."""
        robot = self._arm.robot
        self.take(robot.jacobian(self._arm.state.q, frame="end_effector").T @ wrench)

    def tick(self) -> None:
        """Simulate a tick of the mode."""
        arm = self._arm
        is_silent = arm.state.time - self._heard > 0.25  # [s] (README, torque inactivity)
        arm.tick_torques(np.zeros_like(self._torques) if is_silent else self._torques)
        too_fast = np.abs(arm.state.v) > self.safety_factor * arm.robot.velocity_limit
        if too_fast.any() or not arm.can_stop():
            self.turn(on=False)


class KinovaDriver(ArmController[Command | Push]):
    """The driver and the base of an arm, a tick after the other. Several threads may call it.

    Attributes:
        arm: that it moves.
        died: why the driver has died, as the real one would; empty while it lives.
        is_stopped: whether the service `stop` forbids motion.
        torque_control: the mode of the base in which it takes torques.
        T_end_effector_tool: the tool, which `set_end_effector_offset` moves.
    """

    def __init__(self, arm: SimulatedArm, *, faults: Faults | None = None, seed: int = 0) -> None:
        """Drive an arm.

        Args:
            arm: to drive.
            faults: what goes wrong; None for nothing.
            seed: from which faults are drawn.
        """
        super().__init__(arm, faults, seed)
        self.died, self.is_stopped = "", False
        self.torque_control = TorqueControl(arm)
        self.T_end_effector_tool = pin.SE3.Identity()
        self._queue: deque[Command] = deque(maxlen=2000)  # velocities that the base keeps (README)
        self._speed = np.full(arm.robot.dof, np.radians(20.0))  # where jointSpeedLimitParameter is not set
        self._tracker = Tracker(arm.robot, dt=TICK, q=arm.state.q, acceleration_limit=np.inf)
        self._is_tracking = False
        self._limits = arm.robot.lower, arm.robot.upper
        self._solver = IKSolver(arm.robot, collision="ignore")
        self._watches: dict[TwinGoal, Watch] = {}
        self._playing: Playing | None = None
        self._ticks = 0

    def set_joint_speed(self, speed: ArrayLike) -> None:
        """Set the speeds (dof,) of `go_to_angles` and `home` [rad/s], jointSpeedLimitParameter1 and 2.

        Raises:
            InvalidInputError: not so many positive numbers.
        """
        speeds = checks.positive_vector("speed", speed, self.arm.robot.dof, "rad/s")
        with self._lock:
            self._speed = speeds

    @property
    def state(self) -> ArmState:
        """What the driver knows of the arm, late by the lag."""
        with self._lock:
            return self._line.measured

    def tell(self) -> ArmState | None:
        """What the driver publishes now, None where faults or its death take that."""
        with self._lock:
            return None if self.died else super().tell()

    def record(self) -> Record:
        """What was done until now."""
        with self._lock:
            return replace(super().record(), waiting=len(self._queue))

    def tool_pose(self, q: Array) -> pin.SE3:
        """T_base_tool at angles (dof,) [rad]."""
        return self.arm.robot.forward_kinematics(q) * self.T_end_effector_tool

    def set_end_effector_offset(self, offset: ArrayLike | None) -> None:
        """`in/set_end_effector_offset`: move the tool (3,) along the axes of the end effector [m]; None: back there.

        Raises:
            InvalidInputError: not so many finite numbers.
        """
        moved = np.zeros(3) if offset is None else checks.vector("offset", offset, 3, "m")
        with self._lock:
            self.T_end_effector_tool = pin.SE3(np.eye(3), moved)

    def set_torque_control(self, *, on: bool) -> None:
        """`in/set_torque_control_mode`: take torques and forces; or hold positions, and take what moves there.

        Raises:
            InvalidInputError: neither True nor False.
        """
        checks.flag("on", on)
        with self._lock:
            if not self.died:
                self._last = self.arm.state.time
                self._clear()
                self.torque_control.turn(on=on)

    def joint_torque(self, torques: ArrayLike) -> None:
        """`in/joint_torque`: torques (dof,), on top of what holds the arm [N m].

        Raises:
            InvalidInputError: not so many finite numbers.
        """
        self._push(JointTorqueCommand(checks.vector("torques", torques, self.arm.robot.dof, "N m")))

    def tool_force(self, wrench: ArrayLike) -> None:
        """`in/cartesian_force`: a wrench (6,) at the tool, in base axes, force first [N, N m].

        Raises:
            InvalidInputError: not so many finite numbers.
        """
        self._push(ToolForceCommand(checks.vector("wrench", wrench, 6, "N, N m")))

    def _push(self, command: Push) -> None:
        with self._lock:
            if not (self.died or self.is_stopped):
                self._last = self.arm.state.time
                self._line.send(command)

    def finger_turns(self, fingers: Array) -> Array:
        """Angles of fingers (k,) [rad] as the driver counts them, 0 open, 6800 closed.

        Raises:
            InvalidInputError: not numbers, or more than 1e6 rad.
        """
        angles = checks.array("fingers", fingers, "numbers of at most 1e6", "rad")
        if (np.abs(angles) > 1e6).any():  # their turns may overflow
            raise checks.refusal("fingers", "numbers of at most 1e6", fingers, "rad")
        lower, upper = self.arm.finger_range
        return np.asarray((angles - lower) / (upper - lower) * TURNS)

    def finger_angles(self, turns: Array) -> Array:
        """Angles of fingers (k,) [rad] of turns as the driver counts them: the inverse of `finger_turns`.

        Raises:
            InvalidInputError: not numbers.
        """
        lower, upper = self.arm.finger_range
        return np.asarray(lower + checks.array("turns", turns, "numbers") / TURNS * (upper - lower))

    def joint_velocity(self, v: ArrayLike) -> None:
        """`in/joint_velocity`: velocities (dof,) for a tick [rad/s].

        Raises:
            InvalidInputError: not so many finite numbers.
        """
        self._send(JointVelocityCommand(checks.vector("v", v, self.arm.robot.dof, "rad/s")))

    def tool_velocity(self, twist: ArrayLike, fingers: ArrayLike | None = None) -> None:
        """`in/cartesian_velocity`: a velocity of the tool for a tick.

        Args:
            twist: (6,) in base axes, linear first [m/s, rad/s].
            fingers: (k,) velocities of the fingers [rad/s]; None to leave them alone.

        Raises:
            InvalidInputError: not so many finite numbers.
        """
        speeds = None if fingers is None else checks.vector("fingers", fingers, len(self.arm.state.fingers), "rad/s")
        self._send(ToolVelocityCommand(checks.vector("twist", twist, 6, "m/s, rad/s"), speeds))

    def _send(self, command: Command) -> None:
        with self._lock:
            if not (self.died or self.is_stopped):
                self._send_velocity(command)

    def go_to_angles(self, q: ArrayLike) -> TwinGoal:
        """`joints_action/joint_angles`: go to angles (dof,) [rad], as they are, with their whole turns.

        Raises:
            InvalidInputError: not so many finite numbers.
        """
        q = checks.vector("q", q, self.arm.robot.dof, "rad")
        return self._go(
            JointTargetCommand(q),
            Watch(
                read=lambda state: state.q,
                target=q,
                tolerance=np.full(len(q), np.radians(2.0)),
                threshold=np.radians(1.0),
                patience=0.5,
                turns=True,
            ),
        )

    def go_to_pose(self, pose: pin.SE3 | ArrayLike) -> TwinGoal:
        """`pose_action/tool_pose`: take the tool to T_base_tool, or as near as it comes, after what is in the queue.

        The joints go together to the nearest configuration; the real base leads the tool in a line.

        Raises:
            InvalidInputError: malformed pose.
        """
        target = checked_pose(pose, "pose")

        def read(state: ArmState) -> Array:
            """Translation [m] and rotation vector [rad] from the tool to the target, in base axes."""
            tool = self.tool_pose(state.q)
            return np.concatenate((target.translation - tool.translation, pin.log3(target.rotation @ tool.rotation.T)))

        return self._go(
            self._at_pose(target),
            Watch(
                read=read,
                target=np.zeros(6),
                tolerance=np.array([0.01] * 3 + [np.radians(2.0)] * 3),
                threshold=0.005,
                patience=1.0,
            ),
            clears=False,
        )

    def add_pose(self, pose: pin.SE3 | ArrayLike) -> None:
        """`in/add_pose_to_Cartesian_trajectory`: take the tool to T_base_tool after what is in the queue.

        Raises:
            InvalidInputError: malformed pose.
        """
        target = checked_pose(pose, "pose")
        with self._lock:
            if not (self.died or self.is_stopped):
                self._last = self.arm.state.time
                self._queue.append(self._at_pose(target))

    def _at_pose(self, T_base_tool: pin.SE3) -> JointTargetCommand:
        """The configuration nearest to that of the last target in the queue, or to that of the arm."""
        with self._lock:
            last = next(
                (each.q for each in reversed(self._queue) if isinstance(each, JointTargetCommand)), self.state.command
            )
            target = T_base_tool * self.T_end_effector_tool.inverse()
            return JointTargetCommand(self._solver.solve(target, seed=last.clip(*self._limits)).q)

    def move_fingers(self, turns: ArrayLike) -> TwinGoal:
        """`fingers_action/finger_positions`: move fingers to (k,) turns of their motors; clears the queue.

        Raises:
            InvalidInputError: not so many finite numbers.
        """
        turns = checks.vector("turns", turns, len(self.arm.state.fingers), "turns")
        goal = self._go(
            None,
            Watch(
                read=lambda state: self.finger_turns(state.fingers),
                target=turns,
                tolerance=np.full(len(turns), 64.0),
                threshold=1.0,
                patience=0.5,
            ),
        )
        if not goal.has_ended:
            self.arm.move_fingers(self.finger_angles(turns))
        return goal

    def _go(self, command: Command | None, watch: Watch, *, clears: bool = True) -> TwinGoal:
        """Go there, after the queue, or at once if it clears that (the arguments `push` of kinova_comm.h)."""
        with self._lock:
            goal = TwinGoal()
            if self.died or self.is_stopped:
                goal.end(GoalStatus.ABORTED, self.died or "the arm is stopped: call in/start")
                return goal
            if clears:
                self._clear()
            self._goals += 1
            logger.info("a goal")
            self._last = watch.since = self.arm.state.time
            watch.seen = watch.read(self.state)
            if command is not None:
                self._queue.append(command)
            self._watches[goal] = watch
            return goal

    def home(self) -> TwinGoal:
        """`in/home_arm`: the joints to the home configuration, by the short way, then the fingers open."""
        arm = self.arm
        with self._lock:
            goal = self.go_to_angles(nearest_copy(arm.robot.home, arm.state.q, arm.robot.unlimited))
            if goal in self._watches:
                watch = self._watches[goal]
                watch.tolerance, watch.threshold = np.full(arm.robot.dof, 2.0 * REACHED), REACHED
                arm.move_fingers(np.full(len(arm.state.fingers), arm.finger_range[0]))
            return goal

    def follow(self, times: ArrayLike, velocities: ArrayLike) -> TwinGoal:
        """`follow_joint_trajectory`: play the velocities of points, one a tick, in an open loop.

        A goal while another one is active kills the driver, as does an empty one.

        Args:
            times: (n,) from the start [s].
            velocities: (n, dof) in the order in which they came, whatever their names [rad/s].

        Raises:
            InvalidInputError: not so many rows of so many joints, or not finite.
        """
        at, rows = (
            checks.array("times", times, "numbers", "s"),
            checks.array("velocities", velocities, "rows of numbers"),
        )
        at = checks.vector("times", at, at.size, "s")
        if rows.size:
            rows = checks.matrix("velocities", rows, self.arm.robot.dof, "rad/s")
        if len(rows) and len(rows) != len(at):
            raise InvalidInputError(f"velocities must have shape ({len(at)}, {self.arm.robot.dof})")
        with self._lock:
            goal = TwinGoal()
            if self.died:
                goal.end(GoalStatus.ABORTED, self.died)
            elif self._playing is not None and not self._playing.goal.has_ended:
                self.cancel(self._playing.goal)
                goal.end(GoalStatus.ABORTED, self.died)
            elif not len(rows):
                self._die("an empty trajectory")
                goal.end(GoalStatus.ABORTED, self.died)
            else:
                logger.info("a trajectory of %d points, %.2f s", len(rows), at[-1])
                self._goals += 1
                self._last = self.arm.state.time
                # What is still played is replaced, its index is not.
                index = 0 if self._playing is None else self._playing.index
                self._playing = Playing(goal, at, rows, index, begun=self.arm.state.time)
            return goal

    def cancel(self, goal: TwinGoal) -> None:
        """Cancel a goal: the queue is emptied; a trajectory that is played kills the driver (issue 191).

        Raises:
            InvalidInputError: it is no goal of this driver; nothing has changed.
        """
        checks.instance("goal", goal, TwinGoal, "a TwinGoal")
        with self._lock:
            if goal.has_ended:
                return
            is_played = self._playing is not None and self._playing.goal is goal
            if not is_played and goal not in self._watches:
                raise InvalidInputError("goal is one of another driver")
            goal.end(GoalStatus.CANCELLED)
            self._last = self.arm.state.time
            if is_played:
                self._die("a goal of follow_joint_trajectory was cancelled")
            else:
                self._watches.pop(goal)
                self._clear()

    def stop(self) -> None:
        """`in/stop`: empty the queue, and take nothing until `start`."""
        with self._lock:
            self.is_stopped = True
            self._last = self.arm.state.time
            self._clear()

    def start(self) -> None:
        """`in/start`: take commands again."""
        with self._lock:
            self.is_stopped = False

    def clear_trajectories(self) -> None:
        """`in/clear_trajectories`: empty the queue."""
        with self._lock:
            self._last = self.arm.state.time
            self._clear()

    def _clear(self) -> None:
        self._queue.clear()
        self._line.clear()
        self._is_tracking = False

    def _die(self, why: str) -> None:
        """Be as the driver after it read the first point of a trajectory that has none; the base goes on by itself."""
        self.died = f"the driver died, as kinova-ros' does (issue 191): {why}"
        for goal in self._watches:
            goal.end(GoalStatus.ABORTED, self.died)
        self._watches.clear()
        self._playing = None

    def tick(self) -> None:
        """Let 10 ms pass."""
        with self._lock:
            if self._playing is not None:
                self._play(self._playing)
            for command in self._line.arrived():
                self._take(command)
            if self.torque_control.is_on and not self.is_stopped:
                self._queue.clear()
                self.torque_control.tick()
            else:
                self.arm.tick(self._next_velocity())
            self._line.tick(self.arm.state)
            self._ticks += 1
            if self._ticks % round(PERIOD / TICK) == 0:
                self._look()

    def _take(self, command: Command | Push) -> None:
        """Take what arrives at the base."""
        if isinstance(command, JointTorqueCommand):
            self.torque_control.take(command.torques)
        elif isinstance(command, ToolForceCommand):
            self.torque_control.take_force(command.wrench)
        else:
            self._queue.append(command)

    def _play(self, playing: Playing) -> None:
        """Send the velocity of a point, until its time has come (kinova_joint_trajectory_controller.cpp)."""
        now = self.arm.state.time
        if playing.index < len(playing.times):
            self._send(JointVelocityCommand(playing.velocities[playing.index]))
            if now - playing.begun + TICK >= playing.times[playing.index] - TICK / 2.0:
                playing.index += 1
        elif playing.goal.has_ended:
            self._playing = None

    def _next_velocity(self) -> Array:
        """Velocities (dof,) of the joints for this tick, by what is in front of the queue [rad/s]."""
        still = np.zeros(self.arm.robot.dof)
        if self.is_stopped or not self._queue:
            self._is_tracking = False
            return still
        command = self._queue[0]
        if isinstance(command, JointVelocityCommand):
            self._queue.popleft()
            self._is_tracking = False
            return command.v
        if isinstance(command, ToolVelocityCommand):
            self._queue.popleft()
            if command.fingers is not None:
                self.arm.turn_fingers(command.fingers)
            if not self._is_tracking:
                self._tracker.reset(np.clip(self.arm.state.command, *self._limits))
                self._is_tracking = True
            return self._tracker.step(twist=self._at_end_effector(command.twist)).v
        self._is_tracking, self._last = False, self.arm.state.time
        way = command.q - self.arm.state.command
        farthest = np.abs(way)
        if farthest.max() < REACHED:
            self._queue.popleft()
            return way / TICK
        speeds = np.minimum(self._speed, np.sqrt(BRAKING * farthest))  # as joints stop, half as hard as they could
        moves = farthest > REACHED
        return np.asarray(way * min(1.0 / TICK, (speeds[moves] / farthest[moves]).min()))  # all together

    def _at_end_effector(self, twist: Array) -> Array:
        """The twist (6,) of the end effector, where the tool has this one."""
        rotation = self.arm.robot.forward_kinematics(self.arm.state.q).rotation
        lever = rotation @ self.T_end_effector_tool.translation
        return np.concatenate([twist[:3] - np.cross(twist[3:], lever), twist[3:]])

    def _look(self) -> None:
        """Look how goals stand, 10 times a second."""
        state = self._line.measured
        for goal, watch in list(self._watches.items()):
            self._look_at(goal, watch, state)
        playing = self._playing
        if playing is None or playing.goal.has_ended or self._line.is_dead:
            return
        if playing.heard is None:
            playing.heard = state.time
        elif state.time - playing.heard > playing.times[-1]:
            # joint_trajectory_action_server.cpp: any end is reached, if the joints stand; without more patience. Even
            # then the controller plays on, if it is behind.
            if np.abs(state.v).max() > 0.01:  # [rad/s] stopped_velocity_tolerance of joint_trajectory_action_server.cpp
                playing.goal.end(GoalStatus.ABORTED, "wound up outside the goal constraints")
            else:
                playing.goal.end(GoalStatus.SUCCEEDED)

    def _look_at(self, goal: TwinGoal, watch: Watch, state: ArmState) -> None:
        now = watch.read(state)
        if self.is_stopped:
            goal.end(GoalStatus.ABORTED, "the arm was stopped")
        elif (watch.distance(now, watch.target) < watch.tolerance).all():
            goal.end(GoalStatus.SUCCEEDED)
        elif (watch.distance(now, watch.seen) > watch.threshold).any():
            watch.seen, watch.since = now, state.time
        elif state.time - watch.since > watch.patience:
            goal.end(GoalStatus.ABORTED, f"nothing has moved for {watch.patience:g} s")
            self._clear()
        if goal.has_ended:
            del self._watches[goal]
