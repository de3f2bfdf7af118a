"""Equality constraints of an MJCF that tie joints to each other or to the world."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco

from jacokin.model.descriptions import mjcf
from jacokin.model.descriptions.whole import Coupling

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
            joints = frozenset(mjcf.joint_name(model, joint) for joint in _joints(model, equality))
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
        joints.update(mjcf.body_joints(model, body))
        body = int(model.body_parentid[body])
    return joints
