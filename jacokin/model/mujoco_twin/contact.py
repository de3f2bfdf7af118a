"""Does the arm touch itself? Asked of MuJoCo, on the collision shapes of the description."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from jacokin.errors import ModelError

if TYPE_CHECKING:
    from jacokin.model.robot import Robot


class SelfContact:
    """Self-contact of one robot; may be shared between threads, each of which gets working memory of its own.

    Attributes:
        pairs: how many pairs of shapes are tested.
    """

    def __init__(self, robot: Robot) -> None:
        """Build the shapes of the robot in MuJoCo.

        Raises:
            InvalidInputError: `robot` is not a Robot.
            ModelError: the description's shapes cannot be loaded.
        """
        import mujoco

        from jacokin.model.mujoco_twin.export import to_mujoco

        self._mujoco = mujoco
        self._robot = robot
        self._model = to_mujoco(robot, geometry=True)
        self._local = threading.local()
        self.pairs = int(self._model.npair)

    @classmethod
    def of(cls, robot: Robot) -> SelfContact | None:
        """A checker, or None when the description has no shapes to check."""
        try:
            checker = cls(robot)
        except ModelError:
            return None
        return checker if checker.pairs else None

    def touching(self, q: ArrayLike) -> list[tuple[str, str]]:
        """Names of the shapes that touch at `q` (dof,) [rad]; empty when none do.

        Raises:
            InvalidInputError: `q` malformed.
        """
        checked = self._robot.configuration(q)
        try:
            data = self._local.data
        except AttributeError:
            data = self._local.data = self._mujoco.MjData(self._model)
        data.qpos[:] = checked
        self._mujoco.mj_kinematics(self._model, data)
        self._mujoco.mj_collision(self._model, data)
        contact = data.contact
        touching = [
            (self._model.geom(int(a)).name, self._model.geom(int(b)).name)
            for (a, b), distance in zip(contact.geom, contact.dist, strict=True)
            if distance <= 0.0
        ]
        return sorted(set(touching))
