"""The same arm in MuJoCo: what mink solves on, and what checks contact.

`to_mujoco` builds a model with the joints of a `Robot` and nothing else that moves, from the robot's own Pinocchio
numbers, so a URDF and an MJCF end in the same place. It is a kinematic twin: masses are placeholders.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.errors import ModelError
from jacokin.model import bundled, mjcf, poses
from jacokin.model.robot import Robot

UNLIMITED = 1e6  # [rad] stands for an open side
LOCKED_ROOM = 1e-9  # [rad] on both sides of a joint with equal limits

BASE_BODY = "jacokin_base"
GEOM_OF_MESH = mujoco.mjtGeom.mjGEOM_MESH


def to_mujoco(robot: Robot, *, geometry: bool = False) -> mujoco.MjModel:
    """Compile the kinematic twin of a robot.

    Args:
        robot: the arm.
        geometry: True to carry the collision shapes of the description, fingers locked at `robot.finger_angle`.

    Returns:
        A model with nq == nv == robot.dof, joints in the robot's order and named as there, one body a link, and a
        site for every name in `robot.frames`. The world of the model is the robot's base.

    Raises:
        ModelError: `geometry` and the description's shapes cannot be loaded by MuJoCo.
    """
    return to_spec(robot, geometry=geometry).compile()


def to_spec(robot: Robot, *, geometry: bool = False) -> mujoco.MjSpec:
    """As `to_mujoco`, before compiling: scene geometry can still be added."""
    model = robot.pin_model
    spec = mujoco.MjSpec()
    spec.modelname = robot.name
    spec.compiler.degree = False
    spec.compiler.autolimits = False
    carriers = [spec.worldbody.add_body(name=BASE_BODY)]
    for index in range(1, model.njoints):
        placement = model.jointPlacements[index]
        body = carriers[model.parents[index]].add_body(
            name=body_of_joint(robot, index),
            pos=placement.translation,
            quat=poses.quat_wxyz(placement.rotation),
        )
        # Kinematics needs no mass; MuJoCo refuses moving bodies without one.
        body.mass, body.inertia, body.explicitinertial = 1.0, np.ones(3), True
        _add_joint(body, robot, index)
        carriers.append(body)
    for name in robot.frames:
        frame = model.frames[robot.frame_id(name)]
        carriers[frame.parentJoint].add_site(
            name=name, pos=frame.placement.translation, quat=poses.quat_wxyz(frame.placement.rotation)
        )
    if geometry:
        _add_geometry(spec, carriers, robot)
    return spec


def body_of_joint(robot: Robot, joint: int) -> str:
    """Name of the twin's body that Pinocchio's joint (by number, 0 for the base) moves."""
    return f"jacokin_{robot.joint_names[joint - 1]}" if joint else BASE_BODY


def _add_joint(body: mujoco.MjsBody, robot: Robot, index: int) -> None:
    """The joint that moves a body, about (or along) the axis Pinocchio has."""
    joint = robot.pin_model.joints[index]
    data = joint.createData()
    joint.calc(data, np.zeros(joint.nq))
    subspace = np.asarray(data.S).ravel()
    hinge = bool(subspace[3:].any())
    limited = bool(np.isfinite(robot.lower[index - 1]) or np.isfinite(robot.upper[index - 1]))
    # MuJoCo wants a finite range; one side may be open.
    low, high = np.clip((robot.lower[index - 1], robot.upper[index - 1]), -UNLIMITED, UNLIMITED)
    if not low < high:  # a locked joint: MuJoCo wants some room, answers are clamped to the robot's own limits
        low, high = low - LOCKED_ROOM, high + LOCKED_ROOM
    body.add_joint(
        name=robot.joint_names[index - 1],
        type=mujoco.mjtJoint.mjJNT_HINGE if hinge else mujoco.mjtJoint.mjJNT_SLIDE,
        axis=subspace[3:] if hinge else subspace[:3],
        limited=mujoco.mjtLimited.mjLIMITED_TRUE if limited else mujoco.mjtLimited.mjLIMITED_FALSE,
        range=(low, high) if limited else (0.0, 0.0),
    )


def source_model(robot: Robot) -> mujoco.MjModel:
    """MuJoCo's own compilation of the robot's description, everything movable still movable.

    A bundled robot's MJCF, a user's MJCF, or a user's URDF read by MuJoCo with all its links kept.

    Raises:
        ModelError: MuJoCo cannot load the file.
    """
    source = robot.source
    if source.bundled is not None:
        return mjcf.compile_mjcf(bundled.urdf_folder() / f"{source.bundled}.xml")
    if source.kind == "mjcf":
        return mjcf.compile_mjcf(source.path)
    return _compile_urdf(source.path)


def _compile_urdf(path: Path) -> mujoco.MjModel:
    """A URDF in MuJoCo with all its links; masses as in the file unless MuJoCo refuses moving links without mass."""
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.compiler.fusestatic = False
        spec.compiler.discardvisual = False
        try:
            return spec.compile()
        except ValueError:
            spec.compiler.balanceinertia = True
            spec.compiler.boundmass, spec.compiler.boundinertia = 1e-9, 1e-15
            return spec.compile()
    except (ValueError, RuntimeError) as error:
        raise ModelError(f"{path}: MuJoCo cannot load the shapes of this URDF: {error}") from error


def _add_geometry(spec: mujoco.MjSpec, carriers: list[mujoco.MjsBody], robot: Robot) -> None:
    """Copy the colliding shapes of the arm, and MuJoCo's own choice of which pairs may touch."""
    source = source_model(robot)
    model = robot.pin_model
    names = set(robot.frames)
    placed: dict[int, str] = {}  # geom of the source -> its name here
    for geom in range(source.ngeom):
        body = int(source.geom_bodyid[geom])
        link = mjcf.body_name(source, body)
        if link not in names or body == 0 or not (source.geom_contype[geom] or source.geom_conaffinity[geom]):
            continue
        frame = model.frames[robot.frame_id(link)]
        T_carrier_geom = frame.placement * mjcf.placement(source.geom_quat[geom], source.geom_pos[geom])
        placed[geom] = _add_geom(spec, carriers[frame.parentJoint], source, geom, T_carrier_geom)
    for first, second in _pairs(source, sorted(placed), robot):
        spec.add_pair(name=f"{placed[first]}~{placed[second]}", geomname1=placed[first], geomname2=placed[second])


def _add_geom(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, source: mujoco.MjModel, geom: int, T_body_geom: pin.SE3
) -> str:
    """One shape; meshes are copied as vertices, and collide as their convex hull, as in MuJoCo."""
    name = str(source.geom(geom).name) or f"{mjcf.body_name(source, int(source.geom_bodyid[geom]))}#{geom}"
    kind = mujoco.mjtGeom(source.geom_type[geom])
    shape: dict[str, object] = {"size": source.geom_size[geom]}
    if kind == GEOM_OF_MESH:
        shape = {"meshname": name}
        spec.add_mesh(name=name, uservert=_mesh_vertices(source, int(source.geom_dataid[geom])).ravel())
    added = body.add_geom(
        name=name,
        type=kind,
        pos=T_body_geom.translation,
        quat=poses.quat_wxyz(T_body_geom.rotation),
        contype=0,
        conaffinity=0,
        rgba=source.geom_rgba[geom] if source.geom_matid[geom] < 0 else source.mat_rgba[source.geom_matid[geom]],
        **shape,
    )
    added.mass = 0.0
    return name


def _mesh_vertices(source: mujoco.MjModel, mesh: int) -> NDArray[np.float64]:
    first = int(source.mesh_vertadr[mesh])
    return np.array(source.mesh_vert[first : first + int(source.mesh_vertnum[mesh])], dtype=np.float64)


def _pairs(source: mujoco.MjModel, geoms: list[int], robot: Robot) -> list[tuple[int, int]]:
    """Pairs of shapes MuJoCo would test: masks agree, not parent and child, not excluded, and able to move apart."""
    carrier = {
        geom: robot.pin_model.frames[robot.frame_id(mjcf.body_name(source, int(source.geom_bodyid[geom])))].parentJoint
        for geom in geoms
    }
    # MuJoCo's signature of an excluded pair: lower body id in the high half.
    excluded = {int(signature) for signature in source.exclude_signature}
    pairs = []
    for position, first in enumerate(geoms):
        for second in geoms[position + 1 :]:
            if carrier[first] == carrier[second]:
                continue
            body_a, body_b = int(source.geom_bodyid[first]), int(source.geom_bodyid[second])
            if (min(body_a, body_b) << 16) + max(body_a, body_b) in excluded:
                continue
            masks = (source.geom_contype[first] & source.geom_conaffinity[second]) | (
                source.geom_contype[second] & source.geom_conaffinity[first]
            )
            if masks and not _parent_and_child(source, body_a, body_b):
                pairs.append((first, second))
    return pairs


def _parent_and_child(source: mujoco.MjModel, body_a: int, body_b: int) -> bool:
    """Whether a joint joins the two; bodies welded together count as one.

    MuJoCo tests such a pair when one side is welded to the world. A base that overlaps its first link is no
    self-contact, so here it never counts.
    """
    weld_a, weld_b = int(source.body_weldid[body_a]), int(source.body_weldid[body_b])
    parent_a = int(source.body_weldid[source.body_parentid[weld_a]])
    parent_b = int(source.body_weldid[source.body_parentid[weld_b]])
    return weld_a == parent_b or weld_b == parent_a
