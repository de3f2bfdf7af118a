"""Initial poses of the arm: the tool centre point at random poses, free of collisions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, PhysicsError
from jacokin.model import checks
from jacokin.mujoco_bridge.base import DOWN_QUATERNION, RandomState, RobotArm, RobotHand, check_random_state
from jacokin.mujoco_bridge.entities.entity import Entity
from jacokin.mujoco_bridge.quaternions import rotation_matrix, unit_quaternion
from jacokin.mujoco_bridge.simulation.physics import Physics, check_physics

Array = NDArray[np.float64]
Sampler = Callable[[RandomState], ArrayLike]


def uniform_box(lower: ArrayLike, upper: ArrayLike) -> Sampler:
    """A sampler of positions (3,) [m], uniform between two corners.

    Raises:
        InvalidInputError: malformed corners, or lower above upper.
    """
    low, high = checks.vector("lower", lower, 3, "m"), checks.vector("upper", upper, 3, "m")
    if (low > high).any():
        raise InvalidInputError(f"lower must not be above upper, got {low.tolist()} and {high.tolist()}")
    return lambda random_state: random_state.uniform(low, high)


class TcpInitializer:
    """Places the tool centre point of a hand at sampled poses.

    A configuration is rejected when the arm touches itself, the hand, or anything without a free joint, or when the
    hand touches the latter. Every branch of a pose is tried before another pose is sampled.
    """

    def __init__(
        self,
        hand: RobotHand | None,
        arm: RobotArm,
        position: ArrayLike | Sampler,
        quaternion: ArrayLike | Sampler = DOWN_QUATERNION,
        *,
        ignore_collisions: bool = False,
        max_ik_attempts: int = 10,
        max_rejection_samples: int = 10,
    ) -> None:
        """Set what is placed and where.

        Args:
            hand: the hand on the arm; None to place the arm's wrist site.
            arm: the arm.
            position: (3,) in the world [m], or a callable of a random state that samples one, such as `uniform_box`.
            quaternion: (4,) wxyz, or a callable of a random state that samples one.
            ignore_collisions: accept the first configuration.
            max_ik_attempts: starts of the numerical solver for each pose, where the arm has no closed form.
            max_rejection_samples: poses to try.

        Raises:
            InvalidInputError: an argument is wrong.
        """
        if not isinstance(arm, RobotArm) or not isinstance(hand, RobotHand | None):
            raise InvalidInputError(f"hand and arm must be a RobotHand and a RobotArm, got {hand!r} and {arm!r}")
        self._hand = hand
        self._arm = arm
        self._position = position
        self._quaternion = quaternion
        self._ignore_collisions = checks.flag("ignore_collisions", ignore_collisions)
        self._max_ik_attempts = checks.whole_number("max_ik_attempts", max_ik_attempts, 1)
        self._max_rejection_samples = checks.whole_number("max_rejection_samples", max_rejection_samples, 1)

    def __call__(self, physics: Physics, random_state: RandomState) -> None:
        """Place the tool centre point; only the arm's joint positions change.

        Args:
            physics: the simulation.
            random_state: the source of random numbers.

        Raises:
            PhysicsError: no pose sampled has a configuration free of collisions; nothing is changed then.
            InvalidInputError: a sampler returns something else than a position or quaternion.
        """
        check_random_state(random_state)
        solver = self._arm.site_solver(
            check_physics(physics), self._arm.wrist_site if self._hand is None else self._hand.tool_center_point
        )
        bounds = None if solver.has_closed_form else self._arm.sampling_bounds(physics)
        collisions = _Collisions(physics, self._arm, self._hand)
        for _ in range(self._max_rejection_samples):
            position = checks.vector("position", _draw(self._position, random_state), 3, "m")
            rotation = rotation_matrix(unit_quaternion("quaternion", _draw(self._quaternion, random_state)))
            for rows, q in solver.solutions(position, rotation, bounds, random_state, self._max_ik_attempts):
                if self._ignore_collisions or not collisions.any_with(rows, q):
                    physics.set_qpos(rows, q)
                    return
        raise PhysicsError(
            f"none of {self._max_rejection_samples} poses sampled for the tool centre point has a configuration within "
            "the joint limits and free of collisions"
        )


def _draw(value: ArrayLike | Sampler, random_state: RandomState) -> ArrayLike:
    return value(random_state) if callable(value) else value


class _Collisions:
    """Checks configurations of a robot for contacts."""

    def __init__(self, physics: Physics, arm: RobotArm, hand: RobotHand | None) -> None:
        self._physics = physics
        self._data = mujoco.MjData(physics.model)
        model = physics.model
        bodies = range(model.nbody)
        in_arm = _below(physics, arm)
        in_hand = np.zeros(model.nbody, dtype=bool) if hand is None else _below(physics, hand)
        free = np.array([_is_free(model, int(model.body_rootid[body])) for body in bodies])
        self._arm = (in_arm & ~in_hand)[model.geom_bodyid]
        self._robot = (in_arm | in_hand)[model.geom_bodyid]
        self._fixed = (~free & ~in_arm & ~in_hand)[model.geom_bodyid]

    def any_with(self, rows: NDArray[np.intp], q: Array) -> bool:
        """Whether the robot touches itself (except the hand itself) or something fixed, with q at these addresses."""
        data = self._data
        data.qpos[:] = self._physics.data.qpos
        data.qpos[rows] = q
        if self._physics.model.nmocap:
            data.mocap_pos[:] = self._physics.data.mocap_pos
            data.mocap_quat[:] = self._physics.data.mocap_quat
        mujoco.mj_fwdPosition(self._physics.model, data)
        touching = data.contact.dist <= 0.0
        first, second = data.contact.geom1[touching], data.contact.geom2[touching]
        relevant = (
            (self._arm[first] & self._robot[second])
            | (self._robot[first] & self._arm[second])
            | (self._robot[first] & self._fixed[second])
            | (self._fixed[first] & self._robot[second])
        )
        return bool(relevant.any())


def _below(physics: Physics, entity: Entity) -> NDArray[np.bool_]:
    """For each body whether it belongs to an entity or to one attached to it."""
    model = physics.model
    top = int(physics.bind(entity.root_body).element_ids[0])
    found = np.zeros(model.nbody, dtype=bool)
    found[top] = True
    for body in range(top + 1, model.nbody):
        found[body] = found[model.body_parentid[body]]
    return found


def _is_free(model: mujoco.MjModel, body: int) -> bool:
    joints: Any = range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])
    return any(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE for joint in joints)
