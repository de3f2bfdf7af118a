"""Reassembling: a stack of bricks is to be taken apart and stacked in another order."""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.mujoco_bridge.base import RandomState
from jacokin.mujoco_bridge.control.queries import Asking
from jacokin.mujoco_bridge.distributions import uniform_box
from jacokin.tasks.families.bricks import BRICK_BOX, BrickTask, Indices
from jacokin.tasks.task import ANY_YAW


class Reassemble(BrickTask):
    """Take a stack apart and build another on its bottom brick: in reverse order, or in one that is drawn."""

    def __init__(self, count: int, *, order_varies: bool = False) -> None:
        """Compile the scene.

        Args:
            count: number of bricks.
            order_varies: whether the orders of both stacks are drawn, and the wanted one is observed.
        """
        super().__init__(count, count, is_base_fixed=True, order_varies=order_varies, close_weight=0.0)

    def _usual_order(self) -> Indices:
        return _rebuilt(np.arange(self.count))

    def _initialize(self, random_state: RandomState) -> Asking[Array]:
        initial = np.arange(self.count)
        if self._order_varies:
            random_state.shuffle(initial)
        wanted = _rebuilt(initial)
        if self._order_varies:
            random_state.shuffle(wanted[1:])
        goal, slots = self._goal(wanted, int(initial[0]))
        position = np.asarray(self._base_position(random_state=random_state))
        quat_wxyz = np.asarray(ANY_YAW(random_state=random_state))
        self._build_stack([self.bricks[slots[k]] for k in initial], position, quat_wxyz, random_state)
        self._show_hints(wanted, random_state)
        yield from self._place_robot(random_state)
        return goal

    def _add_props(self) -> None:
        super()._add_props()
        self._base_position = uniform_box(*BRICK_BOX)


def _rebuilt(order: Indices) -> Indices:
    """The reverse of an order above its first."""
    return np.concatenate((order[:1], order[:0:-1]))
