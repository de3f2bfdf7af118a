"""`CONTROLS`, what actions may mean: velocities or angles of the joints, a velocity or a pose of the tool.

All but velocities of joints move a reference configuration within the limits of the joints, which the arm follows with
velocities; gravity is compensated.
"""

from __future__ import annotations

import abc
from collections.abc import Callable

import numpy as np
import pinocchio as pin

import jacokin
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model.angles import nearest_copy
from jacokin.model.descriptions import bundled
from jacokin.mujoco_bridge import JacoArm, Physics
from jacokin.mujoco_bridge.control.commands import GAIN
from jacokin.tasks.features import StateView

FRAME = "pinchsite"
JOINTS, FINGERS = 6, 3
_REACH = np.array((0.6, 0.6, 0.8))  # [m] half-extent of the poses that can be asked for, about the arena's origin


class Control(abc.ABC):
    """Turns actions into velocities; one for each environment. Pickles.

    Each is made of lower and upper bounds (9,) of the velocities of the actuators [rad/s], the control step [s], and
    the arm that is moved.

    Attributes:
        bounds: lower and upper bounds of actions.
    """

    bounds: tuple[Array, Array]

    def check(self, actions: Array) -> None:  # noqa: B027 - nothing to refuse where every action is a velocity
        """Check actions (..., n) within the bounds.

        Raises:
            InvalidInputError: one of them means nothing.
        """

    def start(self, physics: Physics) -> None:  # noqa: B027 - joint velocities need no start
        """Begin an episode."""

    @abc.abstractmethod
    def velocities(self, view: StateView, action: Array) -> Array:
        """The velocities (9,) for a control step [rad/s], of a checked action, for a simulation as it is now."""


class JointVelocity(Control):
    """Actions are the velocities of the joints and the fingers, as in the reference.

    Attributes:
        bounds: of the actions, (9,) [rad/s].
    """

    def __init__(self, lower: Array, upper: Array, dt: float, arm: JacoArm) -> None:
        """Allow velocities between two bounds (9,) [rad/s]."""
        self.bounds = lower, upper

    def velocities(self, view: StateView, action: Array) -> Array:
        """The action itself."""
        return action


class _ReferenceControl(Control):
    """A reference configuration, and velocities that follow it."""

    def __init__(self, lower: Array, upper: Array, dt: float, arm: JacoArm) -> None:
        self._lower, self._upper, self._dt = lower, upper, dt
        self._robot = arm.robot
        if self._robot.dof != JOINTS or len(lower) != JOINTS + FINGERS:
            raise InvalidInputError(
                f"control: an arm and a hand with {len(lower)} actuators take 'joint_velocity'; the others are for "
                f"{JOINTS} joints and {FINGERS} fingers"
            )
        # The simulated motors limit accelerations.
        self._tracker = jacokin.Tracker(self._robot, FRAME, dt=dt, acceleration_limit=np.inf)
        self._joints = self._robot.dof

    def start(self, physics: Physics) -> None:
        """Begin where the arm is."""
        model, data = physics.model, physics.data
        self._gain: Array = model.actuator_gainprm[:, 0].copy()
        self._fingers: Array = model.jnt_range[self._joints : self._joints + FINGERS].T.copy()
        base = model.body_parentid[model.jnt_bodyid[0]]
        self._base_position: Array = data.xpos[base].copy()
        self._R_base_world: Array = data.xmat[base].reshape(3, 3).T.copy()
        self._put(self._within(physics.data.qpos[: self._joints]))

    def _put(self, q: Array) -> None:
        """Put the reference to a configuration (dof,) [rad], at rest."""
        self._tracker.reset(q, v=np.zeros(self._joints))

    def _within(self, q: Array) -> Array:
        return np.asarray(np.clip(q, self._robot.lower, self._robot.upper))

    def _follow(self, view: StateView, speed: Array, fingers: Array) -> Array:
        """Velocities of all actuators, for the arm to be at the reference at the end of the control step."""
        error = self._tracker.q - speed * self._dt - view.qpos[: self._joints]
        found = np.concatenate((speed + GAIN * error, fingers))
        found += (view.qfrc_bias - view.qfrc_passive)[: len(found)] / self._gain
        return np.asarray(np.minimum(np.maximum(found, self._lower), self._upper))

    def _approach(self, q: Array) -> Array:
        """Move the reference towards a configuration, all joints together; returns its velocities [rad/s]."""
        before = self._tracker.q
        way = nearest_copy(q, before, self._robot.unlimited) - before
        longest = float(np.max(np.abs(way) / (self._tracker.velocity_limit * self._dt)))
        self._put(self._within(before + way / max(1.0, longest)))
        return np.asarray((self._tracker.q - before) / self._dt)

    def _close(self, view: StateView, angles: Array) -> Array:
        """Velocities that move the fingers to angles."""
        fingers = view.qpos[self._joints : self._joints + FINGERS]
        return np.asarray(GAIN * (np.clip(angles, *self._fingers) - fingers))

    def _keep_near(self, view: StateView) -> None:
        """Put the reference back to an arm that something has stopped."""
        q = view.qpos[: self._joints]
        if np.abs(self._tracker.q - q).max() > 0.1:  # [rad] ahead of the arm, which an obstacle may stop
            self._put(self._within(q))


class JointPosition(_ReferenceControl):
    """Actions are angles of the joints and the fingers; the joints move there together, as fast as they may.

    Attributes:
        bounds: of the actions, (9,) [rad]: the limits of the joints, a turn to each side for those without.
    """

    def __init__(self, lower: Array, upper: Array, dt: float, arm: JacoArm) -> None:
        """Allow velocities of actuators between two bounds (9,) [rad/s]."""
        super().__init__(lower, upper, dt, arm)
        free = self._robot.unlimited
        low = np.where(free, -2.0 * np.pi, self._robot.lower)
        high = np.where(free, 2.0 * np.pi, self._robot.upper)
        fingers = bundled.robot_table()["finger"]
        self.bounds = np.append(low, [fingers["lower"]] * FINGERS), np.append(high, [fingers["upper"]] * FINGERS)

    def velocities(self, view: StateView, action: Array) -> Array:
        """Move the reference towards the angles, and follow it."""
        self._keep_near(view)
        speed = self._approach(self._within(action[: self._joints]))
        return self._follow(view, speed, self._close(view, action[self._joints :]))


class JointDelta(_ReferenceControl):
    """Actions are by how much the reference of the joints, and the fingers, move in the control step.

    Attributes:
        bounds: of the actions, (9,) [rad]: what velocities allow in a step.
    """

    def __init__(self, lower: Array, upper: Array, dt: float, arm: JacoArm) -> None:
        """Allow velocities of actuators between two bounds (9,) [rad/s]."""
        super().__init__(lower, upper, dt, arm)
        self.bounds = lower * dt, upper * dt

    def velocities(self, view: StateView, action: Array) -> Array:
        """Move the reference, and follow it."""
        self._keep_near(view)
        speed = self._approach(self._within(self._tracker.q + action[: self._joints]))
        return self._follow(view, speed, action[self._joints :] / self._dt)


class ToolVelocity(_ReferenceControl):
    """Actions are velocities of the pinch site in world axes and of the fingers; the `Tracker` keeps all limits.

    Attributes:
        bounds: of the actions, (7,): [m/s], [rad/s], and one velocity of all fingers [rad/s].
    """

    def __init__(self, lower: Array, upper: Array, dt: float, arm: JacoArm) -> None:
        """Allow velocities of actuators between two bounds (9,) [rad/s]."""
        super().__init__(lower, upper, dt, arm)
        bound = np.array([0.25] * 3 + [1.5] * 3 + [upper[-1]])  # [m/s], [rad/s] of the tool at most
        self.bounds = -bound, bound

    def velocities(self, view: StateView, action: Array) -> Array:
        """Move the reference along the twist, and follow it."""
        self._keep_near(view)
        twist = np.concatenate((self._R_base_world @ action[:3], self._R_base_world @ action[3:6]))
        step = self._tracker.step(twist=twist)
        return self._follow(view, step.v, np.full(FINGERS, action[6]))


class ToolPose(_ReferenceControl):
    """Actions are poses of the pinch site in the world, and how far the fingers are to be closed.

    The solver finds the nearest configuration, to which the joints move together; without one the `Tracker` goes as
    near as it can.

    Attributes:
        bounds: of the actions, (8,): position [m], quaternion wxyz of any norm but 0, close factor 0..1.
    """

    def __init__(self, lower: Array, upper: Array, dt: float, arm: JacoArm) -> None:
        """Allow velocities of actuators between two bounds (9,) [rad/s]."""
        super().__init__(lower, upper, dt, arm)
        middle = np.array((0.0, 0.0, 0.4))  # [m]
        low = np.concatenate((middle - _REACH, -np.ones(4), (0.0,)))
        high = np.concatenate((middle + _REACH, np.ones(4), (1.0,)))
        self.bounds = low, high
        self._solver = jacokin.IKSolver(self._robot, FRAME, collision="ignore")

    def check(self, actions: Array) -> None:
        """Check quaternions.

        Raises:
            InvalidInputError: one is 0.
        """
        quats = actions[..., 3:7]
        is_zero = np.linalg.norm(quats, axis=-1) < 1e-3
        if is_zero.any():
            raise InvalidInputError(f"the quaternion of a pose must not be 0, got {quats[is_zero].tolist()[0]}")

    def velocities(self, view: StateView, action: Array) -> Array:
        """Move the reference towards the pose, and follow it."""
        self._keep_near(view)
        quat = action[3:7] / np.linalg.norm(action[3:7])
        rotation = pin.Quaternion(quat[0], quat[1], quat[2], quat[3]).toRotationMatrix()
        R = self._R_base_world
        target = pin.SE3(R @ rotation, R @ (action[:3] - self._base_position))
        speed = self._speed(target)
        lower, upper = self._fingers
        closed = lower + action[7] * (upper - lower)
        return self._follow(view, speed, self._close(view, closed))

    def _speed(self, target: pin.SE3) -> Array:
        """Move the reference; returns its velocities [rad/s]."""
        before = self._tracker.q
        result = self._solver.solve(target, seed=before, closest=False)
        if not result.success:
            return self._tracker.step(target).v
        return self._approach(result.q)


CONTROLS: dict[str, Callable[[Array, Array, float, JacoArm], Control]] = {
    "joint_velocity": JointVelocity,
    "joint_position": JointPosition,
    "joint_delta": JointDelta,
    "tool_velocity": ToolVelocity,
    "tool_pose": ToolPose,
}
