"""`ArmDriver`, the arm as a script sees it: observations in, actions out, and the motions that scripts consist of.

A script is a generator of actions. Before each it is resumed, the arm has a new observation.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

import jacokin
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import Scene
from jacokin.model import checks
from jacokin.model.angles import nearest_copy, wrap_to_turn
from jacokin.motion import TrackerStatus
from jacokin.mujoco_bridge import robots
from jacokin.tasks.gym.controls import FRAME
from jacokin.tasks.task import CONTROL_TIMESTEP

ARM = "jaco_arm/"  # prefix of its observations
BRICK = "duplo2x4/"  # prefix of the observations of the first brick
OPEN, CLOSED = 0.15, 1.35  # [rad] limits of the fingers
CLOSE, RELEASE = 5.0, -5.0  # [rad/s]

SQUEEZE = 2.0  # [rad] beyond the limits of the fingers: they squeeze
SPEED = 0.35  # [m/s] of the tool along lines
KEEPS_UP, LAG = 0.015, 0.04  # [m] of the tool behind the line, from where that slows down, and where it waits
PATIENCE = 15  # steps of waiting, until it ends

Script = Iterator[Array]


class ArmDriver:
    """The arm as observed, and what makes it move.

    Attributes:
        robot: its kinematics.
        solver: of configurations for poses of the pinch site.
        tracker: follows poses that move.
        q: (6,) its configuration [rad].
        lag: of the tracker behind its target [m].
        is_stuck: whether the tracker cannot get nearer.
        fingers: (3,) their angles [rad].
        grip: (3,) their angles when they had closed for the last time [rad].
    """

    def __init__(self) -> None:
        """Load the robot and its solver."""
        self.robot = jacokin.load_robot()
        self.solver = jacokin.IKSolver(self.robot, FRAME, collision="ignore")
        self.tracker = jacokin.Tracker(self.robot, FRAME, dt=CONTROL_TIMESTEP, acceleration_limit=np.inf)
        self.lag, self.is_stuck = 0.0, False
        self.grip: Array = np.full(3, CLOSED)
        self._observation: Mapping[str, Any] = {}
        self._data = self.robot.pin_model.createData()

    def observe(self, observation: object) -> None:
        """Read an observation.

        Raises:
            InvalidInputError: not a dictionary of features by name.
        """
        if not isinstance(observation, Mapping) or f"{ARM}joints_pos" not in observation:
            given = checks.shown(observation)
            if isinstance(observation, np.ndarray):
                given = f"an array of shape {observation.shape}"
            raise InvalidInputError(
                "an expert needs the features by name, as jacokin.tasks.load gives them or gymnasium.make(..., "
                f"flatten=False); got {given}"
            )
        self._observation = observation
        pairs = self.get(f"{ARM}joints_pos", 2 * self.robot.dof).reshape(-1, 2)
        self.q = np.clip(wrap_to_turn(np.arctan2(pairs[:, 0], pairs[:, 1])), self.robot.lower, self.robot.upper)
        self.fingers = self.get("jaco_arm/jaco_hand/joints_pos", 3)

    def get(self, name: str, size: int) -> Array:
        """The newest value of an observation."""
        return self.whole(name)[-size:]

    def whole(self, name: str) -> Array:
        """All values of an observation whose size differs between tasks.

        Raises:
            InvalidInputError: it is not there: this is another task than that of the script.
        """
        if name not in self._observation:
            raise InvalidInputError(f"{name!r}, which this expert needs, is not observed here: it is of another task")
        return np.ravel(np.asarray(self._observation[name], dtype=np.float64))

    def find(self, ending: str) -> list[str]:
        """The names of the observations that end like this."""
        return [name for name in self._observation if name.endswith(ending)]

    @property
    def pose(self) -> pin.SE3:
        """T_world_tool, the pose of the pinch site."""
        return self.pose_at(self.q)

    def pose_at(self, q: Array) -> pin.SE3:
        """T_world_tool at a configuration (6,) [rad]."""
        T_base_tool = self.robot.forward_kinematics(q, FRAME)
        return pin.SE3(T_base_tool.rotation, T_base_tool.translation + robots.ARM_OFFSET)

    def prop(self, prefix: str) -> pin.SE3:
        """T_world_prop of a prop, its origin in the middle of its bounding box."""
        w, x, y, z = self.get(f"{prefix}orientation", 4)
        return pin.SE3(pin.Quaternion(w, x, y, z).toRotationMatrix(), self.get(f"{prefix}position", 3))

    def configurations(self, T_world_tool: pin.SE3, seed: Array | None = None) -> Array:
        """Configurations (k, 6) that put the pinch site at a pose, the quickest to reach first."""
        start = self.q if seed is None else seed
        found = self.solver.solve_all(in_base(T_world_tool), seed=start)
        q = nearest_copy(found.q[found.within_limits], start, self.robot.unlimited)
        return np.asarray(q[np.argsort(self.durations(q, start))])

    def chain(self, poses: Sequence[pin.SE3], q: Array, most: float) -> Array | None:
        """Configurations (k, 6) at poses one after the other, from one to the next in at most some time [s].

        None where there are none without a change of branch on the way.
        """
        found = []
        for pose in poses:
            result = self.solver.solve(in_base(pose), q, closest=False)
            if not result.success or self.durations(result.q[None], q)[0] > most:
                return None
            q = result.q
            found.append(q)
        return np.array(found)

    def durations(self, q: Array, start: Array) -> Array:
        """How long (k,) the joints need from one configuration to others [s]."""
        return np.asarray((np.abs(q - start) / self.robot.velocity_limit).max(axis=-1))

    def duration(self, *stops: Array) -> float:
        """How long the joints need from one configuration to the next [s]."""
        return float(sum(self.durations(b[None], a)[0] for a, b in itertools.pairwise(stops)))

    def room(self, q: Array, scene: Scene) -> float:
        """The least distance between the arm and obstacles at configurations (k, 6) [m]."""
        return float(np.min(self.robot.clearance(q, scene)))

    def way(self, *stops: Array) -> Array:
        """Configurations (k, 6) along joint motions from one configuration to the next."""
        parts = np.linspace(0.0, 1.0, 8)[:, None]
        return np.concatenate([a + parts * (b - a) for a, b in itertools.pairwise(stops)])

    def towards(self, q: Array, fingers: ArrayLike) -> Array:
        """An action that moves the joints together towards a configuration.

        Args:
            q: (6,) where to go [rad].
            fingers: velocities of the fingers [rad/s].
        """
        error = nearest_copy(q, self.q, self.robot.unlimited) - self.q
        # Joints brake by 2 rad/s^2 before the end.
        limit = np.minimum(self.robot.velocity_limit, np.sqrt(2.0 * 2.0 * np.abs(error)) + 1e-9)
        velocity = 15.0 * error  # [1/s] near the end of a motion
        velocity /= max(1.0, float(np.abs(velocity / limit).max()))
        return self._action(velocity, fingers)

    def follow_from_here(self) -> None:
        """Let the tracker begin where the arm is."""
        self.tracker.reset(self.q, v=np.zeros(self.robot.dof))
        self.lag, self.is_stuck = 0.0, False

    def along(self, T_world_tool: pin.SE3, fingers: ArrayLike) -> Array:
        """An action that moves the tool towards a pose, by a step of the tracker from where that is."""
        before = self.tracker.q
        step = self.tracker.step(in_base(T_world_tool))
        self.lag, self.is_stuck = step.position_error, step.status is TrackerStatus.HELD
        error = nearest_copy(before, self.q, self.robot.unlimited) - self.q
        return self._action(step.v + 8.0 * error, fingers)  # [1/s] velocity per position error of the tracker

    def _action(self, velocity: Array, fingers: ArrayLike) -> Array:
        gravity = pin.computeGeneralizedGravity(self.robot.pin_model, self._data, self.q)
        velocity = velocity + gravity / 500.0  # [N m s/rad] of the arm's actuators
        return np.concatenate((velocity, np.broadcast_to(fingers, 3)))

    def is_at(self, q: Array, tolerance: float = 0.01) -> bool:
        """Whether the joints are at a configuration [rad]."""
        return bool(np.abs(nearest_copy(q, self.q, self.robot.unlimited) - self.q).max() < tolerance)

    def fingers_to(self, angle: ArrayLike) -> Array:
        """Velocities that move the fingers to an angle, or each to its own."""
        return 5.0 * (np.asarray(angle) - self.fingers)  # [1/s]

    def stay(self, fingers: float) -> Script:
        """Stay where the arm is now, without end."""
        q = self.q.copy()
        while True:
            yield self.towards(q, fingers)

    def hold(self, fingers: float, steps: int) -> Script:
        """Stay where the arm is now while the fingers move with a velocity [rad/s]."""
        q = self.q.copy()
        for _ in range(steps):
            yield self.towards(q, fingers)

    def close(self, steps: int) -> Script:
        """Close the hand and squeeze."""
        yield from self.hold(CLOSE, steps)
        self.grip = self.fingers.copy()

    def release(self, steps: int) -> Script:
        """Open the hand."""
        return self.hold(RELEASE, steps)

    def _squeeze_to(self, angle: float) -> Array:
        """Velocities that move the fingers to an angle; if it is beyond their limits, the thumb squeezes."""
        if angle <= CLOSED:
            return self.fingers_to(angle)
        return np.concatenate(((CLOSE,), self.fingers_to(self.grip)[1:]))

    def go(self, q: Array, fingers: float, *, tolerance: float = 0.01, around: bool = True) -> Script:
        """Go to a configuration; the fingers go to an angle, or squeeze if it is beyond their limits.

        Args:
            q: (6,) where to [rad].
            fingers: their angle [rad].
            tolerance: at which distance of a joint the motion ends [rad].
            around: where something stops the arm, go around it, upwards; otherwise the motion ends there.
        """
        before, step = self.q + 1.0, 0
        while not self.is_at(q, tolerance):
            yield self.towards(q, self._squeeze_to(fingers))
            step += 1
            if step % 5 == 0:
                if np.abs(self.q - before).max() < 0.01:  # stopped by something
                    if not around:
                        return
                    around = False
                    yield from self.move(shift(self.pose, up(0.08)), fingers, tolerance=0.02, settle=2)
                before = self.q.copy()

    def move(
        self,
        pose: pin.SE3,
        fingers: float,
        *,
        speed: float = SPEED,
        ramp: float = 0.0,
        tolerance: float = 0.002,
        settle: int = 15,
    ) -> Script:
        """Move the pinch site to a pose in the world along a straight line.

        Args:
            pose: T_world_tool at the end.
            fingers: their angle [rad]; they squeeze if it is beyond their limits.
            speed: of the tool [m/s].
            ramp: time until it has this speed [s].
            tolerance: to the end, where the motion may stop [m], [rad].
            settle: steps at most from when the line has ended.
        """
        self.follow_from_here()
        start = self.pose
        turn = pin.log3(start.rotation.T @ pose.rotation)
        way = pose.translation - start.translation
        # The tool turns at 1 rad/s.
        duration = max(float(np.linalg.norm(way)) / speed, float(np.linalg.norm(turn)), CONTROL_TIMESTEP)
        part, waited, now, pace = 0.0, 0, start, 0.0
        while part < 1.0 and waited < PATIENCE:
            # The joints accelerate slowly, and each has its limit: the line waits for them.
            lag = float(np.linalg.norm(self.pose.translation - now.translation)) + (0.0 if self.is_stuck else self.lag)
            rate = min(1.0, max(0.0, (LAG - lag) / (LAG - KEEPS_UP)))
            waited = waited + 1 if rate < 0.1 else 0
            pace = min(rate, pace + CONTROL_TIMESTEP / max(ramp, CONTROL_TIMESTEP))
            part = min(1.0, part + pace * CONTROL_TIMESTEP / duration)
            now = shift(start, part * way) * pin.SE3(pin.exp3(part * turn), np.zeros(3))
            yield self.along(now, self._squeeze_to(fingers))
        end = self.chain([pose], self.tracker.q, np.inf)
        for _ in range(settle):
            if waited >= PATIENCE or _distance(self.pose, pose) < tolerance:
                return
            squeeze = self._squeeze_to(fingers)
            yield self.along(pose, squeeze) if end is None else self.towards(end[0], squeeze)


def in_base(T_world_tool: pin.SE3) -> pin.SE3:
    """T_base_tool."""
    return pin.SE3(T_world_tool.rotation, T_world_tool.translation - robots.ARM_OFFSET)


def up(height: float) -> Array:
    """A vertical way [m]."""
    return np.array((0.0, 0.0, height))


def shift(pose: pin.SE3, way: Array) -> pin.SE3:
    """Move a pose by a way in the world [m]."""
    return pin.SE3(pose.rotation, pose.translation + way)


def _distance(a: pin.SE3, b: pin.SE3) -> float:
    """The larger of the distance [m] and the angle [rad] between two poses."""
    turn = float(np.linalg.norm(pin.log3(a.rotation.T @ b.rotation)))
    return max(float(np.linalg.norm(a.translation - b.translation)), turn)
