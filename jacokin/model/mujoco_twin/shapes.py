"""Collision shapes of a description, copied to the arm's twin in MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import poses
from jacokin.model.descriptions import mjcf
from jacokin.model.mujoco_twin import source as sources
from jacokin.model.robot import Robot

GEOM_OF_MESH = mujoco.mjtGeom.mjGEOM_MESH


def add_shapes(
    spec: mujoco.MjSpec, carriers: list[mujoco.MjsBody], robot: Robot, finger_angle: float | None = None
) -> None:
    """Copy the colliding shapes of the arm, and MuJoCo's own choice of which pairs may touch.

    Args:
        spec: the twin.
        carriers: its bodies, by number of Pinocchio's joint that moves them.
        robot: the arm.
        finger_angle: angle of the joints off the arm [rad]; None for the one the robot was loaded with.

    Raises:
        InvalidInputError: a finger angle that no joint off the arm can take.
        ModelError: a mesh is not found, or MuJoCo cannot load the shapes.
    """
    source = sources.with_shapes(robot)
    model = robot.pin_model
    fingers = None if finger_angle is None else _Fingers(source, robot, finger_angle)
    names = set(robot.frames)
    placed: dict[int, str] = {}  # geom of the source -> its name here
    for geom in range(source.ngeom):
        body = int(source.geom_bodyid[geom])
        link = mjcf.body_name(source, body)
        if link not in names or body == 0 or not (source.geom_contype[geom] or source.geom_conaffinity[geom]):
            continue
        frame = model.frames[robot.frame_id(link)]
        T_carrier_link = frame.placement if fingers is None else fingers.placement(body, frame.parentJoint)
        T_carrier_geom = T_carrier_link * mjcf.placement(source.geom_quat[geom], source.geom_pos[geom])
        placed[geom] = _add_geom(spec, carriers[frame.parentJoint], source, geom, T_carrier_geom)
    for first, second in _pairs(source, sorted(placed), robot):
        spec.add_pair(name=f"{placed[first]}~{placed[second]}", geomname1=placed[first], geomname2=placed[second])


class _Fingers:
    """Where the links of a description are when the joints off the arm stand at another angle."""

    def __init__(self, source: mujoco.MjModel, robot: Robot, angle: float) -> None:
        """Put every joint off the arm at the angle [rad], clipped into its limits."""
        self._source, self._robot = source, robot
        self._data = mujoco.MjData(source)
        arm, allowed = set(robot.joint_names), list[tuple[float, float]]()
        for joint in range(source.njnt):
            if mjcf.joint_name(source, joint) in arm or source.jnt_type[joint] not in mjcf.SCALAR_JOINTS:
                continue
            low, high = source.jnt_range[joint].tolist() if source.jnt_limited[joint] else (-np.inf, np.inf)
            self._data.qpos[source.jnt_qposadr[joint]] = np.clip(angle, low, high)
            allowed.append((low, high))
        if not any(low <= angle <= high for low, high in allowed):
            reason = f"the fingers move from {allowed[0][0]} to {allowed[0][1]} rad" if allowed else "it has no fingers"
            raise InvalidInputError(f"finger_angle = {angle} rad: {reason}")
        mujoco.mj_kinematics(source, self._data)

    def placement(self, body: int, carrier: int) -> pin.SE3:
        """Placement of a link on the link that Pinocchio's joint (by number, 0 for the base) moves."""
        robot, source = self._robot, self._source
        if carrier == 0:
            return robot.pin_model.frames[robot.frame_id(mjcf.body_name(source, body))].placement
        joints = [mjcf.joint_name(source, joint) for joint in range(source.njnt)]
        moved = int(source.jnt_bodyid[joints.index(robot.joint_names[carrier - 1])])
        T_carrier_moved = robot.pin_model.frames[robot.frame_id(mjcf.body_name(source, moved))].placement
        return T_carrier_moved * self._world(moved).inverse() * self._world(body)

    def _world(self, body: int) -> pin.SE3:
        return mjcf.placement(self._data.xquat[body], self._data.xpos[body])


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
        quat=poses.quaternion(T_body_geom.rotation),
        contype=0,
        conaffinity=0,
        rgba=source.geom_rgba[geom] if source.geom_matid[geom] < 0 else source.mat_rgba[source.geom_matid[geom]],
        **shape,
    )
    added.mass = 0.0
    return name


def _mesh_vertices(source: mujoco.MjModel, mesh: int) -> Array:
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
