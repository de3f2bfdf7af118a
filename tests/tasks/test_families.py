"""Rewards and successes at states whose values are computed by hand, of one simulation and of several."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin.tasks
from jacokin.arrays import Array
from jacokin.tasks.families import LiftBrick, PlaceBrick, ReachBrick, ReachSite, Stack
from jacokin.tasks.features import StateView
from jacokin.tasks.registry import TASKS
from jacokin.tasks.task import Task
from tests.tasks.families_sample import slow_but

ORIGIN = np.zeros(3)


def rewards(task: Task, achieved: Array, desired: Array) -> list[float]:
    """The rewards (n,) of rows, which single rows have too."""
    found = task.reward(achieved, desired)
    singles = [task.reward(one, other) for one, other in zip(achieved, desired, strict=True)]
    np.testing.assert_array_equal(found, singles)
    return list(found.tolist())


def put_prop(task: Task, start: int, position: tuple[float, float, float]) -> StateView:
    """Move a free prop, whose position in qpos starts there, and give a view of the state."""
    task.physics.data.qpos[start : start + 3] = position
    task.physics.forward()
    return StateView.of(task.physics.data)


def test_reaching_falls_along_a_gaussian() -> None:
    """1 up to 0.05 m, 0.1 at 0.1 m, 0.1^4 at 0.15 m: the distance beyond 0.05 m, in units of 0.05 m, squared."""
    task = ReachSite()
    achieved = np.array([[0.0, 0.0, 0.0], [0.05, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.15]])
    assert rewards(task, achieved, np.zeros((4, 3))) == pytest.approx([1.0, 1.0, 0.1, 1e-4])
    assert task.success(achieved, np.zeros((4, 3))).tolist() == [True, True, False, False]


def test_reaching_compares_the_pinch_site_with_the_brick() -> None:
    task = ReachBrick()
    view = put_prop(task, task._position.start, (0.03, -0.04, 0.5))
    np.testing.assert_array_equal(task.desired(view, np.empty(0)), [0.03, -0.04, 0.5])
    pinch = task.physics.bind(task.hand.tool_center_point).xpos
    np.testing.assert_array_equal(task.achieved(view, np.empty(0)), pinch)


def test_lifting_grows_with_the_height_of_the_lowest_corner() -> None:
    task = LiftBrick()
    achieved, desired = np.array([[0.0], [0.15], [0.3], [0.4], [-0.1]]), np.full((5, 1), 0.3)
    assert rewards(task, achieved, desired) == pytest.approx([0.0, 0.5, 1.0, 1.0, 0.0])
    assert task.success(achieved, desired).tolist() == [False, False, True, True, False]
    joint = task.prop.freejoint
    assert joint is not None
    start = int(task.physics.model.jnt_qposadr[joint.id])
    low, high = (float(task.achieved(put_prop(task, start, (0.0, 0.0, z)), np.empty(0))[0]) for z in (0.0, 0.25))
    assert high - low == pytest.approx(0.25)


def test_placing_has_ten_parts_for_the_brick_and_one_for_the_hand() -> None:
    """With the long tail 1 / (1 + 9 d^2), d in units of 0.05 m beyond 0.05 m (0.15 m for the hand that is too near)."""
    task = PlaceBrick()
    far = [1.0, 0.0, 0.0]
    beyond = (1.0 - 0.05) / 0.05
    tail = 1.0 / (1.0 + 9.0 * beyond**2)
    achieved = np.array([[*ORIGIN, *far], [*ORIGIN, *ORIGIN], [*far, *far]])
    at_target = 1.0 / (1.0 + 9.0 * (0.2 / 0.15) ** 2)  # of the hand, 0.2 m too near
    wanted = [
        (1.0 + 10.0) / 11.0,  # in place, and the hand away
        (at_target + 10.0) / 11.0,  # in place, but the hand is there
        (1.0 * (1.0 - tail) + 1.0 * tail + 10.0 * tail) / 11.0,  # grasped elsewhere, where the hand is away
    ]
    desired = np.array([[*ORIGIN, *elsewhere] for elsewhere in (ORIGIN, far, far)])  # of the hand, it does not count
    assert rewards(task, achieved, desired) == pytest.approx(wanted)
    assert task.success(achieved, desired).tolist() == [True, False, False]


@pytest.mark.parametrize("name", slow_but(TASKS, ["reach_site", "place_brick"]))
def test_what_is_desired_would_solve_the_task_if_it_were_achieved(name: str) -> None:
    """So goals of both kinds are of one space, as hindsight replay needs them."""
    env = jacokin.tasks.TaskEnv(name, goal=True)
    observation, _ = env.reset(seed=0)
    assert isinstance(observation, dict)
    desired = observation["desired_goal"]
    assert desired.shape == observation["achieved_goal"].shape
    assert env.compute_reward(desired, desired) == pytest.approx(1.0, abs=1e-12)
    assert env.task.success(desired, desired)


def test_stacking_counts_pairs_that_are_close_and_that_click() -> None:
    """Clicked within 1 mm, 0.1 at 2 mm; close within 1 cm, 0.1 at 11 cm, with a tenth of the weight."""
    task = Stack(3)
    achieved = np.array([[0.0, 0.001], [0.002, 0.0], [0.11, 0.11]])
    wanted = [1.0, ((0.1 + 0.1) / 1.1 + 1.0) / 2.0, 0.1 * 0.1 / 1.1]
    assert rewards(task, achieved, np.zeros((3, 2))) == pytest.approx(wanted)
    assert task.success(achieved, np.zeros((3, 2))).tolist() == [True, False, False]


@pytest.mark.parametrize("turn", [0.0, np.pi])
def test_stacked_bricks_are_together_turned_by_half_or_not(turn: float) -> None:
    task = Stack(2)
    physics, (below, above) = task.physics, task.bricks
    below.set_pose(physics, [0.1, 0.0, 0.0])
    above.set_pose(physics, [0.1, 0.0, 0.0], [np.cos(turn / 2.0), 0.0, 0.0, np.sin(turn / 2.0)])
    # Of two opposite studs in two opposite holes, the sum of the distances.
    sites = (below.studs[0, 0], above.holes[0, 0] if turn == 0.0 else above.holes[-1, -1])
    apart = np.subtract(*(physics.bind(site).xpos.copy() for site in sites))
    above.set_pose(physics, np.array([0.1, 0.0, 0.0]) + apart + (0.0, 0.0, 0.02))
    goal, _ = task._goal(np.arange(2), 0)
    physics.forward()
    view = StateView.of(physics.data)
    assert task.achieved(view, goal) == pytest.approx([0.04], abs=1e-9)
