"""`crosscheck`: how far two descriptions, or Pinocchio and MuJoCo, differ in kinematics and dynamics."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import mujoco
import numpy as np
import pinocchio as pin

from jacokin.arrays import Array, Sealed
from jacokin.errors import InvalidInputError
from jacokin.model import checks, mujoco_twin, poses
from jacokin.model.descriptions import mjcf
from jacokin.model.dynamics import has_moving_masses
from jacokin.model.robot import Robot, checked_robot
from jacokin.model.written_descriptions import move_bodies

QUANTITIES = {
    "position": "m",
    "rotation": "rad",
    "jacobian": "m/rad",
    "mass_matrix": "kg m^2",
    "gravity_torque": "N m",
}

# Same numbers in two engines differ by rounding only; dynamics adds up masses over several bodies.
TOLERANCES = {
    "position": 1e-12,
    "rotation": 1e-12,
    "jacobian": 1e-12,
    "mass_matrix": 1e-11,
    "gravity_torque": 1e-11,
}


def crosscheck(
    robot_a: Robot,
    robot_b: Robot | None = None,
    *,
    samples: int = 1000,
    rng: np.random.Generator | None = None,
    joint_map: Mapping[str, str] | None = None,
    frame_map: Mapping[str, str] | None = None,
) -> CrossCheckReport:
    """Compare two descriptions of one arm, or one description in Pinocchio and in MuJoCo.

    Args:
        robot_a: the first arm, in Pinocchio.
        robot_b: the second arm, in Pinocchio; None for MuJoCo's own computation on the description of the first.
        samples: number of random configurations within the limits of the first arm.
        rng: randomness; None for a fixed seed.
        joint_map: name in the second for a joint of the first, where they differ.
        frame_map: name in the second for a frame of the first; None compares all frames of equal name.

    Returns:
        The largest deviations, with the configurations where they occur.

    Raises:
        UnknownNameError: a mapped name does not exist.
        InvalidInputError: the arms have different joints or no frame in common, or `samples` is not positive.
    """
    samples = checks.whole_number("samples", samples, 1)
    checked_robot("robot_a", robot_a)
    checks.optional(checked_robot, "robot_b", robot_b)
    checks.optional(checks.mapping, "joint_map", joint_map, "a dict of names")
    checks.optional(checks.mapping, "frame_map", frame_map, "a dict of names")
    checks.optional(checks.generator, "rng", rng)
    first = PinocchioEngine(robot_a)
    second = MujocoEngine(robot_a) if robot_b is None else PinocchioEngine(robot_b)
    order = _joint_order(first, second, joint_map or {})
    frames = _frames(first, second, frame_map)
    with_armature = first.armature.any() == second.armature.any()
    notes: tuple[str, ...] = (
        () if with_armature else ("mass matrices are compared without armature: only one side has it",)
    )
    for robot in (robot_a, robot_b):
        if robot is not None and not has_moving_masses(robot.pin_model):
            notes += (f"{robot.label} ({robot.source.kind}) gives no masses: its mass matrix and torques are zero",)

    rng = np.random.default_rng(0) if rng is None else rng
    worst: dict[tuple[str, str], tuple[float, Array]] = {}
    for q in robot_a.sample(rng, samples):
        moved = np.empty_like(q)
        moved[order] = q
        states = first.at(q, frames), second.at(moved, frames.values())
        armatures = None if with_armature else (first.armature, second.armature)
        for key, value in _differences(*states, list(frames), order, armatures).items():
            if key not in worst or not value <= worst[key][0]:
                worst[key] = value, q
    rows = tuple(
        Deviation(quantity, frame, value, QUANTITIES[quantity], checks.read_only(q))
        for (quantity, frame), (value, q) in sorted(worst.items(), key=lambda item: list(QUANTITIES).index(item[0][0]))
    )
    return CrossCheckReport(first.label, second.label, samples, rows, notes)


@dataclass(frozen=True, slots=True, eq=False)
class Deviation(Sealed):
    """The largest difference found in one quantity."""

    quantity: str
    """Key of `QUANTITIES`."""
    frame: str
    """Frame of the first robot; empty for dynamics."""
    value: float
    """Largest difference, in `unit`."""
    unit: str
    """Unit of the value."""
    q: Array
    """(dof,) configuration of the first robot where it was found [rad]; read-only."""


@dataclass(frozen=True, slots=True, eq=False)
class CrossCheckReport:
    """How far two descriptions of one arm differ."""

    first: str
    """What was compared."""
    second: str
    """What it was compared with."""
    samples: int
    """Number of random configurations."""
    deviations: tuple[Deviation, ...]
    """One row for each quantity and frame."""
    notes: tuple[str, ...]
    """What was left out, and why."""

    def worst(self, quantity: str) -> Deviation:
        """The largest deviation of a quantity.

        Raises:
            UnknownNameError: not a quantity that was compared.
        """
        checks.choice("quantity", quantity, dict.fromkeys(row.quantity for row in self.deviations))
        return max((row for row in self.deviations if row.quantity == quantity), key=lambda row: row.value)

    def within(self, tolerances: Mapping[str, float] = TOLERANCES) -> bool:
        """Whether every deviation is at most the tolerance of its quantity (1e-12, for dynamics 1e-11).

        Raises:
            InvalidInputError: the tolerances are not numbers by the names of quantities.
        """
        for quantity, tolerance in checks.mapping("tolerances", tolerances, "a dict of numbers by quantity").items():
            checks.non_negative(f"tolerances[{checks.choice('quantity', quantity, QUANTITIES)!r}]", tolerance)
        return all(row.value <= tolerances.get(row.quantity, np.inf) for row in self.deviations)

    def __str__(self) -> str:
        """The report as a plain table."""
        lines = [f"{self.first} against {self.second}, {self.samples} random configurations"]
        lines += [f"{row.quantity:15} {row.frame:18} {row.value:10.3e} {row.unit}" for row in self.deviations]
        return "\n".join([*lines, *self.notes])


class _State(NamedTuple):
    """An arm at one configuration."""

    placed: list[tuple[pin.SE3, Array]]
    """Of each frame its pose in the base, and its Jacobian (6, dof), local world aligned."""
    mass_matrix: Array
    """(dof, dof), with armature [kg m^2]."""
    gravity_torque: Array
    """(dof,) that holds the arm still [N m]."""


class PinocchioEngine:
    """A `Robot` in Pinocchio."""

    def __init__(self, robot: Robot) -> None:
        """Prepare working memory."""
        self.label = f"{robot.label} ({robot.source.kind}) in Pinocchio"
        self.joint_names = robot.joint_names
        self.frames = robot.frames
        self.armature = robot.pin_model.armature
        self._robot = robot
        self._data = robot.pin_model.createData()

    def at(self, q: Array, frames: Iterable[str]) -> _State:
        """The arm with some frames at `q` (dof,) [rad]."""
        model, data, aligned = self._robot.pin_model, self._data, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        masses, gravity = pin.crba(model, data, q), pin.computeGeneralizedGravity(model, data, q)
        ids = [self._robot.frame_id(frame) for frame in frames]
        # Pinocchio drops the second dimension of a single joint.
        placed = [(data.oMf[i].copy(), pin.getFrameJacobian(model, data, i, aligned).reshape(6, -1)) for i in ids]
        masses = np.reshape(masses, (len(q), len(q)))
        return _State(placed, np.triu(masses) + np.triu(masses, 1).T, np.array(gravity))


class MujocoEngine:
    """The description compiled by MuJoCo, joints off the arm held where the robot has them.

    Poses and Jacobians are expressed in the robot's base, as the robot's own are.
    """

    def __init__(self, robot: Robot) -> None:
        """Prepare working memory."""
        self._model = model = move_bodies(mujoco_twin.with_masses(robot), robot)
        self._data = mujoco.MjData(model)
        self.label = f"{robot.label} in MuJoCo"
        self.joint_names = robot.joint_names
        joints = mjcf.joint_ids(model, robot.joint_names)
        self._qpos, self._dofs = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        self.armature = model.dof_armature[self._dofs]
        self._frames = _live_frames(model, self._data)
        self.frames = tuple(name for name in robot.frames if name in self._frames)
        self._base = self._frames.get(robot.base, self._frames[mjcf.body_name(model, 0)])
        self._hold_still(robot)

    def _hold_still(self, robot: Robot) -> None:
        """Joints off the arm where they are locked, or where the robot has them, clipped into their limits."""
        model, locked = self._model, dict(robot.source.locked)
        for joint in range(model.njnt):
            address = model.jnt_qposadr[joint]
            if address in self._qpos or model.jnt_type[joint] not in mjcf.SCALAR_JOINTS:
                continue
            name = mjcf.joint_name(model, joint)
            angle = self._data.qpos[address] if robot.finger_angle is None else robot.finger_angle
            if model.jnt_limited[joint]:
                angle = np.clip(angle, *model.jnt_range[joint])
            self._data.qpos[address] = locked.get(name, angle)

    def at(self, q: Array, frames: Iterable[str]) -> _State:
        """The arm with some frames at `q` (dof,) [rad]."""
        model, data = self._model, self._data
        data.qpos[self._qpos] = q
        data.qvel[:] = 0.0
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeM(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 0, data.qfrc_bias)
        masses, base, placed = np.zeros((model.nv, model.nv)), self._base.placement(), []
        mujoco.mj_fullM(model, data, masses)
        for frame in (self._frames[name] for name in frames):
            linear, angular = np.zeros((2, 3, model.nv))
            frame.compute_jacobian(model, data, linear, angular, frame.id)
            jacobian = np.vstack((base.rotation.T @ linear, base.rotation.T @ angular))
            placed.append((base.actInv(frame.placement()), jacobian[:, self._dofs]))
        return _State(placed, masses[np.ix_(self._dofs, self._dofs)], np.array(data.qfrc_bias[self._dofs]))


Engine: TypeAlias = PinocchioEngine | MujocoEngine


class _LiveFrame(NamedTuple):
    """A body or site of MuJoCo, with views of the working memory."""

    position: Array
    rotation: Array
    compute_jacobian: Callable[..., None]
    id: int

    def placement(self) -> pin.SE3:
        """Where it is in the world now."""
        return pin.SE3(self.rotation, self.position)


def _live_frames(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, _LiveFrame]:
    """Bodies and sites by name, in the world; of a body and a site with the same name, the body."""
    sites = {
        mjcf.site_name(model, i): _LiveFrame(data.site_xpos[i], data.site_xmat[i].reshape(3, 3), mujoco.mj_jacSite, i)
        for i in range(model.nsite)
    }
    bodies = {
        mjcf.body_name(model, i): _LiveFrame(data.xpos[i], data.xmat[i].reshape(3, 3), mujoco.mj_jacBody, i)
        for i in range(model.nbody)
    }
    return sites | bodies


def _joint_order(first: Engine, second: Engine, joint_map: Mapping[str, str]) -> list[int]:
    """Index in the second arm of each joint of the first."""
    for name in joint_map:
        checks.choice("joint", name, first.joint_names)
    names = [joint_map.get(name, name) for name in first.joint_names]
    wanted = [checks.choice("joint of the second arm", name, second.joint_names) for name in names]
    if sorted(wanted) != sorted(second.joint_names):
        raise InvalidInputError(
            f"the arms have different joints: {', '.join(first.joint_names)} and {', '.join(second.joint_names)}"
        )
    return [second.joint_names.index(name) for name in wanted]


def _frames(first: Engine, second: Engine, frame_map: Mapping[str, str] | None) -> dict[str, str]:
    """Frames of the second arm by those of the first that mean the same."""
    pairs = {name: name for name in first.frames if name in second.frames} if frame_map is None else dict(frame_map)
    for a, b in pairs.items():
        checks.choice("frame", a, first.frames)
        checks.choice("frame", b, second.frames)
    if not pairs:
        raise InvalidInputError(
            f"no frame in common: {', '.join(first.frames)} and {', '.join(second.frames)}; give frame_map"
        )
    return pairs


def _differences(
    first: _State, second: _State, frames: list[str], order: list[int], armatures: tuple[Array, Array] | None
) -> dict[tuple[str, str], float]:
    """Largest element-wise differences, masses without armatures (dof,) that are given."""
    values: dict[tuple[str, str], float] = {}
    for name, (here, jacobian), (there, other) in zip(frames, first.placed, second.placed, strict=True):
        values["position", name] = float(np.linalg.norm(here.translation - there.translation))
        values["rotation", name] = poses.rotation_angle(here.rotation.T @ there.rotation)
        values["jacobian", name] = float(np.abs(jacobian - other[:, order]).max())
    masses = [first.mass_matrix, second.mass_matrix]
    if armatures is not None:
        masses = [mass - np.diag(armature) for mass, armature in zip(masses, armatures, strict=True)]
    values["mass_matrix", ""] = float(np.abs(masses[0] - masses[1][np.ix_(order, order)]).max())
    values["gravity_torque", ""] = float(np.abs(first.gravity_torque - second.gravity_torque[order]).max())
    return values
