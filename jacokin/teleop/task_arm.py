"""`TaskArm`: the simulated arm of a task, as a hand leads it."""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.model.angles import nearest_copy
from jacokin.model.descriptions import bundled
from jacokin.model.loading import load_robot
from jacokin.model.obstacles import Floor
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene
from jacokin.motion.tracking.tracker import Tracker
from jacokin.mujoco_bridge import robots
from jacokin.tasks.gym.environment import TaskEnv
from jacokin.teleop.devices import Fingers

CONTROL = "joint_position"  # that actions must be of: they are where the arm is led to
FINGERS = 3
MOTOR_PART = 0.8  # of the acceleration that simulated motors are strong enough for
ACCELERATION = 4.0  # [rad/s^2] that suffices for a hand


class TaskArm:
    """The arm of a task's simulation as it is at the start of an episode, and the actions that move it.

    Attributes:
        robot: the arm, with the fingers about as they are.
        q: (6,) where it is [rad].
        dt: control step [s].
        table: what it stands on.
        acceleration: (6,) that its motors are strong enough for, with a reserve [rad/s^2].
        fingers: that keys and buttons move.
    """

    def __init__(self, env: TaskEnv) -> None:
        """Look at an environment that has been reset.

        Raises:
            InvalidInputError: its control is not "joint_position".
        """
        check_control(env)
        lower, upper = env._control.bounds
        angles = env.data.qpos[: len(lower)].clip(lower, upper)
        self.q = checks.read_only(angles[:-FINGERS])
        self.robot: Robot = load_robot(finger_angle=float(angles[-FINGERS:].mean()))
        self.dt = env.dt
        self.table = Scene([Floor(-robots.ARM_OFFSET[2])])
        limits = bundled.robot_table()["finger"]
        self.fingers = Fingers(float(angles[-FINGERS:].mean()), lower=limits["lower"], upper=limits["upper"])
        # Torque of the motors less friction and the gravity that they hold here, over the inertia with armature.
        simulated, arm = env.model, slice(self.robot.dof)
        load = simulated.dof_frictionloss[arm] + np.abs(self.robot.gravity(self.q))
        inertia = self.robot.mass_matrix(self.q).diagonal() + simulated.dof_armature[arm]
        possible = MOTOR_PART * (simulated.actuator_forcerange[arm, 1] - load) / inertia
        self.acceleration: Array = checks.read_only(possible.clip(max=ACCELERATION))

    def tracker(self) -> Tracker:
        """A tracker that starts where the arm is, with the step of the task, off the table and within its motors."""
        return Tracker(
            self.robot, q=self.q, dt=self.dt, scene=self.table, clearance=0.0, acceleration_limit=self.acceleration
        )

    def action(self, q: Array, finger_angle: float) -> Array:
        """(9,) that moves the arm to (6,) angles [rad], and the fingers to theirs."""
        near = nearest_copy(q, 0.0 * q, self.robot.unlimited)  # actions allow a turn to each side
        return np.append(near, [finger_angle] * FINGERS)


def check_control(env: TaskEnv) -> None:
    """Check that actions are angles.

    Raises:
        InvalidInputError: they are something else.
    """
    if env.options.control != CONTROL:
        raise InvalidInputError(f"a hand leads an environment with control={CONTROL!r}, not {env.options.control!r}")
