"""Stacking: bricks that lie on the table are to be stacked in a wanted order."""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.mujoco_bridge import PropPlacer
from jacokin.mujoco_bridge.base import RandomState
from jacokin.mujoco_bridge.control.queries import Asking
from jacokin.mujoco_bridge.distributions import uniform_box
from jacokin.tasks.families.bricks import BRICK_BOX, BrickTask
from jacokin.tasks.task import ANY_YAW

_CLOSE_WEIGHT = 0.1


class Stack(BrickTask):
    """Stack bricks on one another."""

    def __init__(
        self, count: int, height: int | None = None, *, is_base_fixed: bool = True, order_varies: bool = False
    ) -> None:
        """Compile the scene.

        Args:
            count: number of bricks on the table.
            height: number of bricks in the wanted stack; None for all.
            is_base_fixed: whether the bottom brick of the stack stands still.
            order_varies: whether the wanted order is drawn, and observed.
        """
        super().__init__(
            count,
            count if height is None else height,
            is_base_fixed=is_base_fixed,
            order_varies=order_varies,
            close_weight=_CLOSE_WEIGHT,
        )

    def _initialize(self, random_state: RandomState) -> Asking[Array]:
        order = np.arange(self.height)
        if self._order_varies:
            order = random_state.choice(self.count, self.height, replace=False)
        goal, slots = self._goal(order, int(order[0]))
        placer = self._placers.get(int(order[0]))
        if placer is None:
            roles = [self.bricks[slot] for slot in slots]
            placer = self._placers[int(order[0])] = PropPlacer(
                roles, uniform_box(*BRICK_BOX), ANY_YAW, settle_physics=True
            )
        placer(self.physics, random_state)
        yield from self._place_robot(random_state)
        self._show_hints(order, random_state)
        return goal

    def _add_props(self) -> None:
        super()._add_props()
        self._placers: dict[int, PropPlacer] = {}
