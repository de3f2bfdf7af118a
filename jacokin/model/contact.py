"""Contact of an arm with itself and with obstacles, and distances, on the collision shapes of its description."""

from __future__ import annotations

import threading
from collections.abc import Sequence

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.model.mujoco_twin import to_spec
from jacokin.model.obstacles import Obstacle, add_pairs, add_to_spec, collision_pairs
from jacokin.model.poses import quaternion
from jacokin.model.robot import Robot, checked_robot

FARTHEST = 1e3  # [m] distances beyond are not looked for
STANDING = 0.005  # [m] a base may be this deep in what it stands on or is screwed to
WORLD_BODY = "jacokin_world"


class _Shapes:
    """A compiled model of the arm and obstacles; each thread gets working memory of its own."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Take the compiled twin of a robot with its obstacles."""
        self.model = model
        self._local = threading.local()

    def at(self, q: Array, T_base_world: pin.SE3 | None = None) -> mujoco.MjData:
        """The shapes in the places that they have at `q` (dof,) [rad], those in the world where it is."""
        try:
            data = self._local.data
        except AttributeError:
            data = self._local.data = mujoco.MjData(self.model)
        data.qpos[:] = q
        if T_base_world is not None:
            data.mocap_pos[0] = T_base_world.translation
            data.mocap_quat[0] = quaternion(T_base_world.rotation)
        mujoco.mj_kinematics(self.model, data)
        return data


class Contact:
    """Contact of one robot with itself and with obstacles; may be shared between threads.

    Attributes:
        pairs: how many pairs of shapes are tested.
    """

    def __init__(
        self,
        robot: Robot,
        obstacles: Sequence[Obstacle] = (),
        *,
        clearance: float = 0.0,
        finger_angle: float | None = None,
    ) -> None:
        """Build the shapes in MuJoCo.

        Args:
            robot: the arm.
            obstacles: checked obstacles, in the base frame.
            clearance: shapes this near to each other count as touching [m].
            finger_angle: angle of the joints off the arm [rad]; None for the one the robot was loaded with.

        Raises:
            InvalidInputError: `robot` is not a Robot, an obstacle has the name of a shape of the arm, or no finger can
                take the angle.
            ModelError: the description's shapes cannot be loaded.
        """
        self._robot = checked_robot("robot", robot)
        self._clearance = clearance
        spec = to_spec(robot, geometry=True, finger_angle=finger_angle)
        add_to_spec(spec, obstacles)
        add_pairs(spec, obstacles)
        for pair in spec.pairs:
            pair.margin = clearance
        self._shapes = _Shapes(spec.compile())
        self.pairs = int(self._shapes.model.npair)

    def touching(self, q: ArrayLike) -> list[tuple[str, str]]:
        """Names of the shapes that touch at `q` (dof,) [rad]; empty when none do.

        Raises:
            InvalidInputError: `q` malformed.
        """
        model, data = self._shapes.model, self._shapes.at(self._robot.configuration(q))
        mujoco.mj_collision(model, data)
        contact = data.contact
        touching = {
            (model.geom(int(a)).name, model.geom(int(b)).name)
            for (a, b), distance in zip(contact.geom, contact.dist, strict=True)
            if distance <= self._clearance
        }
        return sorted(touching)


class SelfContact(Contact):
    """Self-contact of one robot; may be shared between threads."""

    def __init__(self, robot: Robot) -> None:
        """Build the shapes of the robot in MuJoCo.

        Raises:
            InvalidInputError: `robot` is not a Robot.
            ModelError: the description's shapes cannot be loaded.
        """
        super().__init__(robot)

    @classmethod
    def of(cls, robot: Robot) -> SelfContact | None:
        """A checker, or None when the description has no shapes to check."""
        try:
            checker = cls(robot)
        except ModelError:
            return None
        return checker if checker.pairs else None


def compiled_pairs(
    robot: Robot, obstacles: Sequence[Obstacle], *, self_collision: bool, finger_angle: float | None
) -> tuple[mujoco.MjModel, list[tuple[int, int]]]:
    """The robot's twin with its shapes and the obstacles, and the pairs of shapes that may collide, by number.

    Raises:
        InvalidInputError: an obstacle has the name of a shape of the arm, or no finger can take the angle.
        ModelError: the description has no shapes, or they cannot be loaded.
    """
    spec = to_spec(robot, geometry=True, finger_angle=finger_angle)
    if not spec.geoms:
        raise ModelError(f"{robot.name}: the description has no collision shapes, so no distance can be measured")
    add_to_spec(spec, obstacles)
    model = spec.compile()
    return model, collision_pairs(model, obstacles, self_collision=self_collision)


class ContactInWorld:
    """Contact of an arm, its base included, whose base may stand anywhere in a scene; may be shared between threads."""

    def __init__(self, robot: Robot, obstacles: Sequence[Obstacle], *, finger_angle: float | None = None) -> None:
        """Build the shapes in MuJoCo; arguments and errors as of `Contact`, the obstacles in the world."""
        self._robot = checked_robot("robot", robot)
        spec = to_spec(robot, geometry=True, finger_angle=finger_angle)
        arm = [geom.name for geom in spec.geoms]
        if not arm:
            raise ModelError(f"{robot.name}: the description has no collision shapes, so no contact can be found")
        # Only the pose of a mocap body can change after compiling.
        add_to_spec(spec, obstacles, spec.worldbody.add_body(name=WORLD_BODY, mocap=True))
        for obstacle in obstacles:
            for name in arm:
                spec.add_pair(name=f"{obstacle.name}~{name}", geomname1=obstacle.name, geomname2=name)
        self._shapes = _Shapes(spec.compile())
        model = self._shapes.model
        base = {name for name in arm if model.body_weldid[model.geom(name).bodyid[0]] == 0}
        self._base = frozenset(base)
        self._obstacles = frozenset(obstacle.name for obstacle in obstacles)

    def touching(self, q: Array, T_world_base: pin.SE3) -> list[tuple[str, str]]:
        """Names of the shapes that touch at `q` (dof,) [rad]; a base that stands on an obstacle does not touch it."""
        model = self._shapes.model
        T_base_world = T_world_base.inverse()
        data = self._shapes.at(q, T_base_world)
        mujoco.mj_collision(model, data)
        found = set()
        for (a, b), distance in zip(data.contact.geom, data.contact.dist, strict=True):
            pair = model.geom(int(a)).name, model.geom(int(b)).name
            stands = not self._base.isdisjoint(pair) and not self._obstacles.isdisjoint(pair)
            if distance <= (-STANDING if stands else 0.0):
                found.add(pair)
        return sorted(found)

    def is_blocked(self, T_world_base: pin.SE3) -> bool:
        """Whether the base is inside an obstacle, whatever the joints do."""
        touching = self.touching(self._robot.home, T_world_base)
        return any(not self._base.isdisjoint(pair) and not self._obstacles.isdisjoint(pair) for pair in touching)


class ShapeDistances:
    """Smallest distance between shapes of one robot in one scene; may be shared between threads."""

    def __init__(
        self,
        robot: Robot,
        obstacles: Sequence[Obstacle],
        *,
        self_collision: bool = False,
        finger_angle: float | None = None,
    ) -> None:
        """Build the shapes in MuJoCo.

        Args:
            robot: the arm.
            obstacles: checked obstacles, in the base frame.
            self_collision: True to measure the arm's own shapes against each other too.
            finger_angle: angle of the joints off the arm [rad]; None for the one the robot was loaded with.

        Raises:
            InvalidInputError: an obstacle has the name of a shape of the arm, or no finger can take the angle.
            ModelError: the description has no shapes, or they cannot be loaded.
        """
        model, pairs = compiled_pairs(robot, obstacles, self_collision=self_collision, finger_angle=finger_angle)
        self._shapes = _Shapes(model)
        self._first, self._second = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
        radius = model.geom_rbound
        self._radii = radius[self._first] + radius[self._second]
        # Planes have no bounding sphere.
        self._bounded = (radius[self._first] > 0.0) & (radius[self._second] > 0.0)

    def least(self, q: Array) -> tuple[float, tuple[str, str]]:
        """Smallest distance [m] at `q` (dof,) [rad], negative where shapes overlap, and the two shapes.

        Without any pair of shapes the distance is infinite and the names are empty.
        """
        model, data = self._shapes.model, self._shapes.at(q)
        gap = np.linalg.norm(data.geom_xpos[self._first] - data.geom_xpos[self._second], axis=1) - self._radii
        bound = np.where(self._bounded, gap, -np.inf)
        best, found = np.inf, -1
        for pair in np.argsort(bound).tolist():
            if bound[pair] >= best:
                break
            first, second = int(self._first[pair]), int(self._second[pair])
            distance = mujoco.mj_geomDistance(model, data, first, second, min(best, FARTHEST), None)
            if distance < best:
                best, found = float(distance), pair
        if found < 0:
            return best, ("", "")
        return best, (str(model.geom(self._first[found]).name), str(model.geom(self._second[found]).name))
