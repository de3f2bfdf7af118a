"""`load_robot`: a bundled name, a URDF or an MJCF becomes a `Robot`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError, UnknownNameError, shown
from jacokin.model import checks, home
from jacokin.model.descriptions import bundled, chain, reading
from jacokin.model.descriptions.whole import Coupling
from jacokin.model.robot import Home, HomeFinder, Robot, Source

FINGER_ANGLE = 0.15  # [rad] fully open: the fingers' lower limit
TIP_OF_BUNDLED = "end_effector"


def load_robot(
    robot: str | Path = bundled.DEFAULT_ROBOT,
    *,
    base: str | None = None,
    tip: str | None = None,
    finger_angle: float | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    package_dirs: Sequence[str | Path] = (),
) -> Robot:
    """Load an arm by name or from a file, which is not read again afterwards (meshes of a URDF: when first needed).

    Args:
        robot: a bundled name (`jacokin.model.NAMES`), or the path of a .urdf or .xml (MJCF) file. Load only files that
            you trust, or in a sandbox: what an MJCF makes MuJoCo do is not bounded.
        base: frame in which poses are expressed. None: the root link of a URDF, the world of an MJCF.
        tip: frame at the end of the arm, and its default frame. None: the arm ends where the tree branches (into
            fingers), and its default frame is the end effector there.
        finger_angle: angle at which joints off the arm are locked [rad]. None: 0.15 for bundled robots, the reference
            position clipped into the limits for a user's file.
        limits: a user's own limits (lower, upper) [rad] by joint name, in place of those of the file.
        package_dirs: folders that hold the packages of package:// meshes, searched before ROS_PACKAGE_PATH and the
            folders above the file. Kinematics needs no meshes; self-contact does.

    Returns:
        The robot; nq == nv == dof in `robot.pin_model`.

    Raises:
        UnknownNameError: no such bundled robot, frame or joint.
        InvalidInputError: limits malformed, or a finger angle that no finger can take.
        ModelError: the file is missing, malformed, or holds no such arm.
    """
    path, name = reading.resolve(robot)
    for argument, frame in (("base", base), ("tip", tip)):
        if frame is not None and not isinstance(frame, str):
            raise InvalidInputError(f"{argument} must be the name of a frame, got {shown(frame)}")
    folders = _folders(package_dirs)
    if finger_angle is not None:
        finger_angle = checks.number("finger_angle", finger_angle, "rad")
    whole = reading.read(path, name)
    if name:
        tip = tip or TIP_OF_BUNDLED
        finger_angle = FINGER_ANGLE if finger_angle is None else finger_angle
    locked = _locked_reference(whole.model, whole.reference, finger_angle)
    model = chain.extract(whole.model, locked, base, tip, name or whole.model.name or path.stem)
    _refuse_coupled(model, whole.couplings)
    if finger_angle is not None:
        _check_fingers(whole.model, model, finger_angle)
    own_limits = () if limits is None else _override_limits(model, limits)
    _check_limits(model)
    return Robot(
        model,
        base=base or whole.base,
        tip=tip,
        source=Source(path, whole.kind, name, base, tip, folders, own_limits, whole.content),
        finger_angle=finger_angle,
        home=_documented_home(name, model) if name else home.find,
    )


def _folders(package_dirs: Sequence[str | Path]) -> tuple[Path, ...]:
    folders = checks.listed("package_dirs", package_dirs)
    for folder in folders:
        if not isinstance(folder, str | Path):
            raise InvalidInputError(f"package_dirs must be a list of folders, got {shown(folder)} in it")
    return tuple(Path(folder).absolute() for folder in folders)


def _documented_home(name: str, model: pin.Model) -> Home | HomeFinder:
    """The home of a bundled robot, free of contact by its tests; to be found where the chain or its limits differ."""
    known = home.documented(name)
    if (
        len(known.q) != model.nv
        or (known.q < model.lowerPositionLimit).any()
        or (known.q > model.upperPositionLimit).any()
    ):
        return home.find
    return known


def _locked_reference(full: pin.Model, reference: Array, finger_angle: float | None) -> Array:
    """Configuration at which joints off the arm are frozen; the arm's own entries do not matter."""
    q = np.array(reference, dtype=np.float64)
    for index in range(1, full.njoints):
        joint = full.joints[index]
        if joint.nq != 1:
            continue
        at = joint.idx_q
        wanted = q[at] if finger_angle is None else finger_angle
        q[at] = min(max(wanted, full.lowerPositionLimit[at]), full.upperPositionLimit[at])
    return q


def _refuse_coupled(model: pin.Model, couplings: Iterable[Coupling]) -> None:
    """Solving needs joints that move independently of each other and of what holds the arm."""
    for joint in tuple(model.names)[1:]:
        for coupling in couplings:
            if joint in coupling.joints:
                raise ModelError(
                    f"joint {joint!r} of the arm is coupled ({coupling.what}); "
                    "jacokin solves for independent joints only"
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


def _override_limits(
    model: pin.Model, limits: Mapping[str, tuple[float, float]]
) -> tuple[tuple[str, float, float], ...]:
    """Write a user's own limits [rad] into a freshly extracted chain; the limits as they were read."""
    names = tuple(model.names)[1:]
    lower, upper = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
    written: list[tuple[str, float, float]] = []
    if not isinstance(limits, Mapping):
        raise InvalidInputError(f"limits must map joint names to pairs (lower, upper) [rad], got {shown(limits)}")
    for joint, pair in limits.items():
        if joint not in names:
            raise UnknownNameError("joint", joint, names)
        where = f"limits[{joint!r}]"
        try:
            both = checks.numbers(pair)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"{where} must be a pair (lower, upper) [rad], got {shown(pair)}") from error
        if both.shape != (2,):
            raise InvalidInputError(f"{where} must be a pair (lower, upper) [rad], got {shown(pair)}")
        low, high = both.tolist()
        if not low <= high:
            raise InvalidInputError(f"{where}: lower {low} must not be above upper {high}")
        if low > chain.NO_LIMIT or high < -chain.NO_LIMIT:
            raise InvalidInputError(f"{where}: no angle within 1e6 rad lies between {low} and {high}")
        lower[names.index(joint)], upper[names.index(joint)] = low, high
        written.append((joint, low, high))
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    return tuple(written)


def _check_limits(model: pin.Model) -> None:
    """A chain whose limits contradict each other is not an arm."""
    for name, low, high in zip(tuple(model.names)[1:], model.lowerPositionLimit, model.upperPositionLimit, strict=True):
        if not low <= high:
            raise ModelError(f"joint {name!r}: lower limit {low} is above upper limit {high}")
