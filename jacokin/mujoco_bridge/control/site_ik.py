"""Inverse kinematics on an arm as it stands in a scene: what `RobotArm.set_site_to_xpos` runs.

Where the arm has a closed form, it gives every branch (of seven joints, curves), and the nearest
one within the limits is taken. Otherwise the QP starts from the present configuration and then from random ones. The
chain of joints is built from the compiled scene. The simulation is read only; nothing is written before there is
a solution.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import ModelError, PhysicsError
from jacokin.ik import targets
from jacokin.ik.local_search import LocalSearch
from jacokin.ik.options import ORIENTATION_TOLERANCE, POSITION_TOLERANCE, SolverOptions
from jacokin.ik.solutions.solution_set import SolutionSet
from jacokin.ik.solver import IKSolver
from jacokin.ik.verification import Verifier
from jacokin.model.angles import TURN
from jacokin.model.descriptions import mjcf
from jacokin.model.robot import Home, Known, Robot, Source
from jacokin.mujoco_bridge.distributions import RandomState
from jacokin.mujoco_bridge.simulation.physics import Physics

Memory = tuple[memoryview, ...]
"""Live parts of MuJoCo's arrays. Joining their bytes is the quickest way to compare all of them with what they were."""

JointBounds = tuple[Array, Array]
Solution = tuple[NDArray[np.intp], Array]  # addresses in qpos, and values for them

BASE = "base"  # the frames of the chain
SITE = "site"

_INFINITE = np.array([np.inf])

# Matrices of rotations that are a small angle apart differ by sqrt(2) times that angle, in the Frobenius norm.
_ROTATION_TOLERANCE = math.sqrt(2.0) * ORIENTATION_TOLERANCE


class SiteSolver:
    """Inverse kinematics of one site of one scene, for target poses in the world.

    Attributes:
        lists_all: whether every configuration at a pose is found; otherwise the QP runs.
    """

    def __init__(self, physics: Physics, joints: Sequence[int], site: int) -> None:
        """Prepare for a site.

        Args:
            physics: the scene; it is only read.
            joints: ids of the arm's joints.
            site: id of the site.

        Raises:
            ModelError: the joints do not move the site, or cannot be solved for.
            PhysicsError: positions or velocities in the scene are not finite.
        """
        self._model = physics.model
        self._data = physics.data
        self._scratch = mujoco.MjData(physics.model)
        self._joints = tuple(joints)
        self._site = site
        self._site_position: Array = self._data.site_xpos[site]
        self._site_rotation: Array = self._data.site_xmat[site]
        self._qpos: Array = self._data.qpos
        self._qvel: Array = self._data.qvel
        self._prepare()

    def chain(self) -> SceneChain:
        """The joints that move the site; others on the way to it are held at their present positions."""
        if not self._chain.is_current:
            self._prepare()
        return self._chain

    def _prepare(self) -> None:
        self._check_finite()
        self._chain = scene_chain(self._model, self._data.qpos, self._joints, self._site)
        robot = self._chain.robot
        self._solver = IKSolver(robot, SITE, collision="ignore")
        self.lists_all = self._solver.dimension() is not None
        if not self.lists_all:
            from jacokin.ik.qp import QPDescents  # imports mink, which arms with a closed form do not need

            verifier = Verifier(robot, SITE, None, SolverOptions(collision="ignore"))
            self._qp = LocalSearch(verifier, QPDescents(verifier))
        self._nearest = self._solver.closed_form().nearest_branch() if self._solver.is_compiled else None
        self._T = np.eye(4) if self._nearest is None else self._nearest.T
        self._rotation, self._translation = self._T[:3, :3], self._T[:3, 3]
        kinds = self._model.jnt_type[list(self._chain.joints)]
        self._wraps: list[int] = np.flatnonzero(robot.unlimited & (kinds == mujoco.mjtJoint.mjJNT_HINGE)).tolist()
        self._base_position: Array = self._scratch.xpos[self._chain.base_body]
        self._R_base_world: Array = self._scratch.xmat[self._chain.base_body].reshape(3, 3).T
        limited = np.flatnonzero(~robot.unlimited)
        lower, upper = robot.lower[limited].tolist(), robot.upper[limited].tolist()
        self._limits = list(zip(limited.tolist(), lower, upper, strict=True))
        self._watched = (*self._chain.memory, *self._chain.base_memory)
        self._seen = b""

    def nearest(self, position: Array, rotation: Array) -> Sequence[Solution]:
        """The nearest branch of the closed form within the limits, as `solutions` gives it, or nothing.

        Args:
            position: (3,) target position of the site in the world [m].
            rotation: (3, 3) target orientation, R_world_site.

        Raises:
            PhysicsError: positions or velocities in the scene are not finite.
        """
        chain = self._target(position, rotation)
        if self._nearest is None:
            member = self._solver.solve_all(self._T, self._qpos[chain.qpos]).nearest()
            q = None if member is None else member.copy()
        else:
            self._nearest.seed[:] = self._qpos[chain.qpos]
            q = self._nearest()
        return () if q is None else ((chain.qpos, wrapped_in_place(q, self._wraps)),)

    def solutions(
        self,
        position: Array,
        rotation: Array,
        bounds: JointBounds | None,
        random_state: RandomState,
        attempts: int,
        *,
        shuffle: bool = False,
    ) -> Iterator[Solution]:
        """Solutions as addresses in qpos and values for them; branches of the closed form in order of distance.

        Args:
            position: (3,) target position of the site in the world [m].
            rotation: (3, 3) target orientation, R_world_site.
            bounds: lower and upper bounds of all of the arm's joints, for starts of the QP; None with a closed form.
            random_state: drawn from for all starts but the first.
            attempts: number of starts.
            shuffle: branches in random order, and random starts only.

        Raises:
            PhysicsError: positions or velocities in the scene are not finite.
        """
        chain = self._target(position, rotation)
        present = self._qpos[chain.qpos]
        if bounds is None:
            found = self._branches(present, random_state if shuffle else None)
        else:
            found = self._by_qp(self._starts(None if shuffle else present, bounds, random_state, attempts))
        for q in found:
            yield chain.qpos, canonical(q, self._wraps)

    def nearest_to_random(
        self, position: Array, rotation: Array, bounds: JointBounds, random_state: RandomState, attempts: int
    ) -> Iterator[Solution]:
        """For each of some random starts the solution nearest to it, as `solutions` gives it.

        Args:
            position: (3,) target position of the site in the world [m].
            rotation: (3, 3) target orientation, R_world_site.
            bounds: lower and upper bounds of all of the arm's joints.
            random_state: draws the starts, one at a time when needed.
            attempts: number of starts.

        Raises:
            PhysicsError: positions or velocities in the scene are not finite.
        """
        chain = self._target(position, rotation)
        for start in self._starts(None, bounds, random_state, attempts):
            q = self._nearest_to(start)
            if q is not None:
                yield chain.qpos, wrapped_in_place(q, self._wraps)
            elif self.lists_all:
                return  # another start changes nothing

    def _nearest_to(self, start: Array) -> Array | None:
        """The configuration (dof,) at the target that is nearest to a start (dof,); None for none within the limits."""
        if self._nearest is not None:
            self._nearest.seed[:] = start
            q = self._nearest()
            position_error, orientation_error = self._nearest.errors
            if q is None or (position_error <= POSITION_TOLERANCE and orientation_error <= ORIENTATION_TOLERANCE):
                return q
        result = self._solver.solve(self._T, start, closest=False)
        return result.q.copy() if result.success else None

    def is_reached(self, q: Array, position: Array, rotation: list[float]) -> bool:
        """Whether q is within the limits, and brings the site to a pose.

        Args:
            q: (dof,) configuration, at which MuJoCo has computed the poses.
            position: (3,) target position of the site in the world [m].
            rotation: the 9 numbers of the target orientation R_world_site, row by row.
        """
        values = q.tolist()  # plain numbers are faster than NumPy's
        for joint, lower, upper in self._limits:
            if not lower <= values[joint] <= upper:
                return False
        return (
            math.dist(self._site_position.tolist(), position.tolist()) <= POSITION_TOLERANCE
            and math.dist(self._site_rotation.tolist(), rotation) <= _ROTATION_TOLERANCE
        )

    def _target(self, position: Array, rotation: Array) -> SceneChain:
        """Write T_base_site of a target in the world to `_T`; returns the chain as it is now."""
        self._check_finite()
        if not self._chain.base_is_fixed or b"".join(self._watched) != self._seen:
            self._refresh()
        if self._is_upright:
            self._rotation[...] = rotation
            np.subtract(position, self._base_position, self._translation)
        else:
            self._rotation[...] = self._R_base_world.dot(rotation)
            self._translation[...] = self._R_base_world.dot(position - self._base_position)
        return self._chain

    def _check_finite(self) -> None:
        """Check that the scene has a finite state.

        Raises:
            PhysicsError: qpos or qvel is not finite.
        """
        qpos, qvel = self._qpos, self._qvel
        # The quickest tests: up to 16 numbers are added up sooner than a dot product starts. A sum that is not finite
        # is looked at closely.
        if len(qpos) <= 16:
            if math.isfinite(sum(qpos.tolist() + qvel.tolist())):
                return
        elif math.isfinite(qpos.dot(qpos)) and math.isfinite(qvel.dot(qvel)):
            return
        for name, values in (("qpos", qpos), ("qvel", qvel)):
            if not np.isfinite(values).all():
                raise PhysicsError(f"the simulation is not finite in {name}; reset it first")

    def _refresh(self) -> None:
        """Bring the chain, and the base's pose in the scratch data, up to date."""
        self.chain()
        scratch, data = self._scratch, self._data
        scratch.qpos[:] = data.qpos
        scratch.mocap_pos[:] = data.mocap_pos
        scratch.mocap_quat[:] = data.mocap_quat
        mujoco.mj_kinematics(self._model, scratch)
        self._is_upright = np.array_equal(self._R_base_world, np.eye(3))
        self._seen = b"".join(self._watched)

    def _members(self, found: SolutionSet, present: Array, shuffled_by: RandomState | None) -> Iterator[Array]:
        """Members of curves: the nearest one, then some of all others by distance; or at random."""
        nearest = found.nearest()
        if nearest is None:
            return
        if shuffled_by is None:
            yield nearest
        rows = found.sample(32)
        order = np.argsort(((rows - present) ** 2).sum(axis=1), kind="stable")
        for index in order if shuffled_by is None else shuffled_by.permutation(len(rows)):
            yield rows[index]

    def _branches(self, present: Array, shuffled_by: RandomState | None) -> Iterator[Array]:
        found = self._solver.solve_all(self._T, present)
        if found.dimension == 1:
            yield from self._members(found, present, shuffled_by)
            return
        q = found.q
        order = found.within_limits.nonzero()[0]
        for index in order if shuffled_by is None else shuffled_by.permutation(order):
            yield q[index]

    def _by_qp(self, starts: Iterator[Array]) -> Iterator[Array]:
        target = targets.checked_target(self._T)
        for start in starts:
            q = self._qp.reach(target, start)
            if q is not None:
                yield q

    def _starts(
        self, present: Array | None, bounds: JointBounds, random_state: RandomState, attempts: int
    ) -> Iterator[Array]:
        """The present configuration, clipped to the limits, then random ones, drawn one at a time when needed."""
        members = [self._joints.index(joint) for joint in self._chain.joints]
        if present is not None:
            yield np.clip(present, self._chain.robot.lower, self._chain.robot.upper)
        for _ in range(attempts - (present is not None)):
            yield random_state.uniform(*bounds)[members]


@dataclass(frozen=True, slots=True, eq=False)
class SceneChain:
    """The joints that move a site.

    Attributes:
        robot: the chain; its only frame is the site, its base the parent of the first joint's body.
        base_body: id of that body.
        base_is_fixed: whether the simulation never moves that body.
        base_memory: the parts of the model that determine the pose of a fixed base.
        joints: (dof,) ids of the joints, base to site.
        qpos: (dof,) addresses of the joints' positions in qpos.
        memory: the parts of the model that determine the chain, and the positions of joints that are held.
        memory_then: their bytes when the chain was made.
    """

    robot: Robot
    base_body: int
    base_is_fixed: bool
    base_memory: Memory
    joints: tuple[int, ...]
    qpos: NDArray[np.intp]
    memory: Memory
    memory_then: bytes

    @property
    def is_current(self) -> bool:
        """Whether the model and the held joints are as they were when the chain was made."""
        return b"".join(self.memory) == self.memory_then


def scene_chain(model: mujoco.MjModel, qpos: Array, joints: Sequence[int], site: int) -> SceneChain:
    """Build the chain.

    Args:
        model: the compiled scene.
        qpos: its live configuration; joints that are not the arm's are held there.
        joints: ids of the arm's joints.
        site: id of the site.

    Raises:
        ModelError: none of the joints moves the site, or a joint on the way is neither hinge nor slide.
    """
    bodies = _path(model, int(model.site_bodyid[site]))
    moved = [i for i, body in enumerate(bodies) if set(mjcf.body_joints(model, body)) & set(joints)]
    if not moved:
        raise ModelError(f"none of the arm's joints moves site {model.site(site).name!r}")
    above, bodies = bodies[: moved[0]], bodies[moved[0] :]
    members: list[int] = []
    addresses: list[int] = []
    held: list[int] = []
    out = pin.Model()
    out.name = "scene"
    carrier, T = 0, pin.SE3.Identity()
    for body in bodies:
        T = T * mjcf.placement(model.body_quat[body], model.body_pos[body])
        for joint in mjcf.body_joints(model, body):
            if model.jnt_type[joint] not in mjcf.SCALAR_JOINTS:
                raise ModelError(f"joint {mjcf.joint_name(model, joint)!r} of the arm is neither hinge nor slide")
            kind, T_zero = mjcf.pinocchio_joint(model, joint)
            anchor = pin.SE3(np.eye(3), np.array(model.jnt_pos[joint]))
            address = int(model.jnt_qposadr[joint])
            if joint in joints:
                limits = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.inf, np.inf)
                lower, upper = np.array(limits[:1]), np.array(limits[1:])
                name = mjcf.joint_name(model, joint)
                carrier = out.addJoint(carrier, kind, T * anchor * T_zero, name, _INFINITE, _INFINITE, lower, upper)
                T = anchor.inverse()
                members.append(joint)
                addresses.append(address)
            else:
                T = T * anchor * mjcf.scalar_joint_motion(model, joint, float(qpos[address])) * anchor.inverse()
                held.append(address)
    T = T * mjcf.placement(model.site_quat[site], model.site_pos[site])
    out.addFrame(pin.Frame(BASE, 0, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME), False)
    out.addFrame(pin.Frame(SITE, carrier, 0, T, pin.FrameType.OP_FRAME), False)
    memory = (*_memory(model, bodies, site), *_rows(qpos, held))
    source = Source(path=Path("scene"), kind="mjcf", bundled=None, base=BASE, tip=SITE)
    return SceneChain(
        robot=Robot(out, Known(BASE, SITE, source, Home(qpos[addresses], "where the arm was in the scene"))),
        base_body=int(model.body_parentid[bodies[0]]),
        base_is_fixed=not any(model.body_dofnum[body] or model.body_mocapid[body] >= 0 for body in above),
        base_memory=_poses(model, above),
        joints=tuple(members),
        qpos=np.array(addresses, dtype=np.intp),
        memory=memory,
        memory_then=b"".join(memory),
    )


def _memory(model: mujoco.MjModel, bodies: Sequence[int], site: int) -> Memory:
    """The parts of the model that determine a chain along these bodies."""
    joints = [joint for body in bodies for joint in mjcf.body_joints(model, body)]
    arrays = model.jnt_range, model.jnt_limited, model.jnt_pos, model.jnt_axis
    return (
        *_poses(model, bodies),
        *(part for array in arrays for part in _rows(array, joints)),
        *(part for array in (model.site_pos, model.site_quat) for part in _rows(array, [site])),
    )


def _poses(model: mujoco.MjModel, bodies: Sequence[int]) -> Memory:
    """The parts of the model with the poses of bodies in their parents."""
    return tuple(part for array in (model.body_pos, model.body_quat) for part in _rows(array, bodies))


def _rows(array: NDArray[Any], rows: Sequence[int]) -> Memory:
    """The memory of some rows of an array; consecutive ones are one part."""
    starts = [row for i, row in enumerate(rows) if i == 0 or row != rows[i - 1] + 1]
    stops = [row + 1 for i, row in enumerate(rows) if i == len(rows) - 1 or rows[i + 1] != row + 1]
    return tuple(array[start:stop].data for start, stop in zip(starts, stops, strict=True))


def _path(model: mujoco.MjModel, body: int) -> list[int]:
    """Ids of the bodies from the world's child down to a body."""
    path: list[int] = []
    while body > 0:
        path.insert(0, body)
        body = int(model.body_parentid[body])
    return path


def canonical(q: Array, wraps: Sequence[int]) -> Array:
    """A copy with some joints, the unlimited hinges, in [0, 2 pi)."""
    return wrapped_in_place(q.copy(), wraps)


def wrapped_in_place(q: Array, wraps: Sequence[int]) -> Array:
    """An array (dof,), which is changed: some joints in [0, 2 pi)."""
    values: list[float] = q.tolist()  # plain numbers are faster than NumPy's
    for joint in wraps:
        if not 0.0 < values[joint] < TURN:
            turned = values[joint] % TURN
            q[joint] = turned if turned < TURN else 0.0  # the remainder of -1e-17 is rounded up to a full turn
    return q
