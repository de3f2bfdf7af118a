"""What the arm looks like: one mesh for each of its moving parts, from the collision shapes of the description."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.viewer.drawing.meshes import Mesh, box, cylinder, merged, of_geom, placed, sphere

if TYPE_CHECKING:
    from jacokin.model.robot import Robot
    from jacokin.model.scenes.scene import Scene

PLATE = (1.0, 1.0, 0.002)  # [m] half edges of what is drawn of a floor
BONE_RADIUS = 0.02  # [m] of the sticks that stand for an arm without shapes


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """What one joint moves, in Pinocchio's frame of that joint; the base is part 0."""

    name: str
    """Of the joint; "base" for the base."""
    mesh: Mesh | None
    """None where there is nothing to draw."""
    shapes: dict[str, Mesh] = field(default_factory=dict)
    """The collision shapes by name, which are merged in the mesh of an arm that is drawn by them."""


def parts_of(robot: Robot) -> tuple[tuple[Part, ...], str]:
    """The base and the part each joint moves, base to tip; and why it is sticks from joint to joint, or ""."""
    from jacokin.model.mujoco_twin.export import to_mujoco

    try:
        model = to_mujoco(robot, geometry=True)
    except ModelError as error:
        return _sticks(robot), str(error)
    first = model.body(1).id  # bodies are the world, the base, and one for each joint, in the order of the joints
    parts = []
    for index, name in enumerate(("base", *robot.joint_names)):
        geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] == first + index]
        found = {str(model.geom(geom).name): mesh for geom in geoms if (mesh := of_geom(model, geom)) is not None}
        parts.append(Part(name, merged(list(found.values())), found))
    if any(part.mesh for part in parts):
        return tuple(parts), ""
    return _sticks(robot), "the description has no collision shapes"


def of_obstacles(scene: Scene) -> dict[str, Mesh]:
    """The shapes of a scene by name, in the base frame; a floor as a thin plate."""
    import mujoco

    spec = mujoco.MjSpec()
    for obstacle in scene:
        obstacle.add_to(spec.worldbody)
    model = spec.compile()
    meshes = {}
    for geom in range(model.ngeom):
        mesh = of_geom(model, geom)
        if mesh is None:
            z = float(model.geom_pos[geom][2])
            mesh = placed(box(np.array(PLATE)), np.eye(3), np.array([0.0, 0.0, z - PLATE[2]]))
        meshes[str(model.geom(geom).name)] = mesh
    return meshes


def _sticks(robot: Robot) -> tuple[Part, ...]:
    """A ball at each joint and a stick from there to the next joint, or to the default frame."""
    model = robot.pin_model
    ends: list[Array] = [np.array(model.jointPlacements[joint].translation) for joint in range(1, model.njoints)]
    ends.append(np.array(model.frames[robot.frame_id()].placement.translation))
    parts = []
    for name, end in zip(("base", *robot.joint_names), ends, strict=True):
        meshes = [sphere(1.5 * BONE_RADIUS)]
        length = float(np.linalg.norm(end))
        if length > 1e-6:  # [m] below that there is nothing to see
            meshes.append(placed(cylinder(BONE_RADIUS, 0.5 * length), _rotation_to(end / length), 0.5 * end))
        parts.append(Part(name, merged(meshes)))
    return tuple(parts)


def _rotation_to(direction: Array) -> Array:
    """A rotation (3, 3) that takes z to a unit vector (3,)."""
    helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
    x = np.cross(helper, direction)
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(direction, x), direction))
