"""The placer of props: free of contacts, at rest, everything else held still, nothing changed on failure."""

from __future__ import annotations

import itertools
import logging
from typing import Any

import numpy as np
import pytest

from jacokin.errors import EpisodeInitializationError, InvalidInputError
from jacokin.mujoco_bridge import Arena, JacoArm, JacoHand, Physics, Primitive, PropPlacer, robots, uniform_box
from jacokin.mujoco_bridge.distributions import QuaternionFromAxisAngle, Uniform

RADIUS = 0.02  # [m]
BOX = ((-0.1, -0.1, 0.03), (0.1, 0.1, 0.06))  # [m]
AT_REST = (1e-3, 1e-2)  # [m/s, rad/s], [m/s^2, rad/s^2]


def spheres(number: int) -> tuple[Physics, list[Primitive]]:
    """Free spheres, all at the origin."""
    arena = Arena()
    props = [Primitive("sphere", (RADIUS,), name=f"sphere_{i}") for i in range(number)]
    for prop in props:
        arena.add_free_entity(prop)
    return Physics.from_entity(arena), props


def touching(physics: Physics, *names: str) -> bool:
    physics.forward()
    pairs = [
        {physics.model.geom(geom).name for geom in (contact.geom1, contact.geom2)}
        for contact in physics.data.contact
        if contact.dist <= 0.0
    ]
    return any(any(name in geom for geom in pair) for pair in pairs for name in names)


def test_props_are_placed_in_the_box_free_of_contacts() -> None:
    physics, props = spheres(8)
    PropPlacer(props, uniform_box(*BOX))(physics, np.random.RandomState(0))
    for prop in props:
        position, quat_wxyz = prop.get_pose(physics)
        assert (position >= BOX[0]).all()
        assert (position <= BOX[1]).all()
        np.testing.assert_array_equal(quat_wxyz, (1.0, 0.0, 0.0, 0.0))
    assert not touching(physics, "sphere")
    assert len({prop.get_pose(physics)[0].tobytes() for prop in props}) == 8


def test_draws_are_those_of_the_random_state() -> None:
    yaw = QuaternionFromAxisAngle((0.0, 0.0, 1.0), Uniform(0.0, 2.0 * np.pi, single_sample=True))
    for kind in (np.random.RandomState, np.random.default_rng):
        physics, props = spheres(1)
        PropPlacer(props, Uniform(*BOX), yaw)(physics, kind(3))
        twin = kind(3)
        position, quat_wxyz = props[0].get_pose(physics)
        np.testing.assert_array_equal(position, twin.uniform(*BOX))
        angle = twin.uniform(0.0, 2.0 * np.pi)
        np.testing.assert_allclose(quat_wxyz, (np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)), atol=1e-15)


def test_samplers_see_the_first_and_the_last_pose() -> None:
    physics, props = spheres(1)
    props[0].set_pose(physics, (0.0, 0.0, 0.5))
    seen = []

    def lower(initial_value: Any, current_value: Any, random_state: Any) -> Any:
        seen.append((initial_value[2], current_value[2]))
        return current_value - (0.0, 0.0, 0.4) if len(seen) > 1 else (0.0, 0.0, 0.01)  # the first is in the floor

    with pytest.raises(EpisodeInitializationError, match="'sphere_0' in 3 attempts"):
        PropPlacer(props, lower, max_attempts_per_prop=3)(physics, np.random.default_rng(0))
    np.testing.assert_allclose(seen, [(0.5, 0.5), (0.5, 0.01), (0.5, -0.39)])
    assert props[0].get_pose(physics)[0][2] == 0.5


def test_failure_names_the_prop_and_changes_nothing() -> None:
    physics, props = spheres(2)
    for number, prop in enumerate(props):
        prop.set_pose(physics, (0.0, 0.1 * number, 0.5))
    before = physics.get_state()
    with pytest.raises(EpisodeInitializationError, match="'sphere_1' in 4 attempts"):
        PropPlacer(props, (0.0, 0.0, 0.1), max_attempts_per_prop=4)(physics, np.random.RandomState(0))
    np.testing.assert_array_equal(physics.get_state(), before)
    PropPlacer(props, (0.0, 0.0, 0.1), ignore_collisions=True)(physics, np.random.RandomState(0))
    assert touching(physics, "sphere")


def test_contacts_with_some_entities_can_be_ignored() -> None:
    physics, (first, second) = spheres(2)
    rng = np.random.RandomState(0)
    here, there = (0.0, 0.0, 0.1), (0.0, 0.1, 0.1)
    PropPlacer([first, second], here, ignore_collisions=True)(physics, rng)
    place_first, place_second = (
        PropPlacer([prop], position, max_attempts_per_prop=1) for prop, position in ((first, here), (second, there))
    )
    with pytest.raises(EpisodeInitializationError, match="sphere_0"):
        place_first(physics, rng)
    place_first(physics, rng, ignore_contacts_with_entities=[second])
    place_second(physics, rng)
    assert not touching(physics, "sphere")


def test_fixed_props_are_moved_too_and_put_back_on_failure() -> None:
    arena, wall, cube = Arena(), Primitive("box", name="wall"), Primitive("box", name="cube")
    arena.attach(wall, position=(0.3, 0.0, 0.1))
    arena.add_free_entity(cube, position=(0.0, 0.0, 0.5))
    physics = Physics.from_entity(arena)
    PropPlacer([wall], (0.2, 0.0, 0.2))(physics, np.random.RandomState(0))
    np.testing.assert_allclose(physics.bind(wall.geom).xpos, (0.2, 0.0, 0.2))
    with pytest.raises(EpisodeInitializationError, match="'cube'"):
        PropPlacer([wall, cube], (0.0, 0.0, 0.3))(physics, np.random.RandomState(0))
    np.testing.assert_allclose(physics.bind(wall.geom).xpos, (0.2, 0.0, 0.2))


def scene_with_arm() -> tuple[Physics, JacoArm, JacoHand, list[Primitive]]:
    arm, hand, arena = JacoArm(), JacoHand(), Arena()
    arm.attach(hand)
    arena.attach(arm, position=robots.ARM_OFFSET)
    cubes = [Primitive("box", name=f"cube_{i}") for i in range(3)]
    for cube in cubes:
        arena.add_free_entity(cube)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    return physics, arm, hand, cubes


def test_settled_props_are_at_rest_and_everything_else_was_held_still() -> None:
    physics, arm, hand, cubes = scene_with_arm()
    other = cubes.pop()
    other.set_pose(physics, (0.3, 0.3, 0.3))  # in the air
    physics.bind(arm.joints).qvel = 0.1
    physics.bind(hand.actuators).ctrl = 0.5
    physics.data.time = 13.0
    joints = physics.bind([*arm.joints, *hand.joints])
    before = joints.qpos.copy(), joints.qvel.copy(), physics.bind(other.freejoint).qpos.copy()
    placer = PropPlacer(cubes, uniform_box((-0.1, -0.1, 0.06), (0.1, 0.1, 0.06)), settle_physics=True)
    placer(physics, np.random.RandomState(0))
    np.testing.assert_array_equal(joints.qpos, before[0])
    np.testing.assert_array_equal(joints.qvel, before[1])
    np.testing.assert_array_equal(physics.bind(other.freejoint).qpos, before[2])
    assert physics.time == 13.0
    for cube in cubes:
        joint = physics.bind(cube.freejoint)
        assert cube.get_pose(physics)[0][2] == pytest.approx(0.02, abs=1e-3)  # on the floor
        assert np.abs(joint.qvel).max() < AT_REST[0]
        assert np.abs(joint.qacc).max() < AT_REST[1]


def test_settling_ends_with_the_first_step_after_which_a_prop_is_at_rest() -> None:
    """Its acceleration is that of where it is: one that is a step old ends a settling too late."""
    physics, props = spheres(1)
    PropPlacer(props, (0.0, 0.0, 0.03), ignore_collisions=True, settle_physics=True)(physics, np.random.default_rng(0))
    other, (prop,) = spheres(1)
    prop.set_pose(other, (0.0, 0.0, 0.03))
    joint = other.bind(prop.freejoint)
    is_at_rest = False
    while not is_at_rest:
        other.step()
        other.forward()
        is_at_rest = np.abs(joint.qvel).max() < AT_REST[0] and np.abs(joint.qacc).max() < AT_REST[1]
    np.testing.assert_array_equal(physics.bind(props[0].freejoint).qvel, joint.qvel)


@pytest.mark.parametrize("attempts", [1, 2, 3])
def test_props_that_do_not_settle_are_placed_again(attempts: int, caplog: pytest.LogCaptureFixture) -> None:
    physics, props = spheres(1)
    heights = itertools.count(1)
    placer = PropPlacer(
        props,
        lambda random_state: (0.0, 0.0, float(next(heights))),
        settle_physics=True,
        max_settle_physics_time=0.01,
        max_settle_physics_attempts=attempts,
    )
    with caplog.at_level(logging.WARNING):
        placer(physics, np.random.RandomState(0))
    assert props[0].get_pose(physics)[0][2] == pytest.approx(attempts, abs=1e-2)
    assert f"did not come to rest in {attempts} attempts of 0.01 s" in caplog.text
    assert physics.time == 0.0


def test_settling_failure_can_be_an_error_that_changes_nothing() -> None:
    physics, props = spheres(1)
    before = physics.get_state()
    placer = PropPlacer(
        props,
        (0.0, 0.0, 1.0),
        settle_physics=True,
        max_settle_physics_time=0.1,
        raise_exception_on_settle_failure=True,
    )
    with pytest.raises(EpisodeInitializationError, match=r"did not come to rest.*velocity 0\.98"):
        placer(physics, np.random.RandomState(0))
    np.testing.assert_array_equal(physics.get_state(), before)


def test_settling_takes_at_least_the_shortest_time() -> None:
    physics, props = spheres(1)
    calls: list[int] = []
    step = physics.step

    def counted(n: int = 1) -> None:
        calls.append(n)
        step(n)

    physics.step = counted  # type: ignore[method-assign]  # counts the steps of the placer
    placer = PropPlacer(props, (0.0, 0.0, RADIUS), ignore_collisions=True, settle_physics=True)
    placer(physics, np.random.RandomState(0))
    needed = sum(calls)
    calls.clear()
    PropPlacer(props, (0.0, 0.0, RADIUS), ignore_collisions=True, settle_physics=True, min_settle_physics_time=1.0)(
        physics, np.random.RandomState(0)
    )
    assert needed < 500 <= sum(calls) <= 502


def test_wrong_arguments_are_refused() -> None:
    physics, props = spheres(1)
    wrong: list[tuple[Any, str]] = [
        (lambda: PropPlacer(None, (0, 0, 0)), "props must be"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: PropPlacer(["cube"], (0, 0, 0)), "props must be"),  # type: ignore[list-item]  # wrong on purpose
        (lambda: PropPlacer(props, lambda: (0, 0, 0)), "position must take"),
        (lambda: PropPlacer(props, (0, 0, 0), max_attempts_per_prop=0), "max_attempts_per_prop must be"),
        (lambda: PropPlacer(props, (0, 0, 0), max_settle_physics_attempts=0), "max_settle_physics_attempts must be"),
        (lambda: PropPlacer(props, (0, 0, 0), max_qvel_tol=True), "max_qvel_tol must be"),
        (lambda: PropPlacer(props, (0, 0, 0), settle_physics=1), "settle_physics must be"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: PropPlacer(props, (0, 0))(physics, np.random.RandomState(0)), "position must have shape"),
        (lambda: PropPlacer(props, (0, 0, 1), (0, 0, 0, 0))(physics, np.random.RandomState(0)), "quaternion"),
        (lambda: PropPlacer(props, (0, 0, 1))(physics, np.random.RandomState(0), 3), "ignore_contacts_with_entities"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: PropPlacer(props, Uniform(single_sample=2)), "single_sample must be"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: PropPlacer(props, (0, 0, 1))(physics, None), "random_state must be"),  # type: ignore[arg-type]  # wrong on purpose
    ]
    before = physics.get_state()
    for call, message in wrong:
        with pytest.raises(InvalidInputError, match=message):
            call()
    np.testing.assert_array_equal(physics.get_state(), before)


def test_props_on_mocap_bodies_are_placed_in_the_state_and_not_in_the_model() -> None:
    arena = Arena()
    fixed = [Primitive("sphere", (RADIUS,), name=f"fixed_{i}") for i in range(3)]
    for prop in fixed:
        arena.attach(prop).mocap = True
    free = Primitive("sphere", (RADIUS,), name="free")
    arena.add_free_entity(free)
    physics = Physics.from_entity(arena)
    assert fixed[0].is_mocap
    assert not free.is_mocap
    before = physics.model.body_pos.copy(), physics.model.body_quat.copy()
    half = RADIUS
    placer = PropPlacer([*fixed, free], uniform_box((-half, -half, 0.03), (half, 4.0 * half, 0.1)))
    for seed in range(5):
        placer(physics, np.random.default_rng(seed))
        poses = [prop.get_pose(physics)[0] for prop in (*fixed, free)]
        for pose in poses[:3]:  # what cannot move does not touch what cannot move
            assert np.linalg.norm(pose - poses[3]) > 2.0 * RADIUS
        np.testing.assert_array_equal(physics.data.mocap_pos, poses[:3])
    np.testing.assert_array_equal(physics.model.body_pos, before[0])
    np.testing.assert_array_equal(physics.model.body_quat, before[1])
