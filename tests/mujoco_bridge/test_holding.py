"""What the hand holds stays where it is held: grasped, lifted, and looked at for as long as a minute."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

import jacokin.tasks
from jacokin.arrays import Array
from jacokin.mujoco_bridge import Arena, Physics, Primitive, command_joint_positions
from jacokin.tasks import Task, TaskEnv
from tests.mujoco_bridge.scenes import jaco_parts

SHAPES = {  # kind, size [m], mass [kg], height of the middle above the floor [m]
    "cube": ("box", (0.02, 0.02, 0.02), 0.05, 0.02),
    "heavy cube": ("box", (0.02, 0.02, 0.02), 0.3, 0.02),
    "cup": ("cylinder", (0.025, 0.05), 0.1, 0.05),
    "ball": ("sphere", (0.025,), 0.06, 0.025),
}
ABOVE, GRASP, LIFTED = 0.15, 0.01, 0.1  # [m]
STEPS, CONTROL_STEP = 20, 0.04  # physics steps of a control step, [s]
SQUEEZE, SETTLING = 1.0, 2.0  # [rad/s], [s] after which it is to stand still
CREEP, TURN = 1e-4, 0.2  # [m], [deg] in a minute


def moved(before: tuple[Array, Array], after: tuple[Array, Array]) -> tuple[float, float]:
    """How far one pose is from another [m], [deg]."""
    cosine = 0.5 * (np.trace(before[1].T @ after[1]) - 1.0)
    return float(np.linalg.norm(after[0] - before[0])), float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def held(shape: str, contact: str, seconds: float) -> tuple[float, float]:
    """How far something moves in the hand [m], [deg]."""
    kind, size, mass, height = SHAPES[shape]
    prop = Primitive(kind, size, mass=mass, name="prop")
    arena, arm, hand = jaco_parts(arena=Arena(contact=contact))
    arena.add_free_entity(prop, position=(0.0, 0.0, height))
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    copy, waypoints = physics.copy(), []
    for up in (ABOVE, 0.0):
        goal = (0.0, 0.0, height + GRASP + up)
        assert arm.set_site_to_xpos(copy, np.random.default_rng(0), hand.pinch_site, goal)
        waypoints.append(copy.bind(arm.joints).qpos.copy())
    above, at = waypoints

    def go(q: Array, squeeze: float, duration: float) -> None:
        for _ in range(round(duration / CONTROL_STEP)):
            command_joint_positions(physics, arm, q)
            physics.bind(hand.actuators).ctrl = squeeze
            physics.step(STEPS)

    def pose() -> tuple[Array, Array]:
        site, geom = physics.bind(hand.pinch_site), physics.bind(prop.geom)
        rotation = np.array(site.xmat).reshape(3, 3).T
        return rotation @ (geom.xpos - site.xpos), rotation @ np.array(geom.xmat).reshape(3, 3)

    go(above, 0.0, 4.0)
    go(at, 0.0, 2.5)
    go(at, SQUEEZE, 1.5)
    go(above, SQUEEZE, 3.0 + SETTLING)
    assert physics.bind(prop.geom).xpos[2] > height + LIFTED
    before = pose()
    go(above, SQUEEZE, seconds)
    return moved(before, pose())


def test_a_cube_stays_where_it_is_held() -> None:
    """Also that without the options it would not: the test sees what it looks for."""
    creep, turn = held("cube", "firm", 10.0)
    assert creep < CREEP / 6.0
    assert turn < TURN / 6.0
    assert held("cube", "dm_control", 10.0)[0] > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
def test_things_stay_where_they_are_held_for_a_minute(shape: str) -> None:
    creep, turn = held(shape, "firm", 60.0)
    assert creep < CREEP
    assert turn < TURN


def in_hand(observation: dict[str, NDArray[Any]]) -> tuple[Array, Array]:
    """Pose of the brick in the pinch site, of what is observed."""
    site, brick, w = "jaco_arm/jaco_hand/pinch_site", "duplo2x4", np.zeros(9)
    mujoco.mju_quat2Mat(w, observation[f"{brick}/orientation"])
    rotation = observation[f"{site}_rmat"].reshape(3, 3).T
    return rotation @ (observation[f"{brick}/position"] - observation[f"{site}_pos"]), rotation @ w.reshape(3, 3)


@pytest.mark.slow
@pytest.mark.parametrize("contact", ["firm", "dm_control"])
def test_a_brick_of_a_task_stays_where_it_is_held(contact: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the expert, after it has lifted it, for a minute."""
    lifting, holding = round(12.0 / CONTROL_STEP), round(60.0 / CONTROL_STEP)
    monkeypatch.setattr(Task, "time_limit", (lifting + holding) * CONTROL_STEP)
    env, expert = TaskEnv("lift_brick", flatten=False, contact=contact), jacokin.tasks.expert("lift_brick")
    observation, info = env.reset(seed=0)
    expert.reset(seed=0)
    for step in range(lifting + holding):
        observation, _, _, _, info = env.step(expert(observation))
        assert isinstance(observation, dict)
        if step == lifting:
            before = in_hand(observation)
    assert info["is_success"]
    assert isinstance(observation, dict)
    creep, turn = moved(before, in_hand(observation))
    assert creep < CREEP
    assert turn < TURN
