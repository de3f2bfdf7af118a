"""Lifting: a prop is to be 0.3 m higher than it lay."""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.model import checks
from jacokin.mujoco_bridge import Brick, PropPlacer, large_box
from jacokin.mujoco_bridge.base import RandomState
from jacokin.mujoco_bridge.control.site_ik import Asking
from jacokin.mujoco_bridge.distributions import uniform_box
from jacokin.mujoco_bridge.props import FreeProp
from jacokin.mujoco_bridge.rewards import fall_beyond
from jacokin.tasks.features import StateView, ids
from jacokin.tasks.task import ANY_YAW, BRICK, Task

DISTANCE = 0.3  # [m] to lift
_HALF_BOX = 0.09  # [m] height of the middle of the large box
_BOX_NAME = "unnamed_model"  # of the large box in dm_control's observations


class Lift(Task):
    """Lift a prop by 0.3 m, measured at its lowest corner.

    Attributes:
        prop: what is lifted.
    """

    goal_size = 1  # the height to reach [m]

    def __init__(self, prop: FreeProp, *, height: float | None = None) -> None:
        """Compile the scene.

        Args:
            prop: what is to be lifted, such as a `Mesh`.
            height: of its origin when it is placed [m]; None for that at which it lies on the table.
        """
        if not isinstance(prop, FreeProp):
            raise checks.refusal("prop", "a prop, such as a Mesh", prop)
        self.prop = prop
        z = prop.height_above_lowest if height is None else checks.non_negative("height", height, "m")
        lower, upper = (-0.1, -0.1, z), (0.1, 0.1, z)
        self._place_prop = PropPlacer(
            [prop], uniform_box(lower, upper), ANY_YAW, ignore_collisions=True, settle_physics=True
        )
        super().__init__(props=[prop])
        self._corners = ids(self.physics, prop.vertices)

    def initialize(self, random_state: RandomState) -> Asking[Array]:
        """Open the hand, place the prop, then the tool; the goal is the height to reach."""
        self.hand.set_grasp(self.physics, float(random_state.uniform()))
        self._place_prop(self.physics, random_state)
        yield from self.place_tool(random_state)
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


class LiftBrick(Lift):
    """Lift a brick."""

    def __init__(self) -> None:
        """Compile the scene."""
        super().__init__(Brick(name=BRICK), height=0.0)


class LiftLargeBox(Lift):
    """Lift a box that is too wide to be pinched."""

    def __init__(self) -> None:
        """Compile the scene."""
        super().__init__(large_box(_BOX_NAME), height=_HALF_BOX)
