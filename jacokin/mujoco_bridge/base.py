"""Base classes of arms and hands: `RobotArm` and `RobotHand`.

Subclass them for a robot of your own: `_build` makes the spec; `joints` and `wrist_site` of an arm, `set_grasp` and
`tool_center_point` of a hand name its elements. Randomization, inverse kinematics and observables are inherited.
"""

from __future__ import annotations

import abc
import weakref
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from itertools import repeat

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, PhysicsError, shown
from jacokin.kernels.library import warmup
from jacokin.model import angles, checks
from jacokin.model.descriptions import bundled
from jacokin.model.poses import unit_quaternion
from jacokin.mujoco_bridge.control.site_ik import SiteSolver, Solution
from jacokin.mujoco_bridge.distributions import RandomState, check_random_state
from jacokin.mujoco_bridge.entity import Entity, check_name, rotation_matrix
from jacokin.mujoco_bridge.observables import JointsObservables, Observables
from jacokin.mujoco_bridge.simulation.physics import Physics, check_physics

__all__ = ["DOWN_QUATERNION", "JointsObservables", "RandomState", "RobotArm", "RobotHand"]

DOWN_QUATERNION = checks.read_only(bundled.robot_table()["arena"]["down"]["quat_wxyz"])
"""The tool pointing vertically down, wxyz."""

_DOWN = rotation_matrix(DOWN_QUATERNION)
_DOWN_NUMBERS: list[float] = _DOWN.ravel().tolist()


class RobotArm(Entity):
    """An arm: a chain of joints from a base to a wrist."""

    @property
    @abc.abstractmethod
    def joints(self) -> Sequence[mujoco.MjsJoint]:
        """The joint elements, from base to wrist."""

    @property
    @abc.abstractmethod
    def wrist_site(self) -> mujoco.MjsSite:
        """The site that hands are attached to."""

    @property
    def attachment_site(self) -> mujoco.MjsSite:
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
            PhysicsError: a joint without limits is not a hinge.
            InvalidInputError: an argument is wrong.
        """
        check_random_state(random_state)
        lower, upper = self.sampling_bounds(physics)
        physics.bind(self.joints).qpos = np.clip(random_state.uniform(lower, upper), lower, upper)

    def sampling_bounds(self, physics: Physics) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lower and upper bounds of the joints, (n,) each [rad, m on slide joints].

        Those of a hinge without limits are 0 and 2 pi.

        Raises:
            PhysicsError: a joint without limits is not a hinge.
            InvalidInputError: the arm names no joints.
        """
        if not len(checks.listed("joints", self.joints)):
            raise InvalidInputError(f"{type(self).__name__}.joints is empty")
        bound = check_physics(physics).bind(self.joints)
        lower, upper = bound.range.T.copy()
        unlimited = bound.limited == 0
        invalid = unlimited & (bound.type != mujoco.mjtJoint.mjJNT_HINGE)
        if invalid.any():
            names = ", ".join(repr(joint.name) for joint, wrong in zip(self.joints, invalid, strict=True) if wrong)
            raise PhysicsError(
                f"only hinges can be sampled without limits; these joints have none and are not hinges: {names}"
            )
        lower[unlimited], upper[unlimited] = 0.0, angles.TURN
        return lower, upper

    def set_site_to_xpos(
        self,
        physics: Physics,
        random_state: RandomState,
        site: mujoco.MjsSite | str,
        target_pos: ArrayLike,
        target_quat: ArrayLike | None = None,
        max_ik_attempts: int = 10,
    ) -> bool:
        """Set the joint positions, without simulating, so that a site has a given pose.

        Of all configurations within the joint limits the one nearest to the present is taken; hinges without limits
        end up in [0, 2 pi). Only the positions of the arm's joints change; on failure nothing changes.

        Poses and Jacobians of the scene follow at once, everything else as after `Physics.set_qpos`.

        Args:
            physics: the simulation.
            random_state: used only for restarts of the numerical solver, where there is no closed form.
            site: a site on the arm or on what is attached to it: an element, or its full name.
            target_pos: (3,) position of the site in the world [m].
            target_quat: (4,) orientation of the site in the world, wxyz; None for `DOWN_QUATERNION`.
            max_ik_attempts: starts of the numerical solver; 1 tries only the present configuration.

        Returns:
            Whether the site is at its target, within 1e-6 m and 1e-6 rad, as MuJoCo computes it, and the arm within its
            limits.

        Raises:
            InvalidInputError: an argument is wrong.
            UnknownNameError: no site has this name; lists the valid ones.
            ModelError: none of the arm's joints moves the site, or one on the way to it is not a hinge or slide.
            PhysicsError: positions or velocities in the scene are not finite.
        """
        check_random_state(random_state)
        position = checks.vector("target_pos", target_pos, 3, "m")
        if target_quat is None:
            rotation, numbers = _DOWN, _DOWN_NUMBERS
        else:
            rotation = rotation_matrix(unit_quaternion("target_quat", target_quat))
            numbers = rotation.ravel().tolist()
        attempts = checks.whole_number("max_ik_attempts", max_ik_attempts, 1)
        with check_physics(physics).lock:
            solver = self.site_solver(physics, site)
            found: Iterable[Solution]
            if solver.lists_all:
                found = solver.nearest(position, rotation)
            else:
                found = solver.solutions(position, rotation, self.sampling_bounds(physics), random_state, attempts)
            for rows, q in found:
                before = physics._try_qpos(rows, q)
                if solver.is_reached(q, position, numbers):
                    physics._keep_qpos()
                    return True
                physics._try_qpos(rows, before)
            return False

    def prepare(self, physics: Physics, site: mujoco.MjsSite | str | None = None) -> None:
        """Do now what `set_site_to_xpos` would do first: load the closed form, and make the solver of a site.

        Args:
            physics: the simulation.
            site: as in `set_site_to_xpos`; its solver is made, too. None for the closed form alone.

        Raises:
            JacokinError: as `site_solver`, or the compiled kernels do not load.
        """
        check_physics(physics)
        if site is None or self.site_solver(physics, site).lists_all:
            warmup()

    def site_solver(self, physics: Physics, site: mujoco.MjsSite | str) -> SiteSolver:
        """The inverse kinematics of a site in a physics; made once for each and kept.

        Args:
            physics: the simulation.
            site: a site on the arm or on what is attached to it: an element, or its full name.

        Raises:
            InvalidInputError: an argument is wrong.
            UnknownNameError: no site has this name; lists the valid ones.
            ModelError: none of the arm's joints moves the site, or one on the way to it is not a hinge or slide.
        """
        solvers = self._solvers.get(check_physics(physics))
        if solvers is None:
            solvers = self._solvers[physics] = {}
        try:
            return solvers[site]
        except (KeyError, TypeError):  # not kept yet, or something that cannot be a key
            number = _site_id(physics, site)
        solver = solvers[site] = SiteSolver(physics, physics.bind(self.joints).element_ids, number)
        return solver

    @cached_property
    def _solvers(self) -> weakref.WeakKeyDictionary[Physics, dict[mujoco.MjsSite | str, SiteSolver]]:
        return weakref.WeakKeyDictionary()


class RobotHand(Entity):
    """A hand: fingers, and a tool centre point between them."""

    @abc.abstractmethod
    def set_grasp(self, physics: Physics, close_factors: float | Sequence[float]) -> None:
        """Set the finger positions between open and closed, without simulating.

        Args:
            physics: the simulation.
            close_factors: 0 for open, 1 for closed; one number for all fingers, or one per finger.
        """

    @property
    @abc.abstractmethod
    def tool_center_point(self) -> mujoco.MjsSite:
        """The site that is moved to targets."""

    def _build_observables(self) -> Observables:
        return JointsObservables(self) if hasattr(self, "joints") else Observables(self)


class BundledPart(Entity):
    """The arm or the hand of a bundled robot, with an actuator on each joint."""

    def _read(
        self, part: str, robot: str, name: str | None, groups: Mapping[str, str], actuation: str = "velocity"
    ) -> mujoco.MjSpec:
        """Make the spec.

        Args:
            part: "arm" or "hand".
            robot: the bundled robot.
            name: replaces the name in the file.
            groups: joints in their order, and the group of each as in `add_actuator`.
            actuation: as in `add_actuator`.
        """
        spec = self._mjcf_root = mujoco.MjSpec.from_file(str(bundled.part_file(robot, part)))
        if name is not None:
            spec.modelname = check_name(name)
        self._robot_name = robot
        self._joints = [spec.joint(joint) for joint in groups]
        self._actuators = list(map(add_actuator, repeat(spec), self._joints, groups.values(), repeat(actuation)))
        return spec

    @property
    def robot_name(self) -> str:
        """The bundled robot whose part this is."""
        return self._robot_name

    @property
    def joints(self) -> list[mujoco.MjsJoint]:
        """The joint elements: of an arm from base to wrist, of a hand the fingers."""
        return self._joints

    @property
    def actuators(self) -> list[mujoco.MjsActuator]:
        """The actuators, one per joint; ctrl is the desired velocity [rad/s], positive closes a finger.

        Those of an arm made for it take torques [N m] or positions [rad].
        """
        return self._actuators


def add_actuator(spec: mujoco.MjSpec, joint: mujoco.MjsJoint, group: str, actuation: str) -> mujoco.MjsActuator:
    """Add an actuator to a joint, under the name of the joint. None gives more than the torque of its row.

    Args:
        spec: the spec of the joint.
        joint: the joint element.
        group: "large", "small" or "finger": the row with gains, speed and torque in ``urdf/jaco.toml``.
        actuation: "velocity", "torque" or "position": what its control is.
    """
    row = bundled.actuator(group)
    actuator = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    actuator.forcelimited = True
    actuator.forcerange = row["force_range"]  # [N m]
    if actuation == "velocity":
        actuator.set_to_velocity(kv=row["kv"])
        actuator.ctrllimited = True
        actuator.ctrlrange = row["ctrl_range"]  # [rad/s]
    elif actuation == "torque":
        actuator.set_to_motor()
        actuator.ctrllimited = True
        actuator.ctrlrange = row["force_range"]  # [N m]
    else:
        actuator.set_to_position(kp=row["kp"], kv=row["kv"])
        actuator.ctrllimited = joint.limited
        actuator.ctrlrange = joint.range  # [rad]
    return actuator


def _site_id(physics: Physics, site: mujoco.MjsSite | str) -> int:
    if isinstance(site, mujoco.MjsSite):
        return int(physics.bind(site).element_id)
    names = [physics.model.site(i).name for i in range(physics.model.nsite)]
    if not isinstance(site, str):
        raise InvalidInputError(
            f"site must be a site element or the full name of a site, got {shown(site)}. Sites: {', '.join(names)}"
        )
    return names.index(checks.choice("site", site, names))
