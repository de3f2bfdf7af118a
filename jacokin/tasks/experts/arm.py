"""The arm as a script sees it: observations in, actions out."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

import jacokin
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.model.angles import nearest_copy, wrap_to_turn
from jacokin.mujoco_bridge import robots
from jacokin.tasks.gym.controls import FRAME

GAIN = 8.0  # [1/s] velocity per position error
VELOCITY_GAIN = 500.0  # [N m s/rad] of the arm's actuators
ARM, HAND = "jaco_arm/", "jaco_arm/jaco_hand/"
OPEN, CLOSED = 0.15, 1.35  # [rad] limits of the fingers
CLOSE, RELEASE = 5.0, -5.0  # [rad/s]
FINGER_GAIN = 5.0  # [1/s]
DOWN = np.array(((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)))  # R_world_tool, the tool pointing down


class Arm:
    """The arm as observed."""

    def __init__(self) -> None:
        """Load the robot and its solver."""
        self.robot = jacokin.load_robot()
        self.solver = jacokin.IKSolver(self.robot, FRAME)
        self._observation: Mapping[str, Any] = {}
        self._data = self.robot.pin_model.createData()

    def observe(self, observation: object) -> None:
        """Take over an observation.

        Raises:
            InvalidInputError: not a dictionary of features by name.
        """
        if not isinstance(observation, Mapping) or f"{ARM}joints_pos" not in observation:
            raise InvalidInputError(
                "an expert needs the features by name, as jacokin.tasks.load gives them or gymnasium.make(..., "
                f"flatten=False); got {checks.shown(observation)}"
            )
        self._observation = observation
        pairs = self.get(f"{ARM}joints_pos", 2 * self.robot.dof).reshape(-1, 2)
        self.q = np.clip(wrap_to_turn(np.arctan2(pairs[:, 0], pairs[:, 1])), self.robot.lower, self.robot.upper)
        self.fingers = self.get(f"{HAND}joints_pos", 3)

    def get(self, name: str, size: int) -> Array:
        """The newest value of an observation."""
        return np.ravel(np.asarray(self._observation[name], dtype=np.float64))[-size:]

    def find(self, ending: str) -> list[str]:
        """The names of the observations that end like this."""
        return [name for name in self._observation if name.endswith(ending)]

    @property
    def tool(self) -> Array:
        """Position (3,) of the pinch site [m]."""
        return self.get(f"{HAND}pinch_site_pos", 3)

    def configurations(self, position: ArrayLike, rotation: NDArray[np.float64], seed: Array | None = None) -> Array:
        """Configurations (k, 6) that put the pinch site at a pose in the world, the quickest to reach first."""
        start = self.q if seed is None else seed
        target = pin.SE3(rotation, np.asarray(position, dtype=np.float64) - robots.ARM_OFFSET)
        found = self.solver.solve_all(target, seed=start)
        q = nearest_copy(found.q[found.within_limits], start, self.robot.unlimited)
        return np.asarray(q[np.argsort(self.durations(q, start))])

    def durations(self, q: Array, start: Array) -> Array:
        """How long (k,) the joints need from one configuration to others [s]."""
        limit = self.robot.velocity_limit
        return np.asarray(np.abs(q - start).max(axis=-1) if limit is None else (np.abs(q - start) / limit).max(axis=-1))

    def way(self, *stops: Array) -> Array:
        """Configurations (k, 6) along joint motions from one configuration to the next."""
        parts = np.linspace(0.0, 1.0, 8)[:, None]
        return np.concatenate([a + parts * (b - a) for a, b in itertools.pairwise(stops)])

    def towards(self, q: Array, fingers: float | Array, speed: float = 1.0) -> Array:
        """An action that moves the joints together towards a configuration.

        Args:
            q: (6,) where to go [rad].
            fingers: velocities of the fingers [rad/s].
            speed: part of the joints' velocity limits to use.
        """
        error = nearest_copy(q, self.q, self.robot.unlimited) - self.q
        limit = speed * np.asarray(self.robot.velocity_limit)
        velocity = GAIN * error
        velocity /= max(1.0, float(np.abs(velocity / limit).max()))
        gravity = pin.computeGeneralizedGravity(self.robot.pin_model, self._data, self.q)
        return np.concatenate((velocity + gravity / VELOCITY_GAIN, np.broadcast_to(fingers, 3)))

    def is_at(self, q: Array, tolerance: float = 0.01) -> bool:
        """Whether the joints are at a configuration [rad]."""
        return bool(np.abs(nearest_copy(q, self.q, self.robot.unlimited) - self.q).max() < tolerance)

    def fingers_to(self, angle: float) -> Array:
        """Velocities that move the fingers to an angle."""
        return FINGER_GAIN * (angle - self.fingers)


def yawed(yaw: float, tilt: float = 0.0, lean: float = 0.0) -> Array:
    """R_world_tool of a tool that points down, its x axis turned from the world's by a yaw [rad].

    Args:
        yaw: about the vertical axis.
        tilt: then about the tool's x axis, about which the fingers stand side by side.
        lean: then about its y axis, around which they close.
    """
    c, s = np.cos(yaw), np.sin(yaw)
    down = np.array(((c, s, 0.0), (s, -c, 0.0), (0.0, 0.0, -1.0)))
    return np.asarray(down @ pin.utils.rotate("x", tilt) @ pin.utils.rotate("y", lean))


def yaw_of(quat_wxyz: Array) -> float:
    """The rotation about the vertical axis of something that lies on the table [rad]."""
    w, x, y, z = quat_wxyz
    return float(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
