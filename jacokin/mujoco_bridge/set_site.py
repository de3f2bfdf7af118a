"""Inverse kinematics on an arm as it stands in a scene: what `RobotArm.set_site_to_xpos` runs.

Where the arm has a closed form, it gives every branch and the nearest legal one is taken; otherwise the QP descends
from the present configuration and then from random ones. MuJoCo's own kinematics has the last word on the answer, on a
copy of the data: the simulation is not touched before success is certain.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator, Sequence

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.ik.qp import MultiStartQP
from jacokin.ik.solver import IKSolver
from jacokin.ik.targets import Target, rotation_angle
from jacokin.mujoco_bridge.physics import Physics
from jacokin.mujoco_bridge.scene_chain import SITE, SceneChain, scene_chain

Array = NDArray[np.float64]
RandomState = np.random.RandomState | np.random.Generator
Bounds = tuple[Array, Array]

POSITION_TOLERANCE = 1e-6  # [m] what the interface promises of a success
ORIENTATION_TOLERANCE = 1e-6  # [rad]
QP_SOLVER = "daqp"

_TURN = 2.0 * np.pi


class SiteSolver:
    """Brings one site of one scene to poses in the world.

    Attributes:
        has_closed_form: whether the closed form fits the arm; the QP runs otherwise.
    """

    def __init__(self, physics: Physics, joints: Sequence[int], site: int) -> None:
        """Prepare for a site.

        Args:
            physics: the scene; it is only read.
            joints: ids of the arm's joints.
            site: id of the site.

        Raises:
            ModelError: the joints do not move the site, or cannot be solved for.
        """
        self._model = physics.model
        self._scratch = mujoco.MjData(physics.model)
        self._joints = tuple(joints)
        self._site = site
        self._prepare(physics.data.qpos)

    def chain(self, qpos: Array) -> SceneChain:
        """The joints that move the site, with fingers and the like held where they are in a qpos."""
        if self._chain.held.size and not np.array_equal(qpos[self._chain.held], self._chain.held_at):
            self._prepare(qpos)
        return self._chain

    def _prepare(self, qpos: Array) -> None:
        self._chain = scene_chain(self._model, qpos, self._joints, self._site)
        robot = self._chain.robot
        self._solver = IKSolver(robot, SITE)
        self.has_closed_form = self._solver.applies()
        kinds = self._model.jnt_type[list(self._chain.joints)]
        self._wraps = robot.free & (kinds == mujoco.mjtJoint.mjJNT_HINGE)
        self._qp: MultiStartQP | None = None
        self._T = np.eye(4)

    def solutions(
        self,
        data: mujoco.MjData,
        position: Array,
        rotation: Array,
        bounds: Bounds | None,
        random_state: RandomState,
        attempts: int,
    ) -> Iterator[Array]:
        """Configurations of the whole scene with the site at its target, those of the closed form nearest first.

        Each is a view of one buffer that the next overwrites.

        Args:
            data: the simulation's state; it is only read.
            position: (3,) of the site in the world [m].
            rotation: (3, 3) world <- site.
            bounds: lower and upper bounds of all of the arm's joints, for starts of the QP; None with a closed form.
            random_state: drawn from for all starts but the first.
            attempts: number of starts.
        """
        scratch, model = self._scratch, self._model
        scratch.qpos[:] = data.qpos
        if model.nmocap:
            scratch.mocap_pos[:] = data.mocap_pos
            scratch.mocap_quat[:] = data.mocap_quat
        chain = self.chain(scratch.qpos)
        mujoco.mj_kinematics(model, scratch)
        R_base_world = scratch.xmat[chain.base_body].reshape(3, 3).T
        T = self._T
        np.matmul(R_base_world, rotation, out=T[:3, :3])
        T[:3, 3] = R_base_world @ (position - scratch.xpos[chain.base_body])
        present = scratch.qpos[chain.qpos]
        found = (
            self._branches(T, present)
            if bounds is None
            else self._by_qp(T, self._starts(present, bounds, random_state, attempts))
        )
        for q in found:
            scratch.qpos[chain.qpos] = self._canonical(q)
            mujoco.mj_kinematics(model, scratch)
            miss = scratch.site_xpos[self._site] - position
            tilt = scratch.site_xmat[self._site].reshape(3, 3).T @ rotation
            if miss.dot(miss) <= POSITION_TOLERANCE**2 and rotation_angle(tilt) <= ORIENTATION_TOLERANCE:
                yield scratch.qpos

    def _branches(self, T_base_site: Array, present: Array) -> Iterator[Array]:
        branches = self._solver.closed_form().solve_all(T_base_site, present)
        return iter(branches.q[branches.within_limits])

    def _by_qp(self, T_base_site: Array, starts: Iterator[Array]) -> Iterator[Array]:
        target = Target(pin.SE3(T_base_site), position_only=False)
        if self._qp is None:
            self._qp = MultiStartQP(self._chain.robot, SITE, None, QP_SOLVER, POSITION_TOLERANCE, ORIENTATION_TOLERANCE)
        for start in starts:
            attempt = self._qp.solve(target, [start])
            if attempt.reached:
                yield attempt.q

    def _starts(self, present: Array, bounds: Bounds, random_state: RandomState, attempts: int) -> Iterator[Array]:
        """The present configuration made legal, then random ones, each drawn when it is asked for."""
        members = [self._joints.index(joint) for joint in self._chain.joints]
        yield np.clip(present, self._chain.robot.lower, self._chain.robot.upper)
        for _ in range(attempts - 1):
            yield random_state.uniform(*bounds)[members]

    def _canonical(self, q: Array) -> Array:
        """Free hinges turned into [0, 2 pi)."""
        turned = q % _TURN
        turned[turned >= _TURN] = 0.0  # the remainder of -1e-17 is rounded up to a full turn
        return np.where(self._wraps, turned, q)


class SceneSolvers:
    """The solvers of one arm, made when first needed for a site of a physics."""

    def __init__(self) -> None:
        """Start without any."""
        self._solvers: weakref.WeakKeyDictionary[Physics, dict[int, SiteSolver]] = weakref.WeakKeyDictionary()

    def of(self, physics: Physics, joints: Sequence[int], site: int) -> SiteSolver:
        """The solver of a site.

        Args:
            physics: the scene.
            joints: ids of the arm's joints.
            site: id of the site.

        Raises:
            ModelError: the joints do not move the site, or cannot be solved for.
        """
        solvers = self._solvers.setdefault(physics, {})
        if site not in solvers:
            solvers[site] = SiteSolver(physics, joints, site)
        return solvers[site]
