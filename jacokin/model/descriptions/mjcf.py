"""MJCF robots, exactly as MuJoCo sees them.

Pinocchio has an MJCF reader of its own; it loses includes, frames, sites of jointless bodies and base poses. So MuJoCo
compiles the file, and the Pinocchio model is built from the compiled model: both engines then share every number.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.model.descriptions.chain import Coupling, Description

WORLD = "world"
NUMERIC = frozenset((
    "pos", "quat", "euler", "axisangle", "xyaxes", "zaxis", "axis", "range", "ref", "springref", "mass", "qpos", "size",
    "fromto", "diaginertia", "fullinertia", "damping", "armature", "frictionloss", "stiffness", "margin", "friction",
    "actuatorfrcrange", "solref", "solimp", "gravity", "timestep", "rgba",
))  # fmt: skip
MUJOCO_ERRORS = (ValueError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError)  # of its compiler
COMPILED = (
    "body_pos",
    "body_quat",
    "jnt_pos",
    "jnt_axis",
    "jnt_range",
    "site_pos",
    "site_quat",
    "body_mass",
    "key_qpos",
    "qpos0",
)
UNIT = ("body_quat", "body_iquat", "site_quat", "jnt_axis")  # zeros in the compiled model where a norm overflowed
UNIT_TOLERANCE = 1e-6  # of a norm; MuJoCo normalises
SITE_SUFFIX = "_site"  # of a site that has the name of a body
SCALAR_JOINTS = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))  # ints: numpy does not equal enums


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
        ModelError: MuJoCo refuses the file (its message is passed on), or a number in it is not finite, or so large
            that MuJoCo cannot normalise it.
    """
    _refuse_nan(path)
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except MUJOCO_ERRORS as error:
        raise ModelError(f"{path}: MuJoCo cannot load this file: {error}") from error
    for name in COMPILED:
        if not np.isfinite(getattr(model, name)).all():
            raise ModelError(f"{path}: {name} of the compiled model is not finite")
    for name in UNIT:
        norms = np.linalg.norm(getattr(model, name), axis=1)
        if not (np.abs(norms - 1.0) <= UNIT_TOLERANCE).all():
            at = int(np.argmax(np.abs(norms - 1.0)))
            raise ModelError(f"{path}: {name}[{at}] of the compiled model has norm {norms[at]:.6g} instead of 1")
    return model


def _refuse_nan(path: Path) -> None:
    """Name a NaN before MuJoCo warns of it and goes on; what cannot be parsed is left for MuJoCo to name."""
    try:
        elements = ET.parse(path).getroot().iter()
    except (OSError, ET.ParseError):
        return
    for element in elements:
        for attribute in NUMERIC.intersection(element.keys()):
            if "nan" in element.attrib[attribute].lower().split():
                who = element.get("name", "without a name")
                raise ModelError(
                    f'{path}: <{element.tag}> {who}: {attribute}="{element.attrib[attribute]}" is not finite'
                )


def placement(quat_wxyz: ArrayLike, position: ArrayLike) -> pin.SE3:
    """`pin.SE3` from MuJoCo's quaternion (w, x, y, z) and position [m]."""
    w, x, y, z = (float(c) for c in np.asarray(quat_wxyz))
    quat = pin.Quaternion(w, x, y, z)
    quat.normalize()
    return pin.SE3(quat.toRotationMatrix(), np.array(position, dtype=np.float64))


def body_name(model: mujoco.MjModel, body: int) -> str:
    """Name of a body; unnamed ones get a name from their number."""
    return str(model.body(body).name) or _free_name(model, mujoco.mjtObj.mjOBJ_BODY, f"body_{body}")


def joint_name(model: mujoco.MjModel, joint: int) -> str:
    """Name of a joint; unnamed ones get a name from their number."""
    return str(model.joint(joint).name) or _free_name(model, mujoco.mjtObj.mjOBJ_JOINT, f"joint#{joint}")


def site_name(model: mujoco.MjModel, site: int) -> str:
    """Name of a site, "" for none; one that is named like a body gets an ending, as frames have unique names."""
    name = str(model.site(site).name)
    if not name or mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) < 0:
        return name
    name += SITE_SUFFIX
    while any(
        mujoco.mj_name2id(model, kind, name) >= 0 for kind in (mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_SITE)
    ):
        name += "_"
    return name


def _free_name(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str) -> str:
    """A generated name that no element of the file has."""
    while mujoco.mj_name2id(model, kind, name) >= 0:
        name += "_"
    return name


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


def _joint_limits(model: mujoco.MjModel, joint: int) -> tuple[float, float]:
    """Lower and upper limit, infinite where MuJoCo imposes none (a range alone does not)."""
    if not model.jnt_limited[joint]:
        return -np.inf, np.inf
    lower, upper = model.jnt_range[joint]
    return float(lower), float(upper)


def to_pinocchio(model: mujoco.MjModel, name: str) -> pin.Model:
    """The same tree in Pinocchio, its zero for ball and free joints at MuJoCo's reference pose.

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
            lower, upper = _joint_limits(model, joint)
            limited_force = bool(model.jnt_actfrclimited[joint])
            effort = float(np.abs(model.jnt_actfrcrange[joint]).min()) if limited_force else np.inf
            parent = out.addJoint(
                parent,
                plain,
                T_parent_body * pin.SE3(np.eye(3), anchor) * T_zero,
                joint_name(model, joint),
                *(
                    np.full(size, value)
                    for size, value in (
                        (plain.nv, effort),
                        (plain.nv, np.inf),
                        (plain.nq, lower),
                        (plain.nq, upper),
                    )
                ),
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


def reference_configuration(model: mujoco.MjModel, full: pin.Model) -> Array:
    """MuJoCo's reference position as a configuration of the model made by `to_pinocchio`."""
    q = pin.neutral(full)
    for body in range(1, model.nbody):
        for joint in body_joints(model, body):
            if model.jnt_type[joint] in SCALAR_JOINTS:
                index = full.joints[full.getJointId(joint_name(model, joint))].idx_q
                q[index] = model.qpos0[model.jnt_qposadr[joint]]
    return np.asarray(q)


def joint_addresses(model: mujoco.MjModel, names: tuple[str, ...]) -> list[int]:
    """Addresses in qpos of scalar joints, by the names `joint_name` gives."""
    by_name = {joint_name(model, joint): int(model.jnt_qposadr[joint]) for joint in range(model.njnt)}
    return [by_name[name] for name in names]


def dof_addresses(model: mujoco.MjModel, names: tuple[str, ...]) -> list[int]:
    """Addresses in qvel of scalar joints, by the names `joint_name` gives."""
    by_name = {joint_name(model, joint): int(model.jnt_dofadr[joint]) for joint in range(model.njnt)}
    return [by_name[name] for name in names]


# As ints: NumPy's comparisons do not take enums.
CONNECT, WELD, JOINT, TENDON = (
    int(kind)
    for kind in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtEq.mjEQ_TENDON)
)
SITE = int(mujoco.mjtObj.mjOBJ_SITE)
FREE = int(mujoco.mjtJoint.mjJNT_FREE)


def couplings(model: mujoco.MjModel) -> list[Coupling]:
    """The active equalities, each with the names of the joints that it couples."""
    found = []
    for equality in range(model.neq):
        if model.eq_active0[equality]:
            kind = mujoco.mjtEq(model.eq_type[equality]).name.removeprefix("mjEQ_").lower()
            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_EQUALITY, equality) or f"number {equality}"
            joints = frozenset(joint_name(model, joint) for joint in _joints(model, equality))
            found.append(Coupling(joints, f"{kind} equality {name!r}"))
    return found


def _joints(model: mujoco.MjModel, equality: int) -> set[int]:
    """Ids of the joints that an equality couples; none where something free follows."""
    kind, ids = int(model.eq_type[equality]), (int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality]))
    if kind == JOINT:
        return {joint for joint in ids if joint >= 0}
    if kind == TENDON:
        return {joint for tendon in ids if tendon >= 0 for joint in _of_tendon(model, tendon)}
    if kind in (CONNECT, WELD):
        at_sites = int(model.eq_objtype[equality]) == SITE
        bodies = [int(model.site_bodyid[index]) if at_sites else index for index in ids]
        between = _between(model, bodies)
        follows = any(model.jnt_type[joint] == FREE for joint in between)  # a grasped object
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
    moved_by = [_above(model, body) for body in bodies]
    some: set[int] = set().union(*moved_by)
    return {joint for joint in some if not all(joint in joints for joints in moved_by)}


def _above(model: mujoco.MjModel, body: int) -> set[int]:
    joints: set[int] = set()
    while body > 0:
        joints.update(body_joints(model, body))
        body = int(model.body_parentid[body])
    return joints
