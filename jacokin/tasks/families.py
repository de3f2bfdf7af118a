"""The tasks: the hand at a place, a prop lifted, a brick on a pedestal, bricks stacked. Read `ReachSite` first."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.model import checks
from jacokin.mujoco_bridge import Brick, Cradle, Pedestal, PropPlacer, large_box, workspaces
from jacokin.mujoco_bridge.base import RandomState
from jacokin.mujoco_bridge.distributions import uniform_box
from jacokin.mujoco_bridge.entity import Entity, quaternion_product
from jacokin.mujoco_bridge.props import FreeProp
from jacokin.mujoco_bridge.rewards import fall_beyond
from jacokin.mujoco_bridge.workspaces import BoundingBox
from jacokin.tasks import features
from jacokin.tasks.features import Feature, StateView, ids, length, take_rows
from jacokin.tasks.task import ANY_YAW, ATTEMPTS, BRICK, LYING, Task, position_in_qpos

RADIUS = 0.05  # [m] of the target
AWAY = 4.0 * RADIUS  # [m] of the hand from a target at which something was put
LIFTED = 0.3  # [m]
TOUCHING = 1e-6  # [m] above the table
CLICKED = 0.001  # [m] of studs and holes from each other
BRICK_BOX = BoundingBox((-0.1, -0.1, TOUCHING), (0.1, 0.1, TOUCHING))
CORNERS = {
    name: BoundingBox((x, y, LYING), (x, y, LYING))
    for name, (x, y) in {
        "top_left": (-0.09, 0.09),
        "top_right": (0.09, 0.09),
        "bottom_left": (-0.09, -0.09),
        "bottom_right": (0.09, -0.09),
    }.items()
}
"""Boxes that place the brick of `ReachBrick` at a corner of the usual one."""

_COLORS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 0.0))

Indices = NDArray[np.intp]


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

    tool_box = BoundingBox((-0.2, -0.2, 0.02), (0.2, 0.2, 0.4))

    def build(self) -> None:
        """Add the site."""
        body = self.arena.mjcf_model.worldbody.add_body(name="target", mocap=True)
        workspaces.add_target_site(body, RADIUS, visible=True, name="target")
        self._target = uniform_box(*ReachSite.tool_box)

    def observe(self, own: list[Feature]) -> list[Feature]:
        """The position of the site before those of the robot."""
        return [Feature("target_position", (3,), self.desired), *own]

    def initialize(self, random_state: RandomState) -> Array:
        """Place the robot, then the site."""
        self.place_robot(random_state)
        self.physics.data.mocap_pos[0] = self._target(random_state=random_state)
        return np.empty(0)

    def desired(self, view: StateView, goal: Array) -> Array:
        """Position of the site, (..., 3) [m]."""
        return view.mocap_pos[..., 0, :]


class ReachBrick(_ReachTask):
    """Reach a brick on the table."""

    def __init__(self, brick_box: BoundingBox = Task.prop_box) -> None:
        """Compile the scene.

        Args:
            brick_box: where the brick is placed.
        """
        brick = Brick(name=BRICK)
        self._place_brick = PropPlacer([brick], uniform_box(*brick_box), ANY_YAW, settle_physics=True)
        super().__init__(props=[brick])
        self._position = position_in_qpos(self.physics, brick)

    def initialize(self, random_state: RandomState) -> Array:
        """Place the robot, then the brick."""
        self.place_robot(random_state)
        self._place_brick(self.physics, random_state)
        return np.empty(0)

    def desired(self, view: StateView, goal: Array) -> Array:
        """Position of the brick, (..., 3) [m]."""
        return view.qpos[..., self._position]


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

    def initialize(self, random_state: RandomState) -> Array:
        """Open the hand, place the prop, then the tool; the goal is the height to reach."""
        self.hand.set_grasp(self.physics, float(random_state.uniform()))
        self._place_prop(self.physics, random_state)
        self.place_tool(random_state)
        return self._lowest(StateView.of(self.physics.data))[None] + LIFTED

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
        return fall_beyond((desired - achieved)[..., 0], LIFTED, "linear", 0.0)

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
        super().__init__(large_box("unnamed_model"), height=0.09)  # as dm_control observes it; half its edge [m]


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
        self._place_pedestal = PropPlacer([self.pedestal], uniform_box((-0.1, -0.1, 0.07), (0.1, 0.1, 0.17)))
        super().__init__(props=[prop], fixtures=[self.pedestal])
        self._position = position_in_qpos(self.physics, prop)

    def initialize(self, random_state: RandomState) -> Array:
        """Place the pedestal, the robot, then the prop."""
        self._place_pedestal(self.physics, random_state, ignore_contacts_with_entities=self.props)
        self.place_robot(random_state)
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
        return np.concatenate((target, target + np.array((0.0, 0.0, AWAY + RADIUS))), axis=-1)

    def reward(self, achieved: Array, desired: Array) -> Array:
        """Ten parts for the brick in place; one for the hand at the brick or, once that is in place, away.

        Where away from the target the hand is desired does not count.
        """
        prop, tool, target = achieved[..., :3], achieved[..., 3:], desired[..., :3]
        grasped = fall_beyond(length(prop - tool) - RADIUS, RADIUS, "long_tail")
        in_place = fall_beyond(length(prop - target) - RADIUS, RADIUS, "long_tail")
        away = fall_beyond(AWAY - length(tool - target), 3.0 * RADIUS, "long_tail")
        return (grasped * (1.0 - in_place) + away * in_place + 10.0 * in_place) / 11.0

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


class BrickTask(Task):
    """Bricks are to be stacked in a wanted order.

    All bricks are equal, so the one that stands still is always the first of the scene. When an episode wants another
    brick there, the two exchange their roles: colours and names of observations. No scene is compiled anew.

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
            half_turn = np.array((0.0, 0.0, 0.0, 1.0))  # about z, wxyz
            above.set_pose(physics, np.zeros(3), quaternion_product(turn, half_turn) if is_turned else turn)
            above.set_pose(physics, stud - physics.bind(hole).xpos)

    def _show_hints(self, order: Indices, random_state: RandomState) -> None:
        for role in set(range(self.count)) - set(order.tolist()):
            self.hints[role].set_pose(self.physics, np.zeros(3))  # dm_control's pictures show them there
        position = np.array((0.2, 0.1, 0.0))  # [m]
        quat_wxyz = np.array((-0.38268343, 0.0, 0.0, 0.92387953))  # -135 deg about z
        self._build_stack([self.hints[k] for k in order], position, quat_wxyz, random_state)

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
        clicked = fall_beyond(distance - CLICKED, CLICKED, "gaussian")
        if self.close_weight:
            close = fall_beyond(distance - 0.01, 0.1, "gaussian")  # [m]
            clicked = (self.close_weight * close + clicked) / (1.0 + self.close_weight)
        return np.asarray(clicked.mean(axis=-1))

    def success(self, achieved: Array, desired: Array) -> Array:
        """Whether all pairs click together: distances within 1 mm."""
        return np.asarray((np.abs(achieved - desired) <= CLICKED).all(axis=-1))


class Stack(BrickTask):
    """Stack bricks on one another."""

    close_weight = 0.1

    def initialize(self, random_state: RandomState) -> Array:
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
        self.place_robot(random_state)
        self._show_hints(order, random_state)
        return goal


class Reassemble(BrickTask):
    """Take a stack apart and build another on its bottom brick: in reverse order, or in one that is drawn."""

    def _usual_order(self) -> Indices:
        return _rebuilt(np.arange(self.count))

    def initialize(self, random_state: RandomState) -> Array:
        """Build a stack, show the wanted one, place the robot."""
        initial = np.arange(self.count)
        if self._order_varies:
            random_state.shuffle(initial)
        wanted = _rebuilt(initial)
        if self._order_varies:
            random_state.shuffle(wanted[1:])
        goal, slots = self._goal(wanted, int(initial[0]))
        position = np.asarray(uniform_box(*BRICK_BOX)(random_state=random_state))
        quat_wxyz = np.asarray(ANY_YAW(random_state=random_state))
        self._build_stack([self.bricks[slots[k]] for k in initial], position, quat_wxyz, random_state)
        self._show_hints(wanted, random_state)
        self.place_robot(random_state)
        return goal


def _rebuilt(order: Indices) -> Indices:
    """The reverse of an order above its first."""
    return np.concatenate((order[:1], order[:0:-1]))
