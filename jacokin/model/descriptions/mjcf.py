"""MJCF robots, exactly as MuJoCo sees them.

Pinocchio has an MJCF reader of its own; it loses includes, frames, sites of jointless bodies and base poses. So MuJoCo
compiles the file, and the Pinocchio model is built from the compiled model: both engines then share every number.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.model.descriptions.chain import Coupling, Description

WORLD = "world"
#: What a link of a URDF with that name is called in MuJoCo, which would take it for the world body.
WORLD_LINK = "jacokin_world"
NUMERIC = frozenset((
    "pos", "quat", "euler", "axisangle", "xyaxes", "zaxis", "axis", "range", "ref", "springref", "mass", "qpos", "size",
    "fromto", "diaginertia", "fullinertia", "damping", "armature", "frictionloss", "stiffness", "margin", "friction",
    "actuatorfrcrange", "solref", "solimp", "gravity", "timestep", "rgba", "gear", "ctrlrange", "forcerange", "kp",
    "kv", "gainprm", "biasprm", "dynprm", "scale", "refpos", "refquat", "count", "offset", "nrow", "ncol", "elevation",
    "density", "gap", "coef", "polycoef", "width", "height",
))  # fmt: skip
MUJOCO_ERRORS = (ValueError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError)  # of its compiler
MOST_ELEMENTS = 20_000  # that copies may make; the time MuJoCo takes grows with their square: 6 s
MOST_POINTS = {"hfield": 4_000_000, "texture": 100_000_000}  # 0.1 GB and 0.3 GB
MOST_USER_DATA = 1_000_000
# As ints: NumPy's comparisons do not take enums.
SCALAR_JOINTS = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
JOINT_TRANSMISSIONS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
BODY_NAME, JOINT_NAME, SITE_NAME = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_JOINT, mujoco.mjtObj.mjOBJ_SITE


def read(path: Path) -> Description:
    """The robot or scene of an MJCF file.

    Raises:
        ModelError: as `compile_mjcf`.
    """
    compiled = compile_mjcf(path)
    model = to_pinocchio(compiled, path.stem)
    return Description(
        model=model,
        reference=reference_configuration(compiled, model),
        kind="mjcf",
        base=WORLD,
        couplings=couplings(compiled),
        content=compiled,
    )


def compile_mjcf(path: Path) -> mujoco.MjModel:
    """Compile an MJCF file.

    Raises:
        ModelError: MuJoCo refuses the file (its message is passed on), a number in it is not finite, or so large that
            MuJoCo cannot normalise it, a name is not in UTF-8, or the file asks for more elements, terrain or pixels
            than are read.
    """
    _check_text(path)
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except MUJOCO_ERRORS as error:
        raise ModelError(f"{path}: MuJoCo cannot load this file: {' '.join(str(error).split())}") from error
    try:
        model.names.decode()
    except UnicodeDecodeError as error:
        name = model.names[model.names.rfind(b"\0", 0, error.start) + 1 :].partition(b"\0")[0]
        raise ModelError(f"{path}: the name {name!r} is not in UTF-8") from error
    lengths, units = ("body_pos", "jnt_pos", "site_pos"), ("body_quat", "body_iquat", "site_quat", "jnt_axis")
    for name in (*lengths, *units, "jnt_range", "body_mass", "key_qpos", "qpos0"):
        if not np.isfinite(getattr(model, name)).all():
            raise ModelError(f"{path}: {name} of the compiled model is not finite")
    for name in units:  # zeros where a norm overflowed
        norms = np.linalg.norm(getattr(model, name), axis=1)
        if not (np.abs(norms - 1.0) <= 1e-6).all():  # MuJoCo normalises
            at = int(np.argmax(np.abs(norms - 1.0)))
            raise ModelError(f"{path}: {name}[{at}] of the compiled model has norm {norms[at]:.6g} instead of 1")
    return model


def _check_text(path: Path) -> None:
    """Refuse what MuJoCo would only warn of, and what would take minutes or gigabytes to compile.

    Files that cannot be parsed are left to MuJoCo, which says why.
    """
    files, seen, folders, elements = [path], set[Path](), {""}, 0
    while files:
        file = files.pop()
        if file in seen or len(seen) == 1000:
            continue
        seen.add(file)
        try:
            root = ET.parse(file).getroot()
        except (OSError, ValueError, ET.ParseError):
            continue
        looked_in = ("assetdir", "meshdir", "texturedir")
        folders.update(each.get(key, "") for each in root.iter("compiler") for key in looked_in)
        waiting = [(root, 1)]
        while waiting:
            element, copies = waiting.pop()
            _refuse_nan(file, element)
            _refuse_giants(file, element, [path.parent / folder for folder in folders])
            if element.tag in ("include", "model") and element.get("file"):
                files.append(path.parent / element.get("file", ""))
            copies *= _copies(element)
            elements += copies if copies > 1 else 0
            if elements > MOST_ELEMENTS:
                raise ModelError(f"{path}: replicate, composite and flexcomp make more than {MOST_ELEMENTS} elements")
            waiting += [(child, copies) for child in element]


def _refuse_nan(file: Path, element: ET.Element) -> None:
    for attribute in NUMERIC.intersection(element.keys()):
        if "nan" in element.attrib[attribute].lower().split():
            who = element.get("name", "without a name")
            raise ModelError(f'{file}: <{element.tag}> {who}: {attribute}="{element.attrib[attribute]}" is not finite')


def _copies(element: ET.Element) -> int:
    """How many times an element and what is in it are made."""
    if element.tag not in ("replicate", "composite", "flexcomp"):
        return 1
    counts = (max(_whole(part), 1) for part in element.get("count", "1").split())
    return min(math.prod(counts), MOST_ELEMENTS + 1)


def _whole(text: str | None) -> int:
    try:
        return int(float(text or "0"))
    except (ValueError, OverflowError):
        return 0  # MuJoCo says what is wrong with it


def _refuse_giants(file: Path, element: ET.Element, folders: Sequence[Path]) -> None:
    """Refuse terrains and textures of too many points, user data without end, and files that are none."""
    who = f"{file}: <{element.tag}> {element.get('name', 'without a name')}"
    named = [value for name, value in element.attrib.items() if name.startswith("file") and value]
    found = [folder / name for name in named for folder in folders if _is_there(folder / name)]
    for path in found:
        if not path.is_file():
            raise ModelError(f"{who}: {path} is not a regular file")
    if element.tag in MOST_POINTS:
        rows, columns = ("nrow", "ncol") if element.tag == "hfield" else ("height", "width")
        points = max([_whole(element.get(rows)) * _whole(element.get(columns)), *map(_pixels, found)])
        if points > MOST_POINTS[element.tag]:
            raise ModelError(f"{who} has {points} points; at most {MOST_POINTS[element.tag]} are read")
    if element.tag == "size":
        for name, value in element.attrib.items():
            if name.startswith("nuser") and _whole(value) > MOST_USER_DATA:
                raise ModelError(f"{who}: {name}={value} is more than the {MOST_USER_DATA} that are read")


def _is_there(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that no file can have
        return False


def _pixels(path: Path) -> int:
    """Width times height of a PNG file; 0 for another."""
    try:
        with path.open("rb") as opened:
            header = opened.read(24)
    except OSError:
        return 0
    wide, high = (int.from_bytes(header[at : at + 4], "big") for at in (16, 20))
    return wide * high if header.startswith(b"\x89PNG\r\n\x1a\n") else 0


def to_pinocchio(model: mujoco.MjModel, name: str) -> pin.Model:
    """The tree of a MuJoCo model in Pinocchio, its zero for ball and free joints at MuJoCo's reference pose.

    Bodies become body frames, sites operational frames, the world body a frame called "world". Names: `body_name`,
    `site_name`.
    """
    out = pin.Model()
    out.name = name
    out.gravity.linear = np.array(model.opt.gravity)
    out.addFrame(pin.Frame(WORLD, 0, 0, pin.SE3.Identity(), pin.FrameType.BODY), False)
    carried: dict[int, tuple[int, pin.SE3]] = {0: (0, pin.SE3.Identity())}
    dofs: list[int] = []  # MuJoCo's degree of freedom behind each of Pinocchio's
    for body in range(1, model.nbody):
        parent, T_parent_body = carried[model.body_parentid[body]]
        T_parent_body = T_parent_body * placement(model.body_quat[body], model.body_pos[body])
        for joint in body_joints(model, body):
            anchor = np.array(model.jnt_pos[joint])
            plain, T_zero = pinocchio_joint(model, joint)
            # A range alone is no limit to MuJoCo.
            lower, upper = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.inf, np.inf)
            effort = _effort(model, joint)
            parent = out.addJoint(
                parent,
                plain,
                T_parent_body * pin.SE3(np.eye(3), anchor) * T_zero,
                joint_name(model, joint),
                np.full(plain.nv, effort),
                np.full(plain.nv, np.inf),
                np.full(plain.nq, lower),
                np.full(plain.nq, upper),
            )
            dofs.extend(range(model.jnt_dofadr[joint], model.jnt_dofadr[joint] + plain.nv))
            T_parent_body = pin.SE3(np.eye(3), -anchor)
        carried[body] = (parent, T_parent_body)
        principal = placement(model.body_iquat[body], np.zeros(3)).rotation
        inertia = pin.Inertia(
            float(model.body_mass[body]),
            np.array(model.body_ipos[body]),
            principal @ np.diag(model.body_inertia[body]) @ principal.T,
        )
        out.appendBodyToJoint(parent, inertia, T_parent_body)
        out.addFrame(pin.Frame(body_name(model, body), parent, 0, T_parent_body, pin.FrameType.BODY), False)
    for site in range(model.nsite):
        parent, T_parent_body = carried[model.site_bodyid[site]]
        T_parent_site = T_parent_body * placement(model.site_quat[site], model.site_pos[site])
        name_of_site = site_name(model, site)
        if name_of_site:
            out.addFrame(pin.Frame(name_of_site, parent, 0, T_parent_site, pin.FrameType.OP_FRAME), False)
    out.armature = np.array(model.dof_armature[dofs])
    out.damping = np.array(model.dof_damping[dofs])
    out.upperDryFrictionLimit = np.array(model.dof_frictionloss[dofs])
    out.lowerDryFrictionLimit = -out.upperDryFrictionLimit
    return out


def _effort(model: mujoco.MjModel, joint: int) -> float:
    """The largest effort that the actuators of a joint can exert both ways [N m] or [N]; infinite where not bounded.

    The range of the joint itself, and the sum of those of its actuators: their force ranges, or the control ranges of
    plain motors. 0 where they push one way only.
    """
    limits = [model.jnt_actfrcrange[joint]] if model.jnt_actfrclimited[joint] else []
    on_joint = np.isin(model.actuator_trntype, JOINT_TRANSMISSIONS) & (model.actuator_trnid[:, 0] == joint)
    if on_joint.any():
        limits.append(
            np.sum([_actuator_range(model, actuator) for actuator in np.flatnonzero(on_joint).tolist()], axis=0)
        )
    return max(0.0, min((min(-float(low), float(high)) for low, high in limits), default=np.inf))


def _actuator_range(model: mujoco.MjModel, actuator: int) -> tuple[float, float]:
    """The least and the largest effort of an actuator on its joint; infinite where it is not bounded."""
    low, high = model.actuator_forcerange[actuator] if model.actuator_forcelimited[actuator] else (-np.inf, np.inf)
    dynamics = mujoco.mjtDyn(model.actuator_dyntype[actuator])
    within_control = (mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT)
    plain = (
        model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED
        and model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_NONE
        and dynamics in within_control  # whose state stays within the range of the control
    )
    if plain and model.actuator_ctrllimited[actuator]:
        driven = sorted(model.actuator_gainprm[actuator, 0] * model.actuator_ctrlrange[actuator])
        low, high = max(low, driven[0]), min(high, driven[1])
    gear = float(model.actuator_gear[actuator, 0])
    if gear == 0.0:
        return 0.0, 0.0
    ends = gear * low, gear * high
    return min(ends), max(ends)


def scalar_joint_motion(model: mujoco.MjModel, joint: int, position: float) -> pin.SE3:
    """Pose of a hinge's or slide's frame at a joint position, in its frame at MuJoCo's `ref`."""
    axis = np.array(model.jnt_axis[joint])
    travel = position - float(model.qpos0[model.jnt_qposadr[joint]])
    if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
        return pin.SE3(np.eye(3), travel * axis)
    return pin.SE3(pin.AngleAxis(travel, axis).toRotationMatrix(), np.zeros(3))


def pinocchio_joint(model: mujoco.MjModel, joint: int) -> tuple[pin.JointModel, pin.SE3]:
    """Pinocchio's joint, and for a hinge or slide the offset that makes its zero MuJoCo's."""
    axis = np.array(model.jnt_axis[joint])
    kind = model.jnt_type[joint]
    if kind == mujoco.mjtJoint.mjJNT_FREE:
        return pin.JointModelFreeFlyer(), pin.SE3.Identity()
    if kind == mujoco.mjtJoint.mjJNT_BALL:
        return pin.JointModelSpherical(), pin.SE3.Identity()
    if kind == mujoco.mjtJoint.mjJNT_HINGE:
        plain = pin.JointModelRZ() if np.array_equal(axis, (0.0, 0.0, 1.0)) else pin.JointModelRevoluteUnaligned(axis)
        return plain, scalar_joint_motion(model, joint, 0.0)
    return pin.JointModelPrismaticUnaligned(axis), scalar_joint_motion(model, joint, 0.0)


def body_joints(model: mujoco.MjModel, body: int) -> range:
    """Ids of the joints between a body and its parent."""
    first = int(model.body_jntadr[body])
    return range(first, first + int(model.body_jntnum[body]))


def placement(quat_wxyz: ArrayLike, position: ArrayLike) -> pin.SE3:
    """`pin.SE3` from MuJoCo's quaternion (w, x, y, z) and position [m]."""
    w, x, y, z = (float(c) for c in np.asarray(quat_wxyz))
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized(), np.array(position, dtype=np.float64))


def body_name(model: mujoco.MjModel, body: int) -> str:
    """Name of a body, or of the link that it is; unnamed ones get a name from their number."""
    name = str(model.body(body).name)
    return WORLD if name == WORLD_LINK else name or _free_name(model, f"body_{body}", BODY_NAME)


def joint_name(model: mujoco.MjModel, joint: int) -> str:
    """Name of a joint; unnamed ones get a name from their number."""
    return str(model.joint(joint).name) or _free_name(model, f"joint#{joint}", JOINT_NAME)


def geom_name(model: mujoco.MjModel, geom: int) -> str:
    """Name of a geom; unnamed ones get a name from their body and number."""
    return str(model.geom(geom).name) or f"{body_name(model, int(model.geom_bodyid[geom]))}#{geom}"


def site_name(model: mujoco.MjModel, site: int) -> str:
    """Name of a site, "" for none; one that is named like a body gets an ending, as frames have unique names."""
    name = str(model.site(site).name)
    if not name or mujoco.mj_name2id(model, BODY_NAME, name) < 0:
        return name
    return _free_name(model, f"{name}_site", BODY_NAME, SITE_NAME)


def _free_name(model: mujoco.MjModel, name: str, *kinds: mujoco.mjtObj) -> str:
    """A generated name that no element of the file has."""
    while any(mujoco.mj_name2id(model, kind, name) >= 0 for kind in kinds):
        name += "_"
    return name


def joint_ids(model: mujoco.MjModel, names: Iterable[str]) -> list[int]:
    """Ids of joints, by the names `joint_name` gives."""
    by_name = {joint_name(model, joint): joint for joint in range(model.njnt)}
    return [by_name[name] for name in names]


def reference_configuration(model: mujoco.MjModel, full: pin.Model) -> Array:
    """MuJoCo's reference position as a configuration of the model made by `to_pinocchio`."""
    q = pin.neutral(full)
    for body in range(1, model.nbody):
        for joint in body_joints(model, body):
            if model.jnt_type[joint] in SCALAR_JOINTS:
                index = full.joints[full.getJointId(joint_name(model, joint))].idx_q
                q[index] = model.qpos0[model.jnt_qposadr[joint]]
    return np.asarray(q)


def couplings(model: mujoco.MjModel) -> list[Coupling]:
    """The active equalities, each with the names of the joints that it couples; of a linear one, which joint leads."""
    found = []
    for equality in range(model.neq):
        if model.eq_active0[equality]:
            kind = mujoco.mjtEq(model.eq_type[equality]).name.removeprefix("mjEQ_").lower()
            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_EQUALITY, equality) or f"number {equality}"
            joints = frozenset(joint_name(model, joint) for joint in _joints(model, equality))
            found.append(Coupling(joints, f"{kind} equality {name!r}", *_linear(model, equality)))
    return found


def _linear(model: mujoco.MjModel, equality: int) -> tuple[str | None, float, float]:
    """Leader, multiplier and offset of two joints of which one is a linear function of the other; None for no leader.

    MuJoCo's second joint leads, or the first one where an actuator moves that and not the second.
    """
    if model.eq_type[equality] != mujoco.mjtEq.mjEQ_JOINT or model.eq_obj2id[equality] < 0:
        return None, 1.0, 0.0
    offset, slope, *curved = (float(each) for each in model.eq_data[equality, :5])
    if any(curved) or slope == 0.0:
        return None, 1.0, 0.0
    follower, leader = int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])
    offset += float(model.qpos0[model.jnt_qposadr[follower]] - slope * model.qpos0[model.jnt_qposadr[leader]])
    moved = actuated(model)
    if follower in moved and leader not in moved:
        leader, slope, offset = follower, 1.0 / slope, -offset / slope
    return joint_name(model, leader), slope, offset


def actuated(model: mujoco.MjModel) -> set[int]:
    """Ids of the joints that an actuator moves, by itself or through a tendon."""
    found = set[int]()
    for kind, target in zip(model.actuator_trntype.tolist(), model.actuator_trnid[:, 0].tolist(), strict=True):
        if kind in JOINT_TRANSMISSIONS:
            found.add(target)
        elif kind == mujoco.mjtTrn.mjTRN_TENDON:
            found |= _of_tendon(model, target)
    return found


def _joints(model: mujoco.MjModel, equality: int) -> set[int]:
    """Ids of the joints that an equality couples; none where something free follows."""
    kind = mujoco.mjtEq(model.eq_type[equality])
    ids = int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])
    if kind == mujoco.mjtEq.mjEQ_JOINT:
        return {joint for joint in ids if joint >= 0}
    if kind == mujoco.mjtEq.mjEQ_TENDON:
        return {joint for tendon in ids if tendon >= 0 for joint in _of_tendon(model, tendon)}
    if kind in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD):
        at_sites = model.eq_objtype[equality] == mujoco.mjtObj.mjOBJ_SITE
        bodies = [int(model.site_bodyid[index]) if at_sites else index for index in ids]
        between = _between(model, bodies)
        follows = any(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE for joint in between)  # a grasped object
        moved = any(model.body_mocapid[model.body_rootid[body]] >= 0 for body in bodies)  # a handle that pulls the arm
        return set() if follows or moved else between
    return set()


def _of_tendon(model: mujoco.MjModel, tendon: int) -> set[int]:
    """Joints that change a tendon's length."""
    first = int(model.tendon_adr[tendon])
    joints: set[int] = set()
    bodies: list[int] = []
    for wrap in range(first, first + int(model.tendon_num[tendon])):
        kind, index = mujoco.mjtWrap(model.wrap_type[wrap]), int(model.wrap_objid[wrap])
        if kind == mujoco.mjtWrap.mjWRAP_JOINT:
            joints.add(index)
        elif kind == mujoco.mjtWrap.mjWRAP_SITE:
            bodies.append(int(model.site_bodyid[index]))
        elif kind in (mujoco.mjtWrap.mjWRAP_SPHERE, mujoco.mjtWrap.mjWRAP_CYLINDER):
            bodies.append(int(model.geom_bodyid[index]))
    return joints | _between(model, bodies)


def _between(model: mujoco.MjModel, bodies: Iterable[int]) -> set[int]:
    """Joints that move some of the bodies and not all of them."""
    moved_by = [joints_above(model, body) for body in bodies]
    some: set[int] = set().union(*moved_by)
    return {joint for joint in some if not all(joint in joints for joints in moved_by)}


def joints_above(model: mujoco.MjModel, body: int) -> set[int]:
    """Joints that move a body."""
    joints: set[int] = set()
    while body > 0:
        joints.update(body_joints(model, body))
        body = int(model.body_parentid[body])
    return joints
