"""`ArmModel`: the numbers that may be off, how sure the datasheet is of each, and what they make of a measurement.

Every joint may be shifted (x, y, z), its axis tilted (two numbers), its zero be off: six for each, which is more than
any measurement can tell apart, and each has a meaning of its own. What cannot be told apart is held by the prior, the
deviations that arms of this kind have. Jacobians are analytic.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from jacokin.arrays import Array
from jacokin.calibration.alignment import Reference, Seen, find_reference, left_jacobian, rotation_of
from jacokin.calibration.measurements import CONTACTS, SIZES, Measurements
from jacokin.errors import InvalidInputError, ModelError
from jacokin.kernels.vector import cross
from jacokin.model import checks
from jacokin.model.kinematics import arm_of
from jacokin.model.measured_arm import MeasuredJoint, axis_rotation
from jacokin.model.robot import Robot

KEYS = ("x", "y", "z", "axis_x", "axis_y", "offset", "scale", "compliance")
GROUPS: Mapping[str, tuple[str, ...]] = {
    "geometry": ("x", "y", "z", "axis_x", "axis_y"),
    "offset": ("offset",),
    "scale": ("scale",),
    "compliance": ("compliance",),
}
AUTO = ("geometry", "offset")
PRIORS = (1e-12, 1e3)  # of any number: rounding takes more from what is measured than a wider one adds
UNITS = {"x": "m", "y": "m", "z": "m", "axis_x": "rad", "axis_y": "rad", "offset": "rad", "scale": "1",
         "compliance": "rad/(N m)"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Prior:
    """How far arms are from their description: standard deviations of each number of each joint.

    Raises:
        InvalidInputError: not positive, below 1e-12 or above 1000.
    """

    position: float = 1e-3
    """Of x, y and z [m]."""
    axis: float = 3e-3
    """Of a tilt about x, and about y [rad]."""
    offset: float = math.radians(1.0)
    """Of the zero [rad]."""
    scale: float = 1e-3
    """Of the transmission."""
    compliance: float = 1e-3
    """Of the angle by which a joint gives [rad/(N m)]."""

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, unit in (("position", "m"), ("axis", "rad"), ("offset", "rad"), ("scale", ""), ("compliance", "")):
            value = checks.positive(name, getattr(self, name), unit)
            if not PRIORS[0] <= value <= PRIORS[1]:
                raise InvalidInputError(
                    f"{name} must be between {PRIORS[0]:g} and {PRIORS[1]:g} [{unit or 1}], got {value:g}"
                )
            object.__setattr__(self, name, value)

    def of(self, key: str) -> float:
        """Standard deviation of one of `KEYS`."""
        group = "position" if key in "xyz" else key.removesuffix("_x").removesuffix("_y")
        return float(getattr(self, group))


def checked_groups(parameters: str | Iterable[str], prior: Prior | None) -> tuple[tuple[str, ...], Prior]:
    """Which of `GROUPS` are estimated, each once, and how far arms may be off; errors as `calibrate`."""
    chosen = AUTO if isinstance(parameters, str) and parameters == "auto" else checks.listed("parameters", parameters)
    groups = dict.fromkeys(checks.choice("group of parameters", each, GROUPS) for each in chosen)
    return tuple(groups), checks.instance("prior", Prior() if prior is None else prior, Prior, "a Prior")


def check_sought(groups: Sequence[str], sets: Sequence[Measurements]) -> None:
    """Refuse to look for nothing.

    Raises:
        InvalidInputError: no numbers of the arm are estimated, and base and tool are known.
    """
    if not groups and not any(each.base is None or each.tool is None for each in sets):
        raise InvalidInputError(
            f"parameters is empty, and neither base nor tool is unknown: give some of {', '.join(GROUPS)}"
        )


class MovingFrame(NamedTuple):
    """A frame at n configurations, and how it moves with the numbers of the joints."""

    position: Array
    """(n, 3) in the base [m]."""
    rotation: Array
    """(n, 3, 3)."""
    linear: Array
    """(n, 3, dof, 8) derivative of the position by each of `KEYS` of each joint."""
    angular: Array
    """(n, 3, dof, 8) angular velocity."""


class ArmKinematics:
    """A chain of turning joints, each where it is described and a little off. Immutable."""

    def __init__(self, robot: Robot, frame: str | None, *, sags: bool = False) -> None:
        """Read the chain.

        Args:
            robot: the arm as it is described, with its masses.
            frame: name of the frame; None for the default frame.
            sags: whether joints may give under gravity; else it is not computed, and those columns are zero.

        Raises:
            ModelError: a joint slides.
            UnknownNameError: no such frame.
        """
        for name, slides in zip(robot.joint_names, robot.sliding.tolist(), strict=True):
            if slides:
                raise ModelError(f"joint {name!r} slides: only arms whose joints all turn are calibrated")
        model = robot.pin_model
        self._model, self._gravity_data, self._sags = model, model.createData(), sags
        self.dof = robot.dof
        frame_id = robot.frame_id(frame)
        self._placements = arm_of(model, frame_id).placements

    def at(self, q: Array, joints: Array) -> MovingFrame:
        """The frame for joints (dof, 8) that are off by these numbers, a scale counted from 1.

        Args:
            q: (n, dof) reported angles [rad].
            joints: (dof, 8) in the order of `KEYS`.
        """
        n = len(q)
        angles = q * (1.0 + joints[:, 6]) + joints[:, 5]
        sag = -self._gravity(q) if self._sags else np.zeros_like(q)
        angles = angles + joints[:, 7] * sag
        rotation, position = np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3))
        origins, turning = np.zeros((2, n, 3, self.dof, 8))
        moving = np.zeros((n, 3, self.dof, 8))
        for k, placement in enumerate(self._placements[:-1]):
            position = position + rotation @ placement[:, 3]
            rotation = rotation @ placement[:, :3]
            moving[:, :, k, :3] = rotation
            position = position + rotation @ joints[k, :3]
            tilt, by_x, by_y = _tilt(joints[k, 3], joints[k, 4])
            turning[:, :, k, 3], turning[:, :, k, 4] = rotation @ by_x, rotation @ by_y
            rotation = rotation @ tilt
            axis = rotation[:, :, 2]
            turning[:, :, k, 5] = axis
            turning[:, :, k, 6] = q[:, k, None] * axis
            turning[:, :, k, 7] = sag[:, k, None] * axis
            origins[:, :, k, 3:] = position[:, :, None]
            rotation = rotation @ Rotation.from_euler("z", angles[:, k : k + 1]).as_matrix()
        position = position + rotation @ self._placements[-1, :, 3]
        rotation = rotation @ self._placements[-1, :, :3]
        lever = position[:, :, None, None] - origins
        return MovingFrame(position, rotation, moving + _cross(turning, lever), turning)

    def _gravity(self, q: Array) -> Array:
        """Torques (n, dof) that hold the described arm [N m]."""
        return np.array([pin.computeGeneralizedGravity(self._model, self._gravity_data, row) for row in q])


def _tilt(x: float, y: float) -> tuple[Array, Array, Array]:
    """The rotation to an axis (x, y, .), and its angular velocities by x and by y."""
    long, steepest = math.hypot(x, y), 0.9
    if long > steepest:  # a step that is tried and not taken
        x, y = x * steepest / long, y * steepest / long
    z = math.sqrt(1.0 - x * x - y * y)
    axis = np.array([x, y, z])
    # The axis moves, and the least rotation to it turns about it, by the solid angle that it goes around.
    by_x = cross((x, y, z), (1.0, 0.0, -x / z)) + y / (1.0 + z) * axis
    by_y = cross((x, y, z), (0.0, 1.0, -y / z)) - x / (1.0 + z) * axis
    return axis_rotation((x, y, z)), by_x, by_y


def _cross(first: Array, second: Array) -> Array:
    """Cross products (n, 3, ...) of vectors (n, 3, ...): NumPy's takes twice as long for so few."""
    a, b, c, x, y, z = (each[:, axis] for each in (first, second) for axis in range(3))
    return np.stack((b * z - c * y, c * x - a * z, a * y - b * x), axis=1)


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number that is estimated."""

    name: str
    """Such as "joint_2.offset", "base.x", "plane 1.distance"."""
    unit: str
    """"m", "rad", "rad/(N m)" or "1"."""
    prior: float
    """How far it may be from the description: a standard deviation, in its unit."""

    @property
    def words(self) -> str:
        """Its name in a sentence."""
        whose, _, what = self.name.rpartition(".")
        if whose in ("base", "tool") or " " in whose:
            return f"the {whose}'s {what}"
        return f"{what} of {whose}"


class ArmModel:
    """What all numbers make of some sets of measurements. Immutable.

    Attributes:
        parameters: the numbers that are estimated.
        prior: (p,) their standard deviations before anything is measured.
        robot: the arm as it is described.
        sets: the measurements.
        sets_named: what each is called in messages: its file, or its place in the list.
        free_columns: (8 dof,) which of `KEYS` of each joint are estimated.
        reference: where base, tools, planes and points were found, before they are refined.
    """

    def __init__(self, robot: Robot, sets: Sequence[Measurements], groups: Iterable[str], prior: Prior) -> None:
        """Lay out the numbers and find where base, tools and touched places are.

        Raises:
            InvalidInputError: joint angles of another arm, or a base that cannot be found.
            ModelError: a joint slides.
            UnknownNameError: no such frame.
        """
        self.robot, self.sets = robot, tuple(sets)
        self.sets_named = tuple(str(each.source or f"measurements[{k}]") for k, each in enumerate(sets))
        self.dof, self._joint_names = robot.dof, robot.joint_names
        for name, each in zip(self.sets_named, sets, strict=True):
            if each.q.shape[1] != robot.dof:
                raise InvalidInputError(f"{name} must have {robot.dof} joint angles in a row, got {each.q.shape[1]}")
        keys = [key for group in groups for key in GROUPS[group]]
        self._chains = {each.frame: ArmKinematics(robot, each.frame, sags="compliance" in keys) for each in sets}
        self.free_columns = np.array([key in keys for key in KEYS] * robot.dof)
        parameters = [
            Parameter(f"{joint}.{key}", UNITS[key], prior.of(key))
            for joint in robot.joint_names
            for key in KEYS
            if key in keys
        ]
        self._blocks: dict[tuple[str, object], slice] = {}
        for key, name, words in self._placed():
            self._blocks[key] = slice(len(parameters), len(parameters) + len(words))
            # Known to about 1 m or 1 rad: far wider than what data say, and narrow enough to compute with.
            parameters += [Parameter(f"{name}.{word}", unit, 1.0) for word, unit in words]
        self.parameters = tuple(parameters)
        self.prior = checks.read_only([each.prior for each in parameters])
        nominal = np.zeros((robot.dof, len(KEYS)))
        seen = []
        for each in self.sets:
            kept = each.select(each.finite)
            at = self._chains[each.frame].at(kept.q, nominal)
            seen.append(Seen(kept, at.position, at.rotation))
        self.reference: Reference = find_reference(seen)

    def _placed(self) -> Iterable[tuple[tuple[str, object], str, list[tuple[str, str]]]]:
        """Key, name, and numbers with units of everything that is found beside the arm."""
        shift, turn = [("x", "m"), ("y", "m"), ("z", "m")], [("roll", "rad"), ("pitch", "rad"), ("yaw", "rad")]
        if any(each.base is None for each in self.sets):
            yield ("base", None), "base", shift + turn
        frames = list(dict.fromkeys(each.frame for each in self.sets if each.tool is None))
        for frame in frames:
            turned = any(each.kind == "poses" for each in self.sets if each.tool is None and each.frame == frame)
            name = "tool" if len(frames) == 1 else f"tool of {frame or 'the default frame'}"
            yield ("tool", frame), name, shift + (turn if turned else [])
        for index, each in enumerate(self.sets):
            if each.kind == "plane":
                words = [("tilt_1", "rad"), ("tilt_2", "rad"), ("distance", "m")]
                yield ("plane", index), f"plane {index + 1}", words
            elif each.kind == "point":
                yield ("point", index), f"point {index + 1}", shift

    def joints(self, x: Array) -> Array:
        """(dof, 8) numbers of the joints, in the order of `KEYS`, a scale counted from 1."""
        full = np.zeros(self.dof * len(KEYS))
        full[self.free_columns] = x[: int(self.free_columns.sum())]
        return full.reshape(self.dof, len(KEYS))

    def measured_joints(self, x: Array) -> list[MeasuredJoint]:
        """The joints as `MeasuredArm` has them.

        Raises:
            InvalidInputError: farther off than any arm of this kind.
        """
        found = []
        for name, row in zip(self._joint_names, self.joints(x).tolist(), strict=True):
            px, py, pz, ax, ay, offset, scale, compliance = row
            axis = (ax, ay, math.sqrt(max(1.0 - ax * ax - ay * ay, 0.0)))
            try:
                found.append(MeasuredJoint((px, py, pz), axis, offset, 1.0 + scale, max(compliance, 0.0)))
            except InvalidInputError as error:
                raise InvalidInputError(
                    f"no arm near the described one fits these measurements: {name}: {error}; another frame or tool?"
                ) from error
        return found

    def base(self, x: Array) -> pin.SE3 | None:
        """T_sensor_base where it was unknown."""
        block = self._blocks.get(("base", None))
        return None if block is None else _refined(self.reference.base, x[block])

    def tools(self, x: Array) -> dict[str | None, pin.SE3]:
        """T_frame_target by frame, where it was unknown."""
        return {
            each.frame: _refined(self.reference.tools[each.frame], x[self._blocks["tool", each.frame]])
            for each in self.sets
            if each.tool is None
        }

    def kinematics(self, q: Array, frame: str | None, x: Array) -> MovingFrame:
        """A frame of the arm that has these numbers."""
        return self._chains[frame].at(q, self.joints(x))

    def predict(self, index: int, x: Array) -> tuple[Array, Array]:
        """What the numbers leave unexplained of a set, and its derivatives.

        Args:
            index: of the set.
            x: (p,) numbers.

        Returns:
            (n, k) predicted less measured [m], of a pose's last three [rad]; (n, k, p) derivatives. NaN in rows that
            are not finite.
        """
        rows = self.sets[index]
        position, rotation, linear, angular = self._target(rows, x)
        if rows.kind in CONTACTS:
            return self._contact(index, x, position, linear)
        if rows.kind == "positions":
            return position - rows.values, linear
        if rows.kind == "distances":
            assert rows.points is not None  # of this kind
            between = position - rows.points
            length = np.linalg.norm(between, axis=1)
            unit = between / np.maximum(length, 1e-9)[:, None]  # nearer, a distance has no direction
            return (length - rows.values)[:, None], np.einsum("ni,nip->np", unit, linear)[:, None]
        missed = position - rows.values[:, :3, 3]
        turned, rates = _logarithms(rotation @ np.swapaxes(rows.values[:, :3, :3], 1, 2))
        return np.hstack([missed, turned]), np.concatenate([linear, rates @ angular], axis=1)

    def point_jacobian(self, index: int, x: Array, q: Array) -> Array:
        """Derivatives (n, 3, p) of a set's point in its instrument's frame at other angles (n, dof) [rad]."""
        rows = self.sets[index]
        at = Measurements(
            q,
            positions=np.zeros((len(q), 3)),
            sigma=1.0,
            frame=rows.frame,
            base="unknown" if rows.base is None else rows.base,
            tool="unknown" if rows.tool is None else rows.tool,
        )
        return self._target(at, x)[2]

    def _target(self, rows: Measurements, x: Array) -> tuple[Array, Array, Array, Array]:
        """Position, rotation and derivatives of the measured point in the instrument's frame."""
        at = self.kinematics(rows.q, rows.frame, x)
        n, p, joints = len(rows), len(x), int(self.free_columns.sum())
        linear, angular = np.zeros((2, n, 3, p))
        position, rotation = at.position, at.rotation
        linear[:, :, :joints] = at.linear.reshape(n, 3, -1)[:, :, self.free_columns]
        angular[:, :, :joints] = at.angular.reshape(n, 3, -1)[:, :, self.free_columns]
        tool = rows.tool
        block = self._blocks.get(("tool", rows.frame)) if tool is None else None
        if block is not None:
            tool = _refined(self.reference.tools[rows.frame], x[block])
        assert tool is not None  # known, or one of the blocks
        lever = rotation @ tool.translation
        linear[:, :, :joints] += _cross(angular[:, :, :joints], lever[:, :, None])
        if block is not None:
            start = block.start
            linear[:, :, start : start + 3] = rotation
            if block.stop - start == 6:
                angular[:, :, start + 3 : block.stop] = rotation @ left_jacobian(x[start + 3 : block.stop])
        position, rotation = position + lever, rotation @ tool.rotation
        base, block = rows.base, self._blocks.get(("base", None)) if rows.base is None else None
        if block is not None:
            base = _refined(self.reference.base, x[block])
        assert base is not None  # known, or the block
        position = position @ base.rotation.T
        linear, angular = base.rotation @ linear, base.rotation @ angular
        if block is not None:
            spin = left_jacobian(x[block.start + 3 : block.stop])
            linear[:, :, block.start : block.start + 3] = np.eye(3)
            linear[:, :, block.start + 3 : block.stop] = _cross(spin[None], position[:, :, None])
            angular[:, :, block.start + 3 : block.stop] = spin
        return position + base.translation, base.rotation @ rotation, linear, angular

    def _contact(self, index: int, x: Array, position: Array, linear: Array) -> tuple[Array, Array]:
        """What contact with a point or a plane leaves unexplained, and its derivative.

        Args:
            index: of the set.
            x: (p,) numbers.
            position: (n, 3) of the tool in the base [m].
            linear: (n, 3, p) its derivatives.

        Returns:
            (n, 3) from the point or (n, 1) from the plane [m], and the derivatives (n, 3 or 1, p).
        """
        place = self.reference.places[index]
        if self.sets[index].kind == "point":
            block = self._blocks["point", index]
            linear[:, :, block] = -np.eye(3)
            return position - (place.point + x[block]), linear
        block = self._blocks["plane", index]
        first, second, distance = x[block]
        along = place.normal + first * place.axes[0] + second * place.axes[1]
        length = float(np.linalg.norm(along))
        normal = along / length
        away = position - place.point
        jacobian = np.einsum("i,nip->np", normal, linear)
        for number, axis in enumerate(place.axes):
            jacobian[:, block.start + number] = away @ (axis - normal * (normal @ axis)) / length
        jacobian[:, block.start + 2] = -1.0
        return (away @ normal - distance)[:, None], jacobian[:, None]

    def whitened(self, index: int, x: Array) -> tuple[Array, Array]:
        """What the model leaves unexplained, and its derivative, over the standard deviations.

        Zero in rows that are not finite.
        """
        missed, jacobian = self.predict(index, x)
        sigma = self.sets[index].sigma
        bad = ~self.sets[index].finite
        missed, jacobian = missed / sigma, jacobian / sigma[:, :, None]
        missed[bad], jacobian[bad] = 0.0, 0.0
        return missed, jacobian

    def distances(self, index: int, missed: Array) -> Array:
        """Lengths (n,) [m] of what `predict` leaves unexplained, angles left out."""
        return np.asarray(np.linalg.norm(missed[:, : min(SIZES[self.sets[index].kind], 3)], axis=1))


def _refined(reference: pin.SE3, x: Array) -> pin.SE3:
    """A pose shifted [m] and turned [rad] in the axes that it is expressed in."""
    turn = rotation_of(x[3:]) if len(x) == 6 else np.eye(3)
    return pin.SE3(turn @ reference.rotation, reference.translation + x[:3])


def _logarithms(rotations: Array) -> tuple[Array, Array]:
    """Rotation vectors (n, 3) of rotations, and (n, 3, 3) from angular velocities to their rates; NaN as those are."""
    vectors, rates = np.full((len(rotations), 3), np.nan), np.full(rotations.shape, np.nan)
    for row in np.flatnonzero(np.isfinite(rotations).all(axis=(1, 2))):
        vectors[row] = pin.log3(rotations[row])
        rates[row] = pin.Jlog3(rotations[row]) @ rotations[row].T
    return vectors, rates
