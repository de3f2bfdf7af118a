"""The three-finger hand of the Kinova Jaco in MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError
from jacokin.model.descriptions import bundled, table
from jacokin.mujoco_bridge.base import RobotHand
from jacokin.mujoco_bridge.control.velocity_actuator import add_velocity_actuator
from jacokin.mujoco_bridge.observables.jaco import JacoHandObservables
from jacokin.mujoco_bridge.simulation.physics import Physics, check_physics

_FILE = "jaco_hand.xml"
_HAND_BODY = "hand"
_FINGER_GEOMS = "link_finger"
_GRIP_SITE = "gripsite"
_PINCH_SITE = "pinchsite"


class JacoHand(RobotHand):
    """The hand: three fingers with rigid tips, each with a velocity actuator."""

    def _build(self, name: str | None = None, use_pinch_site_as_tcp: bool = False) -> None:
        """Build the hand.

        Args:
            name: replaces ``jaco_hand`` in the names of its elements.
            use_pinch_site_as_tcp: use the pinch site, between the finger tips, as tool centre point instead of
                the grip site.
        """
        spec = self._mjcf_root = mujoco.MjSpec.from_file(str(bundled.urdf_folder() / _FILE))
        if name:
            spec.modelname = name
        fingers = table.load()["hands"][table.variant(bundled.DEFAULT_ROBOT)["hand"]]["fingers"]
        self._joints = [spec.joint(finger) for finger in fingers]
        self._grip_site = spec.site(_GRIP_SITE)
        self._pinch_site = spec.site(_PINCH_SITE)
        self._tool_center_point = self._pinch_site if use_pinch_site_as_tcp else self._grip_site
        self._hand_geom = list(spec.body(_HAND_BODY).geoms)
        self._finger_geoms = [geom for geom in spec.geoms if geom.name.startswith(_FINGER_GEOMS)]
        group = table.load()["finger"]["group"]
        self._actuators = [add_velocity_actuator(spec, joint, group) for joint in self._joints]

    def _build_observables(self) -> JacoHandObservables:
        return JacoHandObservables(self)

    @property
    def joints(self) -> list[mujoco.MjsJoint]:
        """The finger joints."""
        return self._joints

    @property
    def actuators(self) -> list[mujoco.MjsActuator]:
        """The velocity actuators, one per finger; ctrl is the desired velocity [rad/s], positive closes."""
        return self._actuators

    @property
    def tool_center_point(self) -> mujoco.MjsSite:
        """The grip site, or the pinch site with ``use_pinch_site_as_tcp=True``."""
        return self._tool_center_point

    @property
    def grip_site(self) -> mujoco.MjsSite:
        """The site in front of the palm, where objects are held."""
        return self._grip_site

    @property
    def pinch_site(self) -> mujoco.MjsSite:
        """The site between the finger tips."""
        return self._pinch_site

    @property
    def hand_geom(self) -> list[mujoco.MjsGeom]:
        """The geoms of the palm."""
        return self._hand_geom

    @property
    def finger_geoms(self) -> list[mujoco.MjsGeom]:
        """The geoms of the fingers and their tips."""
        return self._finger_geoms

    def set_grasp(self, physics: Physics, close_factors: float | Sequence[float]) -> None:
        """Set the finger positions between open and closed, without simulating.

        The velocity commands of the fingers become 0; velocities and the arm do not change.

        Args:
            physics: the simulation.
            close_factors: 0 for open (the lower limit), 1 for closed (the upper limit); one number for all fingers,
                or one per finger.

        Raises:
            InvalidInputError: not one number or one per finger, or outside 0..1.
        """
        fingers = check_physics(physics).bind(self.joints)
        factors = _checked_factors(close_factors, len(self.joints))
        lower, upper = fingers.range.T
        fingers.qpos = np.clip(lower + (upper - lower) * factors, lower, upper)
        physics.bind(self.actuators).ctrl = 0.0
        physics.after_reset()

    def set_home(self, physics: Physics) -> None:
        """Open the fingers at rest.

        Raises:
            InvalidInputError: the physics does not hold this hand.
        """
        check_physics(physics).bind(self.joints).qvel = 0.0
        self.set_grasp(physics, 0.0)


def _checked_factors(close_factors: float | Sequence[float], fingers: int) -> NDArray[np.float64]:
    try:
        factors = np.asarray(close_factors, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"close_factors must be numbers in 0..1, got {close_factors!r}") from error
    if factors.shape not in ((), (fingers,)):
        raise InvalidInputError(f"close_factors must be one number or {fingers}, got shape {factors.shape}")
    if not ((factors >= 0.0) & (factors <= 1.0)).all():
        raise InvalidInputError(f"close_factors must lie in 0..1, got {factors.tolist()}")
    return factors
