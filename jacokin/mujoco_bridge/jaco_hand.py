"""The hands of the bundled Jacos and Micos, with three or two fingers, in MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks
from jacokin.model.descriptions import bundled
from jacokin.mujoco_bridge.base import BundledPart, RobotHand
from jacokin.mujoco_bridge.observables import JointsObservables, MJCFFeature, Observable, observable
from jacokin.mujoco_bridge.simulation.physics import Physics, check_physics

_HANDS = {3: bundled.DEFAULT_ROBOT, 2: "j2n6s200"}  # whose hand is taken, by the number of fingers
_PINCH_SITE = "pinchsite"


class JacoHand(BundledPart, RobotHand):
    """The hand: three or two fingers with rigid tips, each with a velocity actuator."""

    def _build(
        self,
        name: str | None = None,
        use_pinch_site_as_tcp: bool = False,
        fingers: int | None = None,
        robot: str | None = None,
    ) -> None:
        """Build the hand.

        Args:
            name: replaces ``jaco_hand`` in the names of its elements.
            use_pinch_site_as_tcp: use the pinch site, between the finger tips, as tool centre point instead of
                the grip site; the hand with two fingers has none.
            fingers: 3 (the default) or 2.
            robot: the bundled robot whose hand it is, which determines its masses: the j2n6s300 has the palm's mass in
                the hand, all others in the last link of the arm. None for the j2n6s300 or,
                with two fingers, the j2n6s200.

        Raises:
            UnknownNameError: no bundled Jaco has this name; lists the valid ones.
            InvalidInputError: another number of fingers, or no pinch site where it is asked for.
        """
        robot = _robot_with(fingers, robot)
        group = bundled.robot_table()["finger"]["group"]
        spec = self._read("hand", robot, name, dict.fromkeys(bundled.hand(robot)["fingers"], group))
        self._grip_site = spec.site("gripsite")
        self._pinch_site = spec.site(_PINCH_SITE)
        self._tool_center_point = (
            self.pinch_site if checks.flag("use_pinch_site_as_tcp", use_pinch_site_as_tcp) else self.grip_site
        )
        self._hand_geom = list(spec.body("hand").geoms)
        self._finger_geoms = [geom for geom in spec.geoms if geom.name.startswith("link_finger")]

    def _build_observables(self) -> JacoHandObservables | TwoFingerHandObservables:
        return TwoFingerHandObservables(self) if self._pinch_site is None else JacoHandObservables(self)

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
        """The site between the finger tips.

        Raises:
            InvalidInputError: the hand has two fingers, for which no source gives one.
        """
        if self._pinch_site is None:
            raise InvalidInputError("the hand with two fingers has no pinch site; use its grip_site")
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


def has_pinch_site(robot: str) -> bool:
    """Whether the hand of a bundled robot has a pinch site.

    Raises:
        UnknownNameError: no bundled Jaco has this name; lists the valid ones.
    """
    return _PINCH_SITE in bundled.hand(checks.choice("robot", robot, bundled.JACOS))["sites"]


def _robot_with(fingers: int | None, robot: str | None) -> str:
    """The bundled robot whose hand has so many fingers."""
    if fingers is not None and checks.whole_number("fingers", fingers) not in _HANDS:
        raise InvalidInputError(f"fingers must be 3 or 2, got {shown(fingers)}")
    name = _HANDS[3 if fingers is None else fingers] if robot is None else checks.choice("robot", robot, bundled.JACOS)
    count = len(bundled.hand(name)["fingers"])
    if fingers is not None and count != fingers:
        raise InvalidInputError(f"the hand of the {name} has {count} fingers, not {fingers}")
    return name


def _checked_factors(close_factors: float | Sequence[float], fingers: int) -> NDArray[np.float64]:
    factors = checks.array("close_factors", close_factors, "numbers in 0..1")
    if factors.shape not in ((), (fingers,)):
        raise InvalidInputError(f"close_factors must be one number or {fingers}, got shape {factors.shape}")
    if not ((factors >= 0.0) & (factors <= 1.0)).all():
        raise InvalidInputError(f"close_factors must lie in 0..1, got {factors.tolist()}")
    return factors


class TwoFingerHandObservables(JointsObservables):
    """Finger positions and velocities, pose of the grip site: the hand with two fingers has no pinch site."""

    @observable
    def grip_site_pos(self) -> Observable:
        """Position of the grip site in the world, (3,) [m]."""
        return MJCFFeature("xpos", self._entity.grip_site)

    @observable
    def grip_site_rmat(self) -> Observable:
        """Rotation matrix R_world_gripsite in row-major order, (9,)."""
        return MJCFFeature("xmat", self._entity.grip_site)


class JacoHandObservables(JointsObservables):
    """Finger positions and velocities, pose of the pinch site."""

    @observable
    def pinch_site_pos(self) -> Observable:
        """Position of the pinch site in the world, (3,) [m]."""
        return MJCFFeature("xpos", self._entity.pinch_site)

    @observable
    def pinch_site_rmat(self) -> Observable:
        """Rotation matrix R_world_pinchsite in row-major order, (9,)."""
        return MJCFFeature("xmat", self._entity.pinch_site)
