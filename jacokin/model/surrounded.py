"""`surround`: an arm among the shapes of a scene, as the kernels of contact take them.

An obstacle counts against every shape that moves, and so does what the arm holds; that counts against the shapes of
other links, too. The arm's own pairs are those of its description. Contact that the scene allows does not count.

The arm's own arrays are shared (`own_shapes`), unless it holds something or the scene allows contact. Those of the
obstacles depend on no robot, and are made once a scene (`WorldArrays`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError
from jacokin.kernels.contact.arm import FIRST_PAIR, HINGE, ArmShapes
from jacokin.kernels.contact.near_points import find_near_points, make_near_work
from jacokin.kernels.contact.run import ContactNumber
from jacokin.kernels.contact.shapes import CENTRE, LINK, RADIUS
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.library import Call
from jacokin.model import checks
from jacokin.model.contact_arrays import (
    NO_WORLD,
    ArmArrays,
    ShapeRow,
    WorldArrays,
    arm_arrays,
    joined,
    joints_about_z,
    shape_rows,
    world_arrays,
)
from jacokin.model.descriptions.shapes import KINDS, Shape
from jacokin.model.obstacles import (
    NOTHING_AROUND,
    Attached,
    Obstacle,
    RobotPart,
    Surroundings,
    checked_surroundings,
    shape_of,
)
from jacokin.model.own_shapes import NOTHING_KEPT, OwnShapes, kept_less, own_shapes
from jacokin.model.point_cloud import PointCloud, checked_points
from jacokin.model.robot import Robot, SceneLike


class Surrounded(NamedTuple):
    """The shapes of an arm and those of a scene."""

    geometry: Geometry
    """What the kernels take: shapes of the arm group by group, then the obstacles that count against all of it."""
    names: tuple[str, ...]
    """Their names."""
    ranks: NDArray[np.int64]
    """(arm,) in what order the shapes of the arm are named: that of the joints, then of the description; -1 first for
    an obstacle among them."""
    kinds: NDArray[np.int64]
    """(n,) number of the kind of each shape, simple ones first."""
    alone: int
    """How many of them, the first ones, are obstacles that do not count against every shape that moves."""
    arm_shapes: int
    """How many are kept with the arm: those obstacles, and its own shapes with what it holds."""
    moving: int
    """How many of those are moved by a joint."""
    met_partly: int
    """How many meetings of the arm's groups, the first ones, are with those obstacles."""
    pairs: int
    """How many pairs of shapes count."""
    levers: Array
    """(dof,) how far a point of the arm can be from the axis of each joint, at most [m]; 1 where a joint slides."""


def surround(robot: Robot, around: Surroundings, world: WorldArrays | None = None) -> Surrounded:
    """The shapes of an arm and of a scene, and the pairs of them whose contact counts.

    Args:
        robot: the arm.
        around: the scene.
        world: `make_world` of its obstacles, where it is known.

    Raises:
        InvalidInputError: a shape of the scene has the name of a shape of the arm, one is attached to what does not
            move, or no finger can take the angle.
        UnknownNameError: a shape is attached to, or contact is allowed with, a name that is not there.
        ShapeError: the description's shapes cannot be loaded.
    """
    own, names = own_shapes(robot, around.finger_angle), around.names
    if not own.taken.isdisjoint(names):
        name = next(name for name in names if name in own.taken)
        raise InvalidInputError(f"the name {name!r} is used by a shape of the arm; names must differ")
    if around.attached or around.allow:
        return _surround_some(robot, own, around)
    alone = robot.once(_alone, around.finger_angle)
    return _with_world(alone, own.arrays, names, make_world(around.obstacles) if world is None else world)


def _alone(robot: Robot, finger_angle: float | None) -> Surrounded:
    """A robot with nothing around it."""
    own = own_shapes(robot, finger_angle)
    return among_nothing(own.shapes, own.arrays, len(own.pairs))


def with_clearance(robot: Robot, around: Surroundings, found: Surrounded, clearance: float) -> Surrounded:
    """What surrounds an arm, where pairs of its own shapes that hardly ever have a clearance [m] keep less of it.

    See `kept_less`; pairs that keep nothing are left out.
    """
    if found.geometry.arm is robot.once(_alone, around.finger_angle).geometry.arm:  # shared by scenes
        arm = robot.once(_alone_keeping_less, around.finger_angle, clearance)
    else:
        arm = _keeping_less(robot, found, around.finger_angle, clearance)
    left_out = len(found.geometry.arm.pairs) - len(arm.pairs)
    return found._replace(geometry=found.geometry._replace(arm=arm), pairs=found.pairs - left_out)


def _alone_keeping_less(robot: Robot, finger_angle: float | None, clearance: float) -> ArmShapes:
    """The arm that holds nothing, for `with_clearance`."""
    return _keeping_less(robot, robot.once(_alone, finger_angle), finger_angle, clearance)


def _keeping_less(robot: Robot, found: Surrounded, finger_angle: float | None, clearance: float) -> ArmShapes:
    """The arm among what surrounds it, some of whose pairs keep less than a clearance [m]."""
    arm, count, kept_of = found.geometry.arm, len(found.names), kept_less(robot, finger_angle, clearance)
    if not kept_of:
        return arm
    number = {name: index for index, name in enumerate(found.names)}
    less, counts = arm.less.copy(), np.ones(len(arm.pairs), dtype=np.bool_)
    rows = {code: row for row, code in enumerate((arm.pairs[:, 0] * count + arm.pairs[:, 1]).tolist())}
    for names, kept in kept_of.items():
        a, b = (number[name] for name in names)
        row = rows.get(a * count + b, rows.get(b * count + a))
        if row is not None:  # else it is allowed to touch, or the pairs are those of the arm and another robot
            less[row], counts[row] = clearance - kept, kept > NOTHING_KEPT
    meetings = arm.meetings.copy()
    meetings[:, FIRST_PAIR:] = np.append(0, np.cumsum(counts))[meetings[:, FIRST_PAIR:]]
    return arm._replace(meetings=meetings, pairs=arm.pairs[counts], less=less[counts])


def make_world(obstacles: Sequence[Obstacle]) -> WorldArrays:
    """The arrays of obstacles, for whatever arm is among them.

    Raises:
        ShapeError: MuJoCo cannot compile a shape that is none of ours.
    """
    return world_arrays([shape_of(obstacle) for obstacle in obstacles])


def _surround_some(robot: Robot, own: OwnShapes, around: Surroundings) -> Surrounded:
    """An arm that holds something, or may touch something; errors as of `surround`."""
    model = robot.pin_model
    both = carried_shapes(robot, around)
    order = sorted(range(len(both)), key=lambda index: both[index][0].joint)
    shapes, rows = [both[index][0] for index in order], [both[index][1] for index in order]
    number = {index: place for place, index in enumerate(order)}
    allowed = allowed_pairs(robot, around, own.names)
    counting = [*own.pairs, *_pairs_of_held(own.shapes, [shape for shape, _ in both])]
    pairs = [(number[a], number[b]) for a, b in counting if _named_pair(both[a][0], both[b][0]) not in allowed]
    moving = [place for place, shape in enumerate(shapes) if shape.joint > 0]
    count, named = len(shapes), frozenset[str]().union(*allowed)
    standing, partly = list[Obstacle](), list[tuple[int, int]]()
    for obstacle in around.obstacles:
        counted = moving
        if obstacle.name in named:
            counted = [other for other in moving if _named_pair(obstacle, shapes[other]) not in allowed]
        if len(counted) == len(moving):
            standing.append(obstacle)
        else:
            partly += [(len(shapes), other) for other in counted]
            shapes.append(shape_of(obstacle))
    rows += shape_rows(model, shapes[count:])
    links, alone = [shape.joint for shape in shapes], range(count, len(shapes))
    arrays = arm_arrays(joints_about_z(model), links, rows, [*partly, *pairs], alone)
    some = among_nothing(shapes, arrays, len(partly) + len(pairs))
    return _with_world(some, arrays, [obstacle.name for obstacle in standing], make_world(standing))


def _pairs_of_held(own: Sequence[Shape], both: Sequence[Shape]) -> list[tuple[int, int]]:
    """Pairs of a shape of the arm and one that it holds, whose numbers come after, on different links."""
    held = range(len(own), len(both))
    return [(other, index) for index in held for other in range(len(own)) if own[other].joint != both[index].joint]


def _named_pair(one: Shape | Obstacle, other: Shape | Obstacle) -> frozenset[str]:
    """The names of two shapes, in no order."""
    return frozenset((one.name, other.name))


def among_nothing(shapes: Sequence[Shape], arrays: ArmArrays, pairs: int) -> Surrounded:
    """An arm with so many pairs of its own, and no obstacles that count against all shapes that move."""
    given = [shapes[number] for number in arrays.numbers]
    ranks = arrays.numbers.astype(np.int64)
    ranks[: arrays.alone] = -1
    return Surrounded(
        geometry=joined(arrays, NO_WORLD),
        names=tuple(shape.name for shape in given),
        ranks=ranks,
        kinds=np.array([KINDS.index(shape.kind) for shape in given], dtype=np.int64),
        alone=arrays.alone,
        arm_shapes=len(given),
        moving=sum(shape.joint > 0 for shape in given),
        met_partly=arrays.met_partly,
        pairs=pairs,
        levers=_levers(arrays),
    )


def _levers(arrays: ArmArrays) -> Array:
    """How far a point of an arm can be from the axis of each joint (dof,), at most [m]; 1 where a joint slides."""
    shapes, arm = arrays.shapes, arrays.arm
    links, spheres = shapes.integers[arrays.alone :, LINK], shapes.numbers[arrays.alone :, CENTRE : RADIUS + 1]
    reach = np.linalg.norm(spheres[:, :3], axis=1) + spheres[:, 3]
    along = np.append(0.0, np.cumsum(np.linalg.norm(arm.placements[:, :, 3], axis=1)))
    found = np.ones(len(arm.joint_kinds))
    for joint in np.flatnonzero(arm.joint_kinds == HINGE).tolist():
        far = (along[links] - along[joint + 1] + reach)[links > joint]
        found[joint] = far.max(initial=0.0)
    return checks.sealed(found)


def _with_world(arm: Surrounded, arrays: ArmArrays, names: Sequence[str], world: WorldArrays) -> Surrounded:
    """An arm, with obstacles that count against all shapes that move."""
    return arm._replace(
        geometry=joined(arrays, world),
        names=(*arm.names, *names),
        kinds=np.concatenate([arm.kinds, world.kinds]),
        pairs=arm.pairs + arm.moving * len(names),
    )


def allowed_pairs(robot: Robot, around: Surroundings, arm: Sequence[str]) -> set[frozenset[str]]:
    """Pairs of shapes whose contact the scene allows.

    Raises:
        UnknownNameError: no shape, link or obstacle has a name.
        InvalidInputError: both a link and an obstacle have it.
    """
    if not around.allow:
        return set()
    from jacokin.model.mujoco_twin import shapes_of_links

    links = {name: shapes & set(arm) for name, shapes in shapes_of_links(robot).items()}
    each = {name: frozenset((name,)) for name in (*arm, *around.names)}
    robots = {part.robot.name: part.robot for part in around.obstacles if isinstance(part, RobotPart)}
    others = {name: frozenset(part.name for part in other.parts) for name, other in robots.items()}
    held = {name: shapes for name, shapes in links.items() if shapes}
    groups = {"robot": frozenset(arm), **held, **each, **others}
    both = {"robot", *held} & {*around.names, *robots}
    found = set[frozenset[str]]()
    for pair in around.allow:
        for name in pair:
            if name in both:
                what = "all of the arm" if name == "robot" else "a link of the arm"
                raise InvalidInputError(f"allow: {name!r} is {what} and an obstacle; give the obstacle another name")
        first, second = (groups[checks.choice("shape or link", name, groups)] for name in pair)
        found |= {frozenset((a, b)) for a in first for b in second if a != b}
    return found


def carried_shapes(robot: Robot, around: Surroundings) -> list[tuple[Shape, ShapeRow]]:
    """The shapes of an arm, and then those that it holds; errors as of `surround`."""
    own = own_shapes(robot, around.finger_angle)
    held = [_held_shape(robot, each) for each in around.attached]
    rows = shape_rows(robot.pin_model, held)
    return [*zip(own.shapes, own.rows, strict=True), *zip(held, rows, strict=True)]


def _held_shape(robot: Robot, attached: Attached) -> Shape:
    """A shape that a link carries, in the frame of the joint that moves that link."""
    frame = robot.pin_model.frames[robot.frame_id(attached.to)]
    if frame.parentJoint == 0:
        raise InvalidInputError(
            f"{attached.to!r} is moved by no joint of {robot.name}: leave {attached.name!r} an obstacle"
        )
    shape = shape_of(attached.shape)
    return shape._replace(joint=int(frame.parentJoint), placement=frame.placement * shape.placement)


def without_own_points(robot: Robot, q: ArrayLike, points: ArrayLike, margin: float, scene: SceneLike | None) -> Array:
    """The points that are farther from the arm than a margin; arguments and errors as of `Robot.without_own_points`."""
    q = robot.configuration(q)
    rows = np.ascontiguousarray(checked_points("points", points))
    margin = checks.non_negative("margin", margin, "m")
    around = NOTHING_AROUND if scene is None else checked_surroundings("scene", scene)
    measured_to = PointCloud("a point", np.zeros((1, 3)), 0.0)
    found = surround(robot, around._replace(obstacles=(measured_to,), allow=()))
    if found.arm_shapes == 0:
        raise ModelError(
            f"{robot.name}: the description has no collision shapes, so no point can be told to be its own"
        )
    call = Call(find_near_points, make_near_work(found.geometry, rows))
    call.work.contact.q[:] = q
    call.work.contact.numbers[ContactNumber.MARGIN_KEPT] = margin
    call()
    return np.asarray(rows[call.work.near == 0])
