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
# As ints: NumPy's comparisons do not take enums.
CONNECT, WELD, JOINT, TENDON = (
    int(kind)
    for kind in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtEq.mjEQ_TENDON)
)
SCALAR_JOINTS = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
SITE = int(mujoco.mjtObj.mjOBJ_SITE)
FREE = int(mujoco.mjtJoint.mjJNT_FREE)
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
    """Refuse NaN, of which MuJoCo would only warn. Files that cannot be parsed are left to MuJoCo, which says why."""
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
            # A range alone is no limit to MuJoCo.
            lower, upper = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.inf, np.inf)
            effort = np.abs(model.jnt_actfrcrange[joint]).min() if model.jnt_actfrclimited[joint] else np.inf
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
    quat = pin.Quaternion(w, x, y, z)
    quat.normalize()
    return pin.SE3(quat.toRotationMatrix(), np.array(position, dtype=np.float64))


def body_name(model: mujoco.MjModel, body: int) -> str:
    """Name of a body; unnamed ones get a name from their number."""
    return str(model.body(body).name) or _free_name(model, f"body_{body}", BODY_NAME)


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
    return _free_name(model, name + SITE_SUFFIX, BODY_NAME, SITE_NAME)


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
