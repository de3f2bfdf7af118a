"""Placing: a brick is to be put on a pedestal, and the hand to move away."""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.model import checks
from jacokin.mujoco_bridge import Brick, Cradle, Pedestal, PropPlacer
from jacokin.mujoco_bridge.base import RandomState
from jacokin.mujoco_bridge.control.site_ik import Asking
from jacokin.mujoco_bridge.distributions import uniform_box
from jacokin.mujoco_bridge.entity import Entity
from jacokin.mujoco_bridge.props import FreeProp
from jacokin.mujoco_bridge.rewards import fall_beyond
from jacokin.mujoco_bridge.workspaces import BoundingBox
from jacokin.tasks.families.bricks import BRICK_BOX, TOUCHING
from jacokin.tasks.features import StateView, length
from jacokin.tasks.task import ANY_YAW, ATTEMPTS, BRICK, Task, position_in_qpos

RADIUS = 0.05  # [m] of the target
AWAY = 4.0 * RADIUS  # [m] of the hand from the target
_AWAY_MARGIN = 3.0 * RADIUS  # [m]
_BESIDE = np.array((0.0, 0.0, AWAY + RADIUS))  # [m] from the target, a place of the hand that solves the task
_IN_PLACE = 10.0  # weight
_PEDESTAL_BOX = BoundingBox((-0.1, -0.1, 0.07), (0.1, 0.1, 0.17))


class Place(Task):
    """Put a prop on a pedestal and take the hand away."""

    tool_box = BoundingBox((-0.1, -0.1, 0.17), (0.1, 0.1, 0.4))

    def __init__(self, prop: FreeProp, top: Entity | None = None, *, height: float | None = None) -> None:
        """Compile the scene.

        Args:
            prop: what is to be placed, such as a `Mesh`; its origin is to be near the top of the pedestal.
            top: what is on the pedestal, such as a `Cradle`; None for nothing.
            height: of the prop's origin when it is placed [m]; None for that at which it lies on the table.
        """
        if not isinstance(prop, FreeProp):
            raise checks.refusal("prop", "a prop, such as a Mesh", prop)
        self.pedestal = Pedestal(top)
        z = prop.height_above_lowest + TOUCHING if height is None else checks.non_negative("height", height, "m")
        (x, y, _), (to_x, to_y, _) = BRICK_BOX
        self._place_prop = PropPlacer(
            [prop],
            uniform_box((x, y, z), (to_x, to_y, z)),
            ANY_YAW,
            settle_physics=True,
            max_attempts_per_prop=ATTEMPTS,
        )
        self._place_pedestal = PropPlacer([self.pedestal], uniform_box(*_PEDESTAL_BOX))
        super().__init__(props=[prop], fixtures=[self.pedestal])
        self._position = position_in_qpos(self.physics, prop)

    def initialize(self, random_state: RandomState) -> Asking[Array]:
        """Place the pedestal, the robot, then the prop."""
        self._place_pedestal(self.physics, random_state, ignore_contacts_with_entities=self.props)
        yield from self.place_robot(random_state)
        self._place_prop(self.physics, random_state)
        return np.empty(0)

    def achieved(self, view: StateView, goal: Array) -> Array:
        """Positions of the brick and of the tool centre point, (..., 6) [m]."""
        return np.concatenate((view.qpos[..., self._position], self.tool(view)), axis=-1)

    def _target(self, view: StateView) -> Array:
        return view.mocap_pos[..., 0, :]

    def desired(self, view: StateView, goal: Array) -> Array:
        """Where the brick is to be, and a place for the tool centre point away from it, (..., 6) [m]."""
        target = self._target(view)
        return np.concatenate((target, target + _BESIDE), axis=-1)

    def reward(self, achieved: Array, desired: Array) -> Array:
        """Ten parts for the brick in place; one for the hand at the brick or, once that is in place, away.

        Where away from the target the hand is desired does not count.
        """
        prop, tool, target = achieved[..., :3], achieved[..., 3:], desired[..., :3]
        grasped = fall_beyond(length(prop - tool) - RADIUS, RADIUS, "long_tail")
        in_place = fall_beyond(length(prop - target) - RADIUS, RADIUS, "long_tail")
        away = fall_beyond(AWAY - length(tool - target), _AWAY_MARGIN, "long_tail")
        return (grasped * (1.0 - in_place) + away * in_place + _IN_PLACE * in_place) / (1.0 + _IN_PLACE)

    def success(self, achieved: Array, desired: Array) -> Array:
        """Whether the brick is within 0.05 m of the target, and the tool centre point at least 0.2 m away."""
        prop, tool, target = achieved[..., :3], achieved[..., 3:], desired[..., :3]
        return np.asarray((length(prop - target) <= RADIUS) & (length(tool - target) >= AWAY))


class PlaceBrick(Place):
    """Put a brick on a pedestal that carries another brick."""

    def __init__(self) -> None:
        """Compile the scene."""
        super().__init__(Brick(name=BRICK), Brick(name=BRICK), height=TOUCHING)


class PlaceCradle(Place):
    """Put a brick into a cradle of three spheres."""

    def __init__(self) -> None:
        """Compile the scene."""
        super().__init__(Brick(name=BRICK), Cradle(), height=TOUCHING)
