"""Lifting: a prop is to be 0.3 m higher than it lay."""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.mujoco_bridge import BoxProp, Brick, PropPlacer, large_box
from jacokin.mujoco_bridge.base import RandomState
from jacokin.mujoco_bridge.control.site_ik import Asking
from jacokin.mujoco_bridge.distributions import uniform_box
from jacokin.mujoco_bridge.rewards import fall_beyond
from jacokin.mujoco_bridge.workspaces import BoundingBox
from jacokin.tasks import features
from jacokin.tasks.features import Feature, StateView, ids
from jacokin.tasks.task import ANY_YAW, BRICK, Task

DISTANCE = 0.3  # [m] to lift
_HALF_BOX = 0.09  # [m] height of the middle of the large box
_BOX_NAME = "unnamed_model"  # of the large box in dm_control's observations


class _Lift(Task):
    """Lift a prop by 0.3 m, measured at its lowest corner."""

    goal_size = 1  # the height to reach [m]
    tool_box = BoundingBox((-0.1, -0.1, 0.2), (0.1, 0.1, 0.4))
    prop: Brick | BoxProp
    height: float  # [m] of the prop's origin when it is placed

    def _add_prop(self, prop: Brick | BoxProp) -> None:
        self.prop = prop
        self._add_free(prop)
        lower, upper = (-0.1, -0.1, self.height), (0.1, 0.1, self.height)
        self._place_prop = PropPlacer(
            [prop], uniform_box(lower, upper), ANY_YAW, ignore_collisions=True, settle_physics=True
        )

    def _features(self, own: list[Feature]) -> list[Feature]:
        self._corners = ids(self.physics, self.prop.vertices)
        return own + features.prop_features(self.physics, self.prop)

    def _initialize(self, random_state: RandomState) -> Asking[Array]:
        self.hand.set_grasp(self.physics, float(random_state.uniform()))
        self._place_prop(self.physics, random_state)
        yield from self._place_tool(random_state)
        return self._lowest(StateView.of(self.physics.data))[None] + DISTANCE

    def _lowest(self, view: StateView) -> Array:
        return np.asarray(view.site_xpos[..., self._corners, 2].min(axis=-1))

    def achieved(self, view: StateView, goal: Array) -> Array:
        """Height of the prop's lowest corner, (..., 1) [m]."""
        return self._lowest(view)[..., None]

    def desired(self, view: StateView, goal: Array) -> Array:
        """The height to reach, (..., 1) [m]."""
        return goal

    def reward(self, achieved: Array, desired: Array) -> Array:
        """1 from 0.3 m above the start, falling linearly to 0 at the height of the start."""
        return fall_beyond((desired - achieved)[..., 0], DISTANCE, "linear", 0.0)

    def success(self, achieved: Array, desired: Array) -> Array:
        """Whether the lowest corner is 0.3 m higher than at the start."""
        return np.asarray((achieved >= desired)[..., 0])


class LiftBrick(_Lift):
    """Lift a brick."""

    height = 0.0

    def _add_props(self) -> None:
        self._add_prop(Brick(name=BRICK))


class LiftLargeBox(_Lift):
    """Lift a box that is too wide to be pinched."""

    height = _HALF_BOX

    def _add_props(self) -> None:
        self._add_prop(large_box(_BOX_NAME))
