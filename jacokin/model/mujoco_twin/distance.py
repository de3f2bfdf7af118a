"""How far the arm's shapes are from obstacles and from each other, measured by MuJoCo."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.model.mujoco_twin.export import to_spec
from jacokin.model.obstacles import add_to_spec, collision_pairs

if TYPE_CHECKING:
    from jacokin.model.obstacles import Obstacle
    from jacokin.model.robot import Robot


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
        spec = to_spec(robot, geometry=True, finger_angle=finger_angle)
        if not spec.geoms:
            raise ModelError(f"{robot.name}: the description has no collision shapes, so no distance can be measured")
        add_to_spec(spec, obstacles)
        self._model = model = spec.compile()
        pairs = collision_pairs(model, obstacles, self_collision=self_collision)
        self._first, self._second = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
        radius = model.geom_rbound
        self._radii = radius[self._first] + radius[self._second]
        # Planes have no bounding sphere.
        self._bounded = (radius[self._first] > 0.0) & (radius[self._second] > 0.0)
        self._local = threading.local()

    def least(self, q: Array) -> tuple[float, tuple[str, str]]:
        """Smallest distance [m] at `q` (dof,) [rad], negative where shapes overlap, and the two shapes.

        Without any pair of shapes the distance is infinite and the names are empty.
        """
        model = self._model
        try:
            data = self._local.data
        except AttributeError:
            data = self._local.data = mujoco.MjData(model)
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        gap = np.linalg.norm(data.geom_xpos[self._first] - data.geom_xpos[self._second], axis=1) - self._radii
        bound = np.where(self._bounded, gap, -np.inf)
        best, found = np.inf, -1
        for pair in np.argsort(bound).tolist():
            if bound[pair] >= best:
                break
            first, second = int(self._first[pair]), int(self._second[pair])
            cutoff = best if np.isfinite(best) else 1e3
            distance = mujoco.mj_geomDistance(model, data, first, second, cutoff, None)
            if distance < best:
                best, found = float(distance), pair
        if found < 0:
            return best, ("", "")
        return best, (str(model.geom(self._first[found]).name), str(model.geom(self._second[found]).name))
