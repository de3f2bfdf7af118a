"""`ContactObserver`: notices contact from joint torques, by the momentum that they do not explain."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array, Sealed
from jacokin.errors import InvalidInputError
from jacokin.model import checks, dynamics, poses
from jacokin.model.robot import Robot, checked_robot


@dataclass(frozen=True, slots=True, eq=False)
class ContactStep(Sealed):
    """What the observer sees after one step; arrays are read-only."""

    external_torque: Array
    """(dof,) torques of the surroundings on the joints, low-passed [N m]."""
    joints: tuple[str, ...]
    """Names of the joints whose external torque is beyond the threshold."""

    @property
    def contact(self) -> bool:
        """Whether any joint's is."""
        return bool(self.joints)


class ContactObserver:
    """Momentum observer: external joint torques without measuring accelerations.

    The momentum p = M(q) v changes by dp/dt = torque + C^T v - g + external. What a step leaves unexplained is the
    external torque, which a first-order filter smooths. Friction and errors of the masses count as external, too: the
    threshold must lie above them. Forces through a joint's axis, and those that no joint feels, are not seen.

    Source: De Luca, Albu-Schaeffer, Haddadin, Hirzinger, Collision detection and safe reaction with the DLR-III
    lightweight manipulator arm, IROS 2006.
    """

    def __init__(
        self,
        robot: Robot,
        threshold: ArrayLike,
        *,
        bandwidth: float = 30.0,
        base: pin.SE3 | ArrayLike | None = None,
    ) -> None:
        """Prepare an observer that has not seen anything yet.

        Args:
            robot: the arm, with its payload if it carries one.
            threshold: external torque that counts as contact [N m], one for all joints or (dof,).
            bandwidth: of the filter [rad/s]; with 30 a push shows with a time constant of 33 ms. Noise of velocities
                counts in proportion.
            base: T_world_base, how the base is mounted, as in `Robot.gravity`.

        Raises:
            InvalidInputError: malformed.
        """
        self.robot = checked_robot("robot", robot)
        self.threshold = checks.positive_vector("threshold", threshold, robot.dof, "N m")
        self.bandwidth = checks.positive("bandwidth", bandwidth, "rad/s")
        self._base = None if base is None else poses.checked_pose(base, "base")
        self.reset()

    def reset(self) -> None:
        """Forget what was seen: the next step starts anew."""
        self._seen: tuple[Array, Array] | None = None  # momentum, and the part of its rate that needs no torque
        self._external = np.zeros(self.robot.dof)

    def step(self, q: ArrayLike, v: ArrayLike, torque: ArrayLike, dt: float) -> ContactStep:
        """Take one measurement; one that is refused leaves the observer as it was.

        Args:
            q: (dof,) joint angles now [rad].
            v: (dof,) joint velocities now [rad/s].
            torque: (dof,) mean torques of the motors on the joints since the step before [N m].
            dt: time since the step before [s]; the first step has none before it and sees no contact.

        Raises:
            InvalidInputError: malformed, or too large for the answer to be finite.
        """
        robot = self.robot
        at, velocity = robot.configuration(q), robot.configuration(v, "v")
        applied, dt = robot.configuration(torque, "torque"), checks.positive("dt", dt, "s")
        with np.errstate(over="ignore", invalid="ignore"):  # what does not fit is refused below
            bias = robot.coriolis(at, velocity).T @ velocity - robot.gravity(at, base=self._base)
            momentum = robot.mass_matrix(at) @ velocity
        external = self._external
        if self._seen is not None:
            before, bias_before = self._seen
            with np.errstate(over="ignore", invalid="ignore"):
                unexplained = (momentum - before) / dt - applied - 0.5 * (bias + bias_before)
                external = external - math.expm1(-self.bandwidth * dt) * (unexplained - external)
        if not (np.isfinite(external).all() and np.isfinite(momentum).all() and np.isfinite(bias).all()):
            raise InvalidInputError(dynamics.TOO_LARGE)
        self._seen, self._external = (momentum, bias), external
        beyond = np.abs(external) > self.threshold
        names = tuple(name for name, over in zip(robot.joint_names, beyond, strict=True) if over)
        return ContactStep(checks.read_only(external), names)
