"""What every arm and every hand can do, whatever its make: `RobotArm` and `RobotHand`.

Subclass them for another robot: `_build` makes the spec, `joints` and `wrist_site` (of an arm), `set_grasp` and
`tool_center_point` (of a hand) say what is what in it. Randomization, inverse kinematics and observables come along.
"""

from __future__ import annotations

import abc
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, PhysicsError, UnknownNameError
from jacokin.model import checks, table
from jacokin.mujoco_bridge.control.site_ik import SceneSolvers, SiteSolver
from jacokin.mujoco_bridge.entities.entity import Entity
from jacokin.mujoco_bridge.entities.quaternions import rotation_matrix, unit_quaternion
from jacokin.mujoco_bridge.observables.joints import JointsObservables
from jacokin.mujoco_bridge.observables.observable import Observables
from jacokin.mujoco_bridge.simulation.physics import Physics, check_physics

RandomState = np.random.RandomState | np.random.Generator

__all__ = ["DOWN_QUATERNION", "JointsObservables", "RandomState", "RobotArm", "RobotHand"]

DOWN_QUATERNION = checks.read_only(table.load()["arena"]["down"]["quat_wxyz"])
"""The tool pointing vertically down, wxyz."""

_DOWN = rotation_matrix(DOWN_QUATERNION)


class RobotArm(Entity):
    """An arm: joints in a row from a base to a wrist."""

    @property
    @abc.abstractmethod
    def joints(self) -> Sequence[Any]:
        """The joint elements, base to wrist."""

    @property
    @abc.abstractmethod
    def wrist_site(self) -> Any:
        """The site that hands are attached to."""

    @property
    def attachment_site(self) -> Any:
        """The wrist site."""
        return self.wrist_site

    def _build_observables(self) -> Observables:
        return JointsObservables(self)

    def randomize_arm_joints(self, physics: Physics, random_state: RandomState) -> None:
        """Draw all joint positions uniformly from their ranges; a hinge without limits from [0, 2 pi).

        Args:
            physics: the simulation.
            random_state: drawn from once, ``random_state.uniform(lower, upper)``.

        Raises:
            PhysicsError: a joint without limits is no hinge.
            InvalidInputError: an argument is wrong.
        """
        check_random_state(random_state)
        lower, upper = self.sampling_bounds(physics)
        physics.bind(self.joints).qpos = np.clip(random_state.uniform(lower, upper), lower, upper)

    def sampling_bounds(self, physics: Physics) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lower and upper bounds of the joints, (n,) each [rad, m on slide joints]; [0, 2 pi] for free hinges.

        Raises:
            PhysicsError: a joint without limits is no hinge.
        """
        bound = check_physics(physics).bind(self.joints)
        lower, upper = bound.range.T.copy()
        unlimited = bound.limited == 0
        invalid = unlimited & (bound.type != mujoco.mjtJoint.mjJNT_HINGE)
        if invalid.any():
            names = ", ".join(repr(joint.name) for joint, wrong in zip(self.joints, invalid, strict=True) if wrong)
            raise PhysicsError(f"a joint that is no hinge must have limits to be sampled; these have none: {names}")
        lower[unlimited], upper[unlimited] = 0.0, 2.0 * np.pi
        return lower, upper

    def set_site_to_xpos(
        self,
        physics: Physics,
        random_state: RandomState,
        site: Any,
        target_pos: ArrayLike,
        target_quat: ArrayLike | None = None,
        max_ik_attempts: int = 10,
    ) -> bool:
        """Move the arm, at once and without simulating, so that a site has a given pose.

        Of all configurations within the joint limits the one nearest to the present is taken; hinges without limits
        end up in [0, 2 pi). Nothing but the positions of the arm's joints changes, and nothing at all on failure.

        Args:
            physics: the simulation.
            random_state: drawn from only for restarts of the numerical solver, where no closed form exists.
            site: a site on the arm or on what is attached to it: an element, or its full name.
            target_pos: (3,) position of the site in the world [m].
            target_quat: (4,) orientation of the site in the world, wxyz; None for pointing down.
            max_ik_attempts: starts of the numerical solver; 1 tries the present configuration alone.

        Returns:
            Whether the site is at its target, within 1e-6 m and 1e-6 rad.

        Raises:
            InvalidInputError: an argument is wrong.
            UnknownNameError: no site of this name; lists those there are.
            PhysicsError: positions or velocities in the scene are not finite.
        """
        check_random_state(random_state)
        position = checks.vector("target_pos", target_pos, 3, "m")
        rotation = _DOWN if target_quat is None else rotation_matrix(unit_quaternion("target_quat", target_quat))
        if (
            isinstance(max_ik_attempts, bool)
            or not isinstance(max_ik_attempts, int | np.integer)
            or max_ik_attempts < 1
        ):
            raise InvalidInputError(f"max_ik_attempts must be a whole number >= 1, got {max_ik_attempts!r}")
        solver = self.site_solver(check_physics(physics), site)
        bounds = None if solver.has_closed_form else self.sampling_bounds(physics)
        for rows, q in solver.solutions(position, rotation, bounds, random_state, int(max_ik_attempts)):
            physics.set_qpos(rows, q)
            return True
        return False

    def site_solver(self, physics: Physics, site: Any) -> SiteSolver:
        """What solves for a site in a physics: kept, since making it takes milliseconds.

        Args:
            physics: the simulation.
            site: a site on the arm or on what is attached to it: an element, or its full name.

        Raises:
            InvalidInputError: an argument is wrong.
            UnknownNameError: no site of this name; lists those there are.
            ModelError: the arm does not move the site.
        """
        known = self._solvers.known(physics, site)
        if known is not None:
            return known
        joints = check_physics(physics).bind(self.joints).element_ids
        return self._solvers.keep(physics, site, SiteSolver(physics, joints, _site_id(physics, site)))

    @property
    def _solvers(self) -> SceneSolvers:
        found: SceneSolvers | None = vars(self).get("_scene_solvers")
        if found is None:
            found = self._scene_solvers = SceneSolvers()
        return found


class RobotHand(Entity):
    """A hand: something that grasps, with a point where it does."""

    @abc.abstractmethod
    def set_grasp(self, physics: Physics, close_factors: float | Sequence[float]) -> None:
        """Put the fingers somewhere between open and closed, at once and without simulating.

        Args:
            physics: the simulation.
            close_factors: 0 for open, 1 for closed; one number for all fingers, or one per finger.
        """

    @property
    @abc.abstractmethod
    def tool_center_point(self) -> Any:
        """The site that is brought to a target."""

    def _build_observables(self) -> Observables:
        return JointsObservables(self) if hasattr(self, "joints") else Observables(self)


def check_random_state(random_state: RandomState) -> None:
    """Refuse what numbers cannot be drawn from.

    Raises:
        InvalidInputError: neither a `numpy.random.RandomState` nor a `numpy.random.Generator`.
    """
    if not isinstance(random_state, RandomState):
        raise InvalidInputError(
            f"random_state must be a numpy.random.RandomState or numpy.random.Generator, got {random_state!r}"
        )


def _site_id(physics: Physics, site: Any) -> int:
    if isinstance(site, mujoco.MjsSite):
        return int(physics.bind(site).element_id)
    names = [physics.model.site(i).name for i in range(physics.model.nsite)]
    if not isinstance(site, str):
        raise InvalidInputError(
            f"site must be a site element or the full name of a site, got {site!r}. Sites: {', '.join(names)}"
        )
    if site not in names:
        raise UnknownNameError("site", site, names)
    return names.index(site)
