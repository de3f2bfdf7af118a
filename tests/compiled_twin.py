"""An arm among the shapes of a scene as MuJoCo compiles them, and the pairs of shapes whose contact counts.

It is told what counts by rules written anew: the package finds contact on arrays of its own, without MuJoCo.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin import Robot
from jacokin.arrays import Array
from jacokin.kernels.contact.run import ContactInteger, ContactTask, make_contact_work, run_contact
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.library import Call
from jacokin.model import poses
from jacokin.model.contact_arrays import arm_arrays, joined, joints_about_z, shape_rows, world_arrays
from jacokin.model.descriptions import mjcf
from jacokin.model.descriptions.shapes import Shape
from jacokin.model.mujoco_twin import body_of_joint, compile_spec, shapes_of_twin, to_spec
from jacokin.model.obstacles import Surroundings
from jacokin.model.own_shapes import overlapping
from jacokin.model.surrounded import allowed_pairs


class ContactArrays(NamedTuple):
    """What the kernels need to know, and whose shapes they are."""

    geometry: Geometry
    numbers: NDArray[np.intp]
    """(n,) number of each of them among the shapes given: those of the arm group by group, then the obstacles."""


def contact_arrays(
    model: pin.Model, given: Sequence[Shape], pairs: Sequence[tuple[int, int]], obstacles: Sequence[int]
) -> ContactArrays:
    """The arrays for an arm and its obstacles.

    Args:
        model: the arm, a chain of joints.
        given: the shapes of the arm and the obstacles.
        pairs: numbers of the shapes of the arm that count as contact when they touch.
        obstacles: numbers of obstacles that count against every shape that moves.

    Raises:
        ShapeError: a shape of an unknown kind.
    """
    own = [number for number in range(len(given)) if number not in obstacles]
    place = {number: index for index, number in enumerate(own)}
    rows = shape_rows(model, [given[number] for number in own])
    links, own_pairs = [given[number].joint for number in own], [(place[a], place[b]) for a, b in pairs]
    arm = arm_arrays(joints_about_z(model), links, rows, own_pairs)
    world = world_arrays([given[number] for number in obstacles])
    numbers = np.append(np.array(own)[arm.numbers], obstacles).astype(np.intp)
    return ContactArrays(joined(arm, world), numbers)


class Twin(NamedTuple):
    """An arm among the shapes of a scene, in MuJoCo."""

    model: mujoco.MjModel
    pairs: list[tuple[int, int]]
    """Numbers of geoms whose contact counts, obstacles first."""


def compile_twin(robot: Robot, around: Surroundings) -> Twin:
    """The robot's twin with all shapes of a scene."""
    spec = to_spec(robot, geometry=True, finger_angle=around.finger_angle)
    arm = {geom.name: geom.parent.name for geom in spec.geoms}
    for obstacle in around.obstacles:
        obstacle.add_to(spec.worldbody)
    held = {}
    for each in around.attached:
        frame = robot.pin_model.frames[robot.frame_id(each.to)]
        held[each.name] = body_of_joint(frame.parentJoint)
        each.shape.add_to(spec.body(held[each.name]))
        geom = spec.geom(each.name)
        placed = frame.placement * mjcf.placement(geom.quat, geom.pos)
        geom.pos, geom.quat = placed.translation, poses.quaternion(placed.rotation)
    model = compile_spec(spec, robot)
    moving = [name for name, body in {**arm, **held}.items() if body != body_of_joint(0)]
    names = [(obstacle.name, other) for obstacle in around.obstacles for other in moving]
    names += [(other, name) for name, body in held.items() for other, carrier in arm.items() if carrier != body]
    own = zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)
    names += [(model.geom(a).name, model.geom(b).name) for a, b in own]
    left_out = allowed_pairs(robot, around, list(arm)) | overlapping(robot)
    pairs = [(model.geom(a).id, model.geom(b).id) for a, b in names if frozenset((a, b)) not in left_out]
    return Twin(model, pairs)


class TwinContact:
    """Contact by the package's kernels on shapes and poses that MuJoCo has compiled."""

    def __init__(self, robot: Robot, around: Surroundings) -> None:
        """Compile the twin; obstacles are told as such, and contact that does not count is left out afterwards."""
        twin = compile_twin(robot, around)
        self._shapes = shapes_of_twin(twin.model)
        standing = [twin.model.geom(name).id for name in around.obstacle_names]
        own = [(a, b) for a, b in twin.pairs if a not in standing and b not in standing]
        geometry, numbers = contact_arrays(robot.pin_model, self._shapes, own, standing)
        self._names = [self._shapes[number].name for number in numbers]
        self._counted = {frozenset((twin.model.geom(a).name, twin.model.geom(b).name)) for a, b in twin.pairs}
        self._call = Call(run_contact, make_contact_work(geometry, 1))
        self._call.work.integers[ContactInteger.TASK] = ContactTask.LIST_TOUCHING

    def touching(self, q: Array) -> set[frozenset[str]]:
        """Names of the pairs that touch at a configuration (dof,) [rad]."""
        self._call.work.q[:] = q
        found = self._call.work.hits.pairs[: self._call()].tolist()
        return {frozenset((self._names[a], self._names[b])) for a, b in found} & self._counted
