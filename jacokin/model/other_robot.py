"""`OtherRobot`: another robot in a scene. It stands at a configuration, and each of its shapes is an obstacle."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.kernels.contact.shapes import SIZE
from jacokin.model import checks, poses
from jacokin.model.contact_arrays import ShapeRow, about_z
from jacokin.model.descriptions.shapes import NO_VERTICES, Shape
from jacokin.model.obstacles import add_solid
from jacokin.model.own_shapes import own_shapes
from jacokin.model.point_cloud import NAME
from jacokin.model.robot import Robot, checked_robot

if TYPE_CHECKING:
    import mujoco


@poses.giving_copies("base")
@dataclass(frozen=True, slots=True, eq=False)
class OtherRobot:
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
        return [base, *(base * data.oMi[joint] * about_z(model, joint) for joint in range(1, model.njoints))]


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
