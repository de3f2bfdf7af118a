"""Poses and velocities of entities."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from jacokin.errors import InvalidInputError, PhysicsError
from jacokin.mujoco_bridge import Arena, Physics, Primitive

EXACT = 1e-12
QUARTER_TURN = np.array((np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)))  # about z, wxyz
HALF_TURN_ABOUT_X = np.array((0.0, 1.0, 0.0, 0.0))


def scene() -> tuple[Physics, Primitive, Primitive]:
    arena, cube, wall = Arena(), Primitive(name="cube"), Primitive(name="wall")
    arena.add_free_entity(cube, position=(0.0, 0.0, 0.3))
    arena.attach(wall, position=(0.5, 0.0, 0.1))
    return Physics.from_entity(arena), cube, wall


def test_poses_of_fixed_and_of_free_entities() -> None:
    physics, cube, wall = scene()
    for entity, start in ((cube, (0.0, 0.0, 0.3)), (wall, (0.5, 0.0, 0.1))):
        position, quaternion = entity.get_pose(physics)
        np.testing.assert_allclose(position, start, atol=EXACT)
        np.testing.assert_allclose(quaternion, (1.0, 0.0, 0.0, 0.0), atol=EXACT)
        entity.set_pose(physics, position=(0.1, 0.2, 0.5))
        entity.set_pose(physics, quaternion=QUARTER_TURN)
        position, quaternion = entity.get_pose(physics)
        np.testing.assert_allclose(position, (0.1, 0.2, 0.5), atol=EXACT)
        np.testing.assert_allclose(quaternion, QUARTER_TURN, atol=EXACT)
        np.testing.assert_allclose(physics.bind(entity.geom).xpos, (0.1, 0.2, 0.5), atol=EXACT)
        np.testing.assert_allclose(physics.bind(entity.geom).xmat[3], 1.0, atol=EXACT)
        for wrong in ({"position": (0.0, 0.0)}, {"quaternion": (0.0, 0.0, 0.0, 0.0)}, {"position": (np.nan, 0, 0)}):
            before = physics.get_state()
            with pytest.raises(InvalidInputError):
                entity.set_pose(physics, **wrong)
            np.testing.assert_array_equal(physics.get_state(), before)
    with pytest.raises(PhysicsError, match="not attached"):
        Arena().get_pose(physics)


@pytest.mark.parametrize("which", ["cube", "wall"])
def test_shifting_adds_to_the_position_and_turns_about_fixed_axes(which: str) -> None:
    physics, cube, wall = scene()
    entity = cube if which == "cube" else wall
    entity.set_pose(physics, quaternion=HALF_TURN_ABOUT_X)
    start = entity.get_pose(physics)[0]
    entity.shift_pose(physics, position=(0.1, 0.2, 0.3))
    np.testing.assert_allclose(entity.get_pose(physics)[0], start + np.array((0.1, 0.2, 0.3)), atol=EXACT)
    np.testing.assert_allclose(entity.get_pose(physics)[1], HALF_TURN_ABOUT_X, atol=EXACT)
    entity.shift_pose(physics, quaternion=QUARTER_TURN)
    position, quaternion = entity.get_pose(physics)
    np.testing.assert_allclose(position, start + np.array((0.1, 0.2, 0.3)), atol=EXACT)
    np.testing.assert_allclose(quaternion, (0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0), atol=EXACT)  # first x, then world z
    # The axis x of the shape, which the first turn left alone, points along the world's y.
    np.testing.assert_allclose(physics.bind(entity.geom).xmat.reshape(3, 3)[:, 0], (0.0, 1.0, 0.0), atol=EXACT)


@pytest.mark.parametrize("rotate_velocity", [False, True])
def test_shifting_may_turn_the_velocity(rotate_velocity: bool) -> None:
    physics, cube, _ = scene()
    cube.set_velocity(physics, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
    cube.shift_pose(physics, quaternion=QUARTER_TURN, rotate_velocity=rotate_velocity)
    linear, angular = cube.get_velocity(physics)
    np.testing.assert_allclose(linear, (-2.0, 1.0, 3.0) if rotate_velocity else (1.0, 2.0, 3.0), atol=EXACT)
    np.testing.assert_array_equal(angular, (0.1, 0.2, 0.3))


def test_velocities_are_those_that_the_observables_see() -> None:
    physics, cube, _ = scene()
    cube.set_pose(physics, quaternion=QUARTER_TURN)
    cube.set_velocity(physics, velocity=(0.5, 0.0, 0.0))
    cube.set_velocity(physics, angular_velocity=(1.0, 0.0, 0.0))
    np.testing.assert_allclose(cube.observables.linear_velocity(physics), (0.5, 0.0, 0.0), atol=EXACT)
    # x of the cube is y of the world; the sensor speaks of the world
    np.testing.assert_allclose(cube.observables.angular_velocity(physics), (0.0, 1.0, 0.0), atol=EXACT)
    with physics.disable("gravity"):
        physics.step(100)
    np.testing.assert_allclose(cube.get_pose(physics)[0], (0.1, 0.0, 0.3), atol=1e-9)


def test_what_has_no_velocity_or_pose() -> None:
    physics, cube, wall = scene()
    with pytest.raises(PhysicsError, match="'wall' has no free joint"):
        wall.get_velocity(physics)
    with pytest.raises(PhysicsError, match="'wall' has no free joint"):
        wall.set_velocity(physics, (1.0, 0.0, 0.0))
    with pytest.raises(PhysicsError, match="not attached"):
        Primitive().shift_pose(physics, (0.0, 0.0, 0.1))
    before = physics.get_state()
    wrong: Callable[[], None]
    for wrong in (
        lambda: cube.set_velocity(physics, (1.0, 0.0)),
        lambda: cube.set_velocity(physics, (1.0, 0.0, 0.0), (np.nan, 0.0, 0.0)),
        lambda: cube.shift_pose(physics, (1.0, 0.0, 0.0), (2.0, 0.0, 0.0, 0.0)),
    ):
        with pytest.raises(InvalidInputError):
            wrong()
    np.testing.assert_array_equal(physics.get_state(), before)
