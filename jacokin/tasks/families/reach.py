"""Reaching: the tool centre point is to be at a site, or at a brick."""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.mujoco_bridge import Brick, PropPlacer, workspaces
from jacokin.mujoco_bridge.base import RandomState
from jacokin.mujoco_bridge.control.site_ik import Asking
from jacokin.mujoco_bridge.distributions import uniform_box
from jacokin.mujoco_bridge.rewards import fall_beyond
from jacokin.mujoco_bridge.workspaces import BoundingBox
from jacokin.tasks.features import Feature, StateView, length
from jacokin.tasks.task import ANY_YAW, BRICK, LYING, Task, position_in_qpos

RADIUS = 0.05  # [m] of the target
_TARGET = "target"
_SITE_BOX = BoundingBox((-0.2, -0.2, 0.02), (0.2, 0.2, 0.4))
_BRICK_BOX = BoundingBox((-0.1, -0.1, LYING), (0.1, 0.1, LYING))
_CORNERS = {
    "top_left": (-0.09, 0.09),
    "top_right": (0.09, 0.09),
    "bottom_left": (-0.09, -0.09),
    "bottom_right": (0.09, -0.09),
}
CORNERS = {name: BoundingBox((x, y, LYING), (x, y, LYING)) for name, (x, y) in _CORNERS.items()}
"""Boxes that place the brick of `ReachBrick` at a corner of the usual one."""


class _ReachTask(Task):
    """Bring the tool centre point to within 0.05 m of a target."""

    def achieved(self, view: StateView, goal: Array) -> Array:
        """Position of the tool centre point, (..., 3) [m]."""
        return self.tool(view)

    def reward(self, achieved: Array, desired: Array) -> Array:
        """1 within 0.05 m of the target, falling along a Gaussian that is 0.1 at 0.1 m."""
        return fall_beyond(length(achieved - desired) - RADIUS, RADIUS, "gaussian")

    def success(self, achieved: Array, desired: Array) -> Array:
        """Whether the tool centre point is within 0.05 m of the target."""
        return np.asarray(length(achieved - desired) <= RADIUS)


class ReachSite(_ReachTask):
    """Reach a point in the air."""

    tool_box = _SITE_BOX

    def build(self) -> None:
        """Add the site."""
        body = self.arena.mjcf_model.worldbody.add_body(name=_TARGET, mocap=True)
        workspaces.add_target_site(body, RADIUS, visible=True, name=_TARGET)
        self._target = uniform_box(*_SITE_BOX)

    def observe(self, own: list[Feature]) -> list[Feature]:
        """The position of the site before those of the robot."""
        return [Feature("target_position", (3,), self.desired), *own]

    def initialize(self, random_state: RandomState) -> Asking[Array]:
        """Place the robot, then the site."""
        yield from self.place_robot(random_state)
        self.physics.data.mocap_pos[0] = self._target(random_state=random_state)
        return np.empty(0)

    def desired(self, view: StateView, goal: Array) -> Array:
        """Position of the site, (..., 3) [m]."""
        return view.mocap_pos[..., 0, :]


class ReachBrick(_ReachTask):
    """Reach a brick on the table."""

    def __init__(self, brick_box: BoundingBox = _BRICK_BOX) -> None:
        """Compile the scene.

        Args:
            brick_box: where the brick is placed.
        """
        brick = Brick(name=BRICK)
        self._place_brick = PropPlacer([brick], uniform_box(*brick_box), ANY_YAW, settle_physics=True)
        super().__init__(props=[brick])
        self._position = position_in_qpos(self.physics, brick)

    def initialize(self, random_state: RandomState) -> Asking[Array]:
        """Place the robot, then the brick."""
        yield from self.place_robot(random_state)
        self._place_brick(self.physics, random_state)
        return np.empty(0)

    def desired(self, view: StateView, goal: Array) -> Array:
        """Position of the brick, (..., 3) [m]."""
        return view.qpos[..., self._position]
