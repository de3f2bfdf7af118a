"""Tasks: the error of a frame against its target, and the Jacobian of that error.

Each task gives a Jacobian J and an error e, weights included: a displacement x of the joints with J x = e reaches the
target to first order. It also measures the error in metres and radians. Poses and orientations use mink's `FrameTask`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import mink
import mujoco
import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik.pose_error import RADIAN_IN_METRES
from jacokin.model import poses

FAR = 100.0  # [m] from the base; nothing beyond is within reach, and its error would drown all else in the QP


def _within_far(position: Array) -> Array:
    """The position (3,) [m], or if it is farther than `FAR` from the base, the one at `FAR` on the way there."""
    largest: float = max(map(abs, position.tolist()))  # a third of what numpy takes, at every tick
    if largest <= FAR:
        return position
    direction = position / largest  # whose norm does not overflow
    return np.asarray(FAR * direction / np.linalg.norm(direction))


class Task(ABC):
    """One target on one site of the MuJoCo twin."""

    def __init__(self, site: int, weight: float) -> None:
        """Remember the site's number and the weight."""
        self._site = site
        self._weight = weight

    @abstractmethod
    def error(self, configuration: mink.Configuration) -> Array:
        """Weighted error e (k,): what is missing to the target."""

    @abstractmethod
    def jacobian(self, configuration: mink.Configuration) -> Array:
        """Weighted Jacobian J (k, dof)."""

    @abstractmethod
    def measure(self, data: mujoco.MjData) -> tuple[float, float]:
        """Distance [m] and angle [rad] to the target."""

    def inequalities(self, configuration: mink.Configuration) -> tuple[Array, Array] | None:
        """G and h of G x <= h that keep what is reached, or None."""
        return None

    def _site_jacobian(self, configuration: mink.Configuration) -> tuple[Array, Array]:
        """Linear and angular rows (3, dof) each, in the axes of the base."""
        linear = np.empty((3, configuration.nv))
        angular = np.empty((3, configuration.nv))
        mujoco.mj_jacSite(configuration.model, configuration.data, linear, angular, self._site)
        return linear, angular


class PoseTask(Task):
    """Position and orientation, or orientation alone."""

    def __init__(self, site: int, weight: float, name: str, *, orientation_only: bool = False) -> None:
        """Build mink's task, which wants the site's name."""
        super().__init__(site, weight)
        self._orientation_only = orientation_only
        linear = 0.0 if orientation_only else weight
        self._task = mink.FrameTask(name, "site", linear, weight * RADIAN_IN_METRES)
        self._cost = np.array([linear] * 3 + [weight * RADIAN_IN_METRES] * 3)
        self._pose = pin.SE3.Identity()
        self._position, self._rotation = self._pose.translation, self._pose.rotation

    def set(self, pose: pin.SE3) -> None:
        """Set T_base_frame."""
        self._position, self._rotation = pose.translation, pose.rotation
        self._task.set_target(mink.SE3(np.concatenate([poses.quaternion(self._rotation), _within_far(self._position)])))

    def error(self, configuration: mink.Configuration) -> Array:
        """Weighted SE(3) logarithm of T_frame_target."""
        return np.asarray(-self._cost * self._task.compute_error(configuration))

    def jacobian(self, configuration: mink.Configuration) -> Array:
        """Weighted Jacobian of that logarithm."""
        return np.asarray(self._cost[:, None] * self._task.compute_jacobian(configuration))

    def measure(self, data: mujoco.MjData) -> tuple[float, float]:
        """Distance and angle."""
        rotation = data.site_xmat[self._site].reshape(3, 3)
        angle = poses.rotation_angle(rotation.T @ self._rotation)
        if self._orientation_only:
            return 0.0, angle
        return math.hypot(*(data.site_xpos[self._site] - self._position).tolist()), angle


class PositionTask(Task):
    """Position alone."""

    def __init__(self, site: int, weight: float, position: Array) -> None:
        """Keep the position (3,) [m]."""
        super().__init__(site, weight)
        self._position, self._reachable = position, _within_far(position)

    def error(self, configuration: mink.Configuration) -> Array:
        """Weighted difference of the positions."""
        return np.asarray(self._weight * (self._reachable - configuration.data.site_xpos[self._site]))

    def jacobian(self, configuration: mink.Configuration) -> Array:
        """Weighted linear Jacobian."""
        return self._weight * self._site_jacobian(configuration)[0]

    def measure(self, data: mujoco.MjData) -> tuple[float, float]:
        """Distance; the orientation is free."""
        return math.hypot(*(data.site_xpos[self._site] - self._position).tolist()), 0.0


class AxisTask(Task):
    """One axis of the frame along a direction, by the shortest rotation.

    mink's `AxisAlignTask` takes the difference of the two unit vectors as the error. Its gradient vanishes where they
    are opposite, so the arm would stay there; the rotation vector used here is longest there.
    """

    def __init__(self, site: int, weight: float, axis: Array, direction: Array) -> None:
        """Keep a unit axis (3,) of the frame and the unit direction (3,) of the base to align it with."""
        super().__init__(site, weight)
        self._axis, self._direction = axis, direction

    def _now(self, data: mujoco.MjData) -> tuple[Array, Array, float]:
        """Where the axis points, the rotation vector to the direction, and its angle."""
        points = data.site_xmat[self._site].reshape(3, 3) @ self._axis
        turn = np.cross(points, self._direction)
        sine, cosine = float(np.linalg.norm(turn)), float(points @ self._direction)
        angle = math.atan2(sine, cosine)
        if sine < 1e-12:  # aligned, or opposite: any perpendicular axis does
            turn = np.cross(points, np.eye(3)[int(np.argmin(np.abs(points)))])
            sine = float(np.linalg.norm(turn))
        return points, turn * (angle / sine), angle

    def error(self, configuration: mink.Configuration) -> Array:
        """Weighted rotation vector of the shortest rotation."""
        return self._weight * RADIAN_IN_METRES * self._now(configuration.data)[1]

    def jacobian(self, configuration: mink.Configuration) -> Array:
        """Weighted angular Jacobian without the rotation about the axis."""
        points = self._now(configuration.data)[0]
        angular = self._site_jacobian(configuration)[1]
        return self._weight * RADIAN_IN_METRES * (angular - np.outer(points, points @ angular))

    def measure(self, data: mujoco.MjData) -> tuple[float, float]:
        """Angle between axis and direction."""
        return 0.0, self._now(data)[2]


class RegionTask(Task):
    """Position inside a box: pulled in from outside, kept in once inside."""

    def __init__(self, site: int, weight: float, lower: Array, upper: Array) -> None:
        """Keep the corners (3,) [m]."""
        super().__init__(site, weight)
        self._lower, self._upper = lower, upper

    def _difference(self, data: mujoco.MjData) -> Array:
        position = data.site_xpos[self._site]
        return np.asarray(np.clip(position, self._lower, self._upper) - position)

    def error(self, configuration: mink.Configuration) -> Array:
        """Weighted difference to the nearest point of the box."""
        return self._weight * self._difference(configuration.data)

    def jacobian(self, configuration: mink.Configuration) -> Array:
        """Weighted linear Jacobian along the axes of the base in which the frame is outside."""
        outside = (self._difference(configuration.data) != 0.0).astype(np.float64)
        return np.asarray(self._weight * outside[:, None] * self._site_jacobian(configuration)[0])

    def inequalities(self, configuration: mink.Configuration) -> tuple[Array, Array] | None:
        """Faces of the box that the frame must not cross, along the axes in which it is inside."""
        position = configuration.data.site_xpos[self._site]
        linear = self._site_jacobian(configuration)[0]
        normals = np.vstack([linear, -linear])
        gaps = np.concatenate([self._upper - position, position - self._lower])
        use = (gaps >= 0.0) & np.isfinite(gaps)
        return (normals[use], gaps[use]) if use.any() else None

    def measure(self, data: mujoco.MjData) -> tuple[float, float]:
        """Distance to the box."""
        return float(np.linalg.norm(self._difference(data))), 0.0
