"""Initial poses drawn at random, free of collisions: of the tool centre point, and of props, which come to rest."""

from __future__ import annotations

import logging
import weakref
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import EpisodeInitializationError, InvalidInputError, PhysicsError, shown
from jacokin.model import checks
from jacokin.model.poses import unit_quaternion
from jacokin.mujoco_bridge.base import DOWN_QUATERNION, RobotArm, RobotHand
from jacokin.mujoco_bridge.control.site_ik import Solution
from jacokin.mujoco_bridge.distributions import (
    IDENTITY_QUATERNION,
    RandomState,
    Sampler,
    check_random_state,
    constant_or_sampler,
)
from jacokin.mujoco_bridge.entity import Entity, rotation_matrix
from jacokin.mujoco_bridge.simulation.elements import qpos_rows
from jacokin.mujoco_bridge.simulation.physics import Physics, check_physics

BRANCHES = ("random", "nearest", "nearest_to_random")

_log = logging.getLogger(__name__)

Geoms = NDArray[np.bool_]  # one flag for each geom of the model
Pairs = tuple[tuple[Geoms, Geoms], ...]

_FULL = int(mujoco.mjtWarning.mjWARN_CONTACTFULL)
_TRIALS: weakref.WeakKeyDictionary[Physics, Trial] = weakref.WeakKeyDictionary()


class ToolCenterPointInitializer:
    """Places the tool centre point of a hand at sampled poses.

    A configuration is rejected when the arm touches itself, the hand, or anything without a free joint, or when the
    hand touches the latter. Every branch of a pose is tried before another pose is sampled, unless branches are chosen
    by random starts.
    """

    def __init__(
        self,
        hand: RobotHand | None,
        arm: RobotArm,
        position: ArrayLike | Sampler,
        quaternion: ArrayLike | Sampler = DOWN_QUATERNION,
        ignore_collisions: bool = False,
        max_ik_attempts: int = 10,
        max_rejection_samples: int = 10,
        *,
        branch: str = "random",
    ) -> None:
        """Set what is placed and where.

        Args:
            hand: the hand on the arm; None to place the arm's wrist site.
            arm: the arm.
            position: (3,) in the world [m], or a sampler of positions such as `uniform_box`.
            quaternion: (4,) wxyz, or a sampler of quaternions.
            ignore_collisions: accept the first configuration.
            max_ik_attempts: starts for each pose, where the arm has no closed form or branches are chosen by starts.
            max_rejection_samples: poses to try.
            branch: "random" tries the branches of a pose in random order, so that each is equally likely to come
                first; "nearest" in the order of their distance to the present configuration; "nearest_to_random"
                takes the one nearest to a random start, as a numerical solver finds it, and another start when that
                collides.

        Raises:
            UnknownNameError: no such branch.
            InvalidInputError: another argument is wrong.
        """
        if not isinstance(arm, RobotArm) or not isinstance(hand, RobotHand | None):
            raise InvalidInputError(
                f"hand and arm must be a RobotHand and a RobotArm, got {shown(hand)} and {shown(arm)}"
            )
        self._hand = hand
        self._arm = arm
        self._position = constant_or_sampler("position", position)
        self._quaternion = constant_or_sampler("quaternion", quaternion)
        self._ignore_collisions = checks.flag("ignore_collisions", ignore_collisions)
        self._max_ik_attempts = checks.whole_number("max_ik_attempts", max_ik_attempts, 1)
        self._max_rejection_samples = checks.whole_number("max_rejection_samples", max_rejection_samples, 1)
        self._branch = checks.choice("branch", branch, BRANCHES)

    def __call__(self, physics: Physics, random_state: RandomState) -> None:
        """Place the tool centre point; only the arm's joint positions change.

        Args:
            physics: the simulation.
            random_state: the source of random numbers.

        Raises:
            EpisodeInitializationError: no sampled pose has a configuration free of collisions; nothing is changed.
            InvalidInputError: a sampler returns something else than a position or quaternion.
        """
        check_random_state(random_state)
        with check_physics(physics).lock:
            solutions, trial = self._solutions_by(physics, random_state), trial_of(physics)
            for _ in range(self._max_rejection_samples):
                for rows, q in solutions(*self._pose(random_state)):
                    if self._is_free(physics, trial, rows, q):
                        physics.set_qpos(rows, q)
                        return
        raise self._failure()

    def _solutions_by(
        self, physics: Physics, random_state: RandomState
    ) -> Callable[[Array, Array], Iterator[Solution]]:
        """What gives the solutions at a position (3,) and an orientation (3, 3) in the world, in their order."""
        solver, attempts = self._arm.site_solver(physics, self._site), self._max_ik_attempts
        if self._branch == "nearest_to_random":
            bounds = self._arm.sampling_bounds(physics)
            return partial(solver.nearest_to_random, bounds=bounds, random_state=random_state, attempts=attempts)
        return partial(
            solver.solutions,
            bounds=None if solver.lists_all else self._arm.sampling_bounds(physics),
            random_state=random_state,
            attempts=attempts,
            shuffle=self._branch == "random",
        )

    @property
    def _site(self) -> mujoco.MjsSite:
        return self._arm.wrist_site if self._hand is None else self._hand.tool_center_point

    def _pose(self, random_state: RandomState) -> tuple[Array, Array]:
        """A position (3,) and an orientation (3, 3) in the world."""
        position = checks.vector("position", self._position(None, None, random_state), 3, "m")
        quat_wxyz = unit_quaternion("quaternion", self._quaternion(None, None, random_state))
        return position, rotation_matrix(quat_wxyz)

    def _is_free(self, physics: Physics, trial: Trial, rows: NDArray[np.intp], q: Array) -> bool:
        """Whether a configuration may be taken; `trial` is at the present positions otherwise."""
        if self._ignore_collisions:
            return True
        bodies = [each.root_body for each in (self._arm, self._hand) if each is not None]
        key = physics.bind(bodies).element_ids
        if key not in trial.arms:
            trial.arms[key] = arm_pairs(physics, self._arm, self._hand)
        trial.qpos[rows] = q
        return not trial.touching(*trial.arms[key])

    def _failure(self) -> EpisodeInitializationError:
        return EpisodeInitializationError(
            f"none of {self._max_rejection_samples} poses sampled for the tool centre point has a configuration within "
            "the joint limits and free of collisions. Sample from another region, raise max_rejection_samples, or set "
            "ignore_collisions=True"
        )


TcpInitializer = ToolCenterPointInitializer
"""`ToolCenterPointInitializer`, by its shorter name."""


class Trial:
    """A second `mujoco.MjData` of a model, in which configurations are tried out.

    Attributes:
        qpos: the configuration to try.
        arms: the pairs of sets of geoms that must not touch, by the ids of the bodies that hold an arm and its hand.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        """Make the data."""
        self._model = model
        self._data = mujoco.MjData(model)
        self.qpos: Array = self._data.qpos
        self.arms: dict[tuple[int, ...], Pairs] = {}

    def follow_mocap(self, physics: Physics) -> None:
        """Copy the poses of the mocap bodies of a simulation."""
        data = physics.data
        self._data.mocap_pos[:], self._data.mocap_quat[:] = data.mocap_pos, data.mocap_quat

    def touching(self, *pairs: tuple[Geoms, Geoms]) -> bool:
        """Whether, for one of the pairs of sets, a geom of the first set touches one of the second, at `qpos`.

        A configuration with more contacts than MuJoCo has memory for counts as touching.
        """
        data = self._data
        data.warning.number[_FULL] = 0
        try:
            mujoco.mj_kinematics(self._model, data)
            mujoco.mj_comPos(self._model, data)
            mujoco.mj_collision(self._model, data)
        except mujoco.FatalError:
            return True
        if data.warning.number[_FULL]:
            return True
        contact = data.contact
        near = contact.dist <= 0.0
        one, other = contact.geom1[near], contact.geom2[near]
        return any(bool((a[one] & b[other]).any() or (b[one] & a[other]).any()) for a, b in pairs)


def trial_of(physics: Physics) -> Trial:
    """The trial data of a simulation, made once, at the present positions."""
    trial = _TRIALS.get(physics)
    if trial is None:
        trial = _TRIALS[physics] = Trial(physics.model)
    trial.qpos[:] = physics.data.qpos
    trial.follow_mocap(physics)
    return trial


def bodies_of(physics: Physics, entity: Entity) -> NDArray[np.bool_]:
    """For each body whether it belongs to an entity or to one attached to it."""
    model = physics.model
    top = int(physics.bind(entity.root_body).element_ids[0])
    found = np.zeros(model.nbody, dtype=bool)
    found[top] = True
    for body in range(top + 1, model.nbody):
        found[body] = found[model.body_parentid[body]]
    return found


def arm_pairs(physics: Physics, arm: Entity, hand: Entity | None) -> Pairs:
    """The pairs of sets of geoms that must not touch: the arm and all but free things, the hand and fixed things."""
    model = physics.model
    with_hand = bodies_of(physics, arm)
    in_hand = np.zeros(model.nbody, dtype=bool) if hand is None else bodies_of(physics, hand)
    in_arm = with_hand & ~in_hand
    free_roots = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
    fixed = ~np.isin(model.body_rootid, free_roots) & ~with_hand & ~in_hand
    geom_body = model.geom_bodyid
    return (in_arm[geom_body], (in_arm | in_hand | fixed)[geom_body]), (in_hand[geom_body], fixed[geom_body])


class PropPlacer:
    """Places props one after the other at sampled poses, free of contact, and lets them come to rest."""

    def __init__(
        self,
        props: Sequence[Entity],
        position: ArrayLike | Sampler,
        quaternion: ArrayLike | Sampler = IDENTITY_QUATERNION,
        ignore_collisions: bool = False,
        max_qvel_tol: float = 1e-3,  # dm_control's
        max_qacc_tol: float = 1e-2,  # dm_control's
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
                trial.qpos[row : row + 3] = number * 1e3  # [m] each where no other is
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
    rows = [qpos_rows(model, joint) for joint in np.flatnonzero(bodies[model.jnt_bodyid]).tolist()]
    return np.concatenate([np.empty(0, dtype=np.intp), *rows])


def _entities(name: str, value: Sequence[Entity]) -> tuple[Entity, ...]:
    if not isinstance(value, list | tuple) or not all(isinstance(each, Entity) for each in value):
        raise InvalidInputError(f"{name} must be a list of entities, got {checks.shown(value)}")
    return tuple(value)


def _free_rows(physics: Physics, prop: Entity) -> int | None:
    """Address in qpos of a prop's free joint; None if it is fixed."""
    joint = prop.freejoint
    return None if joint is None else int(physics.model.jnt_qposadr[physics.bind(joint).element_ids[0]])
