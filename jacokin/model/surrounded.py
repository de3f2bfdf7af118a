"""`surround`: the shapes of an arm among those of a scene, and the pairs of shapes whose contact counts.

An obstacle counts against every shape that moves, and so does what the arm holds; that counts against the shapes of
other links, too. The arm's own pairs are those of its description. Contact that the scene allows does not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from jacokin.errors import InvalidInputError
from jacokin.model import checks, poses
from jacokin.model.descriptions.shapes import Shape, read_bundled
from jacokin.model.obstacles import NOTHING_AROUND, Attached, Surroundings, add_to_spec
from jacokin.model.robot import Robot

if TYPE_CHECKING:
    import mujoco

ROBOT = "robot"  # stands for all shapes of the arm where contact is allowed


class Surrounded(NamedTuple):
    """The shapes of an arm and those of a scene, in one list; pairs of shapes by number."""

    shapes: list[Shape]
    own: list[tuple[int, int]]
    """Pairs of shapes of the arm, and of what it holds."""
    partly: list[tuple[int, int]]
    """Pairs of an obstacle, which comes first, and a shape that moves, where not all contact with it counts."""
    standing: list[int]
    """The other obstacles, which count against every shape that moves."""

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """All pairs whose contact counts, those with obstacles first."""
        moving = [number for number, shape in enumerate(self.shapes) if shape.joint > 0]
        return [(a, b) for a in sorted(self.standing) for b in moving] + self.partly + self.own


def surround(robot: Robot, around: Surroundings) -> Surrounded:
    """The shapes of an arm and of a scene, and the pairs of them whose contact counts.

    Those of a bundled robot that stands alone are read without MuJoCo, which takes long to load.

    Raises:
        InvalidInputError: a shape of the scene has the name of a shape of the arm, one is attached to what does not
            move, or no finger can take the angle.
        UnknownNameError: a shape is attached to, or contact is allowed with, a name that is not there.
        ShapeError: the description's shapes cannot be loaded.
    """
    if around == NOTHING_AROUND and robot.source.bundled is not None:
        links = {name: robot.frame_id(name) for name in robot.frames}
        shapes, pairs = read_bundled(robot.source.bundled, robot.pin_model, links)
        return Surrounded(shapes, pairs, [], [])
    from jacokin.model.mujoco_twin import body_of_joint, shapes_of_twin

    model, arm, held = compile_twin(robot, around)
    shapes = shapes_of_twin(model)
    number = {shape.name: index for index, shape in enumerate(shapes)}
    allowed = allowed_pairs(robot, around, list(arm))
    own = list(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True))
    own += [
        (number[other], number[name])
        for name, carrier in held.items()
        for other, body in arm.items()
        if body != carrier
    ]
    base = body_of_joint(robot, 0)
    moving = [name for name, body in arm.items() if body != base] + list(held)
    standing, partly = list[int](), list[tuple[int, int]]()
    for obstacle in around.obstacles:
        counted = [other for other in moving if frozenset((obstacle.name, other)) not in allowed]
        if len(counted) == len(moving):
            standing.append(number[obstacle.name])
        else:
            partly += [(number[obstacle.name], number[other]) for other in counted]
    unwanted = {frozenset(map(number.__getitem__, pair)) for pair in allowed}
    return Surrounded(shapes, [pair for pair in own if frozenset(pair) not in unwanted], partly, standing)


class Twin(NamedTuple):
    """An arm among the shapes of a scene, in MuJoCo."""

    model: mujoco.MjModel
    arm: dict[str, str]
    """Name of the body of each shape of the arm."""
    held: dict[str, str]
    """That of each shape that the arm holds."""


def compile_twin(robot: Robot, around: Surroundings) -> Twin:
    """The robot's twin with all shapes of a scene; errors as of `surround`."""
    from jacokin.model.mujoco_twin import compile_spec, to_spec

    spec = to_spec(robot, geometry=True, finger_angle=around.finger_angle)
    arm = {geom.name: geom.parent.name for geom in spec.geoms}
    for name in around.names:
        if name in arm:
            raise InvalidInputError(f"the name {name!r} is used by a shape of the arm; names must differ")
    add_to_spec(spec, around.obstacles)
    held = {each.name: _attach(spec, robot, each) for each in around.attached}
    return Twin(compile_spec(spec, robot), arm, held)


def allowed_pairs(robot: Robot, around: Surroundings, arm: Sequence[str]) -> set[frozenset[str]]:
    """Pairs of shapes whose contact the scene allows.

    Raises:
        UnknownNameError: no shape, link or obstacle has a name.
    """
    if not around.allow:
        return set()
    from jacokin.model.mujoco_twin import shapes_of_links

    links = {name: shapes & set(arm) for name, shapes in shapes_of_links(robot).items()}
    each = {name: frozenset((name,)) for name in (*arm, *around.names)}
    groups = {ROBOT: frozenset(arm), **{name: shapes for name, shapes in links.items() if shapes}, **each}
    found = set[frozenset[str]]()
    for pair in around.allow:
        first, second = (groups[checks.choice("shape or link", name, groups)] for name in pair)
        found |= {frozenset((a, b)) for a in first for b in second if a != b}
    return found


def _attach(spec: mujoco.MjSpec, robot: Robot, attached: Attached) -> str:
    """Add a shape to the link that carries it, and return the name of its body."""
    from jacokin.model.descriptions import mjcf
    from jacokin.model.mujoco_twin import body_of_joint

    frame = robot.pin_model.frames[robot.frame_id(attached.to)]
    if frame.parentJoint == 0:
        raise InvalidInputError(
            f"{attached.to!r} is moved by no joint of {robot.name}: leave {attached.name!r} an obstacle"
        )
    carrier = body_of_joint(robot, frame.parentJoint)
    attached.shape.add_to(spec.body(carrier))
    geom = spec.geom(attached.name)
    T_carrier_shape = frame.placement * mjcf.placement(geom.quat, geom.pos)
    geom.pos, geom.quat = T_carrier_shape.translation, poses.quaternion(T_carrier_shape.rotation)
    return carrier
