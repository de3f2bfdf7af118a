"""The pillar, the cradle on it, and what rests there."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge import Arena, Brick, Cradle, Pedestal, Physics, Primitive

EXACT = 1e-12
TOP = (0.1, -0.05, 0.15)  # [m]


def test_the_top_is_the_goal_and_the_pillar_is_below_it() -> None:
    arena, pedestal = Arena(), Pedestal(Cradle())
    arena.attach(pedestal, position=TOP)
    physics = Physics.from_entity(arena)
    np.testing.assert_allclose(pedestal.observables.position(physics), TOP, atol=EXACT)
    assert list(pedestal.observables.as_dict()) == ["pedestal/position"]
    pillar = physics.model.geom("pedestal/pillar")
    np.testing.assert_allclose(pillar.size, (0.07, 0.1, 0.0))
    np.testing.assert_allclose(pillar.pos[2] + pillar.size[0] + pillar.size[1], 0.0, atol=EXACT)  # its top
    assert physics.bind(pedestal.target_site).size[0] == 0.05
    pedestal.set_pose(physics, position=(0.0, 0.0, 0.07))
    np.testing.assert_allclose(pedestal.observables.position(physics), (0.0, 0.0, 0.07), atol=EXACT)


def test_a_ball_comes_to_rest_in_the_cradle() -> None:
    arena, pedestal, ball = Arena(), Pedestal(Cradle()), Primitive("sphere", (0.02,), name="ball")
    arena.attach(pedestal, position=TOP)
    arena.add_free_entity(ball, position=(TOP[0] + 0.005, TOP[1], TOP[2] + 0.03))
    physics = Physics.from_entity(arena)
    physics.step(2000)
    position, _ = ball.get_pose(physics)
    np.testing.assert_allclose(position[:2], TOP[:2], atol=1e-3)
    # Three touching spheres: their centres and that of the ball make a tetrahedron.
    height = -0.0343 + np.sqrt((0.049 + 0.02) ** 2 - 0.0343**2)
    np.testing.assert_allclose(position[2], TOP[2] + height, atol=1e-3)
    assert np.linalg.norm(ball.get_velocity(physics)[0]) < 1e-3
    assert physics.model.geom("pedestal/cradle/sphere_0").condim == 6


def test_a_brick_may_be_the_cradle_and_the_whole_is_copied() -> None:
    brick = Brick(name="holder")
    pedestal = Pedestal(brick, target_radius=0.03)
    arena = Arena()
    arena.attach(pedestal, position=TOP)
    assert brick.studs[0, 0].name == "pedestal/holder/stud_00"
    for twin in (copy.deepcopy(arena), pickle.loads(pickle.dumps(arena))):
        assert [each.prefix for each in twin.iter_entities()] == ["", "pedestal/", "pedestal/holder/"]
        physics = Physics.from_entity(twin)
        np.testing.assert_allclose(physics.data.site("pedestal/target").xpos, TOP, atol=EXACT)
    pedestal.detach()
    arena.attach(pedestal, position=(0.0, 0.0, 0.1))
    assert Physics.from_entity(arena).model.site("pedestal/holder/stud_00").id >= 0


def test_what_cannot_be_a_cradle() -> None:
    with pytest.raises(InvalidInputError, match="cradle must be an Entity"):
        Pedestal("cradle")
    with pytest.raises(InvalidInputError, match="target_radius"):
        Pedestal(target_radius=0.0)
    taken = Cradle()
    Arena().attach(taken)
    with pytest.raises(InvalidInputError, match="attached to 'arena' already"):
        Pedestal(taken)
