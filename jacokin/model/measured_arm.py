"""`MeasuredArm`: how far the joints of one arm are from where its description has them, and the file that says so.

Each joint has a placement of its own: a shift [m] in the axes of the described joint frame, the direction of its axis
there, and the angle by which its zero is off. Four of these numbers move the axis (they are Hayati's for parallel axes,
and like those never jump), the fifth slides the joint along it, the sixth is the offset. Two more are properties of a
drive that no chain of joints can hold: the scale of its transmission, and how far it gives under a torque.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin import documents, files
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError
from jacokin.model import checks
from jacokin.model.kinematics import axis_of, frame_with_z

FORMAT = 1
FARTHEST = 0.1  # [m] that a joint can be from its place: more is another arm, or another unit
STEEPEST = 0.5  # [rad] between an axis and its description
SCALES = (0.5, 2.0)  # of a transmission
SOFTEST = 1.0  # [rad/(N m)]

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class MeasuredJoint:
    """How far one turning joint is from its description.

    Raises:
        InvalidInputError: not finite, an axis whose length is not 1, or farther off than any arm of this kind.
    """

    position: Vector = (0.0, 0.0, 0.0)
    """Of the joint in its described frame, whose z is the joint's axis [m]."""
    axis: Vector = (0.0, 0.0, 1.0)
    """Its direction there, a unit vector."""
    offset: float = 0.0
    """By which the joint is turned when the arm reports the description's zero [rad]."""
    scale: float = 1.0
    """Turned angle over reported angle."""
    compliance: float = 0.0
    """Angle by which it gives under gravity's torque [rad/(N m)]."""

    def __post_init__(self) -> None:
        """Check the numbers; lists of a file become tuples."""
        for name, unit in (("position", "m"), ("axis", "")):
            vector = tuple(checks.vector(name, getattr(self, name), 3, unit).tolist())
            object.__setattr__(self, name, vector)
        for name, unit in (("offset", "rad"), ("scale", ""), ("compliance", "rad/(N m)")):
            object.__setattr__(self, name, checks.number(name, getattr(self, name), unit))
        far = math.hypot(*self.position)
        if far > FARTHEST:
            raise InvalidInputError(f"position is {far:.6g} m from the described place; at most {FARTHEST} m")
        length = math.hypot(*self.axis)
        if not abs(length - 1.0) <= 1e-9:  # what rounding leaves in a file
            raise InvalidInputError(f"axis must be a unit vector, got one of length {length:.6g}")
        slope = math.atan2(math.hypot(*self.axis[:2]), self.axis[2])
        if slope > STEEPEST:
            raise InvalidInputError(f"axis is {slope:.3g} rad from the described one; at most {STEEPEST} rad")
        if abs(self.offset) > math.pi:
            raise InvalidInputError(f"offset must be at most half a turn, got {self.offset:.6g} rad")
        if not SCALES[0] <= self.scale <= SCALES[1]:
            raise InvalidInputError(f"scale must be between {SCALES[0]} and {SCALES[1]}, got {self.scale:.6g}")
        if not 0.0 <= self.compliance <= SOFTEST:
            raise InvalidInputError(
                f"compliance must be between 0 and {SOFTEST} rad/(N m), got {self.compliance:.6g} rad/(N m)"
            )

    @property
    def placement(self) -> pin.SE3:
        """Pose of the joint's frame, at the reported zero, in the described one (z along the axis)."""
        turn = pin.utils.rotate("z", self.offset) if self.offset else np.eye(3)
        return pin.SE3(axis_rotation(self.axis) @ turn, np.array(self.position))


@dataclass(frozen=True, slots=True)
class MeasuredArm:
    """How one arm differs from its description: what `load_robot(calibration=...)` takes, and `robot.calibration`."""

    robot: str
    """Name of the robot."""
    fingerprint: str
    """SHA-256 of the joints of its description: what the measured numbers are relative to."""
    joints: tuple[tuple[str, MeasuredJoint], ...]
    """Name and deviation of every joint, base to tip."""
    facts: tuple[tuple[str, float], ...] = ()
    """What is known of the measurements: names with units, and numbers."""
    path: Path | None = field(default=None, compare=False)
    """The file they were read from."""

    def __post_init__(self) -> None:
        """Check the joints.

        Raises:
            InvalidInputError: none, or other than pairs of a name and a `MeasuredJoint`.
        """
        joints = checks.listed("joints", self.joints)
        pairs = [each for each in joints if isinstance(each, tuple) and len(each) == 2]
        named = [name for name, joint in pairs if isinstance(name, str) and isinstance(joint, MeasuredJoint)]
        if not joints or len(named) < len(joints):
            raise checks.refusal("joints", "pairs of a name and a MeasuredJoint, base to tip", self.joints)

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the joints whose scale is not 1, or that give under load."""
        return tuple(name for name, each in self.joints if each.scale != 1.0 or each.compliance != 0.0)

    def __str__(self) -> str:
        """The largest deviation of each kind, on one line."""
        each = [joint for _, joint in self.joints]
        shift = 1e3 * max(math.hypot(*joint.position) for joint in each)
        tilt = 1e3 * max(math.hypot(*joint.axis[:2]) for joint in each)
        offset = 1e3 * max(abs(joint.offset) for joint in each)
        return f"joints up to {shift:.2f} mm, {tilt:.2f} mrad and {offset:.2f} mrad of offset from the description"

    def apply(self, model: pin.Model, base: str) -> None:
        """Move the joints of a chain that was just made; those with no deviation stay the same to the bit.

        Args:
            model: the chain, which is changed.
            base: the frame that is its universe.

        Raises:
            ModelError: another arm was measured, or no chain of joints can have these numbers.
        """
        self.check(model, base)
        if self.drives:
            raise ModelError(
                "the calibration has a transmission's scale or a joint that gives under load "
                f"({', '.join(self.drives)}), which no robot of plain joints can hold: Calibration.forward_kinematics "
                "has it; inverse kinematics and descriptions need a calibration without"
            )
        for index, (_, joint) in enumerate(self.joints, start=1):
            if joint != MeasuredJoint():
                model.jointPlacements[index] = model.jointPlacements[index] * moved(model, index, joint)

    def undo(self, model: pin.Model) -> pin.Model:
        """A copy of a chain that `apply` has moved, its joints where the description has them, to rounding."""
        described = model.copy()
        for index, (_, joint) in enumerate(self.joints, start=1):
            described.jointPlacements[index] = model.jointPlacements[index] * moved(model, index, joint).inverse()
        return described

    def check(self, model: pin.Model, base: str) -> None:
        """Refuse a chain that is not the one that was measured.

        Raises:
            ModelError: another robot, or other numbers.
        """
        whose = f"{self.path or 'calibration'} is a calibration of {self.robot!r}"
        names = tuple(model.names)[1:]
        joints = tuple(name for name, _ in self.joints)
        if self.robot != model.name:
            raise ModelError(f"{whose}, and this robot is {model.name!r}")
        if joints != names:
            raise ModelError(f"{whose} with joints {', '.join(joints)}; this one has {', '.join(names)}")
        if self.fingerprint != joints_fingerprint(model, base):
            raise ModelError(
                f"{whose} whose description had other numbers, or another base than {base!r}: measure again"
            )

    def save(self, path: str | Path) -> None:
        """Write a TOML file, numbers with the digits that read back to the same bits.

        Raises:
            InvalidInputError: it cannot be written.
        """
        lines = [
            f"# How {_quoted(self.robot)} differs from its description; load_robot(..., calibration=<this file>).",
            "# position [m], axis (unit vector) and offset [rad] of each joint in the joint frame of the description,",
            "# whose z is the joint's axis.",
            f"format = {FORMAT}",
            f"robot = {_quoted(self.robot)}",
            f"fingerprint = {_quoted(self.fingerprint)}",
        ]
        if self.facts:
            lines += ["", "[facts]", *(f"{_quoted(name)} = {value!r}" for name, value in self.facts)]
        for name, joint in self.joints:
            lines += ["", f"[joints.{_quoted(name)}]"]
            lines += [f"{each.name} = {_toml(getattr(joint, each.name))}" for each in fields(joint)]
        with files.replacing(checks.path("path", path)) as temporary:
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, path: str | Path) -> MeasuredArm:
        """Read a file that `save` wrote.

        Raises:
            ModelError: no such file, damaged, of another version, or with numbers that no arm has; says which.
        """
        path = checks.path("calibration", path)
        try:
            content = documents.read_toml(path, "is not a calibration file, or damaged")
        except InvalidInputError as error:
            raise ModelError(str(error)) from error
        return _parse(path, content)


def _quoted(text: str) -> str:
    """A text in TOML, whose escapes are those of JSON but for surrogate pairs, which it does not take."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _toml(value: float | Vector) -> str:
    return f"[{', '.join(map(repr, value))}]" if isinstance(value, tuple) else repr(value)


def _parse(path: Path, content: Mapping[str, Any]) -> MeasuredArm:
    """The arm that a file's content describes.

    Raises:
        ModelError: something is missing, unknown or impossible.
    """
    if "format" not in content or "robot" not in content:
        raise ModelError(f"{path}: is not a calibration file: it names no format or no robot")
    if content["format"] != FORMAT or isinstance(content["format"], bool):
        raise ModelError(f"{path}: is of format {content['format']!r}; this version of jacokin reads format {FORMAT}")
    keys = {"format", "robot", "fingerprint", "facts", "joints"}
    unknown, missing = sorted(content.keys() - keys), sorted(keys - {"facts"} - content.keys())
    if unknown or missing:
        what = f"unknown {', '.join(unknown)}" if unknown else f"{', '.join(missing)} is missing"
        raise ModelError(f"{path}: is damaged: {what}")
    try:
        robot, digest = checks.text("robot", content["robot"]), checks.text("fingerprint", content["fingerprint"])
        tables = checks.mapping("joints", content["joints"], "tables of joints")
        facts = checks.mapping("facts", content.get("facts", {}), "a table of numbers")
        numbers = tuple((name, checks.number(f"facts.{name}", value)) for name, value in facts.items())
    except InvalidInputError as error:
        raise ModelError(f"{path}: is damaged: {error}") from error
    return MeasuredArm(robot, digest, tuple((n, _parse_joint(path, n, t)) for n, t in tables.items()), numbers, path)


def _parse_joint(path: Path, name: str, table: object) -> MeasuredJoint:
    wanted = {each.name for each in fields(MeasuredJoint)}
    if not isinstance(table, Mapping) or table.keys() != wanted:
        raise ModelError(f"{path}: is damaged: joint {name!r} must have {', '.join(sorted(wanted))} and nothing else")
    try:
        for key in ("position", "axis"):
            checks.array(key, table[key], "3 numbers")
        return MeasuredJoint(**table)
    except InvalidInputError as error:
        raise ModelError(f"{path}: joint {name!r}: {error}") from error


def axis_rotation(axis: Vector) -> Array:
    """The least rotation (3, 3) that takes z to a unit vector near it; the identity for z itself.

    The third number is taken from the other two: rounding in a file leaves a rotation a rotation.
    """
    x, y, _ = axis
    z = math.sqrt(1.0 - x * x - y * y)
    k = 1.0 / (1.0 + z)
    return np.array([[1.0 - k * x * x, -k * x * y, x], [-k * x * y, 1.0 - k * y * y, y], [-x, -y, z]])


def _turning_axis(model: pin.Model, index: int) -> Array:
    """Direction (3,) of a turning joint's axis in its own frame.

    Raises:
        ModelError: the joint slides.
    """
    axis = axis_of(model, index)
    if axis.slides:
        raise ModelError(f"joint {model.names[index]!r} slides: only arms whose joints all turn are calibrated")
    return axis.direction


def moved(model: pin.Model, index: int, joint: MeasuredJoint) -> pin.SE3:
    """Pose of a deviating joint in its described frame, in the joint's own axes."""
    turn = pin.SE3(frame_with_z(_turning_axis(model, index)), np.zeros(3))
    return turn * joint.placement * turn.inverse()


def joints_fingerprint(model: pin.Model, base: str) -> str:
    """SHA-256 of the joints of a chain before any calibration: names, axes and places, to 1e-9."""
    content = hashlib.sha256("\n".join([base, *tuple(model.names)[1:]]).encode())
    for index in range(1, model.njoints):
        placement = model.jointPlacements[index].homogeneous[:3]
        rows: NDArray[np.float64] = np.column_stack((placement, _turning_axis(model, index)))
        content.update(np.round(rows / 1e-9).astype(np.int64).tobytes())
    return content.hexdigest()
