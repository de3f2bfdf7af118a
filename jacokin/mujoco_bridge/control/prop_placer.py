"""Initial poses of props: drawn, free of collisions, and at rest."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import EpisodeInitializationError, InvalidInputError, PhysicsError
from jacokin.model import checks
from jacokin.model.poses import unit_quaternion
from jacokin.mujoco_bridge.control.collisions import Trial, bodies_of, trial_of
from jacokin.mujoco_bridge.distributions import (
    IDENTITY_QUATERNION,
    RandomState,
    Sampler,
    check_random_state,
    constant_or_sampler,
)
from jacokin.mujoco_bridge.entity import Entity
from jacokin.mujoco_bridge.simulation.elements import QPOS_SIZE
from jacokin.mujoco_bridge.simulation.physics import Physics, check_physics

MAX_QVEL = 1e-3  # [rad/s, m/s] of a prop at rest, as in dm_control
MAX_QACC = 1e-2  # [rad/s^2, m/s^2] likewise
_AWAY = 1e3  # [m] where props wait that are not placed yet; each at another multiple

_log = logging.getLogger(__name__)


class PropPlacer:
    """Places props one after the other at sampled poses, free of contact, and lets them come to rest."""

    def __init__(
        self,
        props: Sequence[Entity],
        position: ArrayLike | Sampler,
        quaternion: ArrayLike | Sampler = IDENTITY_QUATERNION,
        ignore_collisions: bool = False,
        max_qvel_tol: float = MAX_QVEL,
        max_qacc_tol: float = MAX_QACC,
        max_attempts_per_prop: int = 20,
        settle_physics: bool = False,
        min_settle_physics_time: float = 0.0,
        max_settle_physics_time: float = 2.0,
        max_settle_physics_attempts: int = 1,
        raise_exception_on_settle_failure: bool = False,
    ) -> None:
        """Set what is placed and where.

        Args:
            props: the entities to place, in this order.
            position: (3,) [m], in the world for a free prop, or a sampler of positions such as `uniform_box`.
            quaternion: (4,) wxyz, or a sampler of quaternions.
            ignore_collisions: accept the first pose.
            max_qvel_tol: velocity below which a joint of a prop is at rest [rad/s, m/s].
            max_qacc_tol: acceleration below which a joint of a prop is at rest [rad/s^2, m/s^2].
            max_attempts_per_prop: poses to try for each prop.
            settle_physics: simulate until the props are at rest, with everything else held still.
            min_settle_physics_time: least time of a settling [s].
            max_settle_physics_time: most time of a settling [s].
            max_settle_physics_attempts: how often to place all props anew when they do not come to rest.
            raise_exception_on_settle_failure: raise when the props do not come to rest, instead of logging a warning.

        Raises:
            InvalidInputError: an argument is wrong.
        """
        self._props = _entities("props", props)
        self._position = constant_or_sampler("position", position)
        self._quaternion = constant_or_sampler("quaternion", quaternion)
        self._ignore_collisions = checks.flag("ignore_collisions", ignore_collisions)
        self._max_qvel = checks.positive("max_qvel_tol", max_qvel_tol)
        self._max_qacc = checks.positive("max_qacc_tol", max_qacc_tol)
        self._attempts = checks.whole_number("max_attempts_per_prop", max_attempts_per_prop, 1)
        self._settles = checks.flag("settle_physics", settle_physics)
        self._shortest = checks.non_negative("min_settle_physics_time", min_settle_physics_time, "s")
        self._longest = checks.positive("max_settle_physics_time", max_settle_physics_time, "s")
        self._settle_attempts = checks.whole_number("max_settle_physics_attempts", max_settle_physics_attempts, 1)
        self._raises = checks.flag("raise_exception_on_settle_failure", raise_exception_on_settle_failure)

    def __call__(
        self,
        physics: Physics,
        random_state: RandomState,
        ignore_contacts_with_entities: Sequence[Entity] | None = None,
    ) -> None:
        """Place the props.

        Args:
            physics: the simulation.
            random_state: the source of random numbers.
            ignore_contacts_with_entities: entities that a prop may touch while it is placed, for example because
                they are placed later.

        Raises:
            EpisodeInitializationError: no pose free of collisions was found for a prop, or, if so configured, the props
                do not come to rest; nothing is changed.
            InvalidInputError: an argument is wrong, or a sampler returns something else than a position or quaternion.
        """
        check_random_state(random_state)
        others = () if ignore_contacts_with_entities is None else ignore_contacts_with_entities
        ignored = _entities("ignore_contacts_with_entities", others)
        with check_physics(physics).lock:
            self._run(physics, random_state, ignored)

    def _run(self, physics: Physics, random_state: RandomState, ignored: Sequence[Entity]) -> None:
        state, poses = physics.get_state(), [prop.get_pose(physics) for prop in self._props]
        try:
            for _ in range(self._settle_attempts):
                self._place(physics, random_state, ignored)
                if not self._settles:
                    return
                last = self._settle(physics)
                if last.success:
                    return
            self._report(last)
        except BaseException:
            for prop, pose in zip(self._props, poses, strict=True):
                prop.set_pose(physics, *pose)
            physics.set_state(state)
            raise

    def _place(self, physics: Physics, random_state: RandomState, ignored: Sequence[Entity]) -> None:
        """Draw poses until each prop is free of contacts with what is placed."""
        trial = trial_of(physics)
        geom_body = physics.model.geom_bodyid
        placed = np.ones(physics.model.ngeom, dtype=bool)
        masks = [bodies_of(physics, prop)[geom_body] for prop in self._props]
        for mask in (*masks, *(bodies_of(physics, entity)[geom_body] for entity in ignored)):
            placed &= ~mask
        rows = [_free_rows(physics, prop) for prop in self._props]
        for number, row in enumerate(rows, 1):
            if row is not None:
                trial.qpos[row : row + 3] = number * _AWAY
        for prop, mask, row in zip(self._props, masks, rows, strict=True):
            placed |= mask
            self._place_one(physics, random_state, prop, trial, row, (mask, placed))

    def _place_one(
        self,
        physics: Physics,
        random_state: RandomState,
        prop: Entity,
        trial: Trial,
        row: int | None,
        pair: tuple[NDArray[np.bool_], NDArray[np.bool_]],
    ) -> None:
        first = prop.get_pose(physics)
        position, quat_wxyz = first
        for _ in range(self._attempts):
            position = checks.vector("position", self._position(first[0], position, random_state), 3, "m")
            quat_wxyz = unit_quaternion("quaternion", self._quaternion(first[1], quat_wxyz, random_state))
            if row is None:
                prop.set_pose(physics, position, quat_wxyz)
                trial.follow_mocap(physics)
            else:
                trial.qpos[row : row + 7] = *position, *quat_wxyz
            if self._ignore_collisions or not trial.touching(pair):
                prop.set_pose(physics, position, quat_wxyz)
                return
        raise EpisodeInitializationError(
            f"no pose free of collisions was found for {prop.name!r} in {self._attempts} attempts. Sample from a "
            "larger region, raise max_attempts_per_prop, or set ignore_collisions=True"
        )

    def _settle(self, physics: Physics) -> Settled:
        """Simulate until the props are at rest; everything else keeps its position and velocity.

        Simulated time is put back afterwards.
        """
        model, data = physics.model, physics.data
        bodies = np.zeros(model.nbody, dtype=bool)
        for prop in self._props:
            bodies |= bodies_of(physics, prop)
        dofs = np.flatnonzero(bodies[model.dof_bodyid])
        if not len(dofs):
            return Settled(True, 0.0, 0.0)
        other_dofs = np.flatnonzero(~bodies[model.dof_bodyid])
        other_qpos = _qpos_rows(model, ~bodies)
        qpos, qvel, time = data.qpos[other_qpos], data.qvel[other_dofs], data.time
        velocity = acceleration = np.inf
        try:
            while data.time - time < self._longest:
                try:
                    physics.step()
                    data.qpos[other_qpos], data.qvel[other_dofs] = qpos, qvel
                    physics.forward()  # accelerations where the props are now, not a step ago
                except PhysicsError:
                    return Settled(False, np.inf, np.inf)
                velocity = float(np.abs(data.qvel[dofs]).max())
                acceleration = float(np.abs(data.qacc[dofs]).max())
                is_slow = velocity < self._max_qvel and acceleration < self._max_qacc
                if is_slow and data.time - time > self._shortest:
                    return Settled(True, velocity, acceleration)
        finally:
            data.time = time
        return Settled(False, velocity, acceleration)

    def _report(self, last: Settled) -> None:
        message = (
            f"the props did not come to rest in {self._settle_attempts} attempts of {self._longest:g} s"
            f": velocity {last.velocity:.3g}, acceleration {last.acceleration:.3g}. Raise max_settle_physics_time or "
            "max_settle_physics_attempts, or sample from another region"
        )
        if self._raises:
            raise EpisodeInitializationError(message)
        _log.warning(message)


class Settled(NamedTuple):
    """How a settling ended.

    Attributes:
        success: whether all joints came to rest in time.
        velocity: greatest absolute velocity at the end [rad/s, m/s].
        acceleration: greatest absolute acceleration at the end [rad/s^2, m/s^2].
    """

    success: bool
    velocity: float
    acceleration: float


def _qpos_rows(model: mujoco.MjModel, bodies: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Addresses in qpos of the joints of some bodies."""
    rows = [
        np.arange(model.jnt_qposadr[joint], model.jnt_qposadr[joint] + QPOS_SIZE[model.jnt_type[joint]])
        for joint in np.flatnonzero(bodies[model.jnt_bodyid])
    ]
    return np.concatenate([np.empty(0, dtype=np.intp), *rows]).astype(np.intp)


def _entities(name: str, value: Sequence[Entity]) -> tuple[Entity, ...]:
    if not isinstance(value, list | tuple) or not all(isinstance(each, Entity) for each in value):
        raise InvalidInputError(f"{name} must be a list of entities, got {checks.shown(value)}")
    return tuple(value)


def _free_rows(physics: Physics, prop: Entity) -> int | None:
    """Address in qpos of a prop's free joint; None if it is fixed."""
    joint = prop.freejoint
    return None if joint is None else int(physics.model.jnt_qposadr[physics.bind(joint).element_ids[0]])
