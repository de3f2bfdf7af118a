"""The initializer that places the tool centre point free of collisions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from jacokin.errors import InvalidInputError, PhysicsError
from jacokin.mujoco_bridge import DOWN_QUATERNION, Arena, JacoArm, JacoHand, Physics
from jacokin.mujoco_bridge.control.initializers import TcpInitializer
from jacokin.mujoco_bridge.distributions import uniform_box
from jacokin.mujoco_bridge.props import Primitive
from tests.mujoco_bridge.scenes import jaco_parts

BOX = ((-0.2, -0.2, 0.02), (0.2, 0.2, 0.4))  # [m]
REACHED = 1e-6  # [m]


def scene(*walls: tuple[tuple[float, float, float], tuple[float, float, float]]) -> tuple[Physics, JacoArm, JacoHand]:
    """The arm, a free cube near its path, and walls: half-lengths and position each [m]."""
    arena, arm, hand = jaco_parts()
    arena.add_free_entity(Primitive(name="cube"), position=(0.0, 0.0, 0.1))
    for number, (size, position) in enumerate(walls):
        arena.attach(Primitive("box", size, name=f"wall_{number}"), position=position)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    return physics, arm, hand


def robot_contacts(physics: Physics) -> list[tuple[str, str]]:
    """Contacts between the arm and itself, its hand, or what does not move; judged by names."""
    physics.forward()
    found = []
    for contact in physics.data.contact:
        pair = tuple(physics.model.geom(geom).name for geom in (contact.geom1, contact.geom2))
        robot = [name.startswith("jaco_arm/") for name in pair]
        hand = [name.startswith("jaco_arm/jaco_hand/") for name in pair]
        if any(robot) and not all(hand) and not any("cube" in name for name in pair) and contact.dist <= 0.0:
            found.append(pair)
    return found


@pytest.mark.parametrize("kind", [np.random.RandomState, np.random.default_rng])
def test_poses_are_reached_free_of_collisions(kind: Any) -> None:
    physics, arm, hand = scene()
    initializer = TcpInitializer(hand, arm, uniform_box(*BOX))
    rng = kind(0)
    fingers = physics.bind(hand.joints).qpos.copy()
    positions = []
    for _ in range(60):
        initializer(physics, rng)
        site = physics.bind(hand.pinch_site)
        positions.append(site.xpos.copy())
        assert (site.xpos >= np.array(BOX[0]) - REACHED).all()
        assert (site.xpos <= np.array(BOX[1]) + REACHED).all()
        np.testing.assert_allclose(site.xmat.reshape(3, 3)[:, 2], (0.0, 0.0, -1.0), atol=REACHED)
        assert robot_contacts(physics) == []
    assert np.std(positions, axis=0).min() > 0.05
    np.testing.assert_array_equal(physics.bind(hand.joints).qpos, fingers)


def test_other_branches_are_tried_before_another_pose() -> None:
    """One fixed pose with something in the way of the nearest branch: the random state is not asked again."""
    goal = (-0.04, 0.03, 0.4)
    physics, arm, hand = scene()
    assert arm.set_site_to_xpos(physics, np.random.default_rng(0), hand.pinch_site, goal)
    nearest = physics.bind(arm.joints).qpos.copy()
    x, y, z = physics.data.body("jaco_arm/link_4").xpos.tolist()
    walled, arm, hand = scene(((0.02, 0.02, 0.02), (x, y, z)))
    asked = []

    def position(random_state: Any) -> Any:
        asked.append(1)
        return goal

    TcpInitializer(hand, arm, position)(walled, np.random.default_rng(0))
    assert len(asked) == 1
    np.testing.assert_allclose(walled.bind(hand.pinch_site).xpos, goal, atol=REACHED)
    assert robot_contacts(walled) == []
    assert np.abs(walled.bind(arm.joints).qpos - nearest).max() > 0.1
    TcpInitializer(hand, arm, goal, ignore_collisions=True)(walled, np.random.default_rng(0))


def test_without_a_hand_the_wrist_is_placed() -> None:
    arm, arena = JacoArm(), Arena()
    arena.attach(arm)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    turned = (0.0, 1.0, 0.0, 0.0)
    TcpInitializer(None, arm, (0.3, 0.1, 0.4), turned)(physics, np.random.default_rng(0))
    np.testing.assert_allclose(physics.bind(arm.wrist_site).xpos, (0.3, 0.1, 0.4), atol=REACHED)
    np.testing.assert_allclose(physics.bind(arm.wrist_site).xmat, (1, 0, 0, 0, -1, 0, 0, 0, -1), atol=REACHED)


def test_failure_is_an_error_and_changes_nothing() -> None:
    physics, arm, hand = scene()
    before = physics.get_state().tobytes()
    asked = []

    def position(random_state: Any) -> Any:
        asked.append(random_state)
        return (0.0, 0.0, 3.0)

    with pytest.raises(PhysicsError, match="none of 7 poses"):
        TcpInitializer(hand, arm, position, max_rejection_samples=7)(physics, np.random.default_rng(0))
    assert len(asked) == 7
    with pytest.raises(PhysicsError, match="none of 10 poses"):  # in the floor
        TcpInitializer(hand, arm, (0.0, 0.1, -0.1))(physics, np.random.default_rng(0))
    assert physics.get_state().tobytes() == before


def test_bad_arguments() -> None:
    physics, arm, hand = scene()
    for wrong in (
        lambda: TcpInitializer(arm, arm, (0.0, 0.0, 0.3)),  # type: ignore[arg-type]
        lambda: TcpInitializer(hand, hand, (0.0, 0.0, 0.3)),  # type: ignore[arg-type]
        lambda: TcpInitializer(hand, arm, (0.0, 0.0, 0.3), max_ik_attempts=0),
        lambda: TcpInitializer(hand, arm, (0.0, 0.0, 0.3), max_rejection_samples=0),
        lambda: uniform_box((0.0, 0.0, 1.0), (1.0, 1.0, 0.0)),
        lambda: uniform_box((0.0, 0.0), (1.0, 1.0)),
        lambda: TcpInitializer(hand, arm, (0.0, 0.3))(physics, np.random.default_rng(0)),
        lambda: TcpInitializer(hand, arm, (0.0, 0.0, 0.3), lambda r: (0.0,) * 4)(physics, np.random.default_rng(0)),
    ):
        with pytest.raises(InvalidInputError):
            wrong()
    assert DOWN_QUATERNION.shape == (4,)
