"""`load_robot`: a bundled name, a URDF or an MJCF becomes a `Robot`."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError, UnknownNameError
from jacokin.model import checks, home
from jacokin.model.descriptions import bundled, chain, table, urdf
from jacokin.model.robot import HomeFinder, Robot, Source

FINGER_ANGLE = 0.15  # [rad] fully open: the fingers' lower limit
BASE_OF_BUNDLED = "link_base"
TIP_OF_BUNDLED = "end_effector"


def load_robot(
    robot: str | Path = bundled.DEFAULT_ROBOT,
    *,
    base: str | None = None,
    tip: str | None = None,
    finger_angle: float | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
) -> Robot:
    """Load an arm by name or from a file.

    Args:
        robot: a bundled name ("j2n6s300", "j2n6s200", "j2s6s300", "j2s6s200", "m1n6s300", "m1n6s200"), or the path
            of a .urdf or .xml (MJCF) file.
        base: frame in which poses are expressed. None: the root link of a URDF, the world of an MJCF.
        tip: frame at the end of the arm, and its default frame. None: the arm ends where the tree branches (into
            fingers), and its default frame is the end effector there.
        finger_angle: angle at which joints off the arm are locked [rad]. None: 0.15 for bundled robots, the reference
            position clipped into the limits for a user's file.
        limits: a user's own limits (lower, upper) [rad] by joint name, in place of those of the file.

    Returns:
        The robot; nq == nv == dof in `robot.pin_model`.

    Raises:
        UnknownNameError: no such bundled robot, frame or joint.
        InvalidInputError: limits malformed, or a finger angle that no finger can take.
        ModelError: the file is missing, malformed, or holds no such arm.
    """
    path, name = _resolve(robot)
    for argument, frame in (("base", base), ("tip", tip)):
        if frame is not None and not isinstance(frame, str):
            raise InvalidInputError(f"{argument} must be the name of a frame, got {frame!r}")
    coupled: set[str] = set()
    if name:
        full = urdf.parse(path.read_text(encoding="utf-8"), str(path))
        reference, kind = pin.neutral(full), "urdf"
        base_name = base or _root_link(full)
    elif path.suffix == ".urdf" or _is_urdf(path):
        full, coupled = urdf.read(path)
        reference, kind = pin.neutral(full), "urdf"
        base_name = base or _root_link(full)
    else:
        from jacokin.model.descriptions import mjcf

        compiled = mjcf.compile_mjcf(path)
        full = mjcf.to_pinocchio(compiled, path.stem)
        coupled = mjcf.coupled_joints(compiled)
        reference, kind = mjcf.reference_configuration(compiled, full), "mjcf"
        base_name = base or mjcf.WORLD
    if name:
        tip = tip or TIP_OF_BUNDLED
        finger_angle = FINGER_ANGLE if finger_angle is None else finger_angle
    locked = _locked_reference(full, reference, finger_angle)
    model = chain.extract(full, locked, base, tip, name or full.name or path.stem)
    _refuse_coupled(model, coupled)
    if finger_angle is not None:
        _check_fingers(full, model, finger_angle)
    if limits is not None:
        _override_limits(model, limits)
    _check_limits(model)
    source = Source(path=path, kind=kind, bundled=name, base=base, tip=tip)
    return Robot(
        model,
        base=base_name,
        tip=tip,
        source=source,
        finger_angle=finger_angle,
        home=_documented_home(name, model) if name else home.find,
    )


def _documented_home(name: str, model: pin.Model) -> Array | HomeFinder:
    """The home of a bundled robot, free of contact by its tests; to be found where the chain or its limits differ."""
    q = np.array(table.variant(name)["home"], dtype=np.float64)
    if len(q) == model.nv and ((q >= model.lowerPositionLimit) & (q <= model.upperPositionLimit)).all():
        return q
    return home.find


def _resolve(robot: str | Path) -> tuple[Path, str | None]:
    """Path of the description, and the bundled name if it is one."""
    if not isinstance(robot, str | Path):
        raise InvalidInputError(f"robot must be a bundled name or a path, got {type(robot).__name__}")
    text = str(robot)
    if text in bundled.NAMES:
        return bundled.urdf_folder() / f"{text}.urdf", text
    path = Path(robot).absolute()
    if path.suffix not in (".urdf", ".xml", ".mjcf"):
        if _is_file(path):
            raise ModelError(f"{path}: unknown file type {path.suffix!r}; valid: .urdf, .xml (MJCF)")
        raise UnknownNameError("robot", text, [*bundled.NAMES, "or a path to a .urdf or .xml file"])
    if not _is_file(path):
        raise ModelError(f"{path}: no such file")
    return path, None


def _is_file(path: Path) -> bool:
    """As `Path.is_file`, which raises for a path too long for the system."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _root_link(full: pin.Model) -> str:
    """Name of the first link that does not move."""
    for index, frame in enumerate(full.frames):
        if index and frame.type == pin.FrameType.BODY and frame.parentJoint == 0:
            return str(frame.name)
    return str(full.frames[0].name)


def _locked_reference(full: pin.Model, reference: Array, finger_angle: float | None) -> Array:
    """Configuration at which joints off the arm are frozen; the arm's own entries do not matter."""
    if finger_angle is not None:
        finger_angle = float(checks.vector("finger_angle", [finger_angle], 1, "rad")[0])
    q = np.array(reference, dtype=np.float64)
    for index in range(1, full.njoints):
        joint = full.joints[index]
        if joint.nq != 1:
            continue
        at = joint.idx_q
        wanted = q[at] if finger_angle is None else finger_angle
        q[at] = min(max(wanted, full.lowerPositionLimit[at]), full.upperPositionLimit[at])
    return q


def _is_urdf(path: Path) -> bool:
    """Whether an XML file holds a URDF, whatever it is called."""
    try:
        return ET.parse(path).getroot().tag == "robot"
    except (OSError, ET.ParseError):
        return False


def _refuse_coupled(model: pin.Model, coupled: set[str]) -> None:
    """An arm joint that must follow another one is not free to be solved for."""
    for joint in tuple(model.names)[1:]:
        if joint in coupled:
            raise ModelError(
                f"joint {joint!r} of the arm is coupled to another one (mimic or equality); jacokin solves for "
                "independent joints only"
            )


def _check_fingers(full: pin.Model, model: pin.Model, finger_angle: float) -> None:
    """The angle must be one that a joint off the arm can take; others are clipped into their limits."""
    arm = set(model.names)
    ranges = [
        (full.lowerPositionLimit[joint.idx_q], full.upperPositionLimit[joint.idx_q])
        for name, joint in zip(full.names, full.joints, strict=True)
        if joint.nq == 1 and joint.nv == 1 and name not in arm and name != "universe"
    ]
    if ranges and not any(low <= finger_angle <= high for low, high in ranges):
        low, high = ranges[0]
        raise InvalidInputError(f"finger_angle = {finger_angle} rad: the fingers move from {low} to {high} rad")


def _override_limits(model: pin.Model, limits: Mapping[str, tuple[float, float]]) -> None:
    """Write a user's own limits [rad] into a freshly extracted chain."""
    names = tuple(model.names)[1:]
    lower, upper = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
    if not isinstance(limits, Mapping):
        raise InvalidInputError(f"limits must map joint names to pairs (lower, upper) [rad], got {limits!r}")
    for joint, pair in limits.items():
        if joint not in names:
            raise UnknownNameError("joint", joint, names)
        try:
            low, high = checks.numbers(pair).tolist()
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"limits[{joint!r}] must be a pair (lower, upper) [rad], got {pair!r}") from error
        if not low <= high:
            raise InvalidInputError(f"limits[{joint!r}]: lower {low} must not be above upper {high}")
        if low > chain.NO_LIMIT or high < -chain.NO_LIMIT:
            raise InvalidInputError(f"limits[{joint!r}]: no angle within 1e6 rad lies between {low} and {high}")
        lower[names.index(joint)], upper[names.index(joint)] = low, high
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper


def _check_limits(model: pin.Model) -> None:
    """A chain whose limits contradict each other is not an arm."""
    for name, low, high in zip(tuple(model.names)[1:], model.lowerPositionLimit, model.upperPositionLimit, strict=True):
        if not low <= high:
            raise ModelError(f"joint {name!r}: lower limit {low} is above upper limit {high}")
