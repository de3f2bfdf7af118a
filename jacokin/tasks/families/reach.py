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
from jacokin.tasks import features
from jacokin.tasks.features import Feature, StateView, length
from jacokin.tasks.task import ANY_YAW, BRICK, Task, position_in_qpos

RADIUS = 0.05  # [m] of the target
_TARGET = "target"
_SITE_BOX = BoundingBox((-0.2, -0.2, 0.02), (0.2, 0.2, 0.4))
_LYING = 0.001  # [m] height of a brick that is placed
_BRICK_BOX = BoundingBox((-0.1, -0.1, _LYING), (0.1, 0.1, _LYING))
_CORNERS = {
    "top_left": (-0.09, 0.09),
    "top_right": (0.09, 0.09),
    "bottom_left": (-0.09, -0.09),
    "bottom_right": (0.09, -0.09),
}
CORNERS = {name: BoundingBox((x, y, _LYING), (x, y, _LYING)) for name, (x, y) in _CORNERS.items()}
"""Boxes that place the brick of `ReachBrick` at a corner of the usual one."""


class _Reach(Task):
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


class ReachSite(_Reach):
    """Reach a point in the air."""

    tool_box = _SITE_BOX

    def _add_props(self) -> None:
        body = self.arena.mjcf_model.worldbody.add_body(name=_TARGET, mocap=True)
        workspaces.add_target_site(body, RADIUS, visible=True, name=_TARGET)
        self._target = uniform_box(*_SITE_BOX)

    def _features(self, own: list[Feature]) -> list[Feature]:
        return [Feature("target_position", (3,), self.desired), *own]

    def _initialize(self, random_state: RandomState) -> Asking[Array]:
        yield from self._place_robot(random_state)
        self.physics.data.mocap_pos[0] = self._target(random_state=random_state)
        return np.empty(0)

    def desired(self, view: StateView, goal: Array) -> Array:
        """Position of the site, (..., 3) [m]."""
        return view.mocap_pos[..., 0, :]


class ReachBrick(_Reach):
    """Reach a brick on the table."""

    tool_box = BoundingBox((-0.1, -0.1, 0.2), (0.1, 0.1, 0.4))

    def __init__(self, brick_box: BoundingBox = _BRICK_BOX) -> None:
        """Compile the scene.

        Args:
            brick_box: where the brick is placed.
        """
        self._brick_box = brick_box
        super().__init__()

    def _add_props(self) -> None:
        self.brick = Brick(name=BRICK)
        self._add_free(self.brick)
        self._place_brick = PropPlacer([self.brick], uniform_box(*self._brick_box), ANY_YAW, settle_physics=True)

    def _features(self, own: list[Feature]) -> list[Feature]:
        self._position = position_in_qpos(self.physics, self.brick)
        return own + features.prop_features(self.physics, self.brick)

    def _initialize(self, random_state: RandomState) -> Asking[Array]:
        yield from self._place_robot(random_state)
        self._place_brick(self.physics, random_state)
        return np.empty(0)

    def desired(self, view: StateView, goal: Array) -> Array:
        """Position of the brick, (..., 3) [m]."""
        return view.qpos[..., self._position]
