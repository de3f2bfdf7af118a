"""`load_robot`: a bundled name, a URDF or an MJCF becomes a `Robot`, and its home is found."""

from __future__ import annotations

import errno
import itertools
import logging
import math
import stat
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin import files
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError, ShapeError, UnknownNameError
from jacokin.model import checks
from jacokin.model.angles import TURN
from jacokin.model.descriptions import bundled, chain, urdf
from jacokin.model.descriptions.tools import limits_of, slides
from jacokin.model.dynamics import impossible_moments
from jacokin.model.kinematics import axis_of
from jacokin.model.measured_arm import MeasuredArm
from jacokin.model.robot import Home, HomeFinder, Known, Robot, SceneLike, Source, limit_margins, middle, spread

logger = logging.getLogger(__name__)

TIP_OF_BUNDLED = "end_effector"
NO_FILE = "no such file"


def load_robot(
    robot: str | Path = bundled.DEFAULT_ROBOT,
    *,
    base: str | None = None,
    tip: str | None = None,
    finger_angle: float | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    package_dirs: Sequence[str | Path] = (),
    calibration: str | Path | MeasuredArm | None = None,
    velocity_limit: ArrayLike | None = None,
    decompose: bool = False,
    locked: Mapping[str, float] | None = None,
    home: ArrayLike | None = None,
    srdf: str | Path | None = None,
) -> Robot:
    """Load an arm by name or from a file, which is not read again afterwards (meshes of a URDF: when first needed).

    Args:
        robot: a bundled name (`jacokin.model.NAMES`), or the path of a .urdf or .xml (MJCF) file. Load only files that
            you trust, or in a sandbox: not all that an MJCF makes MuJoCo do is bounded.
        base: frame in which poses are expressed. None: the root link of a URDF, the world of an MJCF.
        tip: frame at the end of the arm, and its default frame. None: the arm ends where the tree branches (into
            fingers), and its default frame is the end effector there.
        finger_angle: where joints off the arm are locked, if there are any [rad], or [m] where they slide. None: open
            for bundled robots (0.15, of the gen3_lite -0.96), the reference position clipped into the limits for a
            user's file.
        limits: a user's own limits (lower, upper) [rad] by joint name, in place of those of the file.
        package_dirs: folders that hold the packages of package:// meshes, searched before ROS_PACKAGE_PATH and the
            folders above the file. Kinematics needs no meshes; self-contact does.
        calibration: how this arm differs from its description: a file that `jacokin.calibration` saved, or what
            `robot.calibration` holds. None: not at all. Limits stay those of the reported angles.
        velocity_limit: (dof,) or one for all [rad/s], in place of those of the file. None: what the file gives; an MJCF
            gives none.
        decompose: True to look for contact on convex parts of the meshes, which takes seconds when it is first looked
            for; False for their convex hulls, which see contact where a mesh is hollow.
        locked: where joints off the arm are locked [rad], or [m] where they slide, by name: another arm of the file, a
            torso, a gripper; what mimics such a joint follows it. Others as `finger_angle` says.
        home: (dof,) a home of your own within the limits [rad], in place of the one that is found.
        srdf: a file of MoveIt's, whose disabled pairs of links do not count as contact. None: the one of the URDF's
            name beside it, or in a folder srdf beside that of the URDF, if there is one.

    Returns:
        The robot; nq == nv == dof in `robot.pin_model`.

    Raises:
        UnknownNameError: no such bundled robot, frame or joint.
        InvalidInputError: limits, velocity limits, locked joints or a home malformed or out of the limits, or a finger
            angle that no finger can take.
        ModelError: the file is missing, malformed, or holds no such arm; the calibration is damaged or another arm's;
            the SRDF cannot be read, or the robot is an MJCF or a bundled one, which exclude pairs themselves.
    """
    path, name = _resolve(robot)
    checks.optional(checks.instance, "base", base, str, "the name of a frame")
    checks.optional(checks.instance, "tip", tip, str, "the name of a frame")
    folders = tuple(
        checks.folder(f"package_dirs[{k}]", each).absolute()
        for k, each in enumerate(checks.listed("package_dirs", package_dirs))
    )
    finger_angle = checks.optional(checks.number, "finger_angle", finger_angle, "rad")
    described = _read(path, name)
    if name:
        tip = tip or TIP_OF_BUNDLED
        finger_angle = bundled.open_angle(name) if finger_angle is None else finger_angle
    disabled, said = _disabled_pairs(path, described, srdf)
    full = described.model
    leaders = {joint: each.leader for each in described.couplings if each.leader for joint in each.followers}
    ends = chain.find_ends(full, base, tip, leaders)
    followers = _followers(described, ends)
    held = {} if locked is None else _held(full, ends, locked, followers)
    reference = _locked_reference(full, described.reference, finger_angle, held, followers)
    model = chain.extract(full, reference, ends, name or full.name or path.stem)
    _refuse_coupled(model, described.couplings)
    if finger_angle is not None:
        _check_fingers(full, model, finger_angle)
    own_limits = () if limits is None else _override_limits(model, limits)
    if velocity_limit is not None:
        model.velocityLimit = checks.positive_vector("velocity_limit", velocity_limit, model.nv, "rad/s")
    measured = None if calibration is None else _calibrate(model, base or described.base, calibration)
    own_home = None if home is None else _own_home(model, home)
    found_home = _documented_home(name, model) if name else find_home
    known = Known(
        base=base or described.base,
        tip=ends.frame,
        source=Source(
            path,
            described.kind,
            name,
            base,
            tip,
            package_dirs=folders,
            limits=own_limits,
            content=described.content,
            calibration=measured,
            notes=(*ends.notes, *described.notes, *said),
            locked=tuple(held.items()),
            followers=followers,
            velocity_limit=() if velocity_limit is None else tuple(model.velocityLimit.tolist()),
            home=() if own_home is None else tuple(own_home.q.tolist()),
            disabled=disabled,
            decompose=checks.flag("decompose", decompose),
        ),
        finger_angle=finger_angle,
        home=own_home or found_home,
        notes=find_notes,
        point_filter=filter_points,
    )
    return Robot(model, known)


def _calibrate(model: pin.Model, base: str, calibration: str | Path | MeasuredArm) -> MeasuredArm:
    """Move the joints of a freshly extracted chain to where a calibration has them.

    Raises:
        ModelError: as `load_robot`.
    """
    if not isinstance(calibration, MeasuredArm | str | Path):
        raise checks.refusal("calibration", "a file name or a MeasuredArm, as robot.calibration is", calibration)
    measured = calibration if isinstance(calibration, MeasuredArm) else MeasuredArm.load(calibration)
    measured.apply(model, base)
    return measured


def _resolve(robot: str | Path) -> tuple[Path, str | None]:
    """Path of the description, and the bundled name if it is one.

    Raises:
        UnknownNameError: neither a bundled name nor a file of a known type.
        InvalidInputError: neither a string nor a path.
        ModelError: there is no such file, or it is not a regular file.
    """
    path, text = checks.path("robot", robot, "a bundled name or a path").absolute(), str(robot)
    if text in bundled.NAMES:
        return bundled.urdf_folder() / f"{text}.urdf", text
    problem = _problem(path)
    if path.suffix.lower() in (".urdf", ".xml", ".mjcf"):
        if problem:
            raise ModelError(f"{path}: {problem}")
        return path, None
    if problem == NO_FILE:
        raise UnknownNameError("robot", text, [*bundled.NAMES, "or a path to a .urdf or .xml file"])
    if problem is None and path.suffix.lower() == ".xacro":
        raise ModelError(f"{path}: is a xacro file, not a URDF: expand it: xacro {path.name} > out.urdf")
    raise ModelError(f"{path}: {problem or f'unknown file type {path.suffix!r}; valid: .urdf, .xml (MJCF)'}")


def _problem(path: Path) -> str | None:
    """Why a path cannot be read as a file; None when it can. Reading a FIFO would wait without end."""
    try:
        mode, size = path.stat().st_mode, path.stat().st_size
    except (OSError, ValueError) as error:
        if getattr(error, "errno", None) == errno.ELOOP:
            return "is a loop of symbolic links"
        if getattr(error, "errno", None) in (errno.EACCES, errno.EPERM):
            return "cannot be read: permission denied"
        return NO_FILE  # or a name that no file can have
    if stat.S_ISDIR(mode):
        return "is a folder, not a file"
    if stat.S_ISREG(mode) and size > files.DESCRIPTION:
        return f"is larger than the {files.DESCRIPTION} bytes that are read of a description"
    return None if stat.S_ISREG(mode) else "is not a regular file (a pipe, socket or device)"


def _read(path: Path, name: str | None) -> chain.Description:
    """What a file describes; `name` says that the file is a bundled one, which is not checked again.

    Raises:
        ModelError: the file is malformed.
    """
    if name is not None:
        return urdf.read_bundled(path)
    if path.suffix.lower() == ".urdf" or _is_urdf(path):
        return urdf.read(path)
    from jacokin.model.descriptions import mjcf  # loads MuJoCo

    return mjcf.read(path)


def _is_urdf(path: Path) -> bool:
    """Whether an XML file holds a URDF, whatever it is called."""
    try:
        _, root = next(iter(ET.iterparse(path, events=("start",))))
        return str(root.tag).rpartition("}")[2] == "robot"
    except (OSError, ET.ParseError, ValueError, StopIteration):
        return False


def _documented_home(name: str, model: pin.Model) -> Home | HomeFinder:
    """The home of a bundled robot, free of contact by its tests; to be found where the chain or its limits differ."""
    known = documented_home(name)
    if (
        len(known.q) != model.nv
        or (known.q < model.lowerPositionLimit).any()
        or (known.q > model.upperPositionLimit).any()
    ):
        return find_home
    return known


def _disabled_pairs(
    path: Path, described: chain.Description, given: str | Path | None
) -> tuple[urdf.DisabledPairs | None, tuple[str, ...]]:
    """The pairs of links that an SRDF disables, and a note on them; one that merely lies there need not be right.

    Raises:
        InvalidInputError: not the name of a file.
        ModelError: the SRDF that was given cannot be read, or is not for this kind of description.
    """
    if given is not None:
        file = checks.path("srdf", given, "a file name")
        if described.kind != "urdf" or described.content is None:
            kind = "an MJCF" if described.kind == "mjcf" else "a bundled robot"
            raise ModelError(f"srdf={str(given)!r}: {path} is {kind}, which excludes pairs of links itself")
        disabled = urdf.read_srdf(file.absolute())
    else:
        found = urdf.find_srdf(path) if isinstance(described.content, str) else None
        if found is None:
            return None, ()
        try:
            disabled = urdf.read_srdf(found)
        except ModelError as error:
            return None, (f"pairs of links are not disabled: {error}",)
    links = set(chain.frame_names(described.model))
    known = disabled._replace(pairs=tuple(pair for pair in disabled.pairs if links.issuperset(pair)))
    return known, (f"contact between {len(known.pairs)} pairs of links does not count, by {disabled.path}",)


def _held(
    model: pin.Model,
    ends: chain.ArmEnds,
    locked: Mapping[str, float],
    followers: Sequence[tuple[str, str, float, float]],
) -> dict[str, float]:
    """Where a user locks joints off the arm, and with them the joints that follow those.

    Raises:
        UnknownNameError: no such joint.
        InvalidInputError: malformed, a joint of the arm, or out of the limits of the joint.
    """
    arm = {str(model.names[joint]) for joint in ends.chain}
    found: dict[str, float] = {}
    for joint, value in checks.mapping("locked", locked, "a dict of joint names and positions").items():
        where = f"locked[{joint!r}]"
        index = model.getJointId(checks.choice("joint", joint, tuple(model.names)[1:]))
        if joint in arm:
            raise InvalidInputError(f"{where}: is a joint of the arm, whose positions are q; limits= narrows it")
        kind = model.joints[index]
        if kind.nv != 1:
            raise InvalidInputError(f"{where}: has {kind.nv} degrees of freedom; only hinges and slides are locked")
        position = checks.number(where, value, "rad, or m")
        low, high = limits_of(model, index)
        if not low <= position <= high:
            raise InvalidInputError(f"{where} = {position}: the joint moves from {low} to {high}")
        found[joint] = position
    following: dict[str, float] = {}
    for joint, leader, multiplier, offset in followers:
        if leader in found and joint not in found:
            low, high = limits_of(model, model.getJointId(joint))
            following[joint] = min(max(multiplier * found[leader] + offset, low), high)
    return found | following


def _own_home(model: pin.Model, home: ArrayLike) -> Home:
    """A user's own home, checked.

    Raises:
        InvalidInputError: malformed, or out of the limits.
    """
    q = checks.vector("home", home, model.nv, "rad")
    for name, at, low, high in zip(
        tuple(model.names)[1:], q.tolist(), model.lowerPositionLimit, model.upperPositionLimit, strict=True
    ):
        if not low <= at <= high:
            raise InvalidInputError(f"home: joint {name!r} at {at} is out of its limits, {low} to {high}")
    return Home(checks.read_only(q), "given with home=")


def _locked_reference(
    full: pin.Model,
    reference: Array,
    finger_angle: float | None,
    held: Mapping[str, float],
    followers: Sequence[tuple[str, str, float, float]],
) -> Array:
    """Configuration at which joints off the arm are locked; the arm's own entries have no effect."""
    q = np.array(reference, dtype=np.float64)
    places, limits, wanted = dict[str, int](), dict[str, tuple[float, float]](), dict[str, float]()
    for index in range(1, full.njoints):
        joint, name = full.joints[index], str(full.names[index])
        at = joint.idx_q
        if joint.nq == 1:
            places[name], limits[name] = at, (full.lowerPositionLimit[at], full.upperPositionLimit[at])
            wanted[name] = held.get(name, q[at] if finger_angle is None else finger_angle)
        elif name in held:  # a continuous joint
            q[at : at + 2] = np.cos(held[name]), np.sin(held[name])
    following = () if finger_angle is None else [rule for rule in followers if rule[0] not in held]
    q[list(places.values())] = list(chain.standing(wanted, limits, following).values())
    return q


def _followers(described: chain.Description, ends: chain.ArmEnds) -> tuple[tuple[str, str, float, float], ...]:
    """The joints off the arm that follow another one off the arm: joint, leader, multiplier and offset."""
    arm = {str(described.model.names[joint]) for joint in ends.chain}
    rules = {
        joint: (each.leader, each.multiplier, each.offset)
        for each in described.couplings
        if each.leader is not None and each.leader not in arm
        for joint in sorted(each.followers - arm)
    }
    coupled = []
    for joint, (leader, multiplier, offset) in rules.items():
        passed = {joint}
        while leader in rules and leader not in passed:  # one that follows another one itself
            passed.add(leader)
            leader, further, start = rules[leader]
            multiplier, offset = multiplier * further, offset + multiplier * start
        coupled.append((joint, leader, multiplier, offset))
    known = arm | {joint for each in described.couplings for joint in each.joints}
    return (*coupled, *_mirrored(described.model, known))


def _mirrored(model: pin.Model, known: set[str]) -> Iterator[tuple[str, str, float, float]]:
    """Pairs of joints on one link that nothing couples and whose limits are each other's mirror image: two fingers.

    Files that leave their coupling to a driver write them so.
    """
    free = [
        joint
        for joint in range(1, model.njoints)
        if str(model.names[joint]) not in known and model.joints[joint].nq == 1 and not list(model.children[joint])
    ]
    for leader, joint in itertools.combinations(free, 2):
        alike = model.parents[leader] == model.parents[joint] and slides(model, leader) == slides(model, joint)
        (low, high), other = limits_of(model, leader), limits_of(model, joint)
        if alike and low != other[0] and np.isfinite((low, high)).all() and np.allclose(other, (-high, -low), atol=0.0):
            yield str(model.names[joint]), str(model.names[leader]), -1.0, 0.0


def _refuse_coupled(model: pin.Model, couplings: Iterable[chain.Coupling]) -> None:
    """Refuse an arm whose joints are coupled: solving needs joints that move independently."""
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
    allowed = [
        (*limits_of(full, joint), "m" if slides(full, joint) else "rad")
        for joint, name in enumerate(full.names)
        if full.joints[joint].nq == 1 and full.joints[joint].nv == 1 and name not in arm and name != "universe"
    ]
    if allowed and not any(low <= finger_angle <= high for low, high, _ in allowed):
        raise InvalidInputError(f"finger_angle = {finger_angle}: {chain.range_of_fingers(allowed)}")


def _override_limits(
    model: pin.Model, limits: Mapping[str, tuple[float, float]]
) -> tuple[tuple[str, float, float], ...]:
    """Write a user's own limits [rad] into a freshly extracted chain; the limits as they were read."""
    names = tuple(model.names)[1:]
    lower, upper = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
    written: list[tuple[str, float, float]] = []
    for joint, pair in checks.mapping("limits", limits, "a dict of joint names and pairs (lower, upper) [rad]").items():
        index, where = names.index(checks.choice("joint", joint, names)), f"limits[{joint!r}]"
        both = checks.array(where, pair, "a pair (lower, upper)", "rad")
        if both.shape != (2,):
            raise checks.refusal(where, "a pair (lower, upper)", pair, "rad")
        low, high = both.tolist()
        if not low <= high:
            raise InvalidInputError(f"{where}: lower {low} must not be above upper {high}")
        if low > chain.NO_LIMIT or high < -chain.NO_LIMIT:
            raise InvalidInputError(f"{where}: no angle within 1e6 rad lies between {low} and {high}")
        lower[index], upper[index] = low, high
        if any(2.0 * TURN < abs(limit) < math.inf for limit in (low, high)) and not axis_of(model, index + 1).slides:
            logger.warning("%s is in radians, and %s exceeds two turns", where, checks.shown(pair))
        written.append((joint, low, high))
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    return tuple(written)


def documented_home(name: str) -> Home:
    """The home of a bundled robot in the table of numbers, free of contact as tests check."""
    row = bundled.variant(name)
    source = row["doubt"].removeprefix("the home is ") if "doubt" in row else f"documented for the {name}"
    return Home(np.array(row["home"], dtype=np.float64), source)


def find_home(robot: Robot) -> Home:
    """The first candidate within the limits, free of contact and not singular; if none is, the one that is closest.

    A keyframe called "home" in the file; the documented home of a bundled robot whose joints stand where this one's
    do; the middle of the limits; random configurations of a fixed seed, first those above the base and away from the
    limits. Coarse shapes may always overlap; that is no reason to have no home.
    """
    from jacokin.model.contact import SelfContact, self_contact  # which need Robot

    unchecked = "without shapes to check for contact"
    try:
        checker = SelfContact.of(robot)
        if checker is None and self_contact(robot).has_shapes:
            unchecked = "no two of its own shapes count as touching, by its description"
    except ShapeError:
        checker, unchecked = None, "contact was not checked, as the shapes cannot be loaded"
    best, fewest, singular = Home(middle(robot), "the middle of the limits"), np.inf, True
    for candidate in _candidates(robot):
        if not robot.within_limits(candidate.q):
            continue
        touching, is_singular = len(checker.touching(candidate.q)) if checker else 0, _is_singular(robot, candidate.q)
        if (touching, is_singular) < (fewest, singular):
            best, fewest, singular = candidate, touching, is_singular
        if (fewest, singular) == (0, False):
            break
    if checker is None:
        return Home(best.q, f"{best.source}; {unchecked}")
    return Home(best.q, best.source if fewest == 0 else f"{best.source}; {fewest} pairs of shapes touch")


def filter_points(robot: Robot, q: ArrayLike, points: ArrayLike, margin: float, scene: SceneLike | None) -> Array:
    """The points that are not on the arm; see `Robot.without_own_points`."""
    from jacokin.model.surrounded import without_own_points  # which needs Robot

    return without_own_points(robot, q, points, margin, scene)


def find_notes(robot: Robot) -> tuple[str, ...]:
    """Sentences on what the description leaves open, and on what was left out of it; none for a bundled robot.

    Loads the shapes of the description.
    """
    if robot.source.bundled is not None:
        return ()
    from jacokin.model.contact import self_contact
    from jacokin.model.own_shapes import may_collide, overlapping

    notes = [*robot.source.notes, *_missing_numbers(robot)]
    try:
        if may_collide(robot):
            from jacokin.model.mujoco_twin import with_shapes

            notes += with_shapes(robot).notes
        always = sorted(tuple(sorted(pair)) for pair in overlapping(robot))
        if not self_contact(robot).has_shapes:
            notes.append("the description has no collision shapes: contact is not looked for")
    except ShapeError as error:
        return (*notes, f"contact cannot be looked for: {error}")
    if always:
        pairs = ", ".join(" and ".join(pair) for pair in always)
        notes.append(f"shapes that touch in every configuration, whose contact does not count: {pairs}")
    return tuple(notes)


def _missing_numbers(robot: Robot) -> Iterator[str]:
    """Sentences on numbers that the description does not give."""
    for what, limits, cure in (
        ("velocity", robot.velocity_limit, "velocity_limit="),
        ("effort", robot.effort_limit, "torque_limit="),
    ):
        missing = [name for name, limit in zip(robot.joint_names, limits, strict=True) if np.isinf(limit)]
        if missing:
            yield f"no limits of {what} for {', '.join(missing)}: motions that keep them need {cure}"
    bodies = list(robot.pin_model.inertias)[1:]
    weightless = [name for name, body in zip(robot.joint_names, bodies, strict=True) if not body.mass > 0.0]
    if len(weightless) == robot.dof:
        yield "no masses: what needs them is refused (gravity, mass matrix, torques)"
    elif weightless:
        yield f"no masses between {', '.join(weightless)} and the next joint: torques are those of the rest"
    for name, body in zip(robot.joint_names, bodies, strict=True):
        wrong = impossible_moments(np.asarray(body.inertia)) if body.mass > 0.0 else ""
        if wrong:
            what = f"what {name} carries up to the next joint has an inertia that no body has"
            yield f"{what}, so torques are wrong: {wrong}"


def _is_singular(robot: Robot, q: Array) -> bool:
    """Whether the tool can hardly move in some direction, as of a straight arm; solving from there goes badly."""
    values = robot.singular_values(q)
    return bool(values[-1] < 0.02 * values[0])  # 0.03 to 0.08 at the documented homes


def _candidates(robot: Robot) -> Iterator[Home]:
    keyframe = _keyframe(robot)
    if keyframe is not None:
        yield Home(keyframe, "keyframe 'home' of the file")
    for name in bundled.NAMES:
        if _has_the_joints_of(robot, name):
            yield documented_home(name)
            break
    yield Home(middle(robot), "the middle of the limits")
    # Of random configurations a real arm is free of self-contact in nine of ten.
    for q in sorted(spread(robot, 200), key=lambda q: _is_awkward(robot, q)):
        yield Home(q, "a random search within the limits")


def _is_awkward(robot: Robot, q: Array) -> tuple[bool, bool]:
    """Whether a joint or the tool is below the base, where a table may be, and whether a joint is near its limit."""
    model, data = robot.pin_model, robot.pin_model.createData()
    pin.framesForwardKinematics(model, data, q)
    heights = [placement.translation[2] for placement in list(data.oMi)[1:]]
    heights.append(data.oMf[robot.frame_id()].translation[2])
    below = min(heights) < min(0.0, heights[0])
    near = limit_margins(robot, q) < 0.1 * (robot.upper - robot.lower)
    return below, bool(near[~robot.unlimited].any())


def _has_the_joints_of(robot: Robot, name: str) -> bool:
    """Whether each joint has the place after the one before it that it has in a bundled arm; names do not count."""
    rows = list(bundled.arm_joints(name).values())
    if robot.dof != len(rows):
        return False
    for row, placement in zip(rows[1:], list(robot.pin_model.jointPlacements)[2:], strict=True):
        rpy = np.array([bundled.parse_angle(value) for value in row["rpy"]])
        expected = pin.SE3(pin.rpy.rpyToMatrix(rpy), np.array(row["xyz"], dtype=np.float64))
        if not np.allclose(placement.homogeneous, expected.homogeneous, rtol=0.0, atol=1e-3):  # [m], or of a matrix
            return False
    return all(joint.shortname() == "JointModelRZ" for joint in list(robot.pin_model.joints)[1:])


def _keyframe(robot: Robot) -> Array | None:
    """The arm's part of the keyframe "home" of an MJCF file."""
    model = robot.source.content
    if model is None or isinstance(model, str):
        return None
    from jacokin.model.descriptions import mjcf

    for key in range(model.nkey):
        if model.key(key).name == "home":
            addresses = model.jnt_qposadr[mjcf.joint_ids(model, robot.joint_names)]
            return np.array(model.key_qpos[key][addresses])
    return None
