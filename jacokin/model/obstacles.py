"""Obstacles around the arm: box, sphere, capsule, cylinder and floor, which stand still in the base frame.

Clouds of points and other robots have files of their own (`point_cloud`, `other_robot`).

The arm has shapes of its own: the collision shapes of its description. It may hold others (`Attached`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.errors import InvalidInputError
from jacokin.model import checks, poses
from jacokin.model.descriptions.shapes import Shape
from jacokin.model.point_cloud import NAME, PointCloud

if TYPE_CHECKING:
    import mujoco


PLANE_SIZE = (1.0, 1.0, 0.1)  # [m] how a plane is drawn, which has no end


class Obstacle(Protocol):
    """A shape that stands still."""

    @property
    def name(self) -> str:
        """Name of the shape."""

    def add_to(self, body: mujoco.MjsBody) -> None:
        """Add the shape to the base body."""


@dataclass(frozen=True, slots=True, eq=False)
class _Solid:
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


def checked_obstacles(obstacles: Iterable[Obstacle]) -> tuple[Obstacle, ...]:
    """The obstacles of a list.

    Raises:
        InvalidInputError: it is not a list, or one is not an obstacle with a name, or two share a name.
    """
    shapes = checks.listed("obstacles", obstacles)
    names = set()
    for shape in shapes:
        name = getattr(shape, "name", None)
        if not callable(getattr(shape, "add_to", None)) or not isinstance(name, str) or not name:
            raise checks.refusal(
                "obstacles", "shapes with a name (Box, Sphere, Capsule, Cylinder, Floor, PointCloud)", shape
            )
        checks.word(NAME, name)
        if name in names:
            raise InvalidInputError(f"the name {name!r} is used by two shapes; names must differ")
        names.add(name)
    return shapes


def add_solid(body: mujoco.MjsBody, solid: Shape) -> None:
    """Add a shape that is no mesh to the base body."""
    import mujoco  # an arm alone is checked without it

    body.add_geom(
        name=solid.name,
        type=getattr(mujoco.mjtGeom, f"mjGEOM_{solid.kind.upper()}"),
        size=PLANE_SIZE if solid.kind == "plane" else solid.size,
        pos=solid.placement.translation,
        quat=poses.quaternion(solid.placement.rotation),
        contype=0,
        conaffinity=0,
    )
