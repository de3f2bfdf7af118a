"""Obstacles around the arm: box, sphere, capsule, cylinder, floor, other robots, which stand still in the base frame.

Clouds of points have a file of their own (`point_cloud`). The arm has shapes of its own: the collision shapes of its
description. It may hold others (`Attached`).
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array, Sealed
from jacokin.errors import ModelError
from jacokin.kernels.contact.shapes import SIZE
from jacokin.model import checks, poses
from jacokin.model.contact_arrays import ShapeRow
from jacokin.model.descriptions.shapes import NO_VERTICES, Shape, add_solid
from jacokin.model.kinematics import own_axes
from jacokin.model.own_shapes import own_shapes
from jacokin.model.point_cloud import NAME, PointCloud
from jacokin.model.robot import Robot, checked_robot

if TYPE_CHECKING:
    import mujoco


class Obstacle(Protocol):
    """A shape that stands still."""

    @property
    def name(self) -> str:
        """Name of the shape."""

    def add_to(self, body: mujoco.MjsBody) -> None:
        """Add the shape to the base body."""


@dataclass(frozen=True, slots=True, eq=False)
class _Solid(Sealed):
    """What the shapes below share."""

    solid: Shape = field(init=False, repr=False, compare=False)

    def add_to(self, body: mujoco.MjsBody) -> None:
        """Add the shape to the base body."""
        add_solid(body, self.solid)

    def _keep(self, solid: Shape, **checked: object) -> None:
        """Keep the checked numbers, and the shape that they make."""
        for name, value in {"solid": solid, **checked}.items():
            object.__setattr__(self, name, value)


@poses.giving_copies("pose")
@dataclass(frozen=True, slots=True, eq=False)
class Box(_Solid):
    """A box.

    Attributes:
        name: name of the shape.
        size: (3,) edge lengths [m].
        pose: where its centre is: T_base_box, or a position (3,) [m].
        solid: the same as contact takes it; not given.
    """

    name: str
    size: ArrayLike
    pose: pin.SE3 | ArrayLike

    def __post_init__(self) -> None:
        """Check the numbers."""
        checks.word(NAME, self.name)
        size = checks.positive_vector(f"{self.name}: size", self.size, 3, "m")
        pose = poses.checked_place(f"{self.name}: pose", self.pose)
        self._keep(Shape(self.name, "box", 0.5 * size, 0, pose), size=size, pose=pose)


@dataclass(frozen=True, slots=True, eq=False)
class Sphere(_Solid):
    """A sphere.

    Attributes:
        name: name of the shape.
        radius: [m].
        position: (3,) centre [m].
        solid: the same as contact takes it; not given.
    """

    name: str
    radius: float
    position: ArrayLike

    def __post_init__(self) -> None:
        """Check the numbers."""
        checks.word(NAME, self.name)
        radius = checks.positive(f"{self.name}: radius", self.radius, "m")
        position = checks.read_only(checks.vector(f"{self.name}: position", self.position, 3, "m"))
        solid = Shape(self.name, "sphere", np.array([radius, 0.0, 0.0]), 0, pin.SE3(np.eye(3), position))
        self._keep(solid, radius=radius, position=position)


@poses.giving_copies("pose")
@dataclass(frozen=True, slots=True, eq=False)
class _Round(_Solid):
    """What capsules and cylinders share."""

    name: str
    radius: float
    length: float
    pose: pin.SE3 | ArrayLike

    def __post_init__(self) -> None:
        """Check the numbers."""
        checks.word(NAME, self.name)
        radius = checks.positive(f"{self.name}: radius", self.radius, "m")
        length = checks.positive(f"{self.name}: length", self.length, "m")
        pose = poses.checked_place(f"{self.name}: pose", self.pose)
        kind = "capsule" if isinstance(self, Capsule) else "cylinder"
        solid = Shape(self.name, kind, np.array([radius, 0.5 * length, 0.0]), 0, pose)
        self._keep(solid, radius=radius, length=length, pose=pose)


@dataclass(frozen=True, slots=True, eq=False)
class Capsule(_Round):
    """A cylinder along its z axis with a half sphere on each end.

    Attributes:
        name: name of the shape.
        radius: [m].
        length: of the cylinder, without the half spheres [m].
        pose: where its centre is: T_base_capsule, or a position (3,) [m].
        solid: the same as contact takes it; not given.
    """


@dataclass(frozen=True, slots=True, eq=False)
class Cylinder(_Round):
    """A cylinder along its z axis with flat ends.

    Attributes:
        name: name of the shape.
        radius: [m].
        length: [m].
        pose: where its centre is: T_base_cylinder, or a position (3,) [m].
        solid: the same as contact takes it; not given.
    """


@dataclass(frozen=True, slots=True)
class Floor(_Solid):
    """A horizontal plane; everything below it is solid.

    Attributes:
        height: its z in the base frame [m].
        name: name of the shape.
        solid: the same as contact takes it; not given.
    """

    height: float = 0.0
    name: str = "floor"

    def __post_init__(self) -> None:
        """Check the numbers."""
        checks.word(NAME, self.name)
        height = checks.number(f"{self.name}: height", self.height, "m")
        at = pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))
        self._keep(Shape(self.name, "plane", np.zeros(3), 0, at), height=height)


@dataclass(frozen=True, slots=True, eq=False)
class Attached:
    """A shape that moves with the arm.

    Attributes:
        shape: with its pose in the frame that carries it.
        to: name of that frame.
    """

    shape: Obstacle
    to: str

    @property
    def name(self) -> str:
        """Name of the shape."""
        return self.shape.name


class Surroundings(NamedTuple):
    """What a scene holds, as whatever looks for contact takes it; already checked."""

    obstacles: tuple[Obstacle, ...] = ()
    """Shapes that stand still in the base frame."""
    attached: tuple[Attached, ...] = ()
    """Shapes that move with the arm."""
    allow: tuple[tuple[str, str], ...] = ()
    """Pairs of names whose contact does not count."""
    finger_angle: float | None = None
    """Angle at which the fingers stand [rad]; None for the angle that the robot was loaded with."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all shapes."""
        return self.obstacle_names + tuple(each.name for each in self.attached)

    @property
    def obstacle_names(self) -> tuple[str, ...]:
        """Names of the shapes that stand still."""
        return tuple(each.name for each in self.obstacles)

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the shapes and what else counts for contact: the same in every process and version of Python."""
        content = hashlib.sha256(repr((self.allow, self.finger_angle)).encode())
        standing = [("", each) for each in self.obstacles]
        for to, obstacle in (*standing, *((each.to, each.shape) for each in self.attached)):
            shape = shape_of(obstacle)
            points = np.asarray(obstacle.points) if isinstance(obstacle, PointCloud) else shape.vertices
            content.update(repr((obstacle.name, to, shape.kind, points.shape)).encode())
            for array in (shape.size, shape.placement.homogeneous, points):
                content.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
        return content.hexdigest()


NOTHING_AROUND = Surroundings()


def checked_surroundings(name: str, scene: object) -> Surroundings:
    """What a scene holds, or an error that names the argument.

    Raises:
        InvalidInputError: not a `Scene`.
    """
    found = getattr(scene, "surroundings", None)
    if not isinstance(found, Surroundings):
        raise checks.refusal(name, "a Scene, for example Scene([Floor(0.0)])", scene)
    return found


def place(shape: Obstacle, pose: pin.SE3 | ArrayLike) -> Obstacle:
    """A shape at another pose, or position (3,) [m].

    Raises:
        InvalidInputError: the pose is malformed, or the shape is not one that can be moved.
    """
    if isinstance(shape, Sphere):
        return replace(shape, position=poses.checked_place(f"{shape.name}: pose", pose).translation)
    if isinstance(shape, Box | Capsule | Cylinder):
        return replace(shape, pose=pose)
    if isinstance(shape, PointCloud):
        return shape.at(pose)
    raise checks.refusal("shape", "a Box, Sphere, Capsule, Cylinder or PointCloud where a pose is given", shape)


def pose_of(shape: Obstacle) -> pin.SE3:
    """T_base_shape; a sphere has the axes of the base.

    Raises:
        InvalidInputError: a shape without a pose.
    """
    if isinstance(shape, Box | Sphere | Capsule | Cylinder | PointCloud):
        return shape.solid.placement
    raise checks.refusal("shape", "a Box, Sphere, Capsule, Cylinder or PointCloud, which have a pose", shape)


def shape_of(obstacle: Obstacle) -> Shape:
    """An obstacle as contact takes it, where it is placed; one without a `solid` through MuJoCo.

    Raises:
        ShapeError: MuJoCo cannot compile it.
    """
    solid = getattr(obstacle, "solid", None)
    if isinstance(solid, Shape):
        return solid
    from jacokin.model.mujoco_twin import shape_through_mujoco

    return shape_through_mujoco(obstacle.name, obstacle.add_to)


@poses.giving_copies("base")
@dataclass(frozen=True, slots=True, eq=False)
class OtherRobot(Sealed):
    """A robot that stands beside the arm.

    Attributes:
        name: of this robot in the scene; its shapes are called "name/shape".
        robot: what it is.
        q: (dof,) where its joints stand [rad].
        base: where its base is: T_base_other, or a position (3,) [m].
        finger_angle: where its fingers stand [rad]; None for the angle that it was loaded with.
        parts: its shapes where they stand; not given.
    """

    name: str
    robot: Robot
    q: ArrayLike
    base: pin.SE3 | ArrayLike
    finger_angle: float | None = None
    parts: tuple[RobotPart, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the numbers, and place the shapes.

        Raises:
            InvalidInputError: malformed, or no finger can take the angle.
            ModelError: the description has no shapes, or they cannot be loaded.
        """
        checks.word(NAME, self.name)
        checked_robot(f"{self.name}: robot", self.robot)
        object.__setattr__(self, "q", checks.read_only(self.robot.configuration(self.q, f"{self.name}: q")))
        object.__setattr__(self, "base", poses.checked_place(f"{self.name}: base", self.base))
        angle = checks.optional(checks.number, f"{self.name}: finger_angle", self.finger_angle, "rad")
        object.__setattr__(self, "finger_angle", angle)
        own = own_shapes(self.robot, angle)
        if not own.shapes:
            raise ModelError(f"{self.name}: the description of {self.robot.name} has no collision shapes")
        links = self._links()
        parts = [
            RobotPart(f"{self.name}/{shape.name}", self, _placed(f"{self.name}/{shape.name}", shape, row, links))
            for shape, row in zip(own.shapes, own.rows, strict=True)
        ]
        object.__setattr__(self, "parts", tuple(parts))

    def at(self, q: ArrayLike) -> OtherRobot:
        """This robot at another configuration (dof,) [rad].

        Raises:
            InvalidInputError: malformed.
        """
        return OtherRobot(self.name, self.robot, q, self.base, self.finger_angle)

    def _links(self) -> list[pin.SE3]:
        """T_base_link of each joint's link, the axis of the joint its z, in the base of the arm; the base first."""
        model = self.robot.pin_model
        data = model.createData()
        pin.forwardKinematics(model, data, np.asarray(self.q))
        base = poses.checked_pose(self.base)
        return [base * placed * own for placed, own in zip(data.oMi, own_axes(model), strict=True)]


@dataclass(frozen=True, slots=True, eq=False)
class RobotPart:
    """A shape of another robot, as an obstacle.

    Attributes:
        name: of the robot in the scene, and of the shape.
        robot: whose shape it is.
        solid: the shape where it stands, in the base of the arm.
    """

    name: str
    robot: OtherRobot = field(repr=False)
    solid: Shape = field(repr=False)

    def add_to(self, body: mujoco.MjsBody) -> None:
        """Add the shape to the base body; the hull of a mesh as the box around it."""
        solid = self.solid
        if solid.kind != "mesh":
            add_solid(body, solid)
            return
        low, high = solid.vertices.min(axis=0), solid.vertices.max(axis=0)
        centre = solid.placement * pin.SE3(np.eye(3), 0.5 * (low + high))
        add_solid(body, solid._replace(kind="box", size=0.5 * (high - low), placement=centre))


def _placed(name: str, shape: Shape, row: ShapeRow, links: list[pin.SE3]) -> Shape:
    """A shape of a link as one of the base; the vertices of meshes are those of its hull."""
    own: Array = row.numbers[:SIZE].reshape(3, 4)
    place = links[shape.joint] * pin.SE3(own[:, :3], own[:, 3])
    vertices = row.vertices if shape.kind == "mesh" else NO_VERTICES
    return Shape(name, shape.kind, shape.size, 0, place, vertices)
