"""Initial poses of the arm: the tool centre point at random poses, free of collisions."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import EpisodeInitializationError, InvalidInputError, shown
from jacokin.model import checks
from jacokin.model.poses import unit_quaternion
from jacokin.mujoco_bridge.base import DOWN_QUATERNION, RobotArm, RobotHand
from jacokin.mujoco_bridge.control import queries
from jacokin.mujoco_bridge.control.collisions import Trial, arm_pairs, trial_of
from jacokin.mujoco_bridge.control.queries import Asking
from jacokin.mujoco_bridge.distributions import RandomState, Sampler, check_random_state, constant_or_sampler
from jacokin.mujoco_bridge.entity import rotation_matrix
from jacokin.mujoco_bridge.simulation.physics import Physics, check_physics

BRANCHES = ("random", "nearest", "nearest_to_random")


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
            if self._branch == "nearest_to_random":
                queries.run(self.placing(physics, random_state))
            else:
                self._place(physics, random_state)

    def placing(self, physics: Physics, random_state: RandomState) -> Asking[None]:
        """As a call with branch="nearest_to_random", but the caller answers the queries of inverse kinematics.

        Between a query and its answer, the state of the physics may be another one.

        Raises:
            EpisodeInitializationError: as for a call.
            InvalidInputError: as for a call.
        """
        bounds = self._arm.sampling_bounds(physics)
        for _ in range(self._max_rejection_samples):
            position, rotation = self._pose(random_state)
            for _ in range(self._max_ik_attempts):
                solver = self._arm.site_solver(physics, self._site)
                query = solver.query(position, rotation, bounds, random_state)
                q = yield query
                if q is None:
                    if solver.has_closed_form:
                        break  # another start changes nothing
                elif self._is_free(physics, trial_of(physics), query.qpos, q):
                    physics.set_qpos(query.qpos, q)
                    return
        raise self._failure()

    def _place(self, physics: Physics, random_state: RandomState) -> None:
        solver = self._arm.site_solver(physics, self._site)
        bounds = None if solver.has_closed_form else self._arm.sampling_bounds(physics)
        trial = trial_of(physics)
        for _ in range(self._max_rejection_samples):
            shuffle, attempts = self._branch == "random", self._max_ik_attempts
            for rows, q in solver.solutions(*self._pose(random_state), bounds, random_state, attempts, shuffle=shuffle):
                if self._is_free(physics, trial, rows, q):
                    physics.set_qpos(rows, q)
                    return
        raise self._failure()

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
"""The same by its shorter name."""
