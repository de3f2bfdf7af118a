"""`Stack` and `Reassemble`, tasks with several bricks: roles, wanted orders, distances of studs and holes.

All bricks are equal, so the one that stands still is always the first of the scene. When an episode wants another
brick there, the two exchange their roles: colours and names of observations. No scene is compiled anew.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.mujoco_bridge import Brick, PropPlacer
from jacokin.mujoco_bridge.base import RandomState
from jacokin.mujoco_bridge.control.site_ik import Asking
from jacokin.mujoco_bridge.distributions import uniform_box
from jacokin.mujoco_bridge.entity import quaternion_product
from jacokin.mujoco_bridge.rewards import fall_beyond
from jacokin.mujoco_bridge.workspaces import BoundingBox
from jacokin.tasks import features
from jacokin.tasks.features import Feature, StateView, ids, length, take_rows
from jacokin.tasks.task import ANY_YAW, BRICK, Task

TOUCHING = 1e-6  # [m] above the table
BRICK_BOX = BoundingBox((-0.1, -0.1, TOUCHING), (0.1, 0.1, TOUCHING))
CLOSE, CLOSE_MARGIN = 0.01, 0.1  # [m]
CLICK, CLICK_MARGIN = 0.001, 0.001  # [m]
_HINT_POSITION = (0.2, 0.1, 0.0)  # [m]
_HINT_QUATERNION = (-0.38268343, 0.0, 0.0, 0.92387953)  # wxyz, -135 deg about z
_HALF_TURN = np.array((0.0, 0.0, 0.0, 1.0))  # about z, wxyz
_COLORS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 0.0))
_BASE_POSITION = uniform_box(*BRICK_BOX)

Indices = NDArray[np.intp]


class BrickTask(Task):
    """Bricks are to be stacked in a wanted order.

    The goal of an episode is the wanted order, from bottom to top, followed by the place of each brick in the scene.

    Attributes:
        count: number of bricks.
        height: number of bricks in the wanted stack.
        bricks: the bricks in the scene.
        close_weight: weight of the reward for bricks that are close, that for bricks that click together being 1.
    """

    tool_box = BoundingBox((-0.1, -0.1, 0.15), (0.1, 0.1, 0.4))

    close_weight = 0.0

    def __init__(
        self, count: int, height: int | None = None, *, is_base_fixed: bool = True, order_varies: bool = False
    ) -> None:
        """Compile the scene.

        Args:
            count: number of bricks on the table, at most 6.
            height: number of bricks in the wanted stack; None for all.
            is_base_fixed: whether the bottom brick of the stack stands still.
            order_varies: whether orders are drawn, and the wanted one is observed.
        """
        self.count, self.height = count, count if height is None else height
        self._is_base_fixed, self._order_varies = is_base_fixed, order_varies
        self.goal_size = self.height + count
        self._placers: dict[int, PropPlacer] = {}
        super().__init__()

    def build(self) -> None:
        """Add the bricks, and translucent ones that show the wanted stack."""
        # dm_control numbers bricks and hints in turn, and observes the former.
        names = [BRICK, *(f"{BRICK}_{number}" for number in range(1, 2 * self.count))]
        self.bricks: list[Brick] = []
        self.hints: list[Brick] = []
        for number in range(self.count):
            prop = Brick(name=names[2 * number], color=_COLORS[number])
            if number == 0 and self._is_base_fixed:
                self.add_fixed(prop)
            else:
                self.add_free(prop)
            hint = Brick(name=names[2 * number + 1], color=_COLORS[number], hint=True)
            self.add_fixed(hint)
            self.bricks.append(prop)
            self.hints.append(hint)

    def observe(self, own: list[Feature]) -> list[Feature]:
        """Those of the bricks by their roles, and the wanted order where it varies."""
        physics = self.physics
        self._studs, self._holes = (
            np.array([ids(physics, [grid[0, 0], grid[-1, -1]]) for grid in grids], dtype=np.intp)
            for grids in ([each.studs for each in self.bricks], [each.holes for each in self.bricks])
        )
        geoms = physics.model.geom_bodyid
        self._geoms = [geoms == ids(physics, each.root_body)[0] for each in self.bricks]
        if not self._order_varies:
            self._fixed_pairs = self._pairs_of(self._usual_order(), np.arange(self.count))
            return own + [each for prop in self.bricks for each in features.prop_features(physics, prop)]
        order = Feature("desired_order", (self.height,), lambda view, goal: goal[..., : self.height])
        return [order, *own, *features.role_features(physics, self.bricks, self._slot)]

    def _usual_order(self) -> Indices:
        """The wanted order if none is drawn."""
        return np.arange(self.height)

    def _slot(self, goal: Array, role: int) -> Indices:
        return np.asarray(goal[..., self.height + role], dtype=np.intp)

    def _goal(self, order: Indices, base: int) -> tuple[Array, Indices]:
        """The goal of an episode, and the places of the bricks when `base` is the first in the scene."""
        slots = np.arange(self.count)
        if self._is_base_fixed:
            slots[[0, base]] = slots[[base, 0]]
        goal = np.concatenate((order, slots)).astype(np.float64)
        return goal, slots

    def show_goal(self, goal: Array) -> None:
        """Give the bricks the colours of their roles."""
        colors = self.physics.model.geom_rgba
        for role in range(self.count if len(goal) else 0):
            colors[self._geoms[self._slot(goal, role)], :3] = _COLORS[role]

    def _build_stack(
        self,
        bricks: Sequence[Brick],
        position: Array,
        quat_wxyz: Array,
        random_state: RandomState,
    ) -> None:
        """Stack bricks in this order, each turned by 180 deg or not relative to the one below."""
        physics = self.physics
        bricks[0].set_pose(physics, position, quat_wxyz)
        for below, above in itertools.pairwise(bricks):
            stud = physics.bind(below.studs[0, 0]).xpos.copy()
            _, turn = below.get_pose(physics)
            is_turned = bool(random_state.uniform() < 0.5)
            hole = above.holes[(-1, -1) if is_turned else (0, 0)]
            above.set_pose(physics, np.zeros(3), quaternion_product(turn, _HALF_TURN) if is_turned else turn)
            above.set_pose(physics, stud - physics.bind(hole).xpos)

    def _show_hints(self, order: Indices, random_state: RandomState) -> None:
        for role in set(range(self.count)) - set(order.tolist()):
            self.hints[role].set_pose(self.physics, np.zeros(3))  # dm_control's pictures show them there
        self._build_stack(
            [self.hints[k] for k in order], np.array(_HINT_POSITION), np.array(_HINT_QUATERNION), random_state
        )

    def _pairs_of(self, order: Indices, slots: Indices) -> tuple[Indices, Indices]:
        """Sites at two opposite studs of each lower, and holes of each upper brick, (..., 2 (height - 1))."""
        placed = np.take_along_axis(slots, order, axis=-1)
        below, above = self._studs[placed[..., :-1]], self._holes[placed[..., 1:]]
        return below.reshape(*below.shape[:-2], -1), above.reshape(*above.shape[:-2], -1)

    def achieved(self, view: StateView, goal: Array) -> Array:
        """For each pair of neighbours in the wanted order how far studs and holes are apart, (..., height - 1) [m].

        The sum of the distances of two opposite studs and holes, the smaller for the brick turned by 180 deg or not.
        """
        if self._order_varies:
            whole = goal.astype(np.intp)
            studs, holes = self._pairs_of(whole[..., : self.height], whole[..., self.height :])
        else:
            studs, holes = self._fixed_pairs
        stud, hole = take_rows(view.site_xpos, studs), take_rows(view.site_xpos, holes)
        pairs = (*stud.shape[:-2], self.height - 1, 2, 3)
        stud, hole = stud.reshape(pairs), hole.reshape(pairs)
        straight = length(stud - hole)
        turned = length(stud[..., ::-1, :] - hole)
        return np.minimum(straight[..., 0] + straight[..., 1], turned[..., 0] + turned[..., 1])

    def desired(self, view: StateView, goal: Array) -> Array:
        """Zeros, (..., height - 1) [m]: all pairs together."""
        return np.zeros((*view.qpos.shape[:-1], self.height - 1))

    def reward(self, achieved: Array, desired: Array) -> Array:
        """The mean over the pairs of how close they are, and how closely they click together."""
        distance = np.abs(achieved - desired)
        clicked = fall_beyond(distance - CLICK, CLICK_MARGIN, "gaussian")
        if self.close_weight:
            close = fall_beyond(distance - CLOSE, CLOSE_MARGIN, "gaussian")
            clicked = (self.close_weight * close + clicked) / (1.0 + self.close_weight)
        return np.asarray(clicked.mean(axis=-1))

    def success(self, achieved: Array, desired: Array) -> Array:
        """Whether all pairs click together: distances within 1 mm."""
        return np.asarray((np.abs(achieved - desired) <= CLICK).all(axis=-1))


class Stack(BrickTask):
    """Stack bricks on one another."""

    close_weight = 0.1

    def initialize(self, random_state: RandomState) -> Asking[Array]:
        """Scatter the bricks, place the robot, show the wanted stack."""
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
        yield from self.place_robot(random_state)
        self._show_hints(order, random_state)
        return goal


class Reassemble(BrickTask):
    """Take a stack apart and build another on its bottom brick: in reverse order, or in one that is drawn."""

    def _usual_order(self) -> Indices:
        return _rebuilt(np.arange(self.count))

    def initialize(self, random_state: RandomState) -> Asking[Array]:
        """Build a stack, show the wanted one, place the robot."""
        initial = np.arange(self.count)
        if self._order_varies:
            random_state.shuffle(initial)
        wanted = _rebuilt(initial)
        if self._order_varies:
            random_state.shuffle(wanted[1:])
        goal, slots = self._goal(wanted, int(initial[0]))
        position = np.asarray(_BASE_POSITION(random_state=random_state))
        quat_wxyz = np.asarray(ANY_YAW(random_state=random_state))
        self._build_stack([self.bricks[slots[k]] for k in initial], position, quat_wxyz, random_state)
        self._show_hints(wanted, random_state)
        yield from self.place_robot(random_state)
        return goal


def _rebuilt(order: Indices) -> Indices:
    """The reverse of an order above its first."""
    return np.concatenate((order[:1], order[:0:-1]))
