"""`SimulatedArm`: MuJoCo's arm and hand behind the velocities that an arm's own base takes, a tick after the other.

`ArmController` is what the drivers of both versions of ROS have in common, with their `TwinGoal` and their `Record`.
"""

from __future__ import annotations

import logging
import threading
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Generic

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks
from jacokin.model.descriptions import bundled
from jacokin.model.loading import load_robot
from jacokin.model.robot import limit_margins
from jacokin.mujoco_bridge import Arena, JacoArm, Physics, observations, robots
from jacokin.twin.faults import TICK, Command, Faults, Line

if TYPE_CHECKING:
    from jacokin.tasks import Task


LEAD = 0.1  # [rad] how far the reference may be ahead of an arm that something holds
BRAKING = 2.0  # [rad/s^2] towards a limit: what the weakest motors hold, `acceleration` of urdf/jaco.toml
STOPPING = 4.0  # [rad/s^2] of joints that are to stand: what motors, friction and damping do together
IDLE = 3  # ticks without a velocity, after which a joint is to stand: one of them may have got lost
GAIN = 40.0  # [1/s] of a joint near its reference, at most; the motors follow within 10 ms
MARGIN = 5e-3  # [rad] by which the reference keeps off a limit: an arm at full speed passes it by 2e-3
MOVING = 0.02  # [rad/s] a faster joint moves
FINGER_SPEED = 1.0  # [rad/s] Kinova's: a hand closes in 1.2 s


@dataclass(frozen=True, slots=True, eq=False)
class ArmState:
    """What an arm measures. Arrays are read-only."""

    time: float
    """Simulated [s]."""
    q: Array
    """(dof,) angles [rad], with the whole turns of joints without limits."""
    v: Array
    """(dof,) velocities [rad/s]."""
    torques: Array
    """(dof,) about the joint axes, with what holds the arm up [N m]."""
    fingers: Array
    """(k,) angles of the fingers [rad]."""
    command: Array
    """(dof,) where the base of the arm leads the joints [rad]."""


class SimulatedArm:
    """An arm that takes velocities.

    As Kinova's base does, it keeps joints within their limits and speeds, and holds them where they were led:
    the error of a velocity is made up for.

    Attributes:
        robot: the arm.
        physics: its simulation.
        finger_range: (2,) open and closed [rad].
        state: what is measured now.
        margin: the least distance of a joint to its limit so far [rad]; inf without limits.
        speed: the largest velocity of a joint so far, over its limit.
        moved: when a joint last moved, in simulated time [s].
    """

    def __init__(
        self, robot: str = bundled.DEFAULT_ROBOT, *, q: ArrayLike | None = None, task: Task | None = None
    ) -> None:
        """Stand at home, the fingers open.

        Args:
            robot: a bundled Jaco or Mico.
            q: (dof,) where to stand instead [rad].
            task: whose arm it is, in an episode that has begun; None for an arm on a floor.

        Raises:
            UnknownNameError: no such robot.
            InvalidInputError: q is malformed, or outside the limits; or the task has another arm.
        """
        self.robot = load_robot(checks.choice("robot", robot, bundled.JACOS))
        arm: JacoArm
        if task is None:
            arm = robots.make_arm(observations.PERFECT_FEATURES, robot)
            hand = robots.make_hand(observations.PERFECT_FEATURES, robot)
            arm.attach(hand)
            arena = Arena()
            arena.attach(arm, position=robots.ARM_OFFSET)
            self.physics = Physics.from_entity(arena)
            arm.set_home(self.physics)
        else:
            from jacokin.tasks.task import Task  # which a twin on a floor does not need

            arm, hand, self.physics = checks.instance("task", task, Task, "a Task").arm, task.hand, task.physics
            if arm.robot_name != robot:
                raise InvalidInputError(f"robot is {robot}, and the task has a {arm.robot_name}")
        self._arm = arm
        bind = self.physics.bind
        self._joints, self._fingers = bind(arm.joints), bind(hand.joints)
        self._motors, self._finger_motors = bind(arm.actuators), bind(hand.actuators)
        self._steps = round(TICK / self.physics.timestep)
        self.finger_range = checks.read_only(self._fingers.range[0])
        if q is not None:
            start = self.robot.configuration(q, "q")
            if not self.robot.within_limits(start):
                raise InvalidInputError(f"q is outside the limits of {self.robot.label}: {shown(start.tolist())}")
            self._joints.qpos = start
            self.physics.after_reset()
        self._reference = np.array(self._joints.qpos)
        self._idle = np.zeros(self.robot.dof)
        self._finger_targets = np.array(self._fingers.qpos)
        self._finger_speeds: Array | None = None
        self.margin, self.speed, self.moved = np.inf, 0.0, 0.0
        self._start = self.physics.time
        self.state = self._measure()

    def move_fingers(self, angles: ArrayLike) -> None:
        """Let the fingers go to angles (k,) [rad]; the range bounds them.

        Raises:
            InvalidInputError: not so many finite numbers.
        """
        targets = checks.vector("angles", angles, len(self.state.fingers), "rad")
        self._finger_speeds, self._finger_targets = None, np.clip(targets, *self.finger_range)

    def turn_fingers(self, speeds: ArrayLike) -> None:
        """Let the fingers turn (k,) [rad/s] for the next tick.

        Raises:
            InvalidInputError: not so many finite numbers.
        """
        asked = checks.vector("speeds", speeds, len(self.state.fingers), "rad/s")
        self._finger_speeds = np.clip(asked, -FINGER_SPEED, FINGER_SPEED)

    def tick(self, velocity: ArrayLike) -> ArmState:
        """Simulate a tick with velocities (dof,) [rad/s]; what the limits do not allow is not done.

        Raises:
            InvalidInputError: not so many finite numbers.
        """
        robot = self.robot
        v = np.clip(
            checks.vector("velocity", velocity, robot.dof, "rad/s"), -robot.velocity_limit, robot.velocity_limit
        )
        up, down = (distance.clip(min=0.0) for distance in self._room())
        v = np.clip(v, -_braking(down), _braking(up))
        q = np.array(self._joints.qpos)
        self._reference = np.clip(self._reference + v * TICK, q - LEAD, q + LEAD)
        self._rest_ahead(q, v)
        follow = v + _closing(self._reference - q - v * TICK)
        follow = np.clip(follow, -robot.velocity_limit, robot.velocity_limit)
        bias = (self._joints.qfrc_bias - self._joints.qfrc_passive) / self._motors.gainprm[:, 0]
        self._motors.ctrl = np.clip(follow + bias, *self._motors.ctrlrange.T)
        self._finger_motors.ctrl = self._finger_control()
        self.physics.step(self._steps)
        self.state = self._measure()
        return self.state

    def tick_torques(self, torques: ArrayLike) -> ArmState:
        """Simulate a tick with torques (dof,) on top of those that hold the arm against gravity [N m].

        Nothing keeps it within limits: see `can_stop`.

        Raises:
            InvalidInputError: not so many finite numbers.
        """
        asked = checks.vector("torques", torques, self.robot.dof, "N m")
        self._finger_motors.ctrl = self._finger_control()
        for _ in range(self._steps):
            # The motors' own loop of velocity is taken out, step by step.
            self._motors.ctrl = self._joints.qvel + (self._joints.qfrc_bias + asked) / self._motors.gainprm[:, 0]
            self.physics.step()
        self.hold()
        self.state = self._measure()
        return self.state

    def hold(self) -> None:
        """Be led to where the arm is now."""
        q = np.array(self._joints.qpos)
        self._reference = np.clip(q, self.robot.lower + MARGIN, self.robot.upper - MARGIN)
        self._idle = np.zeros(self.robot.dof)

    def can_stop(self) -> bool:
        """Whether all joints still stop before their limits."""
        up, down = (distance.clip(min=0.0) for distance in self._room())
        return bool(((-_braking(down) <= self.state.v) & (self.state.v <= _braking(up))).all())

    def _rest_ahead(self, q: Array, velocity: Array) -> None:
        """Put the reference of joints that are to stand where they can stop, so that they do not turn back."""
        self._idle = np.where(velocity == 0.0, self._idle + 1, 0)
        speed = np.array(self._joints.qvel)
        # This tick brakes already: with speed^2 / (2 STOPPING) the curve of `_closing` would brake half as hard.
        stop = q + speed * np.maximum(np.abs(speed) - STOPPING * TICK, 0.0) / (2.0 * STOPPING)
        is_passed = (self._idle > IDLE) & ((stop - self._reference) * speed > 0.0)
        inside = np.clip(stop, self.robot.lower + MARGIN, self.robot.upper - MARGIN)
        self._reference = np.where(is_passed, inside, self._reference)

    def _room(self) -> tuple[Array, Array]:
        """How far the reference may still go up and down, (dof,) each [rad]."""
        return self.robot.upper - MARGIN - self._reference, self._reference - self.robot.lower - MARGIN

    def _finger_control(self) -> Array:
        now = np.array(self._fingers.qpos)
        if self._finger_speeds is not None:
            speeds, self._finger_speeds = self._finger_speeds, None
            self._finger_targets = np.clip(now + speeds * TICK, *self.finger_range)
            return speeds
        return np.asarray(np.clip(8.0 * (self._finger_targets - now), -FINGER_SPEED, FINGER_SPEED))  # [1/s]

    def _measure(self) -> ArmState:
        joints, robot = self._joints, self.robot
        q, v = checks.read_only(joints.qpos), checks.read_only(joints.qvel)
        time = self.physics.time - self._start
        self.margin = min(self.margin, float(limit_margins(robot, q).min()))
        self.speed = max(self.speed, float((np.abs(v) / robot.velocity_limit).max()))
        if np.abs(v).max() > MOVING:
            self.moved = time
        torques = checks.read_only(self._arm.joint_torques(self.physics))
        fingers = checks.read_only(self._fingers.qpos)
        return ArmState(time, q, v, torques, fingers, checks.read_only(self._reference))


def _closing(error: Array) -> Array:
    """Velocities (dof,) that take joints to their reference, from which they can still stop there, by ticks [rad/s]."""
    change = 0.5 * STOPPING * TICK
    fastest = np.sqrt(change**2 + 2.0 * STOPPING * np.abs(error)) - change
    return np.sign(error) * np.minimum(GAIN * np.abs(error), fastest)


def _braking(distance: Array) -> Array:
    """The speeds (dof,) from which joints still stop within distances (dof,) [rad], at the end of a tick too."""
    return np.minimum(np.sqrt(2.0 * BRAKING * distance), distance / TICK)


logger = logging.getLogger(__name__)


class GoalStatus(Enum):
    """How a goal stands, in the words that ROS 1 and 2 have in common."""

    ACTIVE = "active"
    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELLED = "cancelled"


@dataclass(slots=True, eq=False)
class TwinGoal:
    """A goal that was accepted. A controller ends it, once."""

    status: GoalStatus = GoalStatus.ACTIVE
    """How it stands."""
    text: str = ""
    """Why it ended."""
    code: int = 0
    """The error code of FollowJointTrajectory; 0 for none."""

    @property
    def has_ended(self) -> bool:
        """Whether it has ended."""
        return self.status is not GoalStatus.ACTIVE

    def end(self, status: GoalStatus, text: str = "", code: int = 0) -> None:
        """End it; nothing, where it has ended before."""
        if not self.has_ended:
            self.status, self.text, self.code = status, text, code


@dataclass(frozen=True, slots=True)
class Record:
    """What a controller has done until now."""

    time: float
    """Simulated [s]."""
    velocities: int
    """Velocities that were heard."""
    lost: int
    """Velocities and positions that faults have taken."""
    stalls: int
    """How often nothing passed for a while."""
    goals: int
    """Goals that were accepted."""
    waiting: int
    """Commands that wait in the queue of the base."""
    margin: float
    """The least distance of a joint to its limit [rad]; inf without limits."""
    speed: float
    """The largest velocity of a joint, over its limit."""
    coasted: float
    """How long the arm moved on after the last velocity came, or a goal ended, until it stood, or until now [s]."""
    angles: tuple[float, ...]
    """Where the joints are [rad]."""
    fingers: tuple[float, ...]
    """Where the fingers are [rad]."""


class ArmController(Generic[Command]):
    """What a driver and a controller of ros2_control have in common. Several threads may call it.

    Attributes:
        arm: that it moves.
    """

    def __init__(self, arm: SimulatedArm, faults: Faults | None, seed: int) -> None:
        """Move an arm, with faults that are drawn from a seed; None for nothing.

        Raises:
            InvalidInputError: one is something else.
        """
        self.arm = checks.instance("arm", arm, SimulatedArm, "a SimulatedArm")
        going_wrong = Faults() if faults is None else checks.instance("faults", faults, Faults, "Faults, or None")
        self._line: Line[Command, ArmState] = Line(going_wrong, checks.whole_number("seed", seed))
        self._line.tick(arm.state)
        self._lock = threading.RLock()
        self._velocities, self._goals = 0, 0
        self._last = 0.0  # [s] when a command last came

    def tell(self) -> ArmState | None:
        """What is published now, None where faults take that."""
        with self._lock:
            return self._line.tell()

    def record(self) -> Record:
        """What was done until now."""
        with self._lock:
            arm = self.arm
            return Record(
                time=arm.state.time,
                velocities=self._velocities,
                lost=self._line.lost,
                stalls=self._line.stalls,
                goals=self._goals,
                waiting=0,
                margin=arm.margin,
                speed=arm.speed,
                coasted=max(0.0, arm.moved - self._last),
                angles=tuple(arm.state.q.tolist()),
                fingers=tuple(arm.state.fingers.tolist()),
            )

    def _send_velocity(self, command: Command) -> None:
        """Send a velocity to the arm."""
        if self.arm.state.time - self._last > 1.0 or not self._velocities:  # [s]
            logger.info("velocities come")
        self._velocities += 1
        self._last = self.arm.state.time
        self._line.send(command)
